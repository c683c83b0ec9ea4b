"""Whether a chain, with all that moves with it, hits something: spheres against convex pieces, without PyBullet.

Frames are numbered: 0 is the map, 1 the base of the chain, then come the children of its moving joints. A sphere that
is inside a piece means a hit. Where all gaps are wider than what shapes stick out of their spheres, or the plane of a
face is between them, nothing is hit for sure. What is left an exact query has to decide; where it finds a hit,
:meth:`QuickCheck.learn` keeps the two bodies farther apart from then on.

Searches for places of the base ask about many bases at once by :meth:`QuickCheck.hit`, searches for ways of an arm
about edges from one base.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from itertools import compress, pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from executive.motion.backends import ALSO_SURE, SURE, UNSURE
from executive.motion.facets import Facets
from executive.motion.kinematics import Chain
from executive.motion.solids import Solids
from executive.motion.spheres import Faceted
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
class Movers:
    """m links or held objects, or convex shapes of them, as spheres in the frames that they move with."""

    names: tuple[str, ...]
    frames: NDArray[np.int32]
    """(m,)."""
    first: NDArray[np.int32]
    """Whose the spheres are: mover i has those from [i] to [i + 1] - 1, (m + 1,)."""
    spheres: Array
    """Centres and radii (s, 4) [m]."""
    slack: Array
    """How far each sticks out of its spheres (m,) [m]."""
    faces: Facets
    """The polyhedron of each (m)."""

    @staticmethod
    def of(rows: Sequence[tuple[str, int, Array, float, Faceted | None]]) -> Movers:
        """From name, frame, spheres (k, 4), slack and faces of each."""
        return Movers(
            tuple(name for name, *_ in rows),
            np.array([frame for _, frame, *_ in rows], np.int32),
            np.cumsum([0, *(len(spheres) for _, _, spheres, *_ in rows)]).astype(np.int32),
            np.concatenate([np.zeros((0, 4)), *(spheres for _, _, spheres, *_ in rows)]),
            np.array([slack for *_, slack, _ in rows], float),
            Facets.of([faces for *_, faces in rows]),
        )

    def __len__(self) -> int:
        return len(self.names)

    def only(self, kept: NDArray[np.bool_]) -> Movers:
        """Those of a mask (m,)."""
        sizes = np.diff(self.first)
        return Movers(
            tuple(compress(self.names, kept.tolist())),
            self.frames[kept],
            np.append(0, np.cumsum(sizes[kept])).astype(np.int32),
            self.spheres[np.repeat(kept, sizes)],
            self.slack[kept],
            self.faces.only(kept),
        )

    def faceless(self) -> Movers:
        """The same with polyhedra that are not known: for checks that are never asked what is sure."""
        return replace(self, faces=Facets.unknown(len(self)))

    def going_with(self, frame: int) -> Movers:
        """The same spheres in another frame than was said."""
        return replace(self, frames=np.full(len(self), frame, np.int32))

    @staticmethod
    def joined(several: Sequence[Movers]) -> Movers:
        """All of several, one after another."""
        sizes = np.concatenate([np.diff(movers.first) for movers in several])
        return Movers(
            tuple(name for movers in several for name in movers.names),
            np.concatenate([movers.frames for movers in several]),
            np.append(0, np.cumsum(sizes)).astype(np.int32),
            np.concatenate([movers.spheres for movers in several]),
            np.concatenate([movers.slack for movers in several]),
            Facets.joined([movers.faces for movers in several]),
        )


@dataclass(frozen=True, slots=True, eq=False)
class Obstacles:
    """o bodies as convex pieces in the frames that they move with."""

    names: tuple[str, ...]
    frames: NDArray[np.int32]
    """(o,)."""
    first: NDArray[np.int32]
    """Whose the pieces are: obstacle i has those from [i] to [i + 1] - 1, (o + 1,)."""
    solids: Solids
    slack: Array
    """How much larger than its pieces what is meant is (o,) [m]."""
    faces: Facets
    """The polyhedron that is meant, if pieces are not all of it (o)."""

    @staticmethod
    def of(rows: Sequence[tuple[str, int, Solids, float, Faceted | None]]) -> Obstacles:
        """From name, frame, pieces, slack and faces of each."""
        return Obstacles(
            tuple(name for name, *_ in rows),
            np.array([frame for _, frame, *_ in rows], np.int32),
            np.cumsum([0, *(len(solids) for _, _, solids, *_ in rows)]).astype(np.int32),
            Solids.joined([solids for _, _, solids, *_ in rows]),
            np.array([slack for *_, slack, _ in rows], float),
            Facets.of([faces for *_, faces in rows]),
        )

    def __len__(self) -> int:
        return len(self.names)

    def only(self, kept: NDArray[np.bool_]) -> Obstacles:
        """Those of a mask (o,)."""
        sizes = np.diff(self.first)
        return Obstacles(
            tuple(compress(self.names, kept.tolist())),
            self.frames[kept],
            np.append(0, np.cumsum(sizes[kept])).astype(np.int32),
            self.solids.only(np.repeat(kept, sizes)),
            self.slack[kept],
            self.faces.only(kept),
        )

    def followed_by(self, other: Obstacles) -> Obstacles:
        """These, then others."""
        return Obstacles(
            self.names + other.names,
            np.concatenate([self.frames, other.frames]),
            np.concatenate([self.first, self.first[-1] + other.first[1:]]),
            Solids.joined([self.solids, other.solids]),
            np.concatenate([self.slack, other.slack]),
            Facets.joined([self.faces, other.faces]),
        )


@dataclass(frozen=True, slots=True, eq=False)
class Watched:
    """w pairs of a mover and an obstacle, by number, that must not be deeper in each other than ``allowed`` [m]."""

    movers: NDArray[np.intp]
    obstacles: NDArray[np.intp]
    allowed: Array

    @staticmethod
    def of(pairs: Sequence[tuple[int, int]]) -> Watched:
        """Pairs that must not touch at all."""
        rows = np.array(pairs, np.intp).reshape(-1, 2)
        return Watched(rows[:, 0], rows[:, 1], np.zeros(len(rows)))

    def followed_by(self, other: Watched) -> Watched:
        """These, then others."""
        return Watched(
            np.concatenate([self.movers, other.movers]),
            np.concatenate([self.obstacles, other.obstacles]),
            np.concatenate([self.allowed, other.allowed]),
        )


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
    part_faces: NDArray[np.int32]
    piece_faces: NDArray[np.int32]
    corner_first: NDArray[np.int32]
    corners: Array
    plane_first: NDArray[np.int32]
    planes: Array
    beyond: Array

    def widen(self) -> None:
        """Tell the groups how far pairs have to be looked at, after ``limit`` or ``sure`` have changed."""
        widths = np.maximum(self.limit, self.sure)
        if len(widths):
            self.group_width[:, 1] = np.maximum.reduceat(widths, self.group_pair[:-1])
            of_clusters = np.maximum.reduceat(self.group_width[:, 1], self.cluster_group[:-1])
            self.group_width[self.cluster_group[:-1], 0] = of_clusters


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
        whole: bool = True,
    ) -> None:
        """``base`` (4, 4) in the map. Not ``whole``: there is more than is told here, and nothing is ever sure."""
        too_many = [movers.names[k] for k in np.flatnonzero(np.diff(movers.first) > SPHERES).tolist()]
        if too_many:
            raise ValueError(f"at most {SPHERES} spheres for one mover, more have {', '.join(too_many)}")
        sizes = np.diff(obstacles.first)[watched.obstacles]
        order = np.lexsort((watched.movers, movers.frames[watched.movers], watched.obstacles))
        order = order[sizes[order] > 0]
        groups = Watched(watched.movers[order], watched.obstacles[order], watched.allowed[order])
        self._movers, self._obstacles, self._groups = movers, obstacles, groups
        self._bodies = _arrays(chain, base, movers, obstacles, groups)
        self._least = self._bodies.limit.copy()
        self._most = np.full(len(self._least), np.inf)
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
        found = self._checker.hits(np.zeros((count, self._dof)) if q is None else q, _rows(bases), deeper)
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
    """Poses (n, 4, 4) as checkers take them (n, 12)."""
    return np.concatenate([bases[:, :3, :3].reshape(-1, 9), bases[:, :3, 3]], axis=1)


def _arrays(chain: Chain, base: Array, movers: Movers, obstacles: Obstacles, groups: Watched) -> Bodies:
    solids, first = obstacles.solids, obstacles.first
    sizes = np.diff(first)[groups.obstacles]
    keys = np.stack([movers.frames[groups.movers], groups.obstacles], axis=1)
    begins = np.flatnonzero(np.append(True, (keys[1:] != keys[:-1]).any(axis=1))[: len(keys)])
    group_pair = np.concatenate([[0], np.cumsum(sizes)])
    part_ball = _balls(movers.spheres, movers.first)
    by_frame = np.argsort(movers.frames, kind="stable")
    frames = FIRST_JOINT + len(chain.carriers)
    of_frames = np.searchsorted(movers.frames[by_frame], np.arange(frames + 1))
    pieces = np.column_stack([solids.centres, solids.reach])
    slack = np.repeat(movers.slack[groups.movers] + obstacles.slack[groups.obstacles], sizes)
    faces, part_faces, piece_faces = _polyhedra(movers, obstacles)
    steps = np.arange(group_pair[-1]) - np.repeat(group_pair[:-1], sizes)
    found = Bodies(
        base=np.concatenate([base[:3, :3].ravel(), base[:3, 3]]),
        cluster=keys[begins].astype(np.int32),
        cluster_group=np.append(begins, len(keys)).astype(np.int32),
        frame_ball=_balls(part_ball[by_frame], of_frames),
        obstacle_frame=obstacles.frames,
        obstacle_ball=_balls(pieces, first),
        group_part=groups.movers.astype(np.int32),
        group_pair=group_pair.astype(np.int32),
        group_width=np.zeros((len(keys), 2)),
        part_ball=part_ball,
        part_sphere=movers.first,
        spheres=movers.spheres,
        pair_piece=(np.repeat(first[groups.obstacles], sizes) + steps).astype(np.int32),
        limit=-np.repeat(groups.allowed, sizes) - TOUCHING,
        sure=slack + BEYOND,
        piece_kind=solids.kinds.astype(np.int32),
        piece=np.concatenate([solids.centres, solids.axes.reshape(-1, 9), solids.half, solids.reach[:, None]], axis=1),
        solids=solids,
        part_frame=movers.frames,
        pair_part=np.repeat(groups.movers, sizes).astype(np.int32),
        piece_frame=np.repeat(obstacles.frames, np.diff(first)),
        part_faces=part_faces,
        piece_faces=piece_faces,
        corner_first=faces.corner_first,
        corners=faces.corners,
        plane_first=faces.plane_first,
        planes=faces.planes,
        beyond=faces.beyond + BEYOND / 2,
    )
    found.widen()
    return found


def _polyhedra(movers: Movers, obstacles: Obstacles) -> tuple[Facets, NDArray[np.int32], NDArray[np.int32]]:
    """Those of movers, obstacles and pieces that are boxes, and which a mover (m,) and a piece (k,) has, -1: none."""
    solids = obstacles.solids
    if not movers.faces.known.any():  # a plane is only between two that are known
        return Facets.unknown(0), np.full(len(movers), -1, np.int32), np.full(len(solids), -1, np.int32)
    faces = Facets.joined([movers.faces, obstacles.faces])
    numbers = np.where(faces.known, np.arange(len(faces)), -1).astype(np.int32)
    of_piece = np.repeat(numbers[len(movers) :], np.diff(obstacles.first))
    boxes = np.flatnonzero((of_piece < 0) & (solids.kinds == 1))
    of_piece[boxes] = len(faces) + np.arange(len(boxes))
    return Facets.joined([faces, _box_faces(solids, boxes)]), numbers[: len(movers)], of_piece


_SIDES = np.array([[side * (axis == k) for k in range(3)] for axis in range(3) for side in (-1.0, 1.0)])
_ENDS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])


def _box_faces(solids: Solids, boxes: NDArray[np.intp]) -> Facets:
    """Of pieces that are boxes (b,)."""
    centres, axes, half = solids.centres[boxes, None], solids.axes[boxes], solids.half[boxes, None]
    corners = centres + np.einsum("bij,bcj->bci", axes, _ENDS * half)
    normals = np.einsum("bij,fj->bfi", axes, _SIDES)
    offsets = np.einsum("bfi,bki->bf", normals, centres) + (np.abs(_SIDES) * half).sum(axis=2)
    planes = np.concatenate([normals, offsets[..., None]], axis=2).reshape(-1, 4)
    counts = np.arange(len(boxes) + 1, dtype=np.int32)
    return Facets(8 * counts, corners.reshape(-1, 3), 6 * counts, planes, np.zeros(len(boxes)))


def _balls(spheres: Array, first: ArrayLike) -> Array:
    """Centres and radii (m, 4) of spheres around groups of spheres (s, 4); group i: those from [i] to [i + 1] - 1."""
    bounds = np.asarray(first, np.intp)
    full = np.flatnonzero(np.diff(bounds))
    balls = np.zeros((len(bounds) - 1, 4))
    if len(full):
        begins, group = bounds[full], np.repeat(np.arange(len(full)), np.diff(bounds)[full])
        low = np.minimum.reduceat(spheres[:, :3] - spheres[:, 3:], begins)
        high = np.maximum.reduceat(spheres[:, :3] + spheres[:, 3:], begins)
        centres = (low + high) / 2
        away = np.sqrt(((spheres[:, :3] - centres[group]) ** 2).sum(axis=1)) + spheres[:, 3]
        balls[full] = np.column_stack([centres, np.maximum.reduceat(away, begins)])
    return balls


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
