"""Arm paths: RRT-Connect with edges checked by spheres, and lazy exact checks of the paths found.

RRT-Connect: Kuffner and LaValle, ICRA 2000; lazy checking: Bohlin and Kavraki, ICRA 2000. Where the exact check finds a
collision on a path, its neighbourhood is forbidden, the quick check learns to keep the two bodies farther apart, the
trees drop affected edges, and the search continues. After :data:`HITS` of them the trees are discarded and every edge
is checked exactly: then the path is as good as a plain search's. Continuous joints go the shorter way around, also in
the trees; a path may end whole turns away from the goal.

A path under a constraint, such as keeping a held object upright, grows by shorter branches whose ends are projected
onto the constraint (Berenson et al., ICRA 2009); a straight edge that violates it is replaced by its projection.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import field
from functools import cache
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from executive.motion.errors import Effort, GoalInCollision, NoPath, OutOfEffort, OutsideLimits, StartInCollision
from planlang.geometry import Array
from planlang.records import dataclass

Touching = Callable[[Array, Sequence[tuple[str, str]] | None], Sequence[tuple[str, str]]]
"""Exact, slow check: which pairs of bodies collide at a configuration (d,).

The second argument holds the candidate pairs, None if they are unknown."""
AT_FIRST, GROWTH = 1, 4
"""Configurations of a path in the first batch of exact checks, where most hits are, and growth of the batches."""
REACH = 10
"""Length of a new branch, in units of the edge resolution."""
HITS = 0.04
"""Exact collisions, as a share of the allowed iterations, after which spheres are no longer used."""
KEPT_APART = (0.015, 0.0)
"""Clearances to try, in order, where start and goal allow them [m]."""
EXACT_CHECKS = 3.0
"""Exact checks allowed per iteration once spheres are no longer used."""
CHECKS = 35
"""Budget per iteration: checks of straight edges, and exact checks of configurations."""
CONSTRAINED = 0.3
"""Length of a branch under a constraint, as a share of the usual one."""
LEAST_PROGRESS = 0.2
"""Share of its length by which such a branch has to approach its target."""
LARGEST_JUMP = 3.0
"""Greatest distance between neighbouring points of an edge after projection, in units of that before."""
SHORTCUTS = 40
"""Attempts to shorten a path."""
FORBIDDEN = 0.5
"""Largest distance that paths keep from an exact collision, in units of the edge resolution."""


@dataclass(frozen=True, slots=True, eq=False)
class JointSpace:
    """Joint space of an arm: limits (d,), mask of continuous joints (d,), and ``resolution`` (d,) of checks."""

    lower: Array
    upper: Array
    continuous: NDArray[np.bool_]
    resolution: Array

    @staticmethod
    def of(
        lower: ArrayLike, upper: ArrayLike, *, continuous: ArrayLike = False, resolution: ArrayLike = 0.08
    ) -> JointSpace:
        """Create a space; raises ValueError if the resolution is not positive or the limits are not finite."""
        low, high = np.asarray(lower, float), np.asarray(upper, float)
        turning = np.array(np.broadcast_to(np.asarray(continuous, bool), low.shape))
        steps = np.array(np.broadcast_to(np.asarray(resolution, float), low.shape))
        if low.ndim != 1 or low.shape != high.shape:
            raise ValueError(f"expected limits (d,), got shapes {low.shape}, {high.shape}")
        if not (steps > 0).all() or not (np.isfinite(low) & np.isfinite(high) | turning).all():
            raise ValueError("the resolution must be positive and the limits finite")
        return JointSpace(np.where(turning, -np.pi, low), np.where(turning, np.pi, high), turning, steps)

    def move(self, start: Array, end: Array) -> Array:
        """Compute the difference between configurations (..., d), the shorter way around."""
        move = end - start
        return np.asarray(move - np.where(self.continuous, 2 * np.pi * np.rint(move / (2 * np.pi)), 0.0))

    def unwound(self, path: Sequence[Array]) -> list[Array]:
        """Shift waypoints by whole turns, each the shorter way around from the one before."""
        rows = [path[0]]
        for q in path[1:]:
            move = q - rows[-1]
            rows.append(q if (np.abs(move[self.continuous]) <= np.pi).all() else rows[-1] + self.move(rows[-1], q))
        return rows

    def pieces(self, start: Array, end: Array) -> int:
        """Number of pieces into which an edge is divided for checks."""
        return max(1, int(np.ceil((np.abs(end - start) / self.resolution).max() - 1e-9)))

    def length(self, path: Sequence[Array]) -> float:
        """Length of a path, in units of the resolution."""
        return sum(float(np.linalg.norm((b - a) / self.resolution)) for a, b in pairwise(path))

    def points(self, path: Array) -> Array:
        """Interpolate waypoints (n, d) to configurations (m, d) at most the resolution apart, without the start."""
        parts = []
        for a, b in pairwise(path):
            count = self.pieces(a, b)
            parts.append(a + (b - a) * (np.arange(1, count + 1) / count)[:, None])
        return np.concatenate(parts) if parts else path[:0]


class Quick(Protocol):
    """Fast, approximate collision check: :class:`executive.motion.collision.QuickCheck`."""

    def free(self, q: Array) -> NDArray[np.bool_]:
        """Check which configurations (n, d) are free as far as known."""

    def doubtful(self, q: Array) -> Sequence[Sequence[tuple[str, str]] | None]:
        """List the pairs that may touch at each configuration (n, d); None where they are unknown."""

    def keep(self, distance: float, ends: Sequence[Array]) -> None:
        """Keep this clearance [m] where the collision-free ends (d,) allow it; forget what was learnt."""

    def learn(self, q: Array, pairs: Sequence[tuple[str, str]]) -> None:
        """Learn from the exact check that pairs touch at a configuration (d,)."""


class Constraint(Protocol):
    """Constraint on a whole path: :class:`executive.motion.upright.Upright`."""

    def holds(self, q: Array) -> NDArray[np.bool_]:
        """Check at which configurations (n, d) it holds."""

    def projected(self, q: Array) -> Array:
        """Project configurations (n, d) to nearby ones where it holds, if possible; valid ones stay."""


@cache
def bisection(pieces: int) -> NDArray[np.int32]:
    """Order the inner points 1 .. pieces - 1 of an edge, middle first, then the middles of the halves and so on."""
    order: list[int] = []
    spans = [(0, pieces)]
    for low, high in spans:
        if high - low > 1:
            middle = (low + high) // 2
            order.append(middle)
            spans += [(low, middle), (middle, high)]
    result = np.array(order, np.int32)
    result.flags.writeable = False
    return result


class _Rows:
    """Growing array (n, d) of configurations."""

    def __init__(self, dof: int) -> None:
        self._room = np.empty((64, dof))
        self._count = 0

    def append(self, q: Array) -> None:
        if self._count == len(self._room):
            self._room = np.concatenate([self._room, np.empty_like(self._room)])
        self._room[self._count] = q
        self._count += 1

    @property
    def filled(self) -> Array:
        return self._room[: self._count]


class _Tree:
    """Configurations connected to roots by free edges; parents come before their children."""

    def __init__(self, *roots: Array) -> None:
        self.nodes: list[Array] = []
        self.parents: list[int] = []
        self._rows = _Rows(len(roots[0]))
        for root in roots:
            self.add(root, -1)

    def add(self, q: Array, parent: int) -> None:
        self.nodes.append(q)
        self.parents.append(parent)
        self._rows.append(q)

    def nearest(self, q: Array, space: JointSpace) -> int:
        return int(np.argmin(((space.move(self._rows.filled, q) / space.resolution) ** 2).sum(axis=1)))

    def path_from(self, node: int) -> list[Array]:
        """List the configurations from a node to its root."""
        nodes = [self.nodes[node]]
        while (node := self.parents[node]) >= 0:
            nodes.append(self.nodes[node])
        return nodes

    def pruned(self, free: Callable[[Array, Array], bool]) -> _Tree:
        """Copy the tree without edges that are no longer free, and the branches behind them."""
        roots = self.parents.count(-1)
        new_index, tree = dict(zip(range(roots), range(roots), strict=True)), _Tree(*self.nodes[:roots])
        for number in range(roots, len(self.nodes)):
            parent = new_index.get(self.parents[number])
            if parent is not None and free(tree.nodes[parent], self.nodes[number]):
                new_index[number] = len(tree.nodes)
                tree.add(self.nodes[number], parent)
        return tree


@dataclass(slots=True)
class _Search:
    """State of the search for one path."""

    space: JointSpace
    quick: Quick
    touching: Touching
    moments: Callable[[Array], Array]
    rng: np.random.Generator
    effort: Effort
    constraint: Constraint | None = None
    exactly: bool = False
    """True if edges are checked exactly at once."""
    known: dict[bytes, Sequence[tuple[str, str]]] = field(default_factory=dict)
    forbidden: _Rows = field(init=False)
    radii: list[float] = field(default_factory=list)
    """Distance that an edge must keep from each forbidden configuration, in units of the edge resolution."""
    counts: dict[str, int] = field(default_factory=lambda: {"branches": 0, "exact checks": 0, "exact hits": 0})

    def __post_init__(self) -> None:
        self.forbidden = _Rows(len(self.space.resolution))

    def pairs(self, q: Array, among: Sequence[tuple[str, str]] | None = None) -> Sequence[tuple[str, str]]:
        """Find the pairs in exact collision at a configuration, from the candidates ``among``; results are cached."""
        key = np.rint(q * 1e9).astype(np.int64).tobytes()
        colliding = self.known.get(key)
        if colliding is None:
            self.counts["exact checks"] += 1
            self.effort.spend(1)
            colliding = self.known[key] = tuple(self.touching(q.copy(), among))
        return colliding

    def hit(self, rows: Array) -> Array | None:
        """Find the first of configurations (n, d) in exact collision; None if all are free."""
        first, size = 0, AT_FIRST
        while first < len(rows):
            batch = rows[first : first + size]
            for row, among in zip(batch, self.quick.doubtful(batch), strict=True):
                if (among is None or among) and self.pairs(row, among):
                    return np.asarray(row)
            first, size = first + size, GROWTH * size
        return None

    def edge_free(self, a: Array, b: Array, *ends: Array) -> bool:
        """Check whether the straight edge between two configurations is free as far as known, and ``ends`` with it."""
        if not self._allowed(a, b):
            return False
        pieces = self.space.pieces(a, b)
        rows = np.vstack([*ends, a + (b - a) * (bisection(pieces) / pieces)[:, None]])
        self.effort.spend(1)
        if self.constraint is not None and not self.constraint.holds(rows).all():
            return False
        if self.exactly:
            return self.hit(rows) is None
        # if anything is in the way, mostly at the first configuration, which is the end of a branch
        return all(bool(self.quick.free(some).all()) for some in (rows[:1], rows[1:]))

    def edge(self, a: Array, b: Array, *ends: Array) -> list[Array] | None:
        """Connect a to b, free as far as known: by a straight edge, else by its projection; None if neither is free."""
        if self.edge_free(a, b, *ends):
            return [a, b]
        if self.constraint is None:
            return None
        pieces = self.space.pieces(a, b)
        self.effort.spend(1)
        rows = self.constraint.projected(a + (b - a) * (np.arange(pieces + 1) / pieces)[:, None])
        rows[0], rows[-1] = a, b
        if any(self.space.pieces(*pair) > LARGEST_JUMP for pair in pairwise(rows)):
            return None
        return list(rows) if all(self.edge_free(*pair, pair[1]) for pair in pairwise(rows)) else None

    def _allowed(self, a: Array, b: Array) -> bool:
        """Check that an edge stays clear of all configurations where the exact check found a collision."""
        if not self.radii:
            return True
        move = (b - a) / self.space.resolution
        offsets = self.space.move(a, self.forbidden.filled) / self.space.resolution
        around = (offsets >= np.minimum(move, 0.0) - FORBIDDEN) & (offsets <= np.maximum(move, 0.0) + FORBIDDEN)
        for place in np.flatnonzero(around.all(axis=1)):
            share = min(1.0, max(0.0, float(offsets[place] @ move) / max(float(move @ move), 1e-12)))
            if np.abs(offsets[place] - share * move).max() < self.radii[place]:
                return False
        return True

    def first_hit(self, path: Array) -> Array | None:
        """Find a configuration of a path in exact collision; None if it is free."""
        rows = self.moments(path)
        return self.hit(rows[bisection(len(rows) + 1) - 1])

    def forbid(self, q: Array, ends: Sequence[Array]) -> None:
        """Record an exact collision; start and goal, if near, stay accessible."""
        distance = min(float(np.abs(self.space.move(q, end) / self.space.resolution).max()) for end in ends)
        self.forbidden.append(q)
        self.radii.append(min(FORBIDDEN, distance / 2))
        self.counts["exact hits"] += 1
        self.quick.learn(q, self.pairs(q))


def plan_path(
    start: ArrayLike,
    goal: ArrayLike,
    space: JointSpace,
    quick: Quick,
    touching: Touching,
    rng: np.random.Generator,
    *,
    moments: Callable[[Array], Array] | None = None,
    others: Sequence[Array] = (),
    constraint: Constraint | None = None,
    iterations: int = 1000,
) -> Array:
    """Plan a path: collision-free waypoints (n, d) from start to goal, ending at most whole turns away from it.

    ``others`` are alternative goals, tried if the first one has no straight path.

    ``moments`` turns waypoints into the configurations (m, d) to check exactly, by default points at the resolution; it
    should cover where the arm is at each instant. The whole path respects ``constraint``, as start and goal must.
    Raises :class:`StartInCollision` and :class:`GoalInCollision` with the colliding bodies, :class:`OutsideLimits` for
    the goal, :class:`NoPath` with counts after ``iterations`` at each clearance, or :data:`CHECKS` per iteration in
    all.
    """
    a, b = np.array(start, float), np.array(goal, float)
    if a.shape != space.lower.shape or b.shape != a.shape:
        raise ValueError(f"expected start and goal {space.lower.shape}, got shapes {a.shape}, {b.shape}")
    outside = ((b < space.lower - 1e-6) | (b > space.upper + 1e-6)) & ~space.continuous
    if outside.any() or not np.isfinite(b).all():
        raise OutsideLimits("the goal", b.tolist(), space.lower.tolist(), space.upper.tolist())
    effort = Effort(CHECKS * iterations, "checks")
    search = _Search(space, quick, touching, moments or space.points, rng, effort, constraint)
    if pairs := search.pairs(a):
        raise StartInCollision(a.tolist(), pairs)
    goals = [a + space.move(a, goal) for goal in (b, *others) if not search.pairs(goal, quick.doubtful(goal[None])[0])]
    if not goals:
        raise GoalInCollision(b.tolist(), search.pairs(b))
    try:
        path = _free_path(search, a, goals, iterations)
    except OutOfEffort as end:
        raise NoPath(a.tolist(), b.tolist(), search.counts) from end
    if path is None:
        raise NoPath(a.tolist(), b.tolist(), search.counts)
    return path


def _free_path(search: _Search, start: Array, goals: Sequence[Array], iterations: int) -> Array | None:
    """Search for waypoints at decreasing clearances, then with exact checks."""
    for distance in (*KEPT_APART, None):
        search.exactly = distance is None
        if distance is not None:
            search.quick.keep(distance, (start, *goals))
        for path in _paths(search, start, goals, iterations):
            waypoints = np.array(_shortened(search, path))
            hit = search.first_hit(waypoints)
            if hit is None:
                return waypoints
            search.forbid(hit, (start, *goals))
            if search.counts["exact hits"] % max(1, round(HITS * iterations)) == 0:
                break
    return None


def _paths(search: _Search, start: Array, goals: Sequence[Array], iterations: int) -> Iterator[list[Array]]:
    """Yield paths from start to a goal in an ongoing search, which avoids what was forbidden in between."""
    pruned_at = -1
    for goal in goals:
        if (direct := search.edge(start, goal)) is not None:
            yield direct
    here, there = _Tree(start), _Tree(*goals)
    space = search.space
    reach = REACH * (1.0 if search.constraint is None else CONSTRAINED) * space.resolution
    for _ in range(iterations):
        if search.exactly and search.counts["exact checks"] > EXACT_CHECKS * iterations:
            return
        if pruned_at != search.counts["exact hits"]:
            pruned_at = search.counts["exact hits"]
            here, there = (tree.pruned(search.edge_free) for tree in (here, there))
        target = search.rng.uniform(space.lower, space.upper)
        grown = _grow(search, here, here.nearest(target, space), target, reach)
        if grown is not None:
            met = _connect(search, there, here.nodes[grown], reach)
            if met is not None:
                path = here.path_from(grown)[::-1] + there.path_from(met)[1:]
                path = path if path[0] is start else path[::-1]
                yield space.unwound(path)
        here, there = there, here


def _connect(search: _Search, tree: _Tree, target: Array, reach: Array) -> int | None:
    """Grow a tree towards a target until it reaches it; None if something is in the way."""
    met: int | None = tree.nearest(target, search.space)
    while met is not None and np.abs(search.space.move(tree.nodes[met], target)).max() > 1e-12:
        met = _grow(search, tree, met, target, reach)
    return met


def _grow(search: _Search, tree: _Tree, node: int, target: Array, reach: Array) -> int | None:
    """Add a branch of at most ``reach`` from a node towards a target; None if something is in the way."""
    begin = tree.nodes[node]
    move = search.space.move(begin, target)
    end = begin + move / max(1.0, float((np.abs(move) / reach).max()))
    if search.constraint is not None:
        search.effort.spend(1)
        end = search.constraint.projected(end[None])[0]
        remaining = search.space.move(end, target)
        progress = (np.abs(move) / reach).max() - (np.abs(remaining) / reach).max()
        if progress < LEAST_PROGRESS * min(1.0, float((np.abs(move) / reach).max())):
            return None
    if not search.edge_free(begin, end, end):
        return None
    search.counts["branches"] += 1
    tree.add(end, node)
    return len(tree.nodes) - 1


def _shortened(search: _Search, path: list[Array]) -> list[Array]:
    """Shorten a path: skip waypoints, then replace pieces between random points by straight edges."""
    path = _skipped(search, path)
    for _ in range(SHORTCUTS):
        if len(path) == 2:
            break
        marks = np.sort(search.rng.uniform(0, len(path) - 1, 2))
        (i, u), (k, w) = ((int(mark), float(mark % 1)) for mark in marks)
        if k == i:
            continue
        a, b = path[i] + u * (path[i + 1] - path[i]), path[k] + w * (path[k + 1] - path[k])
        b_near = a + search.space.move(a, b)
        old_length = search.space.length([a, *path[i + 1 : k + 1], b])
        if search.space.length([a, b_near]) >= 0.98 * old_length:
            continue
        shortcut = search.edge(a, b_near, a, b)
        if shortcut is not None and search.space.length(shortcut) < 0.98 * old_length:
            path = search.space.unwound([*path[: i + 1], *shortcut, *path[k + 1 :]])
    return _skipped(search, path)


def _skipped(search: _Search, path: list[Array]) -> list[Array]:
    """Shorten a path: continue from each waypoint to the farthest one that a straight edge reaches."""
    kept = [path[0]]
    i = 0
    while i < len(path) - 1:
        for k in range(len(path) - 1, i, -1):
            ahead = kept[-1] + search.space.move(kept[-1], path[k])
            if k == i + 1 or search.edge_free(kept[-1], ahead):
                kept.append(ahead)
                i = k
                break
    return kept
