"""Turning devices on and off: a hand on their button or knob, and what stays off without one."""

from __future__ import annotations

import re
from contextlib import ExitStack
from dataclasses import replace

import numpy as np
import pytest

from executive.maps import MapObject, SemanticMap, scene_of
from executive.modules.tools.motion_grounding import GroundedMotion, Grounding
from planlang import Recovery, explain, perform
from planlang.designators import Condition, action
from planlang.failures import ActionUnresolvable, DeviceUnresponsive, HandleNotReachable, StateUnknown
from planlang.geometry import Pose
from planlang.geometry.matrices import rigid
from planlang.recoveries import step_back_and_repeat
from sim import PyBulletWorld
from sim.joints import Controls
from tests.support.leaves import room, thing, vocabulary

ON, OFF = "TurningOnPoweredDevice", "TurningOffPoweredDevice"
BACK = Pose((0.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0))
"""The x axis of furniture points to its front, which faces the robot."""
TABLE = thing("table", "KitchenTable", Pose((0.7, 0.0, 0.375)), (0.6, 1.6, 0.75))
MAKER = thing("maker", "PancakeMaker", Pose((0.6, 0.0, 0.8)) @ BACK, (0.3, 0.3, 0.1), "button")


def button(y: float = 0.0) -> MapObject:
    """A button at the front of the maker."""
    return thing("button", "PushButton", Pose((0.445, y, 0.81)) @ BACK, (0.01, 0.03, 0.03))


def test_a_device_is_turned_on_and_off_by_its_button(stack: ExitStack) -> None:
    stage = room(stack, (TABLE, MAKER, button()))
    device = stage.designator("maker")
    stage.do(ON, "maker")
    assert stage.truth.matter.is_on("maker")
    assert stage.executive.holds(Condition("switched_on", (device,)))
    before = stage.truth.steps
    stage.do(ON, "maker")
    assert stage.truth.steps <= before + 1, "what is on is left alone"
    stage.do(OFF, "maker")
    assert not stage.truth.matter.is_on("maker")
    assert not stage.executive.holds(Condition("switched_on", (device,)))


def test_a_device_without_control_has_a_button_on_top_if_it_is_low_else_at_its_front() -> None:
    oven = thing("oven", "Oven", Pose((1.5, 0.0, 0.4)), (0.6, 0.6, 0.8))
    scene = scene_of(SemanticMap(None, vocabulary(), (TABLE, thing("maker", "PancakeMaker", *_at()), oven), ()))
    low, high = scene.controls
    assert (low.device, low.body, low.normal) == ("maker", "maker", (0.0, 0.0, 1.0))
    assert (high.device, high.normal, high.point) == ("oven", (1.0, 0.0, 0.0), pytest.approx((0.3, 0.0, 0.37)))


@pytest.mark.parametrize("cls", ["TableKnife", "Knife", "Scissors", "BladeOfADevice"])
def test_what_cuts_has_no_button_unless_the_map_states_one(cls: str) -> None:
    pose, size = Pose((0.6, 0.3, 0.76)), (0.2, 0.03, 0.01)
    maker = thing("maker", "PancakeMaker", *_at())
    scene = scene_of(SemanticMap(None, vocabulary(), (TABLE, maker, thing("blade", cls, pose, size)), ()))
    assert [one.device for one in scene.controls] == ["maker"]
    electric = thing("blade", cls, pose, size, "button")
    (control,) = scene_of(SemanticMap(None, vocabulary(), (TABLE, electric, button()), ())).controls
    assert (control.device, control.body) == ("blade", "button")


def test_a_button_as_far_from_the_edge_as_the_fingers_reach_is_pushed_by_a_hand_beside_the_base(
    stack: ExitStack,
) -> None:
    wide, far = thing("table", "KitchenTable", Pose((0.9, 0.0, 0.375)), (1.0, 1.6, 0.75)), Pose((0.5, 0.0, 0.0))
    moved = tuple(replace(one, pose=far @ one.pose) for one in (MAKER, button()) if one.pose is not None)
    stage = room(stack, (wide, *moved))
    stage.do(ON, "maker")
    assert stage.truth.matter.is_on("maker")


@pytest.mark.long
def test_of_a_button_that_is_too_far_from_the_edge_is_reported_where_it_would_be_reached(stack: ExitStack) -> None:
    """Constraints of the stroke, which "contradict each other" there, tell nobody what to change."""
    wide = thing("table", "KitchenTable", Pose((1.4, 0.0, 0.375)), (2.0, 4.0, 0.75))
    far = Pose((0.8, 0.0, 0.0))
    moved = tuple(replace(one, pose=far @ one.pose) for one in (MAKER, button()) if one.pose is not None)
    stage = room(stack, (wide, *moved))
    with pytest.raises(HandleNotReachable) as caught:
        stage.do(ON, "maker")
    said = explain(caught.value)
    assert "contradict" not in said
    found = re.search(r"; moved 0\.\d\d m, to x = (\d\.\d\d)", said)
    assert found is not None, said
    assert 0.5 < float(found[1]) < 1.4, said


def test_fingers_may_touch_the_device_whose_button_they_push_but_the_palm_may_not(stack: ExitStack) -> None:
    """A palm that leans meets the front of the device beside the button before the fingertips get to it."""
    stage = room(stack, (TABLE, MAKER, button()), "panda")
    platform = stage.platform
    (arm,) = platform.scene.arms.all
    base = (0.0, 0.0, 0.0)
    tip = rigid(arm.frame.rotation(np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])), np.array([0.6, 0.0, 0.8]))
    q, good = arm.chain.solve(tip[None], arm.seeds[None])
    assert good[0], "the hand is well inside the device"
    motion = GroundedMotion((), (arm,), {}, {})
    met = {
        link
        for link, body in Grounding(platform, (), touches={"maker"}).touching(motion, q[0], base)
        if body == "maker"
    }
    met_clear = {
        link for link, body in Grounding(platform, (), touches={"maker"}).touching(motion, q[0], base, clear=True)
    }
    assert "panda_hand" in met
    assert met_clear - met >= {"panda_leftfinger", "panda_rightfinger"}


def test_a_button_that_no_map_has_is_pushed_where_the_device_would_have_it(stack: ExitStack) -> None:
    stage = room(stack, (TABLE, thing("maker", "PancakeMaker", *_at())))
    stage.do(ON, "maker")
    assert stage.truth.matter.is_on("maker")


@pytest.mark.long
def test_a_device_stays_off_whose_button_the_hand_did_not_meet(stack: ExitStack) -> None:
    bare = thing("maker", "PancakeMaker", *_at())
    stage = room(stack, (TABLE, MAKER, button()), truth=(TABLE, bare))
    with pytest.raises(HandleNotReachable, match="failed"):
        stage.do(ON, "maker")
    assert not stage.truth.matter.is_on("maker")
    assert not stage.executive.holds(Condition("switched_on", (stage.designator("maker"),)))


@pytest.mark.parametrize("kind", [ON, OFF])
@pytest.mark.parametrize("is_on", [True, False])
def test_a_device_is_looked_at_and_not_switched_by_what_the_map_says(
    stack: ExitStack, kind: str, *, is_on: bool
) -> None:
    """The map says off."""
    stage = room(stack, (TABLE, MAKER, button()))
    matter = stage.truth.matter
    stage.truth.matter = matter.switched("maker", "DeviceStateOn" if is_on else "DeviceStateOff")
    stage.do(kind, "maker")
    assert stage.truth.matter.is_on("maker") is (kind == ON)
    assert stage.executive.holds(Condition("switched_on", (stage.designator("maker"),))) is (kind == ON)


def test_a_device_with_a_dead_button_is_reported(stack: ExitStack, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Controls, "pushed", lambda *_: None)
    stage = room(stack, (TABLE, MAKER, button()))
    with pytest.raises(DeviceUnresponsive, match=r"its button was pushed 2 times, .* it is dead"):
        stage.do(ON, "maker")


def test_a_button_that_fails_once_is_pushed_once_more(stack: ExitStack) -> None:
    stage = room(stack, (TABLE, MAKER, button()), faults=("device:stays",))
    stage.do(ON, "maker")
    assert stage.truth.matter.is_on("maker")
    assert stage.platform.belief.state.matter.is_on("maker")


def test_a_dead_device_is_given_up_after_four_pushes_within_a_minute(stack: ExitStack) -> None:
    """Two from where the base stands, and two once it has stepped back and looked, as the ontology states."""
    stage = room(stack, (TABLE, MAKER, button()), faults=("device:is_dead",))
    device = stage.designator("maker")
    again = Recovery(DeviceUnresponsive, step_back_and_repeat(device), retries=1)
    with pytest.raises(DeviceUnresponsive, match="it is dead, or has no power"):
        stage.run(lambda: perform(action(ON, object_acted_on=device), recoveries=[again]))
    assert stage.truth.steps / stage.truth.rate < 75.0


def test_a_device_that_cannot_be_seen_from_the_start_is_looked_at_from_elsewhere(stack: ExitStack) -> None:
    stage = room(stack, (TABLE, MAKER, button()), start=(-1.2, 0.0, 3.14))
    stage.truth.matter = stage.truth.matter.switched("maker", "DeviceStateOn")
    stage.do(ON, "maker")
    assert stage.truth.matter.is_on("maker")
    assert abs(stage.truth.configuration().base[2] - 3.14) > 0.5


def test_a_robot_without_a_camera_pushes_no_button_whose_device_it_cannot_see(stack: ExitStack) -> None:
    stage = room(stack, (TABLE, MAKER, button()), "panda")
    with pytest.raises(StateUnknown, match=r"not known whether maker is on: .* takes a robot with a camera"):
        stage.do(ON, "maker")
    assert not stage.truth.matter.is_on("maker")


def test_a_robot_without_a_camera_that_trusts_the_map_counts_its_pushes(stack: ExitStack) -> None:
    """It starts from what the map says, off, and leaves alone what it has turned on."""
    stage = room(stack, (TABLE, MAKER, button()), "panda", trusts_map=True)
    stage.do(OFF, "maker")
    assert not stage.truth.matter.is_on("maker")
    stage.do(ON, "maker")
    stage.do(ON, "maker")
    assert stage.truth.matter.is_on("maker")
    stage.do(OFF, "maker")
    assert not stage.truth.matter.is_on("maker")


def test_a_knob_that_the_map_has_turned_has_its_device_on(stack: ExitStack) -> None:
    oven = thing("oven", "Oven", Pose((1.5, 0.0, 0.4)) @ BACK, (0.6, 0.6, 0.8), "knob")
    knob = thing("knob", "ControlKnob", Pose((1.19, 0.0, 0.7)) @ BACK, (0.025, 0.04, 0.04))
    scene = scene_of(SemanticMap(None, vocabulary(), (oven, knob), ()))
    turned = replace(scene, joints=tuple(replace(one, first=one.upper) for one in scene.joints))
    world = PyBulletWorld(turned)
    stack.callback(world.close)
    assert world.condition("oven") == "DeviceStateOn"
    world.set_joint("knob", 0.0)
    world.step()
    assert world.condition("oven") == "DeviceStateOff"


def test_a_button_that_is_seen_elsewhere_is_pushed_there(stack: ExitStack) -> None:
    stage = room(stack, (TABLE, MAKER, button()), truth=(TABLE, MAKER, button(0.12)))
    stage.do(ON, "maker")
    assert stage.truth.matter.is_on("maker")


@pytest.mark.long
@pytest.mark.pr2
def test_a_knob_is_turned_and_turned_back(stack: ExitStack) -> None:
    oven = thing("oven", "Oven", Pose((0.9, 0.0, 0.5)) @ BACK, (0.6, 0.6, 1.0), "knob")
    knob = thing("knob", "ControlKnob", Pose((0.5875, 0.0, 0.9)) @ BACK, (0.025, 0.04, 0.04))
    stage = room(stack, (oven, knob), "pr2")
    (control,) = stage.truth.scene.controls
    assert (control.body, control.turns) == ("knob", True)
    stage.do(ON, "oven")
    assert stage.truth.joint("knob") > 0.7
    assert stage.truth.matter.is_on("oven")
    stage.do(OFF, "oven")
    assert stage.truth.joint("knob") < 0.1
    assert not stage.truth.matter.is_on("oven")


def test_what_is_no_device_cannot_be_turned_on(stack: ExitStack) -> None:
    stage = room(stack, (TABLE, MAKER, button()))
    with pytest.raises(ActionUnresolvable, match="no device is named"):
        stage.do(ON, "table")


def _at() -> tuple[Pose, tuple[float, float, float]]:
    pose = MAKER.pose
    assert pose is not None
    return pose, (0.3, 0.3, 0.1)
