"""``--trust-map``: what the map says counts as seen, so that a robot without camera handles things."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pybullet_data
import pytest
from click.testing import CliRunner

from executive.cli.app import app


def run(*arguments: str | Path) -> dict[str, Any]:
    """The answer of ``planlang run`` as JSON."""
    result = CliRunner().invoke(app, ["run", *map(str, arguments), "--json"], prog_name="planlang")
    assert "Traceback" not in result.stdout + result.stderr
    found: dict[str, Any] = json.loads(result.stdout)
    return found


def performed(trace: Path) -> list[str]:
    """The actions that were performed, in order, with their arguments."""
    records = [json.loads(line) for line in trace.read_text().splitlines()]
    return [json.dumps(record["action"]) for record in records if record["event"] == "started" and "action" in record]


def header(trace: Path) -> dict[str, Any]:
    """The header of a trace."""
    with trace.open() as file:
        found: dict[str, Any] = json.loads(file.readline())
    return found


@pytest.mark.parametrize("words", [("pass_a_drink",), ("push_the_cup", "--environment", "soup_kitchen")])
def test_a_robot_without_camera_is_refused_with_what_lets_it_work(words: tuple[str, ...]) -> None:
    found = run(*words, "--robot", "panda")
    assert (found["exit_code"], found["failure"]["class"]) == (3, "MissingCapability")
    (advice,) = (one for one in found["diagnostics"] if one["code"] == "X013")
    assert f": planlang run {words[0]} --robot panda " in advice["help"]
    assert advice["help"].endswith(" --trust-map")


@pytest.mark.long
@pytest.mark.parametrize(("recipe", "holder"), [("serve_a_drink", "patient1"), ("pass_a_drink", "guest1")])
def test_a_robot_without_camera_that_trusts_the_map_hands_the_bottle_over(
    tmp_path: Path, recipe: str, holder: str
) -> None:
    trace = tmp_path / "run.jsonl"
    found = run(recipe, "--robot", "panda", "--trust-map", "--trace", trace)
    assert found["final_state"] == [f"bottle1: held by {holder}"]
    assert header(trace)["trusts_map"] is True


def world(folder: Path, thing: str, key: str, value: object) -> Path:
    """A file with one change of the world."""
    file = folder / "world.json"
    file.write_text(json.dumps([{"thing": thing, "property": key, "value": value}]))
    return file


PANDA = ("pass_a_drink", "--robot", "panda", "--trust-map")
GOAL = ("--goal", "bottle1 held by guest1")


def test_what_a_hand_without_camera_misses_where_the_map_has_it_is_felt_for_and_handed_over(tmp_path: Path) -> None:
    trace = tmp_path / "run.jsonl"
    moved = world(tmp_path, "bottle1", "translation", [0.62, 0.05, 0.84])
    found = run(*PANDA, *GOAL, "--world", moved, "--trace", trace)
    assert (found["exit_code"], found["final_state"]) == (0, ["bottle1: held by guest1"])
    felt = [one for one in map(json.loads, trace.read_text().splitlines()) if one.get("change") == "felt"]
    assert [one["name"] for one in felt] == ["bottle1"]


def test_what_is_not_felt_near_where_the_map_has_it_is_nowhere_to_be_found(tmp_path: Path) -> None:
    found = run(*PANDA, "--world", world(tmp_path, "bottle1", "absent", True))
    assert (found["exit_code"], found["failure"]["class"]) == (1, "ObjectNowhereToBeFound")
    assert "bottle1 was not felt within 50 cm of where the map has it" in found["failure"]["message"]


def test_a_guest_who_stands_elsewhere_takes_nothing_and_nothing_else_is_said(tmp_path: Path) -> None:
    found = run(*PANDA, *GOAL, "--world", world(tmp_path, "guest1", "translation", [-1.2, -1.2, 0.8]))
    assert (found["exit_code"], found["failure"]["class"]) == (1, "HandoverNotTaken")
    assert not found["claimed"]
    assert [one["holds"] for one in found["goals"]] == [False]


@pytest.mark.long
def test_a_robot_with_a_camera_looks_unless_it_trusts_the_map(tmp_path: Path) -> None:
    looking, trusting = tmp_path / "looking.jsonl", tmp_path / "trusting.jsonl"
    for trace, options in ((looking, ()), (trusting, ("--trust-map",))):
        found = run("pass_a_drink", "--robot", "amigo", *options, "--trace", trace)
        assert found["final_state"] == ["bottle1: held by guest1"]
    assert any("LookingForSomething" in one for one in performed(looking))
    assert not any("LookingForSomething" in one for one in performed(trusting))
    assert "trusts_map" not in header(looking)


@pytest.mark.long
@pytest.mark.pr2
def test_the_pr2_passes_the_drink_without_moving_its_base(tmp_path: Path) -> None:
    trace = tmp_path / "run.jsonl"
    assert run("pass_a_drink", "--robot", "pr2", "--trace", trace)["final_state"] == ["bottle1: held by guest1"]
    assert not any("Translation" in one for one in performed(trace))


@pytest.mark.long
def test_an_arm_that_is_fixed_at_the_table_passes_the_drink_by_a_robot_file_made_from_its_urdf(tmp_path: Path) -> None:
    urdf, file = Path(pybullet_data.getDataPath()) / "franka_panda" / "panda.urdf", tmp_path / "arm.toml"
    made = CliRunner().invoke(app, ["robot", "make", str(urdf), "-o", str(file)], prog_name="planlang")
    assert made.exit_code == 0, made.output
    mount = "[mount]\nsize = [0.5, 0.5, 0.55]\nat = [0.1, 0.0, 0.55]\n"  # as the bundled one: its maps serve
    file.write_text(file.read_text() + mount)
    assert run("pass_a_drink", "--robot", file, "--trust-map")["final_state"] == ["bottle1: held by guest1"]
    driving = run("serve_a_drink", "--robot", file, "--trust-map")
    assert (driving["exit_code"], driving["failure"]["class"]) == (3, "MissingCapability")
    stuck = run("serve_a_drink", "--robot", file, "--trust-map", "--force")
    assert stuck["exit_code"] == 1, "the base stays, and the bottle is out of reach"


@pytest.mark.long
def test_a_run_that_trusted_the_map_is_resumed_so(tmp_path: Path) -> None:
    trace = tmp_path / "run.jsonl"
    run("pass_a_drink", "--robot", "panda", "--trust-map", "--trace", trace)
    lines = trace.read_text().splitlines(keepends=True)
    grasped = next(number for number, line in enumerate(lines) if '"change":"grasped"' in line.replace(" ", ""))
    completed = next(n for n in range(grasped, len(lines)) if '"event":"completed"' in lines[n].replace(" ", ""))
    trace.write_text("".join(lines[: completed + 1]))
    found = run("--resume", trace)
    assert found["final_state"] == ["bottle1: held by guest1"]
    assert header(trace)["trusts_map"] is True
