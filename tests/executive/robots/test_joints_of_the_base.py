"""Joints that stand for the motion of a base, and what a robot file says of torso and neck."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from executive.locations.reachability import GraspClass
from executive.locations.reachability_maps import build_map
from executive.robots import Robot, bind_robot
from executive.robots.arms import arm_models, gaze_of, with_carrying
from executive.robots.draft import draft_of
from planlang.diagnostics import BadInput
from sim import PlanningWorld, Scene
from tests.support.box_robots import AHEAD, ARM, ODOMETRY, SCARA, Row, box, joint, robot

FREE: dict[str, Sequence[Row]] = {
    "floating": (("free", "floating", "0 0 1", "0 0 0", "0", "0"),),
    "planar": (("free", "planar", "0 0 1", "0 0 0", "0", "0"),),
    "odometry": ODOMETRY,
    "named": tuple((f"mobile_{axis}", *row[1:4], "-1", "1") for axis, row in zip("xyt", ODOMETRY, strict=True)),
    "differential": (ODOMETRY[0], ODOMETRY[2]),
    "without end": tuple((*row[:4], "-999999", "999999") for row in ODOMETRY),
    "revolute yaw": (*ODOMETRY[:2], ("odom_t", "revolute", "0 0 1", "0 0 0", "-10", "10")),
}


def made(folder: Path, text: str, **edits: str) -> Path:
    """The robot file that is made from a URDF, with the values of some keys replaced."""
    (folder / "boxes.urdf").write_text(text)
    lines = draft_of(folder / "boxes.urdf").text().splitlines()
    lines = [
        next((f"{key} = {new}" for key, new in edits.items() if line.startswith(f"{key} ")), line) for line in lines
    ]
    (folder / "boxes.toml").write_text("\n".join(lines))
    return folder / "boxes.toml"


def said_of(folder: Path, more: str) -> str:
    """The error about a robot file to which a line is added at the top."""
    path = made(folder, robot(below=ODOMETRY))
    path.write_text(more + "\n" + path.read_text())
    with pytest.raises(BadInput) as caught:
        bind_robot(path)
    (problem,) = caught.value.diagnostics
    assert problem.code == "B011"
    return problem.message


@pytest.mark.parametrize("kind", FREE)
def test_joints_that_move_the_robot_as_a_whole_belong_to_its_base(tmp_path: Path, kind: str) -> None:
    bound = bind_robot(made(tmp_path, robot(below=FREE[kind])))
    (arm,) = bound.arms
    assert arm.joints == tuple(row[0] for row in ARM)
    assert not bound.base.fixed
    assert (bound.torso, bound.base_link, arm.base_link) == (None, "world", "body")
    world = PlanningWorld(Scene(()), bound.body())
    assert set(world.robot.limits).isdisjoint(row[0] for row in FREE[kind])
    carrying = with_carrying(bound).postures["carrying"]
    assert set(carrying) == set(arm.joints)
    world.close()


def test_slides_with_a_shape_or_of_a_short_way_are_joints_of_the_arm(tmp_path: Path) -> None:
    gantry = [(f"rail_{k}", "prismatic", axis, "0 0 0.1", "0", "1") for k, axis in enumerate(("1 0 0", "0 1 0"))]
    (arm,) = bind_robot(made(tmp_path, robot([*gantry, *ARM]))).arms
    assert arm.joints[:2] == ("rail_0", "rail_1")
    (arm,) = bind_robot(made(tmp_path, robot(below=gantry))).arms
    assert arm.joints[:2] == ("rail_0", "rail_1")


def test_the_torso_that_a_robot_file_states_is_the_torso(tmp_path: Path) -> None:
    stages = [(f"stage_{k}", "prismatic", "1 0 0", "0.05 0 0", "0", "0.1") for k in range(3)]
    text = robot([SCARA[0], *stages, *SCARA[1:]], along=AHEAD)
    assert bind_robot(made(tmp_path, text)).torso == "lift", "the slide upwards, not the last one"
    path = made(tmp_path, text)
    lines = [line for line in path.read_text().splitlines() if not line.startswith("torso")]
    path.write_text('torso = "stage_1"\n' + "\n".join(lines))
    bound = bind_robot(path)
    assert bound.torso == "stage_1"
    assert "stage_1" not in bound.arms[0].joints


def test_a_torso_that_moves_no_arm_and_joints_of_the_base_are_refused(tmp_path: Path) -> None:
    assert said_of(tmp_path, 'torso = "wheel_left"') == "torso: wheel_left moves none of the arms"
    stated = said_of(tmp_path, 'torso = "odom_y_joint"')
    assert stated == "torso: odom_y_joint moves the base, not a part of it"


def neck_of(count: int) -> list[str]:
    """A neck of so many joints, with a camera."""
    parts, parent = list[str](), "body"
    for k in range(count):
        row = (f"neck_{k}", "revolute", ("0 0 1", "0 1 0")[k % 2], "0 0 0.1", "-1.5", "1.5")
        parts += [joint(row, parent), f'<link name="neck_{k}_link">{box("0.02 0.02 0.02")}</link>']
        parent = f"neck_{k}_link"
    optical = f'<joint name="eye" type="fixed"><parent link="{parent}"/><child link="camera_optical_frame"/></joint>'
    return [*parts, optical, '<link name="camera_optical_frame"/>']


def test_the_last_three_joints_of_a_long_neck_aim_the_camera(tmp_path: Path) -> None:
    bound = bind_robot(made(tmp_path, robot(inside=neck_of(7))))
    assert len(bound.neck) == 7
    gaze = gaze_of(bound)
    assert gaze is not None
    assert gaze.joints == ("neck_4", "neck_5", "neck_6")
    _, missed, _ = gaze.at(np.array([0.8, 0.3, 1.4]))
    assert missed < 0.1


def reach_of(bound: Robot, grasp: GraspClass) -> int:
    """How many poses the only arm of a robot reaches."""
    world = PlanningWorld(Scene(()), bound.body())
    (model,) = arm_models(bound, world)
    world.close()
    return len(build_map(model, grasp))


def test_an_arm_on_a_lift_and_odometry_reaches_from_the_side(tmp_path: Path) -> None:
    bound = bind_robot(made(tmp_path, robot(SCARA, below=ODOMETRY, along=AHEAD)))
    assert bound.torso == "lift"
    assert reach_of(bound, GraspClass.SIDE) > 5000
