"""Facts about strokes: a tool goes through all places, and what holds at each holds all the way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from constraint_problems import Arms, arms_of, at

from executive.motion.constrained_ends import MotionProblem
from executive.motion.errors import ConstraintsContradict
from executive.motion.strokes import ends_at, solve_stroke
from planlang.designators import an_object
from planlang.motion_constraints import MotionConstraint, a_constraint, a_feature
from tests.support.examples import some

CUP, TABLE = an_object("Cup"), an_object("Table")
CENTRE = a_feature("POINT", of=CUP, position=(0.0, 0.0, 0.0))
AXIS = a_feature("LINE", of=CUP, position=(0.0, 0.0, 0.0), direction=(0.0, 0.0, 1.0))
TOP = a_feature("PLANE", of=TABLE, position=(0.0, 0.0, 0.0), direction=(0.0, 0.0, 1.0))
UPRIGHT = a_constraint("PERPENDICULARITY", AXIS, TOP, lower=0.97, upper=1.2, name="upright")
LOW = a_constraint("HEIGHT", CENTRE, TOP, lower=0.0, upper=0.01, name="low")
STRAY = 0.006
TURNS = np.linspace(0.0, 2 * np.pi, 12, endpoint=False)


def at_place(x: float, y: float) -> tuple[MotionConstraint, ...]:
    """The cup upright and low, over a place of the table."""
    here = a_feature("LINE", of=TABLE, position=(x, y, 0.0), direction=(0.0, 0.0, 1.0))
    return (UPRIGHT, LOW, a_constraint("DISTANCE", CENTRE, here, upper=STRAY, name="place"))


def holding_a_cup(name: str) -> tuple[Arms, MotionProblem]:
    """A robot whose first hand holds a cup upright, before a table."""
    robot = arms_of(name)
    arm = robot.robot.arms[0]
    x, z = np.array(arm.approach), np.array(arm.closing)
    cup = at(0.0, 0.0, 0.0, np.column_stack([x, z, np.cross(x, z)]))
    return robot, robot.problem({CUP: (0, cup)}, {TABLE: at(0.5, -0.1, 0.8)})


@pytest.mark.parametrize("is_closed", some([True, False], every=2), ids=["circle", "arc"])
@pytest.mark.parametrize("name", some(["panda", "amigo"]))
def test_a_stroke_goes_through_all_places_and_keeps_what_holds_at_each(name: str, is_closed: bool) -> None:
    robot, problem = holding_a_cup(name)
    start = np.mean(robot.group.bounds, axis=0)
    places = [at_place(0.06 * np.cos(turn), 0.06 * np.sin(turn)) for turn in TURNS]
    first, lap = solve_stroke(problem, problem, start, places, [UPRIGHT, LOW], closed=is_closed)
    assert np.array_equal(first.positions[0], start)
    assert np.array_equal(first.positions[-1], lap.positions[0])
    assert np.array_equal(lap.positions[0], lap.positions[-1]) == is_closed
    assert max(robot.worst(problem, [UPRIGHT, LOW], row) for row in lap.positions[::6]) <= 1.0
    way = np.array([robot.tip(row, 0)[:2, 3] for row in lap.positions]) - (0.5, -0.1)
    for turn in TURNS:
        there = 0.06 * np.array([np.cos(turn), np.sin(turn)])
        assert np.linalg.norm(way - there, axis=1).min() <= STRAY + 0.001


def test_a_stroke_begins_near_joint_values_that_are_known_to_reach_its_places() -> None:
    robot, problem = holding_a_cup("amigo")
    start, places = np.mean(robot.group.bounds, axis=0), [at_place(0.02 * k, 0.0) for k in range(4)]
    known = np.array(list(next(ends_at(problem, start, places).along()).values()))
    first, lap = solve_stroke(problem, problem, start, places[::-1], [UPRIGHT, LOW], closed=False, guess=known[::-1])
    assert np.array_equal(first.positions[0], start)
    assert np.abs(lap.positions[0] - known[-1]).max() < 0.1
    assert max(robot.worst(problem, [UPRIGHT, LOW], row) for row in lap.positions[::6]) <= 1.0


def test_a_stroke_beyond_reach_is_refused() -> None:
    robot = arms_of("amigo")
    problem = robot.problem({CUP: (0, np.eye(4))}, {TABLE: at(0.5, -0.1, 0.8)})
    start = np.mean(robot.group.bounds, axis=0)
    with pytest.raises(ConstraintsContradict):
        solve_stroke(problem, problem, start, [at_place(0.0, 0.0), at_place(3.0, 0.0)], [UPRIGHT], closed=False)


def test_the_places_of_a_stroke_are_said_once_with_their_number() -> None:
    problem = ConstraintsContradict(0, [UPRIGHT, *(at_place(0.01 * k, 0.0)[2] for k in range(40))])
    assert str(problem).count("0.006 m") == 1
    assert str(problem).endswith("0.006 m (40 times)")
    assert len(problem.constraints) == 41


def test_a_joint_far_slower_than_others_keeps_still_in_a_stroke_that_goes_round() -> None:
    robot, problem = holding_a_cup("amigo")
    rates = replace(problem.rates, velocity=np.append(0.01, problem.rates.velocity[1:]))
    places = [at_place(0.06 * np.cos(turn), 0.06 * np.sin(turn)) for turn in TURNS]
    slow, start = replace(problem, rates=rates), np.mean(robot.group.bounds, axis=0)
    _, lap = solve_stroke(slow, slow, start, places, [UPRIGHT, LOW], closed=True)
    assert np.ptp(lap.positions[:, 0]) < 0.005
