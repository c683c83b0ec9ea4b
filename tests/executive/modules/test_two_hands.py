"""Two hands take trays, carry them level with what stands on them, and put them down; a hand that opens loses them."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import replace

import pytest

from executive.robots import Robot, bind_robot
from executive.robots.arms import ArmModel
from planlang import perform
from planlang.designators import a_location, a_person, action, an_object
from planlang.failures import (
    ActionUnresolvable,
    HandsLacking,
    LocationUnresolvable,
    ManipulationGoalNotReached,
    ObjectLost,
    TooHeavy,
)
from planlang.geometry import Pose
from planlang.ontology import Ontology
from sim import Body
from sim.scene import Handle
from sim.truth import at_rest_on, held_by, tilt
from tests.executive.conftest import PLACE, MakeStage, Stage, furnisher, model_of
from tests.support.failing_robots import ClosedFingers, StallingPair

TABLE = Body("table", Pose((1.3, 0.0, 0.37)), (0.6, 1.4, 0.74), type="KitchenTable")
OTHER = Body("other", Pose((-1.5, 0.0, 0.36)), (0.8, 1.4, 0.72), type="KitchenTable")
TRAY = Body(
    "tray", Pose((1.2, 0.0, 0.755)), (0.32, 0.45, 0.03), type="Tray", movable=True, wall=0.006, hands=2,
    largest_tilt=math.radians(15), mass=0.8,
)  # fmt: skip
CUP = Body("cup", Pose((1.2, 0.06, 0.791)), (0.07, 0.07, 0.09), "cylinder", type="Cup", movable=True, mass=0.25)
GUEST = Body("guest", Pose((-1.5, 0.0, 0.85)), (0.3, 0.5, 1.7), "person", type="Person")
THE_TRAY, THE_OTHER = an_object("Tray", PLACE + "tray"), an_object("KitchenTable", PLACE + "other")
TAKE = action("PickingUpAnObject", object_acted_on=THE_TRAY)
Limbs = tuple[tuple[ArmModel, ...], object]

pytestmark = pytest.mark.pr2


@pytest.fixture(scope="module")
def pr2() -> Robot:
    return bind_robot("pr2")


@pytest.fixture(scope="module")
def stage_of(pr2: Robot, vocabulary: Ontology) -> Iterator[MakeStage]:
    yield from furnisher(model_of(pr2), vocabulary)


def taken(stage: Stage) -> None:
    async def take() -> None:
        await perform(TAKE)

    stage.run(take)


BARS = tuple(Handle(Pose((0.0, side * 0.32, 0.02)), (0.12, 0.015, 0.015)) for side in (1, -1))
TRAYS = {
    "wide": replace(TRAY, size=(0.6, 0.4, 0.03)),
    "turned": replace(TRAY, pose=Pose.planar(1.2, 0.0, 0.3, 0.755), size=(0.55, 0.55, 0.03)),
    "with handles": replace(TRAY, size=(0.4, 0.6, 0.03), wall=0.0, handles=BARS),
}


@pytest.mark.long
@pytest.mark.parametrize("kind", TRAYS)
def test_a_tray_is_brought_to_another_table_with_the_cup_on_it(stage_of: MakeStage, kind: str) -> None:
    tray = TRAYS[kind]
    cup = replace(CUP, pose=Pose((1.2, 0.06, tray.pose.position[2] + (0.036 if tray.wall else 0.0601))))
    stage = stage_of(TABLE, OTHER, tray, cup)
    taken(stage)
    assert held_by(stage.truth, "tray") == "robot"
    assert (len(stage.truth.holders("tray")), stage.truth.riders("tray")) == (2, ("cup",))

    async def put() -> None:
        await perform(action("PuttingDownAnObject", object_acted_on=THE_TRAY, to_location=a_location(on=THE_OTHER)))

    stage.run(put)
    assert (at_rest_on(stage.truth, "tray"), at_rest_on(stage.truth, "cup")) == ("other", "tray")
    for name in ("tray", "cup"):
        assert stage.belief.pose(name).distance(stage.truth.pose(name)) < 0.01


@pytest.mark.long
def test_a_tray_is_carried_lowered_and_released_in_steps_and_no_arm_moves_alone_meanwhile(stage_of: MakeStage) -> None:
    stage = stage_of(TABLE, OTHER, TRAYS["wide"], CUP)
    taken(stage)
    restored(stage)
    place = {"object_acted_on": THE_TRAY, "to_location": a_location(on=THE_OTHER)}

    async def carry() -> None:
        await perform(action("CarryingWhileLocomoting", **place))
        with pytest.raises(ActionUnresolvable, match="neither moves alone"):
            await perform(action("Reaching", to_location=a_location(above=THE_OTHER)))
        await perform(action("LoweringAnObject", **place))

    stage.run(carry)
    assert (stage.truth.support("tray"), held_by(stage.truth, "tray")) == ("other", "robot")

    async def release() -> None:
        await perform(action("ReleasingGraspOfSomething", object_acted_on=THE_TRAY))

    stage.run(release)
    assert (at_rest_on(stage.truth, "tray"), at_rest_on(stage.truth, "cup")) == ("other", "tray")


def restored(stage: Stage) -> None:
    """Write down the belief as JSON, go on from that, and compare."""
    before = json.loads(json.dumps(stage.belief.snapshot()))
    stage.belief.restore(before)
    assert stage.belief.snapshot() == before
    stage.platform.observe()
    assert (stage.truth.holders("tray"), stage.planning.holders("tray")) == 2 * (stage.truth.holders("tray"),)
    assert stage.truth.riders("tray") == stage.planning.riders("tray") == ("cup",)


ASIDE = action("SettingAsideAnObject", object_acted_on=THE_TRAY)


def set_aside(stage: Stage) -> None:
    async def aside() -> None:
        await perform(ASIDE)

    stage.run(aside)


def test_what_two_hands_hold_is_set_aside_by_both(stage_of: MakeStage) -> None:
    stage = stage_of(TABLE, OTHER, TRAYS["wide"], CUP)
    taken(stage)
    set_aside(stage)
    assert (at_rest_on(stage.truth, "tray"), at_rest_on(stage.truth, "cup")) == ("table", "tray")
    assert not stage.belief.held


APPROACH, LIFTING, DRAWING_IN = 1, 2, 3
"""Numbers of the motions of both arms with which they take a tray."""


def test_arms_that_stop_short_go_on_and_take_the_tray(stage_of: MakeStage) -> None:
    stage, after = stage_of(TABLE, TRAY, CUP), (LIFTING + 1, DRAWING_IN + 2)  # each stalled one is made again
    stage.platform.world = StallingPair(stage.platform.world, APPROACH, *after)  # type: ignore[assignment]
    taken(stage)
    assert (len(stage.truth.holders("tray")), stage.truth.riders("tray")) == (2, ("cup",))
    assert stage.truth.height_above_support("tray") > 0.05
    assert tilt(stage.truth.pose("tray")) < math.radians(2)


def test_arms_that_always_stop_short_are_a_failure(stage_of: MakeStage) -> None:
    stage = stage_of(TABLE, TRAY)
    stage.platform.world = StallingPair(stage.platform.world, *range(20))  # type: ignore[assignment]
    with pytest.raises(ManipulationGoalNotReached):
        taken(stage)


def test_a_hand_that_opens_late_takes_the_tray_all_the_same(stage_of: MakeStage) -> None:
    stage = stage_of(TABLE, TRAY)
    stage.platform.world = ClosedFingers(stage.platform.world, times=2)  # type: ignore[assignment]
    taken(stage)
    assert len(stage.truth.holders("tray")) == 2


def test_a_tray_is_held_out_by_both_hands_and_a_person_takes_it_with_the_cup_on_it(stage_of: MakeStage) -> None:
    stage = stage_of(TABLE, GUEST, TRAY, CUP)
    taken(stage)
    guest = a_person("Person", PLACE + "guest")

    async def serve() -> None:
        await perform(action("Reaching", to_location=a_location(in_reach_of=guest)))
        await perform(action("HandingOverAnObject", object_acted_on=THE_TRAY, recipient=guest))

    stage.run(serve)
    assert (held_by(stage.truth, "tray"), stage.truth.support("cup")) == ("guest", "tray")
    assert not stage.belief.held


def test_one_hand_alone_is_not_sent_to_what_takes_two(stage_of: MakeStage) -> None:
    stage = stage_of(TABLE, TRAY)
    with pytest.raises(HandsLacking, match="tray takes 2 hands, 2 of 2 are free, but one was asked alone"):
        next(stage.resolver.bases(a_location(in_reach_of=THE_TRAY)))


@pytest.mark.long
def test_the_tray_falls_with_what_is_on_it_when_one_hand_opens(stage_of: MakeStage) -> None:
    stage = stage_of(TABLE, OTHER, TRAYS["turned"], CUP)
    taken(stage)
    gripper = stage.platform.robot.arm("left").gripper
    assert gripper is not None

    async def drop() -> None:
        stage.truth.set_configuration(replace(stage.truth.configuration(), joints=gripper.opened))
        await perform(action("PuttingDownAnObject", object_acted_on=THE_TRAY, to_location=THE_OTHER))

    with pytest.raises(ObjectLost):
        stage.run(drop)
    stage.truth.step()
    assert held_by(stage.truth, "tray") is None
    assert not stage.belief.held
    assert set(stage.belief.memory.dropped) == {"left", "right"}


@pytest.mark.parametrize("number", [0, 1])
def test_too_few_hands_are_refused_with_both_numbers(stage_of: MakeStage, number: int) -> None:
    stage = stage_of(TABLE, replace(TRAY, hands=3 - number), replace(CUP, mass=4.0 * number))
    failure, said = (
        (HandsLacking, "takes 3 hands, the robot has 2"),
        (
            TooHeavy,
            "weighs 4.8 kg with the 4 kg in it or on it, both hands carry 3.6 kg: 1.2 kg too much; "
            "with 2.8 kg in it or on it, it could be carried",
        ),
    )[number]
    with pytest.raises(failure, match=said):
        taken(stage)
    assert stage.truth.steps < 100


def test_what_the_arms_do_not_span_is_refused_with_reasons(stage_of: MakeStage) -> None:
    stage = stage_of(TABLE, replace(TRAY, size=(1.5, 1.7, 0.03)))
    with pytest.raises(LocationUnresolvable, match=r"1.5 m by 1.7 m, with two hands \(\d+ candidates: ") as caught:
        taken(stage)
    assert sum(caught.value.counts.values()) > 0


def test_a_tray_is_put_on_a_table_in_front_of_a_person_and_not_held_out(stage_of: MakeStage) -> None:
    guest = replace(GUEST, pose=Pose((-2.3, 0.0, 0.85)))
    stage = stage_of(TABLE, OTHER, guest, TRAY, CUP)
    taken(stage)
    place = a_location(on=THE_OTHER, near=a_person("Person", PLACE + "guest"))

    async def put() -> None:
        await perform(action("PuttingDownAnObject", object_acted_on=THE_TRAY, to_location=place))

    stage.run(put)
    assert (at_rest_on(stage.truth, "tray"), at_rest_on(stage.truth, "cup")) == ("other", "tray")
