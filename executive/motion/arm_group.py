"""One or more chains of a robot that move together, with the joints that they share (a torso) counted once."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from executive.motion.joint_ranges import JointRanges
from executive.motion.kinematics import Chain
from planlang.geometry import Array


class ArmGroup(JointRanges):
    """Several chains with one base link as one space of joints; n joints in all, shared ones first met.

    It is to :class:`executive.motion.arm_bodies.ArmShapes` and to quick checks what a single chain is.
    """

    def __init__(self, chains: Sequence[Chain]) -> None:
        """Initialize from chains, at least one."""
        self.chains = tuple(chains)
        self.names: tuple[str, ...] = tuple(dict.fromkeys(name for chain in chains for name in chain.names))
        """Joint names."""
        self.columns: tuple[NDArray[np.intp], ...] = tuple(
            np.array([self.names.index(name) for name in chain.names], np.intp) for chain in chains
        )
        """For each chain the numbers of its joints among all."""
        self.lower, self.upper, self.velocity = (
            self._of_chains([getattr(chain, limits) for chain in chains]) for limits in ("lower", "upper", "velocity")
        )
        self.continuous, self.prismatic = (
            self._of_chains([getattr(chain, kind).astype(float) for chain in chains]) > 0
            for kind in ("continuous", "prismatic")
        )

    @property
    def dof(self) -> int:
        """Number of joints, n."""
        return len(self.names)

    @cached_property
    def carriers(self) -> tuple[str, ...]:
        """Return the child links of moving joints, each once."""
        return tuple(dict.fromkeys(link for chain in self.chains for link in chain.carriers))

    def frames(self, q: ArrayLike) -> Array:
        """Return poses (m, j, 4, 4) of the links ``carriers`` in the base for configurations (m, n)."""
        rows = self.frame_rows(q)
        poses = np.zeros((rows.shape[-1], len(rows), 4, 4))
        poses[..., :3, :] = np.moveaxis(rows, -1, 0)
        poses[..., 3, 3] = 1.0
        return poses

    def frame_rows(self, q: ArrayLike) -> Array:
        """Return the same without last rows, configurations along the last axis: (j, 3, 4, m)."""
        rows = np.atleast_2d(np.asarray(q, float))
        every = [chain.frame_rows(rows[:, columns]) for chain, columns in zip(self.chains, self.columns, strict=True)]
        return every[0] if len(every) == 1 else np.concatenate(every)[self._first_met]

    def fk(self, q: ArrayLike, arm: int = 0) -> Array:
        """Return poses (m, 4, 4) of the tip of one chain in the base for configurations (m, n)."""
        return self.chains[arm].fk(np.atleast_2d(np.asarray(q, float))[:, self.columns[arm]])

    @cached_property
    def _first_met(self) -> NDArray[np.intp]:
        """Numbers of the frames of ``carriers`` among those of all chains, one after another."""
        links = [link for chain in self.chains for link in chain.carriers]
        return np.array([links.index(link) for link in self.carriers], np.intp)

    def _of_chains(self, values: Sequence[Array]) -> Array:
        found = np.zeros(len(self.names))
        for columns, those in zip(self.columns, values, strict=True):
            found[columns] = those
        return found


Movable = Chain | ArmGroup
"""A mechanism that moves links by joints: one chain or several."""
