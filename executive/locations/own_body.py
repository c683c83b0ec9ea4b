"""The rest of the robot, as an arm meets it: what rules out postures in which the robot would touch itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from executive.locations.reachability import Lift
from executive.locations.spheres import ArmSpheres, surely_filled
from executive.motion.solids import Solids
from planlang.protocols import Array, Configuration
from sim import PyBulletWorld


@dataclass(frozen=True, slots=True, eq=False)
class OwnBody:
    """Pieces that an arm's joints do not move, in the base frame, with the torso at its present height."""

    solids: Solids
    watched: NDArray[np.bool_]
    """Which pieces (n) spheres of the arm (k) must not be inside: (n, k)."""
    lifted: NDArray[np.bool_]
    """Which pieces the torso lifts (n,)."""
    rise: float
    """Present rise of the torso [m]."""
    lift: Lift | None

    def hits(self, points: Array, radii: Array, q: Array) -> tuple[Array, NDArray[np.intp]]:
        """Smallest gap (m,) of spheres at points (m, k, 3) of the base frame for joints (m, d), and of which piece."""
        raised = None
        if self.lift is not None and self.lifted.any():
            raised = np.outer(self.lift.rise(q[:, self.lift.column]) - self.rise, self.lifted)
        return self.solids.closest(points, radii, ~self.watched, raised)


class OwnShapes:
    """The same in no posture: pieces in the frames of their links."""

    def __init__(
        self, world: PyBulletWorld, joints: tuple[str, ...], spheres: ArmSpheres, torso: str | None, lift: Lift | None
    ) -> None:
        """For an arm of some joints; ``torso`` is the one of them that carries it."""
        self._lift = lift
        robot = world.robot
        moved = frozenset[int]().union(*(robot.moved_by(name) for name in joints if name != torso))
        carried = robot.moved_by(torso) if torso in robot.joints else frozenset[int]()
        watching = np.zeros((len(robot.solid), len(robot.solid)), bool)
        for pair in robot.self_pairs:
            watching[pair] = watching[pair[::-1]] = True
        watched = watching[spheres.links]
        others = [number for number in range(len(robot.solid)) if number not in moved and watched[:, number].any()]
        pieces = [(number, *shape) for number in others for shape in robot.shapes(number)]
        self._links = np.array([number for number, *_ in pieces], np.intp)
        self._names = tuple(robot.solid_names[number] for number in self._links)
        self._local = np.array([pose.matrix() for *_, pose in pieces]).reshape(-1, 4, 4)
        self._shapes = [surely_filled(kind, size) for _, kind, size, _ in pieces]
        self._watched = watched[:, self._links].T
        self._lifted = np.array([number in carried for number in self._links.tolist()], bool)

    def now(self, world: PyBulletWorld) -> OwnBody:
        """In the present posture."""
        joints = world.configuration().joints
        frames = world.solid_frames(Configuration((0.0, 0.0, 0.0), joints))
        matrices = frames[self._links] @ self._local
        solids = Solids.placed(self._names, matrices, self._shapes, np.zeros(len(matrices), bool))
        rise = 0.0 if self._lift is None else float(self._lift.rise(joints.get(self._lift.joint, self._lift.lowest)))
        return OwnBody(solids, self._watched, self._lifted, rise, self._lift)
