"""Files that a map names beside what it states: occupancy grids are obstacles for driving, others are told of.

Nothing is ever fetched, and nothing is read outside the folder of the map's own file.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from executive.belief.occupancy_grid import Cells, OccupancyGrid, read_grid
from executive.belief.semantic_map import SemanticMap
from planlang.designators import local_name
from planlang.diagnostics import BadInput, Diagnostic, Severity, note, warning
from planlang.geometry import Array, Pose
from planlang.geometry.shapes import footprint
from planlang.ontology import Literal, Ontology, Triple, expand
from sim import Body
from sim.scene import BodyShape

OBSTACLE = "mapped obstacle"
"""The name of a body that a grid tells of, before its number."""
HEIGHT = 1.0
"""Height of such a body [m]: a grid tells nothing of it, and hands keep away from what is not known as well."""
EXPLAINED = 0.1
"""Cells that are nearer to a thing of the map than this, beside a cell's length, are the thing [m]."""
MOST_BOXES = 200
"""Boxes that the obstacles of a map are; a finer grid is made coarser until they are enough."""

MOST_RUNS = 20_000
"""Runs of occupied cells in rows of which boxes are made."""


def with_obstacles(bodies: Sequence[Body], semantic_map: SemanticMap, found: list[Diagnostic]) -> list[Body]:
    """Return bodies with boxes where the map's occupancy grids have something that the map does not know.

    What cannot be read or is not here is told, and left out.
    """
    boxes = [box for path in _grids(semantic_map.ontology, found) for box in _boxes(path, bodies, found)]
    return [
        *bodies,
        *(Body(f"{OBSTACLE} {number}", pose, size) for number, (pose, size) in enumerate(boxes, 1)),
    ]


def _grids(ontology: Ontology, found: list[Diagnostic]) -> Iterator[Path]:
    """Yield the files of occupancy grids that are there."""
    for iri in ontology.individuals(expand("Map")):
        for triple in ontology.said(iri, "linkToMapFile"):
            if not isinstance(triple.object, Literal):
                continue
            path, problem = _file(triple, triple.object.value.strip())
            if path is not None and path.suffix.lower() not in (".yaml", ".yml"):
                problem = "only occupancy grids (YAML of map_server) are read"
            if problem:
                message = f"the map {local_name(iri)} is left out: {problem}: {triple.object.value[:200]}"
                found.append(note("M025", message, triple.span))
            elif path is not None:
                yield path


def _file(triple: Triple, link: str) -> tuple[Path | None, str]:
    """Return the file that a link means, or why there is none."""
    if "://" in link or link.startswith("//"):
        return None, "files at other places are not fetched"
    folder = Path(triple.span.file).parent
    try:
        path = (folder / link).resolve()
        if not path.is_relative_to(folder.resolve()):
            return None, "it is outside of the map's folder"
        return (path, "") if path.is_file() else (None, "there is no such file")
    except (OSError, ValueError):
        return None, "this is no name of a file"


def _boxes(
    path: Path, bodies: Sequence[Body], found: list[Diagnostic]
) -> list[tuple[Pose, tuple[float, float, float]]]:
    """Return pose and size of boxes that cover what a grid has and no thing explains."""
    try:
        grid = read_grid(path)
    except BadInput as bad:
        found += (warning(one.code, one.message, one.span) for one in bad.diagnostics if one.severity is Severity.ERROR)
        return []
    cells = _unexplained(grid, bodies)
    length, rectangles = 1, list[tuple[int, int, int, int]]()
    while not rectangles or len(rectangles) > MOST_BOXES:
        coarse = _coarser(cells, length)
        runs = np.count_nonzero(coarse[:, 0]) + np.count_nonzero(coarse[:, 1:] > coarse[:, :-1])
        if runs == 0:
            return []
        rectangles = list(_rectangles(coarse)) if runs <= MOST_RUNS else []
        length *= 1 if rectangles and len(rectangles) <= MOST_BOXES else 2
    step = grid.resolution * length
    boxes = []
    for low_row, high_row, low_column, high_column in rectangles:
        middle = np.array([[low_column + high_column, low_row + high_row]]) * step / 2
        (x, y), *_ = grid.in_map(middle).tolist()
        size = ((high_column - low_column) * step, (high_row - low_row) * step, HEIGHT)
        boxes.append((Pose.planar(x, y, grid.origin[2], HEIGHT / 2), size))
    return boxes


def _unexplained(grid: OccupancyGrid, bodies: Sequence[Body]) -> Cells:
    """Return the occupied cells (rows, columns) that are inside of the rooms, if there are any, and in no thing."""
    near, points = EXPLAINED + grid.resolution, grid.centres(grid.occupied)
    rooms = [body for body in bodies if body.shape is BodyShape.ROOM]
    things = [body for body in bodies if body.shape not in (BodyShape.ROOM, BodyShape.MARKER)]
    kept = np.ones(len(points), dtype=bool)
    if rooms:
        kept = np.any([_within(points, room, -near) for room in rooms], axis=0)
    for thing in things:
        kept &= ~_within(points, thing, near)
    cells = np.zeros_like(grid.occupied)
    cells[grid.occupied] = kept
    return cells


def _within(points: Array, body: Body, more: float) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """Return which points (n, 2) are in the outline of a body that is wider by so much on every side [m]."""
    corners = footprint(body.pose, body.size)
    inside = np.ones(len(points), dtype=bool)
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        along = (end - start) / max(math.dist(start, end), 1e-9)
        inside &= (points[:, 0] - start[0]) * along[1] - (points[:, 1] - start[1]) * along[0] <= more
    return inside


def _coarser(cells: Cells, length: int) -> Cells:
    """Return a grid with cells that are so many times as long, and occupied if one of theirs is."""
    if length == 1:
        return cells
    rows, columns = (-(-side // length) * length for side in cells.shape)
    padded = np.zeros((rows, columns), dtype=bool)
    padded[: cells.shape[0], : cells.shape[1]] = cells
    blocks = padded.reshape(rows // length, length, columns // length, length)
    return np.asarray(blocks.any(axis=(1, 3)))


def _rectangles(cells: Cells) -> Iterator[tuple[int, int, int, int]]:
    """Yield rectangles that cover the cells: rows from and to, columns from and to; equal runs of rows are joined."""
    open_runs: dict[tuple[int, int], int] = {}
    for row in range(cells.shape[0] + 1):
        line = cells[row] if row < cells.shape[0] else np.zeros(cells.shape[1], dtype=bool)
        edges = np.flatnonzero(np.diff(np.concatenate(([0], line.astype(np.int8), [0]))))
        runs = set(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))
        for run in [run for run in open_runs if run not in runs]:
            yield open_runs.pop(run), row, *run
        for run in sorted(runs):
            open_runs.setdefault(run, row)
