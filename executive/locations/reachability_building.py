"""Builds reachability maps by inverse kinematics, and keeps them between runs.

A coarse sub-lattice is solved from postures at random; then solutions spread to neighbours in place and heading, each
from the joints of its neighbour, until nothing is added; at last every pose takes over a neighbour's posture if it can
be better off with it. So unreachable poses cost something at the rim only.
"""

from __future__ import annotations

import hashlib
import math
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from executive.locations.reachability import CELL, YAWS, GraspClass, Index, ReachabilityMap, Rows, ordered, row_type
from executive.locations.reachability_sampling import cells_of, is_bound, sampled
from executive.motion import Chain, InverseKinematics
from executive.robots.arms import ArmModel, HandFrame, Lift, lift_of
from planlang.cache import Cache
from planlang.geometry import Array

VERSION = 3
"""Raised whenever maps come out otherwise for the same arm."""
SAMPLES = 20_000
"""Number of random postures that show where the tip can be at all."""
RESTARTS = 6
"""Random postures from which each pose of the coarse lattice is tried."""
COARSE = 2
"""Cells and headings from one pose of the coarse lattice to the next."""
FLOOR = 0.0
"""Lowest tip above the floor that is mapped [m]."""
USUAL_MANIPULABILITY = 90
"""Percentile of a map's manipulability that counts as full."""
SPARE = 0.125
"""Distance to the nearest joint limit, as a share of the joint's range, that counts as full."""
CHUNK = 5_000
"""Configurations that are scored at once."""
_CACHE = Cache("reachability", most=60)

Progress = Callable[[int, int, str], None]
"""A listener that gets the number done, the total, and the name of what was done."""


def reachability_maps(
    arm: ArmModel,
    torso: str | None = None,
    classes: Iterable[GraspClass] = GraspClass,
    progress: Progress | None = None,
) -> Mapping[GraspClass, ReachabilityMap]:
    """The maps of an arm, from the user's cache or built now; ``progress`` is told of those built.

    ``torso``: the joint among the arm's that lifts it; one that does not slide straight up is a joint like others.
    """
    lift = lift_of(arm.solver.chain, torso)
    wanted = list(classes)
    maps = {grasp: _fetch(arm, lift, grasp) for grasp in wanted}
    absent = [(arm, lift, grasp) for grasp, found in maps.items() if found is None]
    for _, _, grasp, rows in _built(absent, progress):
        maps[grasp] = _kept(arm, lift, grasp, rows)
    return {grasp: found for grasp in wanted if (found := maps[grasp]) is not None}


def keep_maps(
    arms: Iterable[ArmModel], torso: str | None = None, progress: Progress | None = None
) -> dict[tuple[str, GraspClass], ReachabilityMap]:
    """Build all maps of arms that are not in the user's cache yet: these, by arm and class."""
    every = [(arm, lift_of(arm.solver.chain, torso), grasp) for arm in arms for grasp in GraspClass]
    built = _built([job for job in every if _fetch(*job) is None], progress)
    return {(arm.name, grasp): _kept(arm, lift, grasp, rows) for arm, lift, grasp, rows in built}


def build_maps(
    arms: Iterable[ArmModel], torso: str | None = None, progress: Progress | None = None
) -> dict[str, bytes]:
    """Return the files with the maps of a robot's arms: name -> content.

    A name has the arm, the class of grasps and the beginning of a key made of chain, sampling and version: where a
    file of a name that :func:`file_name` gives is missing, the map is stale.
    """
    every = [(arm, lift_of(arm.solver.chain, torso), grasp) for arm in arms for grasp in GraspClass]
    built = _built(every, progress)
    return {file_name(arm, lift, grasp): packed(rows) for arm, lift, grasp, rows in built}


def file_name(arm: ArmModel, lift: Lift | None, grasp: GraspClass) -> str:
    """Return the name of the file of a map."""
    return f"{arm.name}-{grasp.value}-{_entry_name(arm, lift, grasp)[:16]}.reach"


def packed(rows: Rows) -> bytes:
    """Return rows of a map as a file keeps them: bytes of equal significance together, which compress well."""
    columns = np.ascontiguousarray(rows).view(np.uint8).reshape(len(rows), rows.dtype.itemsize).T
    return zlib.compress(columns.tobytes(), 9)


def unpacked(content: bytes, dof: int) -> Rows:
    """Return the rows of a file, of d joint values each; the inverse of :func:`packed`."""
    row = row_type(dof)
    columns = np.frombuffer(zlib.decompress(content), np.uint8).reshape(row.itemsize, -1)
    return np.ascontiguousarray(columns.T).view(row)[:, 0]


_Job = tuple[ArmModel, Lift | None, GraspClass]


def _built(jobs: Sequence[_Job], progress: Progress | None) -> Iterator[tuple[ArmModel, Lift | None, GraspClass, Rows]]:
    """Yield the rows of maps, as they get ready."""
    for number, (arm, lift, grasp) in enumerate(jobs, 1):
        yield arm, lift, grasp, _build_rows(arm, lift, grasp)
        if progress is not None:
            progress(number, len(jobs), f"{arm.name}, {grasp.value}")


# Cache


def _entry_name(arm: ArmModel, lift: Lift | None, grasp: GraspClass) -> str:
    chain = arm.solver.chain
    way = "sampled" if is_bound(_carried(chain, lift)) else "lattice"
    facts = (
        VERSION if way == "lattice" else (VERSION, way),
        chain.digest,
        lift,
        grasp.value,
        arm.frame,
        CELL,
        YAWS,
        arm.seeds.tolist(),
    )
    return hashlib.sha256(repr(facts).encode()).hexdigest()


def _fetch(arm: ArmModel, lift: Lift | None, grasp: GraspClass) -> ReachabilityMap | None:
    content = _CACHE.load(_entry_name(arm, lift, grasp))
    row = row_type(_width(arm, lift))
    if content is None or len(content) % row.itemsize:
        return None
    return _map(arm, lift, grasp, np.frombuffer(content, row))


def _kept(arm: ArmModel, lift: Lift | None, grasp: GraspClass, rows: Rows) -> ReachabilityMap:
    _CACHE.keep(_entry_name(arm, lift, grasp), rows.tobytes())
    return _map(arm, lift, grasp, rows)


def _map(arm: ArmModel, lift: Lift | None, grasp: GraspClass, rows: Rows) -> ReachabilityMap:
    return ReachabilityMap.of(arm.name, grasp, arm.frame, arm.solver.chain.names, lift, rows)


def _width(arm: ArmModel, lift: Lift | None) -> int:
    return arm.solver.chain.dof - (lift is not None)


# Building


@dataclass(frozen=True, slots=True)
class _Lattice:
    """Lattice poses around an arm: shape (yaws, x, y, z), ``first`` cell (3,)."""

    grasp: GraspClass
    frame: HandFrame
    roll: int
    first: NDArray[np.int64]
    shape: tuple[int, int, int, int]

    def poses(self, index: Index) -> Array:
        """Tip poses (m, 4, 4) of flat indices (m,)."""
        headings = np.tile(np.eye(4), (YAWS, 1, 1))
        headings[:, :3, :3] = self.grasp.rotations(np.arange(YAWS) * (2 * math.pi / YAWS), self.roll, self.frame)
        yaw, *cells = np.unravel_index(index, self.shape)
        poses = headings[yaw]
        for axis, along in enumerate(cells):
            poses[:, axis, 3] = CELL * (along + self.first[axis])
        return poses

    def coarse(self) -> Index:
        """Flat indices, in their order, of the poses of the coarse lattice."""
        return np.ravel_multi_index(np.ix_(*(np.arange(0, n, COARSE) for n in self.shape)), self.shape).ravel()

    def neighbours(self, index: Index) -> Iterator[tuple[Index, Index]]:
        """Pairs of (positions in ``index``, flat index of a neighbour) for each of the eight directions."""
        cells = np.unravel_index(index, self.shape)
        for axis, step in product(range(4), (1, -1)):
            stride, last = math.prod(self.shape[axis + 1 :]), self.shape[axis] - 1
            edge = cells[axis] == (last if step > 0 else 0)
            if axis == 0:  # headings go around
                yield np.arange(len(index)), index + step * stride * np.where(edge, -last, 1)
            else:
                inside = np.flatnonzero(~edge)
                yield inside, index[inside] + step * stride


def _carried(full: Chain, lift: Lift | None) -> Chain:
    """Return the chain without what lifts it."""
    return full if lift is None else full.locked({lift.joint: lift.lowest})


def _build_rows(arm: ArmModel, lift: Lift | None, grasp: GraspClass) -> Rows:
    full = arm.solver.chain
    chain = _carried(full, lift)
    if is_bound(chain):
        floor = FLOOR - (0.0 if lift is None else float(lift.rise(lift.highest)))
        return ordered(np.concatenate([_sampled_rows(chain, grasp, arm.frame, roll, floor) for roll in grasp.rolls]))
    solver = InverseKinematics(chain)
    columns = [full.names.index(name) for name in chain.names]
    rng = np.random.default_rng(0)
    tips = chain.fk(chain.sample(rng, SAMPLES))[:, :3, 3]
    least = FLOOR - (0.0 if lift is None else float(lift.rise(lift.highest)))
    first = np.floor(np.maximum(tips.min(axis=0), (-np.inf, -np.inf, least)) / CELL).astype(np.int64)
    last = np.ceil(tips.max(axis=0) / CELL).astype(np.int64)
    nx, ny, nz = (int(n) for n in np.maximum(last - first + 1, 1))
    parts = []
    for roll in grasp.rolls:
        lattice = _Lattice(grasp, arm.frame, roll, first, (YAWS, nx, ny, nz))
        q, solved = _solved(lattice, solver, arm.seeds[:, columns], rng)
        parts.append(_as_rows(lattice, chain, q, np.flatnonzero(solved)))
    return ordered(np.concatenate(parts))


def _sampled_rows(chain: Chain, grasp: GraspClass, frame: HandFrame, roll: int, floor: float) -> Rows:
    """Return for each cell of the lattice the best of the postures that are in it."""
    q, places, levels = sampled(chain, grasp, frame, roll, floor, np.random.default_rng(0))
    score = _scores(chain, q)
    cells = np.column_stack([levels, cells_of(places)])
    order = np.lexsort((np.arange(len(q)), -score.round(9)))
    _, first = np.unique(cells[order], axis=0, return_index=True) if len(q) else (None, np.zeros(0, np.intp))
    best = order[first]
    rows = np.zeros(len(best), row_type(chain.dof))
    rows["z"], rows["x"], rows["y"], rows["yaw"] = cells[best].T
    rows["roll"], rows["q"] = roll, q[best]
    rows["score"] = _normal(score[best])
    return rows


def _solved(
    lattice: _Lattice, solver: InverseKinematics, postures: Array, rng: np.random.Generator
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Joint values (all, d) and which poses have some."""
    chain = solver.chain
    count = math.prod(lattice.shape)
    q = np.zeros((count, chain.dof), np.float32)
    solved = np.zeros(count, np.bool_)
    score = np.zeros(count)
    coarse = lattice.coarse()
    coarse = coarse[chain.may_reach(lattice.poses(coarse))]
    seeds = np.concatenate([postures, chain.sample(rng, RESTARTS)])
    tried, ok = solver.solve(lattice.poses(coarse), np.broadcast_to(seeds, (len(coarse), *seeds.shape)))
    added = coarse[ok]
    q[added], solved[added], score[added] = tried[ok], True, _scores(chain, tried[ok])
    while len(added):
        fresh = []
        for at, other in lattice.neighbours(added):
            open_ = ~solved[other]
            source, goal = added[at[open_]], other[open_]
            tried, ok = solver.solve(lattice.poses(goal), q[source][:, None].astype(float))
            reached = goal[ok]
            q[reached], solved[reached], score[reached] = tried[ok], True, _scores(chain, tried[ok])
            fresh.append(reached)
        added = np.concatenate(fresh)
    done = np.flatnonzero(solved)
    for at, other in lattice.neighbours(done):
        better = solved[other] & (score[other] > 1.2 * score[done[at]])
        goal, source = done[at[better]], other[better]
        tried, ok = solver.solve(lattice.poses(goal), q[source][:, None].astype(float))
        goal, tried = goal[ok], tried[ok]
        gained = _scores(chain, tried)
        up = gained > score[goal]
        q[goal[up]], score[goal[up]] = tried[up], gained[up]
    return q, solved


def _scores(chain: Chain, q: Array) -> Array:
    """Return manipulability (m,) (Yoshikawa 1985) of configurations (m, d), less near limits; not normalised."""
    scores = np.empty(len(q))
    for start in range(0, len(q), CHUNK):  # what is between stays in the processor's cache
        scores[start : start + CHUNK] = _few_scores(chain, q[start : start + CHUNK])
    return scores


def _few_scores(chain: Chain, q: Array) -> Array:
    jacobian = chain.jacobian(q)
    across = jacobian.transpose(0, 2, 1)
    squares = jacobian @ across if chain.dof >= 6 else across @ jacobian
    manipulability = np.sqrt(np.maximum(np.linalg.det(squares), 0.0))
    spare = np.ones(len(q))
    for joint in np.flatnonzero(~chain.continuous):
        low, high, values = chain.lower[joint], chain.upper[joint], q[:, joint]
        np.minimum(spare, np.minimum(values - low, high - values) / np.maximum(high - low, 1e-9), out=spare)
    return np.asarray(manipulability * np.clip(spare / SPARE, 0.0, 1.0))


def _as_rows(lattice: _Lattice, chain: Chain, q: NDArray[np.float32], index: Index) -> Rows:
    rows = np.zeros(len(index), row_type(chain.dof))
    if not len(index):
        return rows
    yaw, *cells = np.unravel_index(index, lattice.shape)
    rows["yaw"], rows["roll"], rows["q"] = yaw, lattice.roll, q[index]
    rows["x"], rows["y"], rows["z"] = (np.stack(cells, axis=-1) + lattice.first).T
    rows["score"] = _normal(_scores(chain, q[index].astype(float)))
    return rows


def _normal(score: Array) -> Array:
    """Scores in (0, 1]."""
    if not len(score):
        return score
    full = float(np.percentile(score, USUAL_MANIPULABILITY)) or 1.0
    return np.asarray(np.clip(score / full, 1e-3, 1.0))
