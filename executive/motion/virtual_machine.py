"""Kinematics without a compiler: symbolic functions on casadi's virtual machine, rows of numpy arrays at a time."""

from __future__ import annotations

from typing import Any

import casadi
import numpy as np
from numpy.typing import NDArray

from executive.motion.backends import ChainFacts
from executive.motion.levenberg_marquardt import ROTATION_WEIGHT, step_function
from executive.motion.symbolic import pose_function, position_function, symbolic_chain
from planlang.protocols import Array

BLOCKS = (256, 32, 4, 1)
"""Rows per call of casadi's virtual machine; a call costs about 3 us beside the work of its rows."""
STEPS = 4
"""Steps of inverse kinematics between two looks at the error from outside."""
ROUNDS = 12
"""Looks after which a seed is given up."""
STALLED = 0.8
"""A seed is given up when a round leaves more than this share of its squared error."""


class RowFunction:
    """A symbolic function applied to every row of its arguments on casadi's virtual machine.

    Every row is computed on its own, in the same order of operations whatever the other rows are. The work arrays
    belong to the object: one thread at a time.
    """

    def __init__(self, function: Any) -> None:
        self.widths = tuple(int(function.numel_out(i)) for i in range(function.n_out()))
        """Length of a row of each result."""
        self._function = function
        self._blocks: dict[int, tuple[list[Array], list[Array], Any, Any]] = {}

    def __call__(self, *arguments: Array) -> tuple[Array, ...]:
        """Arguments (n, width of the argument) -> one (n, width) array per result."""
        rows = len(arguments[0])
        results = tuple(np.empty((rows, width)) for width in self.widths)
        first = 0
        while first < rows:
            size = next(block for block in BLOCKS if block <= rows - first)
            inputs, outputs, _, evaluate = self._blocks.get(size) or self._block(size)
            for held, given in zip(inputs, arguments, strict=True):
                held[:] = given[first : first + size]
            evaluate()
            for given, held in zip(results, outputs, strict=True):
                given[first : first + size] = held
            first += size
        return results

    def _block(self, size: int) -> tuple[list[Array], list[Array], Any, Any]:
        mapped = self._function if size == 1 else self._function.map(size)
        inputs = [np.zeros((size, self._function.numel_in(i))) for i in range(self._function.n_in())]
        outputs = [np.zeros((size, width)) for width in self.widths]
        buffer, evaluate = mapped.buffer()
        for i, array in enumerate(inputs):
            buffer.set_arg(i, array.data)
        for i, array in enumerate(outputs):
            buffer.set_res(i, array.data)
        self._blocks[size] = (inputs, outputs, buffer, evaluate)
        return self._blocks[size]


class VirtualChain:
    """Forward kinematics and Jacobian; implements ``Backend``."""

    def __init__(self, facts: ChainFacts) -> None:
        chain = symbolic_chain(facts.joints, facts.variables, facts.dof)
        self._facts = facts
        self._position = RowFunction(position_function(chain))
        self._pose = RowFunction(pose_function(chain))

    def position(self, q: Array) -> tuple[Array, Array]:
        """As ``Backend`` says."""
        rotation, position = self._position(q)
        return rotation, position

    def pose(self, q: Array) -> tuple[Array, Array, Array]:
        """As ``Backend`` says."""
        rotation, position, jacobian = self._pose(q)
        return rotation, position, jacobian

    def solver(self, free_axis: Array | None, tolerance: tuple[float, float]) -> VirtualSolver:
        """As ``Backend`` says."""
        return VirtualSolver(self._facts, free_axis, tolerance)


class VirtualSolver:
    """Iterates the step function, all targets at once, one seed of each at a time; implements ``Solver``."""

    def __init__(self, facts: ChainFacts, free_axis: Array | None, tolerance: tuple[float, float]) -> None:
        chain = symbolic_chain(facts.joints, facts.variables, facts.dof)
        one = step_function(chain, facts.lowest, facts.highest, free_axis)
        q, t = casadi.MX.sym("q", facts.dof), casadi.MX.sym("target", 12)
        state = q
        for _ in range(STEPS):
            moved, squares = one(state, t)
            met = casadi.logic_and(squares[0] <= tolerance[0] ** 2, squares[1] <= tolerance[1] ** 2)
            state = casadi.if_else(met, state, moved)
        self._steps = RowFunction(casadi.Function("ik_steps", [q, t], [state]))
        self._error = RowFunction(casadi.Function("ik_error", [q, t], [one(q, t)[1]]))
        self._tolerance = np.square(tolerance)
        self._facts = facts

    def __call__(self, poses: Array, seeds: Array) -> tuple[Array, NDArray[np.bool_]]:
        """As ``Solver`` says; a target's result does not depend on the other targets."""
        targets = np.concatenate([poses[:, :3, :3].reshape(-1, 9), poses[:, :3, 3]], axis=1)
        first = seeds[:, 0]
        seeds = np.clip(seeds, self._facts.lowest, self._facts.highest)
        q, solved = self._iterated(targets, seeds)
        turns = np.where(self._facts.continuous, np.rint((first - q) / (2 * np.pi)), 0.0)
        return q + 2 * np.pi * turns, solved

    def _iterated(self, targets: Array, seeds: Array) -> tuple[Array, NDArray[np.bool_]]:
        count, tries, _ = seeds.shape
        best, least = seeds[:, 0].copy(), np.full(count, np.inf)
        solved = np.zeros(count, dtype=np.bool_)
        # one lane per target that is still open
        lane, q = np.arange(count), seeds[:, 0].copy()
        seed, rounds, before = np.zeros(count, np.int64), np.zeros(count, np.int64), np.full(count, np.inf)
        while lane.size:
            (q,) = self._steps(q, targets[lane])
            (squares,) = self._error(q, targets[lane])
            rounds += 1
            error = squares[:, 0] + ROTATION_WEIGHT**2 * squares[:, 1]
            met = (squares <= self._tolerance).all(axis=1)
            better = met | (error < least[lane])
            best[lane[better]], least[lane[better]] = q[better], error[better]
            solved[lane[met]] = True
            given_up = ~met & ((error > STALLED * before) | (rounds >= ROUNDS))
            before = error
            seed[given_up] += 1
            again = given_up & (seed < tries)
            q[again] = seeds[lane[again], seed[again]]
            rounds[again], before[again] = 0, np.inf
            keep = ~met & (seed < tries)
            lane, q, seed, rounds, before = lane[keep], q[keep], seed[keep], rounds[keep], before[keep]
        return best, solved
