"""Several chains of a robot that move together; joints that they share (a torso) are counted once."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from executive.motion.kinematics import Chain, JointRanges
from planlang.geometry import Array


class ArmGroup(JointRanges):
    """Several chains with one base link as one joint space of n joints, in the order of first occurrence.

    :class:`executive.motion.arm_bodies.ArmShapes` and quick checks accept it like a single chain.
    """

    def __init__(self, chains: Sequence[Chain]) -> None:
        """Combine at least one chain."""
        self.chains = tuple(chains)
        self.names: tuple[str, ...] = tuple(dict.fromkeys(name for chain in chains for name in chain.names))
        """Joint names."""
        self.dof: int = len(self.names)
        """Number of joints, n."""
        self.carriers: tuple[str, ...] = tuple(dict.fromkeys(link for chain in chains for link in chain.carriers))
        """Child links of moving joints, without duplicates."""
        self.columns: tuple[NDArray[np.intp], ...] = tuple(
            np.array([self.names.index(name) for name in chain.names], np.intp) for chain in chains
        )
        """For each chain, the indices of its joints in the group."""
        self.lower, self.upper, self.velocity = (
            self._of_chains([getattr(chain, limits) for chain in chains]) for limits in ("lower", "upper", "velocity")
        )
        self.continuous, self.prismatic = (
            self._of_chains([getattr(chain, kind).astype(float) for chain in chains]) > 0
            for kind in ("continuous", "prismatic")
        )

    def frame_rows(self, q: ArrayLike) -> Array:
        """Compute the first three rows of these poses, configurations along the last axis: (j, 3, 4, m)."""
        rows = np.atleast_2d(np.asarray(q, float))
        frames = [chain.frame_rows(rows[:, columns]) for chain, columns in zip(self.chains, self.columns, strict=True)]
        return frames[0] if len(frames) == 1 else np.concatenate(frames)[self._carrier_rows]

    def fk(self, q: ArrayLike, arm: int = 0) -> Array:
        """Compute poses (m, 4, 4) of the tip of one chain in the base for configurations (m, n)."""
        return self.chains[arm].fk(np.atleast_2d(np.asarray(q, float))[:, self.columns[arm]])

    @cached_property
    def _carrier_rows(self) -> NDArray[np.intp]:
        """Indices of the frames of ``carriers`` among the concatenated frames of all chains."""
        links = [link for chain in self.chains for link in chain.carriers]
        return np.array([links.index(link) for link in self.carriers], np.intp)

    def _of_chains(self, values: Sequence[Array]) -> Array:
        merged = np.zeros(len(self.names))
        for columns, of_chain in zip(self.columns, values, strict=True):
            merged[columns] = of_chain
        return merged


Movable = Chain | ArmGroup
"""Mechanism with moving links: one chain or several."""
