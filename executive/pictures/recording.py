"""Recordings for the rerun viewer: primitives of bodies and links, their poses, and events of the plan."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from planlang.diagnostics import BadInput, Diagnostic, error
from planlang.geometry import Pose
from planlang.geometry.shapes import SolidKind
from planlang.records import dataclass

if TYPE_CHECKING:
    import rerun

    from sim.bodies import Color, Part
    from sim.kinematic import KinematicScene

HERE = Pose((0.0, 0.0, 0.0))
GREY = (150, 150, 155, 255)


@dataclass(frozen=True, slots=True)
class Shape:
    """A primitive, placed in the frame of what it belongs to."""

    kind: str
    """"box", "cylinder" (axis along z) or "sphere"."""
    size: tuple[float, float, float]
    """Extents along x, y and z [m]."""
    pose: Pose = HERE
    colour: tuple[int, int, int, int] = GREY
    """Red, green, blue and opacity, 0..255."""


@dataclass(frozen=True, slots=True)
class Drawn:
    """Shapes that move together. A path that continues another's is placed in the frame of that one."""

    path: tuple[str, ...]
    shapes: tuple[Shape, ...]
    pose: Callable[[], Pose]
    """Their current pose, in the map or in the frame of the path that theirs continues."""


def drawn_in(world: KinematicScene) -> tuple[Drawn, ...]:
    """Return all bodies of a world, limbs of people one by one, and the links of its robot. Walls are left out."""
    drawn: list[Drawn] = []
    for name in world.names():
        pieces = [(k, part) for k, (part, _) in enumerate(world.pieces(name)) if part.outward is None]
        color = world.scene.body(name).color
        still = tuple(_piece(part, color, part.offset) for _, part in pieces if not part.limb)
        drawn.append(Drawn(("bodies", name), still, partial(world.pose, name)))
        for k, part in pieces:
            if part.limb:
                drawn.append(
                    Drawn(("bodies", name, f"limb{k}"), (_piece(part, color, HERE),), partial(_limb, world, name, k))
                )
    for link, looks in world.robot.looks().items():
        shapes = tuple(_link(*look) for look in looks)
        drawn.append(Drawn(("robot", link), shapes, partial(world.link_pose, link)))
    return tuple(drawn)


def _limb(world: KinematicScene, name: str, k: int) -> Pose:
    return world.pieces(name)[k][1]


def _piece(part: Part, color: Color | None, pose: Pose) -> Shape:
    colour = _bytes(part.color or color or (0.7, 0.65, 0.55, 1.0))
    x, y, z = part.size
    if part.kind != SolidKind.BOX:
        x = y = max(x, y)
    return Shape(part.kind, (x, y, x if part.kind == SolidKind.SPHERE else z), pose, colour)


def _link(kind: str, size: tuple[float, float, float], pose: Pose, color: Color | None) -> Shape:
    """Return a primitive of a link; around a mesh it is a box."""
    drawn = SolidKind.BOX if kind == SolidKind.MESH else kind
    return Shape(drawn, size, pose, GREY if color is None else _bytes(color))


def _bytes(color: Color) -> tuple[int, int, int, int]:
    red, green, blue, opacity = (round(255 * share) for share in color)
    return red, green, blue, opacity


TIME_LINE = "plan time"
"""Name of the only time line; seconds of plan time."""


def missing() -> list[Diagnostic]:
    """Return an error if recordings cannot be written here, with the command that changes it."""
    if find_spec("rerun") is not None:
        return []
    advice = "pip install 'planlang[record]', or leave out --record"
    return [error("C012", "a recording needs the package rerun-sdk, which is not installed", help=advice)]


class Recording:
    """Poses and events of one run, kept in memory until :meth:`save`.

    A pose is kept only when it differs from the one before, so what never moves costs one row.
    Single log calls cost 50 us each; columns are sent once, at the end.
    """

    def __init__(self, rate: int, drawn: Sequence[Drawn], *, title: str = "planlang run") -> None:
        """Begin a recording with ``rate`` world steps per second; ``drawn`` is what is looked at in every frame.

        Raises BadInput when the package rerun-sdk is not installed.
        """
        problems = missing()
        if problems:
            raise BadInput(problems)
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
        import rerun

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
        import rerun

        return rerun.TimeColumn(TIME_LINE, duration=[step / self._rate for step in steps])


def stream_to(path: Path, title: str, blueprint: Any) -> rerun.RecordingStream:
    """Return a recording into a file, of a world with z up."""
    import rerun

    stream = rerun.RecordingStream("planlang", recording_id=title, send_properties=False)
    stream.save(path, default_blueprint=blueprint)
    stream.log("world", rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    return stream


def placed(stream: rerun.RecordingStream, thing: Drawn, *, still: bool = True) -> str:
    """Draw a thing, the name of its entity; where it is now, if it stays there (``still``)."""
    import rerun

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
    import rerun

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
    from rerun import blueprint

    views = blueprint.Horizontal(
        blueprint.Spatial3DView(origin="world", name="World"),
        blueprint.TextLogView(origin="plan", name="Plan"),
        column_shares=[3, 1],
    )
    return blueprint.Blueprint(views, collapse_panels=True)
