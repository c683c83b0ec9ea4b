"""Files that a map names beside what it states: occupancy grids, points and octrees, which are obstacles.

Nothing is ever fetched, and nothing is read outside the folder of the map's own file.
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
"""The name of a body that a file tells of, before its number."""
UPRIGHT = 0.9999
"""Least cosine of the angle between up and the z axis of a file's frame: a degree."""
CELL = 0.05
"""Length of the cells by which points are told apart [m]."""

FAR = 0.2
"""Obstacles that are joined over gaps of this length may bar the way of a robot [m]."""


def with_obstacles(bodies: Sequence[Body], semantic_map: SemanticMap, found: list[Diagnostic]) -> list[Body]:
    """Return bodies with boxes where the map's files have something that the map does not know.

    What cannot be read or is not here is told, and left out.
    """
    files = _files(semantic_map.ontology, found)
    boxes = [box for path, frame in files for box in _boxes(path, frame, bodies, found)]
    return [
        *bodies,
        *(Body(f"{OBSTACLE} {number}", pose, size) for number, (pose, size) in enumerate(boxes, 1)),
    ]


def _files(ontology: Ontology, found: list[Diagnostic]) -> Iterator[tuple[Path, Pose]]:
    """Yield the files that are there and can be read, each with the pose of its map."""
    poses = PosesOfThings(ontology, found)
    for iri in ontology.individuals(expand("Map")):
        for triple in ontology.said(iri, "linkToMapFile"):
            if not isinstance(triple.object, Literal):
                continue
            path, problem = _file(triple, triple.object.value.strip())
            if path is not None and path.suffix.lower() not in _READERS:
                problem = f"of such files {', '.join(_READERS)} are read"
            if problem:
                message = f"the map {local_name(iri)} is left out: {problem}: {triple.object.value[:200]}"
                found.append(note("M025", message, triple.span))
            elif path is not None:
                yield path, poses.pose(iri) or Pose((0.0, 0.0, 0.0))


def _file(triple: Triple, link: str) -> tuple[Path | None, str]:
    """Return the file that a link means, or why there is none."""
    folder, is_elsewhere = Path(triple.span.file).parent, "://" in link or link.startswith("//")
    try:
        path = (folder / (Path(link).name if is_elsewhere else link)).resolve()  # pulled, it is beside the map
        if not path.is_relative_to(folder.resolve()):
            return None, "it is outside of the map's folder"
        if path.is_file():
            return path, ""
        return None, "files at other places are not fetched" if is_elsewhere else "there is no such file"
    except (OSError, ValueError):
        return None, "this is no name of a file"


def _boxes(path: Path, frame: Pose, bodies: Sequence[Body], found: list[Diagnostic]) -> list[Box]:
    """Return boxes that cover what a file in a frame has and no thing explains."""
    if frame.rotation[2, 2] < UPRIGHT:
        found.append(warning("M024", "a map of obstacles that leans is left out", Span(str(path))))
        return []
    try:
        boxes, apart = _READERS[path.suffix.lower()](path).within(frame).boxes(bodies)
    except BadInput as bad:
        found += (warning(one.code, one.message, one.span) for one in bad.diagnostics if one.severity is Severity.ERROR)
        return []
    if apart > 0:
        told = warning if apart >= FAR else note
        message = f"what is up to {apart:.2g} m apart may be one of its {len(boxes)} obstacles, with what is between"
        found.append(told("M032", message, Span(str(path)), "leave out what is no obstacle, or what the map states"))
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
"""What reads a file, by its suffix."""
