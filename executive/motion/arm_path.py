"""Paths of an arm: RRT-Connect whose edges are checked by spheres; exact queries look at the path found, lazily.

RRT-Connect: Kuffner and LaValle, ICRA 2000; checking only what is about to be used: Bohlin and Kavraki, ICRA 2000.
Where the exact check finds a hit on a path, its place is forbidden, the quick check learns which two bodies have to
stay farther apart, the trees lose the edges that are affected, and the search goes on. After :data:`HITS` of them the
trees are given up and everything is checked exactly at once: then the path is as good as that of a plain search.
Joints that turn without end go the shorter way around, in the trees too; a path may end whole turns from the goal.

A path that has to keep to a constraint, such as what is held being upright, grows by shorter branches, whose ends are
projected onto it (Berenson et al., ICRA 2009), and a straight way that strays from it is replaced by its projection.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import field
from functools import cache
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from executive.motion.effort import Effort
from executive.motion.errors import GoalInCollision, NoPath, OutOfEffort, OutsideLimits, StartInCollision
from planlang.geometry import Array
from planlang.records import dataclass

Touching = Callable[[Array, Sequence[tuple[str, str]] | None], Sequence[tuple[str, str]]]
"""The exact check: which two bodies touch each other, wrongly, at a configuration (d,); slow.

The second argument holds the only pairs that can touch there, None if that is not known.
"""
AT_FIRST = 8
"""Configurations of a path that are looked at exactly in one go; then twice as many, and so on."""
REACH = 10
"""Length of a new branch, in units of the edge resolution."""
HITS = 0.04
"""Exact hits on paths, per iteration that is allowed, after which spheres are not asked any more."""
KEPT_APART = (0.015, 0.0)
"""Distance by which everything is kept apart where the ends allow it [m]; less when no path is found like that."""
EXACT_CHECKS = 3.0
"""Exact checks, per iteration, that a search may ask for in all, once spheres are not asked any more."""
CHECKS = 35
"""Checks of straight ways, and exact ones of configurations, per iteration, that a search may ask for in all."""
CONSTRAINED = 0.3
"""Length of a branch that keeps to a constraint, as a share of the usual one."""
LEAST_PROGRESS = 0.2
"""Share of its length by which such a branch has to come nearer to where it is to go."""
LARGEST_JUMP = 3.0
"""The greatest distance of neighbouring points of a straight way after projection, in units of that before."""
FORBIDDEN = 0.5
"""Largest distance that paths have to keep from an exact hit, in units of the edge resolution."""


@dataclass(frozen=True, slots=True, eq=False)
class JointSpace:
    """The joint space of an arm: limits (d,), which joints turn without end (d,), and ``resolution`` (d,) of checks."""

    lower: Array
    upper: Array
    continuous: NDArray[np.bool_]
    resolution: Array

    @staticmethod
    def of(
        lower: ArrayLike, upper: ArrayLike, *, continuous: ArrayLike = False, resolution: ArrayLike = 0.08
    ) -> JointSpace:
        """Return the space of limits (d,); raise ValueError for a resolution not positive or limits not finite."""
        low, high = np.asarray(lower, float), np.asarray(upper, float)
        turning = np.array(np.broadcast_to(np.asarray(continuous, bool), low.shape))
        steps = np.array(np.broadcast_to(np.asarray(resolution, float), low.shape))
        if low.ndim != 1 or low.shape != high.shape:
            raise ValueError(f"expected limits (d,), got shapes {low.shape}, {high.shape}")
        if not (steps > 0).all() or not (np.isfinite(low) & np.isfinite(high) | turning).all():
            raise ValueError("the resolution must be positive and the limits finite")
        return JointSpace(np.where(turning, -np.pi, low), np.where(turning, np.pi, high), turning, steps)

    def move(self, start: Array, end: Array) -> Array:
        """Return the difference from one configuration (..., d) to another, the shorter way around."""
        move = end - start
        return np.asarray(move - np.where(self.continuous, 2 * np.pi * np.rint(move / (2 * np.pi)), 0.0))

    def unwound(self, path: Sequence[Array]) -> list[Array]:
        """Return the same waypoints, each the shorter way around from the one before."""
        found = [path[0]]
        for q in path[1:]:
            move = q - found[-1]
            found.append(q if (np.abs(move[self.continuous]) <= np.pi).all() else found[-1] + self.move(found[-1], q))
        return found

    def pieces(self, start: Array, end: Array) -> int:
        """Return into how many pieces a way is divided to be checked."""
        return max(1, int(np.ceil((np.abs(end - start) / self.resolution).max() - 1e-9)))

    def length(self, path: Sequence[Array]) -> float:
        """Return the length of a path, in units of the resolution."""
        return sum(float(np.linalg.norm((b - a) / self.resolution)) for a, b in pairwise(path))

    def points(self, path: Array) -> Array:
        """Return configurations (m, d) along waypoints (n, d), at most the resolution apart, without the start."""
        parts = []
        for a, b in pairwise(path):
            count = self.pieces(a, b)
            parts.append(a + (b - a) * (np.arange(1, count + 1) / count)[:, None])
        return np.concatenate(parts) if parts else path[:0]


class Quick(Protocol):
    """A fast, approximate check of what is free: :class:`executive.motion.collision.QuickCheck`."""

    def free(self, q: Array) -> NDArray[np.bool_]:
        """Return which configurations (n, d) are free as far as is known."""

    def doubtful(self, q: Array) -> Sequence[Sequence[tuple[str, str]] | None]:
        """Return the pairs that may touch at each configuration (n, d), no others do; None where that is not known."""

    def keep(self, distance: float, ends: Sequence[Array]) -> None:
        """Keep bodies so far apart [m] where the ends (d,), which are free, allow it; forget what was learnt."""

    def learn(self, q: Array, pairs: Sequence[tuple[str, str]]) -> None:
        """Learn from the exact check which pairs touch at a configuration (d,)."""


class Constraint(Protocol):
    """A constraint that a whole path has to keep to: :class:`executive.motion.upright.Upright`."""

    def holds(self, q: Array) -> NDArray[np.bool_]:
        """Return at which configurations (n, d) it holds."""

    def projected(self, q: Array) -> Array:
        """Return configurations (n, d) near others where it holds, if there are any; where it holds they stay."""


@cache
def bisection(pieces: int) -> NDArray[np.int32]:
    """Return the inner points 1 .. pieces - 1 of a way in so many pieces, middle first, then the rest's middles."""
    order: list[int] = []
    spans = [(0, pieces)]
    for low, high in spans:
        if high - low > 1:
            middle = (low + high) // 2
            order.append(middle)
            spans += [(low, middle), (middle, high)]
    found = np.array(order, np.int32)
    found.flags.writeable = False
    return found


class _Rows:
    """Configurations in one array (n, d), which has room for more."""

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
    """Configurations that hang from roots by free edges; parents come before their children."""

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

    def way(self, node: int) -> list[Array]:
        """Return the way from a node to its root."""
        nodes = [self.nodes[node]]
        while (node := self.parents[node]) >= 0:
            nodes.append(self.nodes[node])
        return nodes

    def pruned(self, free: Callable[[Array, Array], bool]) -> _Tree:
        """Return it without the edges that are not free any more, and what hangs from them."""
        roots = self.parents.count(-1)
        kept, left = dict(zip(range(roots), range(roots), strict=True)), _Tree(*self.nodes[:roots])
        for number in range(roots, len(self.nodes)):
            above = kept.get(self.parents[number])
            if above is not None and free(left.nodes[above], self.nodes[number]):
                kept[number] = len(left.nodes)
                left.add(self.nodes[number], above)
        return left


@dataclass(slots=True)
class _Search:
    """A search for one path, and what is known so far."""

    space: JointSpace
    quick: Quick
    touching: Touching
    moments: Callable[[Array], Array]
    rng: np.random.Generator
    shortcuts: int
    effort: Effort
    constraint: Constraint | None = None
    exactly: bool = False
    """True if edges are checked exactly at once."""
    known: dict[bytes, Sequence[tuple[str, str]]] = field(default_factory=dict)
    forbidden: _Rows = field(init=False)
    radii: list[float] = field(default_factory=list)
    """Distances that a way must keep from the forbidden places, in units of the edge resolution."""
    counts: dict[str, int] = field(default_factory=lambda: {"branches": 0, "exact checks": 0, "exact hits": 0})

    def __post_init__(self) -> None:
        self.forbidden = _Rows(len(self.space.resolution))

    def pairs(self, q: Array, among: Sequence[tuple[str, str]] | None = None) -> Sequence[tuple[str, str]]:
        """Return what touches at a configuration, exactly, ``among`` the pairs that may; each is asked for once."""
        key = np.rint(q * 1e9).astype(np.int64).tobytes()
        found = self.known.get(key)
        if found is None:
            self.counts["exact checks"] += 1
            self.effort.spend(1)
            found = self.known[key] = tuple(self.touching(q.copy(), among))
        return found

    def hit(self, rows: Array) -> Array | None:
        """Return the first of configurations (n, d) where something touches, exactly; None if all are free."""
        first, size = 0, AT_FIRST
        while first < len(rows):
            some = rows[first : first + size]
            for row, among in zip(some, self.quick.doubtful(some), strict=True):
                if (among is None or among) and self.pairs(row, among):
                    return np.asarray(row)
            first, size = first + size, 2 * size
        return None

    def edge_free(self, a: Array, b: Array, *ends: Array) -> bool:
        """Return whether the straight way between two configurations is free, as far as is known; ``ends``, too."""
        if not self._allowed(a, b):
            return False
        pieces = self.space.pieces(a, b)
        rows = np.vstack([*ends, a + (b - a) * (bisection(pieces) / pieces)[:, None]])
        self.effort.spend(1)
        if self.constraint is not None and not self.constraint.holds(rows).all():
            return False
        if self.exactly:
            return self.hit(rows) is None
        return bool(self.quick.free(rows).all())

    def way(self, a: Array, b: Array, *ends: Array) -> list[Array] | None:
        """Return a way from a to b that is free as far as is known: straight, else its projection; None if not."""
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
        found = list(rows)
        return found if all(self.edge_free(*pair, pair[1]) for pair in pairwise(found)) else None

    def _allowed(self, a: Array, b: Array) -> bool:
        """Return True if a way passes no place where the exact check has found a hit."""
        if not self.radii:
            return True
        move = (b - a) / self.space.resolution
        aways = self.space.move(a, self.forbidden.filled) / self.space.resolution
        around = (aways >= np.minimum(move, 0.0) - FORBIDDEN) & (aways <= np.maximum(move, 0.0) + FORBIDDEN)
        for place in np.flatnonzero(around.all(axis=1)):
            share = min(1.0, max(0.0, float(aways[place] @ move) / max(float(move @ move), 1e-12)))
            if np.abs(aways[place] - share * move).max() < self.radii[place]:
                return False
        return True

    def first_hit(self, path: Array) -> Array | None:
        """Return a configuration of a path where something touches, exactly; None if it is free."""
        rows = self.moments(path)
        return self.hit(rows[bisection(len(rows) + 1) - 1])

    def forbid(self, q: Array, ends: Sequence[Array]) -> None:
        """Remember a place of an exact hit; start and goal, if they are near, stay accessible."""
        away = min(float(np.abs(self.space.move(q, end) / self.space.resolution).max()) for end in ends)
        self.forbidden.append(q)
        self.radii.append(min(FORBIDDEN, away / 2))
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
    shortcuts: int = 40,
) -> Array:
    """Return waypoints (n, d) of a path that is exactly free, from start to goal, at most whole turns away from it.

    ``others`` are goals that will do as well, if there is no straight way to one before.

    ``moments`` turns waypoints into the configurations (m, d) that are looked at exactly, by default points at the
    resolution: add there where the arm will be at each instant. All of a path keeps to the ``constraint``, to which
    start and goal have to keep. Raises :class:`StartInCollision` and
    :class:`GoalInCollision` with the bodies that touch, :class:`OutsideLimits` for the goal, :class:`NoPath` with
    counts after so many ``iterations`` at each of the distances to keep, or so many :data:`CHECKS` in all.
    """
    a, b = np.array(start, float), np.array(goal, float)
    if a.shape != space.lower.shape or b.shape != a.shape:
        raise ValueError(f"expected start and goal {space.lower.shape}, got shapes {a.shape}, {b.shape}")
    outside = ((b < space.lower - 1e-6) | (b > space.upper + 1e-6)) & ~space.continuous
    if outside.any() or not np.isfinite(b).all():
        raise OutsideLimits("the goal", b.tolist(), space.lower.tolist(), space.upper.tolist())
    effort = Effort(CHECKS * iterations, "checks")
    search = _Search(space, quick, touching, moments or space.points, rng, shortcuts, effort, constraint)
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
    """Return the waypoints of a path, kept apart from everything as far as there is one."""
    for distance in (*KEPT_APART, None):
        search.exactly = distance is None
        if distance is not None:
            search.quick.keep(distance, (start, *goals))
        for path in _paths(search, start, goals, iterations):
            found = np.array(_shortened(search, path))
            hit = search.first_hit(found)
            if hit is None:
                return found
            search.forbid(hit, (start, *goals))
            if search.counts["exact hits"] % max(1, round(HITS * iterations)) == 0:
                break
    return None


def _paths(search: _Search, start: Array, goals: Sequence[Array], iterations: int) -> Iterator[list[Array]]:
    """Yield paths from start to a goal of a search that goes on; what is forbidden in between is heeded."""
    known = -1
    for goal in goals:
        if (direct := search.way(start, goal)) is not None:
            yield direct
    here, there = _Tree(start), _Tree(*goals)
    space = search.space
    reach = REACH * (1.0 if search.constraint is None else CONSTRAINED) * space.resolution
    for _ in range(iterations):
        if search.exactly and search.counts["exact checks"] > EXACT_CHECKS * iterations:
            return
        if known != search.counts["exact hits"]:
            known = search.counts["exact hits"]
            here, there = (tree.pruned(search.edge_free) for tree in (here, there))
        target = search.rng.uniform(space.lower, space.upper)
        grown = _grow(search, here, here.nearest(target, space), target, reach)
        if grown is not None:
            met = _reached(search, there, here.nodes[grown], reach)
            if met is not None:
                path = here.way(grown)[::-1] + there.way(met)[1:]
                path = path if path[0] is start else path[::-1]
                yield space.unwound(path)
        here, there = there, here


def _reached(search: _Search, tree: _Tree, target: Array, reach: Array) -> int | None:
    """Grow a tree towards a target until it is there, or something is in the way."""
    met: int | None = tree.nearest(target, search.space)
    while met is not None and np.abs(search.space.move(tree.nodes[met], target)).max() > 1e-12:
        met = _grow(search, tree, met, target, reach)
    return met


def _grow(search: _Search, tree: _Tree, node: int, target: Array, reach: Array) -> int | None:
    """Add a branch from a node towards a target, at most as long as reach; None if something is in the way."""
    begin = tree.nodes[node]
    move = search.space.move(begin, target)
    end = begin + move / max(1.0, float((np.abs(move) / reach).max()))
    if search.constraint is not None:
        search.effort.spend(1)
        end = search.constraint.projected(end[None])[0]
        left = search.space.move(end, target)
        nearer = (np.abs(move) / reach).max() - (np.abs(left) / reach).max()
        if nearer < LEAST_PROGRESS * min(1.0, float((np.abs(move) / reach).max())):
            return None
    if not search.edge_free(begin, end, end):
        return None
    search.counts["branches"] += 1
    tree.add(end, node)
    return len(tree.nodes) - 1


def _shortened(search: _Search, path: list[Array]) -> list[Array]:
    """Skip waypoints, then replace pieces between random points by straight lines."""
    path = _skipped(search, path)
    for _ in range(search.shortcuts):
        if len(path) == 2:
            break
        marks = np.sort(search.rng.uniform(0, len(path) - 1, 2))
        (i, u), (k, w) = ((int(mark), float(mark % 1)) for mark in marks)
        if k == i:
            continue
        a, b = path[i] + u * (path[i + 1] - path[i]), path[k] + w * (path[k + 1] - path[k])
        b_near = a + search.space.move(a, b)
        known = search.space.length([a, *path[i + 1 : k + 1], b])
        if search.space.length([a, b_near]) >= 0.98 * known:
            continue
        way = search.way(a, b_near, a, b)
        if way is not None and search.space.length(way) < 0.98 * known:
            path = search.space.unwound([*path[: i + 1], *way, *path[k + 1 :]])
    return _skipped(search, path)


def _skipped(search: _Search, path: list[Array]) -> list[Array]:
    """Return a path that goes on from each waypoint to the farthest one that can be reached straight."""
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
