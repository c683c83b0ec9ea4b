"""Quick collision check of a chain, with all that moves with it: spheres against convex pieces.

Frames are numbered: 0 is the map, 1 the base of the chain, then come the children of its moving joints. A sphere that
penetrates a piece is a hit. Where all gaps exceed the protrusion of shapes from their spheres, or a separating axis of
the shapes themselves is found (:func:`are_apart`), a configuration is surely free. PyBullet's exact query decides about
the rest; where it finds a hit, :meth:`QuickCheck.learn` keeps the two bodies farther apart from then on.

A call checks many configurations, in three stages of growing cost on shrinking sets: bounding balls of mover and
obstacle, the mover's ball against each piece, each sphere against the remaining pieces. The search for base poses asks
about many bases at once by :meth:`QuickCheck.hit`, arm planners about edges from one base.
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
"""Penetration of spheres that counts as a hit [m]: the tolerance of exact queries, and rounding."""
BEYOND = 0.002
"""Distance beyond the slack from which bodies surely do not touch [m]: collision margins of meshes."""
APART = 0.001
"""Additional distance kept between bodies after a hit [m]."""
MOST_CLOSE = 2
"""Pairs that are tested before all others: for the PR2, upper arm and torso, which always nearly touch."""
ALIKE = 1e-6
"""Largest difference between the spheres of identically built hands [m]: PyBullet's rounding."""
AT_ONCE = 300_000
"""Pairs of balls tested together: their arrays (8 MB) stay in the cache."""
FEW = 1000
"""Pairs whose spheres are tested together, 24 per mover: their arrays (0.6 MB) stay in the cache."""

Found = tuple[Index, Index, Array, Index]
"""Pairs, rows, gaps [m] and pieces that are near, sorted by pair; a pair may occur once per piece of its obstacle."""


class QuickCheck:
    """Collision check of a chain's configurations; pairs of mover and obstacle are sorted by obstacle, then mover."""

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
        """Create the check: ``base`` (4, 4) in the map, ``tip`` (4, 4) in the numbered frame that carries the hand.

        ``whole`` is False if pieces were left out; then no configuration is surely free.
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
        """Gap below which a pair is a hit (w,)."""
        self._most = np.full(len(self._limit), np.inf)
        self._sure = movers.slack[self._mover] + obstacles.slack[self._obstacle] + BEYOND
        """Gap above which a pair is surely free (w,)."""
        self._close: list[tuple[int, int]] = []
        """Pairs and pieces that were never separable before; they are tested first."""
        self._shaped = np.array([bool(hulls) for hulls in obstacles.hulls], bool)
        self._to_hand, self._hand = inverse(tip[0]), tip[1]
        self.whole = whole

    @property
    def names(self) -> tuple[tuple[str, str], ...]:
        """Mover and obstacle of each pair (w,)."""
        return tuple(map(self._pair, range(len(self._mover))))

    def _pair(self, number: int) -> tuple[str, str]:
        return self._movers.names[self._mover[number]], self._obstacles.names[self._obstacle[number]]

    def hit(self, bases: Array, q: Array | None = None, *, deeper: float = 0.0) -> list[str | None]:
        """Find the first obstacle hit from each base pose (n, 4, 4) at configurations (n, d), or None.

        ``deeper`` raises the penetration that counts [m]. Without configurations all movers must move with the base.
        """
        return self._first(self._limit - deeper, self._frames(bases, q), self._pairs)

    def hand_hit(self, tips: Array) -> list[str | None]:
        """Find the first obstacle in the map that the hand alone hits with the tip at each pose (n, 4, 4), or None.

        All movers in the frame of the hand count, wherever the rest of the chain is.
        """
        return self._first(self._limit, self._hand_frames(tips), self._hand_pairs)

    def _hand_frames(self, tips: Array) -> Array:
        frames = np.zeros((FIRST_JOINT + len(self._chain.carriers), 3, 4, len(tips)))
        frames[MAP] = np.eye(3, 4)[..., None]
        frames[self._hand] = np.moveaxis(product(tips[:, :3], self._to_hand), 0, -1)
        return frames

    def has_same_hand(self, other: QuickCheck) -> bool:
        """Check whether another check's hand hits the same at equal tip poses: arms mostly come in pairs."""
        each = zip(self._in_hand, other._in_hand, strict=True)
        return all(one.shape == two.shape and np.allclose(one, two, rtol=0.0, atol=ALIKE) for one, two in each)

    @cached_property
    def _in_hand(self) -> tuple[Array | Index, ...]:
        """What determines hits of the hand: pieces and limits of its pairs, and their spheres in the tip's frame."""
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
        several = standing[which], pairs[moves]
        movers, numbers = np.unique(self._mover[np.concatenate(several)], return_inverse=True)
        return _Pairs(*several, pieces, movers, *np.split(numbers.ravel(), [len(which)]))

    def _first(self, width: Array, frames: Array, pairs: _Pairs) -> list[str | None]:
        """Find the obstacle of the first pair that is hit in each of frames (f, 3, 4, n), or None."""
        hits = self._near(width, frames, pairs, only_first=True)
        names: list[str | None] = [None] * frames.shape[3]
        for pair, row in zip(hits[0][::-1].tolist(), hits[1][::-1].tolist(), strict=True):
            names[row] = self._obstacles.names[self._obstacle[pair]]
        return names

    def clear(self, bases: Array, q: Array) -> NDArray[np.bool_]:
        """Check from which base poses (n, 4, 4) configurations (n, d) are surely free (n,)."""
        clear = np.full(len(q), self.whole)
        frames = self._frames(bases, q)
        for key in self._close:  # neighbouring links are hardly ever separable; if not, nothing else need be tested
            clear[clear] = self._are_apart(*key, frames[..., clear])
        rows = np.flatnonzero(clear)
        _, near, hits, groups = self._unsure(frames[..., rows])
        clear[rows[near[:hits]]] = False
        for pair, piece, some in groups:
            undecided = rows[some][clear[rows[some]]]
            if len(undecided):
                clear[undecided] = self._are_apart(pair, piece, frames[..., undecided])
                if len(self._close) < MOST_CLOSE and not clear[undecided].any():
                    self._close.append((pair, piece))
        return clear

    def sure(self, q: Array) -> NDArray[np.bool_]:
        """Check which configurations (n, d) are surely free (n,)."""
        return self.clear(self._here(len(q)), q)

    def doubtful(self, q: Array) -> list[list[tuple[str, str]] | None]:
        """List the movers and obstacles that may touch at each of configurations (n, d); None if unknown.

        A list is empty where the configuration is surely free. Elsewhere it also has pairs that are surely apart: to
        check one exactly takes less time than to find that out.
        """
        if not self.whole:
            return [None] * len(q)
        frames = self._frames(self._here(len(q)), q)
        pairs, rows, hits, groups = self._unsure(frames)
        pairs_of_rows: list[dict[int, None]] = [{} for _ in q]
        for pair, row in zip(pairs.tolist(), rows.tolist(), strict=True):
            pairs_of_rows[row][pair] = None
        in_doubt = np.zeros(len(q), bool)
        in_doubt[rows[:hits]] = True
        for pair, piece, several in groups:
            if len(undecided := several[~in_doubt[several]]):
                in_doubt[undecided] = ~self._are_apart(pair, piece, frames[..., undecided])
        each = zip(in_doubt.tolist(), pairs_of_rows, strict=True)
        return [[self._pair(pair) for pair in one] if may_touch else [] for may_touch, one in each]

    def free(self, q: Array) -> NDArray[np.bool_]:
        """Check at which configurations (n, d) no sphere penetrates anything (n,)."""
        free = np.ones(len(q), bool)
        free[self._near(self._limit, self._frames(self._here(len(q)), q), self._pairs, only_first=True)[1]] = False
        return free

    def gaps(self, q: Array, within: float = np.inf) -> Array:
        """Compute the smallest gap of each pair (w,) at a configuration (d,) [m], negative inside.

        Infinite for pairs that are surely farther apart than ``within`` [m].
        """
        pairs, _, gaps, _ = self._near(self._sure + within, self._frames(self._here(1), q[None]), self._pairs)
        smallest = np.full(len(self._mover), np.inf)
        np.minimum.at(smallest, pairs, gaps)
        return smallest

    def room(self, q: Array, within: float, among: Index | None = None) -> tuple[Index, Index, Array]:
        """Find pairs and rows (k,) of configurations (n, d) whose room is at most ``within`` [m], and that room (k,).

        Room is the gap minus the pair's limit, negative below it. ``among``: the only pairs to consider.
        """
        pairs = self._pairs if among is None else self._together(among)
        pair, row, gap, _ = self._near(self._limit + within, self._frames(self._here(len(q)), q), pairs)
        order = np.lexsort((row, pair))
        pair, row, gap = pair[order], row[order], gap[order]
        first = np.flatnonzero(np.diff(pair * len(q) + row, prepend=-1))
        room = np.minimum.reduceat(gap - self._limit[pair], first) if len(first) else gap
        return pair[first], row[first], room

    def keep(self, distance: float, ends: Iterable[Array]) -> None:
        """Keep all pairs this far apart [m], or, if that is less, as far as at the nearer of ``ends`` (d,).

        The ends are assumed to be free. Forgets what was learnt.
        """
        self._most = np.min([self.gaps(q, distance + NEAREST) for q in ends], axis=0, initial=np.inf) - TOUCHING
        self._limit = np.minimum(self._least + TOUCHING + distance, self._most)

    def learn(self, q: Array, pairs: Iterable[tuple[str, str]], by: float = APART) -> None:
        """Learn that bodies touch at a configuration (d,): keep them farther apart [m], as far as the ends allow."""
        touching = {frozenset(pair) for pair in pairs}
        hit = np.array([frozenset(pair) in touching for pair in self.names], bool)
        raised = np.minimum(self.gaps(q, NEAREST + by) + by, self._most)
        # of the shapes of a link only those that may have touched
        hit &= raised <= raised[hit].min(initial=np.inf) + NEAREST
        self._limit = np.where(hit, np.maximum(self._limit, raised), self._limit)

    def _here(self, count: int) -> Array:
        return np.broadcast_to(self._base, (count, 4, 4))

    def _frames(self, bases: Array, q: Array | None) -> Array:
        """Compute all frames (f, 3, 4, n) from base poses (n, 4, 4) at configurations (n, d)."""
        moving = np.zeros((0, 3, 4, len(bases))) if q is None else self._chain.frame_rows(q)
        base = np.moveaxis(bases[:, :3], 0, -1)
        frames = np.empty((FIRST_JOINT + len(moving), 3, 4, len(bases)))
        frames[MAP], frames[BASE] = np.eye(3, 4)[..., None], base
        np.einsum("ijn,fjkn->fikn", base[:, :3], moving, out=frames[FIRST_JOINT:])
        frames[FIRST_JOINT:, :, 3] += base[:, 3]
        return frames

    def _unsure(self, frames: Array) -> tuple[Index, Index, int, list[tuple[int, int, Index]]]:
        """Find pairs and rows of frames (f, 3, 4, n) that may touch, those that hit first, and the number of these.

        Also groups the others, the nearest first: pairs and pieces with their rows. Their piece is -1 if the obstacle
        is tested as a whole.
        """
        pair, row, gap, piece = self._near(np.maximum(self._limit, self._sure), frames, self._pairs)
        hit = gap < self._limit[pair]
        order = np.flatnonzero(~hit)[np.argsort(gap[~hit], kind="stable")]
        piece = np.where(self._shaped[self._obstacle[pair]], -1, piece)
        groups: dict[tuple[int, int], dict[int, None]] = {}
        for key in zip(pair[order].tolist(), piece[order].tolist(), row[order].tolist(), strict=True):
            groups.setdefault(key[:2], {})[key[2]] = None
        found, hits = np.concatenate([np.flatnonzero(hit), order]), int(hit.sum())
        grouped = [(*key, np.array(list(rows), np.intp)) for key, rows in groups.items()]
        return pair[found], row[found], hits, grouped

    def _are_apart(self, pair: int, piece: int, frames: Array) -> NDArray[np.bool_]:
        """Check in which of frames (f, 3, 4, n) the shapes of a pair surely do not touch (n,)."""
        mover, obstacle = int(self._mover[pair]), int(self._obstacle[pair])
        ((points_of_mover, beyond),) = self._movers.spans(mover, -1)
        here, there = (
            np.moveaxis(frames[k], -1, 0) for k in (self._movers.frames[mover], self._obstacles.frames[obstacle])
        )
        turns, shifts = _relative(there, here)
        apart = np.ones(len(turns), bool)  # until one of the obstacle's shapes cannot be separated
        for points, further in self._obstacles.spans(obstacle, piece):
            apart[apart] = are_apart(points_of_mover, points, turns[apart], shifts[apart], beyond + further + BEYOND)
        return np.asarray(apart)

    def _near(self, width: Array, frames: Array, pairs: _Pairs, *, only_first: bool = False) -> Found:
        """Find the pairs nearer than their width (w,) in frames (f, 3, 4, n); incomplete after a row's first hit."""
        count, size = frames.shape[3], len(pairs.standing) + len(pairs.moving)
        if not count or not size:
            none = np.zeros(0, np.intp)
            return none, none, np.zeros(0), none
        size = max(1, AT_ONCE // size)
        find, parts = self._first_by_spheres if only_first else self._near_by_spheres, []
        for some in (frames[..., k : k + size] for k in range(0, count, size)):
            rows = np.ascontiguousarray(np.moveaxis(some, -1, 0))  # (n, f, 3, 4): each row contiguous
            parts.append(find(width, rows, *self._near_by_balls(width, some, rows, pairs)))
        if len(parts) == 1:
            return parts[0]
        starts = np.repeat(np.arange(len(parts)) * size, [len(part[0]) for part in parts])
        pair, row, gap, piece = (np.concatenate(column) for column in zip(*parts, strict=True))
        order = np.lexsort((row + starts, pair))
        return pair[order], (row + starts)[order], gap[order], piece[order]

    def _first_by_spheres(self, width: Array, rows: Array, pair: Index, piece: Index, row: Index) -> Found:
        """Select the first of those pairs, pieces and rows (k,) that is near in each row, and some more.

        As few as possible are tested.
        """
        order = np.argsort(row, kind="stable")
        rank = np.empty(len(row), np.intp)
        rank[order] = np.arange(len(row)) - np.searchsorted(row[order], row[order])
        # Spheres cost most, and one hit is enough to reject a row. So only one candidate of each row is tested at
        # first, and three times as many at each further step of the rows that are left: a free row, in which all have
        # to be tested, takes a number of steps that grows with their logarithm only.
        parts, untested, bound = [], np.arange(len(row)), 1
        while len(untested):
            batch = untested[rank[untested] < bound]
            parts.append(self._near_by_spheres(width, rows, pair[batch], piece[batch], row[batch]))
            hit = np.zeros(len(rows), bool)
            hit[parts[-1][1]] = True
            untested, bound = untested[(rank[untested] >= bound) & ~hit[row[untested]]], 3 * bound
        if len(parts) < 2:
            return parts[0] if parts else (pair, row, np.zeros(0), piece)
        columns = [np.concatenate(column) for column in zip(*parts, strict=True)]
        inside = np.argsort(columns[0], kind="stable")
        return columns[0][inside], columns[1][inside], columns[2][inside], columns[3][inside]

    def _near_by_balls(self, width: Array, frames: Array, rows: Array, pairs: _Pairs) -> tuple[Index, Index, Index]:
        """Find pairs, pieces of their obstacles and rows where the mover's ball is near, in order."""
        middles = _placed(self._balls[pairs.movers], self._movers.frames[pairs.movers], frames)
        pair, piece, row, middle = self._near_standing(width, middles, pairs)
        if len(pairs.moving):
            moving = self._near_moving(width, middles, frames, rows, pairs)
            both = zip((pair, piece, row, middle), moving, strict=True)
            pair, piece, row, middle = (np.concatenate(several) for several in both)
        solids = self._obstacles.solids
        local = np.einsum("kij,ki->jk", solids.axes[piece], middle - solids.centres[piece])
        gap = distances(local, solids.half.T[:, piece], solids.kinds[piece]) - self._balls[self._mover[pair], 3]
        near = np.flatnonzero(gap < width[pair])
        return pair[near], piece[near], row[near]

    def _near_by_spheres(self, width: Array, frames: Array, pair: Index, piece: Index, row: Index) -> Found:
        """Select those pairs, pieces and rows (k,) where a sphere of the mover is near."""
        gap = np.empty(len(pair))
        balls = self._obstacles.solids.kinds[piece] == 3
        for group, find in (
            (np.flatnonzero(balls), self._gaps_to_balls),
            (np.flatnonzero(~balls), self._gaps_to_pieces),
        ):
            for batch in (group[first : first + FEW] for first in range(0, len(group), FEW)):
                mover, obstacle = self._mover[pair[batch]], self._obstacle[pair[batch]]
                theirs = frames[row[batch], self._obstacles.frames[obstacle]]
                turn, shift = _relative(theirs, frames[row[batch], self._movers.frames[mover]])
                gap[batch] = find(mover, piece[batch], turn, shift)
        close = gap < width[pair]
        return pair[close], row[close], gap[close], piece[close]

    def _gaps_to_balls(self, mover: Index, piece: Index, turn: Array, shift: Array) -> Array:
        """Compute gaps (k,) between movers, at (k, 3, 3), (k, 3) in the obstacles' frames, and balls."""
        centres, radii = self._spheres
        solids = self._obstacles.solids
        ball = np.einsum("kji,kj->ki", turn, solids.centres[piece] - shift)  # in the frame of the mover
        offsets = centres[mover] - ball[:, :, None]
        offsets *= offsets
        return np.asarray((np.sqrt(offsets.sum(axis=1)) - radii[mover]).min(axis=1) - solids.half[piece, 0])

    def _gaps_to_pieces(self, mover: Index, piece: Index, turn: Array, shift: Array) -> Array:
        """Compute the same for boxes and cylinders."""
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
        """Find near pairs, static pieces and rows by ball and box, with the centres of the balls."""
        mover = pairs.movers_of_standing
        far = np.maximum(self._balls[pairs.movers[mover], 3] + width[pairs.standing], 0.0)[:, None]
        low, high = (corners[pairs.pieces] for corners in self._boxes)
        # The pieces of furniture do not move, so the box around all centres of a mover, over all rows, is compared with
        # the box of each piece before any single row is: most pieces of a room are far from everything an arm does.
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
        """Find the same for pairs on the robot, by balls, with centres in the frames of obstacles."""
        # Two steps, because an obstacle on the robot, such as a torso or a held tray, has many pieces, and each row of
        # joint values has another frame for it. First its bounding ball against the mover's: both centres are known in
        # the base's frame, so that a distance decides, and most pairs end here. Only for the rest is the mover's centre
        # taken into the obstacle's frame, once for each pair and row, and compared there with the ball of every piece,
        # which does not move in that frame.
        mover, obstacle, obstacles = pairs.movers_of_moving, self._obstacle[pairs.moving], self._obstacles
        far = self._balls[pairs.movers[mover], 3] + width[pairs.moving]
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
    """Pairs to test together: those with pieces at rest in the map, and those with moving obstacles."""

    standing: Index
    """Pairs (s,), one entry per piece."""
    moving: Index
    """Pairs (m,)."""
    pieces: Index
    """(s,)."""
    movers: Index
    """All their movers (k,)."""
    movers_of_standing: Index
    """Indices into ``movers`` (s,)."""
    movers_of_moving: Index


NEAREST = 0.01
"""Difference of gaps within which any shape of a body may be the one that touches [m]: the spheres' slack."""


def _around(solids: Solids, first: Index) -> Array:
    """Compute bounding balls (m, 4) of groups of pieces, given where each begins and the last ends (m + 1,)."""
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
    """Compute corners (k, 3) of boxes around pieces, along the axes of their frame."""
    half = np.minimum(np.einsum("kij,kj->ki", np.abs(solids.axes), solids.extents), solids.reach[:, None])
    return solids.centres - half, solids.centres + half


def _padded(bodies: Bodies) -> tuple[Array, Array]:
    """Arrange the spheres of bodies: centres (m, 3, s) and radii (m, s), padded with infinitely negative radii."""
    sizes = counts(bodies.first)
    body = np.repeat(np.arange(len(bodies)), sizes)
    number = np.arange(len(body)) - bodies.first[body]
    most = int(sizes.max(initial=1))
    centres, radii = np.zeros((len(bodies), 3, most)), np.full((len(bodies), most), -np.inf)
    centres[body, :, number], radii[body, number] = bodies.solids.centres, bodies.solids.reach
    return centres, radii


def _placed(balls: Array, numbers: NDArray[np.intp], frames: Array) -> Array:
    """Compute centres (m, 3, n) in the map of balls (m, 4) in numbered frames (m,)."""
    centres = np.repeat(balls[:, :3, None], frames.shape[3], axis=2)
    moving = np.flatnonzero(numbers != MAP)
    carriers = frames[numbers[moving]]
    centres[moving] = np.einsum("mijn,mj->min", carriers[:, :, :3], balls[moving, :3]) + carriers[:, :, 3]
    return centres


def _nearer(away: Array, far: Array) -> tuple[Index, Index]:
    """Find which vectors (k, 3, n) are shorter than some lengths (k, 1): indices in k, then in n."""
    numbers, rows = np.nonzero(np.einsum("kin,kin->kn", away, away) < far * far)
    return numbers, rows


def _relative(frames: Array, others: Array) -> tuple[Array, Array]:
    """Compute rotations (k, 3, 3) and positions (k, 3) of other frames (k, 3, 4) in frames (k, 3, 4)."""
    return np.einsum("kji,kjl->kil", frames[..., :3], others[..., :3]), _back(frames, others[..., 3])


def _back(frames: Array, points: Array) -> Array:
    """Transform points (k, 3) from the map into frames (k, 3, 4)."""
    return np.asarray(np.einsum("kji,kj->ki", frames[..., :3], points - frames[..., 3]))


def _members(first: Index, groups: Index) -> tuple[Index, Index]:
    """List the members of groups (k,): for each member its position in ``groups``, and its number."""
    sizes = counts(first)[groups]
    which = np.repeat(np.arange(len(groups)), sizes)
    return which, np.arange(len(which)) - np.repeat(np.cumsum(sizes) - sizes, sizes) + first[groups][which]
