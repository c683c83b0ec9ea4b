"""What pictures and recordings show of a world: primitives that move together, and what a recording needs."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from planlang.diagnostics import Diagnostic, error
from planlang.geometry import Pose
from planlang.geometry.shapes import SolidKind
from planlang.records import dataclass

if TYPE_CHECKING:
    from sim import PlanningWorld
    from sim.bodies import Color, Part
    from sim.truth import Truth

HERE = Pose((0.0, 0.0, 0.0))
GREY = (150, 150, 155, 255)


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """Triangles in the frame of their shape [m], in plain numbers that pictures, pages and recordings all take."""

    vertices: NDArray[np.float32]
    """(n, 3)"""
    triangles: NDArray[np.int32]
    """(m, 3): indices into the vertices, anticlockwise seen from outside."""


@dataclass(frozen=True, slots=True)
class Shape:
    """A primitive or a mesh, placed in the frame of what it belongs to."""

    kind: str
    """"box", "cylinder" (axis along z), "sphere" or "mesh"."""
    size: tuple[float, float, float]
    """Extents along x, y and z [m]; of a mesh those of the box around it."""
    pose: Pose = HERE
    colour: tuple[int, int, int, int] = GREY
    """Red, green, blue and opacity, 0..255."""
    mesh: Mesh | None = None
    """The surface of a shape of kind "mesh"."""


@dataclass(frozen=True, slots=True)
class Drawn:
    """Shapes that move together. A path that continues another's is placed in the frame of that one."""

    path: tuple[str, ...]
    shapes: tuple[Shape, ...]
    pose: Callable[[], Pose]
    """Their current pose, in the map or in the frame of the path that theirs continues."""


def drawn_in(world: Truth | PlanningWorld) -> tuple[Drawn, ...]:
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
    for link, looks in world.looks().items():
        shapes = tuple(_link(*look) for look in looks)
        drawn.append(Drawn(("robot", link), shapes, partial(world.link_pose, link)))
    return tuple(drawn)


def _limb(world: Truth | PlanningWorld, name: str, k: int) -> Pose:
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


def missing() -> list[Diagnostic]:
    """Return an error if recordings cannot be written here, with the command that changes it."""
    if find_spec("rerun") is not None:
        return []
    advice = "pip install 'planlang[record]', or leave out --record"
    return [error("C012", "a recording needs the package rerun-sdk, which is not installed", help=advice)]
