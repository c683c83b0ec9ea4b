"""Fingers on hinges go forward while they close: what is behind a thing may keep a hand from taking it."""

from __future__ import annotations

from contextlib import suppress
from itertools import islice

import pytest

from executive.locations import HandSolution
from planlang.designators import a_device, a_location
from planlang.failures import LocationUnresolvable
from planlang.geometry import Pose
from planlang.protocols import Configuration
from sim import Body
from tests.executive.conftest import BOTTLE, CABINET, THE_BOTTLE, MakeStage, Stage

GAPS = (0.05, 0.06, 0.065, 0.1)
"""From the bottle's middle to the wall behind it [m]; at some, open fingers have room and closing ones have none."""


def ways(stage: Stage, most: int) -> list[HandSolution]:
    """GraspCandidates to take the bottle with the left hand from where the robot stands."""
    arm = stage.platform.scene.arms.of(a_device("LeftGripper"))[0]
    found = stage.resolver.hands(a_location(in_center_of=THE_BOTTLE), arm, stage.platform.arm_joints(arm))
    taken = []
    with suppress(LocationUnresolvable):
        for way in islice(found, most):
            taken.append(way)
    return taken


def closed_on(stage: Stage, way: HandSolution) -> str | None:
    """What the hand has between its fingers when it closes them at the grasp of a way."""
    gripper = stage.platform.hands.gripper(way.arm)
    assert gripper is not None
    now = stage.truth.configuration()
    joints = dict(now.joints) | dict(gripper.opened) | dict(zip(way.arm.joints, way.joints[1].tolist(), strict=True))
    stage.truth.set_configuration(Configuration(now.base, joints))

    async def close() -> str | None:
        await stage.platform.hands.move(way.arm, closed=True)
        return stage.platform.hands.between_fingers(way.arm)

    held: str | None = stage.run(close)
    return held


@pytest.mark.parametrize("gap", GAPS)
def test_fingers_close_on_a_bottle_before_a_wall_by_every_way_that_is_offered(
    make_stage: MakeStage, gap: float
) -> None:
    wall = Body("wall", Pose((1.5 + gap + 0.025, 0.0, 1.1)), (0.05, 1.2, 0.6), type="Cupboard")
    stage = make_stage(CABINET, BOTTLE, wall, start=(0.827, 0.0, -0.35))
    offered = ways(stage, 6)
    assert {closed_on(stage, way) for way in offered} == {"bottle"}
