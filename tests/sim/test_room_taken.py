"""How much room the robot takes: measured by pushing walls against it from all sides."""

import math

import numpy as np
import pybullet
import pytest

from planlang.protocols import Configuration
from sim import PyBulletWorld
from tests.sim.conftest import AMIGO, LEVEL_HAND, MakeWorld, grasp

DIRECTIONS = np.linspace(0.0, 2 * math.pi, 120, endpoint=False)


@pytest.fixture
def alone(make_world: MakeWorld) -> PyBulletWorld:
    """Amigo at the origin of an empty world, the right hand level."""
    world = make_world(bodies=(), start=(0.0, 0.0, 0.0))
    world.set_configuration(Configuration((0.0, 0.0, 0.0), LEVEL_HAND))
    return world


def pushed(world: PyBulletWorld, number: int) -> float:
    """How far a solid link reaches from the vertical through the origin, by a wall that meets it from all sides."""
    robot, away = world.robot, 3.0
    shape = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=[0.01, 5.0, 5.0], physicsClientId=robot.client)
    wall = pybullet.createMultiBody(0, shape, physicsClientId=robot.client)
    reach = 0.0
    for direction in DIRECTIONS:
        place = [away * math.cos(direction), away * math.sin(direction), 1.0]
        turn = pybullet.getQuaternionFromEuler([0.0, 0.0, direction])
        pybullet.resetBasePositionAndOrientation(wall, place, turn, physicsClientId=robot.client)
        near = pybullet.getClosestPoints(robot.uid, wall, away, robot.solid[number], -1, physicsClientId=robot.client)
        reach = max([reach, *(away - 0.01 - point[8] for point in near)])
    pybullet.removeBody(wall, physicsClientId=robot.client)
    return reach


def test_the_spread_of_each_link_is_where_a_wall_meets_it_cylinders_having_round_ends(alone: PyBulletWorld) -> None:
    alone.contacts()
    for number, name in enumerate(alone.robot.solid_names):
        measured = pushed(alone, number)
        assert measured - 2e-3 <= alone.robot.spread(number) <= measured + 0.02, name


def test_the_links_of_a_hand_are_palm_and_fingers(alone: PyBulletWorld) -> None:
    for side, other in (("right", "left"), ("left", "right")):
        links = alone.robot.hand_links(f"grippoint_{side}")
        assert set(AMIGO.hands[f"hand_{side}"]) <= links
        assert not any(other in name for name in links)


def test_a_hand_fits_into_a_tube_of_its_radius_around_the_approach(alone: PyBulletWorld) -> None:
    radius = alone.robot.hand_radius("grippoint_right", (1.0, 0.0, 0.0))
    assert 0.03 < radius < 0.2
    frame = alone.link_pose("grippoint_right").matrix()
    lower, upper = alone.robot.boxes()
    for number, name in enumerate(alone.robot.solid_names):
        if name in alone.robot.hand_links("grippoint_right"):
            middle = (lower[number] + upper[number]) / 2 - frame[:3, 3]
            across = middle - (middle @ frame[:3, 0]) * frame[:3, 0]
            assert np.linalg.norm(across) <= radius, name


def test_without_its_arms_the_robot_is_no_wider_than_its_base(alone: PyBulletWorld) -> None:
    arms = [name for name in alone.configuration().joints if name.endswith(("_right", "_left"))]
    whole, body = alone.silhouette(), alone.silhouette(without=arms)
    assert len(body) < len(whole)
    assert set(body) <= set(whole)
    assert max(radius for _, _, radius in body) < 0.36 < max(radius for _, _, radius in whole)


def test_what_an_arm_holds_counts_with_the_arm(make_world: MakeWorld) -> None:
    world = make_world()
    grasp(world)
    arm = [name for name in world.configuration().joints if name.endswith("_right")]
    empty = make_world()
    empty.set_configuration(world.configuration())
    assert len(world.silhouette()) == len(empty.silhouette()) + 1
    assert world.silhouette(without=arm) == empty.silhouette(without=arm)


def test_asking_how_much_room_is_taken_changes_nothing(make_world: MakeWorld) -> None:
    world = make_world()
    grasp(world)
    before = world.state()
    world.silhouette()
    world.silhouette(without=["spindle_joint"])
    world.solids()
    assert world.state() == before


def test_an_outline_is_where_walls_meet_the_link_and_holds_no_more(alone: PyBulletWorld) -> None:
    shapes = alone.outlines()
    assert len(shapes) == len(alone.robot.solid_names)
    for number, (low, high, corners) in enumerate(shapes):
        assert low < high
        widest = float(np.hypot(corners[:, 0], corners[:, 1]).max())
        assert pushed(alone, number) - 0.02 <= widest <= pushed(alone, number) + 2e-3


def test_outlines_are_told_in_the_frame_of_the_base_wherever_it_stands(alone: PyBulletWorld) -> None:
    before = alone.outlines()
    alone.set_configuration(Configuration((1.0, -2.0, 0.7), alone.configuration().joints))
    for one, other in zip(before, alone.outlines(), strict=True):
        np.testing.assert_allclose(one[2], other[2], atol=1e-9)


def test_links_that_a_joint_moves_together_do_not_move_against_each_other(alone: PyBulletWorld) -> None:
    robot = alone.robot
    apart = robot.moved_apart(frozenset({"elbow_pitch_joint_right"}))
    forearm, hand, upper = (robot.number[name] for name in ("fore_arm_right", "hand_right", "upper_arm_right"))
    assert apart[forearm, upper]
    assert apart[upper, hand]
    assert not apart[forearm, hand]
    assert not robot.moved_apart(frozenset({"x", "y"})).any()
