"""Chains of joints: forward kinematics, Jacobian and inverse kinematics, in the frame of the chain's base link.

A neck is aimed by a table of its forward kinematics (:class:`Gaze`).
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import astuple, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from executive.motion.symbolic import ROTATION_WEIGHT, ChainFunctions, Variable
from planlang.geometry import Array
from planlang.geometry.matrices import product, rotated
from planlang.geometry.urdf import KINDS, Joint, NoSuchChain, joints_between, master_of, read_urdf
from planlang.kept import Latest
from planlang.kernel import still_computing

POSITION_TOLERANCE = 1e-4
"""Largest position error of a solution [m]: a tenth of what grasps and contacts notice."""
ANGLE_TOLERANCE = 1e-3
"""Largest rotation error of a solution [rad]: 0.1 mm at the end of a hand of 10 cm."""
TOLERANCES = np.square([[POSITION_TOLERANCE], [ANGLE_TOLERANCE]])
STEPS = 40
"""Steps of inverse kinematics after which a seed is given up."""
STALLED, MOST_SLOW = 0.9, 3
"""A seed is given up when this many steps in a row leave more than this share of its least squared error so far.

Of 2,000 random targets of Amigo's arm 75.3 % are then solved from one random seed, and all but one from 20; 5 steps
solve 76.0 %, but make unreachable targets, which cost 10 steps, 15 % more expensive."""
SINGULAR = 1e-6
"""Singular values of Jacobians below this are zero [m, or 1]."""
IMPROPER = 0.01
"""Largest error in elements of R R^T up to which a matrix R stands for the nearest rotation.

Quaternions whose norm is off by 0.001 give as much; solutions have the rotation that is nearest to R."""


class JointRanges:
    """n joints with their ranges, and the links that they move."""

    lower: Array
    """Lower limits (n,) [rad, m]; -pi, the start of its range, for a continuous joint."""
    upper: Array
    """Upper limits (n,)."""
    continuous: NDArray[np.bool_]
    """Mask of continuous joints (n,)."""

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper limits (n,), infinite for continuous joints."""
        return np.where(self.continuous, -np.inf, self.lower), np.where(self.continuous, np.inf, self.upper)

    def within(self, q: ArrayLike, tolerance: float = 0.0) -> NDArray[np.bool_]:
        """Check which configurations (m, n) respect all limits; continuous joints have none."""
        rows = np.atleast_2d(np.asarray(q, float))
        lower, upper = self.bounds
        return np.asarray(((rows >= lower - tolerance) & (rows <= upper + tolerance)).all(axis=1))

    def near(self, q: ArrayLike, reference: ArrayLike) -> Array:
        """Shift continuous joints of configurations (..., n) by whole turns to within half a turn of the reference."""
        configurations, target = np.asarray(q, float), np.asarray(reference, float)
        turns = np.where(self.continuous, np.round((target - configurations) / (2 * np.pi)), 0.0)
        return np.asarray(configurations + 2 * np.pi * turns)

    def frame_rows(self, q: ArrayLike) -> Array:
        """Compute the first three rows of poses of the moving links in the base, (j, 3, 4, m), for configurations."""
        raise NotImplementedError

    def frames(self, q: ArrayLike) -> Array:
        """Compute poses (m, j, 4, 4) of the moving links in the base for configurations (m, n)."""
        return _whole(self.frame_rows(q))


class Chain(JointRanges):
    """Joints from a base link to a tip link; d of them move.

    A mimic joint moves with its master; a master outside the chain takes the mimic's place in ``names``. Fixed and
    locked joints are folded into the constants. Inverse kinematics is by Levenberg-Marquardt, from given seeds.
    """

    def __init__(self, joints: Sequence[Joint], *, others: Iterable[Joint] = (), locked: Mapping[str, float]) -> None:
        """Create a chain of joints, base to tip; ``others`` may be masters of mimics, ``locked`` ones do not move."""
        self._joints, self._others, self._locked = tuple(joints), tuple(others), dict(locked)
        every = {joint.name: joint for joint in (*self._others, *joints)}
        movers: dict[str, Joint] = {}
        variables: list[Variable] = []
        ranges: dict[str, tuple[float, float]] = {}
        for joint in joints:
            followed = master_of(joint, every)
            name, multiplier, offset = followed.joint, followed.multiplier, followed.offset
            master = every[name]
            if joint.kind == "fixed" or name in locked or joint.name in locked or master.kind == "fixed":
                value = locked.get(joint.name, multiplier * locked.get(name, 0.0) + offset)
                variables.append(Variable(None, 0.0, value))
                continue
            movers.setdefault(name, master)
            variables.append(Variable(tuple(movers).index(name), multiplier, offset))
            if multiplier and joint.kind != "continuous":
                ends = sorted(((joint.lower - offset) / multiplier, (joint.upper - offset) / multiplier))
                low, high = ranges.get(name, (master.lower, master.upper))
                ranges[name] = (max(low, ends[0]), min(high, ends[1]))
        self.names: tuple[str, ...] = tuple(movers)
        """Joint names, base first."""
        self.dof: int = len(movers)
        """Number of moving joints, d."""
        moved = zip(joints, variables, strict=True)
        self.carriers: tuple[str, ...] = tuple(joint.child for joint, variable in moved if variable.index is not None)
        """Child links of its moving joints, base first; :meth:`frames` computes their poses."""
        limits = [ranges.get(name, (joint.lower, joint.upper)) for name, joint in movers.items()]
        self.lower = _frozen([low for low, _ in limits])
        self.upper = _frozen([high for _, high in limits])
        self.velocity: Array = _frozen([joint.velocity for joint in movers.values()])
        """Velocity limits (d,) [rad/s, m/s] from the URDF."""
        self.continuous = np.array([joint.kind == "continuous" for joint in movers.values()], bool)
        self.prismatic: NDArray[np.bool_] = np.array([joint.kind == "prismatic" for joint in movers.values()], bool)
        """Mask of prismatic joints (d,)."""
        self._variables = tuple(variables)

    @classmethod
    def from_urdf(
        cls, path: Path, base_link: str, tip_link: str, locked: Mapping[str, float] | Iterable[str] = ()
    ) -> Chain:
        """Read a chain; ``locked`` joints keep the given position, or the one nearest to zero within their limits.

        Raises BadInput for an unusable URDF, :class:`NoSuchChain` for links that do not form a chain with at least one
        moving joint of the kinds revolute, continuous and prismatic.
        """
        every = read_urdf(Path(path)).joints
        joints = joints_between(every, base_link, tip_link)
        links = [joint.child for joint in every]
        at = dict(locked) if isinstance(locked, Mapping) else dict.fromkeys(locked, 0.0)
        known = {joint.name: joint for joint in every}
        for name in at:
            if name not in known:
                raise NoSuchChain(base_link, tip_link, f"there is no joint {name!r} to lock", links)
            if not isinstance(locked, Mapping):
                at[name] = min(max(0.0, known[name].lower), known[name].upper)
        for joint in joints:
            if joint.kind not in KINDS and joint.name not in at:
                raise NoSuchChain(base_link, tip_link, f"joint {joint.name!r} is {joint.kind or 'untyped'!r}", links)
        chain = cls(joints, others=every, locked=at)
        if not chain.names:
            raise NoSuchChain(base_link, tip_link, "no joint between them moves", links)
        return chain

    def locked(self, positions: Mapping[str, float]) -> Chain:
        """Lock more joints at given positions."""
        return Chain(self._joints, others=self._others, locked={**self._locked, **positions})

    def between(self, name: str, lower: float, upper: float) -> Chain:
        """Restrict one joint to a range."""
        joints = [replace(joint, lower=lower, upper=upper) if joint.name == name else joint for joint in self._joints]
        return Chain(joints, others=self._others, locked=self._locked)

    @cached_property
    def digest(self) -> str:
        """Digest that is equal for equal kinematics: joints, frames, axes, limits, and locked positions."""
        moved = zip(self._joints, self._variables, strict=True)
        # rounded, since the sines of an origin's angles differ in the last bit between processors
        parts = [
            (joint.kind, *((array.round(12) + 0.0).tolist() for array in (joint.origin, joint.axis)), astuple(variable))
            for joint, variable in moved
        ]
        limits = (self.names, self.lower.tolist(), self.upper.tolist(), self.continuous.tolist())
        return hashlib.sha256(repr((parts, limits)).encode()).hexdigest()

    @cached_property
    def functions(self) -> ChainFunctions:
        """Compiled functions, shared by all chains of a process with the same digest."""
        return _FUNCTIONS.of(self.digest, lambda: ChainFunctions(self._joints, self._variables, *self.bounds))

    def fk(self, q: ArrayLike) -> Array:
        """Compute poses (n, 4, 4) of the tip in the base for configurations (n, d)."""
        (rows,) = self.functions.tip(self._rows(q).T)
        return _whole(rows.reshape(3, 4, rows.shape[1]))

    def frame_rows(self, q: ArrayLike) -> Array:
        """Compute the first three rows of these poses, configurations along the last axis: (j, 3, 4, n)."""
        rows = self._rows(q)
        if not self.carriers:
            return np.zeros((0, 3, 4, len(rows)))
        return self.functions.frames(rows.T)[0].reshape(len(self.carriers), 3, 4, len(rows))

    def jacobian(self, q: ArrayLike) -> Array:
        """Compute geometric Jacobians (n, 6, d) for configurations (n, d): linear above angular velocity of the tip.

        Both in the axes of the base.
        """
        (rows,) = self.functions.jacobian(self._rows(q).T)
        return rows.T.reshape(rows.shape[1], 6, self.dof)

    def may_reach(self, targets: ArrayLike) -> NDArray[np.bool_]:
        """Check which targets (m, 4, 4) in the base are within the chain's greatest extent."""
        center, radius, last = self._span
        poses = np.asarray(targets, float)
        last_frames = rotated(poses[:, :3, :3], last) + poses[:, :3, 3]
        slack = POSITION_TOLERANCE + ANGLE_TOLERANCE * float(np.linalg.norm(last)) + 1e-6
        return np.asarray(np.linalg.norm(last_frames - center, axis=1) <= radius + slack)

    @cached_property
    def _span(self) -> tuple[Array, float, Array]:
        """Centre (3,) and radius [m] of a ball that holds the last moving link's origin; that origin (3,) in the tip.

        The ball is in the base. The distance between origins of consecutive moving links is constant, apart from the
        travel of prismatic joints.
        """
        middle = (self.lower + self.upper) / 2
        origins = self.frames(middle)[0, :, :3, 3]
        tip = self.fk(middle)[0]
        travel = [
            abs(variable.multiplier) * float(self.upper[variable.index] - self.lower[variable.index])
            for joint, variable in zip(self._joints, self._variables, strict=True)
            if variable.index is not None and joint.kind == "prismatic"
        ]
        radius = float(np.linalg.norm(np.diff(origins, axis=0), axis=1).sum()) + sum(travel)
        return origins[0], radius, rotated(tip[:3, :3].T, origins[-1] - tip[:3, 3])

    def sample(self, rng: np.random.Generator, shape: int | tuple[int, ...]) -> Array:
        """Draw uniform configurations (*shape, d) within the limits.

        The stages of a telescope extend alike: drawn one by one, they would hardly ever be all out or all in.
        """
        sizes = (shape,) if isinstance(shape, int) else shape
        q = rng.uniform(self.lower, self.upper, (*sizes, self.dof))
        for joint, first, sign in self._stages:
            low, high = self.lower[[first, joint]], self.upper[[first, joint]]
            share = (q[..., first] - low[0]) / (high[0] - low[0])
            q[..., joint] = low[1] + (share if sign > 0 else 1.0 - share) * (high[1] - low[1])
        return q

    def mobility(self, still: int | None = None) -> int:
        """Count the directions of motion of the tip, of 6, that its joints have together in general postures.

        That is the rank of the Jacobian: joints that slide in parallel count as one, those without a range not at all.
        Without the joint ``still``, if one is given.
        """
        moving = [joint for joint in np.flatnonzero(self.upper > self.lower).tolist() if joint != still]
        return int(np.linalg.matrix_rank(self._twists[:, :, moving], tol=SINGULAR).max(initial=0)) if moving else 0

    @cached_property
    def _stages(self) -> tuple[tuple[int, int, int], ...]:
        """Stages of telescopes: (joint, first stage, 1 or -1 if it slides the other way)."""
        found: list[tuple[int, int, int]] = []
        first: int | None = None
        for joint in np.flatnonzero(self.upper > self.lower).tolist():
            if first is not None and self.prismatic[joint]:
                one, other = self._twists[0, :3, first], self._twists[0, :3, joint]
                along = float(one @ other / np.sqrt((one @ one) * (other @ other)))
                if abs(along) > 1.0 - 1e-6:
                    found.append((joint, first, 1 if along > 0 else -1))
                    continue
            first = joint if self.prismatic[joint] else None
        return tuple(found)

    @cached_property
    def _twists(self) -> Array:
        """Jacobians (3, 6, d) in three postures, which stand for all."""
        return self.jacobian(np.random.default_rng(0).uniform(self.lower, self.upper, (3, self.dof)))

    def solve(self, targets: ArrayLike, seeds: ArrayLike) -> tuple[Array, NDArray[np.bool_]]:
        """Solve for targets (m, 4, 4) of the tip in the base, each from its seeds (m, s, d) until one converges.

        Returns q (m, d) and ok (m,): where ok, the tip is within 0.1 mm and 1 mrad of the target and the joints are
        within their limits; elsewhere q is the nearest configuration found. Continuous joints are within half a turn of
        the first seed. Seeds outside the limits are clamped. A target's result does not depend on the others. A
        rotation R with R R^T within ``IMPROPER`` of 1 stands for the nearest one; ValueError for others, for
        reflections, and for numbers that are not finite.
        """
        poses, starts = np.asarray(targets, float), np.asarray(seeds, float)
        d = self.dof
        if poses.shape != (len(poses), 4, 4) or starts.ndim != 3 or starts.shape[::2] != (len(poses), d):
            raise ValueError(
                f"expected targets (m, 4, 4) and seeds (m, s, {d}), got shapes {poses.shape} and {starts.shape}"
            )
        if starts.shape[1] == 0:
            raise ValueError("expected at least one seed per target")
        _check_poses(poses)
        still_computing()
        rows = np.concatenate([poses[:, :3, :3].reshape(-1, 9), poses[:, :3, 3]], axis=1).T
        best, least = np.empty((d, len(poses))), np.full(len(poses), np.inf)
        solved, unsolved = np.zeros(len(poses), np.bool_), np.arange(len(poses))
        for seed in range(starts.shape[1]):
            q, error, ok = self._descend(rows[:, unsolved], starts[unsolved, seed].T)
            better = ok | (error < least[unsolved]) | (seed == 0)
            best[:, unsolved[better]], least[unsolved[better]], solved[unsolved] = q[:, better], error[better], ok
            unsolved = unsolved[~ok]
            if not len(unsolved):
                break
        return self.near(best.T, starts[:, 0]), solved

    def _descend(self, targets: Array, q: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Descend to targets (12, n) from seeds (d, n): configurations, squared errors, and which converged.

        Each row continues by itself until it converges, stalls, or has used all its steps.
        """
        q = self.functions.within(q)
        results, errors, solved = np.empty_like(q), np.empty(q.shape[1]), np.zeros(q.shape[1], np.bool_)
        row, least = np.arange(q.shape[1]), np.full(q.shape[1], np.inf)
        slow = np.zeros(q.shape[1], np.intp)
        for step in range(STEPS + 1):
            moved, squares = self.functions.step(q, targets)
            ok = (squares <= TOLERANCES).all(axis=0)
            error = squares[0] + ROTATION_WEIGHT**2 * squares[1]
            improved = error < STALLED * least
            least, slow = np.where(improved, error, least), (slow + 1) * ~improved
            on = (slow < MOST_SLOW) & ~ok & (step < STEPS)
            if not on.all():
                ended = ~on
                results[:, row[ended]], errors[row[ended]], solved[row] = q[:, ended], error[ended], ok
                row, moved, targets, least, slow = row[on], moved[:, on], targets[:, on], least[on], slow[on]
                if not len(row):
                    break
            q = moved
        return results, errors, solved

    def _rows(self, q: ArrayLike) -> Array:
        rows = np.atleast_2d(np.asarray(q, float))
        if rows.ndim != 2 or rows.shape[1] != self.dof:
            raise ValueError(f"expected configurations (n, {self.dof}) of {self.names}, got shape {np.shape(q)}")
        return rows


MOST_CHAINS = 32
"""Number of chains whose functions are cached in a process: arms, necks and lifts of several robots."""
_FUNCTIONS: Latest[str, ChainFunctions] = Latest(MOST_CHAINS)


def _whole(rows: Array) -> Array:
    """Complete poses (m, ..., 4, 4) from their first three rows (..., 3, 4, m)."""
    poses = np.zeros((rows.shape[-1], *rows.shape[:-3], 4, 4))
    poses[..., :3, :] = np.moveaxis(rows, -1, 0)
    poses[..., 3, 3] = 1.0
    return poses


def _check_poses(poses: Array) -> None:
    """Raise ValueError for the first of poses (m, 4, 4) that is invalid."""
    rotations = poses[:, :3, :3]
    with np.errstate(invalid="ignore", over="ignore"):
        off = np.abs(product(rotations, np.swapaxes(rotations, -1, -2)) - np.eye(3)).max(axis=(-1, -2))
        (a, b, c), (d, e, f), (g, h, i) = rotations.transpose(1, 2, 0)
        volume = a * (e * i - f * h) + b * (f * g - d * i) + c * (d * h - e * g)
        proper = (off <= IMPROPER) & (volume > 0) & np.isfinite(poses[:, :3, 3]).all(axis=1)
    if proper.all():
        return
    number = int(np.argmin(proper))
    if not np.isfinite(poses[number, :3]).all():
        wrong = "it contains numbers that are not finite"
    elif off[number] > IMPROPER:
        wrong = f"R R^T of its rotation R differs from 1 by {off[number]:.3g}"
    else:
        wrong = "its rotation is a reflection, of determinant -1"
    raise ValueError(f"target {number} is not a pose: {wrong}")


def _frozen(values: Sequence[float]) -> Array:
    array = np.array(values, float)
    array.flags.writeable = False
    return array


GAZE_STEPS = 61
"""Postures per neck joint in the table: about 3 degrees apart for a range of half a turn."""
COARSE = 4
"""Stride of the first pass over the postures when there are many points."""


class Gaze:
    """Aims a camera on a chain of neck joints; everything is in the frame of the robot's base link."""

    def __init__(
        self,
        urdf: Path,
        base_link: str,
        camera_link: str,
        neck: tuple[str, ...],
        axis: tuple[float, float, float],
        *,
        still: dict[str, float],
    ) -> None:
        """Tabulate postures; ``axis`` is the view in the camera link's frame, ``still`` fixes other joints."""
        self.joints = neck
        chain = Chain.from_urdf(urdf, base_link, camera_link, locked=still)
        grids = np.meshgrid(
            *(np.linspace(low, high, GAZE_STEPS) for low, high in zip(chain.lower, chain.upper, strict=True)),
            indexing="ij",
        )
        order = [chain.names.index(name) for name in neck]
        q = np.stack([grid.ravel() for grid in grids], 1)
        self._look(q[:, order], chain.fk(q), axis)

    @classmethod
    def fixed(cls, pose: Array, axis: tuple[float, float, float]) -> Gaze:
        """Describe a camera without a neck, at a pose (4, 4) in the base link's frame."""
        gaze = cls.__new__(cls)
        gaze.joints = ()
        gaze._look(np.zeros((1, 0)), pose[None], axis)
        return gaze

    def _look(self, q: Array, poses: Array, axis: tuple[float, float, float]) -> None:
        self._q = q
        self._origin = poses[:, :3, 3]
        self._axis = poses[:, :3, :3] @ np.asarray(axis, float)
        self._behind = np.einsum("ij,ij->i", self._origin, self._axis)
        self._square = np.einsum("ij,ij->i", self._origin, self._origin)

    def at_all(self, points: Array) -> tuple[Array, Array]:
        """Compute for points (n, 3) by how much the view misses them [rad] (n,), and the camera positions (n, 3).

        Searches every fourth posture of each joint first, then around the best of them; otherwise as :meth:`at`.
        """
        every = np.arange(len(self._q)).reshape((GAZE_STEPS,) * len(self.joints))
        coarse = every[(slice(None, None, COARSE),) * len(self.joints)].ravel()
        best = coarse[self._cosines(points, np.broadcast_to(coarse, (len(points), len(coarse)))).argmax(axis=1)]
        if self.joints:
            steps = np.arange(1 - COARSE, COARSE)
            window = np.stack(np.meshgrid(*[steps] * len(self.joints), indexing="ij"), -1).reshape(-1, len(self.joints))
            middle = np.stack(np.unravel_index(best, every.shape), axis=-1)
            around = np.clip(middle[:, None] + window, 0, GAZE_STEPS - 1)
            choice = np.ravel_multi_index(tuple(np.moveaxis(around, -1, 0)), every.shape)
            best = choice[np.arange(len(points)), self._cosines(points, choice).argmax(axis=1)]
        cosine = self._cosines(points, best[:, None])[:, 0]
        return np.arccos(np.clip(cosine, -1.0, 1.0)), self._origin[best]

    def _cosines(self, points: Array, postures: Array) -> Array:
        """Compute cosines (n, k) between the view and points (n, 3) in postures (n, k) of the table."""
        arrows = points[:, None] - self._origin[postures]
        return np.asarray(
            np.einsum("nki,nki->nk", arrows, self._axis[postures]) / np.maximum(np.linalg.norm(arrows, axis=2), 1e-9)
        )

    def at(self, point: Array) -> tuple[Array, float, Array]:
        """Find neck joint values (k,) to view a point (3,), the remaining angle [rad], and the camera position (3,)."""
        distances = np.sqrt(np.maximum(point @ point - 2 * (self._origin @ point) + self._square, 1e-18))
        cosine = (self._axis @ point - self._behind) / distances
        best = int(np.argmax(cosine))
        return self._q[best], math.acos(float(np.clip(cosine[best], -1.0, 1.0))), self._origin[best]
