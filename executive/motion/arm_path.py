"""Paths of an arm: straight in joint space, RRT-Connect with shortcuts, straight lines of the tip.

RRT-Connect: Kuffner and LaValle, ICRA 2000. An exact check is what costs, so every answer is kept, an edge is checked
at its far end first and then by bisection, and branches are long. Checking edges only once they are part of a path
from start to goal saved nothing (cluttered scenes, 8 joints: 135-170 checks in the median either way).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cache
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from executive.motion.errors import GoalInCollision, StartInCollision
from executive.motion.kinematics import InverseKinematics
from planlang.protocols import Array

IsFree = Callable[[Array], bool]
"""Whether a configuration (d,) is free of collision; must not change while a path is planned."""
REACH = 10
"""Length of a new branch, in units of the edge resolution."""


class _OutOfChecks(Exception):
    """The allowance of collision checks is used up."""


@dataclass(slots=True)
class _Space:
    """Collision checks with a memory and an allowance; ``resolution`` (d,) is what an edge may skip."""

    is_free: IsFree
    resolution: Array
    allowance: int
    known: dict[bytes, bool] = field(default_factory=dict)

    def free(self, q: Array) -> bool:
        key = np.rint(q * 1e7).astype(np.int64).tobytes()
        found = self.known.get(key)
        if found is None:
            if len(self.known) >= self.allowance:
                raise _OutOfChecks
            found = self.known[key] = bool(self.is_free(q.copy()))
        return found

    def edge_free(self, a: Array, b: Array) -> bool:
        """Whether the straight way between two free configurations is free."""
        pieces = int(np.ceil((np.abs(b - a) / self.resolution).max() - 1e-9))
        return all(self.free(a + (b - a) * (i / pieces)) for i in _bisection(pieces))

    def length(self, path: list[Array]) -> float:
        return sum(float(np.linalg.norm((b - a) / self.resolution)) for a, b in pairwise(path))


@dataclass(slots=True)
class _Tree:
    """Configurations that hang from a root by free edges."""

    nodes: list[Array]
    parents: list[int] = field(default_factory=lambda: [-1])

    def nearest(self, q: Array, scale: Array) -> int:
        return int(np.argmin((((np.array(self.nodes) - q) / scale) ** 2).sum(axis=1)))

    def way(self, node: int) -> list[Array]:
        """From a node to the root."""
        nodes = [self.nodes[node]]
        while (node := self.parents[node]) >= 0:
            nodes.append(self.nodes[node])
        return nodes


def plan_path(
    start: ArrayLike,
    goal: ArrayLike,
    is_free: IsFree,
    lower: ArrayLike,
    upper: ArrayLike,
    rng: np.random.Generator,
    *,
    resolution: ArrayLike = 0.08,
    iterations: int = 2000,
    checks: int = 6000,
    shortcuts: int = 12,
) -> Array | None:
    """Waypoints (n, d) of a free path, start and goal included, or None when the search is over without one.

    Edges are checked at steps of ``resolution`` ((d,) or scalar, rad or m per joint); ``is_free`` is called at most
    ``checks`` times. Samples are drawn between ``lower`` and ``upper`` (d,), widened to start and goal: bring
    continuous joints near the start first (``Chain.near``). Raises :class:`StartInCollision` or
    :class:`GoalInCollision`.
    """
    a, b = np.array(start, float), np.array(goal, float)
    low, high = np.minimum(np.minimum(a, b), lower), np.maximum(np.maximum(a, b), upper)
    if a.ndim != 1 or a.shape != b.shape or low.shape != a.shape or high.shape != a.shape:
        raise ValueError(f"expected start, goal and limits (d,), got shapes {a.shape}, {b.shape}, {low.shape}")
    steps = np.array(np.broadcast_to(np.asarray(resolution, float), a.shape))
    if not (steps > 0).all() or not (np.isfinite(low) & np.isfinite(high)).all():
        raise ValueError("the resolution must be positive and the limits finite")
    space = _Space(is_free, steps, max(checks, 2))
    if not space.free(a):
        raise StartInCollision(a.tolist())
    if not space.free(b):
        raise GoalInCollision(b.tolist())
    try:
        path = [a, b] if space.edge_free(a, b) else _connect(space, a, b, low, high, rng, iterations)
    except _OutOfChecks:
        return None
    return None if path is None else np.array(_shorten(space, path, rng, shortcuts))


@dataclass(frozen=True, slots=True, eq=False)
class TipLine:
    """A straight line of the tip: its ``waypoints`` (n, d), or None and the ``reason`` why it cannot be followed."""

    waypoints: Array | None
    reason: str = ""


def cartesian_path(
    ik: InverseKinematics,
    start_q: ArrayLike,
    start_pose: ArrayLike,
    goal_pose: ArrayLike,
    is_free: IsFree,
    *,
    steps: int = 9,
    largest_step: float = 0.5,
) -> TipLine:
    """Move the tip straight from one pose (4, 4) to another in the chain's base frame, turning it evenly.

    Each step's solution starts from the last one and may move no joint by more than ``largest_step`` [rad, m]; every
    configuration but ``start_q`` (d,) is checked. The line between two waypoints is straight in joint space.
    """
    q = np.array(start_q, float)
    waypoints = [q]
    for i, pose in enumerate(_between(np.asarray(start_pose, float), np.asarray(goal_pose, float), steps), start=1):
        found = ik.solve_one(pose, q)
        if found is None:
            return TipLine(None, f"the tip does not reach step {i} of {steps}")
        jump = np.abs(found - q)
        if jump.max() > largest_step:
            name = ik.chain.names[int(np.argmax(jump))]
            return TipLine(None, f"{name} would jump by {jump.max():.2f} at step {i} of {steps}")
        if not is_free(found.copy()):
            return TipLine(None, f"in collision at step {i} of {steps}")
        waypoints.append(found)
        q = found
    return TipLine(np.array(waypoints))


def _connect(
    space: _Space, start: Array, goal: Array, lower: Array, upper: Array, rng: np.random.Generator, iterations: int
) -> list[Array] | None:
    """Grow a tree from either end towards random configurations and each other until a path between them is free."""
    here, there = _Tree([start]), _Tree([goal])
    reach = REACH * space.resolution
    for _ in range(iterations):
        target = rng.uniform(lower, upper)
        grown = _grow(space, here, here.nearest(target, reach), target, reach)
        if grown is not None:
            target = here.nodes[grown]
            met: int | None = there.nearest(target, reach)
            while met is not None and there.nodes[met] is not target:
                met = _grow(space, there, met, target, reach)
            if met is not None:
                path = here.way(grown)[::-1] + there.way(met)[1:]
                return path if path[0] is start else path[::-1]
        here, there = there, here
    return None


def _grow(space: _Space, tree: _Tree, node: int, target: Array, reach: Array) -> int | None:
    """Add a branch from a node towards a target, at most as long as reach; None if something is in the way."""
    move = target - tree.nodes[node]
    far = float((np.abs(move) / reach).max())
    end = target if far <= 1 else tree.nodes[node] + move / far
    if not (space.free(end) and space.edge_free(tree.nodes[node], end)):
        return None
    tree.nodes.append(end)
    tree.parents.append(node)
    return len(tree.nodes) - 1


def _shorten(space: _Space, path: list[Array], rng: np.random.Generator, attempts: int) -> list[Array]:
    """Skip waypoints, then replace pieces between random points by straight lines, while checks are left."""
    try:
        path = _skip(space, path)
        for _ in range(attempts if len(path) > 2 else 0):
            marks = np.sort(rng.uniform(0, len(path) - 1, 2))
            (i, u), (k, w) = ((int(mark), float(mark % 1)) for mark in marks)
            if k == i:
                continue
            a, b = path[i] + u * (path[i + 1] - path[i]), path[k] + w * (path[k + 1] - path[k])
            shorter = [*path[: i + 1], a, b, *path[k + 1 :]]
            if space.length([a, b]) < 0.98 * space.length([a, *path[i + 1 : k + 1], b]) and space.edge_free(a, b):
                path = shorter
        return _skip(space, path)
    except _OutOfChecks:
        return path


def _skip(space: _Space, path: list[Array]) -> list[Array]:
    """From each waypoint go on to the farthest one that can be reached straight."""
    kept = [path[0]]
    i = 0
    while i < len(path) - 1:
        i = next(k for k in range(len(path) - 1, i, -1) if k == i + 1 or space.edge_free(path[i], path[k]))
        kept.append(path[i])
    return kept


@cache
def _bisection(pieces: int) -> tuple[int, ...]:
    """The inner points 1 .. pieces - 1 of an edge, middle first, then the middles of what is left."""
    order: list[int] = []
    spans = [(0, pieces)]
    for low, high in spans:
        if high - low > 1:
            middle = (low + high) // 2
            order.append(middle)
            spans += [(low, middle), (middle, high)]
    return tuple(order)


def _between(start: Array, goal: Array, steps: int) -> Iterator[Array]:
    """Poses (4, 4) after the start up to the goal, evenly moved and turned."""
    turn = goal[:3, :3] @ start[:3, :3].T
    values, vectors = np.linalg.eig(turn)
    axis = np.real(vectors[:, int(np.argmin(np.abs(values - 1)))])
    axis = axis / np.linalg.norm(axis)
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    twice = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    angle = float(np.arctan2(axis @ twice / 2, (np.trace(turn) - 1) / 2))
    for i in range(1, steps + 1):
        share = i / steps
        pose = start.copy()
        part = share * angle
        pose[:3, :3] = (np.eye(3) + np.sin(part) * cross + (1 - np.cos(part)) * cross @ cross) @ start[:3, :3]
        pose[:3, 3] += share * (goal[:3, 3] - start[:3, 3])
        if i == steps:
            pose = goal.copy()
        yield pose
