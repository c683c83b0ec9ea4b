"""The world in a recording for the rerun viewer: static shapes, and poses over time in named frames.

Importing it needs the package rerun-sdk.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import rerun
from numpy.typing import NDArray

from executive.pictures.drawn import Drawn, Shape
from executive.pictures.pose_track import Tracks
from executive.pictures.solids import Solid, vertex_normals
from planlang.geometry import IDENTITY, Array, Pose
from planlang.geometry.matrices import moved, rotated
from planlang.geometry.shapes import SolidKind
from planlang.records import dataclass

TIME_LINE = "plan time"
"""Name of the only time line, in seconds of plan time."""
MAP = "map"
"""Root frame, in which the viewer displays the scene."""
TRUTH, BELIEF, CANDIDATES = "truth", "belief", "candidates"
"""Root entities: the true world, the robot's belief, and candidate base poses and grasps."""
GHOST = 90
"""Opacity of believed bodies, 0..255."""
GONE = 1e-6
"""Scale of entities that do not exist: invisibly small, since the viewer reports a scale of 0 as an error."""


@dataclass(frozen=True, slots=True)
class Keyframe:
    """Pose in a frame from a world step on; None if the entity does not exist then."""

    step: int
    frame: str
    pose: Pose | None


def stream_to(path: Path, title: str, blueprint: Any) -> rerun.RecordingStream:
    """Open a recording into a file, for a world with z up."""
    stream = rerun.RecordingStream("planlang", recording_id=title, send_properties=False)
    stream.save(path, default_blueprint=blueprint)
    stream.log("/", rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    stream.log(TRUTH, rerun.CoordinateFrame(MAP), static=True)
    return stream


def times(steps: Sequence[int] | NDArray[np.int64], rate: int) -> rerun.TimeColumn:
    """Convert world steps to a column of plan time."""
    return rerun.TimeColumn(TIME_LINE, duration=np.asarray(steps, float) / rate)


def frame_of(path: Sequence[str]) -> str:
    """Name of the frame of a path; the empty path is the map."""
    return "/".join(path) or MAP


def entity_of(root: str, path: Sequence[str]) -> str:
    """Entity of a path. Entities are not nested, since frames define the kinematic tree."""
    return "/".join(rerun.escape_entity_path_part(part) for part in (root, path[0], " ".join(path[1:])))


def draw(stream: rerun.RecordingStream, entity: str, frame: str, shapes: Sequence[Shape]) -> None:
    """Write shapes in a frame as static data."""
    stream.log(entity, rerun.CoordinateFrame(frame), *_drawings(shapes), static=True)


def place(stream: rerun.RecordingStream, entity: str, frame: str, keyframes: Sequence[Keyframe], rate: int) -> None:
    """Write the poses of a frame over time; a frame that never moves is static."""
    poses = [keyframe.pose or IDENTITY for keyframe in keyframes]
    columns: dict[str, Any] = {
        "translation": np.array([pose.position for pose in poses]),
        "quaternion": np.array([pose.orientation for pose in poses]),
        "child_frame": [frame] * len(keyframes),
        "parent_frame": [keyframe.frame for keyframe in keyframes],
    }
    if not all(keyframe.pose for keyframe in keyframes):
        columns["scale"] = np.array([[1.0 if keyframe.pose else GONE] * 3 for keyframe in keyframes])
    if len(keyframes) == 1 and keyframes[0].pose is not None:
        stream.log(entity, rerun.Transform3D(**{name: column[0] for name, column in columns.items()}), static=True)
        return
    steps = [keyframe.step for keyframe in keyframes]
    stream.send_columns(entity, indexes=[times(steps, rate)], columns=rerun.Transform3D.columns(**columns))


def record_truth(stream: rerun.RecordingStream, drawn: Sequence[Drawn], tracks: Tracks, rate: int) -> None:
    """Write all entities and their poses over time, including frames without shapes, which have children."""
    shapes = {thing.path: thing.shapes for thing in drawn}
    for path, track in tracks.items():
        entity, frame = entity_of(TRUTH, path), frame_of(path)
        parent = frame_of(track.frame)
        keyframes = [Keyframe(step, parent, pose) for step, pose in zip(track.steps, track.poses, strict=True)]
        if path in shapes:
            draw(stream, entity, frame, shapes[path])
        place(stream, entity, frame, keyframes, rate)


def record_belief(
    stream: rerun.RecordingStream, shapes: Sequence[Shape], name: str, keyframes: Sequence[Keyframe], rate: int
) -> None:
    """Write the believed poses of a thing as a translucent copy of it."""
    ghosts = [replace(shape, colour=(*shape.colour[:3], GHOST)) for shape in shapes]
    entity, frame = entity_of(BELIEF, ("bodies", name)), frame_of((BELIEF, name))
    draw(stream, entity, frame, ghosts)
    place(stream, entity, frame, keyframes, rate)


def record_robot(stream: rerun.RecordingStream, drawn: Sequence[Drawn]) -> None:
    """Write the links of a robot at their current poses in the map, as static data."""
    for thing in drawn:
        entity, frame = entity_of(TRUTH, thing.path), frame_of(thing.path)
        draw(stream, entity, frame, thing.shapes)
        place(stream, entity, frame, [Keyframe(0, MAP, thing.pose())], 1)


def _drawings(shapes: Sequence[Shape]) -> list[Any]:
    """Convert shapes to one archetype of rerun for each kind."""
    drawings: list[Any] = []
    for kind in ("box", "cylinder", "sphere"):
        of_kind = [shape for shape in shapes if shape.kind == kind]
        if not of_kind:
            continue
        sizes = np.array([shape.size for shape in of_kind])
        common = {
            "centers": np.array([shape.pose.position for shape in of_kind]),
            "quaternions": np.array([shape.pose.orientation for shape in of_kind]),
            "colors": np.array([shape.colour for shape in of_kind], dtype=np.uint8),
            "fill_mode": "solid",
        }
        match kind:
            case SolidKind.BOX:
                drawing: Any = rerun.Boxes3D(sizes=sizes, **common)
            case SolidKind.CYLINDER:
                drawing = rerun.Cylinders3D(lengths=sizes[:, 2], radii=sizes[:, 0] / 2, **common)
            case _:
                drawing = rerun.Ellipsoids3D(half_sizes=sizes / 2, **common)
        drawings.append(drawing)
    meshes = [(shape, shape.mesh) for shape in shapes if shape.mesh is not None]
    if meshes:
        drawings.append(_mesh(meshes))
    return drawings


def _mesh(meshes: Sequence[tuple[Shape, Solid]]) -> rerun.Mesh3D:
    """Merge meshes in the frame of their body or link."""
    points, normals, triangles, colours, count = [], [], [], [], 0
    for shape, mesh in meshes:
        points.append(moved(shape.pose.matrix(), mesh.vertices))
        normals.append(rotated(shape.pose.rotation, vertex_normals(mesh.vertices, mesh.faces)))
        triangles.append(mesh.faces + count)
        colours.append(np.tile(np.array(shape.colour, np.uint8), (len(mesh.vertices), 1)))
        count += len(mesh.vertices)
    vertex_colours = np.concatenate(colours)
    is_plain = bool((vertex_colours == vertex_colours[0]).all())
    return rerun.Mesh3D(
        vertex_positions=_rounded(np.concatenate(points), 12),
        vertex_normals=_rounded(np.concatenate(normals), 5),
        triangle_indices=np.concatenate(triangles).astype(np.uint32),
        vertex_colors=None if is_plain else vertex_colours,
        albedo_factor=vertex_colours[0] if is_plain else None,
    )


def _rounded(values: Array, bits: int) -> NDArray[np.float32]:
    """Round values to ``bits`` binary places; trailing zero bits compress well."""
    return np.ldexp(np.round(np.ldexp(values, bits)), -bits).astype(np.float32)
