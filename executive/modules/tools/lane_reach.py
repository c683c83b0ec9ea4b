"""Which parts of lanes over a level surface an arm can wipe, and from which base poses.

A table has postures that hold the tool flat at the height of the surface, by heading and position of the tool in the
base's frame. It is filled outwards from a few postures, so that neighbours on one branch of inverse kinematics are
close to each other; the torso, which is slow, stands still on a branch. All base poses and lanes share the table: a
base pose is judged by looking its waypoints up, then by checks for collisions.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import field
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from executive.belief.scene_collisions import BasePose, SceneCollisions
from executive.locations.grasp_candidates import upright
from executive.modules.platform import Platform
from executive.modules.tools.lanes import LIFTED
from executive.modules.tools.motion_grounding import GroundedMotion, Grounding
from executive.modules.tools.strokes import Plane
from executive.motion import Chain, QuickCheck
from executive.motion.constrained_ends import Ends
from executive.motion.constraint_functions import Bound, ConstraintFunctions
from executive.robots.arms import ArmModel
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import inverse, moved, product, rigid
from planlang.protocols import Configuration
from planlang.records import dataclass

CELL = 0.06
"""Spacing of the table's positions [m]: that of waypoints along a lane."""
HEADINGS = 12
"""Number of headings of the tool in the table."""
TORSOS, RAISED = 3, 13
"""Positions of a torso that lifts the arm, besides the present one, and of those from which they are selected."""
BRANCHES = 2
"""Most branches of inverse kinematics at each of them."""
SEEDS = 8
"""Postures from which to look for the beginning of a branch."""
STARTS = ((0.6, 0.0), (0.75, 0.0), (0.6, 0.8), (0.6, -0.8), (0.45, 0.0))
"""Places of the tool for the first posture: distance from the shoulder, as a share of the reach, and angle [rad]."""
TRIES = 8
"""Guesses of the solver at each of them."""
JUMP = 0.7
"""Largest change of a joint between neighbours on one branch [rad, m]."""
AGAIN = 2
"""Neighbours from which a posture is tried."""
MARGIN = 0.03
"""Least distance of a posture from the limits of joints, as a share of their range: strokes need some room."""
COMFORT = 0.1
"""Difference of that distance from which a posture is preferred."""
TORSO, UNMOVED = 4, 0.01
"""Waypoints that a move of the torso has to gain, and moves that do not count [m]."""
CHOICES = 3
"""Layers of a lane that are checked for collisions."""
AT_ONCE = 256
"""Base poses that are looked up together."""
HIGH = 1000.0
"""Height at which the robot collides with nothing but itself [m]."""
STEPS = ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1))
"""From an entry of the table to its neighbours: in heading, x and y."""

Mask = NDArray[np.bool_]
Index = NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """Consecutive waypoints of a lane that the arm reaches on one branch with the tool at one heading."""

    first: int
    last: int
    postures: Array
    """Joint positions at the waypoints of its stroke, which begins and ends above the surface, (k + 2, d)."""

    def __len__(self) -> int:
        return self.last - self.first + 1


@dataclass(frozen=True, slots=True, eq=False)
class LaneReach:
    """Table of postures over a level surface: s layers, one for each branch and heading, of n x n positions."""

    table: _Table
    torsos: Array
    """Position of the torso in each layer (s,); nan if none lifts the arm."""
    postures: Array
    """Joint positions (s, n, n, d), nan where there are none."""
    ease: Array
    """Distance of the postures from the limits of joints, as a share of their range (s, n, n); -1 for those that
    violate constraints or collide with the robot itself."""
    check: QuickCheck
    """Collisions of the arm from any base pose."""
    touches: Callable[[Array, BasePose], bool]
    """Exact check for collisions of joint positions (d,) from a base pose."""

    # Of many base poses

    def counts(self, bases: Array, lanes: Sequence[Array]) -> Array:
        """Count how many waypoints of lanes (k, 2) in the map one layer reaches from bases (b, 3): (b, l)."""
        points, first, valid = np.concatenate(lanes), np.cumsum([0, *map(len, lanes[:-1])]), self.ease >= MARGIN
        parts = [np.zeros((0, len(lanes)), int)]
        for some in (bases[k : k + AT_ONCE] for k in range(0, len(bases), AT_ONCE)):
            i, j, inside = self._cells(some, points)
            parts.append(np.add.reduceat(valid[:, i, j] & inside, first, axis=2, dtype=int).max(axis=0))
        return np.concatenate(parts)

    def reached(self, bases: Array, lane: Array) -> Mask:
        """Mark the waypoints of a lane (k, 2) in the map that are reached from any of bases (b, 3)."""
        valid, marked = np.asarray((self.ease >= 0.0).any(axis=0)), np.zeros(len(lane), bool)
        for some in (bases[k : k + AT_ONCE] for k in range(0, len(bases), AT_ONCE)):
            i, j, inside = self._cells(some, lane)
            marked |= (valid[i, j] & inside).any(axis=0)
        return marked

    # Of one base pose

    def gain(self, base: BasePose, lanes: Sequence[Array]) -> int:
        """Count the waypoints of lanes (k, 2) in the map that are reached from a base pose by the quick check alone."""
        first, rows, lengths = np.cumsum([0, *map(len, lanes)]), list[Array](), list[tuple[int, int]]()
        i, j, inside = (one[0] for one in self._cells(np.array([base]), np.concatenate(lanes)))
        ease = np.where(inside, self.ease[:, i, j], -1.0)
        for number, (begin, end) in enumerate(pairwise(first.tolist())):
            for layer in _best_first(ease[:, begin:end], np.zeros(len(ease)))[:CHOICES].tolist():
                one, last = _longest(ease[layer, begin:end] >= MARGIN)
                at = begin + np.array([one, (one + last) // 2, last])
                rows.append(self.postures[layer, i[at], j[at]])
                lengths.append((number, last - one + 1))
        if not rows:
            return 0
        link = product(Pose.planar(*base).matrix(), self.table.link)
        hits = self.check.hit(np.broadcast_to(link, (3 * len(rows), 4, 4)), np.concatenate(rows))
        best = np.zeros(len(lanes), int)
        for k, (number, length) in enumerate(lengths):
            if hits[3 * k : 3 * k + 3] == [None] * 3:
                best[number] = max(best[number], length)
        return int(best.sum())

    def runs(self, base: BasePose, lane: Array, now: Array) -> Iterator[Run]:
        """Yield long runs of a lane (k, 2) in the map from a base pose, of few layers.

        All their waypoints pass the quick check for collisions, and the first, the middle one and the last the exact
        one. Long ones come first, if the torso is where it is at joint positions ``now`` (d,), then those far from the
        limits of joints.
        """
        local, (i, j, inside) = (
            _local(np.array([base]), lane)[0],
            (one[0] for one in self._cells(np.array([base]), lane)),
        )
        ease, found = np.where(inside, self.ease[:, i, j], -1.0), []
        link, lift = product(Pose.planar(*base).matrix(), self.table.link), self.table.arm.lift
        moves = np.zeros(len(ease)) if lift is None else np.abs(self.torsos - now[lift.column])
        for layer in _best_first(ease, moves)[:CHOICES].tolist():
            seeds, free = self.postures[layer, i, j], ease[layer] >= MARGIN
            solved = partial(self.table.solved, float(self.torsos[layer]), layer % HEADINGS)
            rows = np.full_like(seeds, np.nan)
            rows[free], free[free] = solved(local[free], seeds[free, None])
            hits = self.check.hit(np.broadcast_to(link, (int(free.sum()), 4, 4)), rows[free])
            free[free] = [hit is None for hit in hits]
            first, last = _longest(free)
            if last >= first:
                above, ok = solved(local[[first, last]], rows[[first, last], None], LIFTED)
                if ok.all():
                    run = Run(first, last, np.vstack([above[:1], rows[first : last + 1], above[1:]]))
                    found.append((_worth(len(run), moves[layer]), run))
        for _, run in sorted(found, key=lambda one: -one[0]):
            ends = run.postures[sorted({1, len(run) // 2 + 1, len(run)})]
            if not any(self.touches(q, base) for q in ends):
                yield run

    def _cells(self, bases: Array, points: Array) -> tuple[Index, Index, Mask]:
        """Find the positions in the table of points (k, 2) from bases (b, 3), and which are in it: (b, k) each."""
        cells = np.rint((_local(bases, points) - self.table.corner) / CELL).astype(np.intp)
        most = self.postures.shape[1] - 1
        inside = ((cells >= 0) & (cells <= most)).all(axis=-1)
        i, j = np.moveaxis(np.clip(cells, 0, most), -1, 0)
        return i, j, inside


def lane_reach(
    platform: Platform, grounding: Grounding, motion: GroundedMotion, plane: Plane, point: Array
) -> LaneReach | None:
    """Fill the table for a tool over a waypoint (4,) of a lane; None if no posture holds it flat at this height."""
    arm, scene = motion.arms[0], platform.scene
    start, check = platform.joints(arm.joints), scene.collisions.arm_check(arm, None, ())
    table = _table(grounding, motion, plane, start, point)
    branches = (
        []
        if table is None
        else [(torso, one) for torso in torso_positions(arm, start, scene.collisions) for one in table.branches(torso)]
    )
    if table is None or not branches:
        return None
    torsos, postures = (
        np.repeat([torso for torso, _ in branches], HEADINGS),
        np.concatenate([one for _, one in branches]),
    )
    now = scene.world.configuration()

    def hits_itself(q: Array) -> bool:
        joints = {**now.joints, **dict(zip(arm.joints, q.tolist(), strict=True))}
        return bool(scene.world.self_contacts(Configuration(now.base, joints)))

    def touches(q: Array, base: BasePose) -> bool:
        return bool(grounding.touching(motion, q, base))

    return LaneReach(table, torsos, postures, table.ease(postures, check, hits_itself), check, touches)


def torso_positions(arm: ArmModel, start: Array, collisions: SceneCollisions) -> list[float]:
    """List positions of the torso [m]: that at joint positions ``start`` (d,), and some over its range; nan without.

    At none of the others the robot's other parts collide with each other, such as the other arm with the base.
    """
    lift = arm.lift
    if lift is None:
        return [math.nan]
    free = collisions.lifted(arm, np.linspace(lift.lowest, lift.highest, RAISED).tolist())
    now, some = float(start[lift.column]), np.linspace(0, len(free) - 1, min(TORSOS, len(free))).round().astype(int)
    return [now, *(free[k] for k in some.tolist() if abs(free[k] - now) > CELL)]


def _table(grounding: Grounding, motion: GroundedMotion, plane: Plane, start: Array, point: Array) -> _Table | None:
    """Make the table for how a first posture holds the tool, with the base where the arm reaches well; None without."""
    arm, tool = motion.arms[0], motion.tools[plane.height.tool.of][1]
    for base in _bases(arm, moved(motion.things[plane.thing], point[None, :3])[0]):
        problem = grounding.problem(motion, base, blocked=False)
        ends = Ends.of(problem, start, [plane.at(point, motion.constraints)])
        link = product(Pose.planar(*base).inverse().matrix(), problem.where.base)
        for q in ends.reached(TRIES):
            hand = product(link, arm.chain.fk(q)[0])
            hand[:2, 3] -= moved(product(hand, tool), np.array([plane.height.tool.position]))[0, :2]
            bounds = [Bound.of(one, problem.where) for one in motion.constraints]
            return _Table(arm, link, hand, ConstraintFunctions(problem.group, bounds))
    return None


def _bases(arm: ArmModel, point: Array) -> Iterator[BasePose]:
    """Yield base poses from which a point (3,) of the map is at the places for the first posture."""
    shoulder = ((arm.shoulder_low + arm.shoulder_high) / 2).tolist()
    for share, angle in STARTS:
        x, y = share * arm.reach * math.cos(angle), share * arm.reach * math.sin(angle)
        yield float(point[0]) - shoulder[0] - x, float(point[1]) - shoulder[1] - y, 0.0


@dataclass(frozen=True, slots=True, eq=False)
class _Table:
    """Positions and headings of the tool for which to compute postures."""

    arm: ArmModel
    link: Array
    """Pose (4, 4) of the arm's base link in the base's frame."""
    hand: Array
    """Pose (4, 4) of the tip at heading 0 with the tool over the middle of the base."""
    functions: ConstraintFunctions
    chains: dict[float, Chain] = field(default_factory=dict)
    """Position of the torso -> the arm with it standing there."""

    @property
    def count(self) -> int:
        """Positions along an axis, n."""
        return 2 * math.ceil(self.arm.reach / CELL) + 1

    @property
    def corner(self) -> Array:
        """Position of the first entry in the base's frame (2,)."""
        return np.asarray((np.rint(self.arm.shoulder_low[:2] / CELL) - self.count // 2) * CELL)

    def branches(self, torso: float) -> Iterator[Array]:
        """Yield branches of postures (h, n, n, d) with the torso at a position, nan where there are none.

        Each begins at a place that those before it do not reach, near where the arm reaches well.
        """
        seeds, open_ = self.arm.seeds[:SEEDS], np.zeros((HEADINGS, self.count, self.count), bool)
        places = self.corner + CELL * np.moveaxis(np.indices(open_.shape[1:]), 0, -1)
        open_[:: HEADINGS // 4] = np.linalg.norm(places - self.arm.shoulder_low[:2], axis=-1) <= self.arm.reach
        for _ in range(BRANCHES):
            entries = np.argwhere(open_)
            q, ok = self.solved(torso, *self._places(entries), np.broadcast_to(seeds, (len(entries), *seeds.shape)))
            if not ok.any():
                return
            well = self.arm.shoulder_low[:2] + np.array([STARTS[0][0] * self.arm.reach, 0.0])
            away = np.linalg.norm(self._places(entries[ok])[1] - well, axis=1).round(6)
            first = np.flatnonzero(ok)[[int(np.argmin(away))]]
            postures = self._branch(torso, entries[first], q[first])
            open_ &= np.isnan(postures[..., 0]).all(axis=0)
            yield postures

    def _branch(self, torso: float, front: Index, seeds: Array) -> Array:
        """Compute the branch outwards from an entry (1, 3) with a posture (1, d)."""
        shape = HEADINGS, self.count, self.count
        postures, tried = np.full((*shape, seeds.shape[1]), np.nan), np.zeros(shape, int)
        while len(front):
            found, ok = self.solved(torso, *self._places(front), seeds[:, None])
            ok &= np.abs(found - seeds).max(axis=1) < JUMP
            postures[tuple(front[ok].T)] = found[ok]
            tried[tuple(front.T)] += 1
            every = (front[ok][:, None] + np.array(STEPS)).reshape(-1, 3)
            every[:, 0] %= HEADINGS
            inside = ((every >= 0) & (every < shape)).all(axis=1)
            parents = np.repeat(found[ok], len(STEPS), axis=0)[inside]
            every, first = np.unique(every[inside], axis=0, return_index=True)
            due = np.isnan(postures[tuple(every.T)][:, 0]) & (tried[tuple(every.T)] < AGAIN)
            front, seeds = every[due], parents[first[due]]
        return postures

    def solved(
        self, torso: float, heading: Index | int, places: Array, seeds: Array, over: float = 0.0
    ) -> tuple[Array, Mask]:
        """Solve for postures (k, d), from seeds (k, s, d) with the torso at a position; which are solved (k,).

        The tool is at headings (k,) and places (k, 2), ``over`` the surface [m].
        """
        lift, at = self.arm.lift, np.column_stack([places, np.full(len(places), over)])
        turns = upright(np.broadcast_to(heading, len(places)) * 2 * math.pi / HEADINGS)
        tips = product(inverse(self.link), rigid(turns, at), self.hand)
        if lift is None:
            return self.arm.chain.solve(tips, seeds)
        if torso not in self.chains:
            self.chains[torso] = self.arm.chain.locked({lift.joint: torso})
        q, ok = self.chains[torso].solve(tips, np.delete(seeds, lift.column, axis=2))
        return np.insert(q, lift.column, torso, axis=1), ok

    def _places(self, entries: Index) -> tuple[Index, Array]:
        """Compute the headings (k,) and places (k, 2) of entries (k, 3)."""
        return entries[:, 0], self.corner + CELL * entries[:, 1:]

    def ease(self, postures: Array, check: QuickCheck, hits_itself: Callable[[Array], bool]) -> Array:
        """Compute the ease (s, n, n) of postures (s, n, n, d), as in :class:`LaneReach`.

        Where the quick check leaves it open whether the robot hits itself, one posture stands for those around it.
        """
        there, chain = ~np.isnan(postures).any(axis=-1), self.arm.chain
        rows, ease = postures[there], np.full(postures.shape[:3], -1.0)
        room = np.minimum(rows - chain.lower, chain.upper - rows) / np.maximum(chain.upper - chain.lower, 1e-9)
        moving = [k for k, name in enumerate(chain.names) if not (self.arm.lift and name == self.arm.lift.joint)]
        least = np.where(chain.continuous, 1.0, room)[:, moving].min(axis=1).clip(0.0)
        high = np.broadcast_to(self.link + HIGH * np.outer(np.eye(4)[2], np.eye(4)[3]), (len(rows), 4, 4))
        hits = np.array([hit is not None for hit in check.hit(high, rows)], bool)
        holds = self.functions.excess(self.functions.all_values(rows)).max(axis=1, initial=0.0) <= 1.0
        ease[there] = np.where(holds & ~hits, least, -1.0)
        sampled = np.zeros_like(there)
        sampled[::2, 1::3, 1::3] = ease[::2, 1::3, 1::3] >= MARGIN
        numbers = np.argwhere(sampled)
        open_ = numbers[~check.clear(high[: len(numbers)], postures[sampled])]
        for layer, i, j in open_.tolist():
            if hits_itself(postures[layer, i, j]):
                ease[layer : layer + 2, i - 1 : i + 2, j - 1 : j + 2] = -1.0
        return ease


def _local(bases: Array, points: Array) -> Array:
    """Transform points (k, 2) of the map into the frames of bases (b, 3): (b, k, 2)."""
    c, s = np.cos(bases[:, 2, None]), np.sin(bases[:, 2, None])
    x, y = (points[:, axis] - bases[:, axis, None] for axis in range(2))
    return np.stack([c * x + s * y, c * y - s * x], axis=-1)


def _best_first(ease: Array, moves: Array) -> Index:
    """Sort layers (s, k) by their longest runs, moves of the torso (s,), and least ease; without those of no run."""
    runs = [_longest(one >= MARGIN) for one in ease]
    lengths = np.array([last - first + 1 for first, last in runs])
    least = [one[first : last + 1].min(initial=1.0) for one, (first, last) in zip(ease, runs, strict=True)]
    order = np.lexsort((-np.floor(np.array(least) / COMFORT), np.round(moves, 2), -_worth(lengths, moves)))
    return np.asarray(order[lengths[order] > 0])


def _worth(lengths: Any, moves: Any) -> Any:
    """Compute the lengths of runs less what moves of the torso [m] cost."""
    return lengths - TORSO * (moves > UNMOVED)


def _longest(free: Mask) -> tuple[int, int]:
    """Find the first and last element of the longest run of True (k,); the last before the first without any."""
    edges = np.diff(np.pad(free, 1).astype(np.int8))
    begins, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1
    if not len(begins):
        return 0, -1
    best = int(np.argmax(ends - begins))
    return int(begins[best]), int(ends[best])
