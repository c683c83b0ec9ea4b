"""The bundled URDF of the Amigo: frames as on the real robot, and its contacts with itself."""

import math
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

from planlang.protocols import Configuration
from sim import PlanningWorld, Scene
from tests.sim.conftest import AMIGO, TUCKED, URDF

SIDES = ("right", "left")


@pytest.fixture(scope="module")
def amigo():
    world = PlanningWorld(Scene(()), AMIGO)
    yield world
    world.close()


def _joints(path: Path) -> dict[str, ET.Element]:
    return {joint.get("name", ""): joint for joint in ET.parse(path).getroot().findall("joint")}


def _vector(joint: ET.Element, tag: str, attribute: str) -> list[float]:
    element = joint.find(tag)
    text = None if element is None else element.get(attribute)
    return [float(number) for number in (text or "0 0 0").split()]


def _ends(joint: ET.Element) -> list[str | None]:
    return [joint.find(tag).get("link") for tag in ("parent", "child")]  # type: ignore[union-attr]


def test_moving_joints_connect_and_turn_as_on_the_real_robot(corpus: Path) -> None:
    ours, theirs = _joints(URDF), _joints(corpus / "robots" / "amigo@hydro.urdf")
    for name, joint in ours.items():
        assert name in theirs
        assert joint.get("type") == theirs[name].get("type"), name
        assert _ends(joint) == _ends(theirs[name]), name
        if "batterycover" in name or name == "base_laser_joint":
            continue  # shapes of the base, no frames of a chain
        for attribute in ("xyz", "rpy"):
            expected = _vector(theirs[name], "origin", attribute)
            assert _vector(joint, "origin", attribute) == pytest.approx(expected, abs=2e-3), name
        if joint.get("type") != "fixed":
            axis = np.array(_vector(theirs[name], "axis", "xyz"))
            assert _vector(joint, "axis", "xyz") == pytest.approx(axis / np.linalg.norm(axis), abs=1e-6), name


def test_every_actuated_joint_of_the_real_robot_but_the_wheels_is_there(corpus: Path) -> None:
    theirs = _joints(corpus / "robots" / "amigo@hydro.urdf")
    assert {name for name, joint in theirs.items() if joint.get("type") in ("revolute", "prismatic")} == {
        name for name, joint in _joints(URDF).items() if joint.get("type") != "fixed"
    }


@pytest.mark.parametrize(("stroke", "height"), [(0.09, 0.91), (0.40, 1.22)])
def test_spindle_lifts_the_shoulders_from_91_to_122_cm(amigo: PlanningWorld, stroke: float, height: float) -> None:
    lifted = Configuration((0.0, 0.0, 0.0), {"spindle_joint": stroke})
    for side, y in zip(SIDES, (-0.22, 0.22), strict=True):
        shoulder = amigo.link_pose(f"shoulder_mount_{side}", lifted).position
        assert shoulder == pytest.approx((0.0, y, height), abs=1e-6)
    torso = amigo.link_pose("torso", lifted)
    assert torso.position[2] == pytest.approx(0.055 + 0.715 + stroke, abs=1e-6)
    assert torso.matrix()[:3, 0] == pytest.approx([0, 0, 1], abs=1e-6)


@pytest.mark.parametrize("side", SIDES)
def test_arm_is_74_cm_from_shoulder_to_grip_point_and_hangs_down_at_zero(amigo: PlanningWorld, side: str) -> None:
    arm = {name: 0.0 for name in TUCKED if side in name and "finger" not in name} | {"shoulder_yaw_joint_" + side: 0.0}
    straight = Configuration((0.0, 0.0, 0.0), {**arm, "spindle_joint": 0.3})
    shoulder = amigo.link_pose(f"shoulder_mount_{side}", straight)
    grip = amigo.link_pose(f"grippoint_{side}", straight)
    assert shoulder.distance(grip) == pytest.approx(0.74, abs=1e-3)
    assert grip.position[2] == pytest.approx(shoulder.position[2] - 0.74, abs=1e-3)


def test_camera_looks_ahead_at_zero_and_down_with_positive_tilt(amigo: PlanningWorld) -> None:
    level = amigo.link_pose("openni_rgb_optical_frame", Configuration((0, 0, 0), {}))
    assert level.matrix()[:3, 2] == pytest.approx([1, 0, 0], abs=1e-5)
    assert level.matrix()[:3, 1] == pytest.approx([0, 0, -1], abs=1e-5)
    tilted = Configuration((0, 0, 0), {"neck_tilt_joint": 0.5})
    down = amigo.link_pose("openni_rgb_optical_frame", tilted).matrix()[:3, 2]
    assert down[2] == pytest.approx(-math.sin(0.5), abs=1e-5)


POSTURES = {
    "hanging": {},
    "elbows bent": {"elbow_pitch": 1.5708},
    "folded": {"shoulder_pitch": -0.3, "elbow_pitch": 2.23},
    "forward": {"shoulder_pitch": 1.2, "elbow_pitch": 0.3},
    "sideways": {"shoulder_yaw": -1.4, "elbow_pitch": 0.5},
    "wrist up": {"elbow_pitch": 1.0, "wrist_pitch": 0.95, "wrist_yaw": 0.61, "elbow_roll": 1.83},
}


@pytest.mark.parametrize("posture", POSTURES)
@pytest.mark.parametrize("stroke", [0.15, 0.25, 0.40])
@pytest.mark.parametrize("fingers", [0.0, 0.4, 0.7])
def test_usual_postures_touch_nothing(amigo: PlanningWorld, posture: str, stroke: float, fingers: float) -> None:
    joints = {f"{joint}_joint_{side}": 0.0 for side in SIDES for joint in ("shoulder_yaw", "shoulder_pitch")}
    joints |= {f"{joint}_joint_{side}": value for side in SIDES for joint, value in POSTURES[posture].items()}
    joints |= {f"finger{k}_joint_{side}": sign * fingers for side in SIDES for k, sign in ((1, 1), (2, -1))}
    assert amigo.contacts(Configuration((0, 0, 0), {**joints, "spindle_joint": stroke})) == ()


def test_head_touches_nothing_wherever_it_looks(amigo: PlanningWorld) -> None:
    for pan in (-1.57, 0.0, 1.57):
        for tilt in (-0.5, 0.0, 0.88):
            joints = {"neck_pan_joint": pan, "neck_tilt_joint": tilt, "spindle_joint": 0.09}
            assert amigo.contacts(Configuration((0, 0, 0), {**TUCKED, **joints})) == ()


def test_hand_on_the_column_is_self_collision(amigo: PlanningWorld) -> None:
    joints = {"shoulder_roll_joint_right": 1.4, "elbow_pitch_joint_right": 1.6, "shoulder_pitch_joint_right": 0.0}
    contacts = amigo.contacts(Configuration((0, 0, 0), {**TUCKED, **joints}))
    assert {contact.body for contact in contacts} | {contact.part for contact in contacts} & {"base", "torso_slider"}


def test_link_and_joint_names_that_do_not_exist_are_refused_with_those_that_do(amigo: PlanningWorld) -> None:
    with pytest.raises(KeyError, match="grippoint_right"):
        amigo.link_pose("tool")
    with pytest.raises(ValueError, match="spindle_joint"):
        amigo.contacts(Configuration((0, 0, 0), {"torso_joint": 0.1}))


def test_the_shape_of_links_does_not_depend_on_where_the_robot_was_asked_for_it(amigo: PlanningWorld) -> None:
    other = PlanningWorld(Scene(()), AMIGO)
    other.set_configuration(Configuration((2.2, -0.45, 0.3), dict.fromkeys(TUCKED, 0.1)))
    for number in range(len(amigo.robot.solid)):
        one, two = amigo.robot.hulls(number), other.robot.hulls(number)
        assert [hull.pose for hull in one] == [hull.pose for hull in two]
    other.close()
