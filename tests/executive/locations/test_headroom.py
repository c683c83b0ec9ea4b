"""Room above things: they are lifted and put down as far as there is some."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from executive.locations.headroom import RISES, SPARE, headroom
from executive.motion import Boxes
from planlang.designators import a_location, an_object
from planlang.geometry import Pose
from planlang.geometry.areas import Block
from sim import Body
from tests.executive.conftest import BOTTLE, PLACE, MakeStage, hold_bottle

BOX = Body("box", Pose((1.5, 0.0, 0.9)), (0.06, 0.06, 0.2), type="CardboardBox", movable=True)
BOARD = Body("board", Pose((1.6, 0.0, 0.79)), (0.4, 1.2, 0.02), type="Shelf")


@given(st.floats(0.0, 0.2), st.floats(-0.3, 0.3), st.floats(-3.1, 3.1))
def test_a_thing_is_raised_by_the_most_that_a_board_above_it_leaves(gap: float, aside: float, yaw: float) -> None:
    assume(min(abs(gap - rise - SPARE) for rise in RISES) > 1e-3)
    block = Block.of(Pose.planar(0.0, 0.0, 0.0, 0.5), (0.1, 0.06, 0.2))
    board = Boxes.around([Pose((0.0, aside, 0.6 + gap + 0.01))], np.array([[0.4, 0.2, 0.02]]))
    (room,) = headroom(block, np.array([[0.0, 0.0, 0.5, yaw]]), board)
    corners = Block.of(Pose.planar(0.0, 0.0, yaw, 0.5), (0.1, 0.06, 0.2))
    if abs(aside) > 0.1 + corners.support(np.pi / 2):
        assert room == RISES[0]
    elif abs(aside) < 0.1 and gap > 0.003:
        fitting = [rise for rise in RISES if rise + SPARE <= gap]
        assert room == (fitting[0] if fitting else RISES[-1])


@pytest.mark.parametrize("gap", [0.03, 0.06, 0.3])
def test_a_box_is_taken_from_between_two_boards_that_leave_little_room_above_it(
    make_stage: MakeStage, gap: float
) -> None:
    above = replace(BOARD, name="above", pose=Pose((1.6, 0.0, 1.01 + gap)))
    stage = make_stage(BOX, BOARD, above)
    base = next(stage.resolver.bases(a_location(in_reach_of=an_object("CardboardBox", PLACE + "box")))).base
    for one in (one for found in stage.resolver.reached_from(base).values() for one in found.values()):
        assert (one.plan.poses[:, 2, 3].max() - one.plan.poses[1, 2, 3]) <= gap


def test_an_arm_at_its_highest_puts_a_thing_down_from_just_above_its_place(make_stage: MakeStage) -> None:
    stage = make_stage(BOTTLE, replace(BOARD, pose=Pose((1.6, 0.0, 1.3)), size=(0.3, 0.6, 0.02)))
    hold_bottle(stage)
    there = a_location(in_reach_of=a_location(on=an_object("Shelf", PLACE + "board")))
    base = next(stage.resolver.bases(there)).base
    for one in (one for found in stage.resolver.reached_from(base).values() for one in found.values()):
        assert one.plan.poses[0, 2, 3] - one.plan.poses[1, 2, 3] == pytest.approx(RISES[-1])
