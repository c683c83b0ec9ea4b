"""Where the robot stands when a run begins."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

import pytest

from executive.robots import bind_robot
from executive.runs.assembly import world_at_start
from planlang.diagnostics import BadInput
from planlang.geometry import Pose
from sim import Body, Scene

ROBOT = """
name = "mine"
urdf = "robot.urdf"
[base]
radius = 0.2
speed = 0.5
acceleration = 0.5
turn_speed = 1.0
turn_acceleration = 1.0
jerk = 5.0
"""
URDF = """<robot name="mine"><link name="base">
  <collision><origin xyz="0 0 0.5"/><geometry><box size="0.2 0.2 1"/></geometry></collision>
  <collision><origin xyz="0.5 0 1"/><geometry><box size="1 0.1 0.1"/></geometry></collision>
</link></robot>"""
SHELF = Body("shelf", Pose((0.8, 0.0, 0.75)), (0.4, 2.0, 1.5))


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    """A pole on a small base that reaches 1 m ahead of it."""
    (tmp_path / "robot.urdf").write_text(URDF)
    (tmp_path / "robot.toml").write_text(ROBOT)
    return tmp_path / "robot.toml"


def test_a_robot_starts_where_its_arms_have_room_too(robot: Path) -> None:
    with ExitStack() as stack:
        world = world_at_start(Scene((SHELF,), (-2, -2, 2, 2)), bind_robot(robot), None, stack)
        assert world.scene.start == world.configuration().base
        assert world.scene.start[0] < -0.39, "the nearest place with room for the base alone would be at 0"
        assert not world.contacts()


def test_a_robot_whose_arms_have_room_nowhere_has_no_place_to_start(robot: Path) -> None:
    with ExitStack() as stack, pytest.raises(BadInput) as caught:
        world_at_start(Scene((SHELF,), (-0.3, -0.3, 0.3, 0.3)), bind_robot(robot), None, stack)
    assert [diagnostic.code for diagnostic in caught.value.diagnostics] == ["X003"]
