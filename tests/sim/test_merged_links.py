"""Robots with more links than PyBullet takes: those that never move are merged, and keep their names and poses."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from executive.pictures.drawn import looks_of_links
from executive.robots.mechanism import Mechanism
from planlang.diagnostics import BadInput
from planlang.protocols import Configuration
from sim import Body, CameraModel, PlanningWorld, RobotBody, Scene
from sim.description import MOST_JOINTS, read_description
from tests.support.box_robots import ARM, box, robot


def frames(count: int, solid: int) -> Iterator[str]:
    """Fixed links on the elbow, each on the one before and turned; the last ``solid`` have shapes."""
    parent = "elbow_link"
    for k in range(count):
        shape = box("0.02 0.02 0.02") if k >= count - solid else ""
        origin = f'<origin xyz="0.01 0.002 -0.004" rpy="0.1 {-0.2 + 0.01 * k} 0.{k % 7}"/>'
        ends = f'<parent link="{parent}"/><child link="frame_{k}"/>'
        yield f'<joint name="to_{k}" type="fixed">{ends}{origin}</joint><link name="frame_{k}">{shape}</link>'
        parent = f"frame_{k}"


def written(folder: Path, *inside: str) -> Path:
    """The URDF of an arm of boxes with more elements."""
    (folder / "many.urdf").write_text(robot(inside=inside))
    return folder / "many.urdf"


def world_of(path: Path, *bodies: Body, allowed: tuple[tuple[str, str], ...] = ()) -> PlanningWorld:
    """A world with the robot, bent at the elbow."""
    body = RobotBody(path, CameraModel("frame_3"), {"hand": ("frame_119",)}, allowed)
    world = PlanningWorld(Scene(bodies), body)
    world.set_configuration(Configuration((0.3, -0.2, 0.7), {row[0]: 0.0 for row in ARM} | {"pan": 0.4}))
    return world


def test_frames_without_shapes_are_merged_first_and_stay_where_they_are(tmp_path: Path) -> None:
    path = written(tmp_path, *frames(140, 20))
    description = read_description(path)
    mechanism = Mechanism(path)
    assert description.text.count("<joint ") == MOST_JOINTS
    assert set(description.merged).isdisjoint(f"frame_{k}" for k in range(120, 140))
    world = world_of(path)
    world.set_configuration(Configuration((0.0, 0.0, 0.0), {row[0]: 0.0 for row in ARM}))
    for link in mechanism.links:
        np.testing.assert_allclose(world.link_pose(link).matrix(), mechanism.frame(link), atol=2e-6)
    world.close()


def test_few_links_are_left_as_they_are(tmp_path: Path) -> None:
    assert not read_description(written(tmp_path, *frames(100, 0))).merged


def test_the_shape_of_a_merged_link_touches_and_is_drawn_where_it_is(tmp_path: Path) -> None:
    few = world_of(written(tmp_path, *frames(100, 0)))
    few.close()
    path = written(tmp_path, *frames(140, 140))
    merged = read_description(path).merged
    assert merged["frame_9"][0] == "elbow_link"
    world = world_of(path)
    pose = world.link_pose("frame_9")
    in_carrier = world.link_pose("elbow_link").inverse() @ pose
    world.close()
    world = world_of(path, Body("pea", pose, (0.005, 0.005, 0.005)))
    assert {contact.part for contact in world.contacts()} >= {"elbow_link"}
    looks = looks_of_links(world.robot)["elbow_link"]
    assert min(np.abs(look.pose.matrix() - in_carrier.matrix()).max() for look in looks) < 1e-6
    assert world.robot.whole("frame_9") == "elbow_link"
    world.close()


def test_too_many_moving_joints_are_counted_in_the_message(tmp_path: Path) -> None:
    turning = "".join(frames(130, 0)).replace('type="fixed"', 'type="continuous"')
    with pytest.raises(BadInput) as caught:
        read_description(written(tmp_path, turning))
    (problem,) = caught.value.diagnostics
    moving = len(ARM) + 2 + 2 + 130
    assert problem.message == f"the robot has {moving} moving joints; the simulator takes at most 127"
    assert problem.help is not None
    assert problem.help.endswith(f"1 of them mimic others: {moving - 127} or more")


def test_a_joint_that_mimics_a_fixed_one_is_where_that_puts_it(tmp_path: Path) -> None:
    text = robot().replace('name="left_finger" type="prismatic"', 'name="left_finger" type="fixed"')
    text = text.replace('<mimic joint="left_finger"/>', '<mimic joint="left_finger" offset="0.02"/>')
    (tmp_path / "fixed.urdf").write_text(text)
    world = PlanningWorld(Scene(()), RobotBody(tmp_path / "fixed.urdf", CameraModel("body")))
    assert "right_finger" not in world.robot.limits
    finger = world.link_pose("hand").inverse() @ world.link_pose("right_finger_link")
    assert finger.position[1] == pytest.approx(-0.02, abs=1e-6)
    world.close()


def test_the_length_of_an_axis_does_not_count(tmp_path: Path) -> None:
    limit = '<limit lower="0" upper="0.045"'
    (tmp_path / "long.urdf").write_text(robot().replace(f'"0 1 0"/>{limit}', f'"0 3 0"/>{limit}'))
    world = PlanningWorld(Scene(()), RobotBody(tmp_path / "long.urdf", CameraModel("body")))
    world.set_configuration(Configuration((0.0, 0.0, 0.0), {"left_finger": 0.04}))
    finger = world.link_pose("hand").inverse() @ world.link_pose("left_finger_link")
    assert finger.position[1] == pytest.approx(0.04, abs=1e-5)
    world.close()
