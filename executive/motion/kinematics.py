"""Chains of joints: forward kinematics, Jacobian and inverse kinematics, in the frame of the chain's base link."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from executive.motion.backends import Backend, ChainFacts, Solver, backend
from executive.motion.symbolic import Variable
from planlang.geometry import Array
from planlang.geometry.urdf import KINDS, Joint, NoSuchChain, joints_between, read_urdf

POSITION_TOLERANCE = 1e-4
"""How far a solution's tip may be from its target [m]."""
ANGLE_TOLERANCE = 1e-3
"""How far a solution's tip may be turned from its target [rad]."""


class Chain:
    """The joints from a base link to a tip link; d of them move.

    A joint that mimics another moves with it; if that one is not in the chain it takes the place of the mimic in
    ``names``. Joints without motion of their own (fixed, locked) are folded into the constants.
    """

    def __init__(self, joints: Sequence[Joint], *, others: Iterable[Joint] = (), locked: Mapping[str, float]) -> None:
        """Joints from base to tip; ``others`` are searched for masters of mimics, ``locked`` ones stay where said."""
        self._joints, self._others, self._locked = tuple(joints), tuple(others), dict(locked)
        every = {joint.name: joint for joint in (*self._others, *joints)}
        movers: dict[str, Joint] = {}
        variables: list[Variable] = []
        ranges: dict[str, tuple[float, float]] = {}
        for joint in joints:
            name, multiplier, offset = _master(joint, every)
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
        limits = [ranges.get(name, (joint.lower, joint.upper)) for name, joint in movers.items()]
        self.lower: Array = _frozen([low for low, _ in limits])
        """Lower limits (d,) [rad, m]; of a continuous joint -pi, the start of its range."""
        self.upper: Array = _frozen([high for _, high in limits])
        """Upper limits (d,)."""
        self.velocity: Array = _frozen([joint.velocity for joint in movers.values()])
        """Velocity limits (d,) [rad/s, m/s] as the URDF gives them."""
        self.continuous: NDArray[np.bool_] = np.array([joint.kind == "continuous" for joint in movers.values()], bool)
        """Which joints turn without end (d,)."""
        self.prismatic: NDArray[np.bool_] = np.array([joint.kind == "prismatic" for joint in movers.values()], bool)
        """Which joints slide (d,)."""
        self._variables = tuple(variables)

    @classmethod
    def from_urdf(
        cls, path: Path, base_link: str, tip_link: str, locked: Mapping[str, float] | Iterable[str] = ()
    ) -> Chain:
        """Read a chain; ``locked`` joints keep the position given, or the one nearest to zero within their limits.

        Raises BadInput for a file that is not a usable URDF, :class:`NoSuchChain` for links that
        do not form a chain with at least one moving joint of the kinds revolute, continuous and prismatic.
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
            if joint.mimic is not None and joint.mimic.joint not in known:
                problem = f"joint {joint.name!r} mimics {joint.mimic.joint!r}, which does not exist"
                raise NoSuchChain(base_link, tip_link, problem, links)
        chain = cls(joints, others=every, locked=at)
        if not chain.names:
            raise NoSuchChain(base_link, tip_link, "no joint between them moves", links)
        return chain

    @property
    def carriers(self) -> tuple[str, ...]:
        """The child links of its moving joints, base first: what :meth:`frames` tells the poses of."""
        moved = zip(self._joints, self._variables, strict=True)
        return tuple(joint.child for joint, variable in moved if variable.index is not None)

    @property
    def dof(self) -> int:
        """Number of moving joints, d."""
        return len(self.names)

    def locked(self, positions: Mapping[str, float]) -> Chain:
        """The same chain with more of its joints kept at a position."""
        return Chain(self._joints, others=self._others, locked={**self._locked, **positions})

    @property
    def digest(self) -> str:
        """Equal for chains that move alike: joints, their frames, axes and limits, and what is locked."""
        return self._facts.digest

    @cached_property
    def backend(self) -> Backend:
        """What computes this chain."""
        return backend(self._facts)

    @cached_property
    def _facts(self) -> ChainFacts:
        moved = zip(self._joints, self._variables, strict=True)
        parts = [(joint.kind, joint.origin.tolist(), joint.axis.tolist(), variable) for joint, variable in moved]
        limits = (self.names, self.lower.tolist(), self.upper.tolist(), self.continuous.tolist())
        return ChainFacts(
            self._joints,
            self._variables,
            self.dof,
            np.where(self.continuous, -np.inf, self.lower),
            np.where(self.continuous, np.inf, self.upper),
            self.continuous,
            hashlib.sha256(repr((parts, limits)).encode()).hexdigest(),
        )

    def fk(self, q: ArrayLike) -> Array:
        """Poses (n, 4, 4) of the tip in the base for configurations (n, d)."""
        rotation, position = self.backend.position(self._rows(q))
        return _poses(rotation, position)

    def frames(self, q: ArrayLike) -> Array:
        """Poses (n, j, 4, 4) of the links ``carriers`` in the base for configurations (n, d)."""
        rows = self.backend.frames(self._rows(q))
        last = np.broadcast_to(np.array([0.0, 0.0, 0.0, 1.0]), (*rows.shape[:2], 1, 4))
        return np.concatenate([rows, last], axis=2)

    def jacobian(self, q: ArrayLike) -> Array:
        """Geometric Jacobians (n, 6, d) for configurations (n, d): velocity of the tip point, then angular velocity.

        Both in the axes of the base.
        """
        _, _, jacobian = self.backend.pose(self._rows(q))
        return jacobian.reshape(-1, 6, self.dof)

    def within(self, q: ArrayLike, tolerance: float = 0.0) -> NDArray[np.bool_]:
        """Which configurations (n, d) keep all limits; continuous joints have none."""
        rows = self._rows(q)
        inside = (rows >= self.lower - tolerance) & (rows <= self.upper + tolerance)
        return np.asarray((inside | self.continuous).all(axis=1))

    def near(self, q: ArrayLike, reference: ArrayLike) -> Array:
        """The same configurations (..., d) with continuous joints within half a turn of the reference."""
        given, other = np.asarray(q, float), np.asarray(reference, float)
        turns = np.where(self.continuous, np.round((other - given) / (2 * np.pi)), 0.0)
        return np.asarray(given + 2 * np.pi * turns)

    def may_reach(self, targets: ArrayLike) -> NDArray[np.bool_]:
        """Which targets (m, 4, 4) in the base are not too far away: no configuration takes the tip to the others."""
        center, radius, last = self._span
        poses = np.asarray(targets, float)
        last_frames = poses[:, :3, :3] @ last + poses[:, :3, 3]
        slack = POSITION_TOLERANCE + ANGLE_TOLERANCE * float(np.linalg.norm(last)) + 1e-6
        return np.asarray(np.linalg.norm(last_frames - center, axis=1) <= radius + slack)

    @cached_property
    def _span(self) -> tuple[Array, float, Array]:
        """Centre (3,) and radius [m] of a ball in the base that the last moving link's origin, (3,) of the tip, is in.

        From one such link to the next the distance of origins is fixed, but for the travel of a joint that slides.
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
        return origins[0], radius, tip[:3, :3].T @ (origins[-1] - tip[:3, 3])

    def sample(self, rng: np.random.Generator, shape: int | tuple[int, ...]) -> Array:
        """Uniform configurations (*shape, d) within the limits."""
        sizes = (shape,) if isinstance(shape, int) else shape
        return rng.uniform(self.lower, self.upper, (*sizes, self.dof))

    def _rows(self, q: ArrayLike) -> Array:
        rows = np.atleast_2d(np.asarray(q, float))
        if rows.ndim != 2 or rows.shape[1] != self.dof:
            raise ValueError(f"expected configurations (n, {self.dof}) of {self.names}, got shape {np.shape(q)}")
        return rows


class InverseKinematics:
    """Configurations of a chain that bring its tip to a pose, by Levenberg-Marquardt from given seeds."""

    def __init__(self, chain: Chain, *, free_axis: ArrayLike | None = None) -> None:
        """``free_axis`` (3,) in the tip's frame: the tip may turn about it, as a hand does around a cylinder."""
        self.chain = chain
        self._free_axis = None
        if free_axis is not None:
            axis = np.asarray(free_axis, float)
            if axis.shape != (3,) or np.linalg.norm(axis) < 1e-9:
                raise ValueError(f"free_axis must be a vector (3,) of some length, got {free_axis!r}")
            self._free_axis = axis / np.linalg.norm(axis)

    @cached_property
    def _solver(self) -> Solver:
        return self.chain.backend.solver(self._free_axis, (POSITION_TOLERANCE, ANGLE_TOLERANCE))

    def solve(self, targets: ArrayLike, seeds: ArrayLike) -> tuple[Array, NDArray[np.bool_]]:
        """Solve for targets (m, 4, 4) in the base frame, each from its seeds (m, s, d) in order until one converges.

        Returns q (m, d) and ok (m,): where ok, the tip is within 0.1 mm and 1 mrad of the target and the joints are
        within their limits; elsewhere q is the nearest found. Continuous joints come out within half a turn of the
        first seed. A rotation R that is one but for rounding, R R^T within ``IMPROPER`` of 1, means the nearest;
        ValueError for others, reflections too, and for numbers that are not finite.
        """
        poses, starts = np.asarray(targets, float), np.asarray(seeds, float)
        d = self.chain.dof
        if poses.shape != (len(poses), 4, 4) or starts.ndim != 3 or starts.shape[::2] != (len(poses), d):
            raise ValueError(
                f"expected targets (m, 4, 4) and seeds (m, s, {d}), got shapes {poses.shape} and {starts.shape}"
            )
        if starts.shape[1] == 0:
            raise ValueError("expected at least one seed per target")
        return self._solver(poses, starts)

    def solve_one(
        self, target: ArrayLike, seed: ArrayLike, rng: np.random.Generator | None = None, restarts: int = 20
    ) -> Array | None:
        """One target (4, 4) from a seed (d,), then from random ones if a generator is given; q (d,) or None."""
        seeds = np.asarray(seed, float)[None]
        if rng is not None:
            seeds = np.concatenate([seeds, self.chain.sample(rng, restarts)])
        q, ok = self.solve(np.asarray(target, float)[None], seeds[None])
        return q[0] if ok[0] else None


def _master(joint: Joint, every: Mapping[str, Joint]) -> tuple[str, float, float]:
    """Whom a joint follows in the end, and how: (name, multiplier, offset)."""
    multiplier, offset, seen = 1.0, 0.0, {joint.name}
    while joint.mimic is not None and joint.mimic.joint in every and joint.mimic.joint not in seen:
        offset += multiplier * joint.mimic.offset
        multiplier *= joint.mimic.multiplier
        joint = every[joint.mimic.joint]
        seen.add(joint.name)
    return joint.name, multiplier, offset


def _poses(rotation: Array, position: Array) -> Array:
    poses = np.zeros((len(position), 4, 4))
    poses[:, :3, :3] = rotation.reshape(-1, 3, 3)
    poses[:, :3, 3] = position
    poses[:, 3, 3] = 1.0
    return poses


def _frozen(values: Sequence[float]) -> Array:
    array = np.array(values, float)
    array.flags.writeable = False
    return array
