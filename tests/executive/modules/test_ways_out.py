"""An arm that seems to be in something moves a little way out of it before it goes on; one that is deep in stays."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from executive.modules.ways_out import SHALLOW, way_out_of_arm
from planlang import perform
from planlang.designators import a_posture, action
from planlang.geometry import Pose
from sim import Body
from tests.executive.conftest import BED, CABINET, MakeStage, Stage

BLOCK = Body("block", Pose((4.0, 4.0, 0.5)), (0.1, 0.1, 0.1), type="Box-Container", movable=True)


def in_the_hand(stage: Stage, least: float, most: float) -> float:
    """Have the robot believe a block in a hand, so deep, while it is elsewhere; return how deep."""
    scene, base = stage.platform.scene, stage.platform.base()
    tip = scene.arms.tip(scene.arms.all[0])[:3, 3]
    for ahead in np.arange(0.3, 0.0, -0.002):
        stage.belief.bump("block", Pose((float(tip[0] + ahead), float(tip[1]), float(tip[2]))))
        stage.platform.observe()
        deepest = max((contact.depth for contact in scene.collisions.contacts(base)), default=0.0)
        if least < deepest < most:
            return deepest
    raise AssertionError("the block is nowhere so deep in the hand")


def test_an_arm_that_only_seems_to_be_in_something_gets_out_of_it_and_goes_on(make_stage: MakeStage) -> None:
    stage = make_stage(BED, CABINET, BLOCK)
    in_the_hand(stage, 0.001, SHALLOW / 2)

    async def plan() -> None:
        await perform(action("Reaching", to_location=a_posture("carrying")))

    stage.run(plan)
    assert not stage.platform.scene.collisions.contacts(stage.platform.base())


def test_an_arm_that_is_deep_in_something_has_no_short_way_out(make_stage: MakeStage) -> None:
    stage = make_stage(BED, CABINET, replace(BLOCK, size=(0.2, 0.2, 0.2)))
    in_the_hand(stage, SHALLOW * 1.2, 1.0)
    assert way_out_of_arm(stage.platform, stage.platform.scene.arms.all[0], None) is None
