"""Reaching, closing, opening: with a bottle in between, beside, and with nothing."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

from executive.belief.scene_collisions import BasePose
from executive.modules.arm.reaching import FEW, FREER
from executive.modules.arm_paths import ITERATIONS
from executive.motion import NoPath
from executive.robots.arms import ArmModel
from planlang import Recovery, look_and_repeat, par, perform, pursue, sleep, timeout, with_failure_handling
from planlang.designators import Action, Location, a_device, a_location, a_posture, action, an_object, holding
from planlang.failures import (
    ActionUnresolvable,
    GraspMissed,
    GripperGoalNotReached,
    ManipulationFailure,
    ManipulationGoalInCollision,
    ManipulationPoseUnreachable,
    ObjectNotFound,
    Timeout,
)
from planlang.geometry import Array, Pose
from planlang.protocols import Detection, Trajectory
from sim import Body, PyBulletWorld
from sim.truth import at_rest_on, held_by
from tests.executive.conftest import (
    BED,
    BOTTLE,
    CABINET,
    THE_BOTTLE,
    MakeStage,
    Stage,
    hold_bottle,
    stand,
)
from tests.support.detections import recognise
from tests.support.examples import some

RIGHT, LEFT = a_device("RightGripper"), a_device("LeftGripper")
BEFORE, AROUND = a_location(in_front_of=THE_BOTTLE), a_location(in_center_of=THE_BOTTLE)
OPEN, CLOSE = action("OpeningAGripper"), action("ClosingAGripper", object_acted_on=THE_BOTTLE)
LET_GO = action("OpeningAGripper", object_acted_on=THE_BOTTLE)


def reach(location: Location, **more: object) -> Action:
    """The action of reaching somewhere."""
    return action("Reaching", to_location=location, **more)


def tips(stage: Stage) -> list[Pose]:
    """Return where the grip points of the hands are."""
    return [stage.truth.link_pose(f"grippoint_{side}") for side in ("left", "right")]


def do(stage: Stage, *actions: Action) -> None:
    """Perform actions one after another."""

    async def plan() -> None:
        for one in actions:
            await perform(one)

    stage.run(plan)


@pytest.fixture(scope="module")
def base_before_bottle(furnish: MakeStage) -> BasePose:
    """Where the robot can grasp the bottle."""
    stage = furnish(CABINET, BOTTLE, BED)
    return next(stage.resolver.bases(a_location(in_reach_of=(THE_BOTTLE, BEFORE, AROUND)))).base


@pytest.fixture
def before_bottle(base_before_bottle: BasePose, make_stage: MakeStage) -> Stage:
    """The robot stands where it can grasp the bottle; nobody lies in the bed."""
    stage = make_stage(CABINET, BOTTLE, BED)
    stand(stage, base_before_bottle)
    return stage


def test_a_bottle_is_grasped_lifted_and_carried(before_bottle: Stage) -> None:
    stage = before_bottle
    do(stage, reach(BEFORE), OPEN, reach(AROUND), CLOSE)
    assert held_by(stage.truth, "bottle") == "robot"
    assert stage.executive.holds(holding(THE_BOTTLE))
    assert stage.executive.held() == ("bottle",)
    do(stage, reach(BEFORE), reach(a_posture("carrying")))
    assert stage.truth.contacts() == ()
    assert stage.planning.pose("bottle").distance(stage.truth.pose("bottle")) < 1e-6


@pytest.mark.parametrize("apart", some([0.025, 0.03]))
def test_a_bottle_between_neighbours_a_fingers_breadth_away_is_grasped_and_they_stay(
    apart: float, make_stage: MakeStage
) -> None:
    x, y, z = BOTTLE.pose.position
    step = BOTTLE.size[0] + apart
    spots = {"left": (x, y + step, z), "right": (x, y - step, z), "behind": (x + step, y, z)}
    others = [replace(BOTTLE, name=name, iri=None, pose=Pose(spot)) for name, spot in spots.items()]
    stage = make_stage(CABINET, BOTTLE, *others)
    stand(stage, next(stage.resolver.bases(a_location(in_reach_of=(THE_BOTTLE, BEFORE, AROUND)))).base)
    do(stage, reach(BEFORE), OPEN, reach(AROUND), CLOSE, reach(BEFORE))
    assert held_by(stage.truth, "bottle") == "robot"
    for name, spot in spots.items():
        assert stage.truth.pose(name).position == pytest.approx(spot, abs=1e-6)


def test_a_hand_holds_what_is_there_while_the_robot_believes_what_it_has_seen(make_stage: MakeStage) -> None:
    other = replace(BOTTLE, name="other", iri="", pose=Pose((1.5, 0.3, 0.9)))
    stage = make_stage(CABINET, BOTTLE, other)
    stand(stage, next(stage.resolver.bases(a_location(in_reach_of=(THE_BOTTLE, BEFORE, AROUND)))).base)
    do(stage, reach(BEFORE), OPEN)
    stage.truth.set_pose("bottle", other.pose)
    stage.truth.set_pose("other", BOTTLE.pose)
    do(stage, reach(AROUND), CLOSE, reach(BEFORE))
    assert stage.executive.held() == ("bottle",)
    assert (held_by(stage.truth, "other"), held_by(stage.truth, "bottle")) == ("robot", None)
    do(stage, LET_GO)
    assert stage.executive.held() == ()
    assert at_rest_on(stage.truth, "other") == "cabinet"


def test_a_thing_stands_for_where_it_is_grasped(before_bottle: Stage) -> None:
    do(before_bottle, reach(BEFORE), OPEN, action("Reaching", to_location=THE_BOTTLE), CLOSE)
    assert held_by(before_bottle.truth, "bottle") == "robot"


def test_the_lift_follows_where_the_bottle_was_not_where_it_is(before_bottle: Stage) -> None:
    stage = before_bottle
    do(stage, reach(BEFORE), OPEN, reach(AROUND), CLOSE)
    assert stage.belief.reference_pose("bottle") == BOTTLE.pose
    do(stage, reach(BEFORE))
    assert stage.belief.reference_pose("bottle") == BOTTLE.pose
    lifted = np.array(stage.truth.pose("bottle").position) - np.array(BOTTLE.pose.position)
    assert 0.02 < lifted[2] < 0.1
    assert np.hypot(*lifted[:2]) == pytest.approx(0.08, abs=5e-3), "back by as much as the approach was long"


def test_a_thing_is_looked_at_before_it_is_reached_for(make_stage: MakeStage) -> None:
    moved = replace(BOTTLE, pose=Pose((1.5, 0.04, 0.9)))
    stage = make_stage(CABINET, BOTTLE, truth=[CABINET, moved])
    stand(stage, next(stage.resolver.bases(a_location(in_reach_of=(THE_BOTTLE, BEFORE, AROUND)))).base)
    do(stage, reach(BEFORE), OPEN, reach(AROUND), CLOSE)
    assert stage.belief.held["bottle"].before == moved.pose
    assert held_by(stage.truth, "bottle") == "robot"


def test_reaching_for_a_thing_that_is_gone_ends_with_not_finding_it(make_stage: MakeStage) -> None:
    gone = replace(BOTTLE, pose=Pose((-1.0, 4.0, 0.1)))
    stage = make_stage(CABINET, BOTTLE, truth=[CABINET, gone], start=(0.83, 0.0, -0.35))
    with pytest.raises(ObjectNotFound):
        do(stage, reach(BEFORE))


def test_closing_on_nothing_misses_and_holds_nothing(before_bottle: Stage) -> None:
    stage = before_bottle
    with pytest.raises(GraspMissed) as caught:
        do(stage, OPEN, CLOSE)
    assert caught.value.what == "bottle"
    assert caught.value.arm in ("right", "left")
    assert "closed on nothing" in str(caught.value)
    assert stage.executive.held() == ()
    assert held_by(stage.truth, "bottle") is None
    assert at_rest_on(stage.truth, "bottle") == "cabinet"


@pytest.mark.long
def test_a_missed_grasp_is_cured_by_looking_and_grasping_again(before_bottle: Stage) -> None:
    """The bottle is moved by somebody after it was seen, across the fingers; the recovery of grasping finds it."""
    stage, tries, moved = before_bottle, [], list[Pose]()

    async def grasp() -> None:
        tries.append(stage.belief.pose("bottle"))
        for one in (reach(BEFORE), OPEN):
            await perform(one)
        if len(tries) == 1:
            x, y, z = BOTTLE.pose.position
            _, (hand_x, hand_y, _) = min((BOTTLE.pose.distance(tip), tip.position) for tip in tips(stage))
            across = np.array([hand_y - y, x - hand_x])
            x, y = map(float, (x, y) + 0.15 * across / np.linalg.norm(across))
            moved.append(Pose((x, y, z)))
            stage.truth.set_pose("bottle", moved[0])
        for one in (reach(AROUND), CLOSE):
            await perform(one)

    stage.run(
        lambda: with_failure_handling(
            grasp, Recovery((GraspMissed, ManipulationFailure), look_and_repeat(THE_BOTTLE), retries=2)
        )
    )
    assert tries == [BOTTLE.pose, *moved]
    assert held_by(stage.truth, "bottle") == "robot"


@pytest.mark.parametrize("arm", ["right", "left"])
def test_opening_over_a_bed_lets_the_bottle_come_to_rest_on_it(arm: str, make_stage: MakeStage) -> None:
    stage = make_stage(CABINET, BOTTLE, BED)
    hold_bottle(stage, arm)
    stand(
        stage,
        next(stage.resolver.bases(a_location(in_reach_of=a_location(above=an_object("Bed-PieceOfFurniture"))))).base,
    )
    do(stage, reach(a_location(above=an_object("Bed-PieceOfFurniture"))), LET_GO)
    assert at_rest_on(stage.truth, "bottle") == "bed"
    assert stage.executive.held() == ()
    assert stage.belief.pose("bottle").distance(stage.truth.pose("bottle")) < 1e-3
    top = BED.pose.position[2] + BED.size[2] / 2
    assert stage.truth.pose("bottle").position[2] == pytest.approx(top + BOTTLE.size[2] / 2, abs=1e-3)


def test_the_action_of_opening_ends_only_when_the_bottle_rests(make_stage: MakeStage) -> None:
    stage = make_stage(CABINET, BOTTLE, BED)
    hold_bottle(stage)
    falling = []

    async def plan() -> None:
        await perform(LET_GO)
        falling.append(stage.truth.falling("bottle"))

    stage.run(plan)
    assert falling == [False]
    assert stage.truth.pose("bottle").position[2] == pytest.approx(0.1, abs=1e-3), "it fell to the floor"


def test_opening_with_nothing_in_the_hand_is_fine(before_bottle: Stage) -> None:
    do(before_bottle, OPEN)
    gripper = before_bottle.platform.robot.arms[0].gripper
    assert gripper is not None
    joints = before_bottle.truth.configuration().joints
    assert {name: joints[name] for name in gripper.joints} == pytest.approx(dict(gripper.opened))


def test_a_device_says_which_gripper_closes(before_bottle: Stage) -> None:
    with pytest.raises(GraspMissed) as caught:
        do(before_bottle, action("ClosingAGripper", device_used=LEFT))
    assert caught.value.arm == "left"


def test_what_is_out_of_reach_cannot_be_reached(make_stage: MakeStage) -> None:
    far = replace(BOTTLE, pose=Pose((2.4, 0.0, 0.9)))
    stage = make_stage(replace(CABINET, pose=Pose((2.5, 0.0, 0.4))), far)
    with pytest.raises(ManipulationPoseUnreachable) as caught:
        do(stage, reach(BEFORE, device_used=RIGHT))
    assert caught.value.arm == "right"
    assert "in_front_of(bottle)" in str(caught.value)


def test_what_is_in_the_way_of_the_hand_is_named(make_stage: MakeStage) -> None:
    lid = [
        Body(name, Pose(position), size, type="Cupboard")
        for name, position, size in (
            ("left side", (1.5, 0.055, 0.95), (0.2, 0.02, 0.3)),
            ("right side", (1.5, -0.055, 0.95), (0.2, 0.02, 0.3)),
        )
    ]
    stage = make_stage(CABINET, BOTTLE, *lid, start=(0.827, 0.0, -0.35))
    with pytest.raises(ManipulationGoalInCollision) as caught:
        do(stage, reach(BEFORE, device_used=LEFT))
    assert caught.value.blocked_by in ("left side", "right side")


def test_an_arm_that_meets_what_was_not_believed_to_be_there_stops_and_names_it(make_stage: MakeStage) -> None:
    board = Body("board", Pose((1.38, 0.0, 1.0)), (0.02, 0.5, 0.3), type="Cupboard", movable=True)
    away = replace(board, pose=Pose((1.38, 1.2, 1.0)))
    stage = make_stage(CABINET, BOTTLE, away, truth=[CABINET, BOTTLE, board], start=(0.8269, 0.0, -0.35))
    assert stage.truth.contacts() == ()
    recognise(stage.belief, "bottle", BOTTLE.pose, 1.0)
    with pytest.raises(ManipulationGoalInCollision) as caught:
        do(stage, reach(BEFORE))
    assert caught.value.blocked_by == "board"
    assert stage.belief.pose("board") == board.pose, "the robot knows now where the board is"
    assert stage.truth.contacts() == ()


def test_reaching_without_a_location_is_refused(ward: Stage) -> None:
    with pytest.raises(ActionUnresolvable, match="to_location"):
        do(ward, action("Reaching"))


@pytest.mark.parametrize("name", ["reset", "carrying", "carryingPose1"])
def test_a_posture_is_taken_by_its_name_or_one_that_contains_it(name: str, make_stage: MakeStage) -> None:
    stage = make_stage()
    do(stage, reach(a_posture("reset"), device_used=LEFT), reach(a_posture(name), device_used=RIGHT))
    wanted = stage.platform.robot.postures["reset" if name == "reset" else "carrying"]
    joints = stage.truth.configuration().joints
    for joint in stage.platform.robot.arm("right").joints:
        assert joints[joint] == pytest.approx(wanted[joint], abs=1e-6)


def test_evaporating_a_reach_stops_the_arm_where_it_is(make_stage: MakeStage) -> None:
    stage = make_stage()
    arm = stage.platform.scene.arms.all[0]

    async def plan() -> None:
        await pursue(lambda: perform(reach(a_posture("reset"), device_used=RIGHT)), lambda: sleep(0.6))

    before = stage.platform.arm_joints(arm)
    stage.run(plan)
    assert stage.truth.motion("right").state == "halted"
    after = stage.platform.arm_joints(arm)
    assert not np.allclose(before, after), "it had begun to move"
    for _ in range(10):
        stage.truth.step()
    assert np.array_equal(stage.platform.arm_joints(arm), after), "it has moved on after it was told to stop"


def test_a_reach_that_takes_too_long_is_stopped_by_its_timeout(make_stage: MakeStage) -> None:
    stage = make_stage()
    with pytest.raises(Timeout):
        stage.run(lambda: timeout(0.5, lambda: perform(reach(a_posture("reset"), device_used=RIGHT))))
    assert stage.truth.motion("right").state == "halted"


def test_evaporating_a_drive_stops_the_base(make_stage: MakeStage) -> None:
    stage = make_stage()
    motion = action("Translation-LocationChange", x=3.0, y=0.0, yaw=0.0)
    with pytest.raises(Timeout):
        stage.run(lambda: timeout(2.0, lambda: perform(motion)))
    assert stage.truth.motion("base").state == "halted"
    assert 0.1 < stage.truth.configuration().base[0] < 2.0


def test_two_arms_reach_one_after_the_other_because_they_share_the_torso(make_stage: MakeStage) -> None:
    stage = make_stage()
    moving = []

    async def plan() -> None:
        await par(
            lambda: perform(reach(a_posture("reset"), device_used=RIGHT)),
            lambda: perform(reach(a_posture("reset"), device_used=LEFT)),
        )

    step = stage.truth.step

    def watched() -> None:
        step()
        moving.append([stage.truth.motion(arm).state for arm in ("right", "left")].count("moving"))

    stage.truth.step = watched  # type: ignore[method-assign]
    stage.run(plan)
    assert max(moving) == 1


def test_hand_poses_after_one_without_a_path_are_searched_for_no_longer_in_all(
    before_bottle: Stage, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[int] = []

    def path(arm: ArmModel, goal: Array, touches: str | None, iterations: int, others: object, **still: object) -> None:
        asked.append(iterations)
        raise NoPath(goal.tolist(), goal.tolist(), {})

    monkeypatch.setattr(before_bottle.platform.arms, "path", path)
    with pytest.raises(ManipulationPoseUnreachable):
        do(before_bottle, reach(BEFORE, device_used=RIGHT))
    assert ITERATIONS < sum(asked) <= 2 * ITERATIONS + len(FREER) * FEW


def test_an_arm_without_a_path_close_to_furniture_unfolds_farther_back_and_comes_again(
    before_bottle: Stage, monkeypatch: pytest.MonkeyPatch
) -> None:
    stage, here, unfolded = before_bottle, before_bottle.platform.base(), list[float]()
    plan = stage.platform.arms.path

    def path(arm: ArmModel, goal: Array, *others: Any, **still: Any) -> Trajectory:
        away = math.dist(stage.platform.base()[:2], here[:2])
        if away < 0.1 and not stage.platform.arms.is_at(arm, goal):
            raise NoPath(goal.tolist(), goal.tolist(), {})
        unfolded.append(away)
        return plan(arm, goal, *others, **still)

    monkeypatch.setattr(stage.platform.arms, "path", path)
    do(stage, reach(BEFORE), OPEN, reach(AROUND), CLOSE)
    assert held_by(stage.truth, "bottle") == "robot"
    assert unfolded[0] == pytest.approx(max(FREER), abs=0.01)
    assert stage.platform.base() == pytest.approx(here, abs=1e-3)


@pytest.mark.parametrize("share", [0.0, 0.3], ids=["closed", "too narrow"])
def test_a_hand_comes_before_a_wide_thing_as_open_as_the_grasp_was_checked(share: float, make_stage: MakeStage) -> None:
    wide = replace(BOTTLE, name="cup", size=(0.08, 0.08, 0.1), pose=Pose((1.5, 0.0, 0.85)), type="Cup", iri=None)
    stage = make_stage(CABINET, wide)
    cup = stage.platform.scene.bodies.designator("cup")
    solution = next(stage.resolver.bases(a_location(in_reach_of=cup)))
    stand(stage, solution.base)
    stage.executive.move_to(solution)  # the arm by which the place was found is the plan's choice
    arm = next(arm for arm in stage.platform.scene.arms.all if arm.name == solution.detail["arm"])
    fingers = arm.openings.fingers[round(share * (len(arm.openings.fingers) - 1))]

    async def approach() -> None:
        await stage.platform.hands.move(arm, closed=False, fingers=fingers)
        await perform(reach(a_location(in_front_of=cup)))

    stage.run(approach)
    _, _, begun = stage.platform.arms.begun[arm.name]
    now = dict(zip(arm.openings.joints, stage.platform.joints(arm.openings.joints), strict=True))
    assert arm.openings.share(now) == pytest.approx(arm.openings.share(dict(begun.plan.fingers)), abs=0.01)
    assert arm.openings.share(now) > share, "the fingers have opened"


@pytest.mark.parametrize("aside", some([0.02, 0.04], every=2))
def test_without_a_camera_a_thing_is_grasped_where_the_hand_has_felt_it(aside: float, make_blind: MakeStage) -> None:
    x, y, z = BOTTLE.pose.position
    stage = make_blind(CABINET, BOTTLE, truth=(CABINET, replace(BOTTLE, pose=Pose((x, y + aside, z)))))
    stage.belief.trusts_map = True
    stand(stage, next(stage.resolver.bases(a_location(in_reach_of=(THE_BOTTLE, BEFORE, AROUND)))).base)

    async def grasp() -> None:
        for one in (reach(BEFORE), OPEN, reach(AROUND), CLOSE):
            await perform(one)

    stage.run(partial(with_failure_handling, grasp, Recovery(GraspMissed, look_and_repeat(THE_BOTTLE), retries=2)))
    assert held_by(stage.truth, "bottle") == "robot"


@pytest.mark.parametrize("part", [0.0, 0.3], ids=["at all", "far enough"])
def test_a_gripper_that_does_not_close_holds_nothing(
    part: float, before_bottle: Stage, monkeypatch: pytest.MonkeyPatch
) -> None:
    stage, start = before_bottle, PyBulletWorld.start
    do(stage, reach(BEFORE), OPEN, reach(AROUND))

    def jammed(world: PyBulletWorld, group: str, trajectory: Trajectory, **more: Any) -> None:
        rows = trajectory.positions
        start(world, group, replace(trajectory, positions=rows[: 1 + int(part * len(rows))]), **more)

    monkeypatch.setattr(PyBulletWorld, "start", jammed)
    with pytest.raises(GripperGoalNotReached):
        do(stage, CLOSE)
    assert stage.executive.held() == ()
    assert stage.truth.attached() == {}


@pytest.mark.long
@pytest.mark.parametrize("wrong", [(0.0, 0.025), (0.0, -0.02), (-0.03, 0.0)])
def test_what_a_camera_shows_inside_a_hand_is_believed_beside_it(
    wrong: tuple[float, float], before_bottle: Stage, monkeypatch: pytest.MonkeyPatch
) -> None:
    stage, detect = before_bottle, PyBulletWorld.detect

    def inexact(world: PyBulletWorld, link: str) -> tuple[Detection, ...]:
        shift = Pose((*wrong, 0.0))
        return tuple(
            replace(one, pose=shift @ one.pose) if one.type == BOTTLE.type else one for one in detect(world, link)
        )

    do(stage, reach(BEFORE), OPEN, reach(AROUND))
    monkeypatch.setattr(PyBulletWorld, "detect", inexact)
    do(stage, action("LookingForSomething", object_acted_on=THE_BOTTLE))
    assert stage.belief.pose("bottle").position != pytest.approx(BOTTLE.pose.position, abs=0.003), "it was seen"
    assert not stage.planning.contacts(stage.truth.configuration())
    do(stage, reach(a_posture("carrying")))
