"""Obstacles from sensor data that a map refers to: occupancy grids, point clouds and octrees.

For safety no URL is fetched, and no file outside the folder of the map is read.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from executive.maps import octree, point_cloud
from executive.maps.occupancy_grid import read_grid
from executive.maps.occupied_space import Box, OccupiedSpace
from executive.maps.octree import read_octree
from executive.maps.point_cloud import read_points
from executive.maps.semantic_map import PosesOfThings, SemanticMap
from planlang.designators import local_name
from planlang.diagnostics import BadInput, Diagnostic, Severity, Span, note, warning
from planlang.geometry import Pose
from planlang.ontology import Literal, Ontology, Triple, expand
from sim import Body

OBSTACLE = "mapped obstacle"
"""Name of a body made from sensor data, followed by its number."""
UPRIGHT = 0.9999
"""Least cosine of the angle between up and the z axis of a file's frame: just below one degree."""
CELL = 0.05
"""Edge of the cells into which points are binned [m]."""
FAR = 0.2
"""Joining obstacles over gaps of this length may block a robot's way: a warning instead of a note [m]."""


def with_obstacles(bodies: Sequence[Body], semantic_map: SemanticMap, notes: list[Diagnostic]) -> list[Body]:
    """Add boxes that cover sensor data which no body of the map explains.

    Files that are missing or cannot be read are skipped, with a diagnostic in ``notes``.
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
    for iri in ontology.individuals(expand("Map")):
        for triple in ontology.said(iri, "linkToMapFile"):
            if not isinstance(triple.object, Literal):
                continue
            path, problem = _file(triple, triple.object.value.strip())
            if path is not None and path.suffix.lower() not in _READERS:
                problem = f"only {', '.join(_READERS)} can be read"
            if problem:
                message = f"the map {local_name(iri)} is ignored: {problem}: {triple.object.value[:200]}"
                notes.append(note("M025", message, triple.span))
            elif path is not None:
                yield path, poses.pose(iri) or Pose((0.0, 0.0, 0.0))


def _file(triple: Triple, link: str) -> tuple[Path | None, str]:
    """Resolve a link to a file in the folder of the map; None with a reason otherwise."""
    folder, is_elsewhere = Path(triple.span.file).parent, "://" in link or link.startswith("//")
    try:
        path = (folder / (Path(link).name if is_elsewhere else link)).resolve()  # `planlang pull` puts it there
        if not path.is_relative_to(folder.resolve()):
            return None, "it is outside the folder of the map"
        if path.is_file():
            return path, ""
        return None, "URLs are not fetched, and there is no copy beside the map" if is_elsewhere else "file not found"
    except (OSError, ValueError):
        return None, "this is not a file name"


def _boxes(path: Path, frame: Pose, bodies: Sequence[Body], notes: list[Diagnostic]) -> list[Box]:
    """Cover what a file in a frame shows and no body explains with boxes."""
    if frame.rotation[2, 2] < UPRIGHT:
        message = "these obstacles are ignored: the z axis of their frame is not vertical"
        notes.append(warning("M024", message, Span(str(path))))
        return []
    try:
        boxes, apart = _READERS[path.suffix.lower()](path).within(frame).boxes(bodies)
    except BadInput as bad:
        notes += (warning(one.code, one.message, one.span) for one in bad.diagnostics if one.severity is Severity.ERROR)
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
