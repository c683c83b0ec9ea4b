"""The witness of the homes: an obvious task is possible, planted impossible ones are impossible for their reason."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from executive.robots import bind_robot
from planlang.geometry import Pose
from sim import Body, Scene
from sim.scene import Cavity, Handle
from tests.benchmarks.homes.tasks import Need
from tests.benchmarks.homes.witness import Answer, Verdict, Witness, is_right_reason

ROOM = Body("room1", Pose((0.0, 0.0, 1.3)), (5.0, 4.0, 2.6), "room")
TABLE = Body("table1", Pose((1.6, 0.0, 0.37)), (0.8, 1.2, 0.74))
CUP = Body("cup1", Pose((1.35, 0.1, 0.792)), (0.07, 0.07, 0.1), "cylinder", movable=True, mass=0.3)
GRASP, PLACE = Need("grasp", "cup1"), Need("place", "cup1", "table1")


def decided(bodies: Sequence[Body], *needs: Need) -> Verdict:
    """Return the answer of the witness for the Amigo."""
    witness = Witness(Scene((ROOM, *bodies), (-2.5, -2.0, 2.5, 2.0)), bind_robot("amigo"))
    try:
        return witness.decide(needs)
    finally:
        witness.close()


def broken(bodies: Sequence[Body], *needs: Need) -> Verdict | None:
    """Return which necessary condition of the Amigo's the witness finds broken, None if none is."""
    witness = Witness(Scene((ROOM, *bodies), (-2.5, -2.0, 2.5, 2.0)), bind_robot("amigo"))
    try:
        return witness.broken(needs)
    finally:
        witness.close()


def test_a_cup_in_the_open_can_be_grasped_and_put_down():
    assert decided([TABLE, CUP], GRASP, PLACE) == Verdict(Answer.POSSIBLE)


@pytest.mark.parametrize(
    ("kind", "thing", "bodies"),
    [
        ("too wide", "cup1", [TABLE, replace(CUP, size=(0.12, 0.12, 0.1))]),
        ("too heavy", "cup1", [TABLE, replace(CUP, mass=9.0)]),
        ("too high", "cup1", [TABLE, replace(CUP, pose=Pose((1.35, 0.0, 2.5)))]),
        ("no floor", "cup1", [replace(TABLE, pose=Pose((0.9, 0.0, 0.37)), size=(3.2, 4.0, 0.74)),
                              replace(CUP, pose=Pose((2.3, 0.0, 0.792)))]),
        ("no room", "table1", [TABLE, CUP, *(
            Body(f"pot{k}", Pose((1.3 + 0.1 * (k % 7), -0.55 + 0.1 * (k // 7), 0.8)), (0.09, 0.09, 0.1), movable=True)
            for k in range(84))]),
    ],
)  # fmt: skip
def test_what_is_impossible_is_so_for_its_reason(kind: str, thing: str, bodies: list[Body]):
    found = decided(bodies, GRASP, PLACE)
    assert (found.answer, found.kind, found.thing) == (Answer.IMPOSSIBLE, kind, thing)


WALL = Body("wall1", Pose((0.6, 0.0, 0.5)), (0.05, 4.0, 1.0))
CASE = Body("case1", Pose((1.8, 1.5, 0.45)), (0.4, 0.6, 0.9), cavities=(Cavity((0.0, 0.0, -0.3), (0.4, 0.56, 0.26)),))
KITCHEN = replace(ROOM, size=(4.0, 4.0, 2.6), cavities=(Cavity((2.05, 0.0, -0.25), (0.3, 0.6, 2.1)),))
DOORWAY = Body("doorway1", Pose((2.05, 0.0, 1.05)), (0.1, 0.6, 2.1), "marker")


def drawn(draw: st.DrawFn) -> tuple[Body, Body]:
    """Return a table and a thing near the edge before which the robot begins, both in Amigo's reach."""
    high, deep = draw(st.floats(0.5, 0.95)), draw(st.floats(0.4, 1.2))
    table = replace(TABLE, pose=Pose((1.0 + deep / 2, 0.0, high / 2)), size=(deep, 1.2, high))
    wide, tall = draw(st.floats(0.03, 0.08)), draw(st.floats(0.03, 0.25))
    at = Pose((1.0 + draw(st.floats(0.05, 0.15)), draw(st.floats(-0.3, 0.3)), high + tall / 2 + 0.002))
    return table, replace(CUP, pose=at, size=(wide, wide, tall))


@settings(max_examples=12, deadline=None, derandomize=True)
@given(room=st.composite(drawn)())
def test_what_is_in_easy_reach_is_never_called_impossible(room: tuple[Body, Body]):
    assert broken(room, GRASP, PLACE) is None


@settings(max_examples=12, deadline=None, derandomize=True)
@given(room=st.composite(drawn)(), how=st.sampled_from(["too wide", "too heavy", "too high", "no floor"]))
def test_what_is_spoilt_on_purpose_is_impossible_for_that_reason(room: tuple[Body, Body], how: str):
    table, cup = room
    x, y, z = cup.pose.position
    spoilt = {
        "too wide": replace(cup, size=(0.13, 0.13, cup.size[2])),
        "too heavy": replace(cup, mass=4.0),
        "too high": replace(cup, pose=Pose((x, y, z + 1.6))),
        "no floor": replace(cup, pose=Pose((2.3, y, z))),
    }[how]
    wall = [WALL] if how == "no floor" else []
    found = broken([table, spoilt, *wall], GRASP)
    assert found is not None
    assert (found.answer, found.kind, found.thing) == (Answer.IMPOSSIBLE, how, "cup1")


def test_a_compartment_below_what_the_arm_reaches_is_out_of_reach_to_put_something_into():
    high = replace(CASE, cavities=(Cavity((0.0, 0.0, 0.0), (0.4, 0.56, 0.26)),))
    assert broken([TABLE, CUP, high], Need("place", "cup1", "case1")) is None
    found = broken([TABLE, CUP, CASE], Need("place", "cup1", "case1"))
    assert found is not None
    assert (found.answer, found.kind, found.thing) == (Answer.IMPOSSIBLE, "out of reach", "case1")


@pytest.mark.parametrize(("deep", "kind"), [(0.62, ""), (0.72, "out of reach")], ids=["in reach", "too deep"])
def test_how_far_in_a_cup_may_stand_is_said_to_a_hand_s_breadth(deep: float, kind: str):
    table = replace(TABLE, pose=Pose((1.5, 0.0, 0.37)), size=(1.7, 4.0, 0.74))
    found = broken([table, replace(CUP, pose=Pose((0.65 + deep, 0.0, 0.792)))], GRASP)
    assert (found.kind if found else "") == kind


def test_a_cup_that_is_only_just_in_reach_has_a_certificate():
    table = replace(TABLE, pose=Pose((1.5, 0.0, 0.37)), size=(1.7, 4.0, 0.74))
    assert decided([table, replace(CUP, pose=Pose((1.25, 0.0, 0.792)))], GRASP).answer is Answer.POSSIBLE


def test_a_doorway_that_is_narrower_than_the_base_is_impossible_to_pass():
    witness = Witness(Scene((KITCHEN, DOORWAY), (-2.5, -2.0, 4.5, 2.0)), bind_robot("amigo"))
    try:
        found = witness.decide([Need("pass", "doorway1")])
    finally:
        witness.close()
    assert (found.answer, found.kind, found.thing) == (Answer.IMPOSSIBLE, "too narrow", "doorway1")


@pytest.mark.parametrize("size", [(0.15, 0.07, 0.01), (0.09, 0.05, 0.02)], ids=["phone", "keys"])
def test_a_flat_thing_on_a_table_has_a_certificate(size: tuple[float, float, float]):
    flat = replace(CUP, pose=Pose((1.35, 0.1, 0.742 + size[2] / 2)), size=size, shape="box")
    assert decided([TABLE, flat], GRASP).answer is Answer.POSSIBLE


def test_a_sponge_that_no_hand_spans_is_pinched_from_above():
    sponge = replace(CUP, pose=Pose((1.35, 0.1, 0.762)), size=(0.12, 0.115, 0.04), shape="box", soft=True)
    assert decided([TABLE, sponge], GRASP).answer is Answer.POSSIBLE


@pytest.mark.pr2
def test_a_pot_is_taken_by_both_hands():
    handles = tuple(Handle(Pose((0.0, y, 0.05)), (0.07, 0.05, 0.015)) for y in (0.131, -0.131))
    pot = Body("pot1", Pose((1.5, 0.0, 0.8255)), (0.212, 0.212, 0.167), "cylinder", movable=True, mass=1.0, wall=0.006,
               hands=2, handles=handles)  # fmt: skip
    table = replace(TABLE, size=(0.5, 1.2, 0.74))
    witness = Witness(Scene((ROOM, table, pot), (-2.5, -2.0, 2.5, 2.0)), bind_robot("pr2"))
    try:
        assert witness.decide([Need("grasp", "pot1")]).answer is Answer.POSSIBLE
    finally:
        witness.close()


def test_a_robot_without_camera_cannot_look_for_a_thing():
    witness = Witness(Scene((ROOM, TABLE, CUP), (-2.5, -2.0, 2.5, 2.0)), bind_robot("panda"))
    try:
        assert witness.decide([Need("see", "cup1")]).kind == "no camera"
    finally:
        witness.close()


def test_a_reason_is_right_if_it_names_the_cause_and_the_thing():
    verdict = {"kind": "too wide", "thing": "cup1"}
    assert is_right_reason(verdict, ("ObjectUnreachable",), "cup1 is too wide for the hand")
    assert not is_right_reason(verdict, ("ObjectUnreachable",), "cup1 is out of reach")
    assert not is_right_reason(verdict, ("GraspTooWide",), "mug1 is too wide for the hand")
