"""Forgotten awaits whose maker is hard to find: under another name, in a file that has changed, among many."""

from __future__ import annotations

import gc
import subprocess
import sys
import textwrap
from collections.abc import Callable, Coroutine
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from planlang import PlanStructureError, VirtualHost, run, sleep


async def reach() -> None:
    await sleep(1)


Plan = Callable[[], Coroutine[Any, Any, Any]]
Written = Callable[[str], Plan]


@pytest.fixture
def written(tmp_path: Path) -> Written:
    """The plan of a body that stands in a file; it knows ``reach``, and ``here``, the path of the file."""

    def made(code: str) -> Plan:
        file = tmp_path / "a_plan.py"
        text = "async def body():\n" + textwrap.indent(textwrap.dedent(code), "    ")
        file.write_text(text)
        space: dict[str, Any] = {"sleep": sleep, "reach": reach, "here": file}
        exec(compile(text, str(file), "exec"), space)
        plan: Plan = space["body"]
        return plan

    return made


def test_a_call_is_found_under_the_name_that_another_module_has_for_the_function(
    written: Written, monkeypatch: pytest.MonkeyPatch
) -> None:
    near = ModuleType("near")
    near.approach = reach  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "near", near)
    body = written("global near\nimport near\nnear.approach()\nawait sleep(1)\n")
    with pytest.raises(PlanStructureError, match=r"a_plan\.py:4 calls reach\(\)(.|\n)*right: await near\.approach\(\)"):
        run(body, host=VirtualHost())


def test_a_file_that_is_no_longer_a_program_leads_to_no_line_but_the_call_is_told(written: Written) -> None:
    body = written("here.write_text('reach(')\nreach()\nawait sleep(1)\n")
    with pytest.raises(PlanStructureError, match=r"a_plan\.py:3 calls reach\(\) without await"):
        run(body, host=VirtualHost())


def test_one_forgotten_call_is_found_among_thousands_that_are_closed() -> None:
    kept: list[Any] = []

    async def closed() -> None:
        await sleep(1)

    async def forgotten() -> None:
        await sleep(1)

    async def body() -> None:
        for _ in range(3):
            many = [closed() for _ in range(700)]
            gc.collect(0)
            for one in many:
                one.close()
        kept.append(forgotten())
        gc.collect(0)
        await sleep(1)

    with pytest.raises(PlanStructureError, match=r"kept\.append\(await forgotten\(\)\)"):
        run(body, host=VirtualHost())


EARLY = """
import gc
from planlang import VirtualHost, run, sleep

async def reach():
    await sleep(1)

early = [reach()]
gc.collect()

async def body():
    early.clear()
    await sleep(1)
    return "done"

print(run(body, host=VirtualHost()))
"""


def test_what_was_made_and_collected_before_the_first_run_is_pythons_own_matter(tmp_path: Path) -> None:
    file = tmp_path / "early.py"
    file.write_text(EARLY)
    ended = subprocess.run([sys.executable, str(file)], capture_output=True, text=True, timeout=60)
    assert "coroutine 'reach' was never awaited" in ended.stderr
    assert ended.stdout.splitlines()[0] == "done"


def test_between_runs_the_collector_calls_nothing_in_which_a_ctrl_c_would_get_lost() -> None:
    before = list(gc.callbacks)

    async def body() -> bool:
        return gc.callbacks != before

    assert run(body, host=VirtualHost())
    assert gc.callbacks == before
