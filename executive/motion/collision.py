"""A quick check whether a chain, with all that moves with it, hits something: spheres against convex pieces.

Frames are numbered: 0 is the map, 1 the base of the chain, then come the children of its moving joints. A sphere that
is inside a piece means a hit. Where all gaps are wider than shapes stick out of their spheres, or an axis separates the
shapes themselves (:func:`are_apart`), nothing is hit for sure. What is left an exact query of PyBullet has to decide;
where it finds a hit, :meth:`QuickCheck.learn` keeps the two bodies farther apart from then on.

Many configurations are checked in one call, in three stages whose costs grow and whose numbers shrink: balls around
mover and obstacle, the ball around the mover against each piece, each sphere against the pieces that are left.
Searches for base poses ask about many bases at once by :meth:`QuickCheck.hit`, planners of arm motions about edges
from one base.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from executive.motion.bodies import BASE, FIRST_JOINT, MAP, Bodies, Index, Pairs, Solids, counts, distances
from executive.motion.separation import are_apart, squares
from planlang.geometry import Array
from planlang.geometry.matrices import inverse, moved, product
from planlang.records import dataclass

if TYPE_CHECKING:  # a plain run moves one arm at a time
    from executive.motion.arm_group import Movable

TOUCHING = 0.001
"""Depth of spheres inside something that counts as a hit [m]: what exact queries take for touching, and rounding."""
BEYOND = 0.002
"""Distance beyond the slack from which bodies surely do not touch [m]: collision margins of meshes."""
APART = 0.001
"""Distance beyond that of a hit by which bodies are kept apart after it [m]."""
MOST_CLOSE = 2
"""Pairs that are asked about before all others: of the PR2's arms upper arm and torso, which always nearly touch."""
ALIKE = 1e-6
"""Distance by which the spheres of hands that are built alike may differ [m]: rounding of what PyBullet tells."""
AT_ONCE = 300_000
"""Pairs of balls that are looked at in one go: their arrays (8 MB) stay near the processor."""
FEW = 1000
"""Pairs whose spheres are looked at in one go, 24 of a mover: their arrays (0.6 MB) stay in the processor's cache."""

Found = tuple[Index, Index, Array, Index]
"""Pairs, rows, gaps [m] and pieces of what is near, by pair; those of an obstacle of several pieces come repeatedly."""


class QuickCheck:
    """Checks configurations of a chain; pairs of a mover and an obstacle are numbered by obstacle, then by mover."""

    def __init__(
        self,
        chain: Movable,
        base: Array,
        movers: Bodies,
        obstacles: Bodies,
        watched: Pairs,
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
        self._balls, self._obstacle_balls = (_around(bodies.solids, bodies.first) for bodies in (movers, obstacles))
        self._boxes = _boxes(obstacles.solids)
        self._spheres = _padded(movers)
        self._pairs = self._together(np.arange(len(order)))
        self._least = -watched.allowed[order] - TOUCHING
        self._limit = self._least
        """A gap below it is a hit (w,)."""
        self._most = np.full(len(self._limit), np.inf)
        self._sure = movers.slack[self._mover] + obstacles.slack[self._obstacle] + BEYOND
        """A gap above it is none for sure (w,)."""
        self._close: list[tuple[int, int]] = []
        """Pairs and pieces that were not apart when it was asked, asked first from then on."""
        self._shaped = np.array([bool(hulls) for hulls in obstacles.hulls], bool)
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
        return self._first(self._limit - deeper, self._frames(bases, q), self._pairs)

    def hand_hit(self, tips: Array) -> list[str | None]:
        """Return the first obstacle in the map that the hand alone hits with the tip at each pose (n, 4, 4), or None.

        What moves as the hand does counts, wherever the rest of the chain is.
        """
        frames = np.zeros((FIRST_JOINT + len(self._chain.carriers), 3, 4, len(tips)))
        frames[MAP] = np.eye(3, 4)[..., None]
        frames[self._hand] = np.moveaxis(product(tips[:, :3], self._to_hand), 0, -1)
        return self._first(self._limit, frames, self._hand_pairs)

    def has_same_hand(self, other: QuickCheck) -> bool:
        """Return whether another check's hand hits the same at the same poses of its tip: arms mostly come in pairs."""
        each = zip(self._in_hand, other._in_hand, strict=True)
        return all(one.shape == two.shape and np.allclose(one, two, rtol=0.0, atol=ALIKE) for one, two in each)

    @cached_property
    def _in_hand(self) -> tuple[Array | Index, ...]:
        """What decides where the hand hits: pieces and limits of its pairs, and their spheres in the tip's frame."""
        pairs, solids, others = self._hand_pairs, self._movers.solids, self._obstacles.solids
        each, sphere = _members(self._movers.first, self._mover[pairs.standing])
        spheres = each, moved(inverse(self._to_hand), solids.centres[sphere]), solids.reach[sphere]
        return *spheres, self._limit[pairs.standing], others.centres[pairs.pieces], others.half[pairs.pieces]

    @cached_property
    def _hand_pairs(self) -> _Pairs:
        with_hand = self._movers.frames[self._mover] == self._hand
        return self._together(np.flatnonzero(with_hand & (self._obstacles.frames[self._obstacle] == MAP)))

    def _together(self, pairs: Index) -> _Pairs:
        moves = self._obstacles.frames[self._obstacle[pairs]] != MAP
        standing = pairs[~moves]
        which, pieces = _members(self._obstacles.first, self._obstacle[standing])
        return _Pairs(standing[which], pieces, pairs[moves])

    def _first(self, width: Array, frames: Array, pairs: _Pairs) -> list[str | None]:
        """Return the obstacle of the first pair that is hit in each of frames (f, 3, 4, n), None where none is."""
        found = self._near(width, frames, pairs, only_first=True)
        names: list[str | None] = [None] * frames.shape[3]
        for pair, row in zip(found[0][::-1].tolist(), found[1][::-1].tolist(), strict=True):
            names[row] = self._obstacles.names[self._obstacle[pair]]
        return names

    def clear(self, bases: Array, q: Array) -> NDArray[np.bool_]:
        """Return from which base poses (n, 4, 4) configurations (n, d) hit nothing for sure (n,)."""
        clear = np.full(len(q), self.whole)
        frames = self._frames(bases, q)
        for key in self._close:  # links next to each other are hardly ever apart for sure: the rest is spared then
            clear[clear] = self._are_apart(*key, frames[..., clear])
        rows = np.flatnonzero(clear)
        _, hit, groups = self._unsure(frames[..., rows])
        clear[rows[hit]] = False
        for pair, piece, some in groups:
            left = rows[some][clear[rows[some]]]
            if len(left):
                clear[left] = self._are_apart(pair, piece, frames[..., left])
                if len(self._close) < MOST_CLOSE and not clear[left].any():
                    self._close.append((pair, piece))
        return clear

    def sure(self, q: Array) -> NDArray[np.bool_]:
        """Return which configurations (n, d) hit nothing for sure (n,)."""
        return self.clear(self._here(len(q)), q)

    def doubtful(self, q: Array) -> list[list[tuple[str, str]] | None]:
        """Return for configurations (n, d) the movers and obstacles that may touch, no others do; None if not known."""
        if not self.whole:
            return [None] * len(q)
        frames = self._frames(self._here(len(q)), q)
        pairs, rows, groups = self._unsure(frames)
        found: list[dict[int, None]] = [{} for _ in q]
        for pair, row in zip(pairs.tolist(), rows.tolist(), strict=True):
            found[row][pair] = None
        for pair, piece, several in groups:
            for row in several[~self._are_apart(pair, piece, frames[..., several])].tolist():
                found[row][pair] = None
        return [[self._pair(pair) for pair in one] for one in found]

    def free(self, q: Array) -> NDArray[np.bool_]:
        """Return at which configurations (n, d) no sphere is inside something (n,)."""
        free = np.ones(len(q), bool)
        free[self._near(self._limit, self._frames(self._here(len(q)), q), self._pairs, only_first=True)[1]] = False
        return free

    def gaps(self, q: Array, within: float = np.inf) -> Array:
        """Return the smallest gap of each pair (w,) at a configuration (d,) [m], negative inside.

        Infinite for pairs that are sure to be farther apart than ``within`` [m].
        """
        pairs, _, gaps, _ = self._within(self._sure + within, self._here(1), q[None])
        found = np.full(len(self._mover), np.inf)
        np.minimum.at(found, pairs, gaps)
        return found

    def room(self, q: Array, within: float, among: Index | None = None) -> tuple[Index, Index, Array]:
        """Return pairs and rows (k,) of configurations (n, d) that have at most so much room [m], and how much (k,).

        Room is what a gap has beyond the least that the pair is to keep, negative where it has less. ``among``: the
        only pairs that are looked at.
        """
        pairs = self._pairs if among is None else self._together(among)
        pair, row, gap, _ = self._near(self._limit + within, self._frames(self._here(len(q)), q), pairs)
        order = np.lexsort((row, pair))
        pair, row, gap = pair[order], row[order], gap[order]
        first = np.flatnonzero(np.diff(pair * len(q) + row, prepend=-1))
        room = np.minimum.reduceat(gap - self._limit[pair], first) if len(first) else gap
        return pair[first], row[first], room

    def keep(self, distance: float, ends: Iterable[Array]) -> None:
        """Keep everything so far apart [m], or, where that is less, as far as it is at the nearer of ``ends`` (d,).

        The ends are taken to be free. Forgets what was learnt.
        """
        self._most = np.min([self.gaps(q, distance + NEAREST) for q in ends], axis=0, initial=np.inf) - TOUCHING
        self._limit = np.minimum(self._least + TOUCHING + distance, self._most)

    def learn(self, q: Array, pairs: Iterable[tuple[str, str]], by: float = APART) -> None:
        """Learn that bodies touch at a configuration (d,): keep them farther apart [m], as far as the ends allow."""
        touching = {frozenset(pair) for pair in pairs}
        hit = np.array([frozenset(pair) in touching for pair in self.names], bool)
        raised = np.minimum(self.gaps(q, NEAREST + by) + by, self._most)
        # among the shapes of a link only the ones that may have touched
        hit &= raised <= raised[hit].min(initial=np.inf) + NEAREST
        self._limit = np.where(hit, np.maximum(self._limit, raised), self._limit)

    def _here(self, count: int) -> Array:
        return np.broadcast_to(self._base, (count, 4, 4))

    def _within(self, width: Array, bases: Array, q: Array | None) -> Found:
        """Return what is nearer than the width (w,) of its pair, from base poses (n, 4, 4) at configurations (n, d)."""
        return self._near(width, self._frames(bases, q), self._pairs)

    def _frames(self, bases: Array, q: Array | None) -> Array:
        """Return all frames (f, 3, 4, n) from base poses (n, 4, 4) at configurations (n, d)."""
        moving = np.zeros((0, 3, 4, len(bases))) if q is None else self._chain.frame_rows(q)
        base = np.moveaxis(bases[:, :3], 0, -1)
        frames = np.empty((FIRST_JOINT + len(moving), 3, 4, len(bases)))
        frames[MAP], frames[BASE] = np.eye(3, 4)[..., None], base
        np.einsum("ijn,fjkn->fikn", base[:, :3], moving, out=frames[FIRST_JOINT:])
        frames[FIRST_JOINT:, :, 3] += base[:, 3]
        return frames

    def _unsure(self, frames: Array) -> tuple[Index, Index, list[tuple[int, int, Index]]]:
        """Return pairs and rows of frames (f, 3, 4, n) that hit, and pairs, pieces and their rows that may, or may not.

        The nearest of these come first. The piece of an obstacle that is looked at as a whole is -1.
        """
        pair, row, gap, piece = self._near(np.maximum(self._limit, self._sure), frames, self._pairs)
        hit = gap < self._limit[pair]
        order = np.flatnonzero(~hit)[np.argsort(gap[~hit], kind="stable")]
        piece = np.where(self._shaped[self._obstacle[pair]], -1, piece)
        groups: dict[tuple[int, int], dict[int, None]] = {}
        for key in zip(pair[order].tolist(), piece[order].tolist(), row[order].tolist(), strict=True):
            groups.setdefault(key[:2], {})[key[2]] = None
        return pair[hit], row[hit], [(*key, np.array(list(rows), np.intp)) for key, rows in groups.items()]

    def _are_apart(self, pair: int, piece: int, frames: Array) -> NDArray[np.bool_]:
        """Return in which of frames (f, 3, 4, n) the shapes of a pair surely do not touch (n,)."""
        mover, obstacle = int(self._mover[pair]), int(self._obstacle[pair])
        ((mine, beyond),) = self._movers.spans(mover, -1)
        here, there = (
            np.moveaxis(frames[k], -1, 0) for k in (self._movers.frames[mover], self._obstacles.frames[obstacle])
        )
        turns, shifts = _relative(there, here)
        apart = np.ones(len(turns), bool)  # as long as none of the obstacle's shapes may be touched
        for points, further in self._obstacles.spans(obstacle, piece):
            apart[apart] = are_apart(mine, points, turns[apart], shifts[apart], beyond + further + BEYOND)
        return np.asarray(apart)

    def _near(self, width: Array, frames: Array, pairs: _Pairs, *, only_first: bool = False) -> Found:
        """Return which of some pairs are nearer than their width (w,) in frames (f, 3, 4, n); some after the first."""
        count, size = frames.shape[3], len(pairs.standing) + len(pairs.moving)
        if not count or not size:
            none = np.zeros(0, np.intp)
            return none, none, np.zeros(0), none
        size = max(1, AT_ONCE // size)
        find = self._first_in if only_first else self._near_in
        parts = [find(width, frames[..., k : k + size], pairs) for k in range(0, count, size)]
        if len(parts) == 1:
            return parts[0]
        starts = np.repeat(np.arange(len(parts)) * size, [len(part[0]) for part in parts])
        pair, row, gap, piece = (np.concatenate(column) for column in zip(*parts, strict=True))
        order = np.lexsort((row + starts, pair))
        return pair[order], (row + starts)[order], gap[order], piece[order]

    def _near_in(self, width: Array, frames: Array, pairs: _Pairs) -> Found:
        rows = _by_row(frames)
        return self._near_by_spheres(width, rows, *self._near_by_balls(width, frames, rows, pairs))

    def _first_in(self, width: Array, frames: Array, pairs: _Pairs) -> Found:
        """Return the first pair of each row that is near, and some more; as few as possible are looked at."""
        rows = _by_row(frames)
        pair, piece, row = self._near_by_balls(width, frames, rows, pairs)
        order = np.argsort(row, kind="stable")
        rank = np.empty(len(row), np.intp)
        rank[order] = np.arange(len(row)) - np.searchsorted(row[order], row[order])
        found, left, most = [], np.arange(len(row)), 1
        while len(left):
            now = left[rank[left] < most]
            found.append(self._near_by_spheres(width, rows, pair[now], piece[now], row[now]))
            hit = np.zeros(frames.shape[3], bool)
            hit[found[-1][1]] = True
            left, most = left[(rank[left] >= most) & ~hit[row[left]]], 3 * most
        if len(found) < 2:
            return found[0] if found else (pair, row, np.zeros(0), piece)
        several = [np.concatenate(column) for column in zip(*found, strict=True)]
        inside = np.argsort(several[0], kind="stable")
        return several[0][inside], several[1][inside], several[2][inside], several[3][inside]

    def _near_by_balls(self, width: Array, frames: Array, rows: Array, pairs: _Pairs) -> tuple[Index, Index, Index]:
        """Return pairs, pieces of their obstacles and rows where the ball around the mover is near, in order."""
        middles = _placed(self._balls, self._movers.frames, frames)
        standing = self._near_standing(width, middles, pairs)
        moving = self._near_moving(width, middles, frames, rows, pairs)
        pair, piece, row, middle = (np.concatenate(several) for several in zip(standing, moving, strict=True))
        solids = self._obstacles.solids
        local = np.einsum("kij,ki->jk", solids.axes[piece], middle - solids.centres[piece])
        gap = _gaps(local, self._balls[self._mover[pair], 3], solids, piece)
        left = np.flatnonzero(gap < width[pair])
        return pair[left], piece[left], row[left]

    def _near_by_spheres(self, width: Array, frames: Array, pair: Index, piece: Index, row: Index) -> Found:
        """Return which of pairs, pieces of their obstacles and rows (k,) are near by a sphere of the mover."""
        gap = np.empty(len(pair))
        balls = self._obstacles.solids.kinds[piece] == 3
        for some, find in (
            (np.flatnonzero(balls), self._gaps_to_balls),
            (np.flatnonzero(~balls), self._gaps_to_pieces),
        ):
            for few in (some[first : first + FEW] for first in range(0, len(some), FEW)):
                mover, obstacle = self._mover[pair[few]], self._obstacle[pair[few]]
                theirs = frames[row[few], self._obstacles.frames[obstacle]]
                turn, shift = _relative(theirs, frames[row[few], self._movers.frames[mover]])
                gap[few] = find(mover, piece[few], turn, shift)
        close = gap < width[pair]
        return pair[close], row[close], gap[close], piece[close]

    def _gaps_to_balls(self, mover: Index, piece: Index, turn: Array, shift: Array) -> Array:
        """Return the gaps (k,) between movers, with poses (k, 3, 3), (k, 3) in the obstacles' frames, and balls."""
        centres, radii = self._spheres
        solids = self._obstacles.solids
        ball = np.einsum("kji,kj->ki", turn, solids.centres[piece] - shift)  # in the frame of the mover
        away = centres[mover] - ball[:, :, None]
        away *= away
        return np.asarray((np.sqrt(away.sum(axis=1)) - radii[mover]).min(axis=1) - solids.half[piece, 0])

    def _gaps_to_pieces(self, mover: Index, piece: Index, turn: Array, shift: Array) -> Array:
        """Return the same for boxes and cylinders."""
        centres, radii = self._spheres
        solids = self._obstacles.solids
        axes, spheres = solids.axes[piece], centres[mover]
        turn = np.einsum("kji,kjl->kil", axes, turn)
        points = np.repeat(np.einsum("kji,kj->ki", axes, shift - solids.centres[piece])[:, :, None], len(radii[0]), 2)
        for axis in range(3):
            points += turn[:, :, axis, None] * spheres[:, None, axis]
        gaps = distances(np.moveaxis(points, 1, 0), solids.half[piece].T[:, :, None], solids.kinds[piece])
        return np.asarray((gaps - radii[mover]).min(axis=1))

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
        self, width: Array, middles: Array, frames: Array, rows: Array, pairs: _Pairs
    ) -> tuple[Index, Index, Index, Array]:
        """Return the same for what moves with the robot, by balls, with middles in the frames of obstacles."""
        mover, obstacle, obstacles = self._mover[pairs.moving], self._obstacle[pairs.moving], self._obstacles
        far = self._balls[mover, 3] + width[pairs.moving]
        others = _placed(self._obstacle_balls, obstacles.frames, frames)
        reach = np.maximum(far + self._obstacle_balls[obstacle, 3], 0.0)[:, None]
        number, row = _nearer(middles[mover] - others[obstacle], reach)
        middle = _back(rows[row, obstacles.frames[obstacle[number]]], middles[mover[number], :, row])
        which, piece = _members(obstacles.first, obstacle[number])
        away, reach = (
            middle[which] - obstacles.solids.centres[piece],
            obstacles.solids.reach[piece] + far[number[which]],
        )
        near = np.flatnonzero((squares(away) < reach * reach) & (reach > 0.0))
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


def _around(solids: Solids, first: Index) -> Array:
    """Return balls (m, 4) around groups of pieces, given where each group begins and the last ends (m + 1,)."""
    spheres = np.column_stack([solids.centres, solids.reach])
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


def _by_row(frames: Array) -> Array:
    """Return frames (f, 3, 4, n) as (n, f, 3, 4): all numbers of one lie together."""
    return np.ascontiguousarray(np.moveaxis(frames, -1, 0))


def _padded(bodies: Bodies) -> tuple[Array, Array]:
    """Return the spheres of bodies: centres (m, 3, s) and radii (m, s); those that make up the number are nowhere."""
    sizes = counts(bodies.first)
    body = np.repeat(np.arange(len(bodies)), sizes)
    number = np.arange(len(body)) - bodies.first[body]
    most = int(sizes.max(initial=1))
    centres, radii = np.zeros((len(bodies), 3, most)), np.full((len(bodies), most), -np.inf)
    centres[body, :, number], radii[body, number] = bodies.solids.centres, bodies.solids.reach
    return centres, radii


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


def _relative(frames: Array, others: Array) -> tuple[Array, Array]:
    """Return rotations (k, 3, 3) and positions (k, 3) of other frames (k, 3, 4) in frames (k, 3, 4)."""
    return np.einsum("kji,kjl->kil", frames[..., :3], others[..., :3]), _back(frames, others[..., 3])


def _back(frames: Array, points: Array) -> Array:
    """Return points (k, 3) of the map as they are in frames (k, 3, 4)."""
    return np.asarray(np.einsum("kji,kj->ki", frames[..., :3], points - frames[..., 3]))


def _members(first: Index, groups: Index) -> tuple[Index, Index]:
    """Return for groups (k,) of which each member is, by position, and the number of the member."""
    sizes = counts(first)[groups]
    which = np.repeat(np.arange(len(groups)), sizes)
    return which, np.arange(len(which)) - np.repeat(np.cumsum(sizes) - sizes, sizes) + first[groups][which]


def _gaps(local: Array, radii: Array, solids: Solids, pieces: Index) -> Array:
    """Return the gaps (k,) between spheres, at points (3, k) of the frames of pieces, and these pieces."""
    return distances(local, solids.half.T[:, pieces], solids.kinds[pieces]) - radii
