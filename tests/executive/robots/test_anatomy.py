"""What a tree of joints is: torsos, arms, hands, heads, lifts and passive parts, whatever they are called."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from executive.robots import bind_draft
from executive.robots.anatomy import Anatomy, Limb, camera
from executive.robots.draft import Draft, draft_of
from executive.robots.mechanism import Mechanism, grounded
from planlang.diagnostics import has_errors
from tests.support.examples import examples
from tests.support.robot_parts import Parts, X, Y, Z


def drafted(parts: Parts, folder: Path) -> tuple[dict[str, Any], Draft]:
    """The draft of a robot file as data, bound once, and with its diagnostics."""
    path = parts.written(folder / "robot.urdf")
    draft = draft_of(path)
    assert not has_errors(bind_draft(draft, path).diagnostics)
    return tomllib.loads(draft.text()), draft


def doubts(draft: Draft) -> str:
    return "\n".join(one.message for one in draft.diagnostics() if one.code == "B017")


def two_arms(torso: str) -> Parts:
    """A robot on wheels with a torso of joints ("y", "p", "l"), two arms with grippers, and a head."""
    parts = Parts()
    chest = parts.torso(parts.base("wheels"), torso)
    for side, y in (("left", 0.2), ("right", -0.2)):
        parts.gripper(parts.arm(chest, f"{side}_arm", 6, y), side)
    parts.head(chest, 1)
    return parts


def one_arm(base: str = "wheels") -> tuple[Parts, str]:
    """A base with an arm of six joints, and its last link."""
    parts = Parts()
    return parts, parts.arm(parts.base(base), "arm", 6, 0.0, at=(0.12, 0.35))


# Torsos and arms


@pytest.mark.parametrize("torso", ["", "l", "yp", "ypl", "yppp", "ypppy", "yppppy"])
def test_arms_on_a_torso_of_any_number_of_joints_are_arms(torso: str, tmp_path: Path) -> None:
    found, draft = drafted(two_arms(torso), tmp_path)
    for side in ("left", "right"):
        arm = found["arms"][side]
        assert (arm["side"], arm["tip"], arm["hand"]) == (side, f"{side}_palm", f"{side}_palm")
        assert arm["tool_offset"] == pytest.approx([0.0, 0.0, 0.11], abs=0.005)
        assert arm["gripper"]["max_opening"] == pytest.approx(0.086, abs=0.001)
        assert f"6 joints, {side}_arm_0 to {side}_arm_5" in draft.text()
    assert len(found["arms"]) == 2
    assert found["camera"]["link"] == "camera_optical_frame"
    assert found["camera"]["neck"] == ["head_0_joint"]
    assert not doubts(draft)


def test_two_arms_of_different_build_are_two_arms(tmp_path: Path) -> None:
    parts = Parts()
    chest = parts.torso(parts.base("wheels"), "yp")
    parts.gripper(parts.arm(chest, "left_arm", 7, 0.2), "left", fingers=4, phalanges=3)
    parts.gripper(parts.arm(chest, "right_arm", 4, -0.2), "right", mimics=True)
    found, _ = drafted(parts, tmp_path)
    assert {name: arm["hand"] for name, arm in found["arms"].items()} == {"left": "left_palm", "right": "right_palm"}


def test_the_sides_of_arms_whose_names_differ_by_a_letter_are_those_letters(tmp_path: Path) -> None:
    parts = Parts()
    body = parts.base("wheels")
    for name in ("arml", "armr"):
        parts.gripper(parts.arm(body, name, 5, 0.0), name)
    found, _ = drafted(parts, tmp_path)
    assert {name: arm["hand"] for name, arm in found["arms"].items()} == {"left": "arml_palm", "right": "armr_palm"}


def test_an_arm_goes_on_behind_a_joint_called_gripper_roll(tmp_path: Path) -> None:
    parts = Parts()
    wrist = parts.arm(parts.base("wheels"), "arm", 5, 0.0)
    roll = parts.joint("gripper_roll", wrist, parts.link("wrist_3", (0.05, 0.05, 0.03)), (0.0, 0.0, 0.08))
    parts.gripper(roll, "gripper", mimics=True)
    found, draft = drafted(parts, tmp_path)
    assert found["arms"]["arm"]["hand"] == "gripper_palm"
    assert found["arms"]["arm"]["gripper"]["max_opening"] == pytest.approx(0.086, abs=0.001)
    assert "6 joints, arm_0 to gripper_roll" in draft.text()


@pytest.mark.parametrize("at", ["arm_0_link", "arm_2_link", "arm_4_link", "gripper_palm"])
def test_a_lamp_ends_no_arm_and_is_no_finger(at: str, tmp_path: Path) -> None:
    parts, wrist = one_arm()
    parts.gripper(wrist, "gripper", mimics=True)
    parts.lamp(at, "beacon")
    found, draft = drafted(parts, tmp_path)
    assert found["arms"]["arm"]["hand"] == "gripper_palm"
    assert found["arms"]["arm"]["gripper"]["opened"] == {"gripper_finger0_joint": 0.045}
    assert found["arms"]["arm"]["gripper"]["fingers"] == ["gripper_finger0", "gripper_finger1"]
    assert "6 joints, arm_0 to arm_5" in draft.text()


def test_a_linkage_along_the_fore_arm_is_passive(tmp_path: Path) -> None:
    parts, wrist = one_arm()
    parts.gripper(wrist, "gripper")
    rod = parts.joint("rod_1", "arm_2_link", parts.link("rod", (0.01, 0.01, 0.2)), axis=Y, mimic="arm_3")
    parts.joint("rod_2", rod, parts.link("rocker", (0.01, 0.01, 0.1)), (0.0, 0.0, 0.2), axis=Y, mimic="arm_3")
    found, _ = drafted(parts, tmp_path)
    assert [arm["hand"] for arm in found["arms"].values()] == ["gripper_palm"]


def test_heads_with_eyes_and_legs_are_no_arms(tmp_path: Path) -> None:
    parts = two_arms("y")
    neck = "torso_0"
    for number in range(4):
        child = parts.link(f"head_link{number}", (0.05, 0.05, 0.05))
        neck = parts.joint(f"neck_{number}", neck, child, (0.0, 0.0, 0.1), (Z, Y)[number % 2])
    for side, y in (("left", 0.03), ("right", -0.03)):
        parts.joint(f"{side}_eye", neck, parts.link(f"{side}_eye_link", (0.02, 0.02, 0.02)), (0.05, y, 0.0))
    found, _ = drafted(parts, tmp_path)
    assert list(found["arms"]) == ["left", "right"]


# Hands


@pytest.mark.parametrize(("fingers", "phalanges"), [(3, 2), (4, 3), (5, 3), (5, 2)])
@pytest.mark.parametrize("mimics", [False, True])
def test_a_hand_of_fingers_is_measured_from_its_thumb(
    fingers: int, phalanges: int, mimics: bool, tmp_path: Path
) -> None:
    parts, wrist = one_arm()
    parts.gripper(wrist, "hand", fingers=fingers, phalanges=phalanges, mimics=mimics)
    found, draft = drafted(parts, tmp_path)
    arm = found["arms"]["arm"]
    assert arm["hand"] == "hand_palm"
    assert arm["approach"] == [0.0, 0.0, 1.0]
    assert [abs(one) for one in arm["closing"]] == pytest.approx([0.0, 1.0, 0.0], abs=1e-6)
    assert arm["gripper"]["max_opening"] == pytest.approx(0.95 * 0.046, abs=0.002), (
        "the thumb is 4.6 cm from the fingers"
    )
    assert not doubts(draft)


@pytest.mark.parametrize("thumb", ["thumb", "finger4"], ids=["named", "told by its place"])
def test_a_thumb_beside_the_palm_is_turned_before_it(thumb: str, tmp_path: Path) -> None:
    parts, wrist = one_arm()
    palm = parts.fixed(wrist, parts.link("palm", (0.02, 0.09, 0.08), (0.0, 0.0, 0.04)), (0.0, 0.0, 0.08))
    for number in range(4):
        parent, at = palm, (0.0, 0.025 * number - 0.0375, 0.08)
        for phalanx in range(2):
            name = f"finger{number}_{phalanx}"
            parent = parts.joint(
                f"{name}_joint", parent, parts.link(name, (0.014, 0.014, 0.035), (0.0, 0.0, 0.018)), at, Y, (-0.2, 1.5)
            )
            at = (0.0, 0.0, 0.036)
    turned = parts.joint("turn", palm, parts.link(f"{thumb}_0"), (0.015, -0.045, 0.03), Z, (0.0, 1.6))
    link = parts.link(f"{thumb}_1", (0.014, 0.014, 0.075), (0.0, -0.02, 0.05))
    parts.joint("bend", turned, link, (0.0, 0.0, 0.0), X, (-0.6, 0.6))
    found, _ = drafted(parts, tmp_path)
    arm, gripper = found["arms"]["arm"], found["arms"]["arm"]["gripper"]
    assert arm["approach"] == [0.0, 0.0, 1.0]
    assert arm["closing"] == [1.0, 0.0, 0.0], "before the palm, not from one side of it to the other"
    for number in range(4):
        assert gripper["opened"][f"finger{number}_0_joint"] < gripper["closed"][f"finger{number}_0_joint"]
    assert gripper["opened"]["turn"] == gripper["closed"]["turn"] > 0.5, "turned before the palm"


def test_equal_hands_on_both_sides_open_equally(tmp_path: Path) -> None:
    parts = Parts()
    chest = parts.torso(parts.base("wheels"), "y")
    for side, y in (("left", 0.2), ("right", -0.2)):
        parts.gripper(parts.arm(chest, f"{side}_arm", 6, y), side, fingers=5, phalanges=3)
    found, draft = drafted(parts, tmp_path)
    assert len({arm["gripper"]["max_opening"] for arm in found["arms"].values()}) == 1
    assert not doubts(draft)


def test_equal_hands_with_other_fingertips_are_named(tmp_path: Path) -> None:
    parts = two_arms("y")
    for finger, y in ((0, 0.0), (1, -0.0)):
        parts.fixed(f"right_finger{finger}", parts.link(f"right_pad{finger}", (0.02, 0.016, 0.02)), (0.0, y, 0.08))
    _, draft = drafted(parts, tmp_path)
    assert "[arms.left.gripper] doubtful: max_opening" in doubts(draft)
    assert "the other hand, with equal joints, opens 0.086 m: compare the shapes of their fingers" in doubts(draft)


def test_a_finger_that_hangs_from_the_other_one_is_a_finger(tmp_path: Path) -> None:
    parts, wrist = one_arm()
    left = parts.link("gripper_left", (0.01, 0.01, 0.06), (0.0, 0.0, 0.1))
    right = parts.link("gripper_right", (0.01, 0.01, 0.06), (0.0, 0.0, 0.1))
    parts.joint("gripper_left_joint", wrist, left, axis=X, limits=(-0.055, -0.006), kind="prismatic")
    parts.joint("gripper_joint", left, right, axis=X, limits=(0.012, 0.11), kind="prismatic")
    found, _ = drafted(parts, tmp_path)
    assert found["arms"]["arm"]["hand"] == "arm_5_link"
    assert found["arms"]["arm"]["gripper"]["max_opening"] == pytest.approx(0.95 * 0.1, abs=0.005)


def test_a_finger_below_the_wrist_is_approached_along_its_tool_frame(tmp_path: Path) -> None:
    parts, wrist = one_arm()
    for name, y in (("left", 1), ("right", -1)):
        finger = parts.link(f"finger_{name}", (0.16, 0.01, 0.01), (0.08, 0.0, -0.05))
        parts.joint(f"finger_{name}_joint", wrist, finger, (0.02, y * 0.02, -0.1), (0.0, 0.0, float(y)), (-0.3, 0.5))
    parts.fixed(wrist, parts.link("grasp_center"), (0.17, 0.0, -0.15))
    found, _ = drafted(parts, tmp_path)
    assert found["arms"]["arm"]["tip"] == "grasp_center"
    assert found["arms"]["arm"]["approach"] == [1.0, 0.0, 0.0]


def test_turning_fingers_close_though_another_part_of_them_comes_to_the_front_on_the_way(tmp_path: Path) -> None:
    parts, wrist = one_arm()
    palm = parts.fixed(wrist, parts.link("palm", (0.05, 0.14, 0.04), (0.0, 0.0, 0.02)), (0.0, 0.0, 0.08))
    for side, sign in (("left", 1.0), ("right", -1.0)):
        finger = parts.link(f"{side}_finger", (0.02, 0.01, 0.065), (0.0, sign * 0.005, 0.0325))
        parts.fixed(finger, parts.link(f"{side}_tip", (0.02, 0.01, 0.035), (0.0, sign * 0.005, 0.0825)))
        parts.joint(f"{side}_joint", palm, finger, (0.0, 0.0, 0.04), (-sign, 0.0, 0.0), (0.0, 0.8))
    gripper = drafted(parts, tmp_path)[0]["arms"]["arm"]["gripper"]
    assert gripper["closed"] == {"left_joint": 0.0, "right_joint": 0.0}
    assert gripper["max_opening"] > 0.08


def test_fingers_without_shapes_grip_at_the_tool_frame_ahead_of_them(tmp_path: Path) -> None:
    parts, wrist = one_arm()
    palm = parts.fixed(wrist, parts.link("palm", (0.05, 0.14, 0.04), (0.0, 0.0, 0.02)), (0.0, 0.0, 0.08))
    for name, axis in (("left_finger", Y), ("right_finger", (0.0, -1.0, 0.0))):
        parts.joint(f"{name}_joint", palm, parts.link(name), (0.0, 0.0, 0.01), axis, (0.0, 0.05), "prismatic")
    parts.fixed(palm, parts.link("flange_tool0"), (0.0, 0.0, -0.06))
    parts.fixed(palm, parts.link("gripper_tool_frame"), (0.0, 0.0, 0.16))
    assert drafted(parts, tmp_path)[0]["arms"]["arm"]["tip"] == "gripper_tool_frame"


@pytest.mark.parametrize("limits", [(0.0, 0.0), (-1.0, 0.0)])
def test_a_finger_without_a_plausible_range_is_named_with_the_key_that_replaces_it(
    limits: tuple[float, float], tmp_path: Path
) -> None:
    parts, wrist = one_arm()
    for name, y in (("left", 1.0), ("right", -1.0)):
        finger = parts.link(f"{name}_finger", (0.02, 0.01, 0.09), (0.0, 0.0, 0.05))
        parts.joint(f"{name}_finger_joint", wrist, finger, (0.0, y * 0.02, 0.08), Y, limits, "prismatic")
    _, draft = drafted(parts, tmp_path)
    missing = [one.message for one in draft.diagnostics() if one.code == "B016"]
    assert any("no finger left_finger_joint with a plausible range" in one for one in missing)
    assert any(one.startswith("[joints.left_finger_joint] missing: limits: the URDF's range") for one in missing)


def test_hands_that_cannot_be_are_doubted(tmp_path: Path) -> None:
    parts, wrist = one_arm()
    parts.gripper(wrist, "hand", fingers=3, phalanges=4)
    _, draft = drafted(parts, tmp_path)
    assert "hand: the link that carries the fingers; doubtful: the finger from" in doubts(draft)
    assert "4 joints, it may be an arm" in doubts(draft)


# Lifts and telescopes


def test_the_lift_is_the_torso_and_the_stages_of_a_telescope_are_not(tmp_path: Path) -> None:
    parts = Parts()
    mast = parts.base("wheels")
    carriage = parts.link("lift", (0.1, 0.1, 0.1))
    link = parts.joint("joint_lift", mast, carriage, (0.0, 0.0, 0.3), Z, (0.0, 1.1), "prismatic")
    for stage in range(4):
        tube, out = parts.link(f"stage_{stage}", (0.04, 0.2, 0.04)), (0.0, -1.0, 0.0)
        link = parts.joint(f"joint_arm_{stage}", link, tube, (0.0, -0.02, 0.0), out, (0.0, 0.13), "prismatic")
    yaw = parts.link("wrist", (0.05, 0.05, 0.05))
    link = parts.joint("joint_wrist_yaw", link, yaw, (0.0, -0.1, 0.0))
    parts.gripper(link, "gripper")
    parts.head(mast, 2, 1.3)
    found, draft = drafted(parts, tmp_path)
    robot = bind_draft(draft, tmp_path / "robot.urdf")
    assert found["torso"] == robot.torso == "joint_lift"
    assert found["arms"]["arm"]["hand"] == "gripper_palm"
    assert found["camera"]["neck"] == ["head_0_joint", "head_1_joint"]


def test_a_scara_arm_on_a_lift_is_an_arm(tmp_path: Path) -> None:
    parts = Parts()
    link = parts.torso(parts.base("wheels"), "l")
    for number, name in enumerate(("shoulder", "elbow", "wrist")):
        upper = parts.link(f"{name}_link", (0.3, 0.06, 0.06), (0.15, 0.0, 0.0))
        link = parts.joint(f"{name}_yaw", link, upper, (0.32 * bool(number), 0.0, 0.0))
    parts.gripper(link, "hand")
    found, _ = drafted(parts, tmp_path)
    assert (found["torso"], found["arms"]["arm"]["hand"]) == ("torso_0_joint", "hand_palm")


# Bases


@pytest.mark.parametrize("base", ["wheels", "planar", "floating", "odometry", "legs"])
def test_what_moves_the_base_is_no_joint_of_an_arm(base: str, tmp_path: Path) -> None:
    parts, wrist = one_arm(base)
    parts.gripper(wrist, "gripper")
    found, draft = drafted(parts, tmp_path)
    robot = bind_draft(draft, tmp_path / "robot.urdf")
    assert not robot.base.fixed
    assert [len(arm.joints) for arm in robot.arms] == [6]
    assert found["arms"]["arm"]["hand"] == "gripper_palm"


def test_a_robot_with_legs_is_moved_as_a_whole_on_its_soles(tmp_path: Path) -> None:
    parts, wrist = one_arm("legs")
    parts.gripper(wrist, "gripper")
    found, draft = drafted(parts, tmp_path)
    assert "legs carry it, from left_hip_yaw on: it is moved as a whole" in draft.text()
    assert found["mount"]["at"] == pytest.approx([0.0, 0.0, 0.62], abs=0.001)
    assert found["mount"]["size"][2] < 0.02


def test_a_robot_without_an_arm_says_what_moves_most(tmp_path: Path) -> None:
    parts = Parts()
    parts.arm(parts.base("wheels"), "pole", 2, 0.0)
    _, draft = drafted(parts, tmp_path)
    (found,) = (one.message for one in draft.diagnostics() if one.message.startswith("[arms.arm]"))
    assert "no chain of 4 or more joints ends in a hand" in found
    assert 'most joints, 2, move pole_1_link: state tip = "pole_1_link" if that is a hand' in found


def test_a_camera_that_an_arm_moves_is_named(tmp_path: Path) -> None:
    parts, wrist = one_arm()
    parts.gripper(wrist, "gripper")
    parts.fixed(wrist, parts.link("wrist_camera_optical_frame"))
    _, draft = drafted(parts, tmp_path)
    assert any("wrist_camera_optical_frame" in one.message for one in draft.diagnostics() if one.code == "B016")


def test_a_camera_that_a_neck_tilts_on_the_waist_of_an_arm_is_a_head(tmp_path: Path) -> None:
    parts = Parts()
    waist = parts.torso(parts.base("wheels"), "y")
    wrist = parts.arm(waist, "arm", 6, 0.0)
    parts.gripper(wrist, "gripper")
    camera_link = parts.link("camera_link", (0.03, 0.1, 0.03))
    parts.fixed(parts.joint("head_tilt_joint", waist, camera_link, (0.0, 0.0, 0.5), Y), parts.link("optical_frame"))
    found, _ = drafted(parts, tmp_path)
    assert (found["camera"]["link"], found["camera"]["neck"]) == ("optical_frame", ["head_tilt_joint"])


# Anything built of parts


@st.composite
def robots(draw: st.DrawFn) -> tuple[Parts, dict[str, tuple[int, str]], int, bool, str]:
    """A robot with its arms (name -> joints, hand), joints of the head, whether it drives, and the torso's joints."""
    parts = Parts()
    kind = draw(st.sampled_from(["wheels", "planar", "floating", "odometry", "legs", "fixed"]))
    torso = draw(st.text("yp", max_size=6)) if draw(st.booleans()) else draw(st.sampled_from(["", "l", "ly", "lyp"]))
    chest = parts.torso(parts.base(kind), torso)
    sides = draw(st.sampled_from([("a",), ("left", "right"), ("left", "right", "third")]))
    named = draw(st.booleans())
    arms: dict[str, tuple[int, str]] = {}
    for number, side in enumerate(sides):
        joints = draw(st.integers(4, 8))
        name = f"{side}_arm" if named else f"joint{number}"
        wrist = parts.arm(chest, name, joints, (0.0, 0.2, -0.2)[number] if len(sides) == 3 else (0.2, -0.2)[number])
        fingers = draw(st.integers(1, 5))
        phalanges = draw(st.integers(1, 3)) if fingers > 2 else 1
        hand = parts.gripper(wrist, f"{side}_hand", fingers=fingers, phalanges=phalanges, mimics=draw(st.booleans()))
        arms[name] = joints, hand
        lamp = draw(st.none() | st.integers(0, joints - 2))
        if lamp is not None:
            parts.lamp(f"{name}_{lamp}_link", f"{side}_beacon")
    head = draw(st.integers(0, 3))
    parts.head(chest, head)
    return parts, arms, head, kind != "fixed", torso


@settings(max_examples=examples(60), suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
@given(robots())
def test_a_robot_built_of_parts_has_exactly_these_parts(
    tmp_path: Path, built: tuple[Parts, dict[str, tuple[int, str]], int, bool, str]
) -> None:
    parts, arms, head, drives, torso = built
    mechanism = Mechanism(grounded(parts.written(tmp_path / "robot.urdf")))
    anatomy = Anatomy(mechanism)
    own = {name: _own(limb, name) for name in arms for limb in anatomy.arms if limb.hand == arms[name][1]}
    assert own == {name: joints for name, (joints, _) in arms.items()}
    assert len(anatomy.arms) == len(arms)
    raised = mechanism.lift([limb.hand for limb in anatomy.arms])
    assert (raised and raised.name) == ("torso_0_joint" if torso.startswith("l") else None)
    moving = [joint.name for limb in anatomy.arms for joint in limb.joints if joint is not raised]
    seen = camera(mechanism, [name for name in moving if not name.startswith("torso")])
    assert seen == "camera_optical_frame"
    assert len([name for name in mechanism.movers(seen) if name.startswith("head")]) == head
    assert bool(anatomy.wheels or anatomy.legs or mechanism.path != tmp_path / "robot.urdf") == drives


def _own(limb: Limb, name: str) -> int:
    return sum(joint.name.startswith(name) for joint in limb.joints)
