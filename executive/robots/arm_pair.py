"""Two arms that hold one object: their joint space, and inverse kinematics for poses of both tips.

Two hands that hold an object form a closed chain: each pose of the object determines the poses of both tips, and
inverse kinematics follows a path of poses arm by arm, for many paths at once. The position of a torso that lifts both
arms straight up is an input, not solved for.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from executive.motion import Chain
from executive.motion.arm_group import ArmGroup
from executive.robots.arms import ArmModel
from planlang.geometry import Array
from planlang.geometry.matrices import inverse, product
from planlang.records import dataclass

TORSOS = 5
"""Number of torso positions to try besides the current one."""
ALIKE = 0.01
"""Torso positions closer than this to the current one are skipped [m]."""
FARTHEST = 0.35
"""Greatest motion of a joint between consecutive postures of a path [rad, m]: more is a jump to another solution."""


@dataclass(frozen=True, eq=False)
class ArmPair:
    """Two arms of one robot, with n joints in total; shared joints count once."""

    arms: tuple[ArmModel, ArmModel]
    still: Mapping[str, float]
    """Values of the shared joints, which stay fixed, except for the torso."""

    @cached_property
    def group(self) -> ArmGroup:
        """Joint space of both arms."""
        return ArmGroup([arm.chain for arm in self.arms])

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the joints (n,)."""
        return self.group.names

    @cached_property
    def torso(self) -> int | None:
        """Index of the joint that lifts both arms; None without one."""
        lifts = [arm.lift for arm in self.arms]
        return next((self.names.index(lift.joint) for lift in lifts if lift and lift == lifts[-1]), None)

    def torsos(self, now: float) -> Array:
        """List torso positions to try (t,), the current one ``now`` first, then by distance; a dummy without torso."""
        lift = self.arms[0].lift
        if self.torso is None or lift is None:
            return np.zeros(1)
        others = np.linspace(lift.highest, lift.lowest, TORSOS)
        others = others[np.abs(others - now) > ALIKE]
        return np.concatenate([[now], others[np.argsort(np.abs(others - now).round(9), kind="stable")]])

    def raised(self, torso: float, by: float) -> float:
        """Compute the torso position that lifts both arms ``by`` [m] from a position, clamped to its range."""
        lift = self.arms[0].lift
        if self.torso is None or lift is None:
            return torso
        rise = np.clip(lift.rise(torso) + by, 0.0, lift.rise(lift.highest))
        return float(lift.position(rise))

    @cached_property
    def _chains(self) -> tuple[Chain, ...]:
        return tuple(arm.chain.locked(self._fixed(arm)) for arm in self.arms)

    @cached_property
    def solved(self) -> tuple[NDArray[np.intp], ...]:
        """Indices of the joints that inverse kinematics solves for, per arm."""
        return tuple(np.array([self.names.index(name) for name in one.names], np.intp) for one in self._chains)

    def _fixed(self, arm: ArmModel) -> dict[str, float]:
        shared = set(self.arms[0].joints) & set(self.arms[1].joints)
        fixed = {name: self.still[name] for name in arm.joints if name in shared}
        return fixed if arm.lift is None or self.torso is None else {**fixed, arm.lift.joint: arm.lift.lowest}

    def tips(self, q: Array) -> Array:
        """Compute the poses of both tips in the base frame (..., 2, 4, 4) at joint values (..., n)."""
        rows = q.reshape(-1, q.shape[-1])
        poses = np.stack([self.group.fk(rows, arm) for arm in (0, 1)], axis=1)
        return np.asarray(poses.reshape(*q.shape[:-1], 2, 4, 4))

    def solve_one(self, arm: int, targets: Array, seeds: Array, torso: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Solve inverse kinematics of one arm for poses of its tip (m, 4, 4) in the base frame.

        ``seeds`` (m, s, n) are joint values of both arms, ``torso`` (m,) its positions. Returns joint values (m, d)
        and a mask of the solved poses (m,).
        """
        lift = self.arms[arm].lift
        lowered = targets.copy()
        if self.torso is not None and lift is not None:
            lowered[:, 2, 3] -= lift.rise(torso)
        return self._chains[arm].solve(lowered, seeds[:, :, self.solved[arm]])

    def joined(self, parts: tuple[Array, Array], torso: Array, start: Array) -> Array:
        """Combine joint values (m, d) of each arm and the torso (m,) into (m, n); the rest as in ``start`` (n,)."""
        rows = np.tile(start, (len(torso), 1))
        if self.torso is not None:
            rows[:, self.torso] = torso
        for columns, part in zip(self.solved, parts, strict=True):
            rows[:, columns] = part
        return rows

    def along(self, targets: Array, start: Array, torso: Array) -> tuple[Array, NDArray[np.intp]]:
        """Follow m paths of k poses of both tips (m, k, 2, 4, 4) from joint values ``start`` (m, n).

        ``torso`` (m, k) are its positions. Returns joint values (m, k, n) and the number of poses reached (m,): a path
        ends where a pose is out of reach, or a joint would jump by more than :data:`FARTHEST`. The values beyond the
        end repeat the last ones.
        """
        postures = np.repeat(start[:, None], targets.shape[1], axis=1)
        reached, active = np.zeros(len(targets), np.intp), np.arange(len(targets))
        last = start.copy()
        for k in range(targets.shape[1]):
            if not len(active):
                break
            is_valid, parts = np.ones(len(active), bool), []
            for arm in (0, 1):
                q, is_solved = self.solve_one(arm, targets[active, k, arm], last[active][:, None], torso[active, k])
                is_valid &= is_solved
                parts.append(q)
            rows = self.joined((parts[0], parts[1]), torso[active, k], start[0])
            is_valid &= np.abs(rows - last[active]).max(axis=1) < FARTHEST
            active, rows = active[is_valid], rows[is_valid]
            postures[active, k:], last[active], reached[active] = rows[:, None], rows, k + 1
        return postures, reached


def strays(pair: ArmPair, rows: Array) -> tuple[float, float]:
    """Measure how much the pose of one tip relative to the other changes along a path (k, n) [m, rad]."""
    tips = pair.tips(rows)
    relative = product(inverse(tips[:, 0]), tips[:, 1])
    distance = float(np.linalg.norm(relative[:, :3, 3] - relative[0, :3, 3], axis=1).max())
    traces = np.trace(product(relative[:, :3, :3], relative[0, :3, :3].T), axis1=1, axis2=2)
    return distance, float(np.arccos(np.clip((traces - 1) / 2, -1.0, 1.0)).max())
