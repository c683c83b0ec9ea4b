"""The peer: RRT-Connect in which PyBullet checks every step of every edge, with a memory, middle first."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from planlang.geometry import Array

REACH = 10
"""Length of a new branch in units of the resolution."""
CHECKS, ITERATIONS, SHORTCUTS = 6000, 2000, 40


class _OutOfChecks(Exception):
    """The allowance is used up."""


@dataclass(slots=True)
class Plain:
    """Plans between limits (d,) at a ``resolution`` (d,)."""

    is_free: Callable[[Array], bool]
    resolution: Array
    lower: Array
    upper: Array
    rng: np.random.Generator
    known: dict[bytes, bool] = field(default_factory=dict)

    def plan(self, start: Array, goal: Array) -> Array | None:
        """Waypoints (n, d), or None."""
        try:
            if not (self._free(start) and self._free(goal)):
                return None
            path = [start, goal] if self._edge(start, goal) else self._connect(start, goal)
            return None if path is None else np.array(self._shorten(path))
        except _OutOfChecks:
            return None

    def _free(self, q: Array) -> bool:
        key = np.rint(q * 1e7).astype(np.int64).tobytes()
        if key not in self.known:
            if len(self.known) >= CHECKS:
                raise _OutOfChecks
            self.known[key] = self.is_free(q)
        return self.known[key]

    def _edge(self, a: Array, b: Array) -> bool:
        pieces = max(1, int(np.ceil((np.abs(b - a) / self.resolution).max() - 1e-9)))
        spans = [(0, pieces)]
        for low, high in spans:
            if high - low > 1:
                middle = (low + high) // 2
                if not self._free(a + (b - a) * (middle / pieces)):
                    return False
                spans += [(low, middle), (middle, high)]
        return True

    def _connect(self, start: Array, goal: Array) -> list[Array] | None:
        nodes: tuple[list[Array], list[Array]] = ([start], [goal])
        above: tuple[list[int], list[int]] = ([-1], [-1])
        side = 0
        for _ in range(ITERATIONS):
            target = self.rng.uniform(self.lower, self.upper)
            grown = self._grow(nodes[side], above[side], self._nearest(nodes[side], target), target)
            if grown is not None:
                target, other = nodes[side][grown], 1 - side
                met: int | None = self._nearest(nodes[other], target)
                while met is not None and nodes[other][met] is not target:
                    met = self._grow(nodes[other], above[other], met, target)
                if met is not None:
                    path = _way(nodes[side], above[side], grown)[::-1] + _way(nodes[other], above[other], met)[1:]
                    return path if side == 0 else path[::-1]
            side = 1 - side
        return None

    def _nearest(self, nodes: list[Array], q: Array) -> int:
        return int(np.argmin((((np.array(nodes) - q) / self.resolution) ** 2).sum(axis=1)))

    def _grow(self, nodes: list[Array], above: list[int], node: int, target: Array) -> int | None:
        move = target - nodes[node]
        far = float((np.abs(move) / (REACH * self.resolution)).max())
        end = target if far <= 1 else nodes[node] + move / far
        if not (self._free(end) and self._edge(nodes[node], end)):
            return None
        nodes.append(end)
        above.append(node)
        return len(nodes) - 1

    def _shorten(self, path: list[Array]) -> list[Array]:
        try:
            path = self._skip(path)
            for _ in range(SHORTCUTS if len(path) > 2 else 0):
                (i, u), (k, w) = (
                    (int(mark), float(mark % 1)) for mark in np.sort(self.rng.uniform(0, len(path) - 1, 2))
                )
                if k == i:
                    continue
                a, b = path[i] + u * (path[i + 1] - path[i]), path[k] + w * (path[k + 1] - path[k])
                if self.length([a, b]) < 0.98 * self.length([a, *path[i + 1 : k + 1], b]) and self._edge(a, b):
                    path = [*path[: i + 1], a, b, *path[k + 1 :]]
            return self._skip(path)
        except _OutOfChecks:
            return path

    def length(self, path: list[Array]) -> float:
        """In units of the resolution."""
        return sum(float(np.linalg.norm((b - a) / self.resolution)) for a, b in pairwise(path))

    def _skip(self, path: list[Array]) -> list[Array]:
        kept, i = [path[0]], 0
        while i < len(path) - 1:
            i = next(k for k in range(len(path) - 1, i, -1) if k == i + 1 or self._edge(path[i], path[k]))
            kept.append(path[i])
        return kept


def _way(nodes: list[Array], above: list[int], node: int) -> list[Array]:
    found = [nodes[node]]
    while (node := above[node]) >= 0:
        found.append(nodes[node])
    return found
