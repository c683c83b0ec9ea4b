"""Strokes of tools, such as lanes over a surface, and the process module for circles in a vessel, as in stirring.

A stroke lies in the plane of the world feature of the motion's first height constraint. The tool feature of that
constraint follows it while all constraints of the motion hold. The base drives if needed.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import islice

import numpy as np

from executive.belief.scene_collisions import BasePose
from executive.modules.runner import Skill
from executive.modules.tools.constrained_motions import ConstrainedWork, unsatisfied
from executive.modules.tools.motion_grounding import GroundedMotion, Grounding, constraints_of
from executive.motion import MotionError
from executive.motion.constrained_ends import BEGINNINGS
from executive.motion.errors import OutOfEffort
from executive.motion.strokes import Place, ends_at, solve_stroke
from executive.robots.arms import ArmModel
from planlang.designators import Action, Object
from planlang.failures import (
    ActionUnresolvable,
    NavigationFailure,
)
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import moved, product
from planlang.kernel import compute_in_thread
from planlang.language.performing import actions_around
from planlang.language.process_module import process_module
from planlang.motion_constraints import (
    ConstraintKind,
    ConstraintsUnsatisfied,
    FeatureKind,
    MotionConstraint,
    a_constraint,
)
from planlang.protocols import Trajectory
from planlang.records import dataclass

CIRCLES = 5
"""Number of circles if the action states neither a number nor a duration."""
CORNERS = 12
"""Waypoints of a circle."""
SHARE = 0.6
"""Default radius of circles, as a share of the room that the tool has in the vessel."""
ASIDE = 0.015
"""Clearance between a tool and the wall of its vessel [m]."""
STRAY = 0.006
"""Largest distance of the tool from a waypoint [m]."""
PLACES = 4
"""Base poses within reach from which to try a stroke."""
NEAR = 16
"""Free base poses whose reach to check."""
FEW = 10
"""Starts of the solver for checking reach without collisions."""


Planned = tuple[GroundedMotion, Trajectory, Trajectory]
"""Motion of a stroke: to its first place, and through all."""


@dataclass(frozen=True, slots=True, eq=False)
class Plane:
    """Plane of a stroke, given by the constraint on the tool's height over it."""

    height: MotionConstraint

    @staticmethod
    def of(motion: GroundedMotion, action: Action) -> Plane:
        """Find the plane of a grounded motion. Raises ActionUnresolvable without a height constraint over a plane."""
        for one in motion.constraints:
            if one.kind is ConstraintKind.HEIGHT and one.world.direction is not None:
                return Plane(one)
        raise ActionUnresolvable(
            "a stroke needs a height constraint over a plane; add one to constrained_by", designator=str(action)
        )

    @property
    def thing(self) -> Object:
        """Object of the world that the plane belongs to."""
        assert isinstance(self.height.world.of, Object)
        return self.height.world.of

    def axes(self) -> tuple[Array, Array]:
        """Compute two orthogonal unit vectors (3,) in the plane, in the object's frame."""
        normal = np.array(self.height.world.direction) / np.linalg.norm(self.height.world.direction or 0)
        first = np.eye(3)[int(np.argmin(np.abs(normal)))]
        first -= float(first @ normal) * normal
        first /= np.linalg.norm(first)
        return first, np.cross(normal, first)

    def at(self, point: Array, constraints: Sequence[MotionConstraint]) -> Place:
        """Build the constraints at a waypoint (4,): a position in the object's frame, and a height over the plane."""
        x, y, z, over = map(float, point)
        feature = replace(self.height.world, kind=FeatureKind.LINE, position=(x, y, z))
        here = a_constraint("DISTANCE", self.height.tool, feature, upper=STRAY, name="place of the stroke")
        lower, upper = (None if one is None else one + over for one in (self.height.lower, self.height.upper))
        height = self.height if not over else replace(self.height, lower=lower, upper=upper)
        return (height, *(one for one in constraints if one != self.height), here)


class StrokeWork(ConstrainedWork):
    """Base of the process modules that make strokes with a tool or a hand."""

    async def begun(self, action: Action) -> tuple[Grounding, GroundedMotion]:
        """Look at the objects of a motion; return the grounding of its active constraints, and the grounded motion."""
        constraints = tuple(one for one in constraints_of(action) if one.is_active)
        if not constraints:
            raise ActionUnresolvable("a stroke needs active constraints in constrained_by", designator=str(action))
        grounding = Grounding(self.platform, constraints, self.platform.phases.current())
        await self._look(grounding)
        return grounding, grounding.grounded()

    def number(self, action: Action, name: str) -> float | None:
        """Read a positive number from an action, or from the nearest enclosing one that states it."""
        stated = (one.get(name) for one in (action, *actions_around()))
        return next((float(one) for one in stated if isinstance(one, int | float) and one > 0), None)

    def tool(self, motion: GroundedMotion) -> str:
        """Find the name of the tool in the first arm of a motion."""
        return next(one for one, grip in self.platform.belief.held.items() if grip.arm == motion.arms[0].name)

    # The stroke

    async def stroke(self, grounding: Grounding, plane: Plane, points: Array, *, closed: bool) -> Trajectory:
        """Move the tool to the first of waypoints (n, 4), if needed from another base pose.

        Returns the trajectory through all waypoints, which is yet to be executed. Raises ConstraintsUnsatisfied or a
        NavigationFailure.
        """
        here = self.platform.base()

        def places() -> Iterator[BasePose]:
            yield here
            yield from self._reaching(grounding, plane, points)

        async def approach(base: BasePose) -> None:
            if base != here:
                await self.drive_with_room(base)
                await self._look(grounding)

        async def solved(_: BasePose) -> Planned:
            return await self.planned_stroke(grounding, plane, points, closed=closed)

        failures = (ConstraintsUnsatisfied, NavigationFailure)
        return await self.begin_stroke(await Skill(places, solved, approach, failures=failures).run())

    async def planned_stroke(
        self, grounding: Grounding, plane: Plane, points: Array, guess: Array | None = None, *, closed: bool
    ) -> Planned:
        """Plan a stroke through waypoints (n, 4) from here, with joint positions (n, d) as a guess, if there is one.

        Raises ConstraintsUnsatisfied.
        """
        motion = grounding.grounded()
        waypoints = [plane.at(point, motion.constraints) for point in points]
        kept = [one for one in waypoints[0] if all(one in other for other in waypoints)]
        problems = grounding.problem(motion, clear=True), grounding.problem(motion)
        solve = partial(solve_stroke, *problems, self._start(motion), waypoints, kept, closed=closed, guess=guess)
        try:
            return motion, *await compute_in_thread(solve)
        except MotionError as problem:
            raise unsatisfied(motion, problem) from problem

    async def begin_stroke(self, planned: Planned) -> Trajectory:
        """Move the tool to the beginning of a stroke; return the trajectory of the stroke itself."""
        motion, first, lap = planned
        arms = {arm.name for arm in motion.arms}
        self.platform.leaning |= {name for name, grip in self.platform.belief.held.items() if grip.arm in arms}
        await self.gone(motion, first)
        return lap

    async def leave(self, arm: ArmModel, lap: Trajectory, what: str) -> None:
        """Retreat from a pushed body ``what`` against the approach of a stroke, back off, and tuck the arms."""
        base = Pose.planar(*self.platform.base()).matrix()
        await self.back(arm, product(base, arm.chain.fk(lap.positions[[0, -1]])), what)

    def _reaching(self, grounding: Grounding, plane: Plane, points: Array) -> Iterator[BasePose]:
        """Yield base poses from which the arm reaches all waypoints (n, 4), one after the other."""
        motion = grounding.grounded()
        in_map = moved(motion.things[plane.thing], points[:, :3])
        near = self.platform.standing().before(in_map, motion.arms) if self._is_mobile() else ()
        places = [plane.at(point, motion.constraints) for point in points]

        def is_reaching(base: BasePose, most: int = BEGINNINGS, *, blocked: bool = True) -> bool:
            problem = grounding.problem(motion, base, blocked=blocked)
            with suppress(OutOfEffort):
                return next(ends_at(problem, self._start(motion), places).along(most), None) is not None
            return False

        within = (base for base in islice(near, NEAR) if is_reaching(base, FEW, blocked=False))
        yield from (base for base in islice(within, PLACES) if is_reaching(base))


@process_module
class Strokes(StrokeWork):
    """Moves a tool in circles."""

    name = "stroke"
    actions = ("CirclingMotion",)

    async def execute(self, action: Action) -> tuple[str, ...]:
        """Move the tool in circles for the stated number and duration; return (), as no constraint is dropped."""
        grounding, motion = await self.begun(action)
        plane = Plane.of(motion, action)
        points = self._circle(plane, motion, self.number(action, "radius_of_circles"))
        lap = await self.stroke(grounding, plane, points, closed=True)
        seconds = len(lap.positions) / self.platform.world.rate
        times, duration = self._laps(action, seconds)
        for _ in range(times):
            await self.gone(motion, slowed(lap, duration / seconds))
        self._straightened()
        grounding.phase.before, grounding.phase.taken = grounding.constraints, self.taken()
        return ()

    def _laps(self, action: Action, seconds: float) -> tuple[int, float]:
        """Compute the number of circles and the duration of each [s], which is at least ``seconds``."""
        times, total = (self.number(action, name) for name in ("number_of_circles", "duration"))
        if total is None:
            return round(times or CIRCLES), seconds
        count = max(1, math.ceil(total / seconds) if times is None else round(times))
        return count, max(seconds, total / count)

    def _circle(self, plane: Plane, motion: GroundedMotion, radius: float | None) -> Array:
        """Sample waypoints (n, 4) on a circle about the plane's centre, in the vessel's frame, as wide as fits."""
        scene, bodies = self.platform.scene, self.platform.scene.world.scene
        name = scene.bodies.bind(plane.thing)
        tool = self.tool(motion)
        size, wide = scene.world.size(name), sorted(scene.world.size(tool))[1]
        room = min(size[:2]) / 2 - bodies.body(name).wall - wide / 2 - ASIDE
        if room <= 0:
            raise ActionUnresolvable(f"{tool} is too wide to move in {name}", designator=str(plane.thing))
        first, second = plane.axes()
        angles = np.linspace(0.0, 2 * np.pi, CORNERS, endpoint=False)[:, None]
        middle = np.array(plane.height.world.position)
        circle: Array = middle + min(radius or SHARE * room, room) * (np.cos(angles) * first + np.sin(angles) * second)
        return np.column_stack([circle, np.zeros(CORNERS)])


def slowed(trajectory: Trajectory, factor: float) -> Trajectory:
    """Stretch a trajectory in time by a factor of at least 1, interpolating linearly."""
    rows = trajectory.positions
    steps = np.linspace(0.0, len(rows) - 1.0, max(2, round((len(rows) - 1) * factor) + 1))
    columns = [np.interp(steps, np.arange(len(rows)), column) for column in rows.T]
    return Trajectory(trajectory.names, np.stack(columns, axis=1))
