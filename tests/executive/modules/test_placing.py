"""Putting down: what a hand holds is lowered onto a place found by relations, let go, and left standing."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

from executive.locations.demands import hand_demand
from executive.locations.hand_predicates import Stage as SearchStage
from executive.locations.hand_predicates import candidates_of
from executive.locations.rejections import Rejections
from planlang import perform
from planlang.designators import Location, a_location, a_posture, action, an_object
from planlang.failures import ActionUnresolvable, ManipulationFailure
from planlang.geometry import Pose
from sim import Body
from sim.truth import at_rest_on
from tests.executive.conftest import (
    BED,
    BOTTLE,
    CABINET,
    PLACE,
    THE_BOTTLE,
    MakeStage,
    Stage,
    hold_bottle,
    stand,
)
from tests.support.detections import put
from tests.support.examples import some

MAT = Body("mat", Pose((2.0, 0.0, 0.782)), (0.3, 0.4, 0.004), type="TableCloth", movable=True)
TABLE = Body("table", Pose((2.0, 0.0, 0.39)), (0.6, 1.2, 0.78), type="Table-PieceOfFurniture")
FORK = Body("fork", Pose((1.0, 2.0, 0.01)), (0.2, 0.02, 0.02), type="Fork-SilverwarePiece", movable=True)
CUP = Body("cup", Pose((2.0, -0.45, 0.84)), (0.08, 0.08, 0.12), "cylinder", type="Cup", movable=True)
THE_TABLE, THE_MAT = an_object(TABLE.type, PLACE + "table"), an_object(MAT.type, PLACE + "mat")
THE_CUP, THE_FORK = an_object(CUP.type, PLACE + "cup"), an_object(FORK.type, PLACE + "fork")
TRAY = Body(
    "tray", Pose((1.88, 0.1, 0.795)), (0.32, 0.45, 0.03), type="Tray", movable=True, wall=0.006, hands=2, mass=0.8
)
THE_TRAY = an_object(TRAY.type, PLACE + "tray")
THE_CABINET = an_object(CABINET.type, PLACE + "cabinet")


def put_down(stage: Stage, where: Location, near: Location | None = None) -> None:
    """Lower the bottle from a base pose where that is possible, and ``near`` holds; let it go and come back."""
    location = a_location(in_reach_of=where)
    stand(stage, next(stage.resolver.bases(location if near is None else near & location)).base)

    async def plan() -> None:
        await perform(action("LoweringAnObject", object_acted_on=THE_BOTTLE, to_location=where))
        await perform(action("OpeningAGripper", object_acted_on=THE_BOTTLE))
        await perform(action("Reaching", to_location=a_location(in_front_of=THE_BOTTLE)))
        await perform(action("Reaching", to_location=a_posture("carrying")))

    stage.run(plan)


@pytest.mark.parametrize("side", some(["left_of", "right_of"]))
def test_the_bottle_stands_where_the_relations_want_it_and_touches_nothing(make_stage: MakeStage, side: str) -> None:
    stage = make_stage(BED, BOTTLE, CABINET, TABLE, CUP, MAT)
    hold_bottle(stage)
    where = a_location(on=THE_TABLE) & a_location(**{side: THE_CUP}, within=0.15) & a_location(seen_from=THE_CABINET)
    put_down(stage, where)
    assert at_rest_on(stage.truth, "bottle") == "table"
    assert stage.resolver.holds(where, THE_BOTTLE)
    assert stage.truth.contacts() == ()
    assert stage.truth.pose("bottle").matrix()[2, 2] > 0.999
    assert stage.truth.pose("cup").distance(CUP.pose) < 1e-6
    assert stage.planning.pose("bottle").distance(stage.truth.pose("bottle")) < 0.005


def test_a_thing_is_put_on_a_mat_that_lies_on_the_table(make_stage: MakeStage) -> None:
    stage = make_stage(BED, BOTTLE, CABINET, TABLE, CUP, MAT)
    hold_bottle(stage)
    put_down(stage, a_location(on=THE_MAT))
    assert at_rest_on(stage.truth, "bottle") == "mat"


def test_what_stands_on_the_table_does_not_stand_on_the_mat_as_well(make_stage: MakeStage) -> None:
    stage = make_stage(BED, BOTTLE, CABINET, TABLE, CUP, MAT)
    for pose in islice(stage.resolver.things(a_location(on=THE_TABLE, near=THE_MAT), THE_CUP), 50):
        x, y, _ = pose.position
        assert math.hypot(max(abs(x - 2.0) - 0.15, 0.0), max(abs(y) - 0.2, 0.0)) >= 0.04


def test_a_fork_is_turned_so_that_it_fits_beside_the_mat(make_stage: MakeStage) -> None:
    wide = Body("mat", Pose((2.0, 0.0, 0.782)), (0.6, 1.0, 0.004), type="TableCloth", movable=True)
    stage = make_stage(BED, BOTTLE, CABINET, TABLE, wide, FORK)
    where = a_location(on=THE_TABLE, left_of=THE_MAT, seen_from=THE_CABINET)
    pose = next(stage.resolver.things(where, THE_FORK))
    assert np.isclose(abs(math.cos(pose.yaw)), 1.0), "10 cm are left, and it is 20 cm long"
    assert stage.resolver.holds(where, THE_FORK) is False, "it still lies elsewhere"


def test_things_beside_the_mat_lie_along_it_and_leave_room_for_each_other(make_stage: MakeStage) -> None:
    """In 15 cm beside the mat there is room for four forks of 2 cm."""
    laid = [replace(FORK, name=f"fork{number}") for number in range(4)]
    stage = make_stage(BED, BOTTLE, CABINET, TABLE, MAT, *laid)
    where = a_location(on=THE_TABLE, seen_from=THE_CABINET) & a_location(left_of=THE_MAT, within=0.15)
    gaps = []
    for fork in laid:
        pose = next(stage.resolver.things(where, an_object(fork.type, PLACE + fork.name)))
        assert np.isclose(abs(math.cos(pose.yaw)), 1.0), "its long side is turned to the mat"
        gaps.append(abs(pose.position[1]) - 0.2 - 0.01)
        put(stage.belief, fork.name, pose)
        stage.platform.observe()
    assert max(gaps) <= 0.15 + 1e-6


def test_places_at_the_edge_come_last_where_more_may_come_beside(make_stage: MakeStage) -> None:
    stage = make_stage(BED, BOTTLE, CABINET, TABLE, CUP)
    hold_bottle(stage)
    scene = stage.platform.scene
    ((arm, held),) = [(arm, held) for arm in scene.arms.all if (held := scene.arms.held(arm.name)) is not None]
    reach = hand_demand(a_location(on=THE_TABLE, in_front_of=THE_CABINET, within=1.0), scene, (0.0, 0.0))
    found = candidates_of(reach, arm, scene, Rejections(), SearchStage.ALL)
    middles = np.concatenate([one.points + held.offsets(one.rotations) for one in found])[:, :2]
    spare = np.array(TABLE.size[:2]) / 2 - np.abs(middles - TABLE.pose.position[:2]) - BOTTLE.size[0] / 2
    assert spare.min() > 0.05


@pytest.mark.parametrize("length", [0.12, 0.2], ids=["can", "bottle"])
def test_what_lies_is_put_down_lying_where_the_arm_cannot_set_it_up(make_stage: MakeStage, length: float) -> None:
    low = Body("low", Pose((-2.0, 0.0, 0.25)), (0.6, 1.2, 0.5), type="CoffeeTable-PieceOfFurniture")
    laid = replace(BOTTLE, pose=Pose((1.5, 0.0, 0.8325), (0.0, math.sqrt(0.5), 0.0, math.sqrt(0.5))))
    stage = make_stage(CABINET, replace(laid, size=(0.065, 0.065, length)), low)
    before, around = a_location(in_front_of=THE_BOTTLE), a_location(in_center_of=THE_BOTTLE)
    stand(stage, next(stage.resolver.bases(a_location(in_reach_of=(THE_BOTTLE, before, around)))).base)

    async def take() -> None:
        await perform(action("Reaching", to_location=before))
        await perform(action("OpeningAGripper"))
        await perform(action("Reaching", to_location=around))
        await perform(action("ClosingAGripper", object_acted_on=THE_BOTTLE))
        await perform(action("Reaching", to_location=before))
        await perform(action("Reaching", to_location=a_posture("carrying")))

    stage.run(take)
    there = an_object(low.type, PLACE + "low")
    stand(stage, next(stage.resolver.bases(a_location(in_reach_of=(there, a_location(on=there))))).base)
    put_down(stage, a_location(on=there))
    assert at_rest_on(stage.truth, "bottle") == "low"
    assert abs(stage.truth.pose("bottle").rotation[2, 2]) < 0.02


@pytest.mark.parametrize("hands", [1, 2])
def test_what_something_is_put_on_is_in_reach_without_being_grasped(make_stage: MakeStage, hands: int) -> None:
    stage = make_stage(BED, BOTTLE, CABINET, TABLE, replace(TRAY, hands=hands), replace(BOTTLE, name="other"))
    hold_bottle(stage)
    if hands == 1:  # no hand is free for the tray
        hold_bottle(stage, "left", name="other")
    put_down(stage, a_location(on=THE_TRAY), a_location(in_reach_of=THE_TRAY))
    assert at_rest_on(stage.truth, "bottle") == "tray"


def test_a_full_hand_comes_above_what_takes_two_hands(make_stage: MakeStage) -> None:
    stage = make_stage(BED, BOTTLE, CABINET, TABLE, TRAY)
    hold_bottle(stage)
    solution = next(stage.resolver.bases(a_location(in_reach_of=THE_TRAY)))
    assert solution.detail["reaches"][0].startswith("above tray")


def test_an_empty_hand_puts_nothing_down(make_stage: MakeStage) -> None:
    stage = make_stage(BED, BOTTLE, CABINET, TABLE)

    async def plan() -> None:
        await perform(action("LoweringAnObject", object_acted_on=THE_BOTTLE, to_location=THE_TABLE))

    with pytest.raises(ActionUnresolvable, match="no hand holds bottle"):
        stage.run(plan)


def test_a_place_out_of_reach_is_a_failure_of_manipulation(make_stage: MakeStage) -> None:
    stage = make_stage(BED, BOTTLE, CABINET, TABLE)
    hold_bottle(stage)
    stand(stage, (0.0, 0.0, 0.0))

    async def plan() -> None:
        await perform(action("LoweringAnObject", object_acted_on=THE_BOTTLE, to_location=THE_TABLE))

    with pytest.raises(ManipulationFailure):
        stage.run(plan)
