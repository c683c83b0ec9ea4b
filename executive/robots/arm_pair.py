"""Two arms that hold one thing: their joints as one space, and postures for poses of both tips.

While both hands hold a thing they are a closed chain: each pose of the thing gives a pose of each tip, and inverse
kinematics follows it arm by arm from posture to posture, for many ways at once. A torso that lifts both arms straight
up is not solved for: it is given.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from executive.motion import InverseKinematics
from executive.motion.arm_group import ArmGroup
from executive.robots.arms import ArmModel
from planlang.geometry import Array
from planlang.geometry.matrices import inverse, product
from planlang.records import dataclass

TORSOS = 5
"""Positions of the torso that are tried beside the present one."""
ALIKE = 0.01
"""Positions of the torso that differ by less are one [m]."""
FARTHEST = 0.35
"""Largest move of a joint between two postures of a way [rad, m]."""


@dataclass(frozen=True, eq=False)
class ArmPair:
    """Two arms of one robot; n joints in all, shared ones once."""

    arms: tuple[ArmModel, ArmModel]
    still: Mapping[str, float]
    """Values of joints that both arms share and that are no torso: they stay."""

    @cached_property
    def group(self) -> ArmGroup:
        """The joints of both arms as one space."""
        return ArmGroup([arm.solver.chain for arm in self.arms])

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of the joints (n,)."""
        return self.group.names

    @cached_property
    def torso(self) -> int | None:
        """The number of the joint that lifts both arms; None without one."""
        lifts = [arm.lift for arm in self.arms]
        return next((self.names.index(lift.joint) for lift in lifts if lift and lift == lifts[-1]), None)

    def torsos(self, now: float) -> Array:
        """Return positions of the torso to try (t,), that which it has first; one that means nothing without torso."""
        lift = self.arms[0].lift
        if self.torso is None or lift is None:
            return np.zeros(1)
        others = np.linspace(lift.highest, lift.lowest, TORSOS)
        others = others[np.abs(others - now) > ALIKE]
        return np.concatenate([[now], others[np.argsort(np.abs(others - now).round(9), kind="stable")]])

    def raised(self, torso: float, by: float) -> float:
        """Return the position of the torso that lifts both arms by so much more [m], as far as it can."""
        lift = self.arms[0].lift
        if self.torso is None or lift is None:
            return torso
        rise = np.clip(lift.rise(torso) + by, 0.0, lift.rise(lift.highest))
        return float(lift.position(rise))

    @cached_property
    def _solvers(self) -> tuple[InverseKinematics, ...]:
        return tuple(InverseKinematics(arm.solver.chain.locked(self._fixed(arm))) for arm in self.arms)

    @cached_property
    def solved(self) -> tuple[NDArray[np.intp], ...]:
        """Return for each arm the numbers of the joints that are solved for."""
        return tuple(np.array([self.names.index(name) for name in one.chain.names], np.intp) for one in self._solvers)

    def _fixed(self, arm: ArmModel) -> dict[str, float]:
        shared = set(self.arms[0].joints) & set(self.arms[1].joints)
        fixed = {name: self.still[name] for name in arm.joints if name in shared}
        return fixed if arm.lift is None or self.torso is None else {**fixed, arm.lift.joint: arm.lift.lowest}

    def tips(self, q: Array) -> Array:
        """Return the poses of both tips in the base (..., 2, 4, 4) at joint values (..., n)."""
        rows = q.reshape(-1, q.shape[-1])
        poses = np.stack([self.group.fk(rows, arm) for arm in (0, 1)], axis=1)
        return np.asarray(poses.reshape(*q.shape[:-1], 2, 4, 4))

    def solve_one(self, arm: int, targets: Array, seeds: Array, torso: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Return joint values (m, d) of one arm for poses of its tip (m, 4, 4) in the base, and which meet them (m,).

        ``seeds`` (m, s, n) are of both arms; ``torso`` (m,): its position.
        """
        lift = self.arms[arm].lift
        lowered = targets.copy()
        if self.torso is not None and lift is not None:
            lowered[:, 2, 3] -= lift.rise(torso)
        return self._solvers[arm].solve(lowered, seeds[:, :, self.solved[arm]])

    def joined(self, parts: tuple[Array, Array], torso: Array, start: Array) -> Array:
        """Return joint values (m, n) of both arms from those of each (m, d); others as at the start (n,)."""
        rows = np.tile(start, (len(torso), 1))
        if self.torso is not None:
            rows[:, self.torso] = torso
        for columns, part in zip(self.solved, parts, strict=True):
            rows[:, columns] = part
        return rows

    def along(self, targets: Array, start: Array, torso: Array) -> tuple[Array, NDArray[np.intp]]:
        """Return joint values (m, k, n) that follow poses of both tips (m, k, 2, 4, 4), and how far each way goes (m,).

        ``start`` (m, n): the values before; ``torso`` (m, k): its positions. A way ends where a pose is out of reach,
        or a joint would have to jump.
        """
        found = np.repeat(start[:, None], targets.shape[1], axis=1)
        reached, alive = np.zeros(len(targets), np.intp), np.arange(len(targets))
        last = start.copy()
        for k in range(targets.shape[1]):
            if not len(alive):
                break
            good, parts = np.ones(len(alive), bool), []
            for arm in (0, 1):
                q, met = self.solve_one(arm, targets[alive, k, arm], last[alive][:, None], torso[alive, k])
                good &= met
                parts.append(q)
            rows = self.joined((parts[0], parts[1]), torso[alive, k], start[0])
            good &= np.abs(rows - last[alive]).max(axis=1) < FARTHEST
            alive, rows = alive[good], rows[good]
            found[alive, k:], last[alive], reached[alive] = rows[:, None], rows, k + 1
        return found, reached


def strays(pair: ArmPair, rows: Array) -> tuple[float, float]:
    """Return by how much the pose of one tip in the frame of the other changes along a way (k, n) [m, rad]."""
    tips = pair.tips(rows)
    between = product(inverse(tips[:, 0]), tips[:, 1])
    away = float(np.linalg.norm(between[:, :3, 3] - between[0, :3, 3], axis=1).max())
    traces = np.trace(product(between[:, :3, :3], between[0, :3, :3].T), axis1=1, axis2=2)
    return away, float(np.arccos(np.clip((traces - 1) / 2, -1.0, 1.0)).max())
