"""Closed places: searches open doors and drawers, look inside, and close them again."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace

import pytest

from planlang import SimulationHost, at_location, perform, run, with_failure_handling
from planlang.designators import Condition, FixedPose, action, an_object
from planlang.failures import (
    ObjectNotFound,
    ObjectNowhereToBeFound,
    ObjectUnresolvable,
    PlanFailure,
)
from planlang.geometry import Pose
from planlang.language.recovery import Recovery
from planlang.recoveries import look_from_another_place
from planlang.runs import Trace
from sim import Body
from tests.executive.conftest import BOTTLE, THE_BOTTLE, MakeStage
from tests.support.instant_doors import Doors
from tests.support.leaves import PLACE, Room, room, thing

TABLE = Body("table", Pose((2.5, 0.0, 0.37)), (0.8, 1.2, 0.74), type="Table-PieceOfFurniture")
DESK = Body("desk", Pose((0.0, -4.0, 0.37)), (0.8, 0.8, 0.74), type="Desk-PieceOfFurniture")
ON_TABLE = replace(BOTTLE, pose=Pose((2.3, 0.0, 0.84)))
ON_DESK = replace(BOTTLE, pose=Pose((0.0, -3.9, 0.84)))
LOOK = action("LookingForSomething", object_acted_on=THE_BOTTLE)
LOOKING = Recovery(ObjectNotFound, look_from_another_place(THE_BOTTLE), retries=3, otherwise=ObjectNowhereToBeFound)


async def look() -> None:
    await with_failure_handling(lambda: perform(LOOK), LOOKING)


def test_what_is_not_where_it_was_believed_to_be_is_found_elsewhere(make_stage: MakeStage) -> None:
    stage = make_stage(TABLE, DESK, ON_TABLE, truth=(TABLE, DESK, ON_DESK))
    stage.run(look)
    assert stage.belief.pose("bottle").distance(ON_DESK.pose) < 1e-6


def test_a_recovery_that_has_seen_the_thing_is_not_undone_by_a_look_from_where_it_is_hidden(
    make_stage: MakeStage,
) -> None:
    wall = Body("wall", Pose((1.0, 0.0, 0.9)), (0.1, 3.0, 1.8), type="Wall-GenericBarrier")
    stage = make_stage(TABLE, wall, ON_TABLE)
    here = FixedPose(x=0.0, y=0.0)

    async def plan() -> None:
        await at_location(here, lambda: perform(LOOK), LOOKING)

    stage.run(plan)
    assert stage.belief.remembers("bottle")


OPENS, CLOSES = "OpeningAContainerArtifact", "ClosingAContainerArtifact"
KEYS = an_object("Key", PLACE + "keys")


def kitchen(stack: ExitStack, *, inside: bool, sticks: bool = False, misses: int = 0) -> tuple[Room, Doors]:
    """A room with a chest with a drawer, and keys that the robot does not know of: in it, or nowhere to be seen."""
    grip = thing("grip", "Handle", Pose((0.56, 0.0, 0.65)), (0.012, 0.2, 0.012))
    leaf = thing("leaf", "Drawer", Pose((0.84, 0.0, 0.65)), (0.48, 0.5, 0.14), "grip")
    case = thing("case", "Dresser-PieceOfFurniture", Pose((0.85, 0.0, 0.36)), (0.5, 0.54, 0.72), "leaf")
    at = Pose((0.75, 0.0, 0.61)) if inside else Pose((-3.0, 3.0, 0.01))
    keys = thing("keys", "Key", at, (0.1, 0.05, 0.02))
    stage = room(stack, (case, leaf, grip, keys))
    stage.platform.belief.not_there("keys")
    stage.platform.observe()
    doors = Doors(stage, "leaf", 0.3, (OPENS, CLOSES), sticks=sticks, misses=misses)
    stage.executive.modules = (doors, *stage.executive.modules)
    return stage, doors


def search(stage: Room, trace: Trace | None = None) -> None:
    looking = action("LookingForSomething", object_acted_on=KEYS)
    run(lambda: perform(looking), host=SimulationHost(stage.truth), executive=stage.executive, trace=trace)


def test_a_drawer_is_opened_to_look_inside_and_stays_open_where_the_thing_is(stack: ExitStack) -> None:
    stage, doors = kitchen(stack, inside=True)
    search(stage)
    assert doors.asked == [OPENS]
    assert stage.platform.belief.seen("keys")


def test_a_drawer_in_which_the_thing_is_not_is_closed_again(stack: ExitStack) -> None:
    stage, doors = kitchen(stack, inside=False)
    with pytest.raises(ObjectNowhereToBeFound, match=r"looked at: the outside of case, in leaf$"):
        search(stage)
    assert doors.asked == [OPENS, CLOSES]


def test_a_drawer_that_does_not_close_at_once_is_closed_after_a_step_back(stack: ExitStack) -> None:
    stage, doors = kitchen(stack, inside=False, misses=1)
    with pytest.raises(ObjectNowhereToBeFound, match=r"looked at: the outside of case, in leaf$"):
        search(stage)
    assert doors.asked == [OPENS, CLOSES, CLOSES]
    assert stage.truth.joint("leaf") == 0.0


def test_of_a_drawer_that_stays_open_after_a_search_it_is_told_why(stack: ExitStack) -> None:
    stage, _ = kitchen(stack, inside=False, misses=9)
    trace = Trace()
    with pytest.raises(ObjectNowhereToBeFound, match="leaf was opened and could not be closed again"):
        search(stage, trace)
    (told,) = (event for event in trace.events if event["event"] == "stays open")
    assert (told["name"], told["because"]) == ("leaf", "the handle is out of reach: leaf")


def test_what_could_not_be_opened_was_not_looked_at(stack: ExitStack) -> None:
    stage, _ = kitchen(stack, inside=True, sticks=True)
    with pytest.raises(ObjectNowhereToBeFound, match=r"looked at: the outside of case; not in leaf \(.*handle.*\)$"):
        search(stage)


def test_what_is_yet_to_be_found_is_in_no_hand(stack: ExitStack) -> None:
    stage, _ = kitchen(stack, inside=True)
    assert not stage.executive.holds(Condition("holding", (KEYS,)))


def test_a_step_that_drives_by_itself_looks_first_for_what_it_is_about(stack: ExitStack) -> None:
    stage, doors = kitchen(stack, inside=True)
    pushing = action("PushingMotion", object_acted_on=KEYS)
    with pytest.raises(PlanFailure) as failure:  # there is nowhere to push them to
        run(lambda: perform(pushing), host=SimulationHost(stage.truth), executive=stage.executive)
    assert not isinstance(failure.value, ObjectUnresolvable)
    assert doors.asked == [OPENS]
    assert stage.platform.belief.remembers("keys")
