"""Octrees in the formats of OctoMap: a header, and the nodes in depth-first order; sizes are bounded.

In ``.bt`` files an inner node is two bytes, two bits per child: 1 free, 2 occupied, 3 an inner node. In ``.ot`` files
a node is its log odds and a byte with a bit for each existing child. Formats: OctoMap's AbstractOcTree and OcTree.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from planlang.diagnostics import BadInput, Span, unread
from planlang.files import read_file
from planlang.geometry import Array

LARGEST = 4_000_000
"""Greatest size of a file [bytes]: two million inner nodes."""
CODE = "M024"
SUFFIXES = (".bt", ".ot")
DEPTH = 16
"""Levels below the root."""
RESOLUTIONS = (0.001, 10.0)
"""Least and greatest length of the smallest cell [m]."""
MOST_LEAVES = 1_000_000
"""Greatest number of occupied leaves."""
MOST_CELLS = 2_000_000
"""Greatest number of equal cells into which occupied leaves are divided; smaller leaves fill a whole cell."""

_HEADER = re.compile(rb"# Octomap OcTree (binary )?file[^\n]*\n(.{0,10000}?)\ndata[ \t\r]*\n", re.DOTALL)
_BEYOND = {"OcTree": 0, "ColorOcTree": 3}
"""Bytes after the log odds of a node, by the type of the tree."""

_Leaf = tuple[int, int, int, int]
"""Lowest corner and edge of a leaf, in smallest cells from the lowest corner of the tree."""


def read_octree(path: Path) -> tuple[Array, float]:
    """Read the centres (n, 3) of the occupied cells, all of one size, and their edge [m], in the frame of the file.

    Raises BadInput with one error.
    """
    content = read_file(path, CODE, largest=LARGEST)
    try:
        return _read(content)
    except ValueError as problem:
        raise BadInput([unread(CODE, str(problem), Span(str(path), 1))]) from None


def _read(content: bytes) -> tuple[Array, float]:
    match = _HEADER.match(content)
    if match is None:
        raise ValueError("not an OctoMap file: the first line must be # Octomap OcTree binary file")
    words = (line.split() for line in match[2].decode("ascii", "replace").splitlines())
    header = {line[0]: line[1] for line in words if len(line) == 2}
    kind, text = header.get("id", "OcTree"), header.get("res", "")
    if kind not in _BEYOND:
        raise ValueError(f"the type of the tree must be {' or '.join(_BEYOND)}, not {kind[:40]}")
    if not re.fullmatch(r"[0-9.eE+-]+", text) or not RESOLUTIONS[0] <= float(text) <= RESOLUTIONS[1]:
        raise ValueError(f"the resolution must be from {RESOLUTIONS[0]} to {RESOLUTIONS[1]} m, not {text[:40]!r}")
    nodes = memoryview(content)[match.end() :]
    try:
        occupied = _binary(nodes) if match[1] else _full(nodes, _BEYOND[kind])
        leaves = np.array(list(islice(occupied, MOST_LEAVES)), dtype=np.int64)
        if next(occupied, None) is not None:
            raise ValueError(f"over {MOST_LEAVES:,} occupied leaves: make the octree coarser, or prune it")
    except (IndexError, struct.error):
        raise ValueError("the file ends before the last node: it is truncated") from None
    return _cells(leaves.reshape(-1, 4), float(text))


def _binary(nodes: memoryview) -> Iterator[_Leaf]:
    """Yield the occupied leaves of a ``.bt`` tree. Raises IndexError, ValueError."""
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
        inner += [_child(corner, index) for index in below]  # last in, first out: the first child comes next
    _check_end(nodes, at)


_STATES = tuple(
    tuple(
        [index for index in order if byte >> 2 * index & 3 == state]
        for state, order in ((2, range(4)), (3, range(3, -1, -1)))
    )
    for byte in range(256)
)
"""For each byte of a node: which of its four children are occupied leaves, and which are inner nodes, last first."""


def _full(nodes: memoryview, beyond: int) -> Iterator[_Leaf]:
    """Yield the occupied leaves of an ``.ot`` tree: those with positive log odds. Raises struct.error, ValueError."""
    node, at = struct.Struct(f"<f{beyond}xB"), 0
    stack = [(0, 0, 0, 1 << DEPTH)] if nodes else []
    while stack:
        corner = stack.pop()
        odds, children = node.unpack_from(nodes, at)
        at += node.size
        if children:
            stack += [_child(corner, index) for index in range(7, -1, -1) if children >> index & 1]
        elif odds > 0:
            yield corner
    _check_end(nodes, at)


def _check_end(nodes: memoryview, at: int) -> None:
    """Check that nothing follows the last node. Raises ValueError."""
    if bytes(nodes[at : at + 100]).strip():
        raise ValueError("there is more behind the last node: the tree is damaged")


def _child(corner: _Leaf, index: int) -> _Leaf:
    """Compute an octant of a cell; bits 0 to 2 of the index are x, y and z. Raises ValueError below the last level."""
    x, y, z, length = corner
    half = length // 2
    if not half:
        raise ValueError(f"the octree has more than {DEPTH} levels")
    return x + half * (index & 1), y + half * (index >> 1 & 1), z + half * (index >> 2), half


def _cells(leaves: NDArray[np.int64], resolution: float) -> tuple[Array, float]:
    """Divide leaves (n, 4) into cells of one size; returns the centres of the cells (m, 3) and their edge [m]."""
    level = 0  # the edge of a cell is 2**level smallest cells
    while (np.maximum(leaves[:, 3] >> level, 1.0) ** 3).sum() > MOST_CELLS:
        level += 1
    cells = [np.zeros((0, 3))]
    for side in np.unique(leaves[:, 3]).tolist():
        count = max(side >> level, 1)
        offsets = np.stack(np.meshgrid(*3 * [np.arange(count)], indexing="ij"), axis=-1).reshape(-1, 3)
        corners = leaves[leaves[:, 3] == side, :3] >> level
        cells.append((corners[:, None] + offsets).reshape(-1, 3))
    length = resolution * (1 << level)
    return (np.vstack(cells) + 0.5) * length - resolution * (1 << DEPTH - 1), length
