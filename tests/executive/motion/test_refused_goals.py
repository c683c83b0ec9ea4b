"""What a refused motion says."""

from __future__ import annotations

import numpy as np
import pytest

from executive.motion import GoalInCollision, StartInCollision
from planlang.protocols import Pose
from sim import Body
from tests.executive.conftest import MakeStage

TABLE = Body("table", Pose((0.75, -0.2, 0.5)), (0.5, 1.0, 1.0))


def test_a_goal_inside_of_something_is_refused_with_both_names(make_stage: MakeStage) -> None:
    platform = make_stage(TABLE).platform
    arm = platform.around.arms[0]
    stretched = np.clip(np.array([0.2, 0.0, 1.2, 0.0, 0.3, 0.0, 0.0, 0.0]), arm.lower, arm.upper)
    with pytest.raises(GoalInCollision, match="table") as refused:
        platform.arm_path(arm, stretched)
    assert {body for _, body in refused.value.pairs} == {"table"}
    assert all("right" in part for part, _ in refused.value.pairs)


def test_a_goal_inside_of_the_robot_is_refused_with_both_links(make_stage: MakeStage) -> None:
    platform = make_stage().platform
    arm = platform.around.arms[0]
    goal = next(
        q
        for q in arm.solver.chain.sample(np.random.default_rng(0), 500)
        if platform.around.contacts(platform.base(), arm, q)
    )
    with pytest.raises(GoalInCollision) as refused:
        platform.arm_path(arm, goal)
    links = platform.around.world.robot.links
    assert all(part in links and body in links for part, body in refused.value.pairs)


def test_errors_name_the_first_pairs() -> None:
    assert str(StartInCollision([0.0], [("hand", "cup")])).endswith("hand in cup")
