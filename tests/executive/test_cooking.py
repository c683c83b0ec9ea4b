"""A real recipe for pancakes with the module of docs/guides/cooking.md: run, replayed and resumed by the command."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.support.cli_runs import answer
from tests.support.examples import some

TOP = Path(__file__).parents[2]
MODULE, POURING = (TOP / "docs" / "examples" / name for name in ("cooking.py", "pouring.py"))
KITCHEN = TOP / "ontologies" / "environments" / "warm_pancake_kitchen.omn"


@pytest.fixture
def cook(corpus: Path) -> tuple[Any, ...]:
    """The command's arguments: recipe, robot, kitchen, module."""
    recipe = corpus / "recipes" / "pancake-making@hydro.owl"
    return (recipe, "--robot", "amigo", "--environment", KITCHEN, "--modules", MODULE, "--modules", POURING)


@pytest.mark.long
def test_the_recipe_runs_although_dough_and_pancake_are_not_in_the_map(cook: tuple[Any, ...], tmp_path: Path) -> None:
    trace = tmp_path / "run.jsonl"
    found = answer("run", *cook, "--trace", trace)
    assert (found["exit_code"], found["duration"]) == (0, 200.0), found
    assert not [one for one in found["diagnostics"] if one["code"] == "R021"], (
        "the module performs what nothing else does"
    )
    assert answer("replay", trace, cook[0], "--modules", MODULE, "--modules", POURING)["equal"]


@pytest.mark.long
@pytest.mark.parametrize("lines", some([50, 30, 62]))
def test_a_run_that_was_cut_goes_on_with_what_is_changed_already(
    cook: tuple[Any, ...], tmp_path: Path, lines: int
) -> None:
    trace, cut, resumed = (tmp_path / name for name in ("run.jsonl", "cut.jsonl", "resumed.jsonl"))
    answer("run", *cook, "--trace", trace)
    whole = trace.read_text(encoding="utf-8").splitlines(keepends=True)
    cut.write_text("".join(whole[:lines]), encoding="utf-8")
    assert answer("run", *cook, "--resume", cut, "--trace", resumed)["exit_code"] == 0
    changes = [
        [line for line in map(json.loads, path.read_text(encoding="utf-8").splitlines()) if line["event"] == "belief"]
        for path in (trace, resumed)
    ]
    known = [{key: line.get(key) for key in ("step", "change", "name")} for line in changes[0]]
    assert [{key: line.get(key) for key in ("step", "change", "name")} for line in changes[1]][-1] == known[-1]


def test_a_thing_that_nothing_makes_is_missed_before_anything_moves(cook: tuple[Any, ...], tmp_path: Path) -> None:
    path = tmp_path / "kitchen.omn"
    text = KITCHEN.with_name("pancake_kitchen.omn").read_text(encoding="utf-8")
    path.write_text(text.replace("Types: knowrob:WheatFlour", "Types: knowrob:Cup"), encoding="utf-8")
    found = answer("run", *(path if one is KITCHEN else one for one in cook))
    assert (found["exit_code"], found["diagnostics"][-1]["code"]) == (2, "X031")
