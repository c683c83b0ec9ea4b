"""Which plan of a file is run."""

from __future__ import annotations

from pathlib import Path

import pytest

from executive.plan_files import import_plan, main_plan
from planlang.diagnostics import BadInput

SOURCE = """
from planlang import plan

@plan("http://example.org/kitchen.owl#FillGlass")
async def fill_glass() -> None: ...

@plan("http://example.org/kitchen.owl#ServeGlass")
async def serve_glass() -> None: ...
"""


def plan_named(folder: Path, task: str | None) -> str:
    """Name of the plan that is run for a task."""
    path = folder / "kitchen.py"
    path.write_text(SOURCE, encoding="utf-8")
    return main_plan(import_plan(path), task).name


@pytest.mark.parametrize("task", ["fill_glass", "FillGlass", "http://example.org/kitchen.owl#FillGlass"])
def test_task_is_a_name_or_an_iri(tmp_path: Path, task: str) -> None:
    assert plan_named(tmp_path, task) == "fill_glass"


def test_without_a_task_the_last_plan_is_run(tmp_path: Path) -> None:
    assert plan_named(tmp_path, None) == "serve_glass"


def test_task_that_is_not_in_the_plan_is_refused_and_nothing_else_is_run(tmp_path: Path) -> None:
    with pytest.raises(BadInput) as caught:
        plan_named(tmp_path, "FillCup")
    (found,) = caught.value.diagnostics
    assert (found.code, found.help) == ("R001", "this file defines fill_glass, serve_glass")
