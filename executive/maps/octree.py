"""Octrees as OctoMap writes them: a header, and the nodes in depth-first order, read with bounds.

In ``.bt`` files an inner node is two bytes, two bits for each child: 1 free, 2 occupied, 3 an inner node. In ``.ot``
files a node is its log odds and a byte that says which children there are. Format: OctoMap's AbstractOcTree and OcTree.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from planlang.diagnostics import BadInput, Span, error
from planlang.files import read_file
from planlang.geometry import Array

LARGEST = 4_000_000
"""Bytes that are read at most: two million inner nodes."""
CODE = "M024"
SUFFIXES = (".bt", ".ot")
DEPTH = 16
"""Levels below the root."""
RESOLUTIONS = (0.001, 10.0)
"""Least and greatest length of the smallest cell [m]."""
MOST_LEAVES = 1_000_000
"""Occupied leaves."""
MOST_CELLS = 2_000_000
"""Cells that occupied leaves are taken apart into, at most; smaller cells count as their larger one."""

_HEADER = re.compile(rb"# Octomap OcTree (binary )?file[^\n]*\n(.{0,10000}?)\ndata[ \t\r]*\n", re.DOTALL)
_BEYOND = {"OcTree": 0, "ColorOcTree": 3}
"""Bytes that follow the log odds of a node, by the tree's kind."""

_Leaf = tuple[int, int, int, int]
"""Lowest corner and length of an occupied leaf, in smallest cells from the tree's lowest corner."""


def read_octree(path: Path) -> tuple[Array, float]:
    """Return the middles (n, 3) of occupied cells of one length in the map, and that length [m].

    Raises BadInput with one error that says what is wrong.
    """
    content = read_file(path, CODE, largest=LARGEST)
    try:
        return _read(content)
    except ValueError as problem:
        raise BadInput([error(CODE, str(problem), Span(str(path), 1))]) from None


def _read(content: bytes) -> tuple[Array, float]:
    found = _HEADER.match(content)
    if found is None:
        raise ValueError("this is no octree of OctoMap: its first line is to be # Octomap OcTree binary file")
    words = (line.split() for line in found[2].decode("ascii", "replace").splitlines())
    header = {line[0]: line[1] for line in words if len(line) == 2}
    kind, text = header.get("id", "OcTree"), header.get("res", "")
    if kind not in _BEYOND:
        raise ValueError(f"a tree of the kind {kind[:40]} is not read: {' or '.join(_BEYOND)}")
    if not re.fullmatch(r"[0-9.eE+-]+", text) or not RESOLUTIONS[0] <= float(text) <= RESOLUTIONS[1]:
        raise ValueError(f"the resolution {text[:40]!r} is not from {RESOLUTIONS[0]} to {RESOLUTIONS[1]} m")
    nodes = memoryview(content)[found.end() :]
    try:
        each = _binary(nodes) if found[1] else _full(nodes, _BEYOND[kind])
        leaves = np.array(list(islice(each, MOST_LEAVES)), dtype=np.int64)
        if next(each, None) is not None:
            raise ValueError(f"over {MOST_LEAVES:,} occupied leaves: make the octree coarser, or prune it")
    except (IndexError, struct.error):
        raise ValueError("the octree ends in the middle of its nodes") from None
    return _cells(leaves.reshape(-1, 4), float(text))


def _binary(nodes: memoryview) -> Iterator[_Leaf]:
    """Yield the occupied leaves of a tree whose nodes are two bytes. Raises IndexError, ValueError."""
    at, inner = 0, [(0, 0, 0, 1 << DEPTH)] if nodes else []
    while inner:
        corner = inner.pop()
        occupied, below = _STATES[nodes[at]]
        more, deeper = _STATES[nodes[at + 1]]
        at += 2
        for index in occupied:
            yield _child(corner, index)
        for index in more:
            yield _child(corner, 4 + index)
        inner += [_child(corner, 4 + index) for index in deeper]
        inner += [_child(corner, index) for index in below]  # the first child is the next one


_STATES = tuple(
    tuple(
        [index for index in order if byte >> 2 * index & 3 == state]
        for state, order in ((2, range(4)), (3, range(3, -1, -1)))
    )
    for byte in range(256)
)
"""For each byte of a node: which of four children are occupied leaves, and which inner nodes, the last one first."""


def _full(nodes: memoryview, beyond: int) -> Iterator[_Leaf]:
    """Yield the occupied leaves of a tree whose nodes have log odds. Raises struct.error, ValueError."""
    step, at = struct.Struct(f"<f{beyond}xB"), 0
    there = [(0, 0, 0, 1 << DEPTH)] if nodes else []
    while there:
        corner = there.pop()
        odds, children = step.unpack_from(nodes, at)
        at += step.size
        if children:
            there += [_child(corner, index) for index in range(7, -1, -1) if children >> index & 1]
        elif odds > 0:
            yield corner


def _child(corner: _Leaf, index: int) -> _Leaf:
    """Return the eighth of a cell: the bits of the index are x, y and z. Raises ValueError for the smallest cell."""
    x, y, z, length = corner
    half = length // 2
    if not half:
        raise ValueError(f"the octree has more than {DEPTH} levels")
    return x + half * (index & 1), y + half * (index >> 1 & 1), z + half * (index >> 2), half


def _cells(leaves: NDArray[np.int64], resolution: float) -> tuple[Array, float]:
    """Return the middles of cells of one length that leaves (n, 4) are taken apart into, and that length."""
    times = 0  # the cell is this power of two
    while (np.maximum(leaves[:, 3] >> times, 1.0) ** 3).sum() > MOST_CELLS:
        times += 1
    cells = [np.zeros((0, 3))]
    for side in np.unique(leaves[:, 3]).tolist():
        count = max(side >> times, 1)
        own = np.stack(np.meshgrid(*3 * [np.arange(count)], indexing="ij"), axis=-1).reshape(-1, 3)
        corners = leaves[leaves[:, 3] == side, :3] >> times
        cells.append((corners[:, None] + own).reshape(-1, 3))
    length = resolution * (1 << times)
    return (np.vstack(cells) + 0.5) * length - resolution * (1 << DEPTH - 1), length
