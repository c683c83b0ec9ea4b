"""Occupied space from the sensor data that a map refers to: occupancy grids, point clouds and octrees.

Their points or cells are covered by a limited number of boxes, which are obstacles in the world. For safety no URL is
fetched, and no file outside the folder of the map is read.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from executive.maps import octree, point_cloud
from executive.maps.occupancy_grid import read_grid
from executive.maps.octree import read_octree
from executive.maps.point_cloud import read_points
from executive.maps.semantic_map import PosesOfThings, SemanticMap
from planlang.designators import local_name
from planlang.diagnostics import BadInput, Diagnostic, Span, note, unread, warning
from planlang.geometry import IDENTITY, Array, Pose
from planlang.geometry.cover import at_most, cells
from planlang.geometry.matrices import moved, rotated
from planlang.geometry.shapes import corners, footprint
from planlang.ontology import Ontology, Triple
from planlang.records import dataclass
from sim import Body
from sim.scene import BodyShape

EXPLAINED = 0.1
"""Points within this distance, plus a cell's length, of a body of the map belong to that body [m]."""
FLOOR = 0.05
"""Points up to this height are the floor: wheels roll over it [m]."""
HIGHEST = 2.2
"""No robot, and nothing that it carries, reaches above this height [m]."""
FARTHEST = 200.0
"""Points farther than this from the median along an axis are sensor errors [m]."""
TILTED = 1e-6
"""Greatest difference of a frame's vertical from that of the map, as 1 minus a cosine."""
MOST_CELLS = 1_000_000
"""Greatest number of cells to compare with the map; cells are made coarser until they are that few."""
MOST_BOXES = 500
"""Greatest number of boxes; close ones are joined until there are that few."""

Box = tuple[Pose, tuple[float, float, float]]
"""Pose of the centre in the map, and size [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class OccupiedSpace:
    """Occupied points of a frame."""

    points: Array
    """Shape (n, 3), in ``frame`` [m]."""
    cell: float
    """Edge of the cells into which the space is divided [m]."""
    half: float = 0.0
    """Half the height that a point represents: 0, or half a cell [m]."""
    height: float | None = None
    """Common height of the obstacles if the data are two-dimensional: then z of all points is 0 [m]."""
    frame: Pose = IDENTITY
    """Pose of the frame in the map; both z axes are parallel."""

    def within(self, frame: Pose) -> OccupiedSpace:
        """Interpret the frame as relative to another one, which has a pose in the map.

        Points are moved into the map if a frame is tilted, as boxes are upright; two-dimensional data must not be.
        """
        whole = frame @ self.frame
        if self.height is not None or abs(whole.rotation[2, 2] - 1.0) < TILTED:
            return replace(self, frame=whole)
        return replace(self, points=moved(whole.matrix(), self.points), frame=IDENTITY)

    def boxes(self, bodies: Sequence[Body]) -> tuple[list[Box], float]:
        """Cover the points that no body explains with boxes; if there are rooms, only the points inside.

        Returns also the greatest length of gaps that a box may bridge [m].
        """
        points, length = self._downsampled()
        points = points[self._unexplained(points, bodies, EXPLAINED + length)]
        covering, across = at_most(cells(points, length), MOST_BOXES)
        boxes = [self._box(low, high, length) for low, high in covering.reshape(-1, 3, 2).transpose(0, 2, 1)]
        return boxes, across * length or length - self.cell

    def why_empty(self) -> str:
        """Say why none of the points can be in a robot's way; "" if some are, or are explained by the map."""
        points = self.points[np.isfinite(self.points).all(axis=1)]
        if not len(points):
            return "no cell is occupied" if self.height is not None else "it has no finite points"
        if len(self._downsampled()[0]):
            return ""
        lowest, highest = (float(z) + self.frame.position[2] for z in (points[:, 2].min(), points[:, 2].max()))
        return (
            f"its points are {lowest:.3g} to {highest:.3g} high, and obstacles {FLOOR} to {HIGHEST} m; "
            "write coordinates in metres, with z upwards and 0 on the floor"
        )

    def _box(self, low: NDArray[np.int64], high: NDArray[np.int64], length: float) -> Box:
        x, y, z = ((low + high) * length / 2).tolist()
        depth, width, height = ((high - low) * length).tolist()
        if self.height is not None:
            z, height = self.height / 2, self.height
        return self.frame @ Pose((x, y, z)), (depth, width, height)

    def _downsampled(self) -> tuple[Array, float]:
        """Keep the points that can be in a robot's way, one per cell if there are too many; and the cell's edge [m]."""
        points = self.points
        if self.height is None:
            points = points[np.isfinite(points).all(axis=1)]
            low = points[:, 2] + self.frame.position[2] - self.half
            points = points[(low >= FLOOR - 1e-9) & (low <= HIGHEST)]
            middle = np.median(points, axis=0) if len(points) else 0.0
            points = points[(np.abs(points - middle) <= FARTHEST).all(axis=1)]
        length, times = self.cell, 1
        while len(points) > MOST_CELLS:
            length = self.cell * times
            points = np.asarray((cells(points, length)[:, ::2] + 0.5) * length)
            times *= 2
        return (points if self.height is None else points * (1.0, 1.0, 0.0)), length

    def _unexplained(self, points: Array, bodies: Sequence[Body], near: float) -> NDArray[np.bool_]:
        """Mask of the points that are inside rooms, if there are any, and not within ``near`` [m] of a body."""
        in_map = moved(self.frame.matrix(), points)
        rooms = [body for body in bodies if body.shape is BodyShape.ROOM]
        mask = np.ones(len(in_map), dtype=bool)
        if rooms:
            tops = [corners(room.pose, room.size)[:, 2].max() - near for room in rooms]
            inside = [
                _in_outline(in_map, room, -near) & (in_map[:, 2] <= top) for room, top in zip(rooms, tops, strict=True)
            ]
            # the openings in the walls of rooms: obstacles there block a doorway
            doorways = [
                Body(room.name, room.pose @ Pose(one.centre), one.size) for room in rooms for one in room.cavities
            ]
            openings = [_in_outline(in_map, one, 0.0) for one in doorways]
            mask = np.any([*inside, *openings], axis=0)
        for body in bodies:
            if body.shape not in (BodyShape.ROOM, BodyShape.MARKER):
                mask &= ~(_in_outline if self.height is not None else _in_box)(in_map, body, near)
        return mask


def _in_box(points: Array, body: Body, more: float) -> NDArray[np.bool_]:
    """Mask of the points (n, 3), in the map frame, inside a body's box that is enlarged on every side by ``more``."""
    local = rotated(body.pose.rotation.T, points - body.pose.position) - body.centre
    return np.asarray((np.abs(local) <= np.array(body.size) / 2 + more).all(axis=1))


def _in_outline(points: Array, body: Body, more: float) -> NDArray[np.bool_]:
    """Mask of the points (n, 3) inside the footprint of a body that is enlarged on every side by ``more`` [m]."""
    outline = footprint(body.pose, body.size)
    inside = np.ones(len(points), dtype=bool)
    for start, end in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        along = (end - start) / max(math.dist(start, end), 1e-9)
        inside &= (points[:, 0] - start[0]) * along[1] - (points[:, 1] - start[1]) * along[0] <= more
    return inside


OBSTACLE = "mapped obstacle"
"""Name of a body made from sensor data, followed by its number."""
UPRIGHT = 0.9999
"""Least cosine of the angle between up and the z axis of a file's frame: just below one degree."""
CELL = 0.05
"""Edge of the cells into which points are binned [m]."""
NO_COPY = "URLs are not fetched, and there is no copy beside the map"
FAR = 0.2
"""Joining obstacles over gaps of this length may block a robot's way: a warning instead of a note [m]."""


def with_obstacles(bodies: Sequence[Body], semantic_map: SemanticMap, notes: list[Diagnostic]) -> list[Body]:
    """Add boxes that cover sensor data which no body of the map explains.

    A file that is missing or cannot be read is an error in ``notes``; one that only has an address elsewhere, of which
    there is no copy, was never on this computer: a warning.
    """
    files = _files(semantic_map.ontology, notes)
    boxes = [box for path, frame in files for box in _boxes(path, frame, bodies, notes)]
    return [
        *bodies,
        *(Body(f"{OBSTACLE} {number}", pose, size) for number, (pose, size) in enumerate(boxes, 1)),
    ]


def _files(ontology: Ontology, notes: list[Diagnostic]) -> Iterator[tuple[Path, Pose]]:
    """Yield the existing files of known formats, each with the pose of its map."""
    poses = PosesOfThings(ontology, notes)
    for triple in ontology.using("linkToMapFile"):
        iri, link = triple.subject, triple.object
        name = unquote(str(link).removeprefix("file:///")) if isinstance(link, str) else getattr(link, "value", "")
        path, problem = _file(triple, name.strip())
        if path is not None and path.suffix.lower() not in _READERS:
            problem = f"only {', '.join(_READERS)} can be read"
        if problem:
            message = f"the obstacles of {local_name(str(iri))} are not in the world: {problem}: {name[:200]}"
            make = warning if problem is NO_COPY else unread
            notes.append(make("M025", message, triple.span))
        elif path is not None:
            yield path, (poses.pose(iri) if isinstance(iri, str) else None) or IDENTITY


def _file(triple: Triple, link: str) -> tuple[Path | None, str]:
    """Resolve a link to a file in the folder of the map; None with a reason otherwise."""
    folder, is_elsewhere = Path(triple.span.file).parent, "://" in link or link.startswith("//")
    try:
        path = (folder / (Path(link).name if is_elsewhere else link)).resolve()  # `planlang pull` puts it there
        if not path.is_relative_to(folder.resolve()):
            return None, "it is outside the folder of the map"
        if path.is_file():
            return path, ""
        return None, NO_COPY if is_elsewhere else "file not found"
    except (OSError, ValueError):
        return None, "this is not a file name"


def _boxes(path: Path, frame: Pose, bodies: Sequence[Body], notes: list[Diagnostic]) -> list[Box]:
    """Cover what a file in a frame shows and no body explains with boxes."""
    try:
        space = _READERS[path.suffix.lower()](path)
        if frame.rotation[2, 2] < UPRIGHT and space.height is not None:
            message = "these obstacles are not in the world: the z axis of their frame is not vertical"
            raise BadInput([unread("M024", message, Span(str(path)))])
        space = space.within(frame)
        if empty := space.why_empty():
            notes.append(warning("M035", f"no obstacle is read from it: {empty}", Span(str(path))))
        boxes, apart = space.boxes(bodies)
    except BadInput as bad:
        notes += bad.diagnostics
        return []
    if apart > 0:
        severity = warning if apart >= FAR else note
        message = f"obstacles up to {apart:.2g} m apart were joined, gaps included, into {len(boxes)} boxes"
        notes.append(severity("M032", message, Span(str(path)), "remove what is not an obstacle, or is in the map"))
    return boxes


def _of_grid(path: Path) -> OccupiedSpace:
    grid = read_grid(path)
    return OccupiedSpace(grid.centres(), grid.resolution, height=grid.height, frame=grid.frame)


def _of_points(path: Path) -> OccupiedSpace:
    return OccupiedSpace(read_points(path), CELL)


def _of_octree(path: Path) -> OccupiedSpace:
    centres, length = read_octree(path)
    return OccupiedSpace(centres, length, half=length / 2)


_READERS: dict[str, Callable[[Path], OccupiedSpace]] = {
    **dict.fromkeys((".yaml", ".yml"), _of_grid),
    **dict.fromkeys(point_cloud.SUFFIXES, _of_points),
    **dict.fromkeys(octree.SUFFIXES, _of_octree),
}
"""Reader of a file by its suffix."""
