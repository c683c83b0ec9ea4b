"""Motions under constraints on real robots: random problems that are feasible by construction, and what is violated."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np
from constraint_evaluation import Matrix, beyond, value_of
from constraint_evaluation import Robot as Joints

from executive.motion.arm_group import ArmGroup
from executive.motion.constrained_ends import JointRates, MotionProblem
from executive.motion.constrained_motion import PhaseMotion
from executive.motion.constraint_functions import Surroundings
from executive.motion.kinematics import Chain
from executive.robots import Robot, bind_robot
from planlang.designators import Object, an_object
from planlang.motion_constraints import ConstraintKind, Feature, MotionConstraint, a_constraint, a_feature

RATE = 30
WIDTHS = (0.0, 0.002, 0.02, 0.2)
"""Of limits, up to which they are drawn [m, no unit]."""


@dataclass(frozen=True)
class Arms:
    """Some arms of a robot at the map's origin."""

    robot: Robot
    group: ArmGroup

    def problem(self, tools: dict[Object, tuple[int, Matrix]], things: dict[Object, Matrix]) -> MotionProblem:
        """A problem without obstacles."""
        limits = [self.robot.limits[name] for name in self.group.names]
        rates = JointRates(
            *(np.array([getattr(one, kind) for one in limits]) for kind in ("speed", "acceleration", "jerk")), RATE
        )
        where = Surroundings(np.eye(4), tools, things, {"map": np.eye(3), "turned": turn((0, 0, 1), 0.5)}, np.eye(3))
        return MotionProblem(self.group, where, rates)

    def tip(self, q: Matrix, arm: int) -> Matrix:
        """The pose of a tip, by formulas that are not the product's."""
        joints = dict(zip(self.group.names, q.tolist(), strict=True))
        return Joints(self.robot.urdf).pose(self.robot.base_link, self.robot.arms[arm].tip, joints)

    def value(self, problem: MotionProblem, constraint: MotionConstraint, q: Matrix) -> float:
        """The function of a constraint at a configuration (n,)."""
        arm, in_tip = problem.where.tools[constraint.tool.of]
        frame = problem.where.frames[constraint.frame or "map"]
        return value_of(constraint, self.tip(q, arm) @ in_tip, problem.where.things[constraint.world.of], frame)

    def worst(self, problem: MotionProblem, constraints: Sequence[MotionConstraint], q: Matrix) -> float:
        """Return how far the function of any constraint is outside, in tolerances."""
        return max((beyond(one, self.value(problem, one, q)) for one in constraints), default=0.0)

    def objection(
        self,
        problem: MotionProblem,
        start: Matrix,
        phases: Sequence[Sequence[MotionConstraint]],
        motions: Sequence[PhaseMotion],
    ) -> str | None:
        """Return what is wrong with motions; None if nothing is."""
        here = start
        for number, (phase, motion) in enumerate(zip(phases, motions, strict=True)):
            rows = motion.trajectory.positions
            if not np.array_equal(rows[0], here):
                return f"phase {number} does not begin where the one before ended"
            here = rows[-1]
            asked = [one for one in phase if one.weight > 0 and one not in motion.given_up]
            if (worst := self.worst(problem, asked, here)) > 1.0:
                return f"phase {number} ends {worst:.2f} tolerances outside"
            for row in rows[:: max(1, len(rows) // 12)]:
                if (worst := self.worst(problem, motion.kept, row)) > 1.0:
                    return f"phase {number} is {worst:.2f} tolerances outside on its way"
            if not self.group.within(rows, 1e-3).all():
                return f"phase {number} leaves joint limits"
        return None


@cache
def arms_of(name: str, count: int = 1) -> Arms:
    """The first arms of a robot; BadInput where its URDF is not installed."""
    robot = bind_robot(name)
    chains = [Chain.from_urdf(robot.urdf, robot.base_link, arm.tip) for arm in robot.arms[:count]]
    return Arms(robot, ArmGroup(chains))


def turn(axis: tuple[float, float, float], angle: float) -> Matrix:
    """A rotation (3, 3)."""
    x, y, z = axis
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k)


def at(x: float, y: float, z: float, rotation: Matrix | None = None) -> Matrix:
    """A pose (4, 4)."""
    pose = np.eye(4)
    pose[:3, 3] = x, y, z
    pose[:3, :3] = np.eye(3) if rotation is None else rotation
    return pose


def _pose(rng: np.random.Generator, spread: float) -> Matrix:
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    return at(*rng.normal(0.0, spread, 3).tolist(), turn(tuple(axis.tolist()), rng.uniform(0, np.pi)))


def _feature(rng: np.random.Generator, of: Object, directed: bool) -> Feature:
    position, direction = rng.normal(0.0, 0.08, 3).tolist(), rng.normal(size=3).tolist()
    if not directed and rng.random() < 0.3:
        return a_feature("POINT", of=of, position=position)
    return a_feature(str(rng.choice(["LINE", "PLANE"])), of=of, position=position, direction=direction)


def _around(arms: Arms, problem: MotionProblem, rng: np.random.Generator, rows: Matrix) -> MotionConstraint:
    """A random constraint that holds at configurations (m, n)."""
    kind = list(ConstraintKind)[int(rng.integers(len(ConstraintKind)))]
    of_tool, of_thing = (
        list(those)[int(rng.integers(len(those)))] for those in (problem.where.tools, problem.where.things)
    )
    tool = _feature(rng, of_tool, kind.value.tool_direction)
    world = _feature(rng, of_thing, kind.value.world_direction)
    frame = str(rng.choice(["map", "turned"]))
    values = [arms.value(problem, a_constraint(kind, tool, world, frame=frame), q) for q in rows]
    below, above = (rng.choice(WIDTHS, 2) * rng.random(2)).tolist()
    return a_constraint(kind, tool, world, frame=frame, lower=min(values) - below, upper=max(values) + above)


def straight(one: Matrix, other: Matrix) -> Matrix:
    """Configurations (24, n) on the straight way between two."""
    return np.asarray(one + np.linspace(0.0, 1.0, 24)[:, None] * (other - one))


def random_problem(
    arms: Arms, seed: int, *, most_phases: int = 3, is_free: Callable[[Matrix, Matrix], bool] = lambda one, other: True
) -> tuple[MotionProblem, Matrix, list[list[MotionConstraint]]]:
    """A problem, where it starts, and phases that are feasible: constraints hold at a random configuration of each.

    Some are asked for in two phases; these hold on the whole straight way between the two configurations. ``is_free``
    says whether such a way may be gone.
    """
    rng = np.random.default_rng(seed)
    group, count = arms.group, len(arms.group.chains)
    tools = {an_object(f"Tool{arm}"): (arm, _pose(rng, 0.1)) for arm in range(count)}
    things = {an_object(f"Thing{k}"): _pose(rng, 0.6) for k in range(2)}
    problem = arms.problem(tools, things)
    start = here = rng.uniform(group.lower, group.upper)
    while not is_free(start, start):
        start = here = rng.uniform(group.lower, group.upper)
    ends, wanted = list[Matrix](), int(rng.integers(1, most_phases + 1))
    while len(ends) < wanted:
        there = rng.uniform(group.lower, group.upper)
        if is_free(here, there):
            ends.append(here := there)
    phases = [[_around(arms, problem, rng, q[None]) for _ in range(int(rng.integers(1, 3 + 3 * count)))] for q in ends]
    for number, (one, other) in enumerate(pairwise(ends)):
        if rng.random() < 0.5:
            both = _around(arms, problem, rng, straight(one, other))
            phases[number].append(both)
            phases[number + 1].append(both)
    return problem, start, phases
