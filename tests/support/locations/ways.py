"""Places that a base can drive to, by the judge: a flood fill over places and headings without contact, from both ends.

Whether two places are joined is found by floods that grow in turn from either: the smaller of two rooms that are not
joined is soon full. Nothing of it is the product's.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterator, Sequence

from planlang.geometry import Pose
from sim import Body
from tests.support.locations.oracle import BasePose, Oracle

CELL, HEADINGS = 0.04, 24
"""Distance of neighbouring places [m], headings at each."""
BESIDE = 2
"""Cells within which a place that touches something may be left at either end of a way."""

Node = tuple[int, int, int]


class Ways:
    """Ways of a base, in the posture in which it drives, between places of a room; what was found is remembered."""

    def __init__(self, oracle: Oracle, known: Sequence[BasePose] = (), most: float = math.inf) -> None:
        """From where the robot of a room begins, or from the nearest of ``known`` places, which it is known to get to.

        A flood over more than ``most`` nodes is given up: the place counts as one that it does not get to.
        """
        self._oracle, self._start, self._known, self._most = oracle, oracle.room.start, tuple(known), most
        self._stuck: bool | None = None
        self._free: dict[Node, bool] = {}
        self._joined: set[Node] = set()
        """Nodes that are joined to the start."""
        self._apart: set[Node] = set()
        """Nodes that are not."""

    def lead_to(self, base: BasePose) -> bool:
        """Return whether the base can get to a place; True for a robot that stands in something or cannot drive."""
        if self._stuck is None:
            self._oracle.place(self._start, self._oracle.posture)
            self._stuck = self._oracle.robot.base.fixed or self._oracle.touched(itself=False) is not None
        begin = self._start
        if self._known:
            begin = min(self._known, key=lambda one: self._away(one, base))
        here, there = self._near(begin), self._near(base)
        if self._stuck or here is None:
            return True
        return there is not None and self._are_joined(here, there)

    def _away(self, one: BasePose, other: BasePose) -> tuple[bool, float]:
        """How far a place is from another; those that share no room are farther than all that do."""
        rooms = [room for room in self._oracle.room.bodies if room.shape == "room"]
        is_apart = not any(_is_in(room, one) and _is_in(room, other) for room in rooms)
        return is_apart, math.dist(one[:2], other[:2])

    def _are_joined(self, here: Node, there: Node) -> bool:
        self._joined.add(here)
        if there in self._joined or there in self._apart:
            return there in self._joined
        ours, theirs = _Flood(here, there), _Flood(there, here)
        while True:
            for flood, known in ((theirs, self._joined), (ours, theirs.seen)):
                fresh = flood.grow(self)
                if fresh is None or (flood is theirs and not self._apart.isdisjoint(fresh)):
                    self._joined |= ours.seen
                    self._apart |= theirs.seen
                    return False
                if any(node in known or (flood is theirs and node in ours.seen) for node in fresh):
                    self._joined |= ours.seen | theirs.seen
                    return True
                if len(ours.seen) + len(theirs.seen) > self._most:
                    self._joined |= ours.seen
                    return False

    def neighbours(self, node: Node) -> Iterator[Node]:
        """Free nodes one step away."""
        i, j, turn = node
        for other in (
            (i + 1, j, turn),
            (i - 1, j, turn),
            (i, j + 1, turn),
            (i, j - 1, turn),
            (i, j, (turn + 1) % HEADINGS),
            (i, j, (turn - 1) % HEADINGS),
        ):
            if self._is_free(other):
                yield other

    def _is_free(self, node: Node) -> bool:
        if node not in self._free:
            i, j, turn = node
            self._oracle.place((i * CELL, j * CELL, turn * 2 * math.pi / HEADINGS), self._oracle.posture)
            self._free[node] = self._oracle.touched(itself=False) is None
        return self._free[node]

    def _near(self, base: BasePose) -> Node | None:
        """The free node that is nearest to a place, None if there is none beside it."""
        x, y = base[0] / CELL, base[1] / CELL
        turn = round(base[2] / (2 * math.pi) * HEADINGS)
        around = range(-BESIDE, BESIDE + 1)
        nodes = [
            (round(x) + di, round(y) + dj, (turn + dt) % HEADINGS)
            for di in around
            for dj in around
            for dt in (0, 1, -1)
        ]
        nodes.sort(key=lambda node: (math.hypot(node[0] - x, node[1] - y), node))
        return next((node for node in nodes if self._is_free(node)), None)


def _is_in(room: Body, base: BasePose) -> bool:
    x, y, _ = (room.pose.inverse() @ Pose((base[0], base[1], room.pose.position[2]))).position
    return abs(x) < room.size[0] / 2 and abs(y) < room.size[1] / 2


class _Flood:
    """A flood from one node, which grows towards another first."""

    def __init__(self, begin: Node, goal: Node) -> None:
        self.seen = {begin}
        self._goal, self._front = goal, [(self._away(begin, goal), begin)]

    def grow(self, ways: Ways) -> list[Node] | None:
        """Take in what is next to one more node, and return that; None if there is nothing left to take in."""
        if not self._front:
            return None
        _, node = heapq.heappop(self._front)
        fresh = [other for other in ways.neighbours(node) if other not in self.seen]
        self.seen.update(fresh)
        for other in fresh:
            heapq.heappush(self._front, (self._away(other, self._goal), other))
        return fresh

    @staticmethod
    def _away(one: Node, other: Node) -> float:
        turned = abs(one[2] - other[2])
        return math.hypot(one[0] - other[0], one[1] - other[1]) + min(turned, HEADINGS - turned)
