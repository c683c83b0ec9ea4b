"""Things that have to stay upright are carried upright, whichever way a hand has it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from executive.locations.reachability import GraspClass
from executive.modules.arm_paths import SHARE
from executive.motion import MotionError
from executive.motion.kinematics import Chain
from executive.robots import CARRYING
from planlang import perform
from planlang.designators import a_posture, action
from planlang.failures import ManipulationPoseUnreachable
from planlang.geometry import Pose
from planlang.protocols import Configuration
from tests.executive.conftest import BOTTLE, MakeStage, Stage, hold_bottle
from tests.support.examples import some

LIMIT = math.radians(15.0)
FULL = replace(BOTTLE, largest_tilt=LIMIT)
CARRY = action("Reaching", to_location=a_posture(CARRYING))


def hold(stage: Stage, heading: float, roll: int, grasp: GraspClass, place: tuple[float, ...]) -> bool:
    """Give the upright bottle to a hand in some pose; return False if the arm does not get there by itself."""
    arm = next(arm for arm in stage.platform.scene.arms.all if arm.name == "right")
    target = np.eye(4)
    target[:3, :3] = grasp.rotations([heading], [roll], arm.frame)[0]
    target[:3, 3] = place
    q, good = arm.chain.solve(target[None], arm.seeds[None])
    stage.truth.set_configuration(Configuration((0.0, 0.0, 0.0), dict(zip(arm.joints, q[0].tolist(), strict=True))))
    stage.platform.observe()
    if not good[0] or stage.truth.contacts():
        return False
    hold_bottle(stage)
    return not stage.truth.contacts()


@pytest.fixture
def room(make_stage: MakeStage) -> Stage:
    """The robot in an empty room, with a full bottle."""
    return make_stage(FULL)


@pytest.mark.parametrize("seed", some(range(6), 6))
def test_each_way_to_the_carrying_posture_keeps_the_bottle_upright(room: Stage, seed: int) -> None:
    rng = np.random.default_rng(seed)
    while not hold(
        room,
        rng.uniform(-1.5, 1.5),
        int(rng.choice([1, -1])),
        [GraspClass.SIDE, GraspClass.TILTED][rng.integers(2)],
        tuple(rng.uniform((0.4, -0.4, 0.7), (0.6, 0.1, 1.1))),
    ):
        if "bottle" in room.truth.attached():
            room.truth.release("bottle")
            room.belief.released("bottle", room.truth.pose("bottle"))
    arm = next(arm for arm in room.platform.scene.arms.all if arm.name == "right")
    held = room.platform.scene.arms.held("right")
    assert held is not None
    chain = arm.chain
    for goal in room.platform.arms.postures(arm, CARRYING):
        assert chain.fk(goal)[0, 2, :3] @ held.up == pytest.approx(1.0, abs=1e-5)
        try:
            rows = room.platform.arms.path(arm, goal).positions
        except MotionError:
            continue
        tilts = np.arccos(np.clip(chain.fk(rows)[:, 2, :3] @ held.up, -1, 1))
        assert tilts.max() <= SHARE * LIMIT + 1e-3


@pytest.mark.parametrize("roll", [1, -1])
def test_a_bottle_in_a_hand_of_either_roll_is_brought_to_the_carrying_posture(room: Stage, roll: int) -> None:
    assert hold(room, 0.4, roll, GraspClass.SIDE, (0.45, -0.25, 0.97))
    room.run(lambda: perform(CARRY))
    assert room.truth.pose("bottle").rotation[2, 2] > math.cos(math.radians(1.0))
    assert not room.platform.arms.untucked()


def test_postures_that_were_found_once_are_kept(room: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    assert hold(room, 0.4, 1, GraspClass.SIDE, (0.45, -0.25, 0.97))
    arm = next(arm for arm in room.platform.scene.arms.all if arm.name == "right")
    found = room.platform.arms.postures(arm, CARRYING)
    monkeypatch.setattr(Chain, "solve", lambda *_: pytest.fail("solved again"))
    assert np.array_equal(room.platform.arms.postures(arm, CARRYING), found)


def test_a_bottle_that_lay_when_it_was_grasped_may_be_turned(room: Stage) -> None:
    hold_bottle(room)
    grip = room.belief.held["bottle"]
    lying = replace(grip, before=Pose((0.0, 0.0, 1.0), (0.0, math.sqrt(0.5), 0.0, math.sqrt(0.5))))
    room.belief.state = replace(room.belief.state, held={"bottle": lying})
    held = room.platform.scene.arms.held("right")
    assert held is not None
    assert held.largest_tilt is None


def test_where_nothing_keeps_it_upright_the_failure_says_so(room: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    hold_bottle(room)
    monkeypatch.setattr("executive.modules.platform.upright_postures", lambda *_: [])
    with pytest.raises(ManipulationPoseUnreachable, match="upright"):
        room.run(lambda: perform(CARRY))
