"""Looking for things: where they are believed to be, around there, and from elsewhere."""

from __future__ import annotations

from dataclasses import replace

import pytest

from planlang import Recovery, look_from_another_place, perform, with_failure_handling
from planlang.designators import Object, action, an_object
from planlang.failures import ActionUnresolvable, ObjectNotFound, ObjectNowhereToBeFound, ObjectUnresolvable
from planlang.geometry import Pose
from sim import Body
from tests.executive.conftest import BOTTLE, CABINET, THE_BOTTLE, WARD, MakeStage, Stage

CLOSE = (0.3, 0.0, 0.0)
"""From here the cabinet's top is seen."""


def look(stage: Stage, what: Object = THE_BOTTLE) -> Pose:
    """Look for a thing from where the robot stands."""
    found: Pose = stage.run(lambda: perform(action("LookingForSomething", object_acted_on=what)))
    return found


def elsewhere(x: float, y: float, z: float = 0.9) -> Body:
    """The bottle at another place."""
    return replace(BOTTLE, pose=Pose((x, y, z)))


def test_a_bottle_where_it_is_believed_to_be_is_seen_there(make_stage: MakeStage) -> None:
    stage = make_stage(*WARD, start=CLOSE)
    assert look(stage) == BOTTLE.pose
    assert stage.belief.seen_from_here("bottle")


@pytest.mark.parametrize("y", [-0.35, -0.2, 0.15, 0.35])
def test_a_bottle_elsewhere_on_its_support_is_found_and_believed_there(y: float, make_stage: MakeStage) -> None:
    stage = make_stage(*WARD, truth=[CABINET, elsewhere(1.55, y), *WARD[2:]], start=CLOSE)
    pose = look(stage)
    assert pose.position == (1.55, y, 0.9)
    assert stage.belief.pose("bottle") == pose
    assert stage.planning.pose("bottle") == pose, "the robot plans with what it saw"


def test_a_bottle_beyond_the_middle_of_the_picture_is_found_by_looking_around(make_stage: MakeStage) -> None:
    """The cabinet is so wide that a look at the believed place does not show its ends."""
    wide = Body("cabinet", Pose((1.6, 0.0, 0.4)), (0.4, 3.0, 0.8), type=CABINET.type)
    stage = make_stage(wide, BOTTLE, truth=[wide, elsewhere(1.5, -1.3)], start=(0.6, 0.0, 0.0))
    assert look(stage).position == (1.5, -1.3, 0.9)
    assert stage.truth.configuration().joints["neck_pan_joint"] < -0.5, "the head has turned to the right end"


def test_a_bottle_that_is_not_there_is_not_found(make_stage: MakeStage) -> None:
    stage = make_stage(*WARD, truth=[CABINET, elsewhere(-1.0, 3.0, 0.1), *WARD[2:]], start=CLOSE)
    with pytest.raises(ObjectNotFound) as caught:
        look(stage)
    assert caught.value.what == "bottle"
    assert stage.belief.looked_in_vain("bottle") == (CLOSE,)
    assert stage.belief.pose("bottle") == BOTTLE.pose, "where it is instead is not known"


def test_a_bottle_hidden_from_everywhere_is_nowhere_to_be_found_after_three_recoveries(make_stage: MakeStage) -> None:
    stage = make_stage(*WARD, truth=[CABINET, elsewhere(-1.0, 4.0, 0.1), *WARD[2:]], start=CLOSE)
    places = []

    async def body() -> None:
        places.append(stage.truth.configuration().base)
        await perform(action("LookingForSomething", object_acted_on=THE_BOTTLE))

    async def plan() -> None:
        await with_failure_handling(
            body,
            Recovery(ObjectNotFound, look_from_another_place(THE_BOTTLE), attempts=3, otherwise=ObjectNowhereToBeFound),
        )

    with pytest.raises(ObjectNowhereToBeFound) as caught:
        stage.run(plan)
    assert [type(link) for link in caught.value.chain()] == [ObjectNowhereToBeFound, ObjectNotFound]
    assert caught.value.what == "bottle"
    assert len(set(places)) == 4, f"it looked from {len(set(places))} places only"


def test_a_bottle_behind_another_thing_is_found_from_another_place(make_stage: MakeStage) -> None:
    box = Body("box", Pose((1.45, 0.25, 0.95)), (0.1, 0.3, 0.3), type="Box-Container")
    at = elsewhere(1.65, 0.25)
    stage = make_stage(CABINET, at, truth=[CABINET, at, box], start=(0.3, 0.25, 0.0))
    found = []

    async def body() -> None:
        found.append(await perform(action("LookingForSomething", object_acted_on=THE_BOTTLE)))

    async def plan() -> None:
        await with_failure_handling(
            body,
            Recovery(ObjectNotFound, look_from_another_place(THE_BOTTLE), attempts=3, otherwise=ObjectNowhereToBeFound),
        )

    stage.run(plan)
    assert found == [at.pose]
    assert stage.truth.configuration().base != (0.3, 0.25, 0.0)


def test_looking_for_a_class_that_is_not_in_the_map_tells_what_is(ward: Stage) -> None:
    with pytest.raises(ObjectUnresolvable, match="there are cabinet, bottle, bed, patient"):
        look(ward, an_object("Refrigerator"))


def test_looking_needs_an_object(ward: Stage) -> None:
    with pytest.raises(ActionUnresolvable, match="object_acted_on"):
        ward.run(lambda: perform(action("LookingForSomething")))


def test_the_head_turns_to_what_it_looks_at(make_stage: MakeStage) -> None:
    stage = make_stage(*WARD, start=(1.0, 1.2, 0.0))
    stage.run(lambda: perform(action("LookingAtSomething", object_acted_on=THE_BOTTLE)))
    assert stage.truth.configuration().joints["neck_pan_joint"] < -0.8, "the bottle is to the right"
