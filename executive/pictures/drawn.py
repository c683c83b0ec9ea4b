"""Drawable form of a world, for pictures and recordings: shapes grouped by the body or link that they move with."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import lru_cache, partial
from importlib.util import find_spec
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from executive.pictures.figures import limb_pieces, still_pieces
from executive.pictures.links import Look, looks_of_links
from executive.pictures.looks import BEVEL, Piece, Rgba, colour_of, colours, look_of, pieces_of
from executive.pictures.solids import Solid, box, shaded
from planlang.diagnostics import Diagnostic, error
from planlang.extras import install_command
from planlang.geometry import Pose
from planlang.geometry.shapes import Size, SolidKind
from planlang.records import dataclass
from planlang.words import Option, Text
from sim.bodies import Color, Part
from sim.scene import Body, BodyShape

if TYPE_CHECKING:
    from sim import PlanningWorld
    from sim.truth import Truth

HERE = Pose((0.0, 0.0, 0.0))
GREY: Rgba = (172, 174, 178, 255)
_WHITE: Rgba = (255, 255, 255, 255)
_WALL: Rgba = (236, 234, 226, 255)
_FLOOR: Rgba = (190, 184, 172, 255)
_LOW = 0.12
"""Height of cut-off walls [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """Triangle mesh in the frame of its shape [m].

    Vertices are duplicated along sharp edges, so that the mean normal of the faces around a vertex is that of the
    surface.
    """

    vertices: NDArray[np.float32]
    """(n, 3)"""
    triangles: NDArray[np.int32]
    """(m, 3): indices of vertices, counterclockwise seen from outside."""


@dataclass(frozen=True, slots=True)
class Shape:
    """A primitive or a mesh, posed in the frame of its body or link."""

    kind: str
    """"box", "cylinder" (axis along z), "sphere" or "mesh"."""
    size: tuple[float, float, float]
    """Extents along x, y and z [m]; for a mesh those of its bounding box."""
    pose: Pose = HERE
    colour: tuple[int, int, int, int] = GREY
    """Red, green, blue and opacity, 0..255."""
    mesh: Mesh | None = None
    """Surface of a shape of kind "mesh"."""
    outward: tuple[float, float, float] | None = None
    """For walls, the direction away from the room, in the frame of the body."""


@dataclass(frozen=True, slots=True)
class Drawn:
    """Shapes of a body, limb or link, which move together. A path that extends another one is a child of it."""

    path: tuple[str, ...]
    shapes: tuple[Shape, ...]
    pose: Callable[[], Pose]
    """Computes the current pose in the parent's frame, or in the map."""


def drawn_in(world: Truth | PlanningWorld, *, walls: bool = False) -> tuple[Drawn, ...]:
    """Collect all bodies of a world, with people's limbs one by one, and the links of its robot.

    Walls are cut off at a low height so that one can look into rooms. With ``walls`` they are complete, and the caller
    leaves out those between the viewer and the room.
    """
    drawn: list[Drawn] = []
    for name in world.names():
        drawn += _body(world, world.scene.body(name), walls=walls)
    for link, looks in looks_of_links(world.robot).items() if world.has_robot else ():
        shapes = tuple(_link(look) for look in looks)
        drawn.append(Drawn(("robot", link), shapes, partial(world.link_pose, link)))
    return tuple(drawn)


def _body(world: Truth | PlanningWorld, body: Body, *, walls: bool) -> Iterator[Drawn]:
    """Yield a body, then its limbs."""
    path, parts = ("bodies", body.name), [part for part, _ in world.pieces(body.name)]
    match body.shape:
        case BodyShape.MARKER:
            return
        case BodyShape.PERSON:
            still = still_pieces([part for part in parts if not part.limb])
            shapes = [_surface(piece, pose=pose) for pose, pieces in still for piece in pieces]
        case BodyShape.ROOM:
            shapes = [_wall(part, whole=walls) if part.outward is not None else _part(part, _FLOOR) for part in parts]
        case _:
            shapes = list(_thing(body, parts))
    yield Drawn(path, tuple(shapes), partial(world.pose, body.name))
    limbs = [k for k, part in enumerate(parts) if part.limb]
    for order, k in enumerate(limbs):  # the right arm comes first
        pieces = limb_pieces(parts[k], -1 if 2 * order < len(limbs) else 1)
        yield Drawn((*path, f"limb{k}"), tuple(map(_surface, pieces)), partial(_limb, world, body.name, k))


def _limb(world: Truth | PlanningWorld, name: str, k: int) -> Pose:
    return world.pieces(name)[k][1]


def _thing(body: Body, parts: Sequence[Part]) -> Iterator[Shape]:
    """Yield the shapes of a thing or a piece of furniture: the look of its class, or its parts if it has cavities."""
    look = look_of(body.kinds, body.type)
    colour = colour_of(look) if body.color is None else _bytes(body.color)
    handles = {handle.pose for handle in body.handles}
    if body.cavities or (look is None and (len(parts) > 1 or body.shape is not BodyShape.BOX)):
        yield from (_part(part, colour) for part in parts if part.offset not in handles)
    else:
        for piece in pieces_of(look, body.size):
            yield _surface(piece, colour, Pose(body.centre))
    for handle in body.handles:
        yield _part(Part(SolidKind.BOX, handle.size, handle.pose), colours()["knob"])


def _surface(piece: Piece, colour: Rgba = GREY, pose: Pose = HERE) -> Shape:
    return _mesh(piece.solid, piece.colour or colour, pose)


def _mesh(solid: Solid, colour: Rgba, pose: Pose) -> Shape:
    size, mesh = _mesh_of(solid)
    return Shape(SolidKind.MESH, size, pose, colour, mesh)


@lru_cache(maxsize=512)
def _mesh_of(solid: Solid) -> tuple[Size, Mesh]:
    """Convert a solid, which things of a class share."""
    low, high = solid.vertices.min(axis=0), solid.vertices.max(axis=0)
    x, y, z = (2 * np.maximum(-low, high)).tolist()
    return (x, y, z), Mesh(solid.vertices.astype(np.float32), solid.faces.astype(np.int32))


def _part(part: Part, colour: Rgba) -> Shape:
    """Convert a primitive of the world; boxes get rounded edges."""
    colour = colour if part.color is None else _bytes(part.color)
    if part.kind == SolidKind.BOX:
        return _mesh(_bevelled(part.size), colour, part.offset)
    x = max(part.size[:2])
    return Shape(part.kind, (x, x, x if part.kind == SolidKind.SPHERE else part.size[2]), part.offset, colour)


@lru_cache(maxsize=256)
def _bevelled(size: Size) -> Solid:
    return shaded([box(size, min(BEVEL * min(size), 0.01))])


def _wall(part: Part, *, whole: bool) -> Shape:
    wall = Shape(SolidKind.BOX, part.size, part.offset, _WALL, outward=part.outward)
    return wall if whole else lowered(wall)


def lowered(wall: Shape) -> Shape:
    """Cut off a wall at a low height."""
    x, y, z = wall.size
    low = min(_LOW, z)
    return replace(wall, size=(x, y, low), pose=wall.pose @ Pose((0.0, 0.0, (low - z) / 2)))


def _link(look: Look) -> Shape:
    colour = GREY if look.colour in (None, _WHITE) else look.colour
    if look.surface is not None:
        return _mesh(look.surface, colour, look.pose)
    return Shape(look.kind, look.size, look.pose, colour)


def _bytes(color: Color) -> Rgba:
    red, green, blue, opacity = (round(255 * share) for share in color)
    return red, green, blue, opacity


def missing() -> list[Diagnostic]:
    """Report an error (C012) if the package for recordings is not installed."""
    if find_spec("rerun") is not None:
        return []
    advice = Text(f"{install_command('record')}, or leave out ", Option("record"))
    return [error("C012", "a recording needs the package rerun-sdk, which is not installed", help=advice)]
