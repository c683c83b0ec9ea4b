"""Certificates of the witness: what fits between fingers, rims, arms that get out of the way, either of two doors."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pybullet
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from executive.robots import bind_robot
from planlang.geometry import Pose
from sim import Body, Scene
from sim.joints import Articulation, JointKind
from tests.benchmarks.homes.grips import RIMS, Grips
from tests.benchmarks.homes.nearest import widths
from tests.benchmarks.homes.tasks import Need
from tests.benchmarks.homes.witness import Answer, Verdict, Witness

ROOM = Body("room1", Pose((0.0, 0.0, 1.3)), (5.0, 4.0, 2.6), "room")
TABLE = Body("table1", Pose((1.6, 0.0, 0.37)), (0.8, 1.2, 0.74))
CUP = Body("cup1", Pose((1.35, 0.1, 0.792)), (0.07, 0.07, 0.1), "cylinder", movable=True, mass=0.3)
BOWL = replace(CUP, name="bowl1", pose=Pose((1.35, 0.1, 0.772)), size=(0.16, 0.16, 0.06), wall=0.006)
BOX = replace(CUP, name="box1", size=(0.19, 0.08, 0.17), shape="box")
AMIGO = bind_robot("amigo")
RIGHT = AMIGO.arm("right")
GRIPS = Grips({"right": 0.03, "left": 0.03})


CASE = Body("case1", Pose((2.2, 1.0, 0.45)), (0.5, 1.0, 0.9))
DOORS = [Body(f"door{k}", Pose((1.94, 0.25 + 0.5 * k, 0.45)), (0.02, 0.5, 0.9)) for k in (1, 2)]
JOINTS = tuple(
    Articulation(f"door{k}", JointKind.HINGED, (1.94, 0.5 * k, 0.0), (0.0, 0.0, 1.0), 0.0, 1.57, "case1")
    for k in (1, 2)
)


def tip(closing: float, at: Pose) -> np.ndarray:
    """Return a tip at a pose that points down and closes along a direction, by its angle about the vertical [rad]."""
    frame = np.eye(4)
    side = np.array([math.cos(closing), math.sin(closing), 0.0])
    frame[:3, :3] = np.column_stack([(0.0, 0.0, -1.0), side, np.cross((0.0, 0.0, -1.0), side)])
    frame[:3, 3] = at.position
    return frame


@pytest.mark.parametrize(("closing", "fits"), [(math.pi / 2, True), (math.pi / 2 + 0.3, False), (0.0, False)])
def test_a_box_is_taken_only_as_far_turned_as_all_of_it_fits_between_the_fingers(closing: float, fits: bool):
    (aim,) = GRIPS.aims(BOX, [BOX.pose])
    hands = GRIPS.from_tip(RIGHT, tip(closing, BOX.pose), aim, BOX.pose, lifts=True)
    assert bool(hands) == fits


def test_a_bowl_wider_than_the_hand_is_taken_by_its_rim_but_not_along_it():
    whole, rim = GRIPS.aims(BOWL, [BOWL.pose])
    assert GRIPS.from_tip(RIGHT, tip(0.0, BOWL.pose), whole, BOWL.pose, lifts=True) == []
    first = rim.poses[0]
    assert len(rim.poses) == RIMS
    assert math.dist(first.position[:2], BOWL.pose.position[:2]) == pytest.approx(0.077)
    assert first.position[2] == pytest.approx(0.802)
    assert GRIPS.from_tip(RIGHT, tip(0.0, first), rim, first, lifts=True)
    assert not GRIPS.from_tip(RIGHT, tip(math.pi / 2, first), rim, first, lifts=True)


def test_what_is_taken_is_lifted_or_pulled_out_but_not_what_stays():
    (aim,) = GRIPS.aims(CUP, [CUP.pose])
    far, near = GRIPS.from_tip(RIGHT, tip(0.0, CUP.pose), aim, CUP.pose, lifts=False)
    assert [len(far), len(near)] == [2, 2]
    assert far[0][2, 3] > near[0][2, 3] > near[1][2, 3] == pytest.approx(CUP.pose.position[2])
    ends = [one[2][2, 3] - one[1][2, 3] for one in GRIPS.from_tip(RIGHT, tip(0.0, CUP.pose), aim, CUP.pose, lifts=True)]
    assert ends == pytest.approx([0.05, 0.095, 0.05, 0.095])


@settings(max_examples=30, deadline=None, derandomize=True)
@given(
    shape=st.sampled_from(["box", "cylinder"]),
    way=st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda one: min(map(abs, one)) > 0.05),
    turn=st.tuples(*[st.floats(-3.0, 3.0)] * 3),
)
def test_how_a_width_changes_is_its_derivative(shape: str, way: tuple[float, ...], turn: tuple[float, ...]):
    rotation = np.linalg.qr(np.eye(3) + 0.3 * np.outer(turn, (1.0, 0.5, 0.2)))[0][None]
    ways = np.array(way)[None]
    width, change = widths(shape, (0.07, 0.07, 0.2), rotation, ways)
    for axis in range(3):
        step = 1e-6 * np.eye(3)[axis]
        assert widths(shape, (0.07, 0.07, 0.2), rotation, ways + step)[0] - width == pytest.approx(
            change @ step, abs=1e-9
        )


def test_a_robot_can_drive_with_its_arms_drawn_in_and_then_has_them_as_usual_again():
    witness = Witness(Scene((ROOM,), (-2.5, -2.0, 2.5, 2.0)), AMIGO)
    oracle, usual, widest = witness.oracle, dict(witness.oracle.posture), []
    arms = [link for name, link in oracle.links.items() if name.endswith(("_right", "_left"))]
    try:
        with witness.search.arms.driving() as postures:
            for _ in postures:
                oracle.place((0.0, 0.0, 0.0), oracle.posture)
                boxes = [pybullet.getAABB(oracle.uid, link, physicsClientId=oracle.client) for link in arms]
                widest.append(max(math.hypot(*np.abs(corner[:2])) for box in boxes for corner in box))
                assert oracle.touched() is None
        assert oracle.posture == usual
    finally:
        witness.close()
    assert len(widest) == 2
    assert widest[1] < widest[0]


@pytest.mark.parametrize(
    ("able", "either", "answer"),
    [
        ({"door1"}, True, Answer.POSSIBLE),
        ({"door2"}, True, Answer.POSSIBLE),
        ({"door2"}, False, Answer.OPEN),
        (set[str](), True, Answer.OPEN),
    ],
    ids=["the one meant", "the other", "not that meant", "neither"],
)
def test_either_door_will_do_if_the_task_says_so(able: set[str], either: bool, answer: Answer):
    witness = Witness(Scene((ROOM, CASE, *DOORS), (-2.5, -2.0, 2.5, 2.0), joints=JOINTS), AMIGO)
    needs = [Need(kind, "door1", "case1", either=either) for kind in ("open", "close")]
    try:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(witness.search, "certified", lambda need, scene, leaves: {need.thing, *leaves} <= able)
            patch.setattr(witness, "broken", lambda needs: None)
            assert witness.decide(needs) == Verdict(answer, open=() if answer is Answer.POSSIBLE else ("open door1",))
    finally:
        witness.close()


def test_an_arm_that_would_be_pressed_against_the_base_by_a_lowered_torso_is_put_aside():
    low = replace(TABLE, pose=Pose((1.6, 0.0, 0.21)), size=(0.8, 1.2, 0.42))
    cup = replace(CUP, pose=Pose((1.35, 0.1, 0.47)))
    witness = Witness(Scene((ROOM, low, cup), (-2.5, -2.0, 2.5, 2.0)), AMIGO)
    try:
        assert witness.decide([Need("grasp", "cup1")]).answer is Answer.POSSIBLE
    finally:
        witness.close()
