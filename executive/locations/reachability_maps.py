"""Makes reachability maps: taken from the files of a robot or the cache, else built by inverse kinematics.

To build one, a coarse sub-lattice is solved from postures at random; then solutions spread to neighbours in place and
heading, each from the joints of its neighbour, until nothing is added; then every pose takes over a neighbour's posture
if it can be better off with it. So unreachable poses cost something at the rim only. At last the poses of a block, a
few cells and headings, share postures: of each block the best one, then the best of those that are not solved from it,
and so on. A map is so small then that it can come with a robot (17 MB of joint values are 2 MB of postures for the
Panda).

A file is sealed with a key made of the chain, the sampling and a version (:func:`map_key`), and named by its beginning.
So a map is never taken for that of another arm, and what is damaged or stale is built anew.
"""

from __future__ import annotations

import hashlib
import math
import zlib
from collections.abc import Iterator
from functools import partial
from itertools import product

import numpy as np
from numpy.typing import NDArray

from executive.locations.reachability import (
    CELL,
    LEVELLED,
    POSTURES,
    ROW,
    SAMPLED_AT_ONCE,
    YAWS,
    GraspClass,
    Index,
    ReachabilityMap,
    Rows,
    carried,
    cells_of,
    is_bound,
    row_keys,
    rows_of,
    sampled,
)
from executive.motion import Chain
from executive.robots.arms import ArmModel, HandFrame
from planlang.cache import Cache, sealed, unsealed
from planlang.files import Bundled
from planlang.geometry import Array
from planlang.kernel import unwatched
from planlang.progress import Report, Share, part, uncounted, unreported
from planlang.records import dataclass

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
BLOCK = 2, 3
"""Cells along each axis, and headings, that share postures: inverse kinematics gets from one to all others."""
SHARED, EXACT = 1e-2, 1e-5
"""Steps of joint values in postures that rows share, and in those that are a row's own [rad, m].

From a shared one inverse kinematics goes on anyway; 1e-5 moves the tip by less than a tenth of its tolerance.
"""
WORTH = 0.7
"""A row shares a posture that leads to this share of its own score: with more, files grow, with less, scores fall."""
USUALLY_SHARED = 0.7
"""Share of the rows that usually share a posture in one round."""
ASTRAY, DAMPED = 5e-3, 1e-8
"""Greatest share of a motion straight ahead by which a hand of an arm with few freedoms goes astray, and damping."""
CROOKED = 0.02
"""Factor on the score of postures from which it goes farther astray: hands approach things straight ahead."""
MOST_POSES = 1_500_000
"""Number of lattice poses around an arm above which only each second or n-th cell in x and y is mapped.

A map of as many takes 30 s and 0.7 GB; arms of 0.85 m have 1.3 million poses around them, those of 1.3 m 4 million.
"""
USUAL_JOINTS = 8
"""Joints of an arm above which a map has fewer poses: there is hardly one that arms on a torso do not reach, in time.

Each takes longer, too: two arms of 13 joints took more than two minutes.
"""
FARTHEST = 500
"""Farthest cell that a map has, in any direction: 25 m from the base."""
SAMPLING = (SAMPLES, RESTARTS, COARSE, FLOOR, USUAL_MANIPULABILITY, SPARE, BLOCK, SHARED, WORTH)


LATTICE, COARSELY, SPREAD = 0.6, 0.3, 0.85
"""Shares of the time: until postures are shared; of a roll's lattice until it is solved coarsely, and completely."""
PARTS = 10
"""Parts in which many poses are solved, so that it is known how far that is."""


def build_map(arm: ArmModel, grasp: GraspClass, share: Share = uncounted) -> ReachabilityMap:
    """Return the map of an arm, built now; ``share`` is given how much of that is done."""
    chain = carried(arm)
    floor = FLOOR - (0.0 if arm.lift is None else float(arm.lift.rise(arm.lift.highest)))
    if is_bound(arm):
        parts = []
        for number, roll in enumerate(grasp.rolls):
            share(number / len(grasp.rolls))
            parts.append(_sampled_rows(arm, chain, grasp, roll, floor))
    else:
        parts = _lattice_rows(arm, chain, grasp, floor, part(share, 0, LATTICE))
    rows, q = (np.concatenate(column) for column in zip(*parts, strict=True))
    order = np.argsort(row_keys(rows))
    rows, q = rows[order], q[order]
    q = chain.functions.within(np.rint(q / joint_step(arm)).T * joint_step(arm)).T
    rows["posture"] = np.arange(len(rows))
    built = ReachabilityMap(arm, grasp, rows, q)
    return built if is_bound(arm) else _shared(built, part(share, LATTICE, 1))


def joint_step(arm: ArmModel) -> float:
    """Return the step of joint values in the postures of an arm's maps [rad, m]."""
    return EXACT if is_bound(arm) else SHARED


def most_poses(arm: ArmModel) -> int:
    """Return the number of lattice poses around an arm above which its map is coarser."""
    return int(MOST_POSES * min(1.0, USUAL_JOINTS / carried(arm).dof) ** 4)


def blocks(rows: Rows, arm: ArmModel) -> NDArray[np.int64]:
    """Return the number of the block of each row: rows of a block may share postures. They grow with z."""
    cells, headings = (1, 1) if is_bound(arm) else BLOCK
    coarse = rows.copy()
    for name in ("z", "x", "y"):
        coarse[name] //= cells
    coarse["yaw"] //= headings
    return row_keys(coarse)


def _shared(full: ReachabilityMap, share: Share) -> ReachabilityMap:
    """Return the same map with as few postures as the rows of a block need."""
    rows, q, chain = full.rows, full.postures, carried(full.arm)
    block = blocks(rows, full.arm)
    poses = full.poses(np.arange(len(rows)), 0.0 if full.arm.lift is None else full.arm.lift.lowest)
    alone = _scores(chain, q)
    scores, owner, left = alone.copy(), np.arange(len(rows)), np.arange(len(rows))
    reached = np.ones(len(rows), np.bool_)  # a few at the rim are not any more, from their own posture rounded
    while len(left):
        order = left[np.lexsort((left, -alone[left].round(9), block[left]))]
        _, best, group = np.unique(block[order], return_index=True, return_inverse=True)
        own = order[best[group]]
        begun = 1 - len(left) / len(rows)
        usual = part(share, begun, begun + USUALLY_SHARED * (1 - begun))
        tried, solved = _in_parts(chain, poses[order], q[own][:, None], usual)
        gained = _scores(chain, tried)
        kept = (order == own) | (solved & (gained >= WORTH * alone[order]))
        owner[order[kept]], scores[order[kept]], reached[order[kept]] = own[kept], gained[kept], solved[kept]
        left = np.sort(order[~kept])
    owners, posture = np.unique(owner[reached], return_inverse=True)
    shared, scores = rows[reached], scores[reached]
    shared["posture"] = posture
    for roll in full.grasp.rolls:
        mine = shared["roll"] == roll
        shared["score"][mine] = _normal(scores[mine])
    return ReachabilityMap(full.arm, full.grasp, shared, q[owners])


@dataclass(frozen=True, slots=True)
class _Lattice:
    """Lattice poses around an arm: shape (yaws, x, y, z), ``first`` cell (3,), ``cells`` (3,) from one to the next."""

    grasp: GraspClass
    frame: HandFrame
    roll: int
    first: NDArray[np.int64]
    cells: NDArray[np.int64]
    shape: tuple[int, int, int, int]

    @classmethod
    def around(cls, arm: ArmModel, grasp: GraspClass, roll: int, ends: tuple[Array, Array]) -> _Lattice:
        """Return the lattice between the lowest and the highest cells (3,), with as many poses as maps may have."""
        most = most_poses(arm)
        first, last = (np.clip(end, -FARTHEST, FARTHEST).astype(np.int64) for end in ends)
        cells = np.ones(3, np.int64)
        shape = last - first + 1
        while YAWS * math.prod(shape.tolist()) > most and shape[:2].max() > 1:
            cells[int(np.argmax(shape[:2]))] += 1
            shape = (last - first) // cells + 1
        nx, ny, nz = (max(int(n), 1) for n in shape)
        return cls(grasp, arm.frame, roll, first, cells, (YAWS, nx, ny, nz))

    def poses(self, index: Index) -> Array:
        """Return tip poses (m, 4, 4) of flat indices (m,)."""
        headings = np.tile(np.eye(4), (YAWS, 1, 1))
        headings[:, :3, :3] = self.grasp.rotations(np.arange(YAWS) * (2 * math.pi / YAWS), self.roll, self.frame)
        yaw, *cells = np.unravel_index(index, self.shape)
        poses = headings[yaw]
        for axis, along in enumerate(cells):
            poses[:, axis, 3] = CELL * (along * self.cells[axis] + self.first[axis])
        return poses

    def coarse(self) -> Index:
        """Return flat indices, in their order, of the poses of the coarse lattice."""
        return np.ravel_multi_index(np.ix_(*(np.arange(0, n, COARSE) for n in self.shape)), self.shape).ravel()

    def neighbours(self, index: Index) -> Iterator[tuple[Index, Index]]:
        """Yield (positions in ``index``, flat index of a neighbour) for each of the eight directions."""
        cells = np.unravel_index(index, self.shape)
        for axis, step in product(range(4), (1, -1)):
            stride, last = math.prod(self.shape[axis + 1 :]), self.shape[axis] - 1
            edge = cells[axis] == (last if step > 0 else 0)
            if axis == 0:  # headings go around
                yield np.arange(len(index)), index + step * stride * np.where(edge, -last, 1)
            else:
                inside = np.flatnonzero(~edge)
                yield inside, index[inside] + step * stride


def _lattice_rows(
    arm: ArmModel, chain: Chain, grasp: GraspClass, floor: float, share: Share
) -> list[tuple[Rows, Array]]:
    """Return rows and joint values of each roll."""
    rng = np.random.default_rng(0)
    columns = [arm.chain.names.index(name) for name in chain.names]
    tips = chain.fk(chain.sample(rng, SAMPLES))[:, :3, 3]
    lowest = np.maximum(tips.min(axis=0), (-np.inf, -np.inf, floor))
    ends = np.floor(lowest / CELL), np.ceil(tips.max(axis=0) / CELL)
    parts = []
    for number, roll in enumerate(grasp.rolls):
        own = part(share, number / len(grasp.rolls), (number + 1) / len(grasp.rolls))
        lattice = _Lattice.around(arm, grasp, roll, ends)
        q, solved = _solved(lattice, chain, arm.seeds[:, columns], rng, own)
        index = np.flatnonzero(solved)
        yaw, *cells = np.unravel_index(index, lattice.shape)
        rows = np.zeros(len(index), ROW)
        rows["yaw"], rows["roll"] = yaw, roll
        rows["x"], rows["y"], rows["z"] = (np.stack(cells, axis=-1) * lattice.cells + lattice.first).T
        parts.append((rows, q[index].astype(float)))
    return parts


def _sampled_rows(arm: ArmModel, chain: Chain, grasp: GraspClass, roll: int, floor: float) -> tuple[Rows, Array]:
    """Return for each cell of the lattice the best of the postures that are in it."""
    q, places, levels = sampled(chain, grasp, arm.frame, roll, floor, np.random.default_rng(0))
    straight = np.where(_goes_straight(arm, chain, q), 1.0, CROOKED)
    score = _scores(chain, q) * straight
    cells = np.column_stack([levels, cells_of(places)])
    order = np.lexsort((np.arange(len(q)), -score.round(9)))
    _, first = np.unique(cells[order], axis=0, return_index=True) if len(q) else (None, np.zeros(0, np.intp))
    best = order[first]
    rows = np.zeros(len(best), ROW)
    rows["z"], rows["x"], rows["y"], rows["yaw"] = cells[best].T
    rows["roll"], rows["score"] = roll, _normal(score[best] / straight[best]) * straight[best]
    return rows, q[best]


def _goes_straight(arm: ArmModel, chain: Chain, q: Array) -> NDArray[np.bool_]:
    """Check in which postures (n, d) a hand can approach a thing straight ahead: a telescope has to be along that."""
    jacobian = chain.jacobian(q) * (chain.upper > chain.lower)
    if arm.lift is not None:
        jacobian = np.concatenate([jacobian, np.tile(np.eye(6)[2][None, :, None], (len(q), 1, 1))], axis=2)
    ahead = np.zeros((len(q), 6))
    ahead[:, :3] = chain.fk(q)[:, :3, :3] @ np.asarray(arm.frame.approach)
    squares = jacobian @ jacobian.transpose(0, 2, 1) + DAMPED * np.eye(6)
    moved = jacobian @ jacobian.transpose(0, 2, 1) @ np.linalg.solve(squares, ahead[:, :, None])
    return np.asarray(np.linalg.norm(moved[:, :, 0] - ahead, axis=1) < ASTRAY)


def _solved(
    lattice: _Lattice, chain: Chain, postures: Array, rng: np.random.Generator, share: Share
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Return joint values (all, d) and which poses have some."""
    count = math.prod(lattice.shape)
    q = np.zeros((count, chain.dof), np.float32)
    solved = np.zeros(count, np.bool_)
    score = np.zeros(count)
    coarse = lattice.coarse()
    coarse = coarse[chain.may_reach(lattice.poses(coarse))]
    seeds = np.concatenate([postures, chain.sample(rng, RESTARTS)])
    starts = np.broadcast_to(seeds, (len(coarse), *seeds.shape))
    tried, ok = _in_parts(chain, lattice.poses(coarse), starts, part(share, 0, COARSELY))
    added = coarse[ok]
    q[added], solved[added], score[added] = tried[ok], True, _scores(chain, tried[ok])
    likely = max(1, len(added) * COARSE**4)
    while len(added):
        fresh = []
        for at, other in lattice.neighbours(added):
            open_ = ~solved[other]
            source, goal = added[at[open_]], other[open_]
            tried, ok = chain.solve(lattice.poses(goal), q[source][:, None].astype(float))
            reached = goal[ok]
            q[reached], solved[reached], score[reached] = tried[ok], True, _scores(chain, tried[ok])
            fresh.append(reached)
            share(COARSELY + (SPREAD - COARSELY) * min(1.0, np.count_nonzero(solved) / likely))
        added = np.concatenate(fresh)
    done = np.flatnonzero(solved)
    for number, (at, other) in enumerate(lattice.neighbours(done)):
        share(SPREAD + (1 - SPREAD) * number / 8)
        better = solved[other] & (score[other] > 1.2 * score[done[at]])
        goal, source = done[at[better]], other[better]
        tried, ok = chain.solve(lattice.poses(goal), q[source][:, None].astype(float))
        goal, tried = goal[ok], tried[ok]
        gained = _scores(chain, tried)
        up = gained > score[goal]
        q[goal[up]], score[goal[up]] = tried[up], gained[up]
    return q, solved


def _in_parts(chain: Chain, poses: Array, seeds: Array, share: Share) -> tuple[Array, NDArray[np.bool_]]:
    """Solve for many poses (m, 4, 4) from seeds (m, s, d), whose solutions do not depend on each other."""
    found = []
    for number, some in enumerate(np.array_split(np.arange(len(poses)), PARTS)):
        found.append(chain.solve(poses[some], seeds[some]))
        share((number + 1) / PARTS)
    tried, solved = zip(*found, strict=True)
    return np.concatenate(tried), np.concatenate(solved)


def _scores(chain: Chain, q: Array) -> Array:
    """Return manipulability (m,) (Yoshikawa 1985) of configurations (m, d), less near limits; not normalised."""
    scores, freedoms = np.empty(len(q)), chain.mobility()
    for start in range(0, len(q), CHUNK):  # what is between stays in the processor's cache
        scores[start : start + CHUNK] = _few_scores(chain, freedoms, q[start : start + CHUNK])
    return scores


def _few_scores(chain: Chain, freedoms: int, q: Array) -> Array:
    jacobian = chain.jacobian(q)
    across = jacobian.transpose(0, 2, 1)
    if freedoms in (6, chain.dof):
        squares = np.linalg.det(jacobian @ across if freedoms == 6 else across @ jacobian)
    else:  # the ellipsoid has no extent in the other directions
        squares = np.linalg.eigvalsh(jacobian @ across)[:, 6 - freedoms :].prod(axis=1)
    manipulability = np.sqrt(np.maximum(squares, 0.0))
    spare = np.ones(len(q))
    for joint in np.flatnonzero(~chain.continuous):
        low, high, values = chain.lower[joint], chain.upper[joint], q[:, joint]
        np.minimum(spare, np.minimum(values - low, high - values) / np.maximum(high - low, 1e-9), out=spare)
    return np.asarray(manipulability * np.clip(spare / SPARE, 0.0, 1.0))


def _normal(score: Array) -> Array:
    """Return scores in (0, 1]."""
    if not len(score):
        return score
    full = float(np.percentile(score, USUAL_MANIPULABILITY))
    if full == 0:  # a joint has to be at its limit for every pose: none is better than another
        return np.ones(len(score))
    return np.asarray(np.clip(score / full, 1e-3, 1.0))


VERSION = 4
"""Raised whenever maps come out otherwise for the same arm, or their files."""
SCORES = 255
"""A score is a whole number of parts of this, so that it is a byte."""
MAPS = Bundled.ROBOT.folder / "maps"
"""Folder of the bundled robots' maps; ``make maps`` writes them."""
_CACHE = Cache("reachability", most=60)


def reachability_map(arm: ArmModel, grasp: GraspClass, robot: str = "", report: Report = unreported) -> ReachabilityMap:
    """Return the map of an arm and class: the one that came with planlang, from the user's cache, or built now.

    ``report`` is given the progress of building, which takes seconds, and if ``robot`` names a bundled robot, why.
    """
    key = map_key(arm, grasp)
    content, why = _bundled_map(arm, grasp, robot, key)
    # in the cache, the same robot has to find the same map whatever was run before
    kept = hashlib.sha256(repr((key, (arm.seeds.round(9) + 0.0).tolist())).encode()).hexdigest()
    if content is None:
        content = _CACHE.load(kept)
    if content is None:
        share = partial(
            report, f"building the reachability map of arm {arm.name}, {grasp.value} grasps, once for this robot{why}"
        )
        share(0.0)
        with unwatched():  # an arm with seven joints takes longer than code of a plan may
            content = packed(build_map(arm, grasp, part(share, 0, 0.999)))
        share(1.0)
        _CACHE.keep(kept, content)
    return unpacked(content, arm, grasp)


def bundled_file(arm: ArmModel, grasp: GraspClass, robot: str) -> tuple[str, bytes]:
    """Return the name and the content of the file with the map of a bundled robot's arm, built now."""
    key = map_key(arm, grasp)
    return f"{robot}-{arm.name}-{grasp.value}{_suffix(key)}", sealed(key, packed(build_map(arm, grasp)))


def _bundled_map(arm: ArmModel, grasp: GraspClass, robot: str, key: str) -> tuple[bytes | None, str]:
    """Return a map that came with planlang, whatever its robot is called; None if there is none, and a reason."""
    for path in MAPS.glob(f"*{_suffix(key)}"):
        return unsealed(key, path.read_bytes()), f": {path} is damaged"
    others = MAPS.glob(f"{robot}-{arm.name}-{grasp.value}-*.map")
    return None, ": the URDF differs from that of the bundled maps" if any(others) else ""


def _suffix(key: str) -> str:
    return f"-{key[:16]}.map"


def map_key(arm: ArmModel, grasp: GraspClass) -> str:
    """Return a digest of what a map is of; the same on all processors, so computed numbers are rounded.

    The arm's postures, from which building begins, do not count: a map that came with planlang serves all robots with
    such an arm.
    """
    lift = arm.lift
    lifted = None if lift is None else (lift.column, round(lift.per_unit, 9), round(float(lift.rise(lift.highest)), 9))
    sampling = (POSTURES, SAMPLED_AT_ONCE, LEVELLED, ASTRAY, CROOKED) if is_bound(arm) else SAMPLING
    coarse = most_poses(arm) < MOST_POSES and not is_bound(arm)
    facts = (
        VERSION,
        (*sampling, most_poses(arm)) if coarse else sampling,
        CELL,
        YAWS,
        carried(arm).digest,
        lifted,
        grasp.value,
        (arm.frame.approach, arm.frame.closing),
    )
    return hashlib.sha256(repr(facts).encode()).hexdigest()


def packed(built: ReachabilityMap) -> bytes:
    """Return a map as its file keeps it.

    Rows as steps from key to key, scores as bytes, and which of the postures of its block a row has; postures in steps
    of :func:`joint_step`, in the order of blocks. Bytes of equal significance are together, which compresses well.
    """
    rows, step = built.rows, joint_step(built.arm)
    count = max(len(built.postures), 1)
    pairs, pair = np.unique(blocks(rows, built.arm) * count + rows["posture"], return_inverse=True)
    block, posture = np.divmod(pairs, count)
    _, first, number = np.unique(block, return_index=True, return_inverse=True)
    columns = (
        np.array([len(rows), len(pairs)]),
        np.diff(row_keys(rows), prepend=0),
        np.maximum(np.rint(rows["score"].astype(float) * SCORES), 1).astype(np.uint8),
        (np.arange(len(pairs)) - first[number])[pair].astype(np.uint8),
        np.rint(built.postures[posture] / step).astype(np.int32).ravel(),
    )
    return zlib.compress(
        b"".join(column.view(np.uint8).reshape(-1, column.itemsize).T.tobytes() for column in columns), 9
    )


def unpacked(content: bytes, arm: ArmModel, grasp: GraspClass) -> ReachabilityMap:
    """Return the map of a file; the inverse of :func:`packed`."""
    plain, chain = np.frombuffer(zlib.decompress(content), np.uint8), carried(arm)
    begin = 0

    def column(count: int, kind: type[np.generic]) -> np.ndarray:
        nonlocal begin
        size = np.dtype(kind).itemsize
        planes = plain[begin : begin + count * size].reshape(size, count)
        begin += count * size
        return np.ascontiguousarray(planes.T).view(kind)[:, 0]

    count, postures = column(2, np.int64).tolist()
    rows = rows_of(np.cumsum(column(count, np.int64)))
    rows["score"] = column(count, np.uint8) / SCORES
    number = column(count, np.uint8).astype(np.int64)
    _, rows["posture"] = np.unique(blocks(rows, arm) * (SCORES + 1) + number, return_inverse=True)
    q = column(postures * chain.dof, np.int32).reshape(postures, chain.dof) * joint_step(arm)
    rows.flags.writeable = False
    return ReachabilityMap(arm, grasp, rows, chain.functions.within(q.T).T)
