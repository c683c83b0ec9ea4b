"""Straight lines of the tip, the camera's gaze, and what a refused motion says."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from executive.motion import Gaze, GoalInCollision, MotionError, NoPath, StartInCollision, time_curve
from executive.motion.kinematics import Chain
from executive.motion.trajectories import LARGEST_STRAY, cartesian_path, keeps_line
from executive.robots import bind_robot
from executive.robots.arms import gaze_of
from planlang.geometry import Array, Pose
from planlang.protocols import Configuration, Trajectory
from sim import Body, PlanningWorld, Scene
from tests.executive.conftest import MakeStage, stand
from tests.support.examples import examples


@pytest.fixture(scope="module")
def panda_ik(chain_of: Callable[[str], Chain]) -> Chain:
    """Inverse kinematics of the Panda."""
    return chain_of("panda")


READY = np.array([0.0, -0.6, 0.0, -2.2, 0.0, 1.6, 0.8])


@pytest.mark.parametrize("turn", [0.0, 1e-7, 0.4, -1.9, -3.1, -np.pi + 1e-4, -np.pi + 1e-6])
def test_tip_moves_on_a_straight_line_and_turns_evenly(panda_ik: Chain, turn: float) -> None:
    chain = panda_ik
    start = chain.fk(READY)[0]
    goal = start.copy()
    goal[:3, 3] += 0.1, 0.05, -0.12
    goal[:3, :3] = goal[:3, :3] @ np.array(
        [[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]]
    )
    line = cartesian_path(panda_ik, READY, start, goal, lambda q: True, steps=10)
    assert line.waypoints is not None
    assert line.waypoints.shape == (11, 7)
    poses = chain.fk(line.waypoints)
    share = np.linspace(0, 1, 11)[:, None]
    np.testing.assert_allclose(poses[:, :3, 3], start[:3, 3] + share * (goal[:3, 3] - start[:3, 3]), atol=1.1e-4)
    turned = np.arccos(np.clip((np.trace(start[:3, :3].T @ poses[:, :3, :3], axis1=1, axis2=2) - 1) / 2, -1, 1))
    np.testing.assert_allclose(turned, share[:, 0] * abs(turn), atol=3e-3)


@pytest.mark.parametrize(
    ("move", "is_free", "said"),
    [
        ((1.0, 0.0, 0.0), lambda q: True, "reach step 4 of 9"),
        ((0.1, 0.0, 0.0), lambda q: False, "in collision at step 1 of 9"),
    ],
)
def test_line_that_breaks_says_why(
    panda_ik: Chain, move: tuple[float, float, float], is_free: Callable[[Array], bool], said: str
) -> None:
    start = panda_ik.fk(READY)[0]
    goal = start.copy()
    goal[:3, 3] += move
    line = cartesian_path(panda_ik, READY, start, goal, is_free, largest_step=7.0)
    assert line.waypoints is None
    assert said in line.reason


def test_jump_of_a_joint_breaks_the_line(panda_ik: Chain) -> None:
    start = panda_ik.fk(READY)[0]
    goal = start.copy()
    goal[:3, 3] += 0.0, 0.3, 0.0
    line = cartesian_path(panda_ik, READY, start, goal, lambda q: True, steps=2, largest_step=0.05)
    assert line.waypoints is None
    assert "would jump by" in line.reason


@pytest.mark.parametrize("steps", [1, 2, 3])
def test_steps_are_halved_until_the_tip_keeps_its_line_between_them(panda_ik: Chain, steps: int) -> None:
    chain = panda_ik
    start = chain.fk(READY)[0]
    goal = start.copy()
    goal[:3, 3] += 0.1, 0.25, -0.1
    line = cartesian_path(panda_ik, READY, start, goal, lambda q: True, steps=steps, largest_step=7.0)
    assert line.waypoints is not None
    assert len(line.waypoints) > steps + 1
    shares = np.linspace(0, 1, 9)[:, None]
    rows = np.concatenate([a + shares * (b - a) for a, b in pairwise(line.waypoints)])
    off = np.cross(chain.fk(rows)[:, :3, 3] - start[:3, 3], goal[:3, 3] - start[:3, 3])
    assert np.linalg.norm(off, axis=1).max() / np.linalg.norm(goal[:3, 3] - start[:3, 3]) < 1.1 * LARGEST_STRAY


def turned(angle: float) -> Array:
    """A pose 0.2 m ahead, turned about the vertical."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0, 0.2], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])


@pytest.mark.parametrize("turn", [0.0, 0.5, -3.0, np.pi])
@pytest.mark.parametrize(
    ("moved", "tilt", "kept"),
    [
        ((0.1, 0, 0), 0.0, True),
        ((0.1, 0.0009, 0), 0.009, True),
        ((0.1, 0.0011, 0), 0.0, False),
        ((0.1, 0, 0), 0.011, False),
        ((0.202, 0, 0), 0.0, False),
        ((-0.002, 0, 0), 0.0, False),
    ],
)
def test_a_pose_keeps_a_line_that_is_near_it_and_is_turned_about_its_axis(
    turn: float, moved: tuple[float, float, float], tilt: float, kept: bool
) -> None:
    pose = turned(turn / 2)
    pose[:3, 3] = moved
    pose[:3, :3] = [[np.cos(tilt), 0, np.sin(tilt)], [0, 1, 0], [-np.sin(tilt), 0, np.cos(tilt)]] @ pose[:3, :3]
    assert keeps_line(pose[None], np.eye(4), turned(turn)) is kept


TABLE = Body("table", Pose((0.75, -0.2, 0.5)), (0.5, 1.0, 1.0))


def test_a_goal_inside_of_something_is_refused_with_both_names(make_stage: MakeStage) -> None:
    platform = make_stage(TABLE).platform
    arm = platform.scene.arms.all[0]
    stretched = np.clip(np.array([0.2, 0.0, 1.2, 0.0, 0.3, 0.0, 0.0, 0.0]), arm.lower, arm.upper)
    with pytest.raises(GoalInCollision, match="table") as refused:
        platform.arms.path(arm, stretched)
    assert {body for _, body in refused.value.pairs} == {"table"}
    assert all("right" in part for part, _ in refused.value.pairs)


def test_a_goal_inside_of_the_robot_is_refused_with_both_links(make_stage: MakeStage) -> None:
    platform = make_stage().platform
    arm = platform.scene.arms.all[0]
    goal = next(
        q
        for q in arm.chain.sample(np.random.default_rng(0), 500)
        if platform.scene.collisions.contacts(platform.base(), arm, q)
    )
    with pytest.raises(GoalInCollision) as refused:
        platform.arms.path(arm, goal)
    links = platform.scene.world.robot.links
    assert all(part in links and body in links for part, body in refused.value.pairs)


def test_a_base_that_would_stand_in_something_is_refused_with_both_names(make_stage: MakeStage) -> None:
    platform = make_stage(TABLE).platform
    with pytest.raises(GoalInCollision, match="in table") as refused:
        platform.drive.path((0.75, -0.2, 0.0))
    links = platform.scene.world.robot.links
    assert {body for _, body in refused.value.pairs} == {"table"}
    assert all(part in links for part, _ in refused.value.pairs)
    joints = platform.world.configuration().joints
    platform.world.set_configuration(Configuration((0.75, -0.2, 0.0), joints))  # type: ignore[attr-defined]
    with pytest.raises(StartInCollision, match="in table"):
        platform.drive.path((-1.0, 0.0, 0.0))


def test_errors_name_the_first_pairs() -> None:
    assert str(StartInCollision([0.0], [("hand", "cup")])).endswith("hand in cup")


def test_a_straight_line_whose_curve_swings_over_a_limit_is_followed_with_stops(
    make_stage: MakeStage, monkeypatch: pytest.MonkeyPatch
) -> None:
    platform = make_stage().platform
    arm, chain, base = platform.scene.arms.all[0], platform.scene.arms.all[0].chain, platform.base()
    curves: list[Array] = []

    def watched(*arguments: Any, **limits: Any) -> Trajectory:
        curve = time_curve(*arguments, **limits)
        curves.append(curve.positions)
        return curve

    monkeypatch.setattr("executive.modules.arm_paths.time_curve", watched)
    rng = np.random.default_rng(0)
    for start in chain.sample(rng, 60):
        start[3] = chain.upper[3] - 0.001  # the shoulder's roll, at its limit
        if platform.scene.collisions.contacts(base, arm, start):
            continue
        joints = {**platform.world.configuration().joints, **dict(zip(arm.joints, start.tolist(), strict=True))}
        platform.world.set_configuration(Configuration(base, joints))  # type: ignore[attr-defined]
        goal = platform.world.link_pose(platform.robot.arms[0].tip).matrix()
        goal[:3, 3] += rng.uniform(-0.1, 0.1, 3)
        with contextlib.suppress(MotionError):
            assert chain.within(platform.arms.straight_path(arm, goal, None).positions, 1e-6).all()
    assert not all(chain.within(curve, 1e-6).all() for curve in curves), "no curve would have left the limits"


ROBOT = bind_robot("amigo")


@pytest.fixture(scope="module")
def gaze() -> Gaze:
    """Amigo's."""
    found = gaze_of(ROBOT)
    assert found is not None
    return found


@pytest.fixture(scope="module")
def world() -> PlanningWorld:
    """An empty world with Amigo at the origin, arms carrying."""
    return PlanningWorld(Scene(()), ROBOT.body())


@settings(deadline=None, max_examples=examples(40))
@given(away=st.floats(0.6, 3.0), bearing=st.floats(-1.2, 1.2), height=st.floats(0.0, 1.8))
def test_the_camera_misses_a_point_by_what_is_said(
    gaze: Gaze, world: PlanningWorld, away: float, bearing: float, height: float
) -> None:
    point = np.array([away * math.cos(bearing), away * math.sin(bearing), height])
    neck, beyond, origin = gaze.at(point)
    assert ROBOT.camera is not None
    joints = dict(zip(gaze.joints, map(float, neck), strict=True))
    frame = world.link_pose(ROBOT.camera.link, Configuration((0.0, 0.0, 0.0), joints)).matrix()
    arrow = point - frame[:3, 3]
    missed = math.acos(min(1.0, float(frame[:3, :3] @ ROBOT.camera.forward @ arrow / np.linalg.norm(arrow))))
    assert missed == pytest.approx(beyond, abs=1e-3)
    assert frame[:3, 3] == pytest.approx(origin, abs=1e-3)


def test_what_is_ahead_is_met_within_half_a_step_of_the_table(gaze: Gaze) -> None:
    for point in ((1.5, 0.0, 1.0), (2.0, 0.8, 0.9), (1.0, -0.6, 0.8)):
        assert gaze.at(np.array(point))[1] < 0.05


def test_what_is_behind_is_beyond_the_neck(gaze: Gaze) -> None:
    assert gaze.at(np.array([-2.0, 0.0, 1.0]))[1] > 0.5


def test_a_path_that_two_searches_missed_is_sought_again_only_once_something_has_changed(make_stage: MakeStage) -> None:
    stage = make_stage(TABLE)
    platform, arm = stage.platform, stage.platform.scene.arms.all[0]

    def is_missed(goal: Array) -> bool:
        try:
            platform.arms.path(arm, goal, iterations=1)
        except MotionError as problem:
            return isinstance(problem, NoPath)
        return False

    def draws() -> object:
        return platform.rng.bit_generator.state["state"]

    goal = next(q for q in arm.chain.sample(np.random.default_rng(0), 500) if is_missed(q))
    assert is_missed(goal)
    drawn = draws()
    assert is_missed(goal)
    assert draws() == drawn, "not sought a third time"
    stand(stage, (-2.0, 0.0, 0.0))
    platform.arms.path(arm, goal)
    assert draws() != drawn
