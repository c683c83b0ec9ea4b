"""Where else to stand: base poses for work at a place, with room for the arms, or a little aside.

Each source yields free base poses lazily, best first; which of them serve is for the caller to find out. Whoever wants
the robot to stand elsewhere, be it a search for a location or the module of a skill, takes base poses from here.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from executive.belief.planning_scene import PlanningScene
from executive.belief.scene_collisions import BasePose
from executive.locations.base_poses import BasePoses
from executive.motion.base_path import poses_along
from executive.robots.arms import ArmModel
from planlang.geometry import Array, Pose, matrices

SHARES = (0.3, 0.35, 0.4, 0.45, 0.5, 0.55, 0.6, 0.65, 0.7, 0.75, 0.8, 0.85)
"""Distances of a point ahead of the shoulders, as shares of an arm's reach."""
BEST = 0.6
"""The best of these."""
HEADINGS = 24
"""Number of headings of the base to try."""
ASIDE = (0.0, math.radians(45.0), math.radians(-45.0), math.radians(90.0), math.radians(-90.0))
"""Angles of the point from the heading: arms reach sideways into a corner, or along a wall."""
SIDEWAYS = 0.2
"""Cost of a point at 90 degrees from the heading, in terms of distance from the best place [m]."""
FARTHER = 0.3
"""Cost of driving one metre, in the same terms [m]."""
LEVEL = 0.3
"""Smallest share of the reach to assume horizontally, however far above or below the shoulder points are."""
GRID, TURNS = 0.08, 12
"""Spacing of base positions [m], and number of headings, for computing distances."""
HAIR = 1e-6
"""Tolerance of shares and distances for rounding."""
MOST = 40
"""Number of free base poses to offer."""
ALIKE = 3
"""Free base poses at one distance of the point ahead before those at other distances follow."""
BACK_OFF = (0.1, 0.2, 0.3, 0.45, 0.6)
"""Distances at which to search for room for postures of the arms [m]; short, so that the base stays near its work."""
FARTHER_OFF = (0.8, 1.0, 1.3)
"""The same where there is none so near [m]: between two pieces of furniture no step aside gives an elbow its room."""
TURNED_BY = tuple(share * math.pi for share in (0.0, 0.25, -0.25, 0.5, -0.5, 0.75, -0.75, 1.0))
"""Turns of the base with which it is searched for there [rad]."""
AWAY = tuple(share * math.pi for share in (1.0, 0.75, -0.75, 0.5, -0.5, 0.25, -0.25, 0.0))
"""Directions in which the base backs off, relative to a heading [rad]: straight back first."""
APPROACH = 0.5
"""Least horizontal component of a hand's unit approach direction that defines a heading."""
STRIDE = 0.025
"""Spacing of checks on a straight motion of the base [m]."""
SPACING, COARSER, TURNED = 0.1, 2, 16
"""Lattice of base poses around a path of the hand: spacing [m], stride of the coarse poses, which come first, headings.
"""
NEAREST = 0.3
"""Least distance of the base from that path's start [m]."""


class Standing:
    """Sources of base poses in the world as believed at the time of the call; ``poses`` tests them."""

    def __init__(self, scene: PlanningScene) -> None:
        self.scene, self.poses = scene, BasePoses(scene)

    def before(
        self, points: Array, arms: Sequence[ArmModel], headings: Array | None = None, *, arms_first: bool = False
    ) -> Iterator[BasePose]:
        """Yield free base poses around a point (2,), or points (k, 2), of the map: near and at a good distance first.

        Of several points the one at the worst distance counts: a row of points is reached from its side, not from its
        end. Of points (k, 3) the height counts as well: far from the shoulder's height less reach is left. Poses from
        which a point is nearer or farther than all of :data:`SHARES` come last: arms seldom reach it, and take long to
        find that out. ``headings`` (h,) are those of the base to try [rad], by default all around. ``arms_first``: the
        arms change their posture before the base goes there, so that their present collisions do not matter.
        """
        now = np.array(self.scene.base())
        shoulder, reach = _shoulder(arms)
        points = np.atleast_2d(points)
        if points.shape[1] == 3:
            points, reach = points[:, :2], _level_reach(arms, points[:, 2], reach)
        around = now[2] + np.linspace(-np.pi, np.pi, HEADINGS, endpoint=False)
        yaws = around if headings is None else np.remainder(headings + np.pi, 2 * np.pi) - np.pi
        share, turned, aside = (grid.ravel() for grid in np.meshgrid(np.array(SHARES), yaws, np.array(ASIDE)))
        # In the base's frame the point lies on an arc about the shoulder: at (x, y), a share of the reach away and
        # turned aside. A base with yaw t has it at its own position + Rz(t) (x, y); solved for that position, with the
        # middle of the points for the point, this is where the base has to stand.
        x, y = shoulder[0] + reach * share * np.cos(aside), shoulder[1] + reach * share * np.sin(aside)
        c, s = np.cos(turned), np.sin(turned)
        middle = points.mean(axis=0)
        bases = np.stack([middle[0] - c * x + s * y, middle[1] - s * x - c * y, turned], axis=1)
        shoulders = middle - reach * share[:, None] * np.stack([np.cos(turned + aside), np.sin(turned + aside)], axis=1)
        distances = np.linalg.norm(points - shoulders[:, None], axis=2)
        cost = np.abs(distances - BEST * reach).max(axis=1) + FARTHER * np.linalg.norm(bases[:, :2] - now[:2], axis=1)
        # rounded, so that ties do not depend on the processor
        cost = (cost + SIDEWAYS * np.abs(aside) / (np.pi / 2)).round(9)
        near, far = distances.min(axis=1), distances.max(axis=1)
        # Searches stop after some tens of base poses. Sorted by cost alone these would all be neighbours at the best
        # share, and fail alike where just that share does not suit the hand's pose; so the shares take turns.
        doubtful = (near < (SHARES[0] - HAIR) * reach) | (far > (SHARES[-1] + HAIR) * reach)
        free = self.poses.free(bases)
        order = np.lexsort((cost, _turn(share, cost, free), doubtful))
        moving = self._parts(arms) if arms_first else frozenset[str]()
        offered = self.poses.with_room(bases[order[free[order]]], moving)
        yield from (base for _, base in zip(range(MOST), offered, strict=False))

    def with_thing_at(self, poses: Sequence[Pose], place: Pose) -> Iterator[BasePose]:
        """Yield free base poses at which a thing with one of ``poses`` in the base's frame is at a place of the map."""
        bases = [Pose.planar(*place.position[:2], place.yaw) @ pose.inverse() for pose in poses]
        rows = np.array([(*base.position[:2], base.yaw) for base in bases])
        return self.poses.with_room(rows[self.poses.free(rows)])

    def lattice(self, arm: ArmModel, tips: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Sample base poses (m, 3) around a path (n, 3) of a hand, the current one first; mark the coarse ones (m,).

        They are not tested: whoever follows the path from many base poses at once has cheaper tests than that for room.
        """
        here = np.array([self.scene.base()])
        if self.scene.robot.base.fixed:
            return here, np.ones(1, bool)
        middle = tips.mean(axis=0)
        shoulder = float(np.hypot(*arm.shoulder_low[:2]))
        count = math.ceil((arm.reach + shoulder + np.hypot(*(tips - middle)[:, :2].T).max()) / SPACING)
        cells, turns = np.arange(-count, count + 1), np.arange(TURNED)
        i, j, k = (grid.ravel() for grid in np.meshgrid(cells, cells, turns, indexing="ij"))
        bases = np.column_stack([middle[0] + SPACING * i, middle[1] + SPACING * j, k * 2 * math.pi / TURNED])
        coarse = (i % COARSER == 0) & (j % COARSER == 0) & (k % COARSER == 0)
        apart = np.hypot(*(bases[:, :2] - tips[0, :2]).T) > NEAREST
        bases[:, 2] = np.remainder(bases[:, 2] + math.pi, 2 * math.pi) - math.pi
        return np.concatenate([here, bases[apart]]), np.concatenate([[True], coarse[apart]])

    def _parts(self, arms: Sequence[ArmModel]) -> frozenset[str]:
        """List the links of arms, and what they hold."""
        names = {arm.name for arm in arms}
        held = (name for name, grip in self.scene.belief.held.items() if names & set(grip.arms))
        return frozenset(held).union(*({*arm.chain.carriers, *arm.hand_links} for arm in arms))

    def is_at_ease(self, point: Array, arms: Sequence[ArmModel]) -> bool:
        """Check whether arms reach a point (2,) of the map from here, with reach to spare."""
        shoulder, reach = _shoulder(arms)
        there = Pose.planar(*self.scene.base()).inverse() @ Pose((float(point[0]), float(point[1]), 0.0))
        return math.dist(there.position[:2], shoulder) <= SHARES[-1] * reach

    def distances(self, rows: Sequence[Array], arms: Sequence[ArmModel]) -> list[float]:
        """Compute how close arms get to rows of points (k, 2) of the map, from the best free base pose for each [m].

        The distance of a row is that of its farthest point from the shoulders, inf without such a base pose.
        """
        shoulder, reach = _shoulder(arms)
        every, span = np.concatenate(rows), reach + float(np.linalg.norm(shoulder))
        spans = (np.arange(low - span, high + span, GRID) for low, high in zip(every.min(0), every.max(0), strict=True))
        turns = np.linspace(-np.pi, np.pi, TURNS, endpoint=False)
        bases = np.stack(np.meshgrid(*spans, turns), axis=-1).reshape(-1, 3)
        bases = bases[self.poses.driven_to(bases)]  # cheaper than the test for room, and there are many
        bases = bases[self.poses.free(bases)]
        c, s = np.cos(bases[:, 2:]), np.sin(bases[:, 2:])
        shoulders = bases[:, :2] + c * shoulder + s * [-shoulder[1], shoulder[0]]
        distances = (np.linalg.norm(shoulders[:, None] - row, axis=2).max(axis=1) for row in rows)
        return [float(one.min(initial=math.inf)) for one in distances]

    def all_over(self, spacing: float) -> Array:
        """Sample places (n, 2) [m] all over the map where the base can turn, and to which it can drive."""
        floor = self.scene.collisions.floor()
        x_min, y_min, x_max, y_max = floor.bounds
        xs, ys = (np.arange(low + spacing / 2, high, spacing) for low, high in ((x_min, x_max), (y_min, y_max)))
        points = np.stack(np.meshgrid(xs, ys), axis=-1).reshape(-1, 2)
        points = points[floor.at(points) > 0.0]
        return points[self.poses.driven_to(np.column_stack([points, np.zeros(len(points))]))]

    def beside(self, heading: float, distances: Sequence[float]) -> Iterator[BasePose]:
        """Yield base poses at distances from here [m] with the same yaw: at each those opposite to a heading first."""
        x, y, yaw = self.scene.base()
        for away in distances:
            for turn in AWAY:
                yield x + away * math.cos(heading + turn), y + away * math.sin(heading + turn), yaw

    def with_room_for(self, postures: Sequence[tuple[ArmModel, Array]], least: float = 0.0) -> BasePose | None:
        """Find the nearest base pose at which arms are free in the given postures (d,); None if there is none.

        The pose is at least ``least`` [m] away. Straight motions with the arms as they are come first, and of these the
        ones opposite to the first hand's approach: a hand leaves a cabinet or a handle the way it came. Poses that are
        turned, or farther away, come last.
        """
        here, indirect = self.scene.base(), None
        heading = here[2]
        if postures:  # a vertical approach has no heading
            tip, approach = self.scene.arms.tip(postures[0][0]), np.asarray(postures[0][0].frame.approach)
            x, y, _ = matrices.rotated(tip[:3, :3], approach).tolist()
            heading = math.atan2(y, x) if math.hypot(x, y) > APPROACH else heading

        def is_free(pose: BasePose) -> bool:
            if math.dist(pose[:2], here[:2]) < least - HAIR or (pose != here and not self.poses.has_room(pose)):
                return False
            return not any(self.scene.collisions.contacts(pose, arm, posture) for arm, posture in postures)

        if self.scene.robot.base.fixed:
            return here if is_free(here) else None
        # A base that turns sweeps the arms through what they have just worked at, so a straight way with the arms as
        # they are goes before a shorter way around, which the planner of paths may or may not find.
        for pose in filter(is_free, chain((here,), self.beside(heading, BACK_OFF))):
            if all(map(self.poses.has_room, poses_along(np.array([here, pose]), STRIDE + HAIR))):
                return pose
            indirect = indirect or pose
        return indirect or next(filter(is_free, self._farther(heading)), None)

    def _farther(self, heading: float) -> Iterator[BasePose]:
        """Yield base poses with a way from here, turned or farther away than those straight beside: nearest first."""
        every = [
            (x, y, yaw + turn)
            for away in (*BACK_OFF, *FARTHER_OFF)
            for turn in TURNED_BY
            if turn or away in FARTHER_OFF
            for x, y, yaw in self.beside(heading, (away,))
        ]
        rows = np.array(every)
        yield from (every[row] for row in np.flatnonzero(self.poses.free(rows)).tolist())


def _shoulder(arms: Sequence[ArmModel]) -> tuple[Array, float]:
    """Mean position of the shoulders in the base's frame, on the floor (2,), and the shortest arm's reach [m]."""
    middle = np.mean([(arm.shoulder_low + arm.shoulder_high)[:2] / 2 for arm in arms], axis=0)
    return middle, min(arm.reach for arm in arms)


def _level_reach(arms: Sequence[ArmModel], heights: Array, reach: float) -> float:
    """Horizontal reach left at the worst of heights (k,) above the floor [m]."""
    low = float(np.mean([arm.shoulder_low[2] for arm in arms]))
    high = float(np.mean([arm.shoulder_high[2] for arm in arms]))
    away = float(np.maximum(low - heights, heights - high).max())
    return math.sqrt(max(reach**2 - max(away, 0.0) ** 2, (LEVEL * reach) ** 2))


def _turn(ahead: Array, price: Array, free: NDArray[np.bool_]) -> Array:
    """Number each base pose in blocks of ``ALIKE`` by cost among the free ones at the same distance (n,).

    The distance that suits an arm depends on the hand's pose: there are more poses at the best distance than are tried.
    """
    turn = np.zeros(len(ahead), int)
    for share in SHARES:
        rows = np.flatnonzero(free & (ahead == share))
        turn[rows[np.argsort(price[rows], kind="stable")]] = np.arange(len(rows)) // ALIKE
    return turn
