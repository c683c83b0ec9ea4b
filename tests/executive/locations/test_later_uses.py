"""Grasps are chosen for what is done with the thing later, as far as the actions around tell."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from executive.locations.deliveries import offering
from executive.locations.grasp_candidates import CLASSES
from executive.locations.placement import Placement
from executive.locations.reachability import GraspClass
from executive.locations.rejections import Rejections
from executive.motion import QuickCheck
from executive.robots.arms import Held
from planlang import perform
from planlang.designators import Action, Object, a_location, a_person, action
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import inverse, rigid
from sim import Body, BodyShape
from tests.executive.conftest import MakeStage, Stage
from tests.support.leaves import room, thing

TABLE = Body("table", Pose((1.2, 0.0, 0.37)), (0.8, 1.4, 0.74), type="KitchenTable")
CUP = Body(
    "cup",
    Pose((1.0, 0.1, 0.79)),
    (0.07, 0.07, 0.1),
    BodyShape.CYLINDER,
    type="Cup",
    movable=True,
    largest_tilt=0.26,
)
PHONE = Body("phone", Pose((1.0, 0.1, 0.75)), (0.15, 0.05, 0.02), type="CellularTelephone", movable=True)
VISITOR = Body("visitor", Pose((-1.6, 0.0, 0.85)), (0.3, 0.5, 1.7), BodyShape.PERSON, type="Person")
SHELF = Body("shelf", Pose((-1.8, 0.0, 0.8)), (0.4, 0.9, 0.02), type="Shelf")
BOARD = Body("board", Pose((-1.8, 0.0, 1.0)), (0.4, 0.9, 0.02), type="Shelf")
"""One over the other with 18 cm between them: a hand comes in from the front, not from above."""


def grips(stage: Stage, thing: Object, around: Action | None, most: int = 3) -> set[str]:
    """Return the classes of the first grasps of a thing that are found while an action around is performed."""
    found: list[str] = []

    async def search() -> None:
        solutions = stage.resolver.bases(a_location(in_reach_of=thing))
        found.extend(next(solutions).detail["reaches"][0] for _ in range(most))

    stage.run(search if around is None else partial(perform, around, otherwise=search))
    return {label.split(", ")[1] for label in found}


def known(stage: Stage, name: str) -> Object:
    """Return the designator of a thing."""
    return stage.platform.scene.bodies.designator(name)


def test_a_low_cup_is_gripped_from_the_side_if_it_is_handed_over_to_somebody_who_stands(make_stage: MakeStage) -> None:
    stage = make_stage(TABLE, CUP, VISITOR)
    cup = known(stage, "cup")
    assert "side" not in grips(stage, cup, None), "from above is more natural where the table is near"
    assert grips(stage, cup, action("FetchingAnObject", object_acted_on=cup)) == grips(stage, cup, None)
    bring = action("TransportingAnObject", object_acted_on=cup, recipient=a_person("Person"))
    assert grips(stage, cup, bring) == {"side"}


def test_what_is_done_with_another_thing_decides_nothing(make_stage: MakeStage) -> None:
    other = replace(CUP, name="other", pose=Pose((1.0, -0.4, 0.79)))
    stage = make_stage(TABLE, CUP, other, VISITOR)
    bring = action("TransportingAnObject", object_acted_on=known(stage, "other"), recipient=a_person("Person"))
    assert grips(stage, known(stage, "cup"), bring) == grips(stage, known(stage, "cup"), None)


def test_a_low_cup_is_gripped_from_the_side_if_it_goes_between_two_shelves(make_stage: MakeStage) -> None:
    stage = make_stage(TABLE, CUP, SHELF, BOARD)
    cup, shelf = known(stage, "cup"), known(stage, "shelf")
    put = action("TransportingAnObject", object_acted_on=cup, to_location=shelf)
    assert grips(stage, cup, put) == {"side"}


def test_a_low_cup_is_not_gripped_from_above_if_the_arm_would_go_through_the_board_over_its_place(
    make_stage: MakeStage,
) -> None:
    stage = make_stage(TABLE, CUP, SHELF, replace(BOARD, pose=Pose((-1.8, 0.0, 1.13))))
    cup, shelf = known(stage, "cup"), known(stage, "shelf")
    put = action("TransportingAnObject", object_acted_on=cup, to_location=shelf)
    assert "top" not in grips(stage, cup, put)


def test_a_thing_is_gripped_low_if_it_goes_as_high_as_a_hand_only_just_reaches(make_stage: MakeStage) -> None:
    high = replace(SHELF, name="high", pose=Pose((-1.8, 0.0, 1.36)))
    tall = replace(CUP, pose=Pose((1.0, 0.1, 0.89)), size=(0.07, 0.07, 0.3))
    stage, heights = make_stage(TABLE, tall, high), list[float]()
    cup, onto = known(stage, "cup"), known(stage, "high")

    async def search() -> None:
        base = next(stage.resolver.bases(a_location(in_reach_of=cup))).base
        for reached in stage.resolver.reached_from(base).values():
            heights.extend(float(one.plan.poses[1, 2, 3]) for one in reached.values())

    stage.run(partial(perform, action("TransportingAnObject", object_acted_on=cup, to_location=onto), otherwise=search))
    assert max(heights) < tall.pose.position[2] - 0.05


def test_doors_that_are_still_shut_rule_out_no_grip_of_what_goes_behind_them(stack: ExitStack) -> None:
    leaves = [
        part
        for name, y in (("left", 0.15), ("right", -0.15))
        for part in (
            thing(name, "Door", Pose((-1.59, y, 0.95)), (0.02, 0.3, 0.2), f"grip_{name}"),
            thing(f"grip_{name}", "Handle", Pose((-1.55, 0.3 * y, 0.95)), (0.012, 0.012, 0.15)),
        )
    ]
    case = thing("case", "Cupboard", Pose((-1.8, 0.0, 0.95)), (0.4, 0.62, 0.22), "left", "right")
    table = thing("table", "KitchenTable", Pose((1.2, 0.0, 0.37)), (0.8, 1.4, 0.74))
    stage = room(stack, (case, *leaves, table, thing("cup", "Cup", Pose((1.0, 0.1, 0.79)), (0.07, 0.07, 0.1))))
    cup, into = stage.designator("cup"), a_location(in_=stage.designator("case"))
    found = list[str]()

    async def search() -> None:
        solutions = stage.platform.resolver.bases(a_location(in_reach_of=cup))
        found.extend(next(solutions).detail["reaches"][0] for _ in range(3))

    stage.run(partial(perform, action("TransportingAnObject", object_acted_on=cup, to_location=into), otherwise=search))
    assert {label.split(", ")[1] for label in found} == {"side"}


def test_places_for_what_follows_are_looked_for_once_for_all_grips(
    make_stage: MakeStage, monkeypatch: pytest.MonkeyPatch
) -> None:
    stage, counted = make_stage(TABLE, CUP, SHELF, BOARD), list[str]()

    def spots(self: Placement, log: Rejections) -> tuple[Array, Array]:
        counted.append(self.name)
        return there(self, log)

    there = Placement.spots
    monkeypatch.setattr(Placement, "spots", spots)
    cup, shelf = known(stage, "cup"), known(stage, "shelf")
    grips(stage, cup, action("TransportingAnObject", object_acted_on=cup, to_location=shelf))
    assert counted == ["cup"]


def test_a_level_hand_offers_what_it_took_from_above_unless_that_has_to_stay_upright(make_stage: MakeStage) -> None:
    scene = make_stage(VISITOR).platform.scene
    arm, zone = scene.arms.all[0], scene.bodies.zone("visitor")
    from_above = GraspClass.TOP.rotations([0.0], [1], arm.frame)[0]
    held = Held("phone", Pose.from_matrix(inverse(rigid(from_above, np.zeros(3)))), PHONE.size)
    offers = offering("visitor", zone, arm.frame, held, fine=True)
    level = offers.chosen(offers.grasps == CLASSES.index(GraspClass.SIDE))
    assert len(level)
    assert all(zone.contains(point) for point in level.points + held.offsets(level.rotations))
    upright = offering("visitor", zone, arm.frame, replace(held, largest_tilt=0.26), fine=True)
    assert set(upright.grasps) == {CLASSES.index(GraspClass.TOP)}


def test_one_free_hand_is_enough_to_know_that_a_grip_suits_what_follows(
    make_stage: MakeStage, monkeypatch: pytest.MonkeyPatch
) -> None:
    poses, hit = [0], QuickCheck.hand_hit

    def counted(self, tips):  # type: ignore[no-untyped-def]
        poses[0] += len(tips)
        return hit(self, tips)

    monkeypatch.setattr(QuickCheck, "hand_hit", counted)
    stage = make_stage(TABLE, CUP, SHELF, BOARD)
    cup, shelf = known(stage, "cup"), known(stage, "shelf")
    assert grips(stage, cup, action("TransportingAnObject", object_acted_on=cup, to_location=shelf)) == {"side"}
    assert poses[0] < 14_000
