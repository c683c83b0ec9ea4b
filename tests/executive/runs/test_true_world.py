"""Runs in a world that files state apart from what the robot believes."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from executive.options.locating import LocateOptions
from executive.runs.locating import locate
from executive.runs.options import Outcome, RunOptions, RunResult
from executive.runs.plan_run import run_plan_file
from executive.runs.prepared import prepared
from planlang.diagnostics import BadInput
from tests.executive.conftest import BUNDLED

THING = """
Individual: <http://example.org/more.owl#{name}>
    Types: knowrob:{cls}
    Facts: knowrob:pose <http://example.org/more.owl#at_{name}>,
        knowrob:depthOfObject {size[0]}, knowrob:widthOfObject {size[1]}, knowrob:heightOfObject {size[2]}
Individual: <http://example.org/more.owl#at_{name}>
    Types: knowrob:RotationMatrix3D
    Facts: knowrob:translation "{at}", knowrob:quaternion "0 0 0 1"
"""
HEAD = """
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://example.org/more.owl>
    Import: <http://planlang.org/kb/hospital_room.owl>
"""
CHAIR = THING.format(name="chair9", cls="Chair-PieceOfFurniture", size=(0.5, 0.5, 0.9), at="-1.5 -0.3 0.45")
TWIN = THING.format(name="bottle7", cls="DrinkingBottle", size=(0.065, 0.065, 0.2), at="-2.7 -0.5 0.9")
MOVED = {"thing": "bottle1", "property": "translation", "value": [-2.6, -0.6, 0.9]}


def gone(*names: str) -> list[dict[str, Any]]:
    """Changes by which the world lacks things."""
    return [{"thing": name, "property": "absent", "value": True} for name in names]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with files of worlds."""
    (tmp_path / "more.omn").write_text(HEAD + CHAIR + TWIN)
    (tmp_path / "twin.omn").write_text(HEAD + TWIN)
    (tmp_path / "moved.json").write_text(json.dumps([MOVED, {**MOVED, "thing": "chair1", "value": [2.0, -1.5, 0.45]}]))
    (tmp_path / "gone.json").write_text(json.dumps(gone("bottle1", "chair1")))
    return tmp_path


def ran(*world: Path | str, **more: Any) -> RunResult:
    """Run the bundled recipe in a world."""
    return run_plan_file(replace(BUNDLED, world=list(world), **more))


def test_a_world_as_the_map_gives_the_same_run_and_its_header_states_it(folder: Path) -> None:
    environment = BUNDLED.environment
    assert isinstance(environment, Path)
    assert ran(environment, trace=folder / "apart.jsonl").outcome is Outcome.DONE
    run_plan_file(replace(BUNDLED, trace=folder / "alike.jsonl"))
    (header, *records), (other, *same) = (
        (folder / name).read_text().splitlines() for name in ("apart.jsonl", "alike.jsonl")
    )
    assert records == same
    assert json.loads(header)["world"]["map"] == json.loads(other)["map"]
    assert "world" not in json.loads(other)


def test_the_robot_sees_that_things_are_elsewhere_and_takes_them_there(folder: Path) -> None:
    result = ran(folder / "moved.json", trace=folder / "run.jsonl")
    assert result.outcome is Outcome.DONE, result.message
    assert result.final_state == ("bottle1: held by patient1",)
    seen = [one for one in result.trace if one["event"] == "belief" and one["change"] == "seen"]
    assert [one["name"] for one in seen][:1] == ["bottle1"]


def test_what_no_map_knows_is_run_into_and_gone_around_and_stands_where_it_stood(folder: Path) -> None:
    files = {"report": folder / "run.html", "picture": folder / "end.png", "update_map": folder / "after.omn"}
    result = ran(folder / "more.omn", trace=folder / "run.jsonl", **files)
    assert result.outcome is Outcome.DONE, result.message
    records = [json.dumps(one) for one in result.trace]
    assert any("blocked by something unknown at" in one for one in records), "the base has run into the chair"
    assert not any("chair9" in one for one in records), "nobody tells its name"
    assert "chair9" not in files["update_map"].read_text(), "an obstacle that was only felt is no thing of the map"
    assert "bottle7" in files["report"].read_text()


def test_a_thing_that_is_missing_is_searched_for_and_the_failure_says_where(folder: Path) -> None:
    result = ran(folder / "gone.json", report=folder / "run.html")
    assert result.failures[0] == "ObjectNowhereToBeFound"
    assert "looked at: cabinet1" in result.message


def test_the_seed_displaces_the_world_of_the_file(folder: Path) -> None:
    traces = []
    for seed in (0, 3):
        ran(folder / "moved.json", seed=seed, trace=folder / f"{seed}.jsonl")
        found = [json.loads(line) for line in (folder / f"{seed}.jsonl").read_text().splitlines()]
        traces.append(next(one for one in found if one.get("change") == "seen" and one["name"] == "bottle1"))
    (x, y, _), (other_x, other_y, _) = (one["pose"]["position"] for one in traces)
    assert 0.001 < abs(x - other_x) + abs(y - other_y) < 0.7


def test_a_resumed_run_needs_the_same_world(folder: Path) -> None:
    trace = folder / "run.jsonl"
    whole = ran(folder / "twin.omn", trace=trace)
    assert whole.outcome is Outcome.DONE
    lines = trace.read_text()
    trace.write_text("\n".join(lines.splitlines()[:60]) + "\n")
    with pytest.raises(BadInput, match="world differs") as refused:
        run_plan_file(replace(BUNDLED, resume=trace))
    assert "name the world of the run" in str(refused.value.diagnostics[0].help)
    resumed = ran(folder / "twin.omn", resume=trace)
    assert resumed.final_state == whole.final_state
    again = [line for line in trace.read_text().splitlines() if '"event": "resumed"' not in line]
    assert again == lines.splitlines()


def test_a_start_that_only_the_world_refuses_is_refused(folder: Path) -> None:
    with pytest.raises(BadInput, match="in the world: it would collide with chair9"):
        ran(folder / "more.omn", start=(-1.5, -0.3, 0.0))


def test_found_poses_say_what_the_world_has_in_their_way(folder: Path) -> None:
    options = LocateOptions(phrase="in reach of the bottle", robot="amigo", environment="hospital_room", count=2)
    assert {pose.blocked_by for pose in locate(options)} == {None}
    found = locate(replace(options, world=folder / "more.omn"))
    assert {pose.blocked_by for pose in found} == {("chair9",)}
    assert "in the world it runs into chair9" in str(found)
    assert found.as_json()["solutions"][0]["blocked_by"] == ["chair9"]
    put = replace(options, phrase="on the cabinet", of="the bottle", count=300, world=folder / "twin.omn")
    assert {pose.blocked_by for pose in locate(put)} == {(), ("bottle7",)}


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ('[{"option": "arm", "value": "left"}]', "no option arm"),
        ("[]", "no changes"),
        ('[{"thing": "nothing9", "property": "absent", "value": true}]', "no nothing9"),
    ],
)
def test_a_list_that_changes_no_thing_of_the_world_is_refused(folder: Path, text: str, problem: str) -> None:
    (folder / "wrong.json").write_text(text)
    with pytest.raises(BadInput, match=problem):
        ran(folder / "wrong.json")


def test_a_world_that_is_not_there_is_refused_before_the_run() -> None:
    with pytest.raises(BadInput, match="no such file"):
        prepared(RunOptions(recipe=BUNDLED.recipe, world=["nothing.json"]))
    with pytest.raises(BadInput, match="no such environment"):
        prepared(RunOptions(recipe=BUNDLED.recipe, world=["nothing.omn"]))
