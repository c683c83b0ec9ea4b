"""Pushing things: what keeps a hand from it, and where a thing is believed to be when the push ends before its time."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from executive.modules.furniture.pushing import ThingStrokes
from executive.modules.tools.motion_grounding import Grounding
from planlang import SimulationHost, explain, perform, pursue, run, sleep
from planlang.designators import action, an_object
from planlang.failures import BehindClosedDoor, ManipulationPoseUnreachable, ObjectNotFound, ObjectNowhereToBeFound
from planlang.geometry import Pose
from planlang.motion_constraints import ConstraintsUnsatisfied, a_constraint, a_feature
from planlang.protocols import Trajectory
from sim import Body
from tests.executive.conftest import PLACE, MakeStage
from tests.support.room_doors import RoomDoor, flat

TABLE = Body("table", Pose((1.3, 0.0, 0.37)), (0.8, 1.4, 0.74), type="KitchenTable")
SHORTER = replace(TABLE, name="shorter", type="", pose=Pose((1.05, 0.0, 0.37)), size=(0.3, 1.4, 0.74))
"""Ends where the table of the map goes on, and is of no class that a camera recognises."""
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
    with pytest.raises(ObjectNowhereToBeFound) as caught:
        stage.run(lambda: perform(PUSH), steps=20_000)  # it is felt for where a hand gets to
    assert caught.value.what == "box"
    assert stage.belief.pose("box") == BOX.pose


def test_the_shut_door_that_keeps_the_base_from_a_thing_to_push_is_named(stack: ExitStack, tmp_path: Path) -> None:
    stated = {
        "table": ("KitchenTable", "3.5 0 0.37", "0.7 1.2 0.74"),
        "parcel": ("CardboardBox", "3.3 0.1 0.8", "0.12 0.16 0.12"),
    }
    more = "\n".join(
        f"Individual: {name}\n    Types: knowrob:{cls}\n"
        f'    Facts: knowrob:translation "{at}", knowrob:boundingBoxSize "{size}"\n'
        for name, (cls, at, size) in stated.items()
    )
    stage = flat(stack, RoomDoor(more=more), tmp_path)
    push = action("PushingMotion", object_acted_on=stage.designator("parcel"), distance_translated=0.15)
    with pytest.raises(BehindClosedDoor, match="parcel is behind door, which is closed") as shut:
        run(partial(perform, push), host=SimulationHost(stage.truth), executive=stage.executive)
    assert shut.value.door == stage.designator("door")


def test_where_no_hand_gets_behind_a_thing_it_is_said_in_a_sentence_what_to_change(
    make_blind: MakeStage, monkeypatch: pytest.MonkeyPatch
) -> None:
    stage = make_blind(TABLE, BOX)
    stage.belief.trusts_map = True

    async def stroke(*_: Any, **__: Any) -> Trajectory:
        raise ConstraintsUnsatisfied("these constraints contradict each other", blocked_by="shelf")

    monkeypatch.setattr(ThingStrokes, "stroke", stroke)
    with pytest.raises(ManipulationPoseUnreachable) as caught:
        stage.run(lambda: perform(PUSH))
    said = str(caught.value)
    assert "shelf is in the way" in said
    assert "nearer to the edge of table" in said
    assert len(said.split()) <= 40
    assert "contradict" not in explain(caught.value)
