"""Facts about the room that things take."""

import pytest

from planlang.geometry import Pose
from planlang.protocols import Configuration
from sim import PyBulletWorld
from tests.sim.conftest import grasp


def test_pieces_of_bodies_leave_out_floor_markers_held_and_removed_ones(world: PyBulletWorld) -> None:
    grasp(world)
    world.remove("bed")
    solids = world.solids()
    places = {solid.pose.position for solid in solids}
    assert world.scene.body("cabinet").pose.position in places
    for absent in ("bed", "bottle", "door"):
        assert world.scene.body(absent).pose.position not in places
    tops = [solid.pose.position[2] + solid.size[2] / 2 for solid in solids]
    assert min(tops) > 0.0


def test_silhouette_holds_plate_and_hands_and_grows_with_what_is_held(world: PyBulletWorld) -> None:
    plain = world.silhouette()
    low = [radius for z_low, _, radius in plain if z_low < 0.1]
    assert max(low) == pytest.approx(0.333, abs=0.001), "the plate is as wide as its disc"
    grasp(world)
    place = world.configuration()
    assert len(world.silhouette()) == len(plain) + 1
    assert world.configuration() == place
    assert max(radius for *_, radius in world.silhouette()) > 0.43


def test_refused_configuration_changes_nothing(world: PyBulletWorld) -> None:
    before = world.state()
    with pytest.raises(ValueError, match="no joint knee"):
        world.set_configuration(Configuration((0.0, 0.0, 0.0), {"knee": 1.0}))
    assert world.state() == before
    assert world.contacts() == ()


def test_released_with_nothing_below_stays_in_the_air(world: PyBulletWorld) -> None:
    world.set_pose("bottle", Pose((20.0, 0.0, 1.0)))
    world.attach("grippoint_right", "bottle")
    world.release("bottle")
    assert not world.falling("bottle")
    assert world.support("bottle") is None
