"""What a robot can do: hands of many builds close on test things, and what its file states wrongly is named."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from executive.cli.capabilities import capability_lines
from executive.locations.capabilities import Capabilities, capabilities_of
from executive.locations.holding import Kind, ranges
from executive.robots import bind_robot
from executive.robots.arms import with_carrying
from planlang.files import Bundled
from tests.support.cli_runs import invoke
from tests.support.hands import PLATE, SUCTION, THREE, THUMB, TWO, Hand, robot_with


def can(path: Path | str) -> Capabilities:
    """What a robot can do, without its reach."""
    return capabilities_of(with_carrying(bind_robot(path)))


def held(found: Capabilities, kind: Kind, arm: str = "arm") -> str:
    """What an arm's hand holds of a kind."""
    (holding,) = (one for one in found.holdings if one.arm == arm)
    (hold,) = (one for one in holding.planned if one.kind is kind)
    return f"{ranges(hold.widths)} {hold.how}" if hold.widths else ""


def warned(found: Capabilities) -> list[str]:
    """The warnings."""
    return list(map(str, found.warnings))


# Hands of many builds, which open 8 cm


@pytest.mark.parametrize(
    ("hand", "how"),
    [
        (TWO, "between two fingers"),
        (THREE, "between a finger and two fingers"),
        (THUMB, "between thumb and three fingers"),
        (replace(PLATE, counted=("plate",)), "between a finger and arm_plate"),
    ],
    ids=["two fingers", "three fingers", "thumb", "plate"],
)
def test_a_hand_holds_what_fits_between_its_fingers(hand: Hand, how: str, tmp_path: Path) -> None:
    found = can(robot_with(tmp_path, arm=hand))
    assert held(found, Kind.BOX) == f"2-7 cm {how}"
    assert held(found, Kind.CYLINDER) == f"2-7 cm {how}"
    assert re.fullmatch(r"[34]-12 cm by the rim", held(found, Kind.BOWL))
    assert not warned(found)


def test_a_plate_that_is_no_finger_is_named_as_one_to_list(tmp_path: Path) -> None:
    found = can(robot_with(tmp_path, arm=PLATE))
    assert not held(found, Kind.BOX)
    (advice,) = warned(found)
    assert advice == (
        "the hand of the arm arm holds things of up to 0.08 m between its finger and arm_plate, which is no finger: "
        'fingers = ["arm_finger", "arm_plate"] in [arms.arm.gripper]'
    )


def test_a_hand_without_fingers_holds_nothing_and_needs_no_warning(tmp_path: Path) -> None:
    found = can(robot_with(tmp_path, arm=SUCTION))
    assert not found.holdings
    assert not warned(found)


def test_fingers_that_never_meet_hold_no_box(tmp_path: Path) -> None:
    apart = Hand({"left": (0.0, 0.005, 0.04), "right": (0.0, 0.02, 0.04)}, 0.076)
    found = can(robot_with(tmp_path, arm=apart))
    assert not held(found, Kind.BOX)
    assert not held(found, Kind.CYLINDER)
    (advice,) = warned(found)
    assert advice.startswith("the fingers of the hand of the arm arm close on no box or cylinder: opened, closed")


def test_an_opening_that_is_too_small_is_said_with_the_one_to_write(tmp_path: Path) -> None:
    found = can(robot_with(tmp_path, arm=replace(TWO, opening=0.04)))
    assert held(found, Kind.BOX) == "2-4 cm between two fingers"
    assert warned(found) == [
        "the fingers of the hand of the arm arm hold things of up to 0.08 m, and plans grasp up to 0.04 m: "
        "max_opening = 0.08 in [arms.arm.gripper]"
    ]


def test_a_hand_that_opens_wider_than_the_widest_test_thing_needs_no_warning(tmp_path: Path) -> None:
    wide = Hand({"left": (0.0, 0.005, 0.08), "right": (0.0, -0.005, -0.08)}, 0.152)
    found = can(robot_with(tmp_path, arm=wide))
    assert held(found, Kind.BOX) == "2-12 cm between two fingers"
    assert not warned(found)


def test_an_opening_that_no_hand_has_is_said(tmp_path: Path) -> None:
    found = can(robot_with(tmp_path, arm=replace(TWO, opening=0.4)))
    assert held(found, Kind.BOX) == "2-8 cm between two fingers"
    assert any("opens 0.4 m, which no hand does" in advice for advice in warned(found))


def test_fingers_that_end_far_from_the_grip_point_are_no_fingers(tmp_path: Path) -> None:
    path = robot_with(tmp_path, arm=replace(TWO, length=0.5))
    path.write_text(path.read_text().replace("tool_offset = [0.0, 0.0, 0.5]", "tool_offset = [0.0, 0.0, 0.05]"))
    assert any(re.search(r"finger arm_left .* ends 0\.4\d m from the grip point", one) for one in warned(can(path)))


def test_equal_hands_that_open_differently_are_named(tmp_path: Path) -> None:
    found = can(robot_with(tmp_path, left=TWO, right=replace(TWO, opening=0.067)))
    assert warned(found)[-1] == (
        "the hands of the left and the right arm have the same joints and open 0.076 and 0.067 m: "
        "max_opening in [arms.left.gripper] and [arms.right.gripper]"
    )
    assert not warned(can(robot_with(tmp_path, left=TWO, right=TWO)))


def test_a_joint_whose_limits_are_equal_is_named_with_the_key(tmp_path: Path) -> None:
    path = robot_with(tmp_path, arm=TWO)
    urdf = tmp_path / "mine.urdf"
    urdf.write_text(urdf.read_text().replace('lower="-2.5" upper="2.5"', 'lower="0" upper="0"', 1))
    assert warned(can(path))[0] == (
        "joint arm_j1 cannot move, its limits are 0 to 0: "
        "if the robot's does, limits = [LOWEST, HIGHEST] in [joints.arm_j1]"
    )


# Bundled robots


def test_bundled_robots_hold_what_their_data_sheets_say() -> None:
    panda, amigo = can("panda"), can("amigo")
    assert held(panda, Kind.BOX) == held(panda, Kind.CYLINDER) == "2-7 cm between two fingers"
    for side in ("left", "right"):
        assert held(amigo, Kind.BOX, side) == "2-11 cm between two fingers"
    assert not warned(panda)
    assert not warned(amigo)


def test_the_doorway_of_a_robot_is_as_wide_as_it_is_or_what_it_carries() -> None:
    doorways = can("amigo").doorways
    assert doorways is not None
    assert doorways.empty == doorways.with_mug == pytest.approx(0.76)


def test_a_fixed_robot_needs_no_doorway(tmp_path: Path) -> None:
    path = robot_with(tmp_path, arm=TWO)
    path.write_text(path.read_text().replace("[base]", "[base]\nfixed = true"))
    assert can(path).doorways is None


# The commands


def inspected(path: Path | str) -> dict[str, Any]:
    """What robot inspect says, as data."""
    result = invoke("robot", "inspect", path, "--json", "--quiet")
    assert result.exit_code == 0, result.output
    data: dict[str, Any] = json.loads(result.stdout)
    return data


def panda_on(size: str, folder: Path) -> Path:
    """Write the Panda on a stand of another size, in a posture of its own choice."""
    text = Bundled.ROBOT.find("panda").read_text()
    text = re.sub(r"^size = .*$", f"size = {size}", text[: text.index("[postures")], flags=re.MULTILINE)
    (folder / "panda.toml").write_text(text)
    return folder / "panda.toml"


def test_a_stand_in_the_way_of_its_own_arm_is_named(tmp_path: Path) -> None:
    data = inspected(panda_on("[0.5, 0.5, 1.2]", tmp_path))
    own = data["arms"][0]["own_body"]
    assert own["link"] == "mobile_base"
    assert own["share"] > 0.5
    (advice,) = data["warnings"]
    assert advice["what"].startswith("the robot's own mobile_base is in the way of the arm arm in ")
    assert "[mount]" in advice["write"]


def test_a_posture_that_is_missing_says_who_needs_it(tmp_path: Path) -> None:
    missing = inspected(panda_on("[0.5, 0.5, 0.9]", tmp_path))["missing"]
    carrying, *named = [one for one in missing if one.startswith("a posture ")]
    assert carrying.startswith("a posture carrying: hands level and close to the body are used")
    assert [one.partition(": ")[2].partition(" (")[0] for one in named] == 2 * ["only recipes that name it need it"]


def test_a_stand_wider_than_the_arm_reaches_is_named(tmp_path: Path) -> None:
    (advice,) = inspected(panda_on("[1.2, 1.2, 0.55]", tmp_path))["warnings"]
    assert "of the reach of the arm arm is over the robot's own base" in advice["what"]


def test_inspect_says_in_json_what_it_prints() -> None:
    lines, data = invoke("robot", "inspect", "panda", "--quiet").stdout.splitlines(), inspected("panda")
    (arm,) = data["arms"]
    assert arm["holds"]["boxes"] == {"widths": [0.02, 0.03, 0.04, 0.05, 0.06, 0.07], "how": "between two fingers"}
    assert "  holds: boxes 2-7 cm, cylinders 2-7 cm between two fingers; bowls 4-12 cm by the rim" in lines
    assert arm["heights"]["side"] == [0.25, 1.65]
    assert any("grasps from the side at 0.25-1.65 m" in line for line in lines)
    width = data["doorway"]["empty"]
    assert f"  narrowest doorway: {width:g} m wide, with a mug in the hand {data['doorway']['with_mug']:g} m" in lines
    assert data["warnings"] == []


def test_inspect_names_the_urdf_of_the_user_and_not_a_copy(tmp_path: Path) -> None:
    assert inspected(robot_with(tmp_path, arm=TWO))["urdf"] == str(tmp_path / "mine.urdf")


def test_make_says_what_the_hands_of_the_draft_hold(tmp_path: Path) -> None:
    robot_with(tmp_path, left=TWO, right=PLATE)
    result = invoke("robot", "make", tmp_path / "mine.urdf", "-o", tmp_path / "made.toml", "--quiet")
    assert result.exit_code == 0, result.output
    said = [line for line in result.stdout.splitlines() if line.startswith("  the hand of")]
    assert said[0].startswith("  the hand of the left arm holds boxes 2-7 cm, cylinders 2-7 cm between two fingers")
    assert "between a finger and right_plate" in said[1]


def test_fingers_without_shapes_hold_what_is_not_known(tmp_path: Path) -> None:
    path = robot_with(tmp_path, arm=TWO)
    urdf = tmp_path / "mine.urdf"
    urdf.write_text(re.sub(r'(<link name="arm_(left|right)">).*?</link>', r"\1</link>", urdf.read_text()))
    found = can(path)
    bare = "arm_left and arm_right have no <collision> shape"
    assert warned(found) == [f"{bare}, so what the hand of the arm holds is not known: add such shapes to the URDF"]
    assert str(found.holdings[0]) == f"not known, as {bare}"
    assert next(iter(capability_lines(found))) == f"  what the hand of the arm holds is not known, as {bare}"
