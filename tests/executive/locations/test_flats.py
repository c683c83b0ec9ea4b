"""Ways through flats: what the location search says about them, the base does, and nothing else."""

from contextlib import ExitStack
from dataclasses import replace

import numpy as np
import pytest

from executive.belief.doorways import NarrowDoorway, narrow_doorway
from executive.motion import NoPath
from planlang.designators import Object, a_location
from planlang.geometry import Pose
from tests.support.flats import Flat, doorway, flat, in_flat, room_of
from tests.support.leaves import thing

FLATS = range(3)
"""A row of rooms, two rooms at a hall, and two rooms at a hall that turns."""


@pytest.mark.parametrize("carries", [False, True], ids=["empty hands", "mug"])
@pytest.mark.parametrize("seed", FLATS)
def test_amigo_drives_through_offset_doorways_of_eighty_centimetres(seed: int, carries: bool) -> None:
    drawn = flat(seed, (0.8, 0.8))
    with ExitStack() as stack:
        platform = in_flat(stack, drawn, "amigo", carries=carries)
        assert platform.scene.collisions.has_way(drawn.goal)
        assert platform.drive.path(drawn.goal).positions[-1][:2] == pytest.approx(drawn.goal[:2])


@pytest.mark.parametrize("robot", ["amigo", pytest.param("pr2", marks=pytest.mark.pr2)])
@pytest.mark.parametrize("seed", FLATS)
def test_search_and_base_agree_that_a_doorway_is_too_narrow(seed: int, robot: str) -> None:
    drawn = flat(seed, (0.5, 0.5))
    with ExitStack() as stack:
        platform = in_flat(stack, drawn, robot)
        assert not platform.scene.collisions.has_way(drawn.goal)
        with pytest.raises(NoPath, match="exact checks 0"):
            platform.drive.path(drawn.goal)


def test_a_base_has_a_way_out_of_where_it_stands_with_less_room_than_it_drives_with() -> None:
    rooms = room_of("room0", (-3.0, -2.0), (0.0, 2.0)), room_of("room1", (0.1, -2.0), (3.0, 2.0))
    narrow, there = doorway("doorway1", 0.05, 0.0, 0.7), (2.0, 0.5, 0.0)
    drawn = Flat("two rooms", (*rooms, narrow), (0.7,), (0.05, 0.0, 0.0), there)
    with ExitStack() as stack:
        platform = in_flat(stack, replace(drawn, start=(-1.5, 0.0, 0.0)), "amigo")
        assert not platform.scene.collisions.has_way(there)
    with ExitStack() as stack:
        platform = in_flat(stack, drawn, "amigo")
        assert platform.scene.collisions.has_way(there)
        assert platform.drive.path(there).positions[-1][:2] == pytest.approx(there[:2])


def test_of_many_poses_those_have_a_way_that_have_one_each() -> None:
    drawn = flat(1, (0.8, 0.8))
    with ExitStack() as stack:
        collisions = in_flat(stack, drawn, "amigo").scene.collisions
        x_min, y_min, x_max, y_max = collisions.travelled().bounds
        bases = np.random.default_rng(0).uniform((x_min, y_min, -3.0), (x_max, y_max, 3.0), (60, 3))
        each = [collisions.has_way((x, y, yaw)) for x, y, yaw in bases.tolist()]
        assert collisions.have_way(bases).tolist() == each
        assert 0 < sum(each) < len(each)


def test_search_counts_what_the_hand_holds() -> None:
    drawn = flat(3, (0.8, 0.8))
    with ExitStack() as stack:
        platform = in_flat(stack, drawn, "amigo", carries=True)
        collisions = platform.scene.collisions
        assert collisions.travelled() is collisions.whole(), "the search asks about the floor of the drive"
        assert len(collisions.travelled().silhouette) > len(collisions.floor().silhouette)


@pytest.mark.parametrize("carries", [False, True], ids=["empty hands", "mug"])
def test_doorway_that_is_too_narrow_is_named_with_what_the_robot_needs(carries: bool) -> None:
    drawn = flat(1, (0.6, 0.6))
    with ExitStack() as stack:
        platform = in_flat(stack, drawn, "amigo", carries=carries)
        narrow = narrow_doorway(platform.scene, np.array(drawn.goal[:2]))
        assert narrow is not None
        assert narrow.width == 0.6
        assert str(narrow) == "doorway1 is 0.60 m wide; the robot needs 0.76 m", "a mug makes it no wider"


def test_what_makes_the_robot_wider_than_a_doorway_is_named() -> None:
    told = str(NarrowDoorway("doorway1", 0.95, 1.1, ("tray1",)))
    assert told == "doorway1 is 0.95 m wide; with tray1 the robot needs 1.10 m"


def test_a_doorway_that_is_too_narrow_with_its_door_open_is_not_said_to_be_closed() -> None:
    told = str(NarrowDoorway("doorway1", 0.0, 0.76, (), "door1", 0.57))
    assert told == "doorway1 is 0.57 m wide with door1 open; the robot needs 0.76 m"
    assert str(NarrowDoorway("doorway1", 0.0, 0.76, (), "door1", 0.8)) == "door1 in doorway1 is closed"


def test_no_doorway_is_named_where_all_are_wide_enough_or_passed() -> None:
    wide = flat(1, (0.9, 0.9))
    widths = {"doorway2": 0.6}
    things = tuple(
        replace(one, size=(widths[one.name], 0.1, 2.0)) if one.name in widths else one for one in wide.things
    )
    with ExitStack() as stack:
        scene = in_flat(stack, wide, "amigo").scene
        assert narrow_doorway(scene, np.array(wide.goal[:2])) is None
    with ExitStack() as stack:
        scene = in_flat(stack, replace(wide, things=things), "amigo").scene
        narrow = narrow_doorway(scene, np.array(wide.goal[:2]))
        assert narrow is not None
        assert narrow.name == "doorway2", "the first doorway is passed"


def test_a_doorway_is_as_wide_as_it_is_though_a_box_stands_in_it() -> None:
    rooms = room_of("room0", (-3.0, -2.0), (0.0, 2.0)), room_of("room1", (0.1, -2.0), (3.0, 2.0))
    box = thing("box", "Box-Container", Pose((0.35, 0.1, 0.15)), (0.4, 0.5, 0.3))
    drawn = Flat(
        "two rooms", (*rooms, box, doorway("doorway1", 0.05, 0.0, 0.9)), (0.9,), (-1.5, 0.0, 0.0), (2.0, 0.5, 0.0)
    )
    with ExitStack() as stack:
        scene = in_flat(stack, drawn, "amigo").scene
        goal = np.array(drawn.goal[:2])
        assert not scene.collisions.has_way(drawn.goal)
        assert narrow_doorway(scene, goal) is None, "it would be wide enough"
        assert scene.collisions.closes_way(goal, 0.15) == ("box",)


def test_the_doorway_to_a_thing_at_a_wall_is_the_one_of_its_own_room() -> None:
    rooms = room_of("room0", (-3.0, -2.0), (0.0, 2.0)), room_of("room1", (0.1, -2.0), (3.0, 2.0))
    table = thing("table", "KitchenTable", Pose((0.6, 0.5, 0.37)), (1.0, 2.0, 0.74))
    glass = thing("glass", "DrinkingGlass", Pose((0.2, 0.5, 0.8)), (0.07, 0.07, 0.12))
    things = (*rooms, table, glass, doorway("doorway1", 0.05, -1.2, 0.6))
    drawn = Flat("two rooms", things, (0.6,), (-1.0, 0.5, 0.0), (2.0, 0.0, 0.0))
    with ExitStack() as stack:
        scene = in_flat(stack, drawn, "amigo").scene
        narrow = narrow_doorway(scene, np.array([0.2, 0.5]))
        assert narrow is not None, "though the floor behind the wall is nearer"
        assert narrow.name == "doorway1"


def test_a_base_is_near_a_table_only_on_this_side_of_a_wall() -> None:
    rooms = room_of("room0", (-3.0, -2.0), (0.0, 2.0)), room_of("room1", (0.1, -2.0), (3.0, 2.0))
    table = thing("table", "KitchenTable", Pose((0.35, 0.5, 0.37)), (0.5, 0.9, 0.74))
    things = (*rooms, table, doorway("doorway1", 0.05, -1.2, 1.2))
    drawn = Flat("two rooms", things, (1.2,), (-1.0, 0.5, 0.0), (2.0, 0.0, 0.0))
    with ExitStack() as stack:
        platform = in_flat(stack, drawn, "amigo")
        near = a_location(near=Object("SpatialThing", "table"))
        assert next(platform.resolver.bases(near)).base[0] > 0.1
        behind_the_wall = (-0.5, 0.5, 0.0)
        assert platform.resolver.satisfies(near, behind_the_wall) is None
        assert platform.resolver.satisfies(a_location(not_=near), behind_the_wall) is not None
        stated = a_location(near=Object("SpatialThing", "table"), within=1.5)
        assert platform.resolver.satisfies(stated, behind_the_wall) is not None


@pytest.mark.parametrize(
    ("robot", "carries"), [("amigo", False), ("amigo", True), pytest.param("pr2", True, marks=pytest.mark.pr2)]
)
def test_where_the_outlines_are_off_everything_an_exact_check_finds_no_contact(robot: str, carries: bool) -> None:
    drawn = flat(1, (0.8, 0.8))
    with ExitStack() as stack:
        platform = in_flat(stack, drawn, robot, carries=carries)
        collisions, rng = platform.scene.collisions, np.random.default_rng(0)
        x_min, y_min, x_max, y_max = platform.scene.world.scene.bounds
        bases = rng.uniform((x_min, y_min, -np.pi), (x_max, y_max, np.pi), (300, 3))
        surely = collisions.whole().surely_holds(bases)
        free = np.array([not collisions.contacts((x, y, yaw)) for x, y, yaw in bases.tolist()])
        assert not (surely & ~free).any()
        assert surely.sum() > 0.8 * (free & collisions.whole().fits(bases[:, :2])).sum()
