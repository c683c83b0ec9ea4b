"""The witness of the homes: an obvious task is possible, planted impossible ones are impossible for their reason."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import pytest

from executive.robots import bind_robot
from planlang.geometry import Pose
from sim import Body, Scene
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
