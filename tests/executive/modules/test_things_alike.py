"""Looking for a thing where others look like it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from planlang import an_object, perform
from planlang.designators import action
from planlang.failures import AmbiguousPerception, ObjectNotFound
from planlang.geometry import Pose
from sim import Body
from tests.executive.conftest import BOTTLE, CABINET, PLACE, MakeStage, Stage

NAMED = an_object("DrinkingBottle", PLACE + "bottle")
MARKED = replace(BOTTLE, mark="Ann")
OTHER = replace(BOTTLE, name="other", pose=Pose((1.5, 0.3, 0.9)), mark="Ben")
SCREEN = Body("screen", Pose((1.4, 0.0, 0.88)), (0.02, 0.4, 0.16), type="Cupboard")


def look(stage: Stage) -> None:
    """Look for the bottle."""

    async def plan() -> None:
        await perform(action("Perceiving", object_acted_on=NAMED))

    stage.run(plan)


def test_a_mark_that_is_read_tells_which_it_is(make_stage: MakeStage) -> None:
    there = replace(MARKED, pose=OTHER.pose), replace(OTHER, pose=MARKED.pose)
    stage = make_stage(CABINET, MARKED, OTHER, truth=(CABINET, *there))
    look(stage)
    assert stage.belief.pose("bottle") == OTHER.pose
    assert stage.belief.alike("bottle") is not None


def test_a_thing_at_whose_place_another_is_seen_is_not_believed_there(make_stage: MakeStage) -> None:
    there = replace(MARKED, pose=Pose((-2.0, 2.0, 0.1))), replace(OTHER, pose=MARKED.pose)
    stage = make_stage(CABINET, MARKED, OTHER, truth=(CABINET, *there))
    with pytest.raises(ObjectNotFound):
        look(stage)
    assert "bottle" in stage.belief.memory.unknown


def test_things_without_the_mark_that_the_map_states_are_named(make_stage: MakeStage) -> None:
    there = replace(MARKED, mark=None), replace(OTHER, mark=None)
    stage = make_stage(CABINET, MARKED, truth=(CABINET, *there))
    with pytest.raises(ObjectNotFound) as caught:
        look(stage)
    cause = caught.value.__cause__
    assert isinstance(cause, AmbiguousPerception)
    assert len(cause.candidates) == 2
    assert "shows 'Ann'" in str(cause)


def test_a_mark_that_is_hidden_is_ambiguous_and_names_both(make_stage: MakeStage) -> None:
    room = CABINET, SCREEN, MARKED, replace(OTHER, pose=Pose((1.5, 0.12, 0.9)))
    stage = make_stage(*room)
    with pytest.raises(AmbiguousPerception) as caught:
        look(stage)
    assert caught.value.candidates == ("bottle", "other")
