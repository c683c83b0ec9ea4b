"""The list of changes that ``planlang why`` tries: what is in it, in which order, and how small each is."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from executive.why.candidates import Candidate, advised, cheaper, singles
from executive.why.costs import cost_of
from executive.why.evidence import Evidence
from executive.why.wording import clause_of
from planlang.advice import Change
from planlang.geometry import Pose
from sim import Body, Scene
from sim.scene import BodyShape, Cavity
from tests.support.failed_situation import CUP, CUPBOARD, DOOR, EVIDENCE, HINGE, SCENE, SITUATION, TABLE


def kinds(candidates: list[Candidate]) -> list[str]:
    """Kinds in the order in which they first come."""
    return list(dict.fromkeys(one.kind for one in candidates))


def with_smaller(candidates: list[Candidate]) -> list[Candidate]:
    return [each for one in candidates for each in (*one.smaller, one)]


def test_the_cheapest_changes_come_first_and_what_the_failure_does_not_name_last() -> None:
    found = singles(SITUATION)
    named = ["arm", "grasp", "attempts", "thing moved", "away", "furniture moved", "robot"]
    assert kinds(found) == [*named, "before", "door"]
    assert [one.changes[0].value for one in found[:2]] == ["right", "left"]
    assert len(with_smaller(found)) <= 80


def test_a_thing_is_moved_only_where_it_has_room_and_with_what_stands_on_it() -> None:
    every = with_smaller(singles(SITUATION))
    cup = [one.changes for one in every if one.changes[0].thing == "cup1"]
    ahead = {changes[0].value for changes in cup if changes[0].value[1] > 0.01}
    assert ahead == {(1.9, 0.05, 0.79), (1.9, 0.1, 0.79), (1.9, 0.4, 0.79)}, "0.2 m further the box is in the way"
    box = [one.changes for one in every if one.changes[0].thing == "box1" and one.kind == "thing moved"]
    assert all([change.thing for change in changes] == ["box1", "saucer1"] for changes in box)


def test_what_the_plan_needs_and_what_that_stands_on_is_not_taken_away() -> None:
    away = [{change.thing for change in one.changes} for one in singles(SITUATION) if one.kind == "away"]
    assert away == [{"box1", "saucer1"}, {"saucer1"}]


def test_where_the_robot_cannot_hold_the_thing_another_robot_comes_before_other_places() -> None:
    found = singles(replace(SITUATION, evidence=replace(EVIDENCE, is_of_places=False)))
    assert kinds(found).index("robot") < kinds(found).index("thing moved")


def test_where_a_search_tried_every_arm_and_grasp_these_come_after_other_places() -> None:
    found = singles(replace(SITUATION, evidence=replace(EVIDENCE, is_of_search=True)))
    assert kinds(found)[0] == "thing moved"
    assert kinds(found).index("arm") > kinds(found).index("robot")


def test_orders_of_steps_are_tried_only_if_some_were_open() -> None:
    assert "order" not in kinds(singles(SITUATION))
    assert "order" in kinds(singles(replace(SITUATION, evidence=replace(EVIDENCE, is_concurrent=True))))


def test_what_was_advised_has_the_cost_of_its_changes_and_things_of_other_maps_are_left_out() -> None:
    moved = (Change("translation", (1.9, 0.3, 0.79), "cup1"),)
    strange = (Change("absent", True, "cup9"),)
    found = advised(replace(SITUATION, evidence=replace(EVIDENCE, advised=(strange, moved))))
    assert [(one.changes, round(one.cost, 6)) for one in found] == [(moved, 6.0)]


def test_what_moves_or_goes_along_costs_nothing_and_is_said_with_the_first() -> None:
    along = (Change("translation", (1.9, 0.3, 0.79), "box1"), Change("translation", (1.9, 0.3, 0.845), "saucer1"))
    assert cost_of(along, SCENE) == cost_of(along[:1], SCENE) == 4.0
    assert clause_of(along, SCENE) == "box1 is moved 0.10 m, to x = 1.90, y = 0.30, z = 0.79, and saucer1 with it"
    gone = (Change("absent", True, "saucer1"), Change("absent", True, "box1"))
    assert (cost_of(gone, SCENE), clause_of(gone, SCENE)) == (5.0, "box1 is not there, nor saucer1")


def test_each_kind_of_change_costs_what_the_guide_says() -> None:
    costs = {
        Change("arm", "left"): 1.0,
        Change("schedule", 2): 1.0,
        Change("attempts", 1): 2.0,
        Change("before", "OpeningAContainerArtifact door1"): 2.0,
        Change("jointPosition", 1.57, "door1"): 4.0,
        Change("translation", (2.0, 0.1, 0.37), "table1"): 6.0,
        Change("robot", "pr2"): 8.0,
    }
    assert {change: cost_of((change,), SCENE) for change in costs} == costs
    assert clause_of(tuple(costs)[-1:], SCENE) == "the robot is pr2"
    assert (
        clause_of(tuple(costs)[3:5], SCENE)
        == "the robot first opens door1, and door1 is open by 90 degrees from the start"
    )


def test_what_a_hand_holds_may_be_put_down_before_the_step_that_failed() -> None:
    held = replace(EVIDENCE, held=(("box1", "serve/budget/serve/at_location"),))
    found = singles(replace(SITUATION, evidence=held))
    assert kinds(found)[:3] == ["arm", "grasp", "put down"]
    change = Change("before", "SettingAsideAnObject box1@serve/budget/serve/at_location")
    down = next(one for one in found if one.kind == "put down")
    assert (down.changes, down.cost) == ((change,), 2.0)
    assert clause_of(down.changes, SCENE) == "the robot puts box1 down before serve/budget/serve/at_location"
    hands = replace(held, is_of_places=False)
    assert "put down" in kinds(singles(replace(SITUATION, evidence=hands)))[:3]


def test_only_single_changes_that_cost_less_and_touch_the_reason_are_cheaper() -> None:
    found = cheaper(SITUATION, 4.5)
    assert kinds(found) == ["arm", "grasp", "attempts", "thing moved"]
    assert all(one.cost < 4.5 for one in with_smaller(found))


def test_a_door_that_is_ajar_may_be_shut_or_open_further() -> None:
    ajar = replace(SCENE, joints=(replace(HINGE, first=0.5),))
    doors = [one.changes[0].value for one in singles(replace(SITUATION, scene=ajar)) if one.kind == "door"]
    assert doors == [0.0, 1.57]


def test_a_run_is_past_another_if_more_steps_succeeded_or_as_many_and_another_one_failed() -> None:
    assert replace(EVIDENCE, steps=2).is_past(EVIDENCE)
    assert replace(EVIDENCE, where="serve/pour").is_past(EVIDENCE)
    assert not replace(EVIDENCE, steps=0, where="serve/pour").is_past(EVIDENCE)
    assert not replace(EVIDENCE, where="serve/SettingAsideAnObject/LoweringAnObject").is_past(EVIDENCE)


def places(scene: Scene, name: str) -> set[Any]:
    """Where a body that the failure names is moved to."""
    evidence = replace(EVIDENCE, texts=(f"{name} cannot be reached",), blocking={})
    every = with_smaller(singles(replace(SITUATION, scene=scene, evidence=evidence)))
    first = [one.changes[0] for one in every]
    return {one.value for one in first if one.thing == name and one.what == "translation"}


def test_a_thing_is_moved_up_or_down_only_onto_something() -> None:
    assert {z for _, _, z in places(SCENE, "cup1")} == {0.79}, "5 cm above the table is in the air"
    shelf = Body("shelf1", Pose((1.9, 0.0, 0.92)), (0.2, 0.2, 0.02))
    assert {z for _, _, z in places(Scene((*SCENE.bodies, shelf)), "cup1")} == {0.79, 0.99}, "20 cm up is on the shelf"
    tall = replace(CUP, pose=Pose((1.9, 0.0, 0.99)))
    assert places(Scene((TABLE, tall)), "cup1") == {(1.9, 0.0, 0.79)}, "what hangs in the air is let down"
    heights = {z for _, _, z in places(SCENE, "table1")}
    assert heights == {0.17, 0.32, 0.37, 0.42, 0.57}, "furniture may be of another height"


def test_a_thing_stays_in_its_compartment_and_does_not_get_through_the_walls() -> None:
    hollow = replace(CUPBOARD, cavities=(Cavity((0.07, 0.0, 0.0), (0.6, 0.56, 0.96)),))
    cup = replace(CUP, pose=Pose((0.0, 3.0, 0.6)))
    for cupboard in (CUPBOARD, hollow):
        found = places(Scene((cupboard, cup, DOOR), joints=(HINGE,)), "cup1")
        assert {z for _, _, z in found} == {0.6}
        back = {0.0, -0.05, -0.1} | ({-0.2} if cupboard == CUPBOARD else set())
        assert {x for x, _, _ in found} == back | {0.05, 0.1, 0.2}
        assert {y for _, y, _ in found} == {3.0, 3.05, 3.1, 3.2, 2.95, 2.9, 2.8}, "0.4 m to a side is outside"


def test_nothing_is_moved_through_the_wall_of_a_room() -> None:
    room = Body("room1", Pose((2.0, 0.0, 1.25)), (1.0, 4.0, 2.5), BodyShape.ROOM)
    assert {x for x, _, _ in places(Scene((room, *SCENE.bodies)), "table1")} == {1.8, 1.9, 1.95, 2.0, 2.05, 2.1, 2.2}


def test_what_was_advised_is_left_out_if_the_thing_would_hang_in_the_air() -> None:
    beside = (Change("translation", (2.5, 0.0, 0.79), "cup1"),)
    assert advised(replace(SITUATION, evidence=replace(EVIDENCE, advised=(beside,)))) == []


def test_a_move_up_or_down_is_said_as_such() -> None:
    up = (Change("translation", (2.0, 0.0, 0.42), "table1"),)
    assert clause_of(up, SCENE) == "table1 is moved 0.05 m up, to x = 2.00, y = 0.00, z = 0.42"


def test_classes_of_grasps_are_tried_only_if_the_plan_left_one_open() -> None:
    assert "grasp" in kinds(singles(SITUATION))
    assert "grasp" not in kinds(singles(replace(SITUATION, evidence=replace(EVIDENCE, is_grasp_open=False))))


@pytest.mark.parametrize(
    ("location", "is_open"),
    [("in_reach_of(cup1) with gripper", True), ("in_reach_of(cup1) by a top grasp", False), ("near(table1)", False)],
)
def test_a_trace_tells_whether_a_place_was_sought_to_grasp_from(location: str, is_open: bool) -> None:
    node = {"step": 0, "event": "started", "node": 1, "parent": None, "name": "at_location", "kind": "at_location"}
    assert Evidence.of([{**node, "location": location}]).is_grasp_open is is_open
