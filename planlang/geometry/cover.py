"""Boxes that cover a set of points, or the surface of a mesh."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from planlang.geometry.matrices import Array

Cells = NDArray[np.int64]
"""Boxes (m, 6) in cells: lower and upper bound along x, y and z."""


def cells(points: Array, length: float) -> Cells:
    """Bin points (n, 3) into unique cells (m, 6) of this edge [m]."""
    lows = np.floor(points / length + 1e-9).astype(np.int64)
    lows = lows[np.lexsort(lows.T)]
    if len(lows):
        lows = lows[np.concatenate([[True], (np.diff(lows, axis=0) != 0).any(axis=1)])]
    return np.asarray(np.repeat(lows, 2, axis=1) + np.tile([0, 1], 3))


def joined(boxes: Cells) -> Cells:
    """Cover the same cells with fewer boxes (m, 6): join neighbours along x that are otherwise equal, then y, z."""
    for axis in range(3):
        others = [2 * other + end for other in range(3) if other != axis for end in (0, 1)]
        boxes = boxes[np.lexsort((boxes[:, 2 * axis], *boxes[:, others].T))]
        is_new = (np.diff(boxes[:, others], axis=0) != 0).any(axis=1)
        is_new |= boxes[1:, 2 * axis] != boxes[:-1, 2 * axis + 1]
        starts = np.flatnonzero(np.concatenate([np.ones(min(len(boxes), 1), dtype=bool), is_new]))
        ends = np.concatenate([starts[1:], [len(boxes)]])[: len(starts)] - 1
        high = boxes[ends, 2 * axis + 1]
        boxes = boxes[starts]
        boxes[:, 2 * axis + 1] = high
    return boxes


def at_most(boxes: Cells, most: int) -> tuple[Cells, int]:
    """Cover boxes with at most ``most`` of them, and return the longest gap that this closes, in cells; 0 for none."""
    boxes, across = joined(boxes), 1
    while len(boxes) > most:
        across *= 2
        boxes = joined(_joined_over_gaps(boxes, across, most))
    return boxes, across if across > 1 else 0


def _joined_over_gaps(boxes: Cells, across: int, most: int) -> Cells:
    """Cover boxes (m, 6), and gaps between them, with at most ``most`` boxes if joining them once is enough.

    Boxes up to ``across`` cells large that begin in one cube of that edge are joined, the most crowded cubes first:
    isolated obstacles and walls stay as they are.
    """
    is_small = ((boxes[:, 1::2] - boxes[:, ::2]) <= across).all(axis=1)
    small = boxes[is_small]
    _, cubes, counts = np.unique(small[:, ::2] // across, axis=0, return_inverse=True, return_counts=True)
    densest = np.argsort(-counts, kind="stable")
    saved = np.cumsum(counts[densest] - 1)
    is_joined = np.zeros(len(counts), dtype=bool)
    is_joined[densest[: np.searchsorted(saved, len(boxes) - most) + 1]] = True
    groups = np.where(is_joined[cubes.ravel()], cubes.ravel(), len(counts) + np.arange(len(small)))
    order = np.argsort(groups, kind="stable")
    starts = np.flatnonzero(np.diff(groups[order], prepend=-1))
    joined = np.empty((len(starts), 6), dtype=np.int64)
    joined[:, ::2] = np.minimum.reduceat(small[order, ::2], starts) if len(starts) else 0
    joined[:, 1::2] = np.maximum.reduceat(small[order, 1::2], starts) if len(starts) else 0
    return np.concatenate([boxes[~is_small], joined])


# Meshes

CELL = 0.05
"""Edge of the cells that cover the surface of a mesh [m]."""
MOST_SAMPLES = 1_000_000
"""Greatest number of points on a surface; cells are made coarser until there are that few."""
MOST_BOXES = 100
"""Greatest number of boxes of a mesh."""
WIDE = 0.6
"""Least horizontal extents of a shape in which a robot, or its arm, could be [m]; a smaller one is one box."""
ROOMY, STOREY = 1.5, 1.9
"""Least horizontal extents and height of a shape that may be the walls around a robot [m]."""
FULL = 0.7
"""Least share of its footprint that a shape covers if it is one box, such as a table, which its top covers."""
THIN = 0.001
"""Least extent of a box: surfaces may be flat [m]."""

Ends = tuple[Array, Array]
"""Lower and upper corner of a box (3,) [m]."""


def boxes_of_surface(vertices: Array, groups: Sequence[NDArray[np.int64]], up: int) -> list[Ends]:
    """Cover triangles of vertices (n, 3) [m], in groups (m, 3), with boxes along the axes, of which ``up`` is vertical.

    One box around all of them, unless much of its footprint is free, as in a room or a corner sofa: then one around
    each connected part of a group, or, for walls modelled in one part, boxes of cells.
    """
    faces = np.concatenate(groups)
    whole = _one_box(vertices, faces, up)
    if whole is not None:
        return [whole]
    parts = [part for group in groups for part in _connected(vertices, group)]
    if len(parts) > MOST_BOXES:
        return _boxes_of_cells(vertices, faces)
    boxes = []
    for part in parts:
        one = _one_box(vertices, part, up)
        boxes += [one] if one is not None else _boxes_of_cells(vertices, part)
    return boxes if len(boxes) <= MOST_BOXES else _boxes_of_cells(vertices, faces)


def is_room(size: Sequence[float] | Array, up: int) -> bool:
    """Check whether a box is as large as a room."""
    return min(_across(size, up)) >= ROOMY and size[up] >= STOREY


def is_wide(size: Sequence[float] | Array, up: int) -> bool:
    """Check whether a robot or its arm has room in a box."""
    return min(_across(size, up)) >= WIDE


def _across(size: Sequence[float] | Array, up: int) -> list[float]:
    return [float(size[axis]) for axis in range(3) if axis != up]


def _one_box(vertices: Array, faces: NDArray[np.int64], up: int) -> Ends | None:
    """Compute the box around triangles; None if much of its footprint is free."""
    low, high = _ends(vertices[faces].reshape(-1, 3))
    if not is_wide(high - low, up):
        return low, high
    if is_room(high - low, up):  # its floor or ceiling may cover all of the footprint
        return None
    points, length = samples(vertices, faces)
    across = [axis for axis in range(3) if axis != up]
    columns = np.unique(np.floor((points - low)[:, across] / length + 1e-9).clip(0), axis=0)
    count = np.ceil((high - low)[across] / length - 1e-9).prod()
    return (low, high) if len(columns) >= FULL * count else None


def _ends(points: Array) -> Ends:
    low, high = points.min(axis=0), points.max(axis=0)
    more = np.maximum(THIN - (high - low), 0.0) / 2
    return low - more, high + more


def _boxes_of_cells(vertices: Array, faces: NDArray[np.int64]) -> list[Ends]:
    low, high = _ends(vertices[faces].reshape(-1, 3))
    points, length = samples(vertices, faces)
    boxes, _ = at_most(cells(points, length), MOST_BOXES)
    lower = np.clip(boxes[:, ::2] * length, low, high - THIN)
    upper = np.clip(boxes[:, 1::2] * length, lower + THIN, high)
    return list(zip(lower, upper, strict=True))


def _connected(vertices: Array, faces: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Split triangles into those that share corners, in the order of the file."""
    _, corner = np.unique(np.round(vertices, 6), axis=0, return_inverse=True)
    linked = corner.ravel()[faces]
    label = np.arange(len(vertices))
    while True:  # the least label spreads along edges, twice as far each time
        least = label[linked].min(axis=1)
        new = label.copy()
        np.minimum.at(new, linked.ravel(), np.repeat(least, 3))
        new = new[new]
        if (new == label).all():
            break
        label = new
    groups = label[linked[:, 0]]
    _, first, group = np.unique(groups, return_index=True, return_inverse=True)
    return [faces[group.ravel() == index] for index in np.argsort(first, kind="stable")]


def samples(vertices: Array, faces: NDArray[np.int64], length: float = CELL) -> tuple[Array, float]:
    """Points (k, 3) on triangles, at most half a cell apart, and the edge of the cells [m], ``length`` or coarser."""
    corners = vertices[faces]
    edges = corners - np.roll(corners, 1, axis=1)
    longest = np.linalg.norm(edges, axis=2).max(axis=1)
    while True:
        steps = np.ceil(2 * longest / length).astype(np.int64).clip(1)
        if ((steps + 1) * (steps + 2) / 2).sum() <= MOST_SAMPLES or (steps == 1).all():
            break
        length *= 2
    found = []
    for count in np.unique(steps).tolist():
        first, second = np.meshgrid(*2 * [np.arange(count + 1)], indexing="ij")
        inner = first + second <= count
        weights = np.stack([first[inner], second[inner], count - first[inner] - second[inner]], axis=1) / count
        found.append(np.einsum("kc,tcx->tkx", weights, corners[steps == count]).reshape(-1, 3))
    return np.concatenate(found), length
