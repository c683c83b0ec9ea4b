"""Obstacles from sensor data that a map refers to: occupancy grids, point clouds and octrees.

For safety no URL is fetched, and no file outside the folder of the map is read.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from urllib.parse import unquote

from executive.maps import octree, point_cloud
from executive.maps.occupancy_grid import read_grid
from executive.maps.occupied_space import Box, OccupiedSpace
from executive.maps.octree import read_octree
from executive.maps.point_cloud import read_points
from executive.maps.semantic_map import PosesOfThings, SemanticMap
from planlang.designators import local_name
from planlang.diagnostics import BadInput, Diagnostic, Span, note, unread, warning
from planlang.geometry import Pose
from planlang.ontology import Ontology, Triple
from sim import Body

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
            yield path, (poses.pose(iri) if isinstance(iri, str) else None) or Pose((0.0, 0.0, 0.0))


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
