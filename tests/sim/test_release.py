"""Facts about letting go: things sink to what bears them."""

import math

import pytest

from planlang.geometry import Pose
from sim import Body, PyBulletWorld
from sim.falling import upright
from sim.world import at_rest_on, held_by
from tests.sim.conftest import MakeWorld


def _drop(world: PyBulletWorld, name: str, pose: Pose) -> int:
    """Let the robot hold a body somewhere and release it; how many steps it falls."""
    world.set_pose(name, pose)
    world.attach("grippoint_right", name)
    world.release(name)
    steps = 0
    while world.falling(name):
        world.step()
        steps += 1
    return steps


def test_released_object_falls_freely_and_rests_on_what_is_below(world: PyBulletWorld) -> None:
    steps = _drop(world, "bottle", Pose((-1.2, 2.2, 1.4)))
    assert world.pose("bottle").position == pytest.approx((-1.2, 2.2, 0.9), abs=1e-3)
    assert at_rest_on(world, "bottle") == "cabinet"
    assert steps == pytest.approx(math.sqrt(2 * 0.5 / 9.81) * world.rate, abs=1.5)


def test_object_over_the_floor_ends_on_the_floor(world: PyBulletWorld) -> None:
    _drop(world, "bottle", Pose((0.0, -1.0, 0.8)))
    assert world.pose("bottle").position == pytest.approx((0.0, -1.0, 0.1), abs=1e-3)
    assert at_rest_on(world, "bottle") == "room"


def test_half_supported_object_stays_and_one_whose_centre_is_off_slips_past_the_edge(world: PyBulletWorld) -> None:
    _drop(world, "bottle", Pose((-0.81, 2.2, 1.0)))
    assert at_rest_on(world, "bottle") == "cabinet"
    _drop(world, "bottle", Pose((-0.79, 2.2, 1.0)))
    assert at_rest_on(world, "bottle") == "room"
    assert world.pose("bottle").position[0] > -0.8 + 0.03 - 0.005, "beside the cabinet, not inside it"


def test_object_spanning_two_supports_rests_on_both(make_world: MakeWorld) -> None:
    trestles = [Body(f"trestle{k}", Pose((k * 0.3, -1.0, 0.25)), (0.1, 0.4, 0.5)) for k in (-1, 1)]
    board = Body("board", Pose((0.0, -1.0, 0.9)), (0.9, 0.3, 0.02), movable=True)
    world = make_world(extra=(*trestles, board))
    _drop(world, "board", board.pose)
    assert world.pose("board").position == pytest.approx((0.0, -1.0, 0.51), abs=1e-3)


def test_tilted_object_lands_on_its_nearest_side(world: PyBulletWorld) -> None:
    lying = Pose((0.0, -1.0, 0.5), (math.sin(0.7), 0.0, 0.0, math.cos(0.7)))
    _drop(world, "bottle", lying)
    assert world.pose("bottle").position[2] == pytest.approx(0.03, abs=1e-3)
    assert upright(Pose((0, 0, 0), (0.1, 0.0, 0.0, 0.995))).orientation == pytest.approx((0, 0, 0, 1), abs=1e-9)


def test_yaw_is_kept_when_an_object_is_set_upright() -> None:
    tilted = Pose.planar(0, 0, 0.8) @ Pose((0, 0, 0), (0.05, 0.0, 0.0, math.sqrt(1 - 0.05**2)))
    assert upright(tilted).yaw == pytest.approx(0.8, abs=0.01)


def test_robot_below_does_not_bear_what_it_lets_go(world: PyBulletWorld) -> None:
    x, y, _ = world.configuration().base
    _drop(world, "bottle", Pose((x + 0.25, y, 1.0)))
    assert at_rest_on(world, "bottle") == "room"


def test_what_is_not_held_cannot_be_released(world: PyBulletWorld) -> None:
    with pytest.raises(KeyError, match="not held"):
        world.release("bottle")


def test_oracle_knows_what_is_held_falls_and_hangs_in_the_air(world: PyBulletWorld) -> None:
    assert at_rest_on(world, "bottle") == "cabinet"
    world.set_pose("bottle", Pose((0.0, -1.0, 0.8)))
    assert at_rest_on(world, "bottle") is None
    world.attach("grippoint_right", "bottle")
    assert held_by(world, "bottle") == "robot"
    world.release("bottle")
    assert (held_by(world, "bottle"), at_rest_on(world, "bottle")) == (None, None)


def test_world_without_a_room_has_a_floor(make_world: MakeWorld) -> None:
    world = make_world(bodies=(Body("bottle", Pose((0.5, 0.5, 1.0)), (0.06, 0.06, 0.2), "cylinder", movable=True),))
    _drop(world, "bottle", world.pose("bottle"))
    assert at_rest_on(world, "bottle") == "floor"
    assert world.names() == ("bottle",)
