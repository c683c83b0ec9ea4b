"""Base poses: which of some have room for the base and a way to them, cheapest first, and why others have not.

Whoever needs a base pose brings poses, or takes those before what arms work at, and asks its own question of what is
left: whether a hand gets there, what the camera sees, how far a leaf can be led.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from executive.belief.believed_bodies import Block
from executive.belief.floor import CELL, Floor
from executive.belief.planning_scene import PlanningScene
from executive.belief.scene_collisions import BasePose
from executive.locations.looking_once import LookedAt, Numbered
from executive.locations.questions import Question
from executive.locations.rejections import NO_ROOM, NO_WAY, Rejections, first_body
from executive.robots.arms import ArmModel
from planlang.geometry import Array, Pose

SHARES = (0.3, 0.35, 0.4, 0.45, 0.5, 0.55, 0.6, 0.65, 0.7, 0.75, 0.8, 0.85)
"""Distances of a point ahead of the shoulders, as shares of an arm's reach."""
BEST = 0.6
"""The best of these."""
HEADINGS = 24
"""Headings of the base that are tried."""
ASIDE = (0.0, math.radians(45.0), math.radians(-45.0), math.radians(90.0), math.radians(-90.0))
"""Angles from the heading at which the point may lie: into a corner, or along a wall, arms reach sideways."""
SIDEWAYS = 0.2
"""Price of a point at 90 degrees from the heading, beside the distance from the best place [m]."""
FARTHER = 0.3
"""Price of driving one metre farther, beside the distance from the best place [m]."""
LEVEL = 0.3
"""Share of the reach with which is reckoned at least, however far below or above the shoulder points are."""
GRID, TURNS = 0.08, 12
"""Distance of base positions [m], and number of headings, of which it is computed how far points are from there."""
HAIR = 1e-6
"""What rounding takes from these shares."""
MOST = 40
"""Free base poses that are offered."""
ALIKE = 3
"""Free base poses at one distance of the point ahead that are offered before the next ones at any other."""
AROUND = 2.5
"""Distance from a thing within which the nearest floor for the base is looked for [m]."""
AWAY = tuple(share * math.pi for share in (1.0, 0.75, -0.75, 0.5, -0.5, 0.25, -0.25, 0.0))
"""Directions in which the base backs off, relative to a heading [rad]: straight back first."""
MOST_CROWDED = 48
"""Number of promising base poses whose obstacles are named when there is no room."""


class BasePoses:
    """Base poses in the believed world, as it is when they are asked for; ``question`` receives what is refused."""

    def __init__(self, scene: PlanningScene, question: Question | None = None) -> None:
        self.scene, self.question = scene, Question() if question is None else question
        self.crowded: list[tuple[float, Array]] = []
        """Base poses without room, with their worth: :meth:`name_crowding` finds out which bodies take it."""

    @property
    def log(self) -> Rejections:
        """What is refused, and why."""
        return self.question.log

    # Which will do

    def free(self, bases: Array, worth: Array | None = None) -> NDArray[np.bool_]:
        """Tell which of bases (n, 3) have room and a way, (n,); those without room are noted if their worth is given.

        All else that is asked of a base pose takes longer; at what is left, :meth:`has_room` looks exactly.
        """
        free = self.scene.collisions.floor().holds(bases)
        self.log.add(NO_ROOM, int((~free).sum()))
        if worth is not None:
            self.crowded += zip(worth[~free].tolist(), bases[~free], strict=True)
        free[free] = self._driven_to(bases[free])
        return free

    def rooms(self, bases: Numbered) -> LookedAt[bool]:
        """Tell at which bases there is room for the base, each looked at once for a question."""
        floor = self.scene.collisions.floor()
        return LookedAt(bases, self.question.known.rooms, lambda new: floor.holds(new).tolist())

    def have_way(self, bases: Array) -> NDArray[np.bool_]:
        """Tell which of bases (n, 3) the base may drive to, (n,); all as long as none was rejected for that."""
        return self._driven_to(bases) if self.question.known.walled else np.ones(len(bases), bool)

    def _driven_to(self, bases: Array) -> NDArray[np.bool_]:
        good = self.scene.collisions.drivable()(bases)
        self.log.add(NO_WAY, int((~good).sum()))
        return good

    def is_driven_to(self, base: BasePose, score: float) -> bool:
        """Tell whether the base can surely drive to a pose that all else accepts; remember that ways matter if not."""
        if self.scene.collisions.has_way(base):
            return True
        self.question.known.walled = True
        return self.log.reject(base, score, NO_WAY)

    def has_room(self, base: BasePose, score: float = 1.0, moving: frozenset[str] = frozenset()) -> bool:
        """Tell whether the robot as it is, but for parts that are ``moving``, is inside nothing at a base pose."""
        contacts = [one for one in self.scene.collisions.contacts(base) if one.part not in moving]
        if contacts:
            body = first_body(contacts)
            self.log.crowded(body)
            self.log.remember(base, score, NO_ROOM, body)
        return not contacts

    def with_room(self, bases: Iterable[Array], moving: frozenset[str] = frozenset()) -> Iterator[BasePose]:
        """Yield bases (3,) at which :meth:`has_room` holds, in their order, each looked at when it is asked for."""
        for x, y, yaw in map(np.ndarray.tolist, bases):
            if self.has_room((x, y, yaw), moving=moving):
                yield x, y, yaw

    def name_crowding(self) -> None:
        """Count which bodies take the room of the base poses that were noted; of the best of them."""
        for score, place in sorted(self.crowded, key=lambda one: -round(one[0], 6))[:MOST_CROWDED]:
            base = (float(place[0]), float(place[1]), math.remainder(float(place[2]), 2 * math.pi))
            body = first_body(contacts) if (contacts := self.scene.collisions.contacts(base)) else None
            if body is not None:
                self.log.blocking[body] += 1
            self.log.remember(base, score, NO_ROOM, body)

    # Where from

    def before(
        self, points: Array, arms: Sequence[ArmModel], headings: Array | None = None, *, arms_first: bool = False
    ) -> Iterator[BasePose]:
        """Yield free base poses about a point (2,), or points (k, 2), of the map: near and at a good distance first.

        The point at the worst distance counts: a row of points is in reach from its side, not from its end. Of points
        (k, 3) the height counts, too: far below or above the shoulder, less of the reach is left. Poses from which a
        point is nearer or farther than all of :data:`SHARES` come last: arms seldom get to it, which takes long to find
        out. ``headings`` (h,) are those of the base that are tried [rad]: by default many, all around. ``arms_first``:
        the arms take another posture before the base goes there: it does not matter what they would touch as they are.
        """
        now = np.array(self.scene.base())
        shoulder, reach = _shoulder(arms)
        points = np.atleast_2d(points)
        if points.shape[1] == 3:
            points, reach = points[:, :2], _level_reach(arms, points[:, 2], reach)
        around = now[2] + np.linspace(-np.pi, np.pi, HEADINGS, endpoint=False)
        yaws = around if headings is None else np.remainder(headings + np.pi, 2 * np.pi) - np.pi
        ahead, turned, aside = (grid.ravel() for grid in np.meshgrid(np.array(SHARES), yaws, np.array(ASIDE)))
        x, y = shoulder[0] + reach * ahead * np.cos(aside), shoulder[1] + reach * ahead * np.sin(aside)
        c, s = np.cos(turned), np.sin(turned)
        middle = points.mean(axis=0)
        bases = np.stack([middle[0] - c * x + s * y, middle[1] - s * x - c * y, turned], axis=1)
        shoulders = middle - reach * ahead[:, None] * np.stack([np.cos(turned + aside), np.sin(turned + aside)], axis=1)
        away = np.linalg.norm(points - shoulders[:, None], axis=2)
        price = np.abs(away - BEST * reach).max(axis=1) + FARTHER * np.linalg.norm(bases[:, :2] - now[:2], axis=1)
        price = (price + SIDEWAYS * np.abs(aside) / (np.pi / 2)).round(9)  # noise of the last bits decides nothing
        doubtful = (away.min(axis=1) < (SHARES[0] - HAIR) * reach) | (away.max(axis=1) > (SHARES[-1] + HAIR) * reach)
        free = self.free(bases)
        order = np.lexsort((price, _turn(ahead, price, free), doubtful))
        moving = self._parts(arms) if arms_first else frozenset[str]()
        offered = self.with_room(bases[order[free[order]]], moving)
        yield from (base for _, base in zip(range(MOST), offered, strict=False))

    def _parts(self, arms: Sequence[ArmModel]) -> frozenset[str]:
        """Return the links of arms, and what they hold."""
        names = {arm.name for arm in arms}
        held = (name for name, grip in self.scene.belief.held.items() if names & set(grip.arms))
        return frozenset(held).union(*({*arm.solver.chain.carriers, *arm.hand_links} for arm in arms))

    def is_at_ease(self, point: Array, arms: Sequence[ArmModel]) -> bool:
        """Tell whether arms reach a point (2,) of the map from where the base is with some reach to spare."""
        shoulder, reach = _shoulder(arms)
        there = Pose.planar(*self.scene.base()).inverse() @ Pose((float(point[0]), float(point[1]), 0.0))
        return math.dist(there.position[:2], shoulder) <= SHARES[-1] * reach

    def distances(self, rows: Sequence[Array], arms: Sequence[ArmModel]) -> list[float]:
        """Compute how near arms get to rows of points (k, 2) of the map, from the best free base pose for each [m].

        The distance of a row is that of its farthest point from the shoulders, inf if there is no such base pose.
        """
        shoulder, reach = _shoulder(arms)
        every, far = np.concatenate(rows), reach + float(np.linalg.norm(shoulder))
        spans = (np.arange(low - far, high + far, GRID) for low, high in zip(every.min(0), every.max(0), strict=True))
        turns = np.linspace(-np.pi, np.pi, TURNS, endpoint=False)
        bases = np.stack(np.meshgrid(*spans, turns), axis=-1).reshape(-1, 3)
        bases = bases[self._driven_to(bases)]  # takes less than room, of which there are many to look at here
        bases = bases[self.free(bases)]
        c, s = np.cos(bases[:, 2:]), np.sin(bases[:, 2:])
        shoulders = bases[:, :2] + c * shoulder + s * [-shoulder[1], shoulder[0]]
        away = (np.linalg.norm(shoulders[:, None] - row, axis=2).max(axis=1) for row in rows)
        return [float(one.min(initial=math.inf)) for one in away]

    def all_over(self, spacing: float) -> Array:
        """Return places (n, 2) [m] all over the map where the base has room to turn and to which it can drive."""
        floor = self.scene.collisions.floor()
        x_min, y_min, x_max, y_max = floor.bounds
        xs, ys = (np.arange(low + spacing / 2, high, spacing) for low, high in ((x_min, x_max), (y_min, y_max)))
        points = np.stack(np.meshgrid(xs, ys), axis=-1).reshape(-1, 2)
        points = points[floor.at(points) > 0.0]
        return points[self._driven_to(np.column_stack([points, np.zeros(len(points))]))]

    def beside(self, heading: float, distances: Sequence[float]) -> Iterator[BasePose]:
        """Yield base poses at distances from here [m], turned as it is: at each those opposite of a heading first."""
        x, y, yaw = self.scene.base()
        for away in distances:
            for turn in AWAY:
                yield x + away * math.cos(heading + turn), y + away * math.sin(heading + turn), yaw


def floor_near(block: Block, floor: Floor) -> Array:
    """Return places (n, 2) about a body where the base somehow has room to stand, whether or not it gets there."""
    steps = np.arange(-AROUND, AROUND, CELL)
    points = np.stack(np.meshgrid(block.x + steps, block.y + steps), axis=-1).reshape(-1, 2)
    return points[floor.fits(points)]


def _shoulder(arms: Sequence[ArmModel]) -> tuple[Array, float]:
    """Return where shoulders are in the base's frame, on the floor (2,), and the reach of the shortest arm [m]."""
    middle = np.mean([(arm.shoulder_low + arm.shoulder_high)[:2] / 2 for arm in arms], axis=0)
    return middle, min(arm.reach for arm in arms)


def _level_reach(arms: Sequence[ArmModel], heights: Array, reach: float) -> float:
    """Return how much of a reach is left horizontally at the worst of heights (k,) above the floor [m]."""
    low = float(np.mean([arm.shoulder_low[2] for arm in arms]))
    high = float(np.mean([arm.shoulder_high[2] for arm in arms]))
    away = float(np.maximum(low - heights, heights - high).max())
    return math.sqrt(max(reach**2 - max(away, 0.0) ** 2, (LEVEL * reach) ** 2))


def _turn(ahead: Array, price: Array, free: NDArray[np.bool_]) -> Array:
    """Return how many times ``ALIKE`` cheaper free base poses there are at the same distance (n,).

    How far an arm reaches depends on how the hand has to be: there are more poses at the best distance than are tried.
    """
    turn = np.zeros(len(ahead), int)
    for share in SHARES:
        rows = np.flatnonzero(free & (ahead == share))
        turn[rows[np.argsort(price[rows], kind="stable")]] = np.arange(len(rows)) // ALIKE
    return turn
