"""Bodies that move by themselves go to and fro, wait for the robot, and begin where a seed puts them."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from planlang.geometry import Pose
from planlang.protocols import Configuration
from sim import Body, PyBulletWorld, Scene, perturb
from sim.movers import Mover
from tests.sim.conftest import AMIGO

PORTER = Body("porter", Pose((-2.0, 0.0, 0.5)), (0.5, 0.4, 1.0))
ROUTE = Mover("porter", ((-2.0, 0.0), (2.0, 0.0), (2.0, 1.0)), 0.5)
HALL = Scene((PORTER,), start=(0.0, 2.0, 0.0), movers=(ROUTE,))


@pytest.mark.parametrize(
    ("gone", "at", "heading"),
    [
        (0.0, (-2.0, 0.0), 0.0),
        (3.0, (1.0, 0.0), 0.0),
        (4.5, (2.0, 0.5), math.pi / 2),
        (5.5, (2.0, 0.5), -math.pi / 2),
        (9.0, (-1.0, 0.0), math.pi),
        (10.0, (-2.0, 0.0), 0.0),
    ],
)
def test_a_mover_goes_along_its_route_and_back_and_looks_ahead(
    gone: float, at: tuple[float, float], heading: float
) -> None:
    pose = ROUTE.pose_at(gone, 0.5)
    assert pose.position == pytest.approx((*at, 0.5))
    assert math.remainder(pose.yaw - heading, 2 * math.pi) == pytest.approx(0.0, abs=1e-9)


STAYS = ((0.0, 0.0), (0.0, 0.0))


@pytest.mark.parametrize(("route", "speed"), [(STAYS[:1], 1.0), (STAYS, 1.0), (ROUTE.route, 0.0)])
def test_a_route_needs_two_places_and_a_speed(route: tuple[tuple[float, float], ...], speed: float) -> None:
    with pytest.raises(ValueError):  # noqa: PT011 - the only check of a mover
        Mover("porter", route, speed)


def test_a_mover_advances_with_the_time_of_the_world() -> None:
    world = PyBulletWorld(HALL, AMIGO)
    for _ in range(world.rate):
        world.step()
    assert world.pose("porter").position == pytest.approx((-1.5, 0.0, 0.5))
    world.close()


def test_a_mover_waits_before_the_robot_until_it_has_left() -> None:
    world = PyBulletWorld(replace(HALL, start=(0.0, 0.0, 0.0)), AMIGO)
    for _ in range(20 * world.rate):
        world.step()
        assert not world.contacts()
    waits = world.pose("porter").position
    assert -1.5 < waits[0] < -0.5
    world.step()
    assert world.pose("porter").position == waits
    world.set_configuration(Configuration((0.0, 2.0, 0.0), {}))
    world.step()
    assert world.pose("porter").position[0] > waits[0]
    world.close()


def test_a_seed_puts_a_mover_anywhere_on_its_way_but_not_into_the_robot() -> None:
    scene = replace(HALL, start=(0.0, 0.0, 0.0))
    begins = [perturb(scene, seed).movers[0].first for seed in range(1, 30)]
    assert len(set(begins)) == len(begins)
    assert all(math.dist(ROUTE.pose_at(gone, 0.5).position[:2], (0.0, 0.0)) > 0.4 for gone in begins)
    assert perturb(scene, 0).movers == (ROUTE,)


def test_a_mover_that_was_put_elsewhere_goes_on_from_there_as_it_faces() -> None:
    world = PyBulletWorld(HALL, AMIGO)
    world.step()
    world.set_pose("porter", ROUTE.pose_at(8.0, 0.5))
    world.step()
    assert world.pose("porter").position == pytest.approx((0.0 - 0.5 / 30, 0.0, 0.5), abs=0.01)
    world.close()
