"""Floor of the believed world: where the base has room, and where it can drive in the posture in which it drives."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from executive.belief.belief import Belief
from executive.belief.floor import CELL, Floor
from executive.belief.memory import BasePose as BasePose
from executive.belief.scene_part import Kept, ScenePart
from executive.motion import Boxes, Grid
from executive.motion.base_path import ESCAPE
from executive.motion.bodies import Solids
from executive.motion.clearance import Mask
from executive.motion.floods import EVERY, LACKING, SPARE, Drivable, Poses, drivable, poses_for
from executive.motion.outlines import outlines
from executive.robots import CARRYING
from executive.robots.arms import ArmModel, RobotModel
from planlang.geometry import Array
from planlang.geometry.areas import Block
from planlang.protocols import Configuration
from sim import PlanningWorld, WorldMirror

NEAR_ITS_END = 0.4
"""Distance from the goal within which less than a cell of clearance is enough for the base [m]."""
ASIDE = (0.0, 0.5, -0.5, 1.0, -1.0, 1.6, -1.6)
"""Offsets from the middle of the straight line at which to try the corner of a path with one turn [m]."""
SAMPLED = (16, 1)
"""Strides of the points of such paths that are checked: a few rule most paths out, then all those of the others."""
MOST_FLOOR = 10_000.0
"""Largest area of a map for which base reachability is computed [m^2]."""
MOST_REMOVED = 8
"""Bodies near the straight line to remove hypothetically, one at a time."""
BESIDE = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
"""Sides of a block, in its frame."""
TUCKED = 0.31
"""Offset of a hand with an object from where it carries things, along each axis, up to which it carries that [m]."""
MOST_FLOORS = 12
"""Floors that are kept: of what is believed and the last hypotheses, with arms, without, and with arms tucked."""
ALIKE = 1e-3
"""Difference of joint positions up to which postures are one [rad, m]."""
SLACKS = (LACKING, 0.0, -SPARE)
"""Clearance that may be missing: where no way must be ruled out, where the base drives, and where it turns [m]."""


class SceneFloor(ScenePart):
    """Floor in the planning world; results are cached until something moves."""

    def __init__(self, mirror: WorldMirror, model: RobotModel, belief: Belief) -> None:
        super().__init__(mirror, belief)
        self._robot, self._arms = model.robot, model.arms
        self._bodies: Kept[tuple[Boxes, Solids]] = Kept()
        self._floors: Kept[Floor] = Kept(MOST_FLOORS)
        self._free: Kept[list[Poses]] = Kept()
        self._drivable: Kept[Drivable] = Kept()
        self._reached: Kept[Drivable] = Kept()

    # Room to stand

    def floor(self) -> Floor:
        """Compute the floor that is free for the base, with the robot's body as it is now, without its arms."""
        return self.whole([name for arm in self._robot.arms for name in arm.joints])

    def whole(self, without: Sequence[str] = ()) -> Floor:
        """Compute the floor that is free for the base, with the robot as it is now, but for what some joints move."""
        key = self._state(), self._posture(), tuple(without)
        return self._floors.of(key, lambda: self._floor_of(self._world, without))

    def _floor_of(self, world: PlanningWorld, without: Sequence[str] = ()) -> Floor:
        shapes, silhouette = outlines(world.outlines(without)), world.silhouette(without)
        return Floor(self.obstacles(), silhouette, shapes, world.scene.bounds)

    # Room to drive

    def travelled(self) -> Floor:
        """Compute the floor that is free for the robot as it drives: arms tucked, with what they hold.

        An arm that carries something near the carrying posture stays as it is, others are in that posture. It is
        :meth:`whole` if the robot is as it drives.
        """
        tucked = self._tucked()
        if not tucked:
            return self.whole()
        key = self._state(), tuple(self._with(tucked).joints.items()), ()
        state = self._belief.state.with_robot(self._belief.robot, self._with(tucked))
        return self._floors.of(key, lambda: self._floor_of(self._mirror.at(state)))

    def _with(self, joints: dict[str, float]) -> Configuration:
        current = self._world.configuration()
        return Configuration(current.base, {**current.joints, **joints})

    def _tucked(self) -> dict[str, float]:
        """List the positions of arm joints in which the robot would drive, if they differ from those of now."""
        current, named = self._world.configuration().joints, self._robot.postures.get(CARRYING, {})
        grips = [grip.arms for grip in self._belief.held.values()]
        moved: dict[str, float] = {}
        for arm in self._arms:
            torso = None if arm.lift is None else arm.lift.joint
            there = {name: named[name] for name in arm.joints if name in named and name != torso}
            holds = [arms for arms in grips if arm.name in arms]
            if not (any(len(arms) > 1 for arms in holds) or (holds and self._carries(arm, there))):
                moved |= there
        return moved if any(abs(current[name] - value) > ALIKE for name, value in moved.items()) else {}

    def _carries(self, arm: ArmModel, named: dict[str, float]) -> bool:
        """Check whether a hand is near where it is in the carrying posture."""
        current = self._world.configuration().joints
        rows = [[joints[name] for name in arm.joints] for joints in (current, {**current, **named})]
        here, there = arm.chain.fk(np.array(rows))[:, :3, 3]
        return bool(np.abs(here - there).max() <= TUCKED)

    def free(self, floor: Floor, grid: Grid) -> list[Poses]:
        """Compute the free poses of a floor over a grid, for each of :data:`SLACKS`."""
        key = floor, grid
        return self._free.of(key, lambda: poses_for(grid, floor.boxes, floor.silhouette, floor.outlines, SLACKS))

    def has_way(self, base: BasePose) -> bool:
        """Check whether the base can drive to a pose: on a path with at most one turn, else as :meth:`reached` says."""
        return self._goes_straight(base[:2]) or bool(self.reached()(np.array([base]))[0])

    def have_way(self, bases: Array) -> Mask:
        """Check to which of many poses (n, 3) the base can drive, (n,), as :meth:`has_way` says."""
        reached = self.reached()
        good = reached(bases)  # once for all, where a path with one turn is searched for each
        near = ~good  # only there such a path may lead to where the flood does not
        near[near] = reached.around(bases[near, :2], NEAR_ITS_END)
        good[near] = self._go_straight(bases[near, :2])
        return good

    def reached(self) -> Drivable:
        """Compute where the base can surely drive as it drives; it turns only where :data:`SPARE` clearance is left.

        Where it stands it has less at times, with a thing in the hand, say. It got in there, so it is taken to get out.
        """
        return self._flooded(self._reached, self.travelled(), -SPARE)

    def _go_straight(self, ends: Array) -> Mask:
        """Check to which places (n, 2) :meth:`_goes_straight` says that the base can drive, (n,)."""
        floor, start = self.travelled(), np.array(self._world.configuration().base[:2])
        needed = np.where(np.hypot(*(ends - start).T) > NEAR_ITS_END, CELL, 0.0)
        clear = (floor.at(start[None]) >= needed) & (floor.at(ends) >= 0.0)
        clear[clear] = [self._goes_straight((x, y)) for x, y in ends[clear].tolist()]
        return np.asarray(clear)

    def _goes_straight(self, place: tuple[float, float]) -> bool:
        """Check whether the base can turn everywhere on two line segments to a place, for one of a few corners.

        Except near the end, a further cell of clearance is required, so that a flood fill would get there too.
        """
        floor, start, end = self.travelled(), np.array(self._world.configuration().base[:2]), np.array(place)
        line = end - start
        across = np.array([-line[1], line[0]]) / max(float(np.hypot(*line)), CELL)
        corners = ((start + end) / 2 + np.outer(ASIDE, across))[:, None]
        count = math.ceil(2 * (float(np.hypot(*line)) / 2 + max(ASIDE)) / CELL) + 1
        shares = np.linspace(0.0, 1.0, count)[None, :, None]
        paths = np.concatenate([start + shares * (corners - start), corners + shares * (end - corners)], axis=1)

        def are_clear(points: Array) -> Mask:
            clearance = floor.at(points.reshape(-1, 2)).reshape(points.shape[:2])
            before = np.hypot(*np.moveaxis(points - end, 2, 0)) > NEAR_ITS_END
            return np.asarray((clearance >= np.where(before, CELL, 0.0)).all(axis=1))

        for every in SAMPLED:
            paths = paths[are_clear(paths[:, ::every])]
        return len(paths) > 0

    def drivable(self) -> Drivable:
        """Compute where the base may be able to drive from its current pose, as it drives; LACKING clearance may miss.

        Rules nothing out if the base is in collision, or if the map is larger than MOST_FLOOR.
        """
        return self._flooded(self._drivable, self.travelled(), LACKING)

    def comes_near(self, block: Block, within: float) -> bool:
        """Check whether the base can drive to within a distance of a block [m], as :meth:`has_way` says."""
        here = np.array(self._world.configuration().base[:2])
        ends = block.to_map((np.array([block.half_x, block.half_y]) + self._robot.base.radius + CELL) * BESIDE)
        nearest = ends[np.argsort(np.hypot(*(ends - here).T).round(6), kind="stable")]
        if any(map(self._goes_straight, map(tuple, nearest.tolist()))):  # no flood of the whole map is needed
            return True
        reached = self.reached()
        return reached.beyond or bool((block.distance(reached.grid.centres()[reached.poses > 0]) <= within).any())

    def may_reach(self, base: BasePose) -> bool:
        """Check whether the base may be able to drive to a pose with the robot as it is now, as :meth:`drivable`."""
        return bool(self._flooded(self._drivable, self.whole(), LACKING)(np.array([base]))[0])

    def _flooded(self, cache: Kept[Drivable], floor: Floor, slack: float) -> Drivable:
        """Compute the base poses reachable from the current one, with one of the slacks, or look them up."""
        current = self._world.configuration()

        def compute() -> Drivable:
            x_min, y_min, x_max, y_max = floor.bounds
            large = (x_max - x_min) * (y_max - y_min) > MOST_FLOOR
            if large or self._world.contacts(current, ("base",)):
                return Drivable(Grid(0.0, 0.0, 1, 1), np.full((1, 1), EVERY), beyond=True)
            return self._flood(floor, slack)

        return cache.of((floor, current.base), compute)

    def _flood(self, floor: Floor, slack: float) -> Drivable:
        """Compute the base poses reachable from the current one: with clearance, it turns only where that is left.

        Where it stands without any, LACKING may miss within :data:`ESCAPE`, over which base paths leave such places.
        """
        x_min, y_min, x_max, y_max = floor.bounds
        grid = Grid.over((x_min, y_min), (x_max, y_max))
        lacking, free, spare = self.free(floor, grid)
        start = self._world.configuration().base
        if slack > 0.0:
            return drivable(start, grid, lacking)
        found = drivable(start, grid, free, spare)
        if found.poses.any():
            return found
        centres = grid.centres()
        near = np.hypot(centres[..., 0] - start[0], centres[..., 1] - start[1]) <= ESCAPE
        return drivable(start, grid, np.where(near, lacking, free), np.where(near, lacking, spare))

    def closes_way(self, place: Array, within: float, fixed: Collection[str] = ()) -> tuple[str, ...]:
        """Find bodies without which, one at a time, the base could reach more floor ``within`` [m] of a position (2,).

        What drives by itself comes first, as it may leave, then that which closes most. Empty if no body makes a
        difference. Only the bodies nearest to the straight line are tried, none of ``fixed``.
        """
        reachable = self.drivable()
        if reachable.beyond:
            return ()
        base, cells = self._world.configuration().base, reachable.near(place, within)
        boxes, names = self.boxes_but(())
        line = np.linspace(base[:2], place, 20)
        distances = np.linalg.norm(boxes.centres[:, None, :2] - line, axis=2).min(axis=1)
        distances -= boxes.half_extents[:, :2].max(axis=1)
        order = (names[row] for row in np.argsort(distances, kind="stable").tolist())
        nearest = dict.fromkeys(name for name in order if name not in fixed)
        gains = {
            name: self._flood(self._without(name), LACKING).near(place, within) - cells
            for name in list(nearest)[:MOST_REMOVED]
        }
        movers = {one.body for one in self._world.scene.movers}
        closing = [name for name, gain in gains.items() if gain > 0]
        return tuple(sorted(closing, key=lambda name: (name not in movers, -gains[name])))

    def _without(self, body: str) -> Floor:
        """Compute the floor that would be free for the robot as it drives without a body."""
        return replace(self.travelled(), boxes=self.boxes_but((body,))[0])

    def obstacles(self) -> Boxes:
        """List the boxes around the pieces of all bodies that are not held, except the floor."""
        return self.boxes_but(())[0]

    def boxes_but(self, without: Sequence[str]) -> tuple[Boxes, tuple[str, ...]]:
        """List the boxes of :meth:`obstacles` except those of some bodies, and the body of each box."""
        boxes, solids = self._of_bodies()
        if not set(without) & set(solids.bodies):
            return boxes, solids.bodies
        kept = np.flatnonzero([body not in without for body in solids.bodies])
        return boxes.only(kept), tuple(solids.bodies[index] for index in kept)

    def solids(self) -> Solids:
        """List the convex pieces of all bodies that are not held."""
        return self._of_bodies()[1]

    def _of_bodies(self) -> tuple[Boxes, Solids]:
        """Compute the pieces of all bodies that are not held, and boxes around them."""

        def compute() -> tuple[Boxes, Solids]:
            pieces = self._world.solids()
            sizes = np.array([piece.size for piece in pieces]).reshape(-1, 3)
            return Boxes.around([piece.pose for piece in pieces], sizes), Solids.of(pieces)

        return self._bodies.of(self._state(), compute)

    def _posture(self) -> object:
        """Cache key of the robot's joint positions."""
        return tuple(self._world.configuration().joints.items())

    def _state(self) -> object:
        """Cache key of the poses of all bodies, and of what is in a hand."""
        state = self._belief.state
        return state.poses, state.away, state.held
