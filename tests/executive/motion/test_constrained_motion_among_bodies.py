"""Facts about motions under constraints where bodies are: nothing is touched, and what is in the way is named."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np
import pytest
from constraint_bodies import bodies_around
from constraint_problems import Arms, arms_of, at

from executive.motion.constrained_ends import MotionProblem
from executive.motion.constrained_motion import solve_motion
from executive.motion.errors import ConstraintsContradict, StartInCollision
from planlang.designators import an_object
from planlang.diagnostics import BadInput
from planlang.geometry import Array, Pose
from planlang.motion_constraints import MotionConstraint, a_constraint, a_feature
from sim import Body
from tests.support.examples import some

CUP, TABLE = an_object("Cup"), an_object("Table")
CENTRE = a_feature("POINT", of=CUP, position=(0.0, 0.0, 0.0))
AXIS = a_feature("LINE", of=CUP, position=(0.0, 0.0, 0.0), direction=(0.0, 0.0, 1.0))
TOP = a_feature("PLANE", of=TABLE, position=(0.0, 0.0, 0.0), direction=(0.0, 0.0, 1.0))
UPRIGHT = a_constraint("PERPENDICULARITY", AXIS, TOP, lower=0.97, upper=1.2, name="upright")


@contextmanager
def among(robot: Arms, bodies: Sequence[Body]) -> Iterator[tuple[MotionProblem, Array]]:
    """A problem of arms with bodies around, a frame "Table" at 0.5, -0.1, 0.8; and the carrying posture."""
    arm = robot.robot.arms[0]
    x, z = np.array(arm.approach), np.array(arm.closing)
    problem = robot.problem(
        {CUP: (0, at(0.0, 0.0, 0.0, np.column_stack([x, z, np.cross(x, z)])))}, {TABLE: at(0.5, -0.1, 0.8)}
    )
    with bodies_around(robot, bodies) as around:
        yield around.of(problem), around.posture


def place(x: float, y: float, z: float) -> list[MotionConstraint]:
    """The cup upright within 1 cm of a place of the table's frame."""
    ways = (("BEHIND", x), ("LEFT_OF", y), ("ABOVE_OF", z))
    return [UPRIGHT, *(a_constraint(kind, CENTRE, TOP, lower=v - 0.01, upper=v + 0.01) for kind, v in ways)]


@pytest.mark.long
@pytest.mark.parametrize("name", some(["amigo", "panda"]))
def test_a_cup_is_carried_upright_around_a_post(name: str) -> None:
    robot = arms_of(name)
    post = Body("post", Pose((0.56, -0.1, 0.6)), (0.04, 0.04, 1.2), "cylinder")
    phases = [place(0.0, 0.15, 0.0), place(0.02, -0.25, 0.03)]
    with among(robot, [post]) as (problem, start):
        motions = solve_motion(problem, start, phases)
        assert robot.objection(problem, start, phases, motions) is None
        assert motions[1].kept == (UPRIGHT,)
        for row in np.concatenate([motion.trajectory.positions for motion in motions])[::4]:
            assert not problem.touching(row)


def test_two_arms_keep_clear_of_each_other() -> None:
    robot = arms_of("amigo", 2)
    phases = [place(0.0, 0.25, 0.0)]  # the right hand where the left one is
    with among(robot, []) as (problem, start):
        (motion,) = solve_motion(problem, start, phases)
        assert robot.objection(problem, start, phases, [motion]) is None
        assert not any(problem.touching(row) for row in motion.trajectory.positions[::4])


@pytest.mark.long
def test_what_is_in_the_way_is_named() -> None:
    robot = arms_of("amigo")
    block = Body("block", Pose((0.6, -0.1, 0.8)), (0.3, 0.5, 0.6))
    with among(robot, [block]) as (problem, start):
        with pytest.raises(ConstraintsContradict, match="block") as refused:
            solve_motion(problem, start, [place(0.1, 0.0, 0.0)])
        assert any("block" in pair for pair in refused.value.pairs)
        assert UPRIGHT not in refused.value.constraints


def test_a_start_in_something_is_refused() -> None:
    robot = arms_of("amigo")
    cube = Body("cube", Pose((0.35, -0.3, 0.9)), (0.5, 0.5, 0.5))
    with among(robot, [cube]) as (problem, start), pytest.raises(StartInCollision, match="cube"):
        solve_motion(problem, start, [place(0.1, 0.0, 0.0)])


def test_equal_problems_among_bodies_have_equal_motions() -> None:
    robot = arms_of("panda")
    post = Body("post", Pose((0.56, -0.1, 0.6)), (0.04, 0.04, 1.2), "cylinder")
    phases = [place(0.0, 0.15, 0.0), place(0.0, -0.25, 0.0)]
    with among(robot, [post]) as (problem, start):
        one, other = (solve_motion(problem, start, phases) for _ in range(2))
    for first, second in zip(one, other, strict=True):
        assert np.array_equal(first.trajectory.positions, second.trajectory.positions)


def test_the_pr2_finds_its_way_though_torso_and_upper_arm_nearly_touch() -> None:
    try:
        robot = arms_of("pr2", 2)
    except BadInput as absent:
        pytest.skip(absent.diagnostics[0].message)
    phases = [place(0.1, 0.1, 0.1), place(0.1, -0.2, 0.0)]
    with among(robot, []) as (problem, start):
        motions = solve_motion(problem, start, phases)
        assert robot.objection(problem, start, phases, motions) is None
