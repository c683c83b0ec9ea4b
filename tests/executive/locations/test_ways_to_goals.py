"""What is taken to where the base has no way is refused before it is taken, with what closes the way."""

from contextlib import ExitStack

import pytest

from executive.locations.ways_to_goals import check_goals
from executive.maps import MapObject
from executive.modules.platform import Platform
from planlang.advice import Change
from planlang.designators import Object, a_location, action
from planlang.failures import LocationUnresolvable, ObjectUndeliverable
from planlang.geometry import Pose
from planlang.state import Hold
from tests.support.flats import Flat, doorway, in_flat, room_of
from tests.support.leaves import thing

CUP, TABLE = Object("Cup", "cup"), Object("KitchenTable", "table")
NEAR_CUP = a_location(in_reach_of=CUP)
BRINGING = action("TransportingAnObject", object_acted_on=CUP, to_location=TABLE)


def two_rooms(stack: ExitStack, width: float, *others: MapObject, robot: str = "amigo") -> Platform:
    """A cup in the room of the robot, a table in the next one, a doorway between them, and other things."""
    rooms = room_of("room0", (-3.0, -2.0), (0.0, 2.0)), room_of("room1", (0.1, -2.0), (4.0, 2.0))
    desk = thing("desk", "KitchenTable", Pose((-2.6, 1.2, 0.37)), (0.6, 1.0, 0.74))
    cup = thing("cup", "Cup", Pose((-2.4, 1.2, 0.79)), (0.07, 0.07, 0.1))
    table = thing("table", "KitchenTable", Pose((3.4, 0.5, 0.37)), (0.7, 1.2, 0.74))
    things = (*rooms, doorway("doorway1", 0.05, 0.0, width), desk, cup, table, *others)
    return in_flat(stack, Flat("two rooms", things, (width,), (-1.5, 0.0, 0.0), (2.0, 0.0, 0.0)), robot)


def refused(platform: Platform) -> LocationUnresolvable:
    """Return the cause for which nothing is taken to the table."""
    with pytest.raises(ObjectUndeliverable) as caught:
        check_goals(NEAR_CUP, [BRINGING], platform.scene)
    assert caught.value.what == "cup"
    assert isinstance(caught.value.__cause__, LocationUnresolvable)
    return caught.value.__cause__


def test_doorway_too_narrow_for_the_delivery_is_named_before_the_thing_is_taken() -> None:
    with ExitStack() as stack:
        cause = refused(two_rooms(stack, 0.7))
    narrow = "doorway1 is 0.70 m wide; the robot needs 0.76 m"
    assert cause.because() == f"the base cannot drive to where it could reach table: {narrow}"


def test_what_stands_in_the_only_way_is_named_with_the_change_of_the_map() -> None:
    pillar = thing("pillar", "Cabinet-PieceOfFurniture", Pose((0.6, 0.0, 1.0)), (0.4, 0.9, 2.0))
    shelf = thing("shelf", "Cabinet-PieceOfFurniture", Pose((1.0, 1.2, 1.0)), (1.2, 1.4, 2.0))
    other = thing("other", "Cabinet-PieceOfFurniture", Pose((1.0, -1.2, 1.0)), (1.2, 1.4, 2.0))
    with ExitStack() as stack:
        cause = refused(two_rooms(stack, 0.9, pillar, shelf, other))
    assert cause.because().endswith("; without pillar this would work")
    assert cause.changes == (Change("absent", True, "pillar"),)


def test_nothing_is_refused_where_the_base_has_a_way_or_the_robot_can_make_one() -> None:
    mug = thing("mug", "DrinkingMug", Pose((0.4, 0.0, 0.05)), (0.08, 0.08, 0.1))
    leaf = thing("leaf", "Door", Pose((0.05, 0.0, 1.0)), (0.04, 0.86, 1.98))
    for others in ((), (mug,), (leaf,)):
        with ExitStack() as stack:
            check_goals(NEAR_CUP, [BRINGING], two_rooms(stack, 0.9, *others).scene)


def test_only_what_enclosing_actions_bring_and_no_hand_holds_is_checked() -> None:
    with ExitStack() as stack:
        platform = two_rooms(stack, 0.7)
        check_goals(NEAR_CUP, [action("FetchingAnObject", object_acted_on=CUP)], platform.scene)
        check_goals(a_location(in_reach_of=TABLE), [BRINGING], platform.scene)
        state, arm = platform.belief.state, platform.scene.arms.all[0]
        held = state.gripped("cup", Hold(arm.name, arm.tip, Pose((0.0, 0.0, 0.0))))
        check_goals(NEAR_CUP, [BRINGING], platform.scene.supposing(held))


def test_a_robot_that_does_not_drive_is_not_checked() -> None:
    with ExitStack() as stack:
        check_goals(NEAR_CUP, [BRINGING], two_rooms(stack, 0.7, robot="panda").scene)
