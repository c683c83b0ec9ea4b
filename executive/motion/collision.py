"""Whether a chain, with all that moves with it, hits something: spheres against convex pieces, without PyBullet.

Frames are numbered: 0 is the map, 1 the base of the chain, then come the children of its moving joints. A sphere that
is inside a piece means a hit. Where all gaps are wider than what shapes stick out of their spheres, or the plane of a
face is between them, nothing is hit for sure. What is left an exact query has to decide; where it finds a hit,
:meth:`QuickCheck.learn` keeps the two bodies farther apart from then on.

Searches for places of the base ask about many bases at once by :meth:`QuickCheck.hit`, searches for ways of an arm
about edges from one base.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache, cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from executive.motion.backends import ALSO_SURE, SURE, UNSURE
from executive.motion.bodies import Movers, Obstacles, Watched
from executive.motion.body_arrays import TOUCHING, arrays_of
from executive.motion.facets import sizes_of
from executive.motion.kinematics import Chain
from planlang.geometry import Array

SPHERES = 64
"""Most spheres of a mover; ``SPHERES`` of collision.c."""
APART = 0.001
"""How much farther than at a hit bodies are kept apart after it [m]."""


class QuickCheck:
    """Judges configurations of a chain; pairs are numbered by obstacle, then by the frame of the mover."""

    def __init__(
        self,
        chain: Chain,
        base: Array,
        movers: Movers,
        obstacles: Obstacles,
        watched: Watched,
        *,
        tip: tuple[Array, int],
        whole: bool = True,
    ) -> None:
        """``base`` (4, 4) in the map; ``tip`` (4, 4) in the frame of that number, with which the hand goes.

        Not ``whole``: there is more than is told here, and nothing is ever sure.
        """
        too_many = [movers.names[k] for k in np.flatnonzero(sizes_of(movers.first) > SPHERES).tolist()]
        if too_many:
            raise ValueError(f"at most {SPHERES} spheres for one mover, more have {', '.join(too_many)}")
        sizes = sizes_of(obstacles.first)[watched.obstacles]
        order = np.lexsort((watched.movers, movers.frames[watched.movers], watched.obstacles))
        order = order[sizes[order] > 0]
        groups = Watched(watched.movers[order], watched.obstacles[order], watched.allowed[order])
        self._movers, self._obstacles, self._groups = movers, obstacles, groups
        self._bodies = arrays_of(chain, base, movers, obstacles, groups)
        self._least = self._bodies.limit.copy()
        self._most = np.full(len(self._least), np.inf)
        self._to_hand, self._hand = np.linalg.inv(tip[0]), tip[1]
        self.whole = whole
        self._dof = chain.dof
        self._checker = chain.backend.checker(self._bodies)

    @property
    def names(self) -> tuple[tuple[str, str], ...]:
        """Who the two of each pair are (p,)."""
        groups = self._groups_of(np.arange(len(self._bodies.pair_piece)))
        return tuple(map(self._pair, groups.tolist()))

    def _groups_of(self, pairs: NDArray[np.integer[Any]]) -> NDArray[np.intp]:
        return np.searchsorted(self._bodies.group_pair, pairs, side="right") - 1

    def _pair(self, group: int) -> tuple[str, str]:
        return self._movers.names[self._groups.movers[group]], self._obstacles.names[self._groups.obstacles[group]]

    @cached_property
    def _pairs_of(self) -> dict[frozenset[str], list[int]]:
        """The numbers of the pairs of two bodies."""
        found: dict[frozenset[str], list[int]] = {}
        for group, span in enumerate(pairwise(self._bodies.group_pair.tolist())):
            found.setdefault(frozenset(self._pair(group)), []).extend(range(*span))
        return found

    def hit(self, bases: Array, q: Array | None = None, *, deeper: float = 0.0) -> list[str | None]:
        """The first obstacle that is hit from each base pose (n, 4, 4) in the map at configurations (n, d); None: none.

        ``deeper``: how much deeper in something than elsewhere spheres have to be [m]. Without configurations only
        what moves with the base may be among the movers.
        """
        count = len(bases)
        if not count or not len(self._bodies.pair_piece):
            return [None] * count
        return self._met(self._checker.hits(np.zeros((count, self._dof)) if q is None else q, _rows(bases), deeper))

    def hand_hit(self, tips: Array) -> list[str | None]:
        """The first obstacle in the map that the hand alone hits with the tip at each pose (n, 4, 4) there.

        What moves as the hand does counts, wherever the rest of the chain is.
        """
        # all rows in one product: many small ones take as long as the rest of this
        places = (tips[:, :3].reshape(-1, 4) @ self._to_hand).reshape(-1, 3, 4)
        return self._met(self._checker.frame_hits(self._hand, _rows(places)))

    def _met(self, found: NDArray[np.int32]) -> list[str | None]:
        """The obstacles of pairs, None for what is none."""
        groups = self._groups_of(found)
        names, of_group = self._obstacles.names, self._groups.obstacles
        return [None if pair < 0 else names[of_group[g]] for pair, g in zip(found.tolist(), groups, strict=True)]

    def clear(self, bases: Array, q: Array) -> NDArray[np.bool_]:
        """From which base poses (n, 4, 4) configurations (n, d) hit nothing for sure, as far as that is told."""
        return self._sure(self._checker.hits(q, _rows(bases), ALSO_SURE))

    def judge(self, q: Array) -> NDArray[np.int32]:
        """For each configuration (n, d) SURE, UNSURE, or the number of a pair that is hit."""
        found = self._checker.judge(q)
        return found if self.whole else np.where(found == SURE, np.int32(UNSURE), found)

    def sure(self, q: Array) -> NDArray[np.bool_]:
        """Which configurations (n, d) hit nothing for sure."""
        return self._sure(self._checker.judge(q))

    def _sure(self, found: NDArray[np.int32]) -> NDArray[np.bool_]:
        return np.asarray((found == SURE) & self.whole)

    def doubtful(self, q: Array) -> list[tuple[str, str]] | None:
        """Mover and obstacle that may touch at a configuration (d,), no others do; None if that is not known."""
        if not self.whole:
            return None
        groups = self._groups_of(self._checker.doubtful(q))
        return list(dict.fromkeys(map(self._pair, np.unique(groups).tolist())))

    def free(self, q: Array) -> bool:
        """Whether no sphere is inside something at a configuration (d,)."""
        return int(self._checker.hits(q[None], self._bodies.base[None], 0.0)[0]) < 0

    def edge_free(self, start: Array, end: Array, pieces: int) -> bool:
        """The same for all points between two configurations (d,) that divide the way into so many pieces."""
        return self._checker.edge_hit(start, end, pieces, bisection(pieces)) < 0

    def gaps(self, q: Array) -> Array:
        """The smallest gap of each pair (p,) at a configuration (d,) [m]."""
        return self._checker.gaps(q)

    def keep(self, distance: float, ends: Iterable[Array]) -> None:
        """Keep everything so far apart [m], or, where that is less, as far as it is at the nearer of ``ends`` (d,).

        The ends are taken to be free. Forgets what was learnt.
        """
        self._most = np.min([self.gaps(q) for q in ends], axis=0, initial=np.inf) - TOUCHING
        self._bodies.limit[:] = np.minimum(self._least + TOUCHING + distance, self._most)
        self._bodies.widen()

    def learn(self, q: Array, pairs: Iterable[tuple[str, str]]) -> None:
        """At a configuration (d,) bodies were found to touch: keep them farther apart, as far as the ends allow."""
        rows = [row for pair in {frozenset(pair): None for pair in pairs} for row in self._pairs_of.get(pair, ())]
        raised = np.minimum(self.gaps(q)[rows] + APART, self._most[rows])
        nearest = raised <= raised.min(initial=np.inf) + 0.01  # of a body's pieces those that may have been hit
        rows_hit = np.array(rows, np.intp)[nearest]
        self._bodies.limit[rows_hit] = np.maximum(self._bodies.limit[rows_hit], raised[nearest])
        self._bodies.widen()


def _rows(bases: Array) -> Array:
    """Poses (n, 4, 4), or without their last rows, as checkers take them (n, 12)."""
    return np.concatenate([bases[:, :3, :3].reshape(-1, 9), bases[:, :3, 3]], axis=1)


@cache
def bisection(pieces: int) -> NDArray[np.int32]:
    """The inner points 1 .. pieces - 1 of a way in so many pieces, middle first, then the middles of what is left."""
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
