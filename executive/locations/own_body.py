"""The rest of the robot, as an arm meets it: what rules out postures in which the robot would touch itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from executive.locations.reachability import Lift
from executive.locations.spheres import CORE, ArmSpheres
from executive.motion.solids import Solids
from planlang.protocols import Array, Configuration
from sim import PyBulletWorld, Solid


@dataclass(frozen=True, slots=True, eq=False)
class OwnBody:
    """Pieces that an arm's joints do not move, in the base frame, with the torso at its present height."""

    solids: Solids
    watched: NDArray[np.bool_]
    """Which spheres of the arm (k) must not be inside which pieces (n): (k, n)."""
    lifted: NDArray[np.bool_]
    """Which pieces the torso lifts (n,)."""
    rise: float
    """Present rise of the torso [m]."""
    lift: Lift | None

    def hits(self, points: Array, radii: Array, q: Array) -> tuple[Array, NDArray[np.intp]]:
        """Smallest gap (m,) of spheres at points (m, k, 3) of the base frame for joints (m, d), and of which piece."""
        if not len(self.solids) or not points.size:
            return np.full(len(points), np.inf), np.zeros(len(points), np.intp)
        gaps = np.full((*points.shape[:2], len(self.solids)), np.inf)
        for group, shift in ((~self.lifted, 0.0), (self.lifted, self._shift(q))):
            if not group.any():
                continue
            moved = points.copy()
            moved[:, :, 2] -= shift
            gaps[:, :, group] = self.solids.only(group).gaps(moved) - radii[:, None]
        gaps[:, ~self.watched] = np.inf
        flat = gaps.reshape(len(points), -1)
        least = np.argmin(flat, axis=1)
        return flat[np.arange(len(points)), least], least % len(self.solids)

    def _shift(self, q: Array) -> Array | float:
        """How much higher than now the torso is (m, 1)."""
        if self.lift is None:
            return 0.0
        return np.asarray(self.lift.rise(q[:, self.lift.column]) - self.rise)[:, None]


def own_body(
    world: PyBulletWorld, joints: tuple[str, ...], spheres: ArmSpheres, torso: str | None, lift: Lift | None
) -> OwnBody:
    """The rest of the robot in its present posture, for an arm of some joints."""
    robot = world.robot
    now = dict(world.configuration().joints)
    moved = frozenset[int]().union(*(robot.moved_by(name) for name in joints if name != torso))
    carried = robot.moved_by(torso) if torso is not None and torso in now else frozenset[int]()
    pairs = {frozenset(pair) for pair in robot.self_pairs}
    pieces, numbers = [], []
    world.link_pose(robot.link_names[-1], Configuration((0.0, 0.0, 0.0), now))
    for number, link in enumerate(robot.solid_names):
        if number in moved:
            continue
        there = robot.link_pose(link)
        for kind, size, pose in robot.shapes(number):
            if kind == "mesh":
                kind, size = "box", (CORE * size[0], CORE * size[1], CORE * size[2])
            pieces.append(Solid(link, kind, size, there @ pose, limb=False))
            numbers.append(number)
    watched = np.array(
        [[frozenset((int(mine), other)) in pairs for other in numbers] for mine in spheres.links], bool
    ).reshape(len(spheres.links), len(numbers))
    kept = np.asarray(watched.any(axis=0), bool)
    solids = Solids.of([piece for piece, keep in zip(pieces, kept, strict=True) if keep])
    lifted = np.array([number in carried for number in numbers], bool)[kept]
    rise = 0.0 if lift is None else float(lift.rise(now.get(lift.joint, lift.lowest)))
    return OwnBody(solids, watched[:, kept], lifted, rise, lift)
