"""Bodies around the arms of a robot at the map's origin, for motions under constraints."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np
from constraint_evaluation import Matrix
from constraint_problems import Arms, random_problem, straight

from executive.motion.arm_bodies import ArmShapes, Room, links_of
from executive.motion.bodies import Solids
from executive.motion.collision import QuickCheck
from executive.motion.constrained_ends import MotionProblem
from planlang.geometry import Pose
from planlang.motion_constraints import MotionConstraint
from planlang.protocols import Configuration
from sim import Body, PlanningWorld, Scene

ROOM = Body("room", Pose((0.0, 0.0, 1.3)), (5.0, 5.0, 2.6), "room")
BOXES = 20
SPARE = 0.02
"""By how much boxes are larger while it is looked which of them would be in the way [m]."""


@dataclass(frozen=True)
class Around:
    """A world with bodies around a robot."""

    robot: Arms
    world: PlanningWorld
    quick: QuickCheck

    @property
    def posture(self) -> Matrix:
        """The joint values (n,) at the beginning."""
        return np.array([self.world.configuration().joints[name] for name in self.robot.group.names])

    def touching(self, q: Matrix) -> list[tuple[str, str]]:
        """Return what touches at a configuration (n,), exactly."""
        joints = {**self.world.configuration().joints, **dict(zip(self.robot.group.names, q.tolist(), strict=True))}
        there = Configuration(self.world.configuration().base, joints)
        return [(contact.part, contact.body) for contact in self.world.contacts(there, self.robot.group.names)]

    def of(self, problem: MotionProblem) -> MotionProblem:
        """Return a problem with these bodies."""
        return replace(problem, obstacles=self.quick, touching=self.touching)


@contextmanager
def bodies_around(robot: Arms, bodies: Sequence[Body]) -> Iterator[Around]:
    """Yield the world of a robot in a room with bodies."""
    world = PlanningWorld(Scene((ROOM, *bodies), (-2.5, -2.5, 2.5, 2.5)), robot.robot.body())
    try:
        tip = robot.robot.arms[0].tip
        shapes = ArmShapes(world, links_of(world), robot.group, robot.robot.base_link, tip)
        base, solids = world.link_pose(robot.robot.base_link).matrix(), Solids.of(world.solids())
        yield Around(robot, world, shapes.now(world).against(base, Room.of(solids, "room"), (frozenset(), frozenset())))
    finally:
        world.close()


def random_problem_among_boxes(
    robot: Arms, alone: Around, seed: int
) -> tuple[MotionProblem, Matrix, list[list[MotionConstraint]], list[Body]]:
    """A random problem, feasible by construction, and boxes: the straight ways that show this touch none of them.

    ``alone`` is the robot with nothing around.
    """
    ways: list[Matrix] = []

    def is_free(one: Matrix, other: Matrix) -> bool:
        way = straight(one, other)
        if any(alone.touching(row) for row in way):
            return False
        ways.append(way)
        return True

    problem, start, phases = random_problem(robot, seed, is_free=is_free)
    rng = np.random.default_rng(seed)
    places = rng.uniform((-0.9, -0.9, 0.2), (0.9, 0.9, 1.6), (BOXES, 3)).tolist()
    sizes = rng.uniform(0.05, 0.25, (BOXES, 3))
    wide = [
        Body(f"box{k}", Pose(tuple(place)), tuple((size + SPARE).tolist()))
        for k, (place, size) in enumerate(zip(places, sizes, strict=True))
    ]
    with bodies_around(robot, wide) as crowded:
        hit = {body for way in ways for row in way for _, body in crowded.touching(row)}
        hit |= {contact.body for contact in crowded.world.contacts(crowded.world.configuration())}
    return (
        problem,
        start,
        phases,
        [replace(one, size=tuple(size.tolist())) for one, size in zip(wide, sizes, strict=True) if one.name not in hit],
    )
