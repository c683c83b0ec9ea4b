"""Meanings of relations, checked by arithmetic of their own; and what is said of those that mean nothing."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import islice

import pytest

from executive.locations.demands import LocationMeaningless, base_demand, hand_demand
from planlang.designators import Location, Relation, a_location, a_person, an_object, located
from planlang.failures import LocationUnresolvable
from planlang.geometry import Pose
from planlang.protocols import Configuration
from planlang.relations.demands import ReachKind
from sim import Body
from tests.executive.conftest import (
    BED,
    BOTTLE,
    CABINET,
    PLACE,
    THE_BOTTLE,
    WARD,
    MakeStage,
    Stage,
    hold_bottle,
    stand,
)

THE_BED, THE_CABINET = an_object("Bed-PieceOfFurniture"), an_object("Cabinet-PieceOfFurniture")
RADIUS = 0.333
"""Of Amigo's base [m]."""


def bases(stage: Stage, location: Location, number: int = 4) -> list[tuple[float, float, float]]:
    return [solution.base for solution in islice(stage.resolver.bases(location), number)]


def test_near_and_far_are_distances_between_outlines(ward: Stage) -> None:
    for x, y, _ in bases(ward, a_location(near=THE_BED, within="40 cm")):
        gap = math.hypot(max(abs(x + 2.5) - 1.0, 0.0), max(abs(y) - 0.46, 0.0)) - RADIUS
        assert -2e-3 <= gap <= 0.402
    for x, y, _ in bases(ward, a_location(far_from=THE_BED, beyond=3.0)):
        assert math.hypot(max(abs(x + 2.5) - 1.0, 0.0), max(abs(y) - 0.46, 0.0)) - RADIUS >= 2.998


def test_a_negated_relation_holds_where_the_relation_does_not(ward: Stage) -> None:
    location = a_location(in_reach_of=THE_BOTTLE, not_=a_location(in_front_of=THE_CABINET))
    for base in bases(ward, location, 3):
        assert ward.resolver.satisfies(a_location(in_front_of=THE_CABINET), base) is None
        assert ward.resolver.satisfies(a_location(in_reach_of=THE_BOTTLE), base) is not None


def test_left_is_that_of_the_thing_if_it_has_a_front_else_the_viewers(ward: Stage) -> None:
    for x, y, _ in bases(ward, a_location(left_of=THE_CABINET), 3):
        assert y > 0.4, "the cabinet's front is its x axis"
        assert abs(x - 1.6) <= y
    stand(ward, (0.3, 0.0, 0.0))  # looking along x at a bottle without front: left is y > 0
    for x, y, _ in bases(ward, a_location(left_of=THE_BOTTLE), 3):
        assert y > 0.0
        assert abs(x - 1.5) <= y


def test_what_faces_a_thing_has_it_ahead(ward: Stage) -> None:
    for x, y, yaw in bases(ward, a_location(near=THE_BED, facing=THE_BED) & a_location(visible_from=THE_BED), 2):
        turn = math.remainder(math.atan2(-y, -2.5 - x) - yaw, 2 * math.pi)
        assert abs(turn) <= math.radians(30) + 2e-3


@pytest.mark.parametrize(
    "location",
    [
        a_location(near=THE_BED, not_=a_location(near=THE_BED)),
        a_location(near=THE_BED, within=0.5) & a_location(far_from=THE_BED, beyond=1.0),
        a_location(in_front_of=THE_CABINET, behind=THE_CABINET),
    ],
    ids=str,
)
def test_a_conjunction_that_nothing_can_satisfy_is_said_to_contradict_itself(location: Location, ward: Stage) -> None:
    with pytest.raises(LocationUnresolvable, match="contradicts itself"):
        next(ward.resolver.bases(location))


def test_an_object_on_a_cabinet_is_supported_whole_and_stands_free_of_others(ward: Stage) -> None:
    ward.belief.bump("bottle", Pose((-2.0, 1.5, 0.1)))
    ward.platform.observe()
    poses = list(islice(ward.resolver.things(a_location(on=THE_CABINET), THE_BOTTLE), 5))
    assert len(poses) == 5
    for pose in poses:
        x, y, z = pose.position
        assert abs(x - 1.6) <= 0.2 - 0.0325 + 1e-9
        assert abs(y) <= 0.4 - 0.0325 + 1e-9
        assert 0.9 <= z <= 0.905


@pytest.mark.parametrize(
    "location",
    [
        a_location(on=THE_BOTTLE),
        a_location(in_=THE_BOTTLE),
        a_location(on=THE_CABINET, near=THE_BOTTLE),
        a_location(on=THE_CABINET, not_=a_location(left_of=THE_BOTTLE)),
    ],
    ids=str,
)
def test_no_thing_is_told_by_a_relation_to_itself(location: Location, ward: Stage) -> None:
    with pytest.raises(LocationMeaningless, match="relates bottle to itself"):
        next(ward.resolver.things(location, THE_BOTTLE))
    with pytest.raises(LocationMeaningless, match="relates bottle to itself"):
        ward.resolver.holds(location, THE_BOTTLE)


@pytest.mark.parametrize("grasp", ["top", "side"])
def test_the_grasp_of_a_place_of_the_base_is_that_of_the_hand_there(grasp: str, make_stage: MakeStage) -> None:
    stage = make_stage(CABINET, replace(BOTTLE, pose=Pose((1.5, 0.0, 0.96)), size=(0.05, 0.05, 0.12)))
    location = a_location(in_reach_of=a_location(in_front_of=THE_BOTTLE), grasp=grasp)
    demand = base_demand(location, stage.platform.scene, (0.0, 0.0))
    assert [reach.grasp for reach in demand.reaches] == [grasp]
    own = a_location(in_reach_of=a_location(in_front_of=THE_BOTTLE, grasp="tilted"), grasp=grasp)
    assert [reach.grasp for reach in base_demand(own, stage.platform.scene, (0.0, 0.0)).reaches] == ["tilted"]


def test_what_is_in_a_hand_is_put_near_where_it_was_and_not_on_itself(make_stage: MakeStage) -> None:
    stage = make_stage(*WARD)
    hold_bottle(stage)
    poses = list(islice(stage.resolver.things(a_location(on=THE_CABINET, near=THE_BOTTLE, within=0.1), THE_BOTTLE), 3))
    assert len(poses) == 3
    assert all(math.dist(pose.position[:2], BOTTLE.pose.position[:2]) <= 0.1 + 2 * 0.0325 + 2e-3 for pose in poses)
    with pytest.raises(LocationMeaningless, match="relates bottle to itself"):
        next(stage.resolver.things(a_location(on=THE_BOTTLE), THE_BOTTLE))
    (arm,) = (arm for arm in stage.platform.scene.arms.all if stage.platform.scene.arms.held(arm.name) is not None)
    with pytest.raises(LocationUnresolvable, match="on itself"):
        next(stage.resolver.hands(a_location(on=THE_BOTTLE), arm, stage.platform.arm_joints(arm)))


@pytest.mark.parametrize(("what", "arm"), [("DrinkingBottle", "right"), ("Cup", "left")])
def test_of_two_things_in_hands_the_one_that_a_place_names_is_put_there(
    what: str, arm: str, make_stage: MakeStage
) -> None:
    stage = make_stage(*WARD, replace(BOTTLE, name="cup", type="Cup", pose=Pose((1.6, 0.25, 0.9))))
    hold_bottle(stage)
    hold_bottle(stage, "left", name="cup")
    where = a_location(in_reach_of=(a_location(on=THE_CABINET), a_location(in_front_of=an_object(what))))
    assert next(stage.resolver.bases(where)).detail["arm"] == arm


def test_what_is_put_beside_a_thing_is_put_on_what_that_stands_on(make_stage: MakeStage) -> None:
    cup = replace(BOTTLE, name="cup", type="Cup", pose=Pose((1.6, 0.25, 0.85)), size=(0.08, 0.08, 0.1))
    stage, beside = make_stage(*WARD, cup), a_location(left_of=an_object("Cup"), seen_from=THE_BED)
    with pytest.raises(LocationMeaningless, match="in_reach_of, above, on, in_, in_center_of, in_front_of"):
        hand_demand(beside, stage.platform.scene, (0.0, 0.0))
    hold_bottle(stage)
    reach = hand_demand(beside, stage.platform.scene, (0.0, 0.0))
    assert (reach.kind, reach.body, [term.name for term in reach.also]) == (ReachKind.PLACE, "cabinet", ["left_of"])


def test_what_holds_is_judged_as_candidates_are(ward: Stage) -> None:
    base = bases(ward, a_location(in_reach_of=THE_BOTTLE), 2)[1]
    here = located(a_location(in_reach_of=THE_BOTTLE))
    assert not ward.executive.holds(here)
    stand(ward, base)
    assert ward.executive.holds(here)
    assert ward.executive.holds(located(a_location(on=THE_CABINET), THE_BOTTLE))
    assert not ward.executive.holds(located(a_location(on=THE_BED), THE_BOTTLE))


@pytest.mark.parametrize(
    ("pose", "said"),
    [
        (Pose((math.nan, 0.0, 0.9)), "not finite"),
        (Pose((1.5, 0.0, 0.9), (0.0, 0.0, 0.0, 2.0)), "not a unit quaternion"),
    ],
)
def test_a_thing_at_an_impossible_pose_is_named(pose: Pose, said: str, make_stage: MakeStage) -> None:
    stage = make_stage(CABINET, BOTTLE)
    stage.belief.state = stage.belief.state.placed({"bottle": pose})
    for location in (a_location(in_reach_of=THE_BOTTLE), a_location(visible_from=THE_BOTTLE)):
        with pytest.raises(LocationUnresolvable, match=said):
            next(stage.resolver.bases(location))


def test_a_mere_place_is_neither_seen_nor_stood_on(make_stage: MakeStage) -> None:
    stage = make_stage(CABINET, replace(BED, shape="marker", size=(0.0, 0.0, 0.0)))
    for location in (a_location(visible_from=THE_BED), a_location(clear_of=THE_BED)):
        with pytest.raises(LocationUnresolvable, match="has no size"):
            next(stage.resolver.bases(location))


@pytest.mark.parametrize("relation", ["in_reach_of", "visible_from", "clear_of", "in_front_of", "next_to"])
def test_what_is_said_from_outside_is_not_said_of_the_room_that_everything_is_in(
    relation: str, make_stage: MakeStage
) -> None:
    room = Body("room", Pose((0.0, 0.0, 1.5)), (8.0, 8.0, 3.0), "room", type="HospitalRoom")
    stage = make_stage(room, CABINET)
    what = an_object("HospitalRoom")
    with pytest.raises(LocationUnresolvable, match=r"room is (a|the only) room"):
        next(stage.resolver.bases(Location((Relation(relation, (what,)),))))
    assert bases(stage, a_location(near=what, facing=what), 1)


def test_what_is_clear_of_a_room_is_in_another(make_stage: MakeStage) -> None:
    rooms = [Body(f"room{x}", Pose((x, 0.0, 1.5)), (5.0, 5.0, 3.0), "room", type="HospitalRoom") for x in (-2.75, 2.75)]
    other = an_object("HospitalRoom", PLACE + rooms[0].name)
    for x, _, _ in bases(make_stage(*rooms, start=(2.0, 0.0, 0.0)), a_location(clear_of=other), 3):
        assert x > 0
    with pytest.raises(LocationUnresolvable, match="no way for the base"):  # walls without a door
        bases(make_stage(*rooms, start=(-2.0, 0.0, 0.0)), a_location(clear_of=other), 3)


def test_a_bottle_inside_a_wall_is_in_collision_with_it(make_stage: MakeStage) -> None:
    wall = replace(CABINET, size=(0.6, 0.8, 1.6), pose=Pose((1.6, 0.0, 0.8)))
    with pytest.raises(LocationUnresolvable) as caught:
        next(make_stage(wall, BOTTLE).resolver.bases(a_location(in_reach_of=THE_BOTTLE)))
    assert next(iter(caught.value.blocking)) == "cabinet"


def test_an_added_obstacle_makes_no_place_possible(make_stage: MakeStage) -> None:
    post = replace(CABINET, name="post", pose=Pose.planar(0.7, -0.3, 0.4, 0.5), size=(0.2, 0.2, 1.0))
    fewer, more = make_stage(*WARD), make_stage(*WARD, post)
    for location in (a_location(in_reach_of=THE_BOTTLE), a_location(in_reach_of=a_person("Patient"))):
        for base in bases(more, location, 3):
            assert fewer.resolver.satisfies(location, base) is not None


def test_what_hides_a_thing_is_named(make_stage: MakeStage) -> None:
    screen = replace(CABINET, name="screen", pose=Pose((0.9, 0.0, 0.9)), size=(0.04, 0.9, 1.8))
    stage = make_stage(CABINET, BOTTLE, screen, start=(0.0, 0.0, 0.0))
    assert stage.platform.scene.visibility.hidden((0.2, 0.0, 0.0), "bottle") == "screen"
    stage.truth.set_configuration(Configuration((0.2, 0.0, 0.0), stage.truth.configuration().joints))


def test_a_mirrored_world_has_mirrored_places(make_stage: MakeStage) -> None:
    def room(sign: float) -> Stage:
        post = replace(CABINET, name="post", pose=Pose((0.7, -0.8 * sign, 0.5)), size=(0.2, 0.3, 1.0))
        return make_stage(CABINET, replace(BOTTLE, pose=Pose((1.5, 0.2 * sign, 0.9))), post)

    one, other = room(1.0), room(-1.0)
    for location in (a_location(in_reach_of=THE_BOTTLE), a_location(visible_from=THE_BOTTLE, near=THE_CABINET)):
        for x, y, yaw in bases(one, location, 3):
            assert other.resolver.satisfies(location, (x, -y, -yaw)) is not None, f"{location} at {(x, -y, -yaw)}"
