"""What computes kinematics: code compiled for one chain, or casadi's virtual machine where there is no compiler."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from executive.motion.symbolic import Variable
from planlang.geometry import Array
from planlang.geometry.urdf import Joint

if TYPE_CHECKING:
    from executive.motion.body_arrays import Bodies


@dataclass(frozen=True, slots=True, eq=False)
class ChainFacts:
    """A chain as it is computed: joints from base to tip, the variable of each, limits (d,) of the variables."""

    joints: tuple[Joint, ...]
    variables: tuple[Variable, ...]
    dof: int
    lowest: Array
    """Lower limits, -inf for joints that turn without end."""
    highest: Array
    continuous: NDArray[np.bool_]
    digest: str
    """Of all this; chains that move alike have the same."""


class Solver(Protocol):
    """Inverse kinematics of one chain, with a tolerance and maybe an axis that may turn freely."""

    def __call__(self, poses: Array, seeds: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Poses (m, 4, 4), seeds (m, s, d), tried in order -> the first solution (m, d), and whether there is one.

        Seeds outside of limits begin at the limit. A row without solution holds the configuration of the smallest error
        found. Joints that turn without end come out within half a turn of the first seed. Raises ValueError for what
        is no pose, as ``targets`` says.
        """


MAP, BASE, FIRST_JOINT = 0, 1, 2
"""Numbers of the frames of bodies: those of the children of moving joints follow in their order."""
SURE, UNSURE = -2, -1
"""What a checker says of a configuration: nothing is hit for sure, or as far as spheres tell."""
ALSO_SURE = -1.0
"""As the depth that is asked for: what is sure may be told, too."""


class Checker(Protocol):
    """Spheres that move with a chain against convex pieces."""

    def judge(self, q: Array) -> NDArray[np.int32]:
        """For each configuration (n, d) SURE, UNSURE, or the number of a pair that is hit."""

    def hits(self, q: Array, bases: Array, deeper: float) -> NDArray[np.int32]:
        """For each (n, d) the first pair that is hit by ``deeper`` [m] or more, else negative: SURE where it is told.

        ``bases`` (n, 12): rotation row by row, and position, of the base of the chain in the map.
        """

    def frame_hits(self, frame: int, places: Array) -> NDArray[np.int32]:
        """For each place (n, 12) of a moving frame in the map the first pair that is hit there, else negative.

        Nothing counts but what moves with that frame, against what is in the map.
        """

    def edge_hit(self, start: Array, end: Array, pieces: int, order: NDArray[np.int32]) -> int:
        """The first pair hit at points ``order`` of 0 .. pieces of a line between configurations (d,), or negative."""

    def doubtful(self, q: Array) -> NDArray[np.int32]:
        """The pairs that are not free for sure at a configuration (d,)."""

    def gaps(self, q: Array) -> Array:
        """The smallest gap (p,) of every pair at a configuration (d,) [m], negative inside."""


class Backend(Protocol):
    """Computes one chain; the result of a row does not depend on the other rows."""

    kind: str
    """"compiled" or "interpreted": the two differ in the last digits of what they find."""

    def position(self, q: Array) -> tuple[Array, Array]:
        """Configurations (n, d) -> rotations (n, 9) row by row, positions (n, 3) of the tip."""

    def pose(self, q: Array) -> tuple[Array, Array, Array]:
        """The same and the Jacobian (n, 6 d) row by row."""

    def solver(self, free_axis: Array | None, tolerance: tuple[float, float]) -> Solver:
        """Inverse kinematics to a tolerance [m, rad], maybe with an axis (3,) of the tip that may turn freely."""

    def frames(self, q: Array) -> Array:
        """Configurations (n, d) -> poses (n, j, 3, 4) of the children of the j moving joints, in the base frame."""

    def checker(self, bodies: Bodies) -> Checker:
        """Collisions with some bodies, whose ``limit`` and ``sure`` may change later."""


def backend(facts: ChainFacts) -> Backend:
    """Compiled code if there is a compiler or the code is kept, else the virtual machine."""
    from executive.motion.compiled import CompiledChain

    found = CompiledChain.of(facts)
    if found is not None:
        return found
    from executive.motion.virtual_machine import VirtualChain

    return VirtualChain(facts)
