"""A quick check whether a chain, with all that moves with it, hits something: spheres against convex pieces.

Frames are numbered: 0 is the map, 1 the base of the chain, then come the children of its moving joints. A sphere that
is inside a piece means a hit. Where all gaps are wider than shapes stick out of their spheres, nothing is hit for sure.
What is left an exact query of PyBullet has to decide; where it finds a hit, :meth:`QuickCheck.learn` keeps the two
bodies farther apart from then on.

Many configurations are checked in one call, in three stages whose costs grow and whose numbers shrink: balls around
mover and obstacle, the ball around the mover against each piece, each sphere against the pieces that are left.
Searches for base poses ask about many bases at once by :meth:`QuickCheck.hit`, planners of arm motions about edges
from one base.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from executive.motion.bodies import BASE, FIRST_JOINT, MAP, Movers, Obstacles, Watched, counts
from executive.motion.kinematics import Chain
from executive.motion.solids import Solids, distances
from planlang.geometry import Array
from planlang.geometry.matrices import inverse, product

TOUCHING = 0.001
"""Depth of spheres inside something that counts as a hit [m]: what exact queries take for touching, and rounding."""
BEYOND = 0.002
"""Distance beyond the slack from which bodies surely do not touch [m]: collision margins of meshes."""
APART = 0.001
"""Distance beyond that of a hit by which bodies are kept apart after it [m]."""
AT_ONCE = 300_000
"""Pairs of balls that are looked at in one go: their arrays (8 MB) stay near the processor."""

Index = NDArray[np.intp]
Found = tuple[Index, Index, Array]
"""Pairs, rows and gaps [m] of what is near, ordered by pair; pairs of an obstacle of several pieces come repeatedly."""


class QuickCheck:
    """Checks configurations of a chain; pairs of a mover and an obstacle are numbered by obstacle, then by mover."""

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
        """Initialize: ``base`` (4, 4) in the map, ``tip`` (4, 4) in the numbered frame with which the hand goes.

        ``whole`` is False if pieces were left out; then no answer is ever that nothing is hit for sure.
        """
        moving = obstacles.frames[watched.obstacles] != MAP
        order = np.lexsort((watched.movers, movers.frames[watched.movers], watched.obstacles, moving))
        order = order[(counts(obstacles.first)[watched.obstacles] > 0)[order]]
        self._mover, self._obstacle = watched.movers[order], watched.obstacles[order]
        self._movers, self._obstacles, self._chain, self._base = movers, obstacles, chain, base
        self._balls = _around(movers.spheres, movers.first)
        pieces = np.column_stack([obstacles.solids.centres, obstacles.solids.reach])
        self._obstacle_balls = _around(pieces, obstacles.first)
        self._boxes = _boxes(obstacles.solids)
        self._pairs = self._together(np.arange(len(order)))
        self._least = -watched.allowed[order] - TOUCHING
        self._limit = self._least
        """A gap below it is a hit (w,)."""
        self._most = np.full(len(self._limit), np.inf)
        self._sure = movers.slack[self._mover] + obstacles.slack[self._obstacle] + BEYOND
        """A gap above it is none for sure (w,)."""
        self._to_hand, self._hand = inverse(tip[0]), tip[1]
        self.whole = whole

    @property
    def names(self) -> tuple[tuple[str, str], ...]:
        """The mover and the obstacle of each pair (w,)."""
        return tuple(map(self._pair, range(len(self._mover))))

    def _pair(self, number: int) -> tuple[str, str]:
        return self._movers.names[self._mover[number]], self._obstacles.names[self._obstacle[number]]

    def hit(self, bases: Array, q: Array | None = None, *, deeper: float = 0.0) -> list[str | None]:
        """Return the first obstacle hit from each base pose (n, 4, 4) at configurations (n, d), or None.

        ``deeper``: how much deeper in something than elsewhere spheres have to be [m]. Without configurations only
        what moves with the base may be among the movers.
        """
        return self._first(self._within(self._limit - deeper, bases, q), len(bases))

    def hand_hit(self, tips: Array) -> list[str | None]:
        """Return the first obstacle in the map that the hand alone hits with the tip at each pose (n, 4, 4), or None.

        What moves as the hand does counts, wherever the rest of the chain is.
        """
        frames = np.zeros((FIRST_JOINT + len(self._chain.carriers), 3, 4, len(tips)))
        frames[MAP] = np.eye(3, 4)[..., None]
        frames[self._hand] = np.moveaxis(product(tips[:, :3], self._to_hand), 0, -1)
        return self._first(self._near(self._limit, frames, self._hand_pairs), len(tips))

    @cached_property
    def _hand_pairs(self) -> _Pairs:
        with_hand = self._movers.frames[self._mover] == self._hand
        return self._together(np.flatnonzero(with_hand & (self._obstacles.frames[self._obstacle] == MAP)))

    def _together(self, pairs: Index) -> _Pairs:
        moves = self._obstacles.frames[self._obstacle[pairs]] != MAP
        standing = pairs[~moves]
        which, pieces = _members(self._obstacles.first, self._obstacle[standing])
        return _Pairs(standing[which], pieces, pairs[moves])

    def _first(self, found: Found, count: int) -> list[str | None]:
        """Return the obstacle of the first pair of each row, None for a row without."""
        names: list[str | None] = [None] * count
        for pair, row in zip(found[0][::-1].tolist(), found[1][::-1].tolist(), strict=True):
            names[row] = self._obstacles.names[self._obstacle[pair]]
        return names

    def clear(self, bases: Array, q: Array) -> NDArray[np.bool_]:
        """Return from which base poses (n, 4, 4) configurations (n, d) hit nothing for sure (n,)."""
        clear = np.full(len(q), self.whole)
        clear[self._within(np.maximum(self._limit, self._sure), bases, q)[1]] = False
        return clear

    def sure(self, q: Array) -> NDArray[np.bool_]:
        """Return which configurations (n, d) hit nothing for sure (n,)."""
        return self.clear(self._here(len(q)), q)

    def doubtful(self, q: Array) -> list[list[tuple[str, str]] | None]:
        """Return for configurations (n, d) the movers and obstacles that may touch, no others do; None if not known."""
        if not self.whole:
            return [None] * len(q)
        pairs, rows, _ = self._within(np.maximum(self._limit, self._sure), self._here(len(q)), q)
        found: list[dict[tuple[str, str], None]] = [{} for _ in q]
        for pair, row in zip(pairs.tolist(), rows.tolist(), strict=True):
            found[row][self._pair(pair)] = None
        return [list(one) for one in found]

    def free(self, q: Array) -> NDArray[np.bool_]:
        """Return at which configurations (n, d) no sphere is inside something (n,)."""
        free = np.ones(len(q), bool)
        free[self._within(self._limit, self._here(len(q)), q)[1]] = False
        return free

    def gaps(self, q: Array, within: float = np.inf) -> Array:
        """Return the smallest gap of each pair (w,) at a configuration (d,) [m], negative inside.

        Infinite for pairs that are sure to be farther apart than ``within`` [m].
        """
        pairs, _, gaps = self._within(self._sure + within, self._here(1), q[None])
        found = np.full(len(self._mover), np.inf)
        np.minimum.at(found, pairs, gaps)
        return found

    def keep(self, distance: float, ends: Iterable[Array]) -> None:
        """Keep everything so far apart [m], or, where that is less, as far as it is at the nearer of ``ends`` (d,).

        The ends are taken to be free. Forgets what was learnt.
        """
        self._most = np.min([self.gaps(q, distance + NEAREST) for q in ends], axis=0, initial=np.inf) - TOUCHING
        self._limit = np.minimum(self._least + TOUCHING + distance, self._most)

    def learn(self, q: Array, pairs: Iterable[tuple[str, str]]) -> None:
        """Learn that bodies touch at a configuration (d,): keep them farther apart, as far as the ends allow."""
        touching = {frozenset(pair) for pair in pairs}
        hit = np.array([frozenset(pair) in touching for pair in self.names], bool)
        raised = np.minimum(self.gaps(q, NEAREST) + APART, self._most)
        # among the shapes of a link only the ones that may have touched
        hit &= raised <= raised[hit].min(initial=np.inf) + NEAREST
        self._limit = np.where(hit, np.maximum(self._limit, raised), self._limit)

    def _here(self, count: int) -> Array:
        return np.broadcast_to(self._base, (count, 4, 4))

    def _within(self, width: Array, bases: Array, q: Array | None) -> Found:
        """Return what is nearer than the width (w,) of its pair, from base poses (n, 4, 4) at configurations (n, d)."""
        moving = np.zeros((0, 3, 4, len(bases))) if q is None else self._chain.frame_rows(q)
        base = np.moveaxis(bases[:, :3], 0, -1)
        frames = np.empty((FIRST_JOINT + len(moving), 3, 4, len(bases)))
        frames[MAP], frames[BASE] = np.eye(3, 4)[..., None], base
        np.einsum("ijn,fjkn->fikn", base[:, :3], moving, out=frames[FIRST_JOINT:])
        frames[FIRST_JOINT:, :, 3] += base[:, 3]
        return self._near(width, frames, self._pairs)

    def _near(self, width: Array, frames: Array, pairs: _Pairs) -> Found:
        """Return which of some pairs are nearer than their width (w,) in frames (f, 3, 4, n)."""
        count, size = frames.shape[3], len(pairs.standing) + len(pairs.moving)
        if not count or not size:
            return np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros(0)
        size = max(1, AT_ONCE // size)
        parts = [self._near_in(width, frames[..., k : k + size], pairs) for k in range(0, count, size)]
        if len(parts) == 1:
            return parts[0]
        starts = np.repeat(np.arange(len(parts)) * size, [len(part[0]) for part in parts])
        pair, row, gap = (np.concatenate([np.zeros(0, np.intp), *column]) for column in zip(*parts, strict=True))
        order = np.lexsort((row + starts, pair))
        return pair[order], (row + starts)[order], gap[order]

    def _near_in(self, width: Array, frames: Array, pairs: _Pairs) -> Found:
        movers, obstacles, solids = self._movers, self._obstacles, self._obstacles.solids
        middles = _placed(self._balls, movers.frames, frames)
        standing, moving = self._near_standing(width, middles, pairs), self._near_moving(width, middles, frames, pairs)
        pair, piece, row, middle = (np.concatenate(several) for several in zip(standing, moving, strict=True))
        # the ball of the mover and each piece
        left = np.flatnonzero(_gaps(middle, self._balls[self._mover[pair], 3], solids, piece) < width[pair])
        pair, piece, row = pair[left], piece[left], row[left]
        # each sphere of the mover and each piece that is left
        mover = self._mover[pair]
        mine = frames[movers.frames[mover], :, :, row]
        theirs = frames[obstacles.frames[self._obstacle[pair]], :, :, row]
        turn = np.einsum("kji,kjl->kil", theirs[..., :3], mine[..., :3])
        shift = _back(theirs, mine[..., 3])
        each, sphere = _members(movers.first, mover)
        points = np.einsum("kij,kj->ki", turn[each], movers.spheres[sphere, :3]) + shift[each]
        gap = _gaps(points, movers.spheres[sphere, 3], solids, piece[each])
        if len(pair):
            gap = np.minimum.reduceat(gap, np.flatnonzero(np.diff(each, prepend=-1)))
        close = gap < width[pair]
        return pair[close], row[close], gap[close]

    def _near_standing(self, width: Array, middles: Array, pairs: _Pairs) -> tuple[Index, Index, Index, Array]:
        """Return pairs, standing pieces and rows that are near by ball and box, and the middles of the balls."""
        mover = self._mover[pairs.standing]
        far = np.maximum(self._balls[mover, 3] + width[pairs.standing], 0.0)[:, None]
        low, high = (corners[pairs.pieces] for corners in self._boxes)
        # where each mover is in any row: most pieces are far from all of it
        below, above = middles.min(axis=2)[mover], middles.max(axis=2)[mover]
        number = np.flatnonzero(((below - far < high) & (above + far > low)).all(axis=1))
        centre, half = (high + low)[number, :, None] / 2, (high - low)[number, :, None] / 2
        away = np.maximum(np.abs(middles[mover[number]] - centre) - half, 0.0)
        near, row = _nearer(away, far[number])
        number = number[near]
        return pairs.standing[number], pairs.pieces[number], row, middles[mover[number], :, row]

    def _near_moving(
        self, width: Array, middles: Array, frames: Array, pairs: _Pairs
    ) -> tuple[Index, Index, Index, Array]:
        """Return the same for what moves with the robot, by balls, with middles in the frames of obstacles."""
        mover, obstacle, obstacles = self._mover[pairs.moving], self._obstacle[pairs.moving], self._obstacles
        far = self._balls[mover, 3] + width[pairs.moving]
        others = _placed(self._obstacle_balls, obstacles.frames, frames)
        reach = np.maximum(far + self._obstacle_balls[obstacle, 3], 0.0)[:, None]
        number, row = _nearer(middles[mover] - others[obstacle], reach)
        middle = _back(frames[obstacles.frames[obstacle[number]], :, :, row], middles[mover[number], :, row])
        which, piece = _members(obstacles.first, obstacle[number])
        away, reach = (
            middle[which] - obstacles.solids.centres[piece],
            obstacles.solids.reach[piece] + far[number[which]],
        )
        near = np.flatnonzero((_squares(away) < reach * reach) & (reach > 0.0))
        which, piece = which[near], piece[near]
        return pairs.moving[number[which]], piece, row[which], middle[which]


@dataclass(frozen=True, slots=True, eq=False)
class _Pairs:
    """Pairs that are looked at together: with each piece that stands in the map, and with what moves."""

    standing: Index
    """Pairs (s,), one entry for each piece."""
    pieces: Index
    """(s,)."""
    moving: Index


NEAREST = 0.01
"""Shapes of a body whose gaps differ by less than this may all have been the one that touches [m]: spheres' slack."""


def _around(spheres: Array, first: Index) -> Array:
    """Return balls (m, 4) around groups of spheres (s, 4), given where each group begins and the last ends (m + 1,)."""
    sizes = counts(first)
    full = np.flatnonzero(sizes)
    balls = np.zeros((len(first) - 1, 4))
    if len(full):
        begins, group = first[full], np.repeat(np.arange(len(full)), sizes[full])
        low = np.minimum.reduceat(spheres[:, :3] - spheres[:, 3:], begins)
        high = np.maximum.reduceat(spheres[:, :3] + spheres[:, 3:], begins)
        centres = (low + high) / 2
        away = np.sqrt(((spheres[:, :3] - centres[group]) ** 2).sum(axis=1)) + spheres[:, 3]
        balls[full, :3], balls[full, 3] = centres, np.maximum.reduceat(away, begins)
    return balls


def _boxes(solids: Solids) -> tuple[Array, Array]:
    """Return lower and upper corners (k, 3) of boxes around pieces, along the axes of the frame they are in."""
    half = np.minimum(np.einsum("kij,kj->ki", np.abs(solids.axes), solids.extents), solids.reach[:, None])
    return solids.centres - half, solids.centres + half


def _placed(balls: Array, numbers: NDArray[np.intp], frames: Array) -> Array:
    """Return the centres (m, 3, n) in the map of balls (m, 4) in frames of these numbers (m,)."""
    centres = np.repeat(balls[:, :3, None], frames.shape[3], axis=2)
    moving = np.flatnonzero(numbers != MAP)
    of = frames[numbers[moving]]
    centres[moving] = np.einsum("mijn,mj->min", of[:, :, :3], balls[moving, :3]) + of[:, :, 3]
    return centres


def _nearer(away: Array, far: Array) -> tuple[Index, Index]:
    """Return which vectors (k, 3, n) are shorter than some lengths (k, 1): numbers in k, then in n."""
    numbers, rows = np.nonzero(np.einsum("kin,kin->kn", away, away) < far * far)
    return numbers, rows


def _squares(vectors: Array) -> Array:
    """Return the squared lengths (k,) of vectors (k, 3)."""
    return np.asarray(np.einsum("ki,ki->k", vectors, vectors))


def _back(frames: Array, points: Array) -> Array:
    """Return points (k, 3) of the map as they are in frames (k, 3, 4)."""
    return np.asarray(np.einsum("kji,kj->ki", frames[..., :3], points - frames[..., 3]))


def _members(first: Index, groups: Index) -> tuple[Index, Index]:
    """Return for groups (k,) of which each member is, by position, and the number of the member."""
    sizes = counts(first)[groups]
    which = np.repeat(np.arange(len(groups)), sizes)
    return which, np.arange(len(which)) - np.repeat(np.cumsum(sizes) - sizes, sizes) + first[groups][which]


def _gaps(points: Array, radii: Array, solids: Solids, pieces: Index) -> Array:
    """Return the gaps (k,) between spheres and pieces, each pair in one frame."""
    local = np.einsum("kij,ki->kj", solids.axes[pieces], points - solids.centres[pieces])
    return distances(local, solids.half[pieces], solids.kinds[pieces]) - radii
