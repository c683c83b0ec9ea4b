"""Pushing things: where a thing is believed to be when the push ends before its time."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from executive.modules.furniture.pushing import ThingStrokes
from executive.modules.tools.motion_grounding import Grounding
from planlang import perform, pursue, sleep
from planlang.designators import action, an_object
from planlang.failures import ObjectNotFound
from planlang.geometry import Pose
from planlang.motion_constraints import a_constraint, a_feature
from planlang.protocols import Trajectory
from sim import Body
from tests.executive.conftest import PLACE, MakeStage

TABLE = Body("table", Pose((1.3, 0.0, 0.37)), (0.8, 1.4, 0.74), type="KitchenTable")
SHORTER = replace(TABLE, name="shorter", pose=Pose((1.05, 0.0, 0.37)), size=(0.3, 1.4, 0.74))
"""Ends where the table of the map goes on, and is not recognised as it."""
BOX = Body("box", Pose((1.15, -0.1, 0.8)), (0.1, 0.1, 0.12), type="FoodOrDrink", movable=True)
TOP = Body("top", Pose((1.15, -0.1, 0.89)), (0.06, 0.06, 0.06), type="FoodOrDrink", movable=True)
THE_BOX = an_object("FoodOrDrink", PLACE + "box")
AXIS = a_feature(of=an_object("DeviceUsed"), path=("ObjectMainAxis",))
BOTTOM = a_feature("PLANE", of=THE_BOX, position=(0.0, 0.0, -0.06), direction=(0.0, 0.0, 1.0))
LOW = a_constraint("HEIGHT", AXIS, BOTTOM, lower=0.02, upper=0.06, name="low")
DOWN = a_constraint("PERPENDICULARITY", AXIS, BOTTOM, lower=-1.2, upper=-0.5, name="down")
PUSH = action("PushingMotion", object_acted_on=THE_BOX, distance_translated=0.15, constrained_by=(LOW, DOWN))


@pytest.mark.long
def test_a_thing_is_believed_to_be_where_the_hand_is_when_its_push_is_interrupted(make_stage: MakeStage) -> None:
    stage = make_stage(TABLE, BOX, TOP)

    def gone_so_far() -> float:
        return stage.truth.pose("box").distance(BOX.pose)

    async def until_on_its_way() -> None:
        while gone_so_far() < 0.04:
            await sleep(0.1)

    async def push() -> None:
        await pursue(until_on_its_way, lambda: perform(PUSH))

    stage.run(push)
    gone = gone_so_far()
    assert 0.02 < gone < 0.13
    assert abs(stage.belief.pose("box").distance(BOX.pose) - gone) < 0.03
    assert abs(stage.belief.pose("top").distance(TOP.pose) - gone) < 0.03


@pytest.mark.long
def test_a_thing_that_was_pushed_off_and_is_not_seen_any_more_is_looked_for(make_stage: MakeStage) -> None:
    stage = make_stage(TABLE, BOX, truth=(SHORTER, BOX))

    async def push() -> None:
        await perform(PUSH)

    with pytest.raises(ObjectNotFound) as caught:
        stage.run(push)
    assert caught.value.what == "box"
    assert stage.truth.support("box") != "shorter"


def test_without_a_camera_a_thing_that_a_hand_does_not_feel_is_not_believed_to_be_pushed(
    make_blind: MakeStage, monkeypatch: pytest.MonkeyPatch
) -> None:
    stage = make_blind(TABLE, BOX, truth=(TABLE, replace(BOX, pose=Pose((1.15, 0.5, 0.8)))))
    stage.belief.trusts_map = True

    async def stroke(_: ThingStrokes, grounding: Grounding, *__: Any, **___: Any) -> Trajectory:
        (arm,) = grounding.grounded().arms
        return Trajectory(arm.joints, np.stack([stage.platform.arm_joints(arm)] * 2))

    monkeypatch.setattr(ThingStrokes, "stroke", stroke)
    with pytest.raises(ObjectNotFound) as caught:
        stage.run(lambda: perform(PUSH))
    assert caught.value.what == "box"
    assert stage.belief.pose("box") == BOX.pose
