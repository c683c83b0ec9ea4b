"""Whether a chain, with all that moves with it, hits something: spheres against convex pieces, without PyBullet.

Frames are numbered: 0 is the map, 1 the base of the chain, then come the children of its moving joints. A sphere that
is inside a piece means a hit. Where all gaps are wider than what shapes stick out of their spheres, nothing is hit for
sure. What is in between an exact query has to decide; where it finds a hit, :meth:`QuickCheck.learn` keeps the two
bodies farther apart from then on.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from executive.motion.backends import SURE
from executive.motion.kinematics import Chain
from executive.motion.solids import Solids
from planlang.protocols import Array

MAP, BASE, FIRST_JOINT = 0, 1, 2
"""Numbers of frames."""
SPHERES = 64
"""Most spheres of a mover; ``SPHERES`` of collision.c."""
TOUCHING = 0.001
"""How deep spheres are inside of what counts as hit [m]: what exact queries take for touching, and rounding."""
BEYOND = 0.002
"""How much farther apart than the slack bodies are that do not touch for sure [m]: collision margins of meshes."""
APART = 0.001
"""How much farther than at a hit bodies are kept apart after it [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Mover:
    """A link, or a held object: spheres (k, 4), centre and radius, in the frame that it moves with [m]."""

    name: str
    frame: int
    spheres: Array
    slack: float


@dataclass(frozen=True, slots=True, eq=False)
class Obstacle:
    """Convex pieces in the frame that they move with; ``slack`` if what is meant is larger than them [m]."""

    name: str
    frame: int
    solids: Solids
    slack: float = 0.0


@dataclass(frozen=True, slots=True)
class Watched:
    """Mover and obstacle, by number, that must not be deeper in each other than ``allowed`` [m]."""

    mover: int
    obstacle: int
    allowed: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Bodies:
    """Movers and pieces of obstacles as arrays, in the layout of ``struct bodies`` in collision.c."""

    base: Array
    cluster: NDArray[np.int32]
    cluster_group: NDArray[np.int32]
    frame_ball: Array
    obstacle_frame: NDArray[np.int32]
    obstacle_ball: Array
    group_part: NDArray[np.int32]
    group_pair: NDArray[np.int32]
    group_width: Array
    part_ball: Array
    part_sphere: NDArray[np.int32]
    spheres: Array
    pair_piece: NDArray[np.int32]
    limit: Array
    sure: Array
    piece_kind: NDArray[np.int32]
    piece: Array
    solids: Solids
    """The pieces, each in its own frame."""
    part_frame: NDArray[np.int32]
    pair_part: NDArray[np.int32]
    piece_frame: NDArray[np.int32]

    def widen(self) -> None:
        """Tell the groups how far pairs have to be looked at, after ``limit`` or ``sure`` have changed."""
        widths = np.maximum(self.limit, self.sure)
        if len(widths):
            self.group_width[:, 1] = np.maximum.reduceat(widths, self.group_pair[:-1])
            of_clusters = np.maximum.reduceat(self.group_width[:, 1], self.cluster_group[:-1])
            self.group_width[self.cluster_group[:-1], 0] = of_clusters


class QuickCheck:
    """Judges configurations of a chain."""

    def __init__(
        self,
        chain: Chain,
        base: Array,
        movers: Sequence[Mover],
        obstacles: Sequence[Obstacle],
        watched: Iterable[Watched],
        *,
        whole: bool = True,
    ) -> None:
        """``base`` (4, 4) in the map. Not ``whole``: there is more than is told here, and nothing is ever sure."""
        too_many = [mover.name for mover in movers if len(mover.spheres) > SPHERES]
        if too_many:
            raise ValueError(f"at most {SPHERES} spheres for one mover, more have {', '.join(too_many)}")
        groups = sorted(
            (pair for pair in watched if len(obstacles[pair.obstacle].solids)),
            key=lambda pair: (movers[pair.mover].frame, pair.obstacle, pair.mover),
        )
        self._bodies = _arrays(base, movers, obstacles, groups, whole=whole)
        self.names = tuple(
            (movers[group.mover].name, obstacles[group.obstacle].name)
            for group in groups
            for _ in range(len(obstacles[group.obstacle].solids))
        )
        """Who the two of each pair are (p,)."""
        self._least = self._bodies.limit.copy()
        self._most = np.full(len(self.names), np.inf)
        self.whole = whole
        self._checker = chain.backend.checker(self._bodies)

    def judge(self, q: Array) -> NDArray[np.int32]:
        """For each configuration (n, d) SURE, UNSURE, or the number of a pair that is hit."""
        return self._checker.judge(q)

    def sure(self, q: Array) -> NDArray[np.bool_]:
        """Which configurations (n, d) hit nothing for sure."""
        return np.asarray(self._checker.judge(q) == SURE)

    def doubtful(self, q: Array) -> list[tuple[str, str]] | None:
        """Mover and obstacle that may touch at a configuration (d,), no others do; None if that is not known."""
        if not self.whole:
            return None
        return list(dict.fromkeys(self.names[number] for number in self._checker.doubtful(q)))

    def free(self, q: Array) -> bool:
        """Whether no sphere is inside something at a configuration (d,)."""
        return int(self._checker.judge(q[None])[0]) < 0

    def edge_free(self, start: Array, end: Array, pieces: int) -> bool:
        """The same for all points between two configurations (d,) that divide the way into so many pieces."""
        return self._checker.judge_edge(start, end, pieces, bisection(pieces)) < 0

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
        found = {frozenset(pair) for pair in pairs}
        rows = [k for k, names in enumerate(self.names) if frozenset(names) in found]
        raised = np.minimum(self.gaps(q)[rows] + APART, self._most[rows])
        nearest = raised <= raised.min(initial=np.inf) + 0.01  # of a body's pieces those that may have been hit
        rows_hit = np.array(rows, np.intp)[nearest]
        self._bodies.limit[rows_hit] = np.maximum(self._bodies.limit[rows_hit], raised[nearest])
        self._bodies.widen()


def _arrays(
    base: Array, movers: Sequence[Mover], obstacles: Sequence[Obstacle], groups: Sequence[Watched], *, whole: bool
) -> Bodies:
    solids = Solids.joined([obstacle.solids for obstacle in obstacles])
    first = np.cumsum([0, *(len(obstacle.solids) for obstacle in obstacles)])
    sizes = [len(obstacles[group.obstacle].solids) for group in groups]
    keys = [(movers[group.mover].frame, group.obstacle) for group in groups]
    begins = [k for k, key in enumerate(keys) if k == 0 or key != keys[k - 1]]
    frames = np.array([mover.frame for mover in movers], np.int32)
    part_ball = np.array([_ball(mover.spheres) for mover in movers]).reshape(-1, 4)
    frame_ball = np.array([_ball(part_ball[frames == k]) for k in range(int(frames.max(initial=1)) + 1)])
    pieces = np.column_stack([solids.centres, solids.reach])
    allowed, slack = (
        np.repeat(np.array(values, float), sizes)
        for values in (
            [group.allowed for group in groups],
            [movers[group.mover].slack + obstacles[group.obstacle].slack for group in groups],
        )
    )
    found = Bodies(
        base=np.concatenate([base[:3, :3].ravel(), base[:3, 3]]),
        cluster=np.array([keys[k] for k in begins], np.int32).reshape(-1, 2),
        cluster_group=np.array([*begins, len(groups)], np.int32),
        frame_ball=frame_ball,
        obstacle_frame=np.array([obstacle.frame for obstacle in obstacles], np.int32),
        obstacle_ball=np.array([_ball(pieces[a:b]) for a, b in pairwise(first)]).reshape(-1, 4),
        group_part=np.array([group.mover for group in groups], np.int32),
        group_pair=np.cumsum([0, *sizes]).astype(np.int32),
        group_width=np.zeros((len(groups), 2)),
        part_ball=part_ball,
        part_sphere=np.cumsum([0, *(len(mover.spheres) for mover in movers)]).astype(np.int32),
        spheres=np.concatenate([np.zeros((0, 4)), *(mover.spheres for mover in movers)]),
        pair_piece=np.array([k for g in groups for k in range(first[g.obstacle], first[g.obstacle + 1])], np.int32),
        limit=-allowed - TOUCHING,
        sure=slack + BEYOND if whole else np.full(len(slack), np.inf),
        piece_kind=solids.kinds.astype(np.int32),
        piece=np.concatenate([solids.centres, solids.axes.reshape(-1, 9), solids.half, solids.reach[:, None]], axis=1),
        solids=solids,
        part_frame=frames,
        pair_part=np.repeat([group.mover for group in groups], sizes).astype(np.int32),
        piece_frame=np.repeat([o.frame for o in obstacles], [len(o.solids) for o in obstacles]).astype(np.int32),
    )
    found.widen()
    return found


def _ball(spheres: Array) -> Array:
    """Centre and radius (4,) of a sphere around spheres (k, 4)."""
    if not len(spheres):
        return np.zeros(4)
    centre = ((spheres[:, :3] - spheres[:, 3:]).min(axis=0) + (spheres[:, :3] + spheres[:, 3:]).max(axis=0)) / 2
    return np.append(centre, (np.linalg.norm(spheres[:, :3] - centre, axis=1) + spheres[:, 3]).max())


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
