"""What flows out of a held vessel is believed as it is in the world, whatever turns the vessel over."""

from __future__ import annotations

import math
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from executive.modules.flowing import Flow
from executive.modules.phases import Phase
from executive.modules.tools.motion_grounding import GroundedMotion
from executive.modules.tools.pouring import Pouring
from executive.motion import MotionError
from planlang import sleep
from planlang.designators import Object, action, an_object
from planlang.failures import AmountNotPoured, ObjectLost
from planlang.geometry import Array, Pose
from planlang.protocols import Configuration, Trajectory
from planlang.state.matter import Portion
from sim import Body
from tests.executive.conftest import BOTTLE, CABINET, PLACE, MakeStage, Stage, hold_bottle

ARM = "left"
WATER = Portion("Water", 400.0, ("water",))
JUG = replace(BOTTLE, name="jug", content=(WATER,), capacity=500.0, largest_tilt=math.radians(15))
LYING = Pose((1.5, 0.0, 0.8325), (0.0, math.sqrt(0.5), 0.0, math.sqrt(0.5)))


@given(st.lists(st.booleans(), min_size=1, max_size=40), st.integers(0, 70))
def test_a_vessel_flows_while_it_is_turned_over_and_after_the_motion_if_it_ends_so(
    turned: list[bool], steps: int
) -> None:
    flow = Flow("cup1", "right", np.array(turned), np.zeros((len(turned), 3)))
    states = turned + [turned[-1]] * 70
    assert flow.steps(steps) == sum(states[:steps])


def turning(stage: Stage) -> Trajectory:
    """A motion of one joint that turns the jug over."""
    arm = next(arm for arm in stage.platform.scene.arms.all if arm.name == ARM)
    start, up = stage.platform.arm_joints(arm), stage.belief.held["jug"].offset.rotation[:, 2]
    for joint in reversed(range(len(start))):
        for goal in (arm.lower[joint], arm.upper[joint]):
            end = np.where(np.arange(len(start)) == joint, np.clip(goal, -3.0, 3.0), start)
            if (arm.chain.fk(end)[0, :3, :3] @ up)[2] < -0.1:
                with suppress(MotionError):
                    return stage.platform.arms.path(arm, end)
    raise AssertionError("no joint turns the jug over")


def holding_jug(make_stage: MakeStage) -> tuple[Stage, Trajectory]:
    stage = make_stage(CABINET, JUG)
    hold_bottle(stage, ARM, name="jug")
    return stage, turning(stage)


def test_what_a_hand_spills_when_it_turns_a_vessel_over_and_back_is_believed_to_be_gone(make_stage: MakeStage) -> None:
    stage, over = holding_jug(make_stage)

    async def plan() -> None:
        await stage.platform.follow(ARM, over)
        await sleep(1.0)
        await stage.platform.follow(ARM, replace(over, positions=over.positions[::-1]))

    stage.run(plan)
    left = stage.truth.matter.total("jug")
    assert left < 375.0
    assert stage.belief.state.matter.total("jug") == pytest.approx(left, abs=2.0)
    assert stage.platform.flowing.arrived("jug", None) == pytest.approx(400.0 - left, abs=2.0)
    assert stage.platform.flowing.arrived("jug", "cabinet") == 0.0


def test_what_has_flowed_before_a_vessel_is_lost_is_believed_to_be_gone(
    make_stage: MakeStage, monkeypatch: pytest.MonkeyPatch
) -> None:
    stage, over = holding_jug(make_stage)
    step = stage.truth.step

    def stepped() -> None:
        if stage.truth.attached() and stage.truth.matter.total("jug") < 390.0:
            stage.truth.release("jug")
        step()

    monkeypatch.setattr(stage.truth, "step", stepped)

    async def plan() -> None:
        await stage.platform.follow(ARM, over)
        await sleep(5.0)
        stage.platform.check_hold([ARM])

    with pytest.raises(ObjectLost):
        stage.run(plan)
    left = stage.truth.matter.total("jug")
    assert 380.0 < left < 390.0
    assert stage.belief.state.matter.total("jug") == pytest.approx(left, abs=2.0)


@pytest.mark.parametrize(
    ("jug", "limit"),
    [(JUG, 15.0), (replace(JUG, pose=LYING), 90.0), (replace(JUG, pose=LYING, content=()), None)],
    ids=["standing", "lying_full", "lying_empty"],
)
def test_a_vessel_that_lay_is_not_tipped_while_it_has_contents(
    make_stage: MakeStage, jug: Body, limit: float | None
) -> None:
    stage = make_stage(CABINET, jug)
    hold_bottle(stage, ARM, name="jug")
    held = stage.platform.scene.arms.held(ARM)
    assert held is not None
    assert held.largest_tilt == (None if limit is None else pytest.approx(math.radians(limit)))


def poured(
    stage: Stage, pouring: Pouring, over: Trajectory, things: dict[Object, Array]
) -> Callable[[], Awaitable[None]]:
    """The two motions of pouring 100 ml, over and back."""
    arm = next(arm for arm in stage.platform.scene.arms.all if arm.name == ARM)
    motion, back = GroundedMotion((), (arm,), {}, things), replace(over, positions=over.positions[::-1])

    async def pour() -> None:
        for name, trajectory in (("Tilt", over), ("TiltBack", back)):
            async with pouring.during(action(name, amount=100.0), motion, trajectory):
                await stage.platform.follow(ARM, trajectory)

    return pour


def test_after_the_vessel_was_lost_only_the_rest_is_poured(
    make_stage: MakeStage, monkeypatch: pytest.MonkeyPatch
) -> None:
    stage, over = holding_jug(make_stage)
    pouring, step, lost = Pouring(stage.platform, Phase()), stage.truth.step, list[float]()

    def stepped() -> None:
        if not lost and stage.truth.matter.total("jug") < 360.0:
            lost.append(stage.truth.matter.total("jug"))
            stage.truth.release("jug")
        step()

    monkeypatch.setattr(stage.truth, "step", stepped)

    async def plan() -> None:
        pour = poured(stage, pouring, over, {})
        with pytest.raises(ObjectLost):
            await pour()
        assert not pouring.is_done(action("Tilt"))
        upright = dict(zip(over.names, map(float, over.positions[0]), strict=True))
        stage.truth.set_configuration(Configuration((0.0, 0.0, 0.0), upright))
        hold_bottle(stage, ARM, name="jug")
        await pour()

    stage.run(plan)
    assert lost
    assert stage.truth.matter.total("jug") == pytest.approx(300.0, abs=5.0)


def test_what_lands_beside_the_thing_to_pour_onto_is_not_poured(make_stage: MakeStage) -> None:
    stage, over = holding_jug(make_stage)
    cabinet = an_object("Cabinet-PieceOfFurniture", PLACE + "cabinet")
    pour = poured(stage, Pouring(stage.platform, Phase()), over, {cabinet: CABINET.pose.matrix()})
    with pytest.raises(AmountNotPoured) as caught:
        stage.run(pour)
    assert (caught.value.asked, caught.value.poured) == (100.0, 0.0)
    assert "0 ml were poured: out of jug into cabinet" in caught.value.message
