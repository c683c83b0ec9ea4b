"""Facts about motions under constraints: they hold at the end of each phase, by formulas that share no code with the
solver, and what cannot hold is named."""

from __future__ import annotations

import os
import signal
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from constraint_problems import Arms, arms_of, at, random_problem

from executive.motion.constrained_ends import MotionProblem
from executive.motion.constrained_motion import solve_motion
from executive.motion.constraint_functions import Bound, ConstraintFunctions
from executive.motion.errors import ConstraintsContradict, Effort, MotionError, OutOfEffort
from planlang import VirtualHost, run
from planlang.designators import an_object
from planlang.diagnostics import BadInput
from planlang.geometry import Array
from planlang.motion_constraints import MotionConstraint, Speed, a_constraint, a_feature
from tests.support.examples import some

ROBOTS = [("amigo", 1), ("amigo", 2), ("panda", 1), ("pr2", 2)]


def arms(name: str, count: int = 1) -> Arms:
    """Arms of a robot; skips where its shape is not installed."""
    try:
        return arms_of(name, count)
    except BadInput as absent:
        pytest.skip(absent.diagnostics[0].message)


@pytest.mark.parametrize(("name", "count"), ROBOTS)
def test_functions_and_gradients_are_those_of_plain_formulas(name: str, count: int) -> None:
    robot, step = arms(name, count), 1e-6
    for seed in range(2):
        problem, q, phases = random_problem(robot, seed)
        asked = [one for phase in phases for one in phase]
        functions = ConstraintFunctions(robot.group, [Bound.of(one, problem.where) for one in asked])
        every = np.arange(len(asked))
        values, gradients = functions.values(np.repeat(q[None], len(asked), axis=0), every)
        np.testing.assert_allclose(values, [robot.value(problem, one, q) for one in asked], atol=1e-9)
        moved = functions.all_values(q + step * np.eye(len(q))) - functions.all_values(q - step * np.eye(len(q)))
        np.testing.assert_allclose(gradients, moved.T / (2 * step), atol=1e-5)


@pytest.mark.parametrize(("name", "count"), some(ROBOTS, 4))
def test_random_feasible_problems_are_solved_without_a_violation(name: str, count: int) -> None:
    # 200 of them: python tests/benchmarks/constraints.py
    robot = arms(name, count)
    for seed in range(100, 106):
        problem, start, phases = random_problem(robot, seed)
        motions = solve_motion(problem, start, phases)
        assert robot.objection(problem, start, phases, motions) is None, seed


CUP, TABLE = an_object("Cup"), an_object("Table")
AXIS = a_feature("LINE", of=CUP, position=(0.0, 0.0, 0.0), direction=(0.0, 0.0, 1.0), name="axis")
CENTRE = a_feature("POINT", of=CUP, position=(0.0, 0.0, 0.0), name="centre")
TOP = a_feature("PLANE", of=TABLE, position=(0.0, 0.0, 0.0), direction=(0.0, 0.0, 2.0), name="top")
UPRIGHT = a_constraint("PERPENDICULARITY", AXIS, TOP, lower=0.97, upper=1.2, name="upright")


def above(lower: float, upper: float, **more: Any) -> MotionConstraint:
    """A height of the cup over the table."""
    return a_constraint("HEIGHT", CENTRE, TOP, lower=lower, upper=upper, name="height", **more)


def near(x: float, y: float, **more: Any) -> list[MotionConstraint]:
    """The cup within 1 cm of a place of the table, seen from above."""
    return [
        a_constraint("BEHIND", CENTRE, TOP, lower=x - 0.01, upper=x + 0.01, name="ahead", **more),
        a_constraint("LEFT_OF", CENTRE, TOP, lower=y - 0.01, upper=y + 0.01, name="aside", **more),
    ]


def with_cup(robot: Arms) -> tuple[MotionProblem, Array]:
    """A problem: the hand level, a cup in it upright, a table half a metre ahead; and the carrying posture."""
    arm = robot.robot.arms[0]
    x, z = np.array(arm.approach), np.array(arm.closing)
    across = np.cross(x, z)
    in_tip = at(0.0, 0.0, 0.0, np.column_stack([x, z, across]))
    problem = robot.problem({CUP: (0, in_tip)}, {TABLE: at(0.55, -0.2, 0.6)})
    known = robot.robot.postures["carrying"]
    return problem, np.array([known[name] for name in robot.group.names])


@pytest.mark.parametrize("name", some(["amigo", "panda", "pr2"], every=3))
def test_what_held_before_holds_throughout(name: str) -> None:
    robot = arms(name)
    problem, start = with_cup(robot)
    phases = [[UPRIGHT, above(0.2, 0.25)], [UPRIGHT, above(0.3, 0.35), *near(0.05, 0.1)], [UPRIGHT, *near(0.0, -0.15)]]
    motions = solve_motion(problem, start, phases)
    assert robot.objection(problem, start, phases, motions) is None
    assert [motion.kept for motion in motions] == [(), (UPRIGHT,), (UPRIGHT,)]
    for row in np.concatenate([motion.trajectory.positions for motion in motions[1:]]):
        assert robot.worst(problem, [UPRIGHT], row) <= 1.0


@pytest.mark.parametrize("name", some(["amigo", "panda", "pr2"], every=3))
def test_pouring_moves_above_tilts_and_tilts_back(name: str) -> None:
    robot = arms(name)
    problem, start = with_cup(robot)
    over = [above(0.25, 0.3), *near(0.0, 0.0)]
    tilted = a_constraint("PERPENDICULARITY", AXIS, TOP, lower=-0.6, upper=-0.5, name="tilted")
    phases = [[UPRIGHT, *over], [tilted, *over], [UPRIGHT, *over]]
    motions = solve_motion(problem, start, phases)
    assert robot.objection(problem, start, phases, motions) is None
    assert [set(motion.kept) for motion in motions] == [set(), set(over), set(over)]


def test_a_phase_whose_weights_are_0_moves_nothing() -> None:
    robot = arms("amigo")
    problem, start = with_cup(robot)
    impossible = [above(3.0, 3.1, weight=0.0)]
    motions = solve_motion(problem, start, [impossible, [UPRIGHT], []])
    assert [len(motion.trajectory.positions) for motion in (motions[0], motions[2])] == [1, 1]
    assert np.array_equal(motions[0].trajectory.positions[0], start)
    assert robot.objection(problem, start, [impossible, [UPRIGHT], []], motions) is None


def test_limits_between_which_there_is_no_room_but_rounding_are_met() -> None:
    robot = arms("amigo")
    problem, start = with_cup(robot)
    # less than twice what is left for waypoints: in floating point lower + half < upper - half is not sure
    narrow = a_constraint("LEFT_OF", CENTRE, TOP, lower=0.0002285611587255598, upper=0.0007999476392546951)
    motions = solve_motion(problem, start, [[narrow]])
    assert robot.objection(problem, start, [[narrow]], motions) is None


def test_phases_that_ask_for_nothing_move_nothing() -> None:
    problem, start = with_cup(arms("amigo"))
    motions = solve_motion(problem, start, [[], []])
    assert [motion.trajectory.positions.tolist() for motion in motions] == [[start.tolist()]] * 2


@pytest.mark.parametrize("name", some(["amigo", "panda"], every=2))
def test_constraints_that_contradict_each_other_are_named_and_no_others(name: str) -> None:
    problem, start = with_cup(arms(name))
    low, high = above(0.1, 0.15), a_constraint("ABOVE_OF", CENTRE, TOP, lower=0.3, upper=0.4, name="high")
    with pytest.raises(ConstraintsContradict) as refused:
        solve_motion(problem, start, [[UPRIGHT], [UPRIGHT, low, *near(0.0, 0.0), high]])
    assert set(refused.value.constraints) == {low, high}
    assert refused.value.phase == 1
    assert "phase 2" in str(refused.value)
    assert "height of centre and top 0.1 to 0.15 m" in str(refused.value)


def test_what_is_out_of_reach_is_named_alone() -> None:
    problem, start = with_cup(arms("amigo"))
    far = above(3.0, 3.1)
    with pytest.raises(ConstraintsContradict, match="reach") as refused:
        solve_motion(problem, start, [[UPRIGHT, far]])
    assert refused.value.constraints == (far,)


def test_heavier_constraints_win_and_the_others_are_told() -> None:
    robot = arms("amigo")
    problem, start = with_cup(robot)
    low, high = above(0.1, 0.15, weight=100.0), a_constraint("ABOVE_OF", CENTRE, TOP, lower=0.3, weight=1.0)
    phases = [[UPRIGHT, high, low]]
    (motion,) = solve_motion(problem, start, phases)
    assert motion.given_up == (high,)
    assert robot.objection(problem, start, phases, [motion]) is None


@pytest.mark.parametrize("speed", some(Speed, every=3))
def test_no_tool_is_faster_than_its_constraints_allow(speed: Speed) -> None:
    robot = arms("amigo")
    problem, start = with_cup(robot)
    (motion,) = solve_motion(problem, start, [[above(0.3, 0.35, speed=speed), *near(0.1, 0.1, speed=speed)]])
    poses = np.array([robot.tip(row, 0) for row in motion.trajectory.positions])
    speeds = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1) * 30
    assert speeds.max() <= speed.value.linear * 1.001
    if speed is Speed.SLOW:
        assert speeds.max() >= 0.9 * speed.value.linear or len(speeds) > 300


def test_equal_problems_have_equal_motions() -> None:
    robot = arms("panda")
    problem, start, phases = random_problem(robot, 3)
    one, other = (solve_motion(problem, start, phases) for _ in range(2))
    for first, second in zip(one, other, strict=True):
        assert np.array_equal(first.trajectory.positions, second.trajectory.positions)


def test_features_tools_and_frames_that_nothing_is_known_of_are_refused() -> None:
    problem, start = with_cup(arms("amigo"))
    rim = a_feature(of=CUP, path=("Rim",))
    for constraint, message in (
        (a_constraint("HEIGHT", rim, TOP, lower=0.0), "Cup.Rim is not grounded"),
        (a_constraint("HEIGHT", TOP, TOP, lower=0.0), "holds Table"),
        (a_constraint("ABOVE_OF", CENTRE, TOP, lower=0.0, frame="/odom"), "reference frame /odom"),
        (a_constraint("HEIGHT", CENTRE, CENTRE, lower=0.0), "pose of Cup is unknown"),
    ):
        with pytest.raises(MotionError, match=message):
            solve_motion(problem, start, [[constraint]])


def test_turning_by_half_a_turn_is_found_where_the_function_is_flat() -> None:
    robot = arms("panda")
    problem, start = with_cup(robot)
    level = a_constraint("PERPENDICULARITY", AXIS, TOP, lower=0.9999)
    (motion,) = solve_motion(problem, start, [[level]])
    upside_down = a_constraint("PERPENDICULARITY", AXIS, TOP, upper=-0.97)
    phases = [[upside_down]]
    motions = solve_motion(problem, motion.trajectory.positions[-1], phases)
    assert robot.objection(problem, motion.trajectory.positions[-1], phases, motions) is None


def test_a_search_ends_when_as_much_was_computed_as_may_be_and_says_so() -> None:
    robot = arms("amigo")
    problem, start = with_cup(robot)
    phases = [[UPRIGHT, above(0.2, 0.25)]]
    little = replace(problem, effort=Effort(20, "variables"))
    for _ in range(2):  # each search has all of it
        with pytest.raises(OutOfEffort, match="given up after 20 variables"):
            solve_motion(little, start, phases)
    assert solve_motion(problem, start, phases)


def test_after_ctrl_c_no_motion_is_searched_any_further() -> None:
    robot = arms("amigo")
    problem, start = with_cup(robot)
    solved: list[object] = []

    def press(q: Array) -> list[tuple[str, str]]:
        os.kill(os.getpid(), signal.SIGINT)
        return []

    async def plan() -> None:
        solved.extend(solve_motion(replace(problem, touching=press), start, [[UPRIGHT, above(0.2, 0.25)]]))

    with pytest.raises(KeyboardInterrupt):
        run(plan, host=VirtualHost())
    assert not solved


def test_a_wish_holds_where_it_can_and_costs_nothing_where_it_cannot() -> None:
    robot = arms("pr2")
    problem, start = with_cup(robot)
    low, out_of_the_way = above(0.2, 0.3), a_constraint("BEHIND", CENTRE, TOP, lower=-0.3, upper=0.3, name="ahead")
    wishes = {above(0.21, 0.23): low, replace(out_of_the_way, lower=0.28): out_of_the_way}
    phase = [UPRIGHT, low, out_of_the_way, a_constraint("BEHIND", CENTRE, TOP, lower=-0.01, upper=0.01, name="over")]
    motions = solve_motion(problem, start, [phase], wishes=wishes)
    assert robot.objection(problem, start, [phase], motions) is None
    end = motions[0].trajectory.positions[-1]
    assert robot.worst(problem, [above(0.21, 0.23)], end) <= 1.0, "between the limits, and where it is wished"
    assert motions[0].given_up == ()
    (unwished,) = solve_motion(problem, start, [phase])
    assert robot.worst(problem, [above(0.21, 0.23)], unwished.trajectory.positions[-1]) > 1.0
