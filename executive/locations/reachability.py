"""Reachability maps: which level, tilted or top poses an arm can reach with its tip, and from which base poses.

A map belongs to one arm and one :class:`GraspClass`. It is a list of rows, one for each reachable pose of a lattice of
``CELL`` metres and ``YAWS`` headings in the **torso frame**: the axes of the robot's base link (x ahead, z up, origin
on the floor), lifted with the torso, so that a point at height z above the floor is at ``z - rise`` when the torso is
``rise`` above its lowest position. Without a vertical torso the torso frame is the base link's frame.

In the pose of a row the tip is at ``CELL * (x, y, z)``; the approach axis of the hand has the heading ``yaw * 2 pi /
YAWS`` and points down by the pitch of the class; its closing axis is horizontal, to the left of the heading for
``roll`` 1 and to the right for -1. A row has a score in (0, 1] and a posture close to joint values for the pose: rows
of a few neighbouring cells and headings share one, and ``seeds`` solves for exact values.

A target pose with approach heading h at a point p of the map is reached by row r from the base

    yaw_base = h - yaw_r,    (x_base, y_base) = p_xy - Rz(yaw_base) (x_r, y_r),    rise = p_z - z_r

(Zacharias et al., Capturing robot workspace structure, IROS 2007; inverted as in Vahrenkamp et al., Robot placement
based on reachability inversion, ICRA 2013; here in ``base_candidates``). ``heights`` lists the torso positions at which
a height is in the lattice, ``seeds`` gives the joint values of rows, ``find`` the rows of given poses.

    found = reachability_map(arm, GraspClass.SIDE)         # from the files of the robot, the cache, or built
    for torso in found.heights(point[2]):
        rows = found.find(points, headings, rolls, torso)  # -1 where there is none
        q = found.seeds(rows[rows >= 0], torso)            # (m, d) in the order of the arm's joints, torso included

An arm with fewer than six freedoms reaches almost no pose of the lattice exactly: its rows are sampled
(:func:`sampled`), near lattice poses but not at them. They are at the heights of the lattice where the arm can move its
tip up and down with the hand in the attitude of the class; where only the lift can (a SCARA, a telescope), they keep
their height, from which the lift takes them to any height within its range.
"""

from __future__ import annotations

import math
from enum import Enum
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from executive.motion import Chain
from executive.robots.arms import ArmModel, HandFrame
from planlang.geometry import Array
from planlang.records import dataclass

CELL = 0.05
"""Side of a cell of the lattice [m]."""
YAWS = 24
"""Number of headings of the lattice."""

Index = NDArray[np.intp]
ROW = np.dtype(
    [("z", "<i2"), ("roll", "i1"), ("yaw", "i1"), ("x", "<i2"), ("y", "<i2"), ("score", "<f4"), ("posture", "<i4")]
)
"""Row: lattice indices, roll, score, and the index of a nearby posture."""
Rows = NDArray[Any]
"""Rows of a map, shape (n,), of type :data:`ROW`, sorted by z, roll, yaw, x, y."""


class GraspClass(Enum):
    """Pitch of an approach; the value is its name."""

    SIDE = "side"
    TILTED = "tilted"
    TOP = "top"

    @property
    def pitch(self) -> float:
        """Angle of the approach axis below the horizon [rad]."""
        return {"side": 0.0, "tilted": math.pi / 4, "top": math.pi / 2}[self.value]

    @property
    def rolls(self) -> tuple[int, ...]:
        """Rolls with separate rows; from the top, turning the hand by half a turn equals another heading."""
        return (1,) if self is GraspClass.TOP else (1, -1)

    def rotations(self, headings: ArrayLike, rolls: ArrayLike, frame: HandFrame) -> Array:
        """Tip rotations (m, 3, 3) for approach headings (m,) [rad] and rolls (m,), 1 or -1."""
        yaw, roll = np.broadcast_arrays(np.asarray(headings, float), np.asarray(rolls, float))
        c, s = np.cos(yaw), np.sin(yaw)
        down, ahead = math.sin(self.pitch), math.cos(self.pitch)
        first = np.stack([c * ahead, s * ahead, np.full(yaw.shape, -down)], axis=-1)
        second = roll[..., None] * np.stack([-s, c, np.zeros(yaw.shape)], axis=-1)
        axes = np.stack([first, second, np.cross(first, second)], axis=-1)
        return np.asarray(axes @ frame.rotation(np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])))


def carried(arm: ArmModel) -> Chain:
    """Chain of an arm with its lift locked at the lowest position."""
    chain = arm.chain
    return chain if arm.lift is None else chain.locked({arm.lift.joint: arm.lift.lowest})


def is_bound(arm: ArmModel) -> bool:
    """Check whether an arm without its lift has too few freedoms to reach arbitrary poses of a lattice.

    The stages of a telescope are one freedom together.
    """
    return arm.chain.mobility(still=None if arm.lift is None else arm.lift.column) < 6


@dataclass(frozen=True, eq=False)
class ReachabilityMap:
    """Rows of one arm and grasp class."""

    arm: ArmModel
    grasp: GraspClass
    rows: Rows
    """Sorted by :func:`row_keys`."""
    postures: Array
    """Joint values (p, d), without the lift, that rows share."""

    def __len__(self) -> int:
        return len(self.rows)

    def heights(self, z: float) -> tuple[float, ...]:
        """List torso positions, lowest first, at which a height [m] above the floor is that of some rows.

        Without a lift, (0.0,) if the nearest level has rows: targets are then up to half a cell off the lattice. The
        same holds for a lift that is too short to take a level of the lattice to every height.
        """
        return tuple(torso for torso, _, _ in self.tiers(z))

    def tiers(self, z: float) -> tuple[tuple[float, int, int], ...]:
        """List torso positions as in :meth:`heights`, each with level and offset of the rows: see :attr:`offsets`."""
        if self.arm.lift is None:
            level = round(z / CELL)
            return ((0.0, level, 0),) if len(self.level(level)) else ()
        most = float(self.arm.lift.rise(self.arm.lift.highest))
        # sampled rows are up to half a step off the level that they count to
        spare = LEVELLED / 2 / CELL if is_bound(self.arm) else 1e-9
        levels = range(math.ceil((z - most) / CELL - spare), math.floor(z / CELL + spare) + 1)
        found = [(z - CELL * level, level, 0) for level in levels if self._has(level, 0)]
        if not len(levels):  # it rises by less than a cell
            nearest = round((z - most / 2) / CELL)
            found = [(z - CELL * nearest, nearest, 0)] if self._has(nearest, 0) else []
        for level, offset in self.raised:
            rise = z - CELL * level - LEVELLED * offset
            if -LEVELLED / 2 <= rise <= most + LEVELLED / 2:
                found.append((rise, level, offset))
        return tuple(
            (float(self.arm.lift.position(min(max(rise, 0.0), most))), level, offset)
            for rise, level, offset in sorted(found)
        )

    @cached_property
    def offsets(self) -> Index:
        """Heights of rows (n,) above their levels, in steps of :data:`LEVELLED`: 0 on the lattice."""
        if not is_bound(self.arm) or self.arm.lift is None:
            return np.zeros(len(self), np.intp)
        chain = carried(self.arm)
        heights = chain.fk(self.postures)[self.rows["posture"], 2, 3] if len(self) else np.zeros(0)
        return np.rint((heights - CELL * self.rows["z"]) / LEVELLED).astype(np.intp)

    @cached_property
    def raised(self) -> tuple[tuple[int, int], ...]:
        """Level and offset of the rows that are off the lattice's heights."""
        off = self.offsets != 0
        pairs = np.column_stack([self.rows["z"][off], self.offsets[off]])
        return tuple(sorted({(level, offset) for level, offset in pairs.tolist()}))

    def _has(self, level: int, offset: int) -> bool:
        """Check whether a level has rows at an offset."""
        rows = self.level(level)
        if not self.raised:
            return len(rows) > 0
        return bool((self.offsets[rows.start : rows.stop] == offset).any())

    def seeds(self, rows: ArrayLike, torso: ArrayLike = 0.0) -> Array:
        """Compute joint values (m, d) of rows (m,), in the order of the arm's joints, at one torso position or (m,)."""
        chosen = np.asarray(rows, np.intp)
        q = self.postures[self.rows["posture"][chosen]] if is_bound(self.arm) else self._exact(chosen)
        return q if self.arm.lift is None else np.insert(q, self.arm.lift.column, np.asarray(torso, float), axis=1)

    def _exact(self, rows: Index) -> Array:
        """Solve for joint values (m, d) at the poses of rows (m,), without the lift; results are cached."""
        joints, known = self._solved
        new = np.unique(rows[~known[rows]])
        if len(new):
            near, lowest = self.postures[self.rows["posture"][new]], self.arm.lift.lowest if self.arm.lift else 0.0
            joints[new], _ = carried(self.arm).solve(self.poses(new, lowest), near[:, None])  # as when it was built
            known[new] = True
        return joints[rows]

    def poses(self, rows: ArrayLike, torso: ArrayLike = 0.0) -> Array:
        """Compute tip poses (m, 4, 4) of rows (m,) in the base link's frame."""
        chosen = self.rows[np.asarray(rows, np.intp)]
        poses = np.tile(np.eye(4), (len(chosen), 1, 1))
        poses[:, :3, :3] = self.grasp.rotations(chosen["yaw"] * (2 * math.pi / YAWS), chosen["roll"], self.arm.frame)
        poses[:, :3, 3] = CELL * np.stack([chosen["x"], chosen["y"], chosen["z"]], axis=-1)
        poses[:, 2, 3] += self._rise(torso)
        return poses

    def find(self, points: ArrayLike, headings: ArrayLike, rolls: ArrayLike, torso: ArrayLike = 0.0) -> Index:
        """Find the row (m,) nearest to each tip point (m, 3) and heading (m,) in the base link's frame; -1 if none.

        "Nearest" is the lattice pose whose cell contains the pose; ``rolls`` (m,) are 1 or -1, ``torso`` one or (m,).
        """
        places = np.asarray(points, float).reshape(-1, 3).copy()
        places[:, 2] -= self._rise(torso)
        cells = np.rint(np.clip(places / CELL, -511, 511)).astype(np.int64)
        first, steps = self._mapped
        if steps.max() > 1:
            cells[:, :2] = first + steps * np.rint((places[:, :2] / CELL - first) / steps).astype(np.int64)
        roll = np.broadcast_to(np.asarray(rolls, np.int64), (len(cells),)).copy()
        yaws = np.broadcast_to(np.asarray(headings, float), (len(cells),)).copy()
        if self.grasp is GraspClass.TOP:
            yaws[roll < 0] += math.pi
            roll[:] = 1
        yaw = np.rint(yaws / (2 * math.pi / YAWS)).astype(np.int64) % YAWS
        keys = _keys(cells[:, 2], roll, yaw, cells[:, 0], cells[:, 1])
        if not len(self):
            return np.full(len(keys), -1, np.intp)
        at = np.minimum(np.searchsorted(self._sorted, keys), len(self) - 1)
        return np.where(self._sorted[at] == keys, at, -1).astype(np.intp)

    @property
    def spacing(self) -> tuple[float, float]:
        """Distances between rows in x and y [m]: more than :data:`CELL` in the maps of large arms."""
        x, y = (CELL * self._mapped[1]).tolist()
        return x, y

    @cached_property
    def _mapped(self) -> tuple[Index, Index]:
        """First mapped cell in x and y (2,), and the number of cells from each to the next (2,)."""
        places = np.column_stack([self.rows[axis][:GRIDDED].astype(np.intp) for axis in "xy"])
        if len(places) < GRIDDED or is_bound(self.arm):
            return np.zeros(2, np.intp), np.ones(2, np.intp)
        return places[0], np.maximum(np.gcd.reduce(np.abs(np.diff(places, axis=0))), 1)

    @cached_property
    def lowest_level(self) -> int:
        """Level of the lowest rows."""
        return int(self.rows["z"][0]) if len(self) else 0

    @cached_property
    def _starts(self) -> Index:
        """First row of each level of the lattice, the lowest first, (levels + 1,)."""
        levels = np.asarray(self.rows["z"], np.intp)
        return np.searchsorted(levels, np.arange(self.lowest_level, int(levels[-1]) + 2 if len(self) else 1))

    @cached_property
    def _solved(self) -> tuple[Array, NDArray[np.bool_]]:
        """Exact joint values of rows (n, d), and which of them are known (n,)."""
        return np.zeros((len(self), self.postures.shape[1])), np.zeros(len(self), bool)

    @cached_property
    def _sorted(self) -> NDArray[np.int64]:
        return row_keys(self.rows)

    def _rise(self, torso: ArrayLike) -> Any:
        return 0.0 if self.arm.lift is None else self.arm.lift.rise(torso)

    def level(self, number: int) -> range:
        """Rows of a level."""
        above = number - self.lowest_level
        if not 0 <= above < len(self._starts) - 1:
            return range(0)
        return range(int(self._starts[above]), int(self._starts[above + 1]))


def row_keys(rows: Rows) -> NDArray[np.int64]:
    """Compute one integer per row from z, roll, yaw, x and y: unique, and increasing in a map."""
    return np.asarray(_keys(*(rows[name].astype(np.int64) for name in ("z", "roll", "yaw", "x", "y"))))


def _keys(z: Any, roll: Any, yaw: Any, x: Any, y: Any) -> Any:
    return ((((z + 512) * 2 + (roll + 1) // 2) * YAWS + yaw) * 1024 + x + 512) * 1024 + y + 512


def rows_of(keys: NDArray[np.int64]) -> Rows:
    """Create rows from their keys, without scores and postures."""
    rows = np.zeros(len(keys), ROW)
    rest, y = np.divmod(keys, 1024)
    rest, x = np.divmod(rest, 1024)
    rest, rows["yaw"] = np.divmod(rest, YAWS)
    z, roll = np.divmod(rest, 2)
    rows["x"], rows["y"], rows["z"], rows["roll"] = x - 512, y - 512, z - 512, 2 * roll - 1
    return rows


LEVELLED = 2e-3
"""Steps of the heights of rows off the lattice's [m]; inverse kinematics moves the lift by the rest."""
GRIDDED = 1_000
"""Number of rows from which the spacing of a map is known."""
POSTURES = 60_000
"""Random postures per roll."""
SAMPLED_AT_ONCE = 10_000
"""Postures computed at once."""
STEPS = 12
"""Newton steps of the projection of a posture."""
DAMPING = 1e-6
STIFF = 1e-2
"""An arm that moves its tip up or down no faster than this cannot change its height [m per rad or m]."""
NEAR = 1e-4, 9e-4
"""Largest error of a pose from a height of the lattice [m], and from the required rotation [rad]."""


def sampled(
    chain: Chain, grasp: GraspClass, frame: HandFrame, roll: int, floor: float, rng: np.random.Generator
) -> tuple[Array, Array, NDArray[np.int64]]:
    """Sample joint values (n, d), places (n, 3: x, y, heading) and levels (n,) of the tip, none below ``floor`` [m]."""
    parts = [
        _projected(chain, grasp, frame, roll, chain.sample(rng, SAMPLED_AT_ONCE))
        for _ in range(POSTURES // SAMPLED_AT_ONCE)
    ]
    q = np.concatenate([part for part in parts if len(part)] or [np.zeros((0, chain.dof))])
    places, heights = exact_places(chain, q, grasp, frame, roll)
    levels = np.rint(heights / CELL).astype(np.int64)
    kept = heights >= floor - CELL / 2
    return q[kept], places[kept], levels[kept]


def exact_places(chain: Chain, q: Array, grasp: GraspClass, frame: HandFrame, roll: Array | int) -> tuple[Array, Array]:
    """Compute tip poses for joint values (n, d): x, y [m] and heading [rad] (n, 3), and the heights (n,) [m]."""
    if not len(q):
        return np.zeros((0, 3)), np.zeros(0)
    tips = chain.fk(q)
    headings = _headings(tips[:, :3, :3], grasp, frame, roll)
    return np.column_stack([tips[:, :2, 3], headings]), tips[:, 2, 3]


def cells_of(places: Array) -> NDArray[np.int64]:
    """Find the lattice cells (n, 3: x, y, heading) that contain places (n, 3)."""
    turns = np.rint(places[:, 2] / (2 * math.pi / YAWS)).astype(np.int64) % YAWS
    return np.column_stack([np.rint(places[:, :2] / CELL).astype(np.int64), turns])


def _headings(rotations: Array, grasp: GraspClass, frame: HandFrame, roll: Array | int) -> Array:
    if grasp is GraspClass.TOP:
        closing = rotations @ np.asarray(frame.closing)
        return np.asarray(np.arctan2(-closing[:, 0] * roll, closing[:, 1] * roll))
    approach = rotations @ np.asarray(frame.approach)
    return np.asarray(np.arctan2(approach[:, 1], approach[:, 0]))


def _projected(chain: Chain, grasp: GraspClass, frame: HandFrame, roll: int, q: Array) -> Array:
    """Project postures (n, d) to nearby ones of the class at a lattice height; those that fail are dropped.

    Where the arm cannot change the height of its tip without tilting the hand, they keep the height they have.
    """
    right, kept = _moved_to(chain, grasp, frame, roll, q, None)
    right = right[kept]
    if not len(right):
        return right
    level = np.rint(chain.fk(right)[:, 2, 3] / CELL) * CELL
    at_level, kept = _moved_to(chain, grasp, frame, roll, right, level)
    stiff = right[~kept]
    return np.concatenate([at_level[kept], stiff[_lift(chain, stiff) < STIFF]]) if len(stiff) else at_level


def _moved_to(
    chain: Chain, grasp: GraspClass, frame: HandFrame, roll: int, q: Array, level: Array | None
) -> tuple[Array, NDArray[np.bool_]]:
    """Move joints (n, d) until the attitude is that of the class and the tip at heights (n,) [m], if there are any.

    Returns where they are then, and which of them are right.
    """
    first = 0 if level is not None else 1
    moving = (chain.upper > chain.lower).astype(float)
    for step in range(STEPS + 1):
        error = _error(chain, grasp, frame, roll, q, level)
        near = np.abs(error)
        kept = (near[:, 0] < NEAR[0]) & (near[:, 1:].max(axis=1) < NEAR[1])
        if kept.all() or step == STEPS:
            break
        jacobian = chain.jacobian(q)[:, 2 + first : 5] * moving  # velocity upwards, turning about x and y
        squares = jacobian @ jacobian.transpose(0, 2, 1) + DAMPING * np.eye(3 - first)
        change = jacobian.transpose(0, 2, 1) @ np.linalg.solve(squares, error[:, first:, None])
        q = np.clip(q + np.clip(change[:, :, 0], -0.4, 0.4), chain.lower, chain.upper)
    return q, kept & _level_about(chain, grasp, frame, roll, q)


def _lift(chain: Chain, q: Array) -> Array:
    """Compute how fast (n,) joints can move the tip up or down, with the hand kept level, in postures (n, d)."""
    jacobian = chain.jacobian(q)[:, 2:5] * (chain.upper > chain.lower)
    up, turning = jacobian[:, :1], jacobian[:, 1:]
    squares = turning @ turning.transpose(0, 2, 1) + DAMPING * np.eye(2)
    lost = turning.transpose(0, 2, 1) @ np.linalg.solve(squares, turning @ up.transpose(0, 2, 1))
    return np.asarray(np.linalg.norm(up[:, 0] - lost[:, :, 0], axis=1))


def _error(chain: Chain, grasp: GraspClass, frame: HandFrame, roll: int, q: Array, level: Array | None) -> Array:
    """Compute errors in height [m], if one is required, and in rotation about x and y [rad], (n, 3)."""
    tips = chain.fk(q)
    level = tips[:, 2, 3] if level is None else level
    required = grasp.rotations(_headings(tips[:, :3, :3], grasp, frame, roll), roll, frame)
    turn = required @ tips[:, :3, :3].transpose(0, 2, 1)
    return np.column_stack([level - tips[:, 2, 3], _log(turn)[:, :2]])


def _level_about(chain: Chain, grasp: GraspClass, frame: HandFrame, roll: int, q: Array) -> NDArray[np.bool_]:
    """Check whether the rotation about z is right, too: the whole rotation is that of the class."""
    tips = chain.fk(q)[:, :3, :3]
    required = grasp.rotations(_headings(tips, grasp, frame, roll), roll, frame)
    turns = required @ tips.transpose(0, 2, 1)
    half = np.trace(turns, axis1=1, axis2=2) < 0  # the logarithm of half a turn is zero, too
    return np.asarray((np.abs(_log(turns)).max(axis=1) < NEAR[1]) & ~half)


def _log(rotations: Array) -> Array:
    """Compute rotation vectors (n, 3) of rotations (n, 3, 3): rough near half a turn, and zero for half a turn."""
    cosine = np.clip((np.trace(rotations, axis1=1, axis2=2) - 1) / 2, -1.0, 1.0)
    angle = np.arccos(cosine)
    skew = np.stack(
        [
            rotations[:, 2, 1] - rotations[:, 1, 2],
            rotations[:, 0, 2] - rotations[:, 2, 0],
            rotations[:, 1, 0] - rotations[:, 0, 1],
        ],
        axis=1,
    )
    scale = np.where(angle < 1e-6, 0.5, angle / np.maximum(2 * np.sin(angle), 1e-6))
    return np.asarray(scale[:, None] * skew)
