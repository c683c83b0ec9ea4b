"""A scalar function of casadi applied to many rows at once, on casadi's virtual machine: nothing is compiled.

The virtual machine takes about 8 ns for an instruction on numbers, and about 80 ns and 1 ns a row for one on vectors.
So for many rows the same instructions are written down once more, on vectors: a step of inverse kinematics of an arm
of 8 joints (1,238 instructions) then takes 1.2 us a row instead of 10 us, little more than compiled C
(docs/benchmarks.md). Each row passes through the same operations in the same order in both, so that its result does not
depend on how many rows there are.
"""

from __future__ import annotations

from typing import Any

import casadi
import numpy as np

from planlang.geometry import Array

BLOCKS = ((256, 97), (32, 7), (1, 0))
"""Rows of a call, and from how many rows on that are left it is made: where it begins to be the cheapest."""


class RowFunction:
    """A function of vectors, applied to each column of its arguments (rows of a batch lie along the last axis).

    The work arrays belong to the object: one thread at a time.
    """

    def __init__(self, function: Any) -> None:
        """Wrap ``function``, of casadi's scalar expressions (SX), with dense vectors as arguments and results."""
        self._function = function
        self._blocks: dict[int, tuple[list[Array], list[Array], Any, Any]] = {}

    def __call__(self, *arguments: Array) -> list[Array]:
        """Return results (width, n) of arguments (width, n)."""
        count, parts = arguments[0].shape[1], list[list[Array]]()
        first = 0
        while first < count or not parts:
            size = next(size for size, least in BLOCKS if count - first >= least)
            inputs, outputs, evaluate, _ = self._blocks.get(size) or self._block(size)
            last = min(first + size, count)
            for held, given in zip(inputs, arguments, strict=True):
                held[:, : last - first] = given[:, first:last]
            evaluate()
            parts.append([held[:, : last - first].copy() for held in outputs])
            first = last
        return (
            parts[0] if len(parts) == 1 else [np.concatenate(several, axis=1) for several in zip(*parts, strict=True)]
        )

    def _block(self, size: int) -> tuple[list[Array], list[Array], Any, Any]:
        one = self._function
        function = one if size == 1 else _on_vectors(one, size)
        inputs = [np.zeros((one.numel_in(i), size)) for i in range(one.n_in())]
        outputs = [np.zeros((one.numel_out(i), size)) for i in range(one.n_out())]
        buffer, evaluate = function.buffer()
        for i, array in enumerate(inputs):
            buffer.set_arg(i, array.data)
        for i, array in enumerate(outputs):
            buffer.set_res(i, array.data)
        self._blocks[size] = (inputs, outputs, evaluate, buffer)
        return self._blocks[size]


def _on_vectors(function: Any, size: int) -> Any:
    """Return the same function with each number replaced by a vector of ``size`` rows."""
    arguments = [casadi.MX.sym(f"argument{i}", size, function.numel_in(i)) for i in range(function.n_in())]
    columns = [casadi.horzsplit(argument) for argument in arguments]
    results: list[list[Any]] = [[None] * function.numel_out(i) for i in range(function.n_out())]
    known: dict[int, Any] = {}
    for number in range(function.n_instructions()):
        operation = function.instruction_id(number)
        sources, targets = function.instruction_input(number), function.instruction_output(number)
        if operation == casadi.OP_CONST:
            known[targets[0]] = casadi.MX(function.instruction_constant(number))
        elif operation == casadi.OP_INPUT:
            known[targets[0]] = columns[sources[0]][sources[1]]
        elif operation == casadi.OP_OUTPUT:
            value = known[sources[0]]
            results[targets[0]][targets[1]] = value if value.numel() == size else casadi.repmat(value, size, 1)
        elif len(sources) == 1:
            known[targets[0]] = casadi.MX.unary(operation, known[sources[0]])
        else:
            known[targets[0]] = casadi.MX.binary(operation, known[sources[0]], known[sources[1]])
    return casadi.Function(function.name(), arguments, [casadi.horzcat(*columns) for columns in results])
