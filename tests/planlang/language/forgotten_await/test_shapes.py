"""What may become of a coroutine that nobody awaits: each mistake is found, and what is none is let be."""

# ruff: noqa: E501 - a plan in a line

from __future__ import annotations

import pytest
from written_plan import WrittenPlan, line_of

from planlang import DeadlockError, PlanStructureError
from planlang.failures import GraspMissed

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
    shape: str, written: WrittenPlan
) -> None:
    code, wrong, right = MISTAKES[shape]
    with pytest.raises(PlanStructureError) as caught:
        written(code)
    first, *contrast = str(caught.value).splitlines()
    assert contrast == [f"  wrong: {wrong}", f"  right: {right}"]
    assert "without await, so nothing was done" in first
    if wrong != "sleep(...)":
        assert f"a_plan.py:{line_of(code, wrong)} " in first


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
def test_a_run_that_fails_of_something_else_prints_nothing_about_coroutines(shape: str, written: WrittenPlan) -> None:
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
    shape: str, written: WrittenPlan
) -> None:
    assert written(LEGITIMATE[shape]) is None
