"""Goals are decided by what is so in the true world, with the tolerances of the one table."""

from __future__ import annotations

import math

import pytest

from executive.goals import Judge, Predicate
from planlang.geometry import Pose
from planlang.state.matter import Portion
from sim.tolerances import AMOUNT, SHUT_SHARE
from tests.executive.goals.conftest import MakeWorld


@pytest.mark.parametrize(
    ("phrase", "reason"),
    [
        ("cup1 on tray1", ""),
        ("cup1 is at rest on tray1", ""),
        ("cup1 on serving_table1", "cup1 is on tray1"),
        ("cup1 not on serving_table1", ""),
        ("cup1 on the floor", "cup1 is on tray1"),
        ("tray1 on serving_table1", ""),
        ("2 Cup on tray1", ""),
        ("3 Cup on tray1", "it holds of 2 Cup (cup1, cup2), not of 3: cup3 is on tray2"),
        ("at least 1 Cup on tray1", ""),
        ("at most 1 cup on tray1", "it holds of 2 Cup (cup1, cup2), not of at most 1"),
        ("a Cup on the tray", ""),
        ("every Cup on a Tray", ""),
        ("every Cup on tray1", "cup3 is on tray2"),
        ("no Cup on the floor", ""),
        ("cup1 near cup2", ""),
        ("cup1 near cup3", "cup1 is on tray1, not on tray2 as cup3 is"),
        ("cup1 within 1 cm of cup2", "cup1 is on tray1, 0.09 m from cup2"),
        ("cup1 in room1", ""),
        ("cup1 held by robot", "cup1 is on tray1"),
        ("cup1 not held by robot", ""),
        ("cup1 is empty", ""),
        ("a Cup exists", ""),
        ("no DinnerPlate exists", ""),
        ("robot in room1", ""),
        ("robot within 30 cm of serving_table1", "the robot is at 0.00, 0.00 in room1"),
        ("robot facing serving_table1", ""),
    ],
)
def test_a_phrase_says_what_is_so_in_the_tea_room(make_world: MakeWorld, phrase: str, reason: str) -> None:
    verdict = make_world("tea_room").decide(phrase)
    assert (verdict.holds, verdict.reason) == (not reason, reason)


def test_what_falls_is_judged_where_it_has_come_to_rest(make_world: MakeWorld) -> None:
    world = make_world("tea_room")
    world.put("cup1", -2.1, 0.4, 1.2)
    assert world.truth.falling("cup1")
    assert world.decide("cup1 on tea_table1").holds
    world.put("cup1", 0.0, 1.5, 0.5)
    assert world.decide("cup1 on tea_table1").reason == "cup1 is on the floor of room1"
    assert world.decide("cup1 on the floor").holds


def test_what_toppled_is_not_on_anything(make_world: MakeWorld) -> None:
    world = make_world("soup_kitchen")
    judge = world.judge("cup1 on table1")
    lying = Pose((0.0, 0.0, 0.0), (math.sin(math.pi / 4), 0.0, 0.0, math.cos(math.pi / 4)))
    world.truth.set_pose("cup1", Pose((-1.0, 1.25, 0.85)) @ lying)
    world.truth.gravity.begin("cup1", ())
    (verdict,) = judge.verdicts()
    assert (verdict.holds, verdict.reason) == (False, "cup1 is on table1, toppled")
    assert world.decide("cup1 on table1").holds, "it lay there before"


@pytest.mark.parametrize(
    ("share", "closed", "opened"),
    [(0.0, True, False), (0.99 * SHUT_SHARE, True, False), (0.06, False, False), (0.9, False, True)],
)
def test_a_door_is_closed_within_the_tolerance_and_open_only_if_it_is_wide(
    make_world: MakeWorld, share: float, closed: bool, opened: bool
) -> None:
    world = make_world("kitchenette")
    (joint,) = world.scene.joints
    world.truth.set_joint(joint.leaf, share * joint.upper)
    for thing in ("cabinet1", "cabinet_door1"):
        assert world.decide(f"{thing} closed").holds is closed
        assert world.decide(f"{thing} open").holds is opened
        assert world.decide(f"{thing} is not closed").holds is not closed


def test_a_thing_in_furniture_is_in_its_box_and_at_rest(make_world: MakeWorld) -> None:
    world = make_world("kitchenette")
    assert world.decide("bottle1 in cabinet1").holds
    assert world.decide("cabinet1 is empty").reason == "cabinet1 has bottle1 in it"
    world.put("bottle1", -1.6, 1.3, 0.9)
    assert world.decide("bottle1 in cabinet1").reason == "bottle1 is on table1"
    assert world.decide("cabinet1 is empty").holds


def test_an_amount_may_deviate_by_the_tolerance(make_world: MakeWorld) -> None:
    world = make_world("soup_kitchen")
    assert world.decide("pot1 contains Soup").holds
    assert world.decide("pot1 contains 1.2 l of Soup").holds
    assert world.decide("pot1 contains 1150 ml").holds, "5 % are 57 ml"
    assert world.decide("pot1 contains at most 1100 ml").reason == "pot1 holds 1200 ml of Soup"
    assert world.decide("cup1 contains Soup").reason == "cup1 holds nothing"
    world.truth.matter = world.truth.matter.put("cup1", Portion("Soup", 40.0 - AMOUNT))
    assert world.decide("cup1 contains 40 ml").holds
    assert not world.decide("cup1 contains 41 ml").holds


def test_a_device_is_on_or_off(make_world: MakeWorld) -> None:
    world = make_world("soup_kitchen")
    is_on = world.truth.condition("stove1") == "DeviceStateOn"
    assert world.decide("stove1 switched on").holds is is_on
    assert world.decide("stove1 is on").holds is is_on
    assert world.decide("stove1 is off").holds is not is_on


def test_things_that_move_on_routes_do_not_keep_a_world_from_being_judged(make_world: MakeWorld) -> None:
    world = make_world("tea_room")
    before = world.truth.steps
    world.decide("cup1 on tray1")
    assert world.truth.steps - before == world.truth.rate, "one second at rest, counted in steps"


def test_a_predicate_is_a_goal_that_fails_if_it_raises(make_world: MakeWorld) -> None:
    world = make_world("tea_room")

    def cup_is_low(truth: object) -> bool:
        return world.truth.pose("cup1").position[2] < 0.5

    goals = (Predicate(cup_is_low), Predicate(lambda truth: truth.pose("cup9")))  # type: ignore[attr-defined]
    low, broken = Judge(goals, world.truth, world.map).verdicts()
    assert (low.goal.rpartition(".")[2], low.holds, low.reason) == ("cup_is_low", False, "it is false in the world")
    assert not broken.holds
    assert broken.reason.startswith("it raised KeyError: ")
