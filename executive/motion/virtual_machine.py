"""Kinematics without a compiler: symbolic functions on casadi's virtual machine, rows of numpy arrays at a time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import casadi
import numpy as np
from numpy.typing import NDArray

from executive.motion.backends import MAP, SURE, UNSURE, ChainFacts
from executive.motion.levenberg_marquardt import ROTATION_WEIGHT, step_function
from executive.motion.symbolic import frames_function, pose_function, position_function, symbolic_chain
from executive.motion.targets import check_targets
from planlang.geometry import Array

if TYPE_CHECKING:
    from executive.motion.body_arrays import Bodies
    from executive.motion.solids import Solids

    _Group = tuple[int, int, NDArray[np.intp], Solids]
    """A part, a frame, the pairs of the part with pieces in that frame, and these."""

BLOCKS = (256, 32, 4, 1)
"""Rows per call of casadi's virtual machine; a call costs about 3 us beside the work of its rows."""
STEPS = 4
"""Steps of inverse kinematics between two looks at the error from outside."""
ROUNDS = 12
"""Looks after which a seed is given up."""
STALLED = 0.8
"""A seed is given up when a round leaves more than this share of its squared error."""


class RowFunction:
    """A symbolic function applied to every row of its arguments on casadi's virtual machine.

    Every row is computed on its own, in the same order of operations whatever the other rows are. The work arrays
    belong to the object: one thread at a time.
    """

    def __init__(self, function: Any) -> None:
        self.widths = tuple(int(function.numel_out(i)) for i in range(function.n_out()))
        """Length of a row of each result."""
        self._function = function
        self._blocks: dict[int, tuple[list[Array], list[Array], Any, Any]] = {}

    def __call__(self, *arguments: Array) -> tuple[Array, ...]:
        """Arguments (n, width of the argument) -> one (n, width) array per result."""
        rows = len(arguments[0])
        results = tuple(np.empty((rows, width)) for width in self.widths)
        first = 0
        while first < rows:
            size = next(block for block in BLOCKS if block <= rows - first)
            inputs, outputs, _, evaluate = self._blocks.get(size) or self._block(size)
            for held, given in zip(inputs, arguments, strict=True):
                held[:] = given[first : first + size]
            evaluate()
            for given, held in zip(results, outputs, strict=True):
                given[first : first + size] = held
            first += size
        return results

    def _block(self, size: int) -> tuple[list[Array], list[Array], Any, Any]:
        mapped = self._function if size == 1 else self._function.map(size)
        inputs = [np.zeros((size, self._function.numel_in(i))) for i in range(self._function.n_in())]
        outputs = [np.zeros((size, width)) for width in self.widths]
        buffer, evaluate = mapped.buffer()
        for i, array in enumerate(inputs):
            buffer.set_arg(i, array.data)
        for i, array in enumerate(outputs):
            buffer.set_res(i, array.data)
        self._blocks[size] = (inputs, outputs, buffer, evaluate)
        return self._blocks[size]


class VirtualChain:
    """Forward kinematics and Jacobian; implements ``Backend``."""

    kind = "interpreted"

    def __init__(self, facts: ChainFacts) -> None:
        chain = symbolic_chain(facts.joints, facts.variables, facts.dof)
        self._facts = facts
        self._position = RowFunction(position_function(chain))
        self._pose = RowFunction(pose_function(chain))
        self._frames = RowFunction(frames_function(chain)) if chain.frames else None

    def position(self, q: Array) -> tuple[Array, Array]:
        """As ``Backend`` says."""
        rotation, position = self._position(q)
        return rotation, position

    def pose(self, q: Array) -> tuple[Array, Array, Array]:
        """As ``Backend`` says."""
        rotation, position, jacobian = self._pose(q)
        return rotation, position, jacobian

    def solver(self, free_axis: Array | None, tolerance: tuple[float, float]) -> VirtualSolver:
        """As ``Backend`` says."""
        return VirtualSolver(self._facts, free_axis, tolerance)

    def frames(self, q: Array) -> Array:
        """As ``Backend`` says."""
        if self._frames is None:
            return np.zeros((len(q), 0, 3, 4))
        rows = self._frames(q)[0].reshape(len(q), -1, 12)
        return np.concatenate([rows[..., :9].reshape(*rows.shape[:2], 3, 3), rows[..., 9:, None]], axis=3)

    def checker(self, bodies: Bodies) -> VirtualChecker:
        """As ``Backend`` says."""
        return VirtualChecker(self, bodies)


class VirtualSolver:
    """Iterates the step function, all targets at once, one seed of each at a time; implements ``Solver``."""

    def __init__(self, facts: ChainFacts, free_axis: Array | None, tolerance: tuple[float, float]) -> None:
        chain = symbolic_chain(facts.joints, facts.variables, facts.dof)
        one = step_function(chain, facts.lowest, facts.highest, free_axis)
        q, t = casadi.MX.sym("q", facts.dof), casadi.MX.sym("target", 12)
        state = q
        for _ in range(STEPS):
            moved, squares = one(state, t)
            met = casadi.logic_and(squares[0] <= tolerance[0] ** 2, squares[1] <= tolerance[1] ** 2)
            state = casadi.if_else(met, state, moved)
        self._steps = RowFunction(casadi.Function("ik_steps", [q, t], [state]))
        self._error = RowFunction(casadi.Function("ik_error", [q, t], [one(q, t)[1]]))
        self._tolerance = np.square(tolerance)
        self._facts = facts

    def __call__(self, poses: Array, seeds: Array) -> tuple[Array, NDArray[np.bool_]]:
        """As ``Solver`` says; a target's result does not depend on the other targets."""
        check_targets(poses)
        targets = np.concatenate([poses[:, :3, :3].reshape(-1, 9), poses[:, :3, 3]], axis=1)
        first = seeds[:, 0]
        seeds = np.clip(seeds, self._facts.lowest, self._facts.highest)
        q, solved = self._iterated(targets, seeds)
        turns = np.where(self._facts.continuous, np.rint((first - q) / (2 * np.pi)), 0.0)
        return q + 2 * np.pi * turns, solved

    def _iterated(self, targets: Array, seeds: Array) -> tuple[Array, NDArray[np.bool_]]:
        count, tries, _ = seeds.shape
        best, least = seeds[:, 0].copy(), np.full(count, np.inf)
        solved = np.zeros(count, dtype=np.bool_)
        # one lane per target that is still open
        lane, q = np.arange(count), seeds[:, 0].copy()
        seed, rounds, before = np.zeros(count, np.int64), np.zeros(count, np.int64), np.full(count, np.inf)
        while lane.size:
            (q,) = self._steps(q, targets[lane])
            (squares,) = self._error(q, targets[lane])
            rounds += 1
            error = squares[:, 0] + ROTATION_WEIGHT**2 * squares[:, 1]
            met = (squares <= self._tolerance).all(axis=1)
            better = met | (error < least[lane])
            best[lane[better]], least[lane[better]] = q[better], error[better]
            solved[lane[met]] = True
            given_up = ~met & ((error > STALLED * before) | (rounds >= ROUNDS))
            before = error
            seed[given_up] += 1
            again = given_up & (seed < tries)
            q[again] = seeds[lane[again], seed[again]]
            rounds[again], before[again] = 0, np.inf
            keep = ~met & (seed < tries)
            lane, q, seed, rounds, before = lane[keep], q[keep], seed[keep], rounds[keep], before[keep]
        return best, solved


class VirtualChecker:
    """Implements ``Checker`` in numpy: all spheres of a part against all pieces of a frame at once."""

    def __init__(self, chain: VirtualChain, bodies: Bodies) -> None:
        self._chain, self._bodies = chain, bodies
        part_of, frame_of = bodies.pair_part, bodies.piece_frame[bodies.pair_piece]
        keys = sorted({(int(part), int(frame)) for part, frame in zip(part_of, frame_of, strict=True)})
        self._groups: list[_Group] = []
        for part, frame in keys:
            pairs = np.flatnonzero((part_of == part) & (frame_of == frame))
            pieces = bodies.solids.only(np.isin(np.arange(len(bodies.solids)), bodies.pair_piece[pairs]))
            self._groups.append((part, frame, pairs[np.argsort(bodies.pair_piece[pairs], kind="stable")], pieces))

    def judge(self, q: Array) -> NDArray[np.int32]:
        """As ``Checker`` says."""
        gaps = self._gaps(q)
        hit = gaps < self._bodies.limit
        sure = self._apart(q, gaps > self._bodies.sure).all(axis=1)
        found = np.where(hit.any(axis=1), hit.argmax(axis=1), np.where(sure, SURE, UNSURE))
        return found.astype(np.int32)

    def hits(self, q: Array, bases: Array, deeper: float) -> NDArray[np.int32]:
        """As ``Checker`` says."""
        return self._first(self._groups, self._frames(q, bases), deeper)

    def frame_hits(self, frame: int, places: Array) -> NDArray[np.int32]:
        """As ``Checker`` says."""
        groups = [group for group in self._groups if self._bodies.part_frame[group[0]] == frame and group[1] == MAP]
        frames = np.zeros((len(places), frame + 1, 3, 4))
        frames[:, MAP], frames[:, frame] = np.eye(3, 4), _poses(places)
        return self._first(groups, frames, 0.0)

    def _first(self, groups: Sequence[_Group], frames: Array, deeper: float) -> NDArray[np.int32]:
        """The first pair of some groups that is hit with frames at (n, f, 3, 4); only near pieces are compared."""
        all_ = self._bodies
        never = len(all_.pair_piece)
        first = np.full(len(frames), never)
        for part, frame, pairs, pieces in groups:
            spheres, ball = all_.spheres[all_.part_sphere[part] : all_.part_sphere[part + 1]], all_.part_ball[part]
            points = self._seen_from(frames, part, frame, np.vstack([ball, spheres]))
            near = pieces.gaps(points[:, 0]) < ball[3] + all_.limit[pairs]
            rows = np.flatnonzero(near.any(axis=1))
            if not len(rows):
                continue
            columns = np.flatnonzero(near.any(axis=0))
            compared = pieces.only(near.any(axis=0))
            gaps = (compared.gaps(points[rows, 1:]) - spheres[:, 3, None]).min(axis=1)
            hit = gaps < all_.limit[pairs[columns]] - max(deeper, 0.0)
            lowest = np.where(hit, pairs[columns], never).min(axis=1)
            first[rows] = np.minimum(first[rows], lowest)
        return np.where(first < never, first, UNSURE).astype(np.int32)

    def edge_hit(self, start: Array, end: Array, pieces: int, order: NDArray[np.int32]) -> int:
        """As ``Checker`` says."""
        rows = start + (end - start) * (order / pieces)[:, None]
        found = self.hits(rows, np.tile(self._bodies.base, (len(rows), 1)), 0.0)
        return int(next((pair for pair in found.tolist() if pair >= 0), UNSURE))

    def doubtful(self, q: Array) -> NDArray[np.int32]:
        """As ``Checker`` says."""
        far = np.maximum(self._bodies.limit, self._bodies.sure)
        return np.flatnonzero(~self._apart(q[None], self._gaps(q[None]) > far)[0]).astype(np.int32)

    def gaps(self, q: Array) -> Array:
        """As ``Checker`` says."""
        return np.asarray(self._gaps(q[None])[0])

    def _gaps(self, q: Array) -> Array:
        """(n, p)."""
        all_ = self._bodies
        frames = self._frames(q, np.broadcast_to(all_.base, (len(q), 12)))
        found = np.empty((len(q), len(all_.pair_piece)))
        for part, frame, pairs, pieces in self._groups:
            spheres = all_.spheres[all_.part_sphere[part] : all_.part_sphere[part + 1]]
            local = self._seen_from(frames, part, frame, spheres)
            found[:, pairs] = (pieces.gaps(local) - spheres[:, 3, None]).min(axis=1)
        return found

    def _apart(self, q: Array, apart: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Pairs (n, p) that are apart by their gaps, or because a plane of a polyhedron is between the two."""
        all_ = self._bodies
        frames = self._frames(q, np.broadcast_to(all_.base, (len(q), 12)))
        numbers = all_.piece_faces[all_.pair_piece]
        for group, part in enumerate(all_.group_part.tolist()):
            begin, end = all_.group_pair[group : group + 2].tolist()
            one, frame = int(all_.part_faces[part]), int(all_.piece_frame[all_.pair_piece[begin]])
            for two in np.unique(numbers[begin:end]).tolist() if one >= 0 else ():
                pairs = begin + np.flatnonzero(numbers[begin:end] == two)
                rows = np.flatnonzero(~apart[:, pairs].all(axis=1)) if two >= 0 else np.zeros(0, np.intp)
                if len(rows):
                    mine, other = frames[rows, all_.part_frame[part]], frames[rows, frame]
                    between = self._beyond(one, mine, two, other) | self._beyond(two, other, one, mine)
                    apart[np.ix_(rows, pairs)] |= between[:, None]
        return apart

    def _beyond(self, one: int, here: Array, other: int, there: Array) -> NDArray[np.bool_]:
        """Whether a plane of one polyhedron has all corners of another far enough beyond it, for frames (n, 3, 4)."""
        all_ = self._bodies
        planes = all_.planes[slice(*all_.plane_first[one : one + 2].tolist())]
        corners = all_.corners[slice(*all_.corner_first[other : other + 2].tolist())]
        points = np.einsum("nij,cj->nci", there[..., :3], corners) + (there[..., 3] - here[..., 3])[:, None]
        heights = np.einsum("nci,nij,pj->ncp", points, here[..., :3], planes[:, :3], optimize=True)
        away = all_.beyond[one] + all_.beyond[other]
        return np.asarray((heights.min(axis=1) > planes[:, 3] + away).any(axis=1))

    def _frames(self, q: Array, bases: Array) -> Array:
        """All frames (n, f, 3, 4) in the map, with the base of the chain at (n, 12)."""
        base = _poses(bases)
        turn, place = base[:, None, :, :3], base[:, None, :, 3:]
        moving = self._chain.frames(q)
        turned = np.concatenate([turn @ moving[..., :3], turn @ moving[..., 3:] + place], axis=3)
        still = np.broadcast_to(np.eye(3, 4), base.shape)
        return np.concatenate([np.stack([still, base], axis=1), turned], axis=1)

    def _seen_from(self, frames: Array, part: int, frame: int, spheres: Array) -> Array:
        """Centres (n, k, 3) of spheres (k, 4) of a part in a frame."""
        mine, other = frames[:, self._bodies.part_frame[part]], frames[:, frame]
        points = np.einsum("nij,kj->nki", mine[..., :3], spheres[:, :3]) + mine[:, None, :, 3]
        return np.asarray(np.einsum("nji,nkj->nki", other[..., :3], points - other[:, None, :, 3]))


def _poses(rows: Array) -> Array:
    """Rotations row by row, and positions (n, 12), as poses (n, 3, 4)."""
    return np.concatenate([rows[:, :9].reshape(-1, 3, 3), rows[:, 9:, None]], axis=2)
