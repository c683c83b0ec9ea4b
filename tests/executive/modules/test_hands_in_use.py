"""Both hands hold something: what is refused then, and what the robot's own body keeps them from."""

from __future__ import annotations

from contextlib import ExitStack
from functools import partial

import numpy as np
import pytest

from executive.modules.trays.pair_paths import PairPaths
from executive.robots.arm_pair import ArmPair
from planlang import SimulationHost, explain, perform, run
from planlang.designators import Device, a_device, a_location, action, an_object
from planlang.failures import (
    ActionUnresolvable,
    HandsFull,
    LocationUnresolvable,
)
from planlang.geometry import Pose
from planlang.motion_constraints import a_constraint, a_feature
from sim import Body
from tests.executive.conftest import BOTTLE, PLACE, MakeStage, Stage, hold_bottle
from tests.support.leaves import drawn, room, thing

TABLE = Body("table", Pose((1.3, 0.0, 0.37)), (0.6, 1.4, 0.74), type="KitchenTable")
TRAY = Body("tray", Pose((1.2, 0.0, 0.755)), (0.3, 0.4, 0.03), type="Tray", movable=True, hands=2)
DRAWER = 2
"""Seed of a drawer."""


@pytest.fixture
def stage(make_stage: MakeStage) -> Stage:
    """Amigo with a tray between its hands, before a table."""
    return with_tray(make_stage(TABLE, TRAY))


def with_tray(stage: Stage) -> Stage:
    """Put the tray of a stage between the robot's hands."""
    tips = {arm.name: stage.platform.robot.arm(arm.name).tip for arm in stage.platform.scene.arms.all}
    x, y, z = np.mean([stage.truth.link_pose(tip).position for tip in tips.values()], axis=0).tolist()
    stage.truth.set_pose("tray", Pose((x, y, z)))
    for arm, tip in tips.items():
        stage.truth.attach(tip, "tray")
        stage.belief.grasped("tray", arm, tip, stage.truth.link_pose(tip).inverse() @ stage.truth.pose("tray"))
    stage.platform.observe()
    return stage


@pytest.mark.parametrize("tool", ["hand", "tray"])
def test_an_arm_that_holds_something_with_another_does_not_move_alone_under_constraints(
    stage: Stage, tool: str
) -> None:
    left = stage.platform.robot.arm("left").iri
    of = Device("Hand", left) if tool == "hand" else an_object("Tray", PLACE + "tray")
    mine = a_feature("LINE", of=of, position=(0.0, 0.0, 0.0), direction=(0.0, 0.0, 1.0))
    table = an_object("KitchenTable", PLACE + "table")
    top = a_feature("PLANE", of=table, position=(0.0, 0.0, 0.37), direction=(0.0, 0.0, 1.0))
    over = action("ITaSCMotion", constrained_by=(a_constraint("HEIGHT", mine, top, lower=0.1, name="over"),))
    before = stage.truth.configuration().joints
    with pytest.raises(ActionUnresolvable, match="neither moves alone"):
        stage.run(lambda: perform(over))
    arms = [joint for arm in stage.platform.scene.arms.all for joint in arm.joints]
    assert [stage.truth.configuration().joints[one] for one in arms] == [before[one] for one in arms]


def test_places_at_which_the_robot_would_touch_itself_are_counted_by_this_reason(stage: Stage) -> None:
    platform = stage.platform
    one, other = platform.scene.arms.all
    paths = PairPaths(platform, ArmPair((one, other), platform.world.configuration().joints))
    nearer = Pose((-0.1, 0.0, 0.0)) @ stage.truth.pose("tray")
    assert list(paths.places("tray", [nearer], lambda pose: [platform.base()])) == [None]
    assert paths.log.counts["touches itself"] > 0
    assert not paths.log.blocking


@pytest.mark.parametrize("kind", ["OpeningAContainerArtifact", "ClosingAContainerArtifact", "PushingMotion"])
def test_a_leaf_is_neither_led_nor_pushed_while_no_hand_is_free(kind: str) -> None:
    bottles = [thing(name, "DrinkingBottle", Pose((-2.0, y, 0.1)), BOTTLE.size) for name, y in (("one", 1), ("two", 2))]
    with ExitStack() as stack:
        furnished = room(stack, (*drawn(DRAWER), *bottles))
        stage = Stage(furnished.truth, furnished.platform, furnished.executive)
        value = 0.0 if kind.startswith("Opening") else 0.2
        stage.truth.set_joint("leaf", value)
        stage.belief.moved("leaf", value)
        hold_bottle(stage, "right", name="one")
        hold_bottle(stage, "left", name="two")
        full = r"no hand is free for \w+: (right holds one, left holds two|left holds two, right holds one)"
        with pytest.raises(HandsFull, match=full) as caught:
            furnished.do(kind, "leaf")
        assert set(caught.value.held) == {"left", "right"}, "what a recovery needs to know"
        assert stage.truth.joint("leaf") == pytest.approx(value)
        assert set(stage.belief.held) == {"one", "two"}


@pytest.mark.parametrize(
    ("kind", "what", "part"), [("TurningOnPoweredDevice", "maker", "button"), ("PushingMotion", "cup", "cup")]
)
def test_what_the_hands_hold_is_named_where_none_is_free_to_push(kind: str, what: str, part: str) -> None:
    facing = Pose((0.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0))
    bottles = [thing(name, "DrinkingBottle", Pose((-2.0, y, 0.1)), BOTTLE.size) for name, y in (("one", 1), ("two", 2))]
    things = (
        thing("table", "KitchenTable", Pose((0.7, 0.0, 0.375)), (0.6, 1.6, 0.75)),
        thing("maker", "PancakeMaker", Pose((0.6, 0.0, 0.8)) @ facing, (0.3, 0.3, 0.1), "button"),
        thing("button", "PushButton", Pose((0.445, 0.0, 0.81)) @ facing, (0.01, 0.03, 0.03)),
        thing("cup", "Cup", Pose((0.6, 0.5, 0.795)), (0.07, 0.07, 0.09)),
    )
    with ExitStack() as stack:
        furnished = room(stack, (*things, *bottles))
        stage = Stage(furnished.truth, furnished.platform, furnished.executive)
        hold_bottle(stage, "right", name="one")
        hold_bottle(stage, "left", name="two")
        pushing = action(kind, object_acted_on=furnished.designator(what), distance_translated=0.1)
        with pytest.raises(HandsFull) as caught:
            run(partial(perform, pushing), host=SimulationHost(stage.truth), executive=stage.executive)
        assert caught.value.because().startswith(f"no hand is free for {part}: ")
        held, advice = caught.value.because().partition(": ")[2].split("; ")
        assert {"right holds one", "left holds two"} == set(held.split(", "))
        assert advice == "put one down first"
        assert explain(caught.value).splitlines()[0].count("no hand is free") == 1, "it is said once"


def test_a_hand_that_holds_nothing_is_told_so_when_it_is_to_put_something_down(ward: Stage) -> None:
    left = a_device("LeftHand", PLACE + "leftHand")
    put = a_location(in_reach_of=a_location(on=an_object("Cabinet-PieceOfFurniture", PLACE + "cabinet")), using=left)
    with pytest.raises(LocationUnresolvable, match="no hand holds anything to put down at cabinet; grasp it first"):
        next(ward.resolver.bases(put))
    hold_bottle(ward, "right")
    said = "the right arm holds bottle, and the left arm, which is to put it down, holds nothing"
    with pytest.raises(LocationUnresolvable, match=said):
        next(ward.resolver.bases(put))


def test_what_two_hands_hold_and_no_furniture_is_near_for_is_told_to_be_put_down_before(make_stage: MakeStage) -> None:
    stage = with_tray(make_stage(TRAY))

    async def aside() -> None:
        await perform(action("SettingAsideAnObject", object_acted_on=an_object("Tray", PLACE + "tray")))

    with pytest.raises(LocationUnresolvable, match="room for tray, which two hands hold: put it down at a place"):
        stage.run(aside)
    assert len(stage.truth.holders("tray")) == 2


def test_a_search_goes_on_where_no_hand_is_free_to_open_a_drawer(stack: ExitStack) -> None:
    bed = thing("bed", "Bed-PieceOfFurniture", Pose((-2.5, -2.0, 0.37)), (0.8, 0.6, 0.74))
    spoon = thing("spoon", "Spoon", Pose((-2.5, -2.0, 0.75)), (0.15, 0.03, 0.02))
    bottles = [thing(name, "DrinkingBottle", Pose((-2.0, y, 0.1)), BOTTLE.size) for name, y in (("one", 1), ("two", 2))]
    furnished = room(stack, (*drawn(DRAWER), bed, spoon, *bottles))
    stage = Stage(furnished.truth, furnished.platform, furnished.executive)
    state = stage.belief.snapshot()
    stage.belief.restore({**state, "belief": {**state["belief"], "unknown": ["spoon"]}})
    stage.platform.observe()
    hold_bottle(stage, "right", name="one")
    hold_bottle(stage, "left", name="two")
    what = furnished.designator("spoon")
    stage.run(lambda: perform(action("LookingForSomething", object_acted_on=what)))
    assert stage.platform.scene.bodies.known(what) == "spoon"
