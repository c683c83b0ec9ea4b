"""Reachability maps: where an arm can take its tip, level, tilted or from the top, and where the base must be for it.

A map belongs to one arm and one :class:`GraspClass`. It is a list of rows, one for each reachable pose of a lattice of
``CELL`` metres and ``YAWS`` headings in the **torso frame**: the axes of the robot's base link (x ahead, z up, origin
on the floor), lifted with the torso, so that a point at height z above the floor is at ``z - rise`` when the torso has
risen by ``rise`` above its lowest position. Without a vertical torso the torso frame is the base link's frame.

The pose of a row: the tip is at ``CELL * (x, y, z)``; the approach axis of the hand heads for ``yaw * 2 pi / YAWS`` and
points down by the pitch of the class; its closing axis is horizontal, to the left of the heading for ``roll`` 1 and to
the right for -1. A row keeps the joint values that take the tip there and a score in (0, 1].

A target pose with approach heading h at a point p of the map is reached by row r from the base

    yaw_base = h - yaw_r,    (x_base, y_base) = p_xy - Rz(yaw_base) (x_r, y_r),    rise = p_z - z_r

(Zacharias et al., Capturing robot workspace structure, IROS 2007; inverted as by Vahrenkamp et al., Robot placement
based on reachability inversion, ICRA 2013). ``heights`` gives the torso positions at which a height is in the lattice,
``bases`` all base poses for one of them, ``seeds`` the joint values to begin with, ``find`` the rows of given poses.

    maps = reachability_maps(arm, torso=robot.torso)       # GraspClass -> ReachabilityMap, from the cache or built
    for torso in maps[GraspClass.SIDE].heights(point[2]):
        found = maps[GraspClass.SIDE].bases(point, headings, torso=torso)
        q = maps[GraspClass.SIDE].seeds(found.rows, torso)  # (m, d) in the order of the arm's joints, torso included
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from executive.robots.arms import HandFrame, Lift
from planlang.geometry import Array

CELL = 0.05
"""Side of a cell of the lattice [m]."""
YAWS = 24
"""Headings of the lattice."""

Index = NDArray[np.intp]
Rows = NDArray[Any]
"""Rows of a map, shape (n,), of the dtype that :func:`row_type` describes, ordered by z, roll, yaw, x, y."""


class GraspClass(Enum):
    """The pitch of an approach; the value is its name."""

    SIDE = "side"
    TILTED = "tilted"
    TOP = "top"

    @property
    def pitch(self) -> float:
        """Return the angle of the approach axis below the horizon [rad]."""
        return {"side": 0.0, "tilted": math.pi / 4, "top": math.pi / 2}[self.value]

    @property
    def rolls(self) -> tuple[int, ...]:
        """Rolls with rows of their own; from the top a turned hand is the same as another heading."""
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


@dataclass(frozen=True, slots=True, eq=False)
class Candidates:
    """Base poses from which a target is reached, in the order of the headings asked for, then of the map's rows."""

    bases: Array
    """(m, 3): x, y [m], yaw [rad, not normalised]."""
    scores: Array
    """(m,) in (0, 1]."""
    rows: Index
    """(m,) rows of the map, for :meth:`ReachabilityMap.seeds`."""
    headings: Index
    """(m,) which of the headings asked for."""

    def __len__(self) -> int:
        return len(self.rows)


@dataclass(frozen=True, eq=False)
class ReachabilityMap:
    """The rows of one arm and grasp class; they may be mapped from a file and are not to be written to."""

    arm: str
    grasp: GraspClass
    frame: HandFrame
    names: tuple[str, ...]
    """The arm's joints, the lift included, (d,)."""
    lift: Lift | None
    rows: Rows
    starts: Index
    """(levels + 1,) where the rows of each level of the lattice begin, the lowest first."""
    lowest_level: int

    @staticmethod
    def of(
        arm: str, grasp: GraspClass, frame: HandFrame, names: tuple[str, ...], lift: Lift | None, rows: Rows
    ) -> ReachabilityMap:
        """Over ordered rows."""
        levels = np.asarray(rows["z"], np.intp)
        lowest, highest = (int(levels[0]), int(levels[-1])) if len(levels) else (0, -1)
        starts = np.searchsorted(levels, np.arange(lowest, highest + 2))
        return ReachabilityMap(arm, grasp, frame, names, lift, rows, starts, lowest)

    def __len__(self) -> int:
        return len(self.rows)

    def heights(self, z: float) -> tuple[float, ...]:
        """Torso positions, lowest first, at which a height [m] above the floor is exactly that of some rows.

        Without a lift (0.0,) if the nearest level has rows: targets are then up to half a cell off the lattice.
        """
        if self.lift is None:
            return (0.0,) if len(self._level(self._nearest(z))) else ()
        most = float(self.lift.rise(self.lift.highest))
        levels = range(math.ceil((z - most) / CELL - 1e-9), math.floor(z / CELL + 1e-9) + 1)
        rises = [z - CELL * level for level in reversed(levels) if len(self._level(level))]
        return tuple(float(self.lift.position(min(max(rise, 0.0), most))) for rise in rises)

    def bases(
        self,
        point: ArrayLike,
        headings: ArrayLike,
        *,
        torso: float = 0.0,
        rolls: tuple[int, ...] = (1, -1),
        least: float = 0.0,
    ) -> Candidates:
        """Return base poses in the map that take the tip to ``point`` (3,) with one of the headings (k,).

        ``torso`` is its joint position; ``rolls`` those that are wanted (from the top both are the same poses seen
        from opposite headings); ``least`` the lowest score.
        """
        x, y, z = (float(value) for value in np.asarray(point, float))
        chosen = self._level(self._nearest(z - self._rise(torso)))
        found = self.rows[chosen.start : chosen.stop]
        kept = found["score"] > least
        turned = np.zeros(len(found))
        if self.grasp is GraspClass.TOP:
            turned[:] = 0.0 if 1 in rolls else math.pi
        else:
            kept = kept & np.isin(found["roll"], rolls)
        index = np.flatnonzero(kept)
        found, turned = found[index], turned[index]
        wanted = np.atleast_1d(np.asarray(headings, float))
        yaw = wanted[:, None] - found["yaw"] * (2 * math.pi / YAWS) + turned
        ahead, aside = CELL * found["x"], CELL * found["y"]
        c, s = np.cos(yaw), np.sin(yaw)
        bases = np.stack([x - (c * ahead - s * aside), y - (s * ahead + c * aside), yaw], axis=-1).reshape(-1, 3)
        count = len(wanted)
        return Candidates(
            bases,
            np.tile(found["score"].astype(float), count),
            np.tile(index + chosen.start, count),
            np.repeat(np.arange(count), len(found)),
        )

    def seeds(self, rows: ArrayLike, torso: ArrayLike = 0.0) -> Array:
        """Joint values (m, d) of rows (m,), in the order of ``names``, with the torso at a position (or (m,))."""
        arm = self.rows["q"][np.asarray(rows, np.intp)].astype(float)
        if self.lift is None:
            return np.asarray(arm)
        return np.insert(arm, self.lift.column, np.asarray(torso, float), axis=1)

    def poses(self, rows: ArrayLike, torso: ArrayLike = 0.0) -> Array:
        """Tip poses (m, 4, 4) of rows (m,) in the base link's frame."""
        chosen = self.rows[np.asarray(rows, np.intp)]
        poses = np.tile(np.eye(4), (len(chosen), 1, 1))
        poses[:, :3, :3] = self.grasp.rotations(chosen["yaw"] * (2 * math.pi / YAWS), chosen["roll"], self.frame)
        poses[:, :3, 3] = CELL * np.stack([chosen["x"], chosen["y"], chosen["z"]], axis=-1)
        poses[:, 2, 3] += self._rise(torso)
        return poses

    def find(self, points: ArrayLike, headings: ArrayLike, rolls: ArrayLike, torso: ArrayLike = 0.0) -> Index:
        """The row (m,) nearest to each tip point (m, 3) and heading (m,) in the base link's frame; -1 without one.

        "Nearest" is the lattice pose whose cell the pose is in; ``rolls`` (m,) are 1 or -1, ``torso`` one or (m,).
        """
        places = np.asarray(points, float).reshape(-1, 3).copy()
        places[:, 2] -= self._rise(torso)
        cells = np.rint(np.clip(places / CELL, -511, 511)).astype(np.int64)
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

    @cached_property
    def _sorted(self) -> NDArray[np.int64]:
        return _row_keys(self.rows)

    def _rise(self, torso: ArrayLike) -> Any:
        return 0.0 if self.lift is None else self.lift.rise(torso)

    def _nearest(self, z: float) -> int:
        return round(z / CELL)

    def _level(self, level: int) -> range:
        """Return the rows of a level."""
        number = level - self.lowest_level
        if not 0 <= number < len(self.starts) - 1:
            return range(0)
        return range(int(self.starts[number]), int(self.starts[number + 1]))


def row_type(d: int) -> np.dtype[Any]:
    """Return the type of a row: lattice indices, roll, score, and d joint values (the lift left out)."""
    return np.dtype(
        [("z", "<i2"), ("roll", "i1"), ("yaw", "i1"), ("x", "<i2"), ("y", "<i2"), ("score", "<f4"), ("q", "<f4", (d,))]
    )


def ordered(rows: Rows) -> Rows:
    """Return the same rows by z, roll, yaw, x, y."""
    return np.asarray(rows[np.argsort(_row_keys(rows), kind="stable")])


def _row_keys(rows: Rows) -> NDArray[np.int64]:
    return np.asarray(_keys(*(rows[name].astype(np.int64) for name in ("z", "roll", "yaw", "x", "y"))))


def _keys(z: Any, roll: Any, yaw: Any, x: Any, y: Any) -> Any:
    """Return one whole number per row that sorts like the rows."""
    return ((((z + 512) * 2 + (roll + 1) // 2) * YAWS + yaw) * 1024 + x + 512) * 1024 + y + 512
