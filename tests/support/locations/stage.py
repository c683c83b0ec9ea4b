"""The product's side of the measurements, through its public interface: rooms that are believed, and answers."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from itertools import islice

import numpy as np

from executive.locations import HandSolution
from executive.maps import MapObject, SemanticMap
from executive.modules.platform import Platform
from executive.robots import Robot, bind_robot
from executive.runs.assembly import platform_of
from planlang.designators import Location, Object, a_location
from planlang.failures import PlanFailure
from planlang.files import bundled
from planlang.geometry import Array, Pose
from planlang.ontology import Ontology, expand, load
from planlang.protocols import Configuration, Solution
from sim import Body, PlanningWorld
from tests.support.locations.oracle import Claim
from tests.support.locations.rooms import PLACE, Room


@cache
def vocabulary() -> Ontology:
    """The bundled classes and properties."""
    return load(bundled("ontologies") / "environments" / "hospital_room.omn")


@cache
def robot_of(name: str) -> Robot:
    """A bundled robot."""
    return bind_robot(name)


@dataclass(slots=True)
class Answer:
    """The result of a resolution."""

    solutions: list[Solution]
    seconds: float
    """CPU time until the last of them, or until it gave up [s]."""
    counts: Mapping[str, int] = field(default_factory=dict)
    blocking: Mapping[str, int] = field(default_factory=dict)
    failure: str = ""

    @property
    def solved(self) -> bool:
        """Return whether there is a place."""
        return bool(self.solutions)


class Stage:
    """A room, a robot in it, and what it believes: all of the room."""

    def __init__(self, room: Room, robot: Robot) -> None:
        self.room, self.robot = room, robot
        self.world = PlanningWorld(room.scene(), robot.body())
        things = SemanticMap(None, vocabulary(), tuple(map(_thing, room.bodies)), ())
        self.platform: Platform = platform_of(robot, things, self.world, self.world, 0)

    def close(self) -> None:
        """End the world."""
        self.world.close()

    def ask(self, location: Location, number: int = 1) -> Answer:
        """The first places for a location."""
        self.platform.observe()
        found: list[Solution] = []
        began = time.process_time()
        try:
            for solution in islice(self.platform.resolver.bases(location), number):
                found.append(solution)
        except PlanFailure as failure:
            counts, blocking = getattr(failure, "counts", {}), getattr(failure, "blocking", {})
            return Answer(found, time.process_time() - began, counts, blocking, str(failure))
        return Answer(found, time.process_time() - began)

    def put(self, location: Location, what: Object) -> tuple[Pose | None, float]:
        """The first pose for a thing at a location, None if there is none, and the CPU time it took [s]."""
        self.platform.observe()
        began = time.process_time()
        try:
            found = next(self.platform.resolver.things(location, what), None)
        except PlanFailure:
            found = None
        return found, time.process_time() - began

    def claim(self, solution: Solution, what: Object, *, held: bool = False) -> Claim | None:
        """The way in which the arm that was chosen reaches, from a place, and how it moves; None if it finds none.

        Raises MotionError if it cannot go straight from pose to pose of it.
        """
        before = self.world.configuration()
        try:
            self.world.set_configuration(Configuration(solution.base, before.joints))
            self.platform.observe()
            arm = next(a for a in self.platform.scene.arms.all if a.name == solution.detail["arm"])
            person = self.platform.scene.bodies.is_person(self.platform.scene.bodies.bind(what))
            hand = a_location(in_reach_of=what) if person else a_location(in_front_of=what)
            seed = np.array([before.joints[name] for name in arm.joints])
            way = next(self.platform.resolver.hands(hand, arm, seed))
            return self._claim(way, solution)
        except (PlanFailure, StopIteration):
            return None
        finally:
            self.world.set_configuration(before)
            self.platform.observe()

    def _claim(self, way: HandSolution, solution: Solution) -> Claim:
        plan, arm, platform = way.plan, way.arm, self.platform
        fingers = dict(plan.fingers)
        motions, q = list[Array](), way.joints[0]
        for pose in plan.poses[1:]:
            joints = {**self.world.configuration().joints, **fingers, **dict(zip(arm.joints, q.tolist(), strict=True))}
            self.world.set_configuration(Configuration(solution.base, joints))
            motions.append(platform.arms.straight_path(arm, pose, plan.touches).positions)
            q = motions[-1][-1]
        names, target = tuple(arm.joints), plan.touches
        return Claim(solution.base, arm.name, names, way.joints, plan.poses, target, fingers, tuple(motions))


def _thing(body: Body) -> MapObject:
    types = (expand(body.type),)
    return MapObject(body.iri or PLACE + body.name, body.name, types, body.pose, body.size)
