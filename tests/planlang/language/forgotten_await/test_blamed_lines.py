"""Which lines are named for a coroutine that nobody awaited."""

from __future__ import annotations

import ast
import sys
import textwrap
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from written_plan import WrittenPlan, line_of, shows

from planlang import PlanStructureError, VirtualHost, plan, run, sleep
from planlang.failures import GraspMissed
from planlang.kernel import suspects


def go(body: Any, **options: Any) -> Any:
    return run(body, host=VirtualHost(), **options)


async def reach() -> str:
    await sleep(1)
    return "reached"


@plan
async def serve(*, cup: str = "a") -> None:
    await sleep(1)


async def fails() -> None:
    raise GraspMissed


def test_where_several_lines_can_have_made_it_all_are_named(written: WrittenPlan) -> None:
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
def test_a_line_that_calls_with_other_arguments_is_not_named(other: str, own: str, written: WrittenPlan) -> None:
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


def test_a_line_that_calls_what_hands_over_an_argument_of_its_own_is_named(written: WrittenPlan) -> None:
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


def test_lines_of_functions_that_exist_no_more_are_not_named(written: WrittenPlan) -> None:
    code = "def old():\n    async def f(): reach()\nold()\nHELD.append(reach())\nHELD.clear()\nawait sleep(1)"
    with pytest.raises(PlanStructureError, match=rf"a_plan\.py:{line_of(code, 'HELD')} calls"):
        written(code)


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
