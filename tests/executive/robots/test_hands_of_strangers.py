"""Hands as public URDFs draw them: markers, springs, sensors as joints, shapes around the grip point, many fingers."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from executive.locations.capabilities import capabilities_of
from executive.locations.reachability import GraspClass
from executive.locations.reachability_maps import build_map
from executive.pictures.robot_picture import FORWARD, hand_picture, robot_picture
from executive.robots import Robot, bind_draft, bind_robot
from executive.robots.arms import arm_models, with_carrying
from executive.robots.draft import draft_of
from executive.robots.matching import possessions_of
from executive.robots.mechanism import markers
from planlang.diagnostics import Diagnostic
from sim import PlanningWorld, Scene
from tests.support.hands import TWO, robot_with
from tests.support.robot_parts import Parts, X, Y


def drafted(path: Path) -> tuple[dict[str, Any], Robot, list[Diagnostic]]:
    """The draft of a URDF's robot file as data, the robot that it is, and what was said."""
    draft = draft_of(path)
    return tomllib.loads(draft.text()), bind_draft(draft, path.with_suffix(".toml")), draft.diagnostics()


def with_gripper(parts: Parts) -> str:
    """Add a base, an arm of six joints and a gripper of two fingers; returns its palm."""
    return parts.gripper(parts.arm(parts.base("wheels"), "arm", 6, 0.0, at=(0.1, 0.35)), "arm")


def test_a_dot_at_the_grip_point_is_no_palm(tmp_path: Path) -> None:
    parts = Parts()
    palm = with_gripper(parts)
    parts.fixed(palm, parts.link("grasp_center", (0.004, 0.004, 0.006)), (0.0, 0.0, 0.11))
    path = parts.written(tmp_path / "dotted.urdf")
    assert markers(path) == ("grasp_center",)
    _, robot, _ = drafted(path)
    assert robot.arms[0].tip == "grasp_center"
    world = PlanningWorld(Scene(()), robot.body())
    (arm,) = arm_models(robot, world)
    world.close()
    assert "arm_palm" in arm.hand_links
    assert max(np.array(arm.palm) @ arm.frame.approach) < -0.05, "the palm is behind the grip point"
    (held,) = capabilities_of(with_carrying(robot)).holdings
    assert held.widest == pytest.approx(0.08)


def test_a_tool_of_some_size_at_the_end_of_an_arm_keeps_its_shape(tmp_path: Path) -> None:
    parts = Parts()
    palm = with_gripper(parts)
    parts.fixed(palm, parts.link("tool_plate", (0.04, 0.04, 0.01)))
    assert markers(parts.written(tmp_path / "plate.urdf")) == ()


def test_springs_in_fingers_are_no_motors(tmp_path: Path) -> None:
    parts = Parts()
    wrist = parts.arm(parts.base("wheels"), "arm", 6, 0.0, at=(0.1, 0.35))
    palm = parts.fixed(wrist, parts.link("palm", (0.05, 0.14, 0.04)), (0.0, 0.0, 0.08))
    for name, y in (("left", 1.0), ("right", -1.0)):
        root = parts.link(f"{name}_root", (0.01, 0.01, 0.03), (0.0, 0.0, 0.015))
        slide = parts.joint(
            f"{name}_finger", palm, root, (0.0, 0.01 * y, 0.03), (0.0, y, 0.0), (0.0, 0.04), "prismatic"
        )
        tip = parts.link(f"{name}_finger_tip", (0.01, 0.01, 0.06), (0.0, 0.0, 0.03))
        parts.joint(f"{name}_spring_joint", slide, tip, (0.0, 0.0, 0.03), (-y, 0.0, 0.0), (0.0, 0.7))
    found, _, said = drafted(parts.written(tmp_path / "springs.urdf"))
    assert set(found["arms"]["arm"]["gripper"]["opened"]) == {"left_finger", "right_finger"}
    assert found["arms"]["arm"]["gripper"]["max_opening"] == pytest.approx(0.95 * 0.09, abs=0.003)
    assert not any("it may be an arm" in one.message for one in said)


def test_a_sensor_drawn_as_a_joint_that_cannot_move_is_no_joint_of_the_arm(tmp_path: Path) -> None:
    parts = Parts()
    wrist = parts.arm(parts.base("wheels"), "arm", 6, 0.0, at=(0.1, 0.35))
    sensor = parts.link("wrist_ft_sensor_frame", (0.05, 0.05, 0.01))
    parts.joint("wrist_ft_sensor_joint", wrist, sensor, (0.0, 0.0, 0.07), limits=(0.0, 0.0))
    parts.gripper(sensor, "arm")
    _, robot, said = drafted(parts.written(tmp_path / "sensing.urdf"))
    assert len(robot.arms[0].joints) == 6
    assert not any("wrist_ft_sensor" in one.message for one in said)
    assert not any("cannot move" in one.what for one in capabilities_of(with_carrying(robot)).warnings)


@pytest.mark.parametrize(("travel", "opening"), [(0.045, 0.086), (0.08, 0.152), (0.2, 0.38)])
def test_sliding_fingers_open_as_far_as_their_joints_and_no_hand_30_cm(
    travel: float, opening: float, tmp_path: Path
) -> None:
    parts = Parts()
    with_gripper(parts)
    parts.elements = [one.replace('upper="0.045"', f'upper="{travel}"') for one in parts.elements]
    found, _, said = drafted(parts.written(tmp_path / "wide.urdf"))
    assert found["arms"]["arm"]["gripper"]["max_opening"] == pytest.approx(opening, abs=0.003)
    assert any("wider than hands open" in one.message for one in said) == (opening > 0.3)


def test_tips_that_stay_parallel_open_wide_though_their_motor_turns_without_a_shape(tmp_path: Path) -> None:
    parts = Parts()
    wrist = parts.arm(parts.base("wheels"), "arm", 6, 0.0, at=(0.1, 0.35))
    palm = parts.fixed(wrist, parts.link("palm", (0.05, 0.08, 0.04)), (0.0, 0.0, 0.08))
    parts.joint("motor_joint", palm, parts.link("motor"), (0.0, 0.0, 0.02), X, (-0.5, 1.2))
    for name, y in (("left", 1.0), ("right", -1.0)):
        bar = parts.link(f"{name}_bar", (0.01, 0.01, 0.06), (0.0, 0.0, 0.03))
        tip = parts.link(f"{name}_tip", (0.02, 0.01, 0.04), (0.0, 0.0, 0.02))
        for joint, parent, child, at, sign in (
            (f"{name}_bar_joint", palm, bar, (0.0, 0.03 * y, 0.02), -y),
            (f"{name}_tip_joint", bar, tip, (0.0, 0.0, 0.06), y),
        ):
            parts.joint(joint, parent, child, at, X, (-1.5, 1.5))
            follows = f'<mimic joint="motor_joint" multiplier="{sign}"/></joint>'
            parts.elements[-1] = parts.elements[-1].replace("</joint>", follows)
    found, _, _ = drafted(parts.written(tmp_path / "wide.urdf"))
    widest = 2 * (0.03 + 0.06 * np.sin(1.2) - 0.005)
    assert widest > 0.15
    assert found["arms"]["arm"]["gripper"]["max_opening"] == pytest.approx(0.95 * widest, abs=0.004)


def test_the_limits_to_write_are_on_the_side_of_those_of_the_urdf(tmp_path: Path) -> None:
    parts = Parts()
    palm = parts.arm(parts.base("wheels"), "arm", 6, 0.0, at=(0.1, 0.35))
    for name, y, limits in (("left", 1.0, (0.0, 1.0)), ("right", -1.0, (-1.0, 0.0))):
        finger = parts.link(f"{name}_finger", (0.02, 0.012, 0.09), (0.0, 0.006 * y, 0.045))
        parts.joint(f"{name}_finger_joint", palm, finger, (0.0, 0.0, 0.08), Y, limits, "prismatic")
    text = draft_of(parts.written(tmp_path / "long.urdf")).text()
    assert "# [joints.left_finger_joint]\n# limits = [0.0, 0.04]" in text
    assert "# [joints.right_finger_joint]\n# limits = [-0.04, 0.0]" in text


def test_a_shape_around_the_grip_point_is_named(tmp_path: Path) -> None:
    parts = Parts()
    wrist = parts.arm(parts.base("wheels"), "arm", 6, 0.0, at=(0.1, 0.35))
    palm = parts.fixed(wrist, parts.link("hull_of_all", (0.15, 0.15, 0.4), (0.0, 0.0, 0.1)), (0.0, 0.0, 0.08))
    for number, y in enumerate((1.0, -1.0)):
        finger = parts.link(f"finger{number}")
        parts.joint(
            f"finger{number}_joint", palm, finger, (0.0, 0.01 * y, 0.1), (0.0, y, 0.0), (0.0, 0.04), "prismatic"
        )
    _, robot, _ = drafted(parts.written(tmp_path / "hulled.urdf"))
    advice = [str(one) for one in capabilities_of(with_carrying(robot)).warnings]
    assert any(
        "the <collision> shape of hull_of_all covers the grip point of the arm, so nothing fits between its fingers"
        in one
        for one in advice
    )


def test_a_hand_whose_fingers_have_no_collision_shape_is_a_guess_that_says_so(tmp_path: Path) -> None:
    parts = Parts()
    with_gripper(parts)
    parts.elements = [one.replace("collision>", "visual>") if "arm_finger" in one else one for one in parts.elements]
    path = parts.written(tmp_path / "drawn.urdf")
    bare = "arm_finger0 and arm_finger1 have no <collision> shape"
    draft = draft_of(path)
    for key in ("tool_offset", "max_opening"):
        above = draft.text().partition(f"\n{key} = ")[0].splitlines()[-1]
        assert f"doubtful: {bare}; add such shapes to the URDF" in above
        assert "the fingertips" not in above
        assert "gap" not in above
    _, robot, _ = drafted(path)
    can = capabilities_of(with_carrying(robot))
    assert str(can.holdings[0]) == f"not known, as {bare}"
    assert str(can.warnings[0]) == (
        f"{bare}, so what the hand of the arm holds is not known: add such shapes to the URDF"
    )


def test_a_single_finger_needs_a_palm_with_a_shape(tmp_path: Path) -> None:
    parts = Parts()
    wrist = parts.arm(parts.base("wheels"), "arm", 6, 0.0, at=(0.1, 0.35))
    palm = parts.link("palm", (0.05, 0.05, 0.1), (0.0, -0.03, 0.05))
    parts.elements[-1] = parts.elements[-1].replace("collision>", "visual>")
    hand = parts.joint("wrist_turn", wrist, palm, (0.0, 0.0, 0.08))
    jaw = parts.link("jaw", (0.02, 0.012, 0.06), (0.0, 0.006, 0.03))
    parts.joint("jaw_joint", hand, jaw, (0.0, 0.0, 0.04), X, (-0.05, 0.0))
    _, robot, said = drafted(parts.written(tmp_path / "jaw.urdf"))
    (found,) = (one.message for one in said if "max_opening" in one.message)
    assert "no gap between two fingers was found, as palm has no <collision> shape: add such shapes" in found
    world = PlanningWorld(Scene(()), robot.body())
    (arm,) = arm_models(robot, world)
    world.close()
    assert robot.arms[0].gripper is None
    assert arm.bare == "palm has no <collision> shape", "what robot inspect says about the gripper that is missing"


def boxes(*spans: tuple[tuple[float, float], ...]) -> str:
    """Write an OBJ of the corners of boxes between lower and upper coordinates."""
    faces = "1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4"
    lines = [f"v {x} {y} {z}" for span in spans for x in span[0] for y in span[1] for z in span[2]]
    corners = ([str(8 * k + int(one)) for one in face.split()] for k in range(len(spans)) for face in faces)
    return "\n".join([*lines, *(f"f {' '.join(face)}" for face in corners)])


@pytest.mark.parametrize("apart", [False, True])
def test_a_fixed_finger_on_the_link_of_the_palm_fills_the_gap_by_its_hull(apart: bool, tmp_path: Path) -> None:
    palm, finger = ((-0.02, 0.02), (-0.06, 0.06), (0.0, 0.03)), ((-0.01, 0.01), (-0.06, -0.05), (0.03, 0.13))
    mesh = '<collision><geometry><mesh filename="{}.obj"/></geometry></collision></link>'
    for name, spans in (("palm", [palm]), ("fixed", [finger]), ("both", [palm, finger])):
        (tmp_path / f"{name}.obj").write_text(boxes(*spans))
    parts = Parts()
    hand = parts.fixed(parts.arm(parts.base("wheels"), "arm", 6, 0.0, at=(0.1, 0.35)), parts.link("palm"), (0, 0, 0.08))
    parts.elements = [
        one.replace('"palm"></link>', f'"palm">{mesh.format("palm" if apart else "both")}') for one in parts.elements
    ]
    if apart:
        parts.fixed(hand, parts.link("fixed"))
        parts.elements = [one.replace('"fixed"></link>', f'"fixed">{mesh.format("fixed")}') for one in parts.elements]
    moving = parts.link("jaw", (0.02, 0.01, 0.1), (0.0, 0.005, 0.08))
    frame = parts.fixed(hand, parts.link("frame"))
    parts.joint("jaw_joint", frame, moving, (0.0, -0.05, 0.0), Y, (0.0, 0.09), "prismatic")
    found, robot, _ = drafted(parts.written(tmp_path / "jaw.urdf"))
    assert found["arms"]["arm"]["gripper"]["max_opening"] == pytest.approx(0.95 * 0.09, abs=0.003)
    can = capabilities_of(with_carrying(robot))
    said = [str(one) for one in can.warnings]
    assert (
        any(
            "as the convex hull of palm, which is palm and finger in one, fills the gap: make that finger" in one
            for one in said
        )
        != apart
    )


def test_a_missing_mesh_of_the_base_makes_no_opening_doubtful(tmp_path: Path) -> None:
    parts = Parts()
    with_gripper(parts)
    inertia = '<inertial><mass value="0.1"/><inertia ixx="2e-5" iyy="2e-5" izz="1e-6"/></inertial>'
    mesh = f'{inertia}<collision><geometry><mesh filename="lost.stl"/></geometry></collision>'
    elements = parts.elements
    for link, said in (
        ("base_link", "gap between the opened fingers\n"),
        ("arm_finger0", "boxes stand for the meshes of arm_finger0, which are missing or unreadable"),
    ):
        parts.elements = [re.sub(rf'(<link name="{link}">).*</link>', rf"\1{mesh}</link>", one) for one in elements]
        text = draft_of(parts.written(tmp_path / f"{link}.urdf")).text()
        assert said in text
        assert ("boxes stand for" in text) == (link != "base_link")


def test_fingers_that_cannot_be_told_apart_make_an_opening_doubtful(tmp_path: Path) -> None:
    parts = Parts()
    wrist = parts.arm(parts.base("wheels"), "arm", 6, 0.0, at=(0.1, 0.35))
    parts.gripper(wrist, "arm", fingers=5, phalanges=2)
    path = parts.written(tmp_path / "five.urdf")
    assert not any("max_opening" in one.message for one in drafted(path)[2] if one.code == "B017")
    motor = '<mimic joint="arm_thumb_0"/></joint>'
    path.write_text("".join(
        one.replace("</joint>", motor) if one.startswith('<joint name="arm_finger') else one
        for one in [f'<robot name="one">{"".join(parts.elements)}</robot>'.replace("<joint ", "\n<joint ")]
        for one in one.splitlines()
    ))  # fmt: skip
    doubts = [one.message for one in drafted(path)[2] if one.code == "B017"]
    assert any("arm_thumb_0 moves the thumb and fingers at once; the hand's data sheet says" in one for one in doubts)


def test_a_camera_looks_where_it_is_mounted_to_look(tmp_path: Path) -> None:
    parts = Parts()
    palm = with_gripper(parts)
    assert palm
    parts.link("head_camera_link")
    parts.elements.append(
        '<joint name="on_head" type="fixed"><parent link="base_link"/><child link="head_camera_link"/>'
        '<origin xyz="0 0 1" rpy="-1.5708 0 -1.5708"/></joint>'
    )
    found, _, _ = drafted(parts.written(tmp_path / "seeing.urdf"))
    assert (found["camera"]["forward"], found["camera"]["up"]) == ([0, 0, 1], [0, -1, 0])


def test_an_arm_of_few_freedoms_prefers_postures_from_which_it_goes_straight_ahead(tmp_path: Path) -> None:
    parts = Parts()
    base = parts.base("wheels")
    link = parts.joint("lift", base, parts.link("carriage"), (0.0, 0.0, 0.4), limits=(0.0, 0.8), kind="prismatic")
    link = parts.joint("telescope", link, parts.link("inner"), (0.2, 0.0, 0.0), X, (0.0, 0.4), "prismatic")
    for number, axis in enumerate(((0.0, 0.0, 1.0), Y, X)):
        link = parts.joint(f"wrist_{number}", link, parts.link(f"wrist_{number}_link"), (0.05, 0.0, 0.0), axis)
    robot_file = tmp_path / "reaching.toml"
    parts.written(tmp_path / "reaching.urdf")
    robot_file.write_text(
        'name = "reaching"\nurdf = "reaching.urdf"\ntorso = "lift"\n[base]\nradius = 0.4\nspeed = 1.0\n'
        "acceleration = 1.0\nturn_speed = 1.0\nturn_acceleration = 1.0\njerk = 5.0\n"
        '[arms.arm]\ntip = "wrist_2_link"\napproach = [1, 0, 0]\nclosing = [0, 1, 0]\n'
    )
    robot = bind_robot(robot_file)
    world = PlanningWorld(Scene(()), robot.body())
    (arm,) = arm_models(robot, world)
    world.close()
    found = build_map(arm, GraspClass.SIDE)
    good = found.rows["score"] > 0.05
    yaw = found.postures[found.rows["posture"]][:, 1]
    assert good.any()
    assert np.abs(np.sin(yaw[good])).max() < 0.01, "the hand points along the telescope"
    assert np.abs(np.sin(yaw[~good])).min() > 1e-3


def test_the_picture_of_a_robot_has_an_arrow_forward() -> None:
    robot = bind_robot("amigo")
    world = PlanningWorld(Scene(()), robot.body())
    image = robot_picture(robot, world, (200, 200))
    world.close()
    dark = np.argwhere((np.abs(image.astype(int) - FORWARD[:3]) < 25).all(axis=2))
    assert len(dark) > 20
    assert np.median(dark[:, 0]) > 120, "it is on the floor"


def test_the_picture_of_a_hand_has_fingers_that_are_only_drawn(tmp_path: Path) -> None:
    path, urdf = robot_with(tmp_path, arm=TWO), tmp_path / "mine.urdf"
    parts = re.split(r"(?=<link )", urdf.read_text())
    drawn = (
        one.replace("collision>", "visual>") if re.match('<link name="arm_(left|right)"', one) else one for one in parts
    )
    urdf.write_text("".join(drawn))
    robot = bind_robot(path)
    world = PlanningWorld(Scene(()), robot.body())
    assert "arm_left" not in world.robot.solid_names
    image = hand_picture(robot, robot.arms[0], world, (200, 200)).astype(int)
    world.close()
    orange = (image[..., 0] - image[..., 2] > 100) & (image[..., 1] - image[..., 2] > 40)
    assert orange.sum() > 100


def test_a_base_that_is_fixed_has_a_next_step(tmp_path: Path) -> None:
    path = tmp_path / "stand.urdf"
    parts = Parts()
    parts.gripper(parts.arm(parts.link("stand", (0.2, 0.2, 0.1)), "arm", 6, 0.0), "arm")
    lacks = possessions_of(bind_robot(parts.written(path))).lacks["BaseMotionCapability"]
    for said in ("fixed = false", "[base]", "[mount]", "pass_a_drink", "where it starts"):
        assert said in lacks


def test_a_hand_without_its_meshes_opens_as_far_as_its_fingertips_travel(corpus: Path) -> None:
    """Boxes of inertia fill more than fingers: between those of the PR2, which opens to 9 cm, there are 3.5 cm."""
    grippers = [arm.gripper for arm in bind_robot(corpus / "robots" / "pr2@hydro.urdf").arms]
    assert [gripper and 0.08 <= gripper.max_opening <= 0.1 for gripper in grippers] == [True, True]
