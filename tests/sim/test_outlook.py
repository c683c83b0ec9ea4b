"""Steps of a motion are looked at ahead, many at once, and nothing comes out otherwise."""

from __future__ import annotations

import numpy as np
import pytest

from planlang.geometry import Pose
from planlang.protocols import Configuration, Trajectory
from sim import PyBulletWorld
from sim.engine import bullet
from sim.outlook import displacements
from tests.sim.conftest import MakeWorld, grasp, straight
from tests.support.examples import some
from tests.support.world_values import value_of

GOALS: tuple[dict[str, float], ...] = (
    {"y": 2.2},
    {"x": 1.5, "yaw": 0.4},
    {"shoulder_pitch_joint_right": 0.8, "elbow_pitch_joint_right": 0.2},
    {"shoulder_pitch_joint_left": 0.6, "elbow_pitch_joint_left": 0.1, "spindle_joint": 0.1},
    {"shoulder_roll_joint_right": 1.2, "elbow_pitch_joint_right": 2.2, "elbow_roll_joint_right": 1.0},
)


def steps(world: PyBulletWorld, trajectory: Trajectory, *, disturbed: bool) -> list[object]:
    """Play a motion; what the world is like at each step. Disturbed: something far away is moved all the time."""
    world.start("motion", trajectory)
    found: list[object] = []
    while world.motion("motion").state == "moving":
        if disturbed:
            world.set_pose("cup", world.pose("cup"))
        world.step()
        found.append((world.motion("motion"), value_of(world)))
    return found


@pytest.mark.parametrize("holds", [False, True])
@pytest.mark.parametrize("goal", some(GOALS, every=3), ids=lambda goal: ",".join(goal))
def test_a_motion_goes_as_far_as_if_every_step_were_asked_about(
    make_world: MakeWorld, goal: dict[str, float], holds: bool
) -> None:
    found = []
    for disturbed in (False, True):
        world = make_world()
        if holds:
            grasp(world)
        found.append(steps(world, straight(world, goal, rows=130), disturbed=disturbed))
    assert found[0] == found[1]


def test_where_nothing_is_near_no_distance_is_asked(make_world: MakeWorld, monkeypatch: pytest.MonkeyPatch) -> None:
    world, asked = make_world(), []
    original = bullet.getClosestPoints
    monkeypatch.setattr(bullet, "getClosestPoints", lambda *a, **named: asked.append(a) or original(*a, **named))
    world.start("base", straight(world, {"y": 0.0}, rows=60))
    world.step()
    asked.clear()
    while world.motion("base").state == "moving":
        world.step()
    assert not asked


def test_what_is_put_in_the_way_of_a_motion_stops_it(make_world: MakeWorld) -> None:
    world = make_world()
    world.start("base", straight(world, {"y": -1.4}, rows=90))
    for _ in range(10):
        world.step()
    world.set_pose("bedside", Pose((-1.1, -0.6, 0.3)))
    while world.motion("base").state == "moving":
        world.step()
    assert world.obstacle("base") == "bedside"


def test_the_robot_is_shown_where_it_is_whenever_somebody_looks(make_world: MakeWorld) -> None:
    world = make_world()
    world.start("base", straight(world, {"y": 0.0}, rows=30))
    for _ in range(10):
        world.step()
    assert world.link_pose("base_link").position[1] == pytest.approx(world.configuration().base[1], abs=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_links_are_displaced_as_pybullet_displaces_them(make_world: MakeWorld, seed: int) -> None:
    world, rng = make_world(), np.random.default_rng(seed)
    robot = world.robot
    limits = {name: robot.limits[name] for name in robot.joints}
    names = ["x", "y", "yaw", *limits]
    values = [rng.uniform(-1.0, 1.0, 3).tolist() + [rng.uniform(*limit) for limit in limits.values()] for _ in range(4)]
    before = world.solid_frames()
    moved = displacements(robot, names, np.array(values), robot.solid)
    for row, (x, y, yaw, *joints) in zip(moved, values, strict=True):
        there = Configuration((x, y, yaw), dict(zip(limits, joints, strict=True)))
        assert np.abs(np.einsum("nij,njk->nik", row, before) - world.solid_frames(there)).max() < 1e-5
