"""A forgotten await ends the task or the run with the line that made the coroutine, whatever became of it."""

# ruff: noqa: E501 - a plan in a line

from __future__ import annotations

import ast
import asyncio
import gc
import queue
import subprocess
import sys
import textwrap
import threading
import warnings
import weakref
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import planlang
from planlang import (
    DeadlockError,
    PlanStructureError,
    VirtualHost,
    checkpoint,
    now,
    par,
    plan,
    run,
    seq,
    sleep,
    try_all,
    wait_for,
)
from planlang.failures import GraspMissed
from planlang.kernel import forgotten, suspects

HEAD = """\
from functools import partial
import gc, planlang, time
from planlang import *
from planlang.failures import *

HELD = []
class Thing: pass

async def reach(cup="a"):
    await sleep(1)
    return "reached"

@plan
async def serve(*, cup="a"):
    await sleep(1)

async def misses():
    raise GraspMissed

async def errs():
    raise ValueError

@plan
async def body():
"""

Written = Callable[[str], Any]


@pytest.fixture
def written(tmp_path: Path) -> Iterator[Written]:
    """Runs the body of a plan that stands in a file; nothing may be printed about coroutines, then or later."""
    space: dict[str, Any] = {"__name__": "a_plan"}

    def go(code: str) -> Any:
        file = tmp_path / "a_plan.py"
        file.write_text(HEAD + textwrap.indent(code, "    "))
        exec(compile(file.read_text(), str(file), "exec"), space)
        return run(space["body"], host=VirtualHost())

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield go
        space.clear()
        gc.collect(1)
    assert [str(one.message) for one in caught] == []


def line_of(code: str, text: str) -> int:
    """In which line of the file a text of the body stands."""
    return HEAD.count("\n") + code[: code.index(text)].count("\n") + 1


def go(body: Any, **options: Any) -> Any:
    return run(body, host=VirtualHost(), **options)


async def reach() -> str:
    await sleep(1)
    return "reached"


@plan
async def serve(*, cup: str = "a") -> None:
    await sleep(1)


def shows(wrong: str, right: str) -> str:
    """A pattern for the two lines of an error."""
    import re

    return f"(.|\n)*wrong: {re.escape(wrong)}\n  right: {re.escape(right)}"


# -- a forgotten await


def test_a_forgotten_await_is_an_error_at_the_next_checkpoint_with_its_line() -> None:
    times: list[float] = []

    async def body() -> None:
        await sleep(1)
        sleep(5)  # the mistake
        times.append(now())
        await sleep(1)
        times.append(now())

    with pytest.raises(
        PlanStructureError, match=r"test_forgotten_await\.py:\d+ calls sleep\(\) without await"
    ) as caught:
        go(body)
    assert "  wrong: sleep(5)  # the mistake\n  right: await sleep(5)  # the mistake" in str(caught.value)
    assert times == [1.0]


def test_a_forgotten_await_of_a_plan_function_is_named_by_the_plan() -> None:
    async def body() -> None:
        serve(cup="b")
        await sleep(1)

    with pytest.raises(PlanStructureError, match=shows('serve(cup="b")', 'await serve(cup="b")')):
        go(body)


def test_a_forgotten_await_of_a_name_in_a_module_is_shown_as_a_whole() -> None:
    async def body() -> None:
        planlang.par(reach, reach)
        await sleep(1)

    with pytest.raises(
        PlanStructureError, match=shows("planlang.par(reach, reach)", "await planlang.par(reach, reach)")
    ):
        go(body)


def test_a_forgotten_await_at_the_end_of_a_branch_is_an_error_too() -> None:
    async def body() -> None:
        await sleep(1)
        sleep(1)

    with pytest.raises(PlanStructureError, match=shows("sleep(1)", "await sleep(1)")):
        go(partial(par, body, partial(sleep, 9)))


def test_a_forgotten_await_before_a_failure_beats_the_failure() -> None:
    async def body() -> None:
        reach()
        raise GraspMissed

    with pytest.raises(PlanStructureError, match="reach"):
        go(partial(try_all, body, partial(sleep, 9)))


def test_a_forgotten_await_in_a_branch_evaporates_the_others() -> None:
    log: list[str] = []

    async def forgets() -> None:
        await sleep(1)
        reach()
        await checkpoint()
        log.append("went on")

    async def other() -> None:
        try:
            await sleep(9)
        finally:
            log.append(f"stopped {now():g}")

    with pytest.raises(PlanStructureError):
        go(partial(par, forgets, other))
    assert log == ["stopped 1"]


def test_every_checkpoint_raises_what_was_forgotten_before_it() -> None:
    fluent = planlang.Fluent(True)
    for waits in (checkpoint, partial(sleep, 0), partial(wait_for, fluent), partial(par, reach), partial(seq)):

        async def body(waits: Any = waits) -> None:
            reach()
            await waits()
            raise AssertionError

        with pytest.raises(PlanStructureError, match=r"without await"):
            go(body)


def test_outside_of_plans_python_warns_as_ever() -> None:
    go(reach)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        reach()
        gc.collect()
    assert [str(one.message) for one in caught] == ["coroutine 'reach' was never awaited"]


def test_a_coroutine_that_is_closed_is_not_forgotten() -> None:
    async def body() -> str:
        reach().close()
        await sleep(1)
        return "done"

    assert go(body) == "done"


def test_a_coroutine_kept_and_awaited_later_is_not_forgotten() -> None:
    async def body() -> str:
        later = reach()
        await sleep(1)
        return await later

    assert go(body) == "reached"


def test_returning_a_call_instead_of_its_result_is_an_error() -> None:
    async def body() -> Any:
        return reach()

    with pytest.raises(PlanStructureError, match=shows("return reach(...)", "return await reach(...)")):
        go(partial(par, body))


def test_a_forgotten_await_prints_nothing_and_leaves_nothing_unclosed() -> None:
    code = (
        "from planlang import *\n"
        "async def body():\n    sleep(1)\n    await sleep(1)\n"
        "try:\n    run(body, host=VirtualHost())\nexcept PlanStructureError as error:\n    print(type(error))\n"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    assert (ended.stdout, ended.stderr) == ("<class 'planlang.misuse.PlanStructureError'>\n", "")


async def fails() -> None:
    raise GraspMissed


# -- what may become of the coroutine

MISTAKES = {
    # code, wrong line, right line
    "assigned": ("x = sleep(5)\nawait sleep(1)", "x = sleep(5)", "x = await sleep(5)"),
    "assigned last": ("await sleep(1)\nx = sleep(5)", "x = sleep(5)", "x = await sleep(5)"),
    "assigned before another": ("x = sleep(1)\nx = await sleep(2)", "x = sleep(1)", "x = await sleep(1)"),
    "assigned to two": ("a, b = reach(), 3\nawait sleep(1)", "a, b = reach(), 3", "a, b = await reach(), 3"),
    "read": ("x = reach()\nstr(x)\nawait sleep(1)", "x = reach()", "x = await reach()"),
    "list": ("xs = [sleep(5)]\nawait sleep(1)", "xs = [sleep(5)]", "xs = [await sleep(5)]"),
    "dict": ("d = {1: sleep(5)}\nawait sleep(1)", "d = {1: sleep(5)}", "d = {1: await sleep(5)}"),
    "argument": ("str(sleep(5))\nawait sleep(1)", "str(sleep(5))", "str(await sleep(5))"),
    "comparison": ("sleep(5) == 3\nawait sleep(1)", "sleep(5) == 3", "await sleep(5) == 3"),
    "attribute": ("reach().cr_code\nawait sleep(1)", "reach().cr_code", "(await reach()).cr_code"),
    "attribute in lines": ("reach(\n).cr_code\nawait sleep(1)", "reach(", "await reach("),
    "test": ("if sleep(5): pass\nawait sleep(1)", "if sleep(5): pass", "if await sleep(5): pass"),
    "conditional": (
        "x = sleep(5) if HELD else reach()\nawait sleep(1)",
        "x = sleep(5) if HELD else reach()",
        "x = sleep(5) if HELD else await reach()",
    ),
    "walrus": (
        "if (x := sleep(5)): pass\nawait sleep(1)",
        "if (x := sleep(5)): pass",
        "if (x := await sleep(5)): pass",
    ),
    "annotated": ("x: object = reach()\nawait sleep(1)", "x: object = reach()", "x: object = await reach()"),
    "class": ("class A: x = reach()\ndel A.x\nawait sleep(1)", "class A: x = reach()", "class A: x = await reach()"),
    "f-string": ("f'{sleep(5)}'\nawait sleep(1)", "f'{sleep(5)}'", "f'{await sleep(5)}'"),
    "walrus as argument": ("str(x := sleep(5))\nawait sleep(1)", "str(x := sleep(5))", "str(x := await sleep(5))"),
    "or": ("reach() or reach()\nawait sleep(1)", "reach() or reach()", "await reach() or reach()"),
    "default": (
        "def f(x=sleep(55)): pass\nawait sleep(1)",
        "def f(x=sleep(55)): pass",
        "def f(x=await sleep(55)): pass",
    ),
    "returned in a list": ("return [reach()]", "return [reach()]", "return [await reach()]"),
    "global": ("HELD.append(sleep(5))\nawait sleep(1)", "HELD.append(sleep(5))", "HELD.append(await sleep(5))"),
    "held": ("HELD.append(sleep(5))", "HELD.append(sleep(5))", "HELD.append(await sleep(5))"),
    "held of ours": ("HELD.append(serve())", "HELD.append(serve())", "HELD.append(await serve())"),
    "held and let go": (
        "HELD.append(reach())\nHELD.clear()\nawait sleep(1)",
        "HELD.append(reach())",
        "HELD.append(await reach())",
    ),
    "closure": ("x = sleep(5)\nHELD.append(lambda: x)", "x = sleep(5)", "x = await sleep(5)"),
    "object": (
        "c = Thing(); c.x = serve(); HELD.append(c)",
        "c = Thing(); c.x = serve(); HELD.append(c)",
        "c = Thing(); c.x = await serve(); HELD.append(c)",
    ),
    "cycle": (
        "c = Thing(); c.me = c; c.x = serve()",
        "c = Thing(); c.me = c; c.x = serve()",
        "c = Thing(); c.me = c; c.x = await serve()",
    ),
    "cycle collected": (
        "c = Thing(); c.me = c\nx = reach()\nc.x = lambda: x\ndel c\ngc.collect(1)\nx = 3\nawait sleep(1)",
        "x = reach()",
        "x = await reach()",
    ),
    "collected and certain": (
        "async def b():\n    x = reach()\n    raise GraspMissed\ntry:\n    await b()\n"
        "except GraspMissed as e:\n    e.me = e\ngc.collect(1)\nawait sleep(1)",
        "x = reach()",
        "x = await reach()",
    ),
    "kept with a traceback": (
        "async def b():\n    x = reach()\n    raise GraspMissed\ntry:\n    await b()\n"
        "except GraspMissed as e:\n    HELD.append(e)\nawait sleep(1)",
        "x = reach()",
        "x = await reach()",
    ),
    "cleanup": ("try:\n    await sleep(1)\nfinally:\n    sleep(5)", "sleep(5)", "await sleep(5)"),
    "cleanup of an evaporated task": (
        "async def b():\n    try:\n        await sleep(9)\n    finally:\n        reach()\n"
        "await pursue(b, partial(sleep, 1))",
        "reach()",
        "await reach()",
    ),
    "assigned in a cleanup": (
        "async def b():\n    try:\n        await sleep(9)\n    finally:\n        x = reach()\n"
        "await pursue(b, partial(sleep, 1))",
        "x = reach()",
        "x = await reach()",
    ),
    "unwind_protect": (
        "async def c():\n    reach()\nawait unwind_protect(partial(sleep, 1), c)",
        "reach()",
        "await reach()",
    ),
    "policy": (
        "async def c():\n    x = reach()\nawait with_policies([Policy('p', clean_up=c)], partial(sleep, 1))",
        "x = reach()",
        "x = await reach()",
    ),
    "recovery": (
        "async def do(f):\n    x = reach()\n    return Return(3)\n"
        "await with_failure_handling(misses, Recovery(GraspMissed, do))",
        "x = reach()",
        "x = await reach()",
    ),
    "branch": ("async def b():\n    x = reach()\nawait par(b, partial(sleep, 2))", "x = reach()", "x = await reach()"),
    "dropped between turns": (
        "async def b():\n    return [reach()]\nawait pursue(partial(sleep, 0), b)\nawait sleep(1)",
        "return [reach()]",
        "return [await reach()]",
    ),
    "evaporated, but nothing reads it": (
        "async def b():\n    x = reach()\n    await sleep(9)\nawait pursue(b, partial(sleep, 1))",
        "x = reach()",
        "x = await reach()",
    ),
    "several lines": ("x = serve(\n    cup='b',\n)\nawait sleep(1)", "x = serve(", "x = await serve("),
    "as an attribute of a module": (
        "x = planlang.sleep(4)\nawait sleep(1)",
        "x = planlang.sleep(4)",
        "x = await planlang.sleep(4)",
    ),
    "one of two": ("x = sleep(5)\ny = sleep(6)\ny.close()\nawait sleep(1)", "x = sleep(5)", "x = await sleep(5)"),
    "beside what has another name here": (
        "time.sleep(0)\nx = sleep(0)\nawait sleep(1)",
        "x = sleep(0)",
        "x = await sleep(0)",
    ),
    "by its arguments": (
        "async def f(): return [sleep(3, ), sleep(4)]\nx, y = await f()\nawait x\ndel y\nawait sleep(1)",
        "async def f(): return [sleep(3, ), sleep(4)]",
        "async def f(): return [sleep(3, ), await sleep(4)]",
    ),
    "lambda": (
        "f = lambda: sleep(5)\nf()\nawait sleep(1)",
        "f = lambda: sleep(5)",
        "await sleep(...), or await what the lambda gives",
    ),
    "plain function": (
        "def f():\n    sleep(5)\nf()\nawait sleep(1)",
        "sleep(5)",
        "await sleep(...)    in async def f, and await f(...)",
    ),
    "generator": (
        "list(sleep(i) for i in range(2))\nawait sleep(1)",
        "list(sleep(i) for i in range(2))",
        "await sleep(...)    in a loop or in brackets: [await ... for ... in ...]",
    ),
    "another name": ("nap = sleep\nnap(3)\nawait sleep(1)", "sleep(...)", "await sleep(...)"),
    "held beside our own with": (
        "async with using('arm'):\n    HELD.append(sleep(5))",
        "HELD.append(sleep(5))",
        "HELD.append(await sleep(5))",
    ),
    "thread": (
        "await in_thread(lambda: [sleep(1)] and None)",
        "await in_thread(lambda: [sleep(1)] and None)",
        "await sleep(...), or await what the lambda gives",
    ),
}


@pytest.mark.parametrize("shape", MISTAKES)
def test_a_forgotten_await_is_an_error_with_its_line_whatever_becomes_of_the_coroutine(
    shape: str, written: Written
) -> None:
    code, wrong, right = MISTAKES[shape]
    with pytest.raises(PlanStructureError) as caught:
        written(code)
    first, *contrast = str(caught.value).splitlines()
    assert contrast == [f"  wrong: {wrong}", f"  right: {right}"]
    assert "without await, so nothing was done" in first
    if wrong != "sleep(...)":
        assert f"a_plan.py:{line_of(code, wrong)} " in first


def test_a_search_for_which_the_stack_has_no_room_prints_nothing(
    monkeypatch: pytest.MonkeyPatch, written: Written
) -> None:
    def no_more(*_: object) -> None:
        raise RecursionError

    monkeypatch.setattr(forgotten, "suspects", no_more)
    assert written("reach()\nawait sleep(1)") is None


FOREIGN: dict[str, tuple[str, type[BaseException]]] = {
    "async for": ("async for x in reach(): pass", TypeError),
    "async with": ("async with reach(): pass", TypeError),
    "values": ("await par_each(sleep(1), reach)", TypeError),
    "raise": ("raise reach()", TypeError),
    "recursion": ("async def r(n): await r(n + 1)\nawait r(0)", RecursionError),
    "recursion by a construct": ("async def r(): await seq(lambda: r())\nawait r()", RecursionError),
    "held by a failed run": ("HELD.append(reach())\nHELD.append(sleep(1))\nraise GraspMissed", GraspMissed),
    "deadlock": ("x = reach()\nawait wait_for(Fluent(False))", DeadlockError),
}


@pytest.mark.parametrize("shape", FOREIGN)
def test_a_run_that_fails_of_something_else_prints_nothing_about_coroutines(shape: str, written: Written) -> None:
    code, error = FOREIGN[shape]
    with pytest.raises(error):
        written(code)


LEGITIMATE = {
    "later": "x = reach()\nawait sleep(1)\nassert await x == 'reached'",
    "list": "xs = [reach(), reach()]\nfor x in xs: await x",
    "handed on": "async def h(c): return await c\nassert await h(reach()) == 'reached'",
    "chosen": "await (reach() if HELD is not None else sleep(1))",
    "walrus": "await (x := reach())",
    "closed": "reach().close()\nawait sleep(1)",
    "evaporated": "async def b():\n    x = reach()\n    await sleep(9)\n    await x\nawait pursue(b, partial(sleep, 1))",
    "evaporated where it was handed on": "async def h(c):\n    await sleep(9)\n    await c\nasync def b():\n    await h(reach())\n"
    "await pursue(b, partial(sleep, 1))",
    "evaporated in the same expression": "async def b():\n    x = (reach(), await sleep(9))\n    await x[0]\n"
    "await pursue(b, partial(sleep, 1))",
    "timed out": "async def b():\n    x = reach()\n    await sleep(9)\n    await x\n"
    "try:\n    await timeout(1, b)\nexcept Timeout: pass",
    "failed": "async def b():\n    x = reach()\n    await misses()\n    await x\n"
    "try:\n    await b()\nexcept GraspMissed: pass\nawait sleep(1)",
    "failed in the same expression": "async def b():\n    x = (reach(), await misses())\n    await x[0]\n"
    "try:\n    await b()\nexcept GraspMissed: pass\nawait sleep(1)",
    "failed, kept": "async def b():\n    x = [reach()]\n    await misses()\n    await x[0]\n"
    "try:\n    await b()\nexcept GraspMissed as e: HELD.append(e)\nawait sleep(1)",
    "failed, collected": "async def b():\n    x = reach()\n    await misses()\n    await x\n"
    "try:\n    await b()\nexcept GraspMissed as e: e.me = e\ngc.collect(1)\nawait sleep(1)",
    "retried": "n = []\nasync def b():\n    x = reach()\n    n.append(1)\n    if len(n) < 3: await misses()\n    await x\n"
    "await with_failure_handling(b, Recovery(GraspMissed, attempts=5))",
    "others tried": "async def b():\n    x = reach()\n    await misses()\n    await x\nawait try_all(b, partial(sleep, 2))\n"
    "await try_in_order(b, partial(sleep, 1))",
    "an error": "async def b():\n    x = reach()\n    await errs()\n    await x\n"
    "try:\n    await b()\nexcept ValueError: pass\nawait sleep(1)",
    "an error with a name": "async def b():\n    x = reach()\n    await errs()\n    await x\n"
    "try:\n    await b()\nexcept ValueError as e: str(e)\nawait sleep(1)",
    "branches": "await par(lambda: reach(), lambda: serve(cup='x'))",
    "failed among several": "cs = [reach(), misses(), reach('c')]\ntry: return [await c for c in cs] and None\n"
    "except GraspMissed: return",
    "failed in a loop": "try:\n    for c in [reach(), misses(), reach('c')]: await c\n"
    "except GraspMissed: pass\nawait sleep(1)",
    "failed in a loop over what is left": "cs = [reach(), misses(), reach('c')]\ntry:\n    while cs: await cs.pop(0)\n"
    "except GraspMissed: pass\nawait sleep(1)",
    "left a loop at a failure": "for c in [reach(), misses(), reach('c')]:\n    try: await c\n"
    "    except GraspMissed: break\nawait sleep(1)",
    "made anew in a loop": "for n in range(3):\n    c = reach()\n    try:\n        if n < 2: await misses()\n        await c\n"
    "    except GraspMissed: pass\nawait sleep(1)",
    "evaporated in a comprehension": "async def b(): return [await c for c in [reach(), reach('b')]]\n"
    "await pursue(b, partial(sleep, 0.5))\nawait sleep(1)",
    "suppressed": "import contextlib\nwith contextlib.suppress(GraspMissed):\n    c = reach()\n    await misses()\n    await c\n"
    "await sleep(1)",
    "failed in the next argument": "def boom(): raise GraspMissed\nasync def two(a, b): await a\n"
    "try: await two(reach(), boom())\nexcept GraspMissed: pass\nawait sleep(1)",
    "handed to what does not enter": "class M:\n    def __init__(self, c): self.c = c\n    async def __aenter__(self): raise GraspMissed\n"
    "    async def __aexit__(self, *_): pass\ntry:\n    async with M(reach()): pass\nexcept GraspMissed: pass\nawait sleep(1)",
}


@pytest.mark.parametrize("shape", LEGITIMATE)
def test_a_coroutine_made_first_to_be_awaited_later_is_no_mistake_also_when_it_does_not_come_to_that(
    shape: str, written: Written
) -> None:
    assert written(LEGITIMATE[shape]) is None


def test_where_several_lines_can_have_made_it_all_are_named(written: Written) -> None:
    code = "async def f(n):\n    if n: return [reach()]\n    return [reach()]\ndel (await f(0))[0]\nawait sleep(1)"
    with pytest.raises(PlanStructureError) as caught:
        written(code)
    first, second = (line_of(code, text) for text in ("if n", "    return [reach()]\ndel"))
    assert (
        f"one of these lines calls reach() without await, so nothing was done: a_plan.py:{first}, a_plan.py:{second}"
        in (str(caught.value))
    )


@pytest.mark.parametrize(
    ("other", "own"),
    [
        ("reach()", 'reach("b")'),
        ("reach(cup=CUP, glass=CUP)", "reach()"),
        ("serve()", "serve(cup=CUP)"),
        ("serve(cup=CUP)", "serve()"),
        ("several()", "several(CUP, 2)"),
        ("several(CUP, CUP, CUP)", "several(CUP, 2)"),
        ("several(CUP, x=CUP)", "several(CUP, y=CUP)"),
        ("reach(CUP, CUP)", "reach(*[CUP])"),
        ("reach(glass=CUP)", "reach(**{'cup': CUP})"),
    ],
)
def test_a_line_that_calls_with_other_arguments_is_not_named(other: str, own: str, written: Written) -> None:
    code = f"""\
        global CUP, several, unused
        CUP = object()
        async def several(first="a", *others, **named): pass
        def unused(): {other}
        kept = {own}
        del kept
        await sleep(1)"""
    code = textwrap.dedent(code)
    with pytest.raises(PlanStructureError, match=rf"a_plan\.py:{line_of(code, f'kept = {own}')} calls"):
        written(code)


def test_a_line_that_calls_what_hands_over_an_argument_of_its_own_is_named(written: Written) -> None:
    code = """\
        global reach_b
        import functools
        def handing(function):
            @functools.wraps(function)
            def call(): return function("b")
            return call
        reach_b = handing(reach)
        kept = reach_b()
        del kept
        await sleep(1)"""
    code = textwrap.dedent(code)
    with pytest.raises(PlanStructureError, match=rf"a_plan\.py:{line_of(code, 'kept = ')} calls"):
        written(code)


def test_lines_of_functions_that_exist_no_more_are_not_named(written: Written) -> None:
    code = "def old():\n    async def f(): reach()\nold()\nHELD.append(reach())\nHELD.clear()\nawait sleep(1)"
    with pytest.raises(PlanStructureError, match=rf"a_plan\.py:{line_of(code, 'HELD')} calls"):
        written(code)


def test_a_run_beside_another_in_a_thread_leaves_alone_what_may_be_the_others() -> None:
    held: list[Any] = []
    inside, leave = threading.Event(), threading.Event()

    async def waits() -> None:
        inside.set()
        leave.wait(10)

    async def holds() -> str:
        held.append(reach())
        return "done"

    async def fails_holding() -> None:
        held.append(reach())
        raise GraspMissed

    other = threading.Thread(target=lambda: go(waits))
    other.start()
    inside.wait(10)
    try:
        assert go(holds) == "done"
        with pytest.raises(GraspMissed):
            go(fails_holding)
    finally:
        leave.set()
        other.join()
    for one in held:
        one.close()


@pytest.mark.parametrize("fails", [False, True])
@pytest.mark.parametrize("how", ["queue", "loop", "running"])
def test_what_was_handed_to_another_thread_is_awaited_there_after_the_run(how: str, fails: bool) -> None:
    ran: list[str] = []
    ended, taken = threading.Event(), threading.Event()
    waiting: queue.Queue[Any] = queue.Queue()

    async def work() -> None:
        ran.append(how)

    def works() -> None:
        if how == "queue":
            ended.wait(10)
        coroutine = waiting.get()
        taken.set()
        ended.wait(10)
        asyncio.run(coroutine)

    loop = asyncio.new_event_loop()

    async def body() -> str:
        if how == "loop":
            asyncio.run_coroutine_threadsafe(work(), loop)
        else:
            waiting.put(work())
        if how == "running":
            taken.wait(10)
        if fails:
            raise GraspMissed
        return "done"

    other = threading.Thread(target=works if how != "loop" else lambda: None)
    other.start()
    if fails:
        with pytest.raises(GraspMissed):
            go(body)
    else:
        assert go(body) == "done"
    ended.set()
    other.join()
    loop.call_soon(loop.stop)
    loop.run_forever()
    loop.run_until_complete(asyncio.sleep(0))
    loop.close()
    assert ran == [how]


def test_what_was_made_before_the_run_is_pythons_own_matter() -> None:
    early = [reach()]

    async def body() -> str:
        early.clear()
        await sleep(1)
        return "done"

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        assert go(body) == "done"
    assert [str(one.message) for one in caught] == ["coroutine 'reach' was never awaited"]


def test_what_was_made_before_the_run_hides_nothing_that_the_run_forgets() -> None:
    early = [reach() for _ in range(50)]

    async def body() -> None:
        while early:
            early.pop().close()
        reach()
        await sleep(1)

    with pytest.raises(PlanStructureError, match="without await"):
        go(body)


def test_what_survived_a_collection_of_garbage_is_found_too(written: Written) -> None:
    with pytest.raises(PlanStructureError, match=shows("HELD.append(sleep(5))", "HELD.append(await sleep(5))")):
        written("HELD.append(sleep(5))\ngc.collect(0)")


def test_coroutines_of_strangers_are_left_alone() -> None:
    space: dict[str, Any] = {}
    exec("async def foreign(): pass\ndef make(f): return f()", space)
    held: list[Any] = []

    async def body() -> str:
        held.append(space["make"](space["foreign"]))
        return "done"

    async def fails() -> None:
        held.append(space["make"](space["foreign"]))
        raise GraspMissed

    assert go(body) == "done"
    with pytest.raises(GraspMissed):
        go(fails)
    for one in held:
        assert one.cr_frame is not None
        one.close()


def test_the_second_of_two_mistakes_is_not_printed_either(written: Written) -> None:
    with pytest.raises(PlanStructureError, match=shows("reach('b')", "await reach('b')")):
        written("reach('b')\nreach('c')\nawait sleep(1)")


def test_each_file_of_a_large_project_is_read_once(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for number in range(100):
        name = f"a_part_{number}_of_a_large_project"
        file = tmp_path / f"{name}.py"
        file.write_text(f"def part_{number}():\n    reach()\n")
        module = ModuleType(name)
        module.__file__ = str(file)
        monkeypatch.setitem(sys.modules, name, module)
    parsed: list[str] = []

    class Counting(suspects._Tree):
        def __init__(self, module: ast.Module) -> None:
            parsed.append("once")
            super().__init__(module)

    async def body() -> int:
        await drops()
        before = len(parsed)
        for _ in range(3):
            await drops()
        return len(parsed) - before

    async def drops() -> None:
        later = reach()
        try:
            await fails()
            await later
        except GraspMissed:
            pass

    monkeypatch.setattr(suspects, "_Tree", Counting)
    assert go(body) == 0
    assert len(parsed) >= 100


def test_lines_of_files_that_nothing_leads_to_are_not_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "far_away.py"
    file.write_text("from planlang import sleep\nlater = lambda: sleep(3)\n")
    module = ModuleType("far_away")
    module.__file__ = str(file)
    exec(compile(file.read_text(), file, "exec"), vars(module))
    monkeypatch.setitem(sys.modules, "far_away", module)
    space: dict[str, Any] = {"sleep": sleep}
    exec("async def body():\n    sleep(3)\n    await sleep(1)\n", space)
    with pytest.raises(PlanStructureError, match="<string>:2 calls"):
        go(space["body"])


def test_without_source_the_name_alone_tells() -> None:
    space: dict[str, Any] = {"sleep": sleep}
    exec("async def body():\n    sleep(3)\n    await sleep(1)\n", space)
    with pytest.raises(PlanStructureError, match="<string>:2 calls" + shows("sleep(...)", "await sleep(...)")):
        go(space["body"])


def test_source_that_has_become_wrong_since_does_not_matter(tmp_path: Path) -> None:
    file = tmp_path / "changed.py"
    file.write_text("async def body(:\n")
    space: dict[str, Any] = {"sleep": sleep}
    exec(compile("async def body():\n    sleep(3)\n    await sleep(1)\n", str(file), "exec"), space)
    with pytest.raises(PlanStructureError, match=r"changed\.py:2 calls" + shows("sleep(...)", "await sleep(...)")):
        go(space["body"])


def test_without_the_interpreters_hook_nothing_is_watched(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(forgotten._Watch, "warn", None)
    monkeypatch.delattr(warnings, "_warn_unawaited_coroutine")
    forgotten.watch()
    assert not hasattr(warnings, "_warn_unawaited_coroutine")
    coroutine = reach()
    forgotten._dropped(coroutine)
    coroutine.close()


def test_dead_proxies_among_the_objects_of_a_process_do_no_harm() -> None:
    class Thing:
        pass

    thing = Thing()
    proxy = weakref.proxy(thing)
    del thing

    async def body() -> int:
        await sleep(1)
        return 3

    assert go(body) == 3
    assert type(proxy) is weakref.ProxyType
