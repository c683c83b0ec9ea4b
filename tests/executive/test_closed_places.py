"""Closed places: searches open doors and drawers, look inside, and close them again."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executive.belief import Belief
from planlang import at_location, perform, with_failure_handling
from planlang.designators import FixedPose, a_location, action
from planlang.failures import ObjectNotFound, ObjectNowhereToBeFound
from planlang.geometry import Pose
from planlang.language.recovery import Recovery
from planlang.recoveries import look_from_another_place
from sim import Body
from tests.executive.conftest import BOTTLE, THE_BOTTLE, MakeStage, Stage

TABLE = Body("table", Pose((2.5, 0.0, 0.37)), (0.8, 1.2, 0.74), type="Table-PieceOfFurniture")
DESK = Body("desk", Pose((0.0, -4.0, 0.37)), (0.8, 0.8, 0.74), type="Desk-PieceOfFurniture")
ON_TABLE = replace(BOTTLE, pose=Pose((2.3, 0.0, 0.84)))
ON_DESK = replace(BOTTLE, pose=Pose((0.0, -3.9, 0.84)))
LOOK = action("LookingForSomething", object_acted_on=THE_BOTTLE)
LOOKING = Recovery(ObjectNotFound, look_from_another_place(THE_BOTTLE), attempts=3, otherwise=ObjectNowhereToBeFound)


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
