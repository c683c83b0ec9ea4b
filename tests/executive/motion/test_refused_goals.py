"""What a refused motion says."""

from __future__ import annotations

import contextlib
from typing import Any

import numpy as np
import pytest

from executive.motion import GoalInCollision, MotionError, StartInCollision, time_curve
from planlang.geometry import Array, Pose
from planlang.protocols import Configuration, Trajectory
from sim import Body
from tests.executive.conftest import MakeStage

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
        for q in arm.solver.chain.sample(np.random.default_rng(0), 500)
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
    arm, chain, base = platform.scene.arms.all[0], platform.scene.arms.all[0].solver.chain, platform.base()
    curves: list[Array] = []

    def watched(*arguments: Any, **limits: Any) -> Trajectory:
        curve = time_curve(*arguments, **limits)
        curves.append(curve.positions)
        return curve

    monkeypatch.setattr("executive.modules.arms.time_curve", watched)
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
            assert chain.within(platform.arms.straight_path(arm, goal, start, None).positions, 1e-6).all()
    assert not all(chain.within(curve, 1e-6).all() for curve in curves), "no curve would have left the limits"
