"""Recordings for the rerun viewer: primitives of bodies and links, their poses, and events of the plan.

Importing it needs the package rerun-sdk; :func:`executive.pictures.drawn.missing` asks for that before.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import rerun
from rerun import blueprint

from executive.pictures.drawn import Drawn, Shape
from planlang.geometry import Pose
from planlang.geometry.shapes import SolidKind

TIME_LINE = "plan time"
"""Name of the only time line; seconds of plan time."""


class Recording:
    """Poses and events of one run, kept in memory until :meth:`save`.

    A pose is kept only when it differs from the one before, so what never moves costs one row.
    Single log calls cost 50 us each; columns are sent once, at the end.
    """

    def __init__(self, rate: int, drawn: Sequence[Drawn], *, title: str = "planlang run") -> None:
        """Begin a recording with ``rate`` world steps per second; ``drawn`` is what is looked at in every frame."""
        self._rate = rate
        self._title = title
        self._drawn = tuple(drawn)
        self._tracks: list[list[tuple[int, Pose]]] = [[] for _ in self._drawn]
        self._events: list[tuple[int, str]] = []

    def frame(self, step: int) -> None:
        """Keep where everything is after ``step`` world steps."""
        for thing, track in zip(self._drawn, self._tracks, strict=True):
            pose = thing.pose()
            if not track or track[-1][1] != pose:
                track.append((step, pose))

    def event(self, step: int, text: str) -> None:
        """Keep a line about the plan."""
        self._events.append((step, text))

    def save(self, path: Path) -> None:
        """Write the recording."""
        stream = stream_to(path, self._title, _blueprint())
        for thing, track in zip(self._drawn, self._tracks, strict=True):
            entity = placed(stream, thing, still=False)
            if track:
                stream.send_columns(
                    entity,
                    indexes=[self._times([step for step, _ in track])],
                    columns=rerun.Transform3D.columns(
                        translation=np.array([pose.position for _, pose in track]),
                        quaternion=np.array([pose.orientation for _, pose in track]),
                    ),
                )
        if self._events:
            stream.send_columns(
                "plan",
                indexes=[self._times([step for step, _ in self._events])],
                columns=rerun.TextLog.columns(text=[text for _, text in self._events]),
            )
        stream.flush()
        stream.disconnect()

    def _times(self, steps: Sequence[int]) -> rerun.TimeColumn:
        return rerun.TimeColumn(TIME_LINE, duration=[step / self._rate for step in steps])


def stream_to(path: Path, title: str, blueprint: Any) -> rerun.RecordingStream:
    """Return a recording into a file, of a world with z up."""
    stream = rerun.RecordingStream("planlang", recording_id=title, send_properties=False)
    stream.save(path, default_blueprint=blueprint)
    stream.log("world", rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    return stream


def placed(stream: rerun.RecordingStream, thing: Drawn, *, still: bool = True) -> str:
    """Draw a thing, the name of its entity; where it is now, if it stays there (``still``)."""
    entity = "/".join(rerun.escape_entity_path_part(part) for part in ("world", *thing.path))
    for place, drawing in _drawings(entity, thing.shapes):
        stream.log(place, drawing, static=True)
    if still:
        pose = thing.pose()
        where = rerun.Transform3D(translation=pose.position, quaternion=pose.orientation)
        stream.log(entity, where, static=True)
    return entity


def _drawings(entity: str, shapes: Sequence[Shape]) -> list[tuple[str, Any]]:
    """Return one drawing per kind of primitive, each under its own entity below the one that moves."""
    drawings: list[tuple[str, Any]] = []
    for kind in ("box", "cylinder", "sphere"):
        chosen = [shape for shape in shapes if shape.kind == kind]
        if not chosen:
            continue
        sizes = np.array([shape.size for shape in chosen])
        placed = {
            "centers": np.array([shape.pose.position for shape in chosen]),
            "quaternions": np.array([shape.pose.orientation for shape in chosen]),
            "colors": np.array([shape.colour for shape in chosen], dtype=np.uint8),
            "fill_mode": "solid",
        }
        match kind:
            case SolidKind.BOX:
                drawing: Any = rerun.Boxes3D(sizes=sizes, **placed)
            case SolidKind.CYLINDER:
                drawing = rerun.Cylinders3D(lengths=sizes[:, 2], radii=sizes[:, 0] / 2, **placed)
            case _:
                drawing = rerun.Ellipsoids3D(half_sizes=sizes / 2, **placed)
        drawings.append((f"{entity}/{kind}", drawing))
    return drawings


def _blueprint() -> Any:
    """Return the scene beside the plan's events."""
    views = blueprint.Horizontal(
        blueprint.Spatial3DView(origin="world", name="World"),
        blueprint.TextLogView(origin="plan", name="Plan"),
        column_shares=[3, 1],
    )
    return blueprint.Blueprint(views, collapse_panels=True)
