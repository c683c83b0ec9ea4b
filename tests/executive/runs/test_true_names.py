"""No plan can read the names of what is there: the world has others than the map that the robot has."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest

from executive.runs.options import Outcome, RunResult
from executive.runs.plan_run import run_plan_file
from planlang.files import bundled
from tests.executive.conftest import BUNDLED

TRUE = "zq_"
"""What the names of true things begin with."""
CHAIR = """
Individual: zq_chair
    Types: knowrob:Chair-PieceOfFurniture
    Facts: knowrob:pose zq_at, knowrob:depthOfObject 0.5, knowrob:widthOfObject 0.5, knowrob:heightOfObject 0.9
Individual: zq_at
    Types: knowrob:RotationMatrix3D
    Facts: knowrob:translation "-1.5 -0.3 0.45", knowrob:quaternion "0 0 0 1"
"""


def renamed(environment: str, folder: Path, more: str = "") -> Path:
    """Write a map whose things have other names than those of a bundled one."""
    text = (bundled("ontologies") / "environments" / f"{environment}.omn").read_text()
    names = sorted(set(re.findall(r"^Individual: (\w+)$", text, re.MULTILINE)), key=len, reverse=True)
    text = re.sub(rf"(?<![\w:/#-])({'|'.join(names)})(?![\w-])", lambda one: TRUE + one[1], text)
    path = folder / "there.omn"
    path.write_text(text.replace(f"{environment}.owl", "there.owl") + more)
    return path


def ran(environment: str, recipe: str, world: Path, seed: int = 0) -> RunResult:
    """Run a bundled recipe in a world."""
    file, room = bundled("recipes") / f"{recipe}.omn", bundled("ontologies") / "environments" / f"{environment}.omn"
    trace = world.parent / "run.jsonl"
    return run_plan_file(replace(BUNDLED, recipe=file, environment=room, world=[world], seed=seed, trace=trace))


@pytest.mark.parametrize(
    ("environment", "recipe", "more"),
    [
        ("hospital_room", "serve_a_drink", CHAIR),
        pytest.param("kitchenette", "fetch_from_cabinet", "", marks=pytest.mark.long),
    ],
)
def test_no_true_name_is_in_the_trace_or_the_message(environment: str, recipe: str, more: str, tmp_path: Path) -> None:
    world = renamed(environment, tmp_path, more)
    assert world.read_text().count(f"Individual: {TRUE}") > 10
    result = ran(environment, recipe, world)
    assert result.outcome is Outcome.DONE, result.message
    assert TRUE in "".join(result.final_state), "the lines at the end tell of the true things"
    records = [json.loads(line) for line in (tmp_path / "run.jsonl").read_text().splitlines()]
    assert not [one for one in records if TRUE in json.dumps(one)]
    assert TRUE not in result.message
