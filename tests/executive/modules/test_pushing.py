"""Pushing: leaves are pushed shut by a closed hand, on a line or on an arc."""

from __future__ import annotations

from contextlib import ExitStack

import pytest

from planlang.designators import Condition
from planlang.failures import ActionUnresolvable, ContainerStuck
from planlang.geometry import Pose
from tests.support.leaves import drawn, room, thing

DOOR, DRAWER = 0, 2
"""Seeds of a door and of a drawer."""


@pytest.mark.long
@pytest.mark.parametrize(("seed", "value"), [(DRAWER, 0.2), pytest.param(DOOR, 1.2, marks=pytest.mark.long)])
def test_an_open_leaf_is_pushed_shut(stack: ExitStack, seed: int, value: float) -> None:
    stage = room(stack, drawn(seed))
    stage.truth.set_joint("leaf", value)
    stage.platform.belief.moved("leaf", value)
    stage.do("PushingMotion", "leaf")
    assert stage.truth.joint("leaf") < 0.03
    assert stage.executive.holds(Condition("closed", (stage.designator("leaf"),)))
    assert stage.truth.contacts() == ()


def test_what_cannot_be_pushed_is_refused(stack: ExitStack) -> None:
    stage = room(stack, drawn(DRAWER))
    with pytest.raises(ActionUnresolvable, match="cannot be pushed"):
        stage.do("PushingMotion", "case")


@pytest.mark.long
def test_a_drawer_that_jams_is_believed_to_be_as_far_open_as_it_is(
    stack: ExitStack, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("executive.modules.furniture.leaf_pushing.STROKES", 1)
    case, leaf, grip = drawn(DRAWER)
    assert leaf.pose is not None
    assert leaf.size is not None
    x, y, z = leaf.pose.position
    block = thing("block", "FoodOrDrink", Pose((-1.0, 2.0, 0.05)), (0.02, 0.1, 0.1))
    stage = room(stack, (case, leaf, grip), truth=(case, leaf, grip, block))
    stage.truth.set_joint("leaf", 0.2)
    stage.truth.set_pose("block", Pose((x + leaf.size[0] / 2 - 0.11, y, z)))
    stage.platform.belief.moved("leaf", 0.2)
    with pytest.raises(ContainerStuck, match=r"leaf is at 0\.1"):
        stage.do("PushingMotion", "leaf")
    assert stage.platform.belief.joint("leaf") == pytest.approx(stage.truth.joint("leaf"), abs=0.02)


@pytest.mark.long
def test_a_thin_bar_does_not_go_between_the_fingers_that_push_it(stack: ExitStack) -> None:
    faces = Pose((0.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0))
    parts = (
        thing("case", "Cabinet-PieceOfFurniture", Pose((1.7, 0.0, 0.65)) @ faces, (0.4, 0.9, 1.3), "leaf"),
        thing("leaf", "Door", Pose((1.491, 0.1, 0.995)) @ faces, (0.018, 0.45, 0.55), "handle"),
        thing("handle", "Handle", Pose((1.446, -0.08, 0.995)) @ faces, (0.012, 0.012, 0.16)),
    )
    stage = room(stack, parts, start=(1.05, 0.8, -0.785))
    stage.truth.set_joint("leaf", 1.3)
    stage.platform.belief.moved("leaf", 1.3)
    stage.do("PushingMotion", "leaf")
    assert stage.truth.joint("leaf") < 0.03
