"""Robots that are tried: two small ones, drawn for it, and what the page says of them."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest
from PIL import Image

from executive.maps import read_map, scene_of
from planlang.ontology import load
from tests.benchmarks.robots_tried.__main__ import TRUTH, robots_in, sheet_of, tried
from tests.benchmarks.robots_tried.table import page
from tests.benchmarks.robots_tried.trial import BENCH, ROOM, room_text
from tests.benchmarks.robots_tried.truth import Drafted, differences, truth_of

LINK = '<link name="{0}"><collision><origin xyz="{1}"/><geometry><box size="{2}"/></geometry></collision></link>'
JOINT = (
    '<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/><origin xyz="{4}"/><axis xyz="{5}"/>'
    '<limit lower="{6}" upper="{7}" velocity="1" effort="1"/></joint>'
)
LINKS = [
    ("base_link", "0 0 0.05", "0.2 0.2 0.1"),
    ("shoulder", "0 0 0.05", "0.05 0.05 0.1"),
    ("upper", "0 0 0.15", "0.05 0.05 0.3"),
    ("fore", "0 0 0.15", "0.05 0.05 0.3"),
    ("wrist", "0 0 0.03", "0.05 0.12 0.06"),
    ("finger1", "0 0.005 0.04", "0.02 0.01 0.08"),
    ("finger2", "0 -0.005 0.04", "0.02 0.01 0.08"),
]
JOINTS = [
    ("pan", "revolute", "base_link", "shoulder", "0 0 0.1", "0 0 1", -2.9, 2.9),
    ("lift", "revolute", "shoulder", "upper", "0 0 0.1", "0 1 0", -2, 2),
    ("elbow", "revolute", "upper", "fore", "0 0 0.3", "0 1 0", -2.5, 2.5),
    ("pitch", "revolute", "fore", "wrist", "0 0 0.3", "0 1 0", -2, 2),
    ("grip1", "prismatic", "wrist", "finger1", "0 0 0.06", "0 1 0", 0, 0.025),
    ("grip2", "prismatic", "wrist", "finger2", "0 0 0.06", "0 -1 0", 0, 0.025),
]
ARM = "".join([*(LINK.format(*one) for one in LINKS), *(JOINT.format(*one) for one in JOINTS)])
FACTS = """[small]
urdf = "small/urdf/small.urdf"
maker = "Nobody"
fixed = true
camera = []
says = "an arm of four joints with a parallel gripper"

[[small.arms]]
hand = "wrist"
joints = 4
opening = 0.05

[broken]
urdf = "broken.urdf"

[absent]
urdf = "absent.urdf"
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Write the two robots, and the facts about them."""
    (tmp_path / "small" / "urdf").mkdir(parents=True)
    (tmp_path / "small" / "urdf" / "small.urdf").write_text(f'<robot name="small">{ARM}</robot>', encoding="utf-8")
    text = f'<robot name="broken">{ARM.replace("type=", "kind=", 1)}</robot>'
    (tmp_path / "broken.urdf").write_text(text, encoding="utf-8")
    (tmp_path / "truth.toml").write_text(FACTS, encoding="utf-8")
    return tmp_path


def test_a_robot_is_drafted_compared_and_drawn_and_a_broken_one_is_a_line(folder: Path, tmp_path: Path) -> None:
    robots = robots_in(folder, folder / "truth.toml", ())
    assert list(robots) == ["small", "broken"], "one is not there"
    rows = tried(robots, tmp_path, 2, 60, None)
    small, broken = rows
    assert small["differs"] == []
    assert small["memory"] < 2000
    assert "<joint> 'pan' has no type" in broken["refused"]
    lines = list(page(rows))
    assert lines[0].startswith("2 robots of 1 makers: 1 are drafted as their sources say; 0 of the 0")
    (line,) = [line for line in lines if line.startswith("| small (Nobody)")]
    assert "0.048" in line
    assert any("**small**: an arm of four joints" in line and "0.048 m at most" in line for line in lines)
    sheet = sheet_of(rows, tmp_path)
    assert isinstance(sheet, Image.Image)
    assert sheet.getextrema() != ((255, 255),) * 3, "the arm is drawn"


def test_what_the_same_code_found_is_not_tried_again_but_what_other_limits_or_facts_found_is(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    robots = robots_in(folder, folder / "truth.toml", ("small",))
    first = tried(robots, tmp_path, 1, 60, None, reused=True)
    assert "draft small" in capsys.readouterr().out
    assert tried(robots, tmp_path, 1, 60, None, reused=True) == first
    assert capsys.readouterr().out == ""
    (other,) = tried({"small": robots["small"] | {"fixed": False}}, tmp_path, 1, 60, None, reused=True)
    assert [kind for kind, _ in other["differs"]] == ["base"]
    tried(robots, tmp_path, 1, 61, None, reused=True)
    assert "draft small" in capsys.readouterr().out


def test_a_robot_that_brings_nothing_says_why_with_what_caused_it() -> None:
    message = "ObjectUnfetchable: it cannot be fetched\n  in a/b\n  because of GraspMissed: the gripper is empty. So\n"
    arms = {"arm": {"tip": "tool", "opening": 0.1}}
    row = {"world": "r", "truth": {}, "arms": arms, "fixed": True, "torso": "", "camera": "", "differs": None}
    lines = list(page([row | {"cpu": 1, "memory": 1, "message": message}]))
    assert "* **r**: Brings nothing: it cannot be fetched, because the gripper is empty." in lines


def test_what_does_not_agree_is_said(folder: Path) -> None:
    truth = truth_of({"urdf": "", "fixed": True, "lift": "column", "camera": ["eye"], "arms": [
        {"hand": "wrist", "joints": 5, "opening": 0.1}, {"hand": "base_link", "joints": 4}]})  # fmt: skip
    arms = {"arm": {"tip": "tool", "hand": "wrist", "opening": 0.085, "joints": ["a", "b", "c", "d"]}}
    urdf = folder / "small" / "urdf" / "small.urdf"
    found = dict(differences(truth, Drafted(False, "", "", arms), urdf))
    assert list(found) == ["base", "arms", "opening", "tip", "camera", "torso"]
    assert found["opening"] == "arm opens 0.085 of 0.1 m"
    right = Drafted(True, "column", "eye", {"arm": arms["arm"] | {"joints": list("abcde"), "opening": 0.093}})
    assert [kind for kind, _ in differences(truth, right, urdf)] == ["tip"]


@pytest.mark.parametrize("things", [ROOM, BENCH], ids=["room", "bench"])
def test_the_bottle_stands_on_the_table(things: dict[str, tuple[str, str, int, str]], tmp_path: Path) -> None:
    path = tmp_path / "room.omn"
    path.write_text(room_text(things), encoding="utf-8")
    scene = scene_of(read_map(load(path)))
    tops = {body.name: body.pose.position[2] + body.size[2] / 2 for body in scene.bodies if body.size}
    assert tops["table1"] == pytest.approx(0.75)
    assert tops["bottle1"] == pytest.approx(0.95)


def test_facts_are_stated_of_thirty_robots_of_twelve_makers() -> None:
    known = {name: truth_of(table) for name, table in tomllib.loads(TRUTH.read_text(encoding="utf-8")).items()}
    assert len(known) >= 30
    assert len({one.maker for one in known.values()}) >= 12
    assert all(one.arms and one.says and one.version for one in known.values())
