"""Whatever goes wrong in a run, and whatever recovers from it, is replayed and resumed byte for byte."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import pytest

from planlang.faults.kinds import KINDS, Kind
from planlang.files import bundled
from planlang.ontology import Ontology, load
from tests.support.cli_runs import answer, invoke
from tests.support.repetition import base_poses, passing, repeated

SERVE, FETCH = ("serve_a_drink",), ("fetch_from_cabinet",)
FILES = Path(__file__).resolve().parents[1] / "benchmarks" / "faults" / "files"
SWITCH = """
from planlang import perform, plan
from planlang.designators import action, an_object

STOVE = an_object("StoveTop", "http://planlang.org/kb/stove_kitchen.owl#stove1")


@plan
async def turn_off() -> None:
    await perform(action("TurningOffPoweredDevice", object_acted_on=STOVE))
"""
STATED = {
    "thing:moves": "thing.bottle1:moves",
    "thing:is_gone": "thing.bottle1:is_gone",
    "camera:overlooks": "camera:overlooks=DrinkingBottle",
    "arm:stalls": "arm:stalls@2",
    "step:fails": "step.ClosingAGripper:fails=GraspMissed@1-2",
}
"""Kind -> how it is stated, if not by its name alone: so that it concerns the task."""
QUICK = ("gripper:misses", "head:stalls", "step:fails")
"""Kinds of which the suite has one each: of the robot's interface, of the world, and of a step."""


@pytest.fixture(scope="module")
def vocabulary() -> Ontology:
    """The bundled ontologies."""
    return load(bundled("ontologies") / "knowrob.omn")


def task_of(kind: Kind, folder: Path) -> Sequence[str | Path]:
    """Find the shortest task in which a fault can happen, or write one."""
    if kind.part == "device":
        (folder / "plan.py").write_text(SWITCH)
        return (folder / "plan.py", "--robot", "amigo", "--environment", "stove_kitchen")
    if str(kind) == "thing:rolls":
        invoke("compile", FILES / "tidy_up.omn", "--output", folder / "plan.py")
        return (folder / "plan.py", "--robot", "amigo", "--environment", FILES / "strewn_room.omn")
    return FETCH if kind.part in ("handle", "door") else SERVE


@pytest.mark.parametrize(
    "kind", [pytest.param(one, marks=() if str(one) in QUICK else pytest.mark.long, id=str(one)) for one in KINDS]
)
def test_a_fault_and_what_recovers_from_it_are_replayed_and_resumed_byte_for_byte(
    kind: Kind, tmp_path: Path, vocabulary: Ontology
) -> None:
    trace, stated = tmp_path / "run.jsonl", STATED.get(str(kind), str(kind))
    task = task_of(kind, tmp_path)
    plan = [one for one in task[:1] if isinstance(one, Path)]  # a bundled recipe is found by its trace
    found = answer("run", *task, "--fault", stated, "--trace", trace)
    assert str(kind) in [one["kind"] for one in found["faults"]["fired"]], found
    lines = trace.read_text().splitlines(keepends=True)
    assert "equal to the end" in invoke("replay", trace, *plan).stdout
    last = max(number for number, line in enumerate(lines) if json.loads(line)["event"] == "fault")
    cut = tmp_path / "cut.jsonl"
    cut.write_text("".join(lines[: last + 2]))  # killed just after it has happened
    again = answer("run", *(task if plan else ()), "--resume", cut)
    assert (again["outcome"], again["faults"]) == (found["outcome"], found["faults"])
    resumed = [line for line in cut.read_text().splitlines(keepends=True) if '"event": "resumed"' not in line]
    assert resumed == lines
    records = list(map(json.loads, lines))
    assert list(repeated(records, passing(vocabulary))) == []
    assert [before for before, after in base_poses(records) if before == after] == []


@pytest.mark.parametrize("seed", [4, *(pytest.param(seed, marks=pytest.mark.long) for seed in range(5, 12))])
def test_with_faults_by_chance_nothing_is_repeated_in_the_same_belief(
    seed: int, tmp_path: Path, vocabulary: Ontology
) -> None:
    trace = tmp_path / "run.jsonl"
    found = answer("run", "serve_a_drink", "--seed", seed, "--fault-rate", "0.2", "--trace", trace)
    assert found["faults"]["fired"]
    records = [json.loads(line) for line in trace.read_text().splitlines()]
    assert list(repeated(records, passing(vocabulary))) == []
    assert [before for before, after in base_poses(records) if before == after] == []
