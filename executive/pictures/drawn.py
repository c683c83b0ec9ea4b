"""Drawable form of a world, for pictures and recordings: shapes grouped by the body or link that they move with.

Links have the primitives and meshes of the robot's URDF, with the colours of its materials. People have legs with feet,
a trunk with a neck, a head with a face, arms and hands; each roughly fills the primitive that represents it in the
world (:mod:`sim.people`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import lru_cache, partial
from typing import TYPE_CHECKING
from xml.etree.ElementTree import Element

import numpy as np

from executive.pictures.looks import BEVEL, Piece, Rgba, colour_of, colours, look_of, pieces_of
from executive.pictures.solids import Solid, ball, box, lathe, shaded, tube
from planlang.geometry import IDENTITY, Array, Pose
from planlang.geometry.mesh import mesh_of
from planlang.geometry.shapes import Size, SolidKind
from planlang.geometry.urdf import origin_of
from planlang.geometry.urdf_schema import numbers
from planlang.geometry.xml_tree import tree_of
from planlang.records import dataclass
from sim.bodies import Color, Part
from sim.scene import Body, BodyShape

if TYPE_CHECKING:
    from sim import PlanningWorld
    from sim.robot import Robot
    from sim.truth import Truth


MOST_TRIANGLES = 1500
"""Triangles above which a mesh is simplified."""
CELLS = 48
"""Initial number of grid cells along the longest side for vertex clustering; reduced until the mesh is small enough."""

GREY: Rgba = (172, 174, 178, 255)


@dataclass(frozen=True, slots=True)
class Shape:
    """A primitive or a mesh, posed in the frame of its body or link."""

    kind: str
    """"box", "cylinder" (axis along z), "sphere" or "mesh"."""
    size: Size
    """Extents along x, y and z [m]; for a mesh those of its bounding box."""
    pose: Pose = IDENTITY
    colour: Rgba = GREY
    """Red, green, blue and opacity, 0..255."""
    mesh: Solid | None = None
    """Surface of a shape of kind "mesh", whose vertices are duplicated along sharp edges."""
    outward: tuple[float, float, float] | None = None
    """For walls, the direction away from the room, in the frame of the body."""
    raised: float = 0.0
    """For walls, the height above the floor at which they begin [m]: lintels of doors and windows hang."""


def looks_of_links(robot: Robot) -> dict[str, list[Shape]]:
    """Visual shapes of each link; links without any get their collision shapes."""
    root = tree_of(robot.description.text.encode())
    materials = {one.get("name", ""): _colour_of(one) for one in root.iter("material") if one.find("color") is not None}
    by_link: dict[str, list[Shape]] = {}
    for link in root.iterfind("link"):
        looks = [look for visual in link.iterfind("visual") for look in _looks(visual, robot, materials)]
        if looks:
            by_link[link.get("name", "")] = looks
    for number, name in enumerate(robot.solid_names):
        if name not in by_link:
            by_link[name] = [
                Shape(SolidKind.BOX if kind == SolidKind.MESH else kind, size, pose)
                for kind, size, pose in robot.shapes(number)
            ]
    return by_link


def _looks(visual: Element, robot: Robot, materials: dict[str, Rgba | None]) -> Iterator[Shape]:
    shape, material = visual.find("geometry/*"), visual.find("material")
    if shape is None:
        return
    pose = Pose.from_matrix(origin_of(visual))
    stated = None if material is None else _colour_of(material) or materials.get(material.get("name", ""))
    colour = GREY if stated in (None, _WHITE) else stated
    if shape.tag == "mesh":
        name = shape.get("filename", "")
        content = robot.description.meshes.get(name)
        if content is None:
            return
        scale = numbers(shape.get("scale", "1 1 1"))
        yield _mesh(_triangles(content, "." + name.rpartition(".")[2], (scale[0], scale[1], scale[2])), colour, pose)
        return
    size = _extents(shape)
    if size is not None:
        kind = SolidKind.CYLINDER if shape.tag == "capsule" else SolidKind(shape.tag)
        yield Shape(kind, size, pose, colour)


def _extents(shape: Element) -> Size | None:
    if shape.tag == "box":
        x, y, z = numbers(shape.get("size", "0 0 0"))
        return x, y, z
    radius, length = (numbers(shape.get(name, "0"))[0] for name in ("radius", "length"))
    if shape.tag == "sphere":
        return 2 * radius, 2 * radius, 2 * radius
    return (2 * radius, 2 * radius, length) if shape.tag in ("cylinder", "capsule") else None


def _colour_of(material: Element) -> Rgba | None:
    color = material.find("color")
    if color is None:
        return None
    red, green, blue, opacity = (round(255 * min(max(value, 0.0), 1.0)) for value in numbers(color.get("rgba", "")))
    return red, green, blue, opacity


@lru_cache(maxsize=256)
def _triangles(content: bytes, suffix: str, scale: tuple[float, float, float]) -> Solid:
    mesh = mesh_of(content, suffix)
    faces = np.concatenate(mesh.parts)
    if np.prod(scale) < 0:  # a mirrored mesh would be inside out
        faces = faces[:, ::-1]
    return shaded([fewer(Solid(mesh.vertices * np.array(scale), faces))])


def fewer(solid: Solid) -> Solid:
    """Simplify a surface to at most :data:`MOST_TRIANGLES` by vertex clustering (J. Rossignac and P. Borrel, 1993).

    Vertices in the same cell of a grid are replaced by their mean. Equal vertices are always merged.
    """
    low = solid.vertices.min(axis=0)
    longest = max(float((solid.vertices.max(axis=0) - low).max()), 1e-9)
    cells: float = 1 << 20  # so fine that only equal vertices are merged
    while True:
        simplified = _clustered(solid, low, longest / cells)
        if len(simplified.faces) <= MOST_TRIANGLES:
            return simplified
        cells = CELLS * 2 if cells > 2 * CELLS else cells * 0.8


def _clustered(solid: Solid, low: Array, cell: float) -> Solid:
    keys = np.floor((solid.vertices - low) / cell).astype(np.int64)
    numbered = (keys[:, 0] * (1 << 21) + keys[:, 1]) * (1 << 21) + keys[:, 2]
    cluster = np.unique(numbered, return_inverse=True)[1]
    counts = np.bincount(cluster)
    vertices = np.column_stack([np.bincount(cluster, solid.vertices[:, k]) / counts for k in range(3)])
    faces = cluster[solid.faces]
    degenerate = (faces[:, 0] == faces[:, 1]) | (faces[:, 1] == faces[:, 2]) | (faces[:, 2] == faces[:, 0])
    faces = faces[~degenerate]
    # with the smallest index first, equal triangles have equal rows
    rotated = np.take_along_axis(faces, (faces.argmin(axis=1)[:, None] + np.arange(3)) % 3, axis=1)
    _, kept = np.unique(rotated, axis=0, return_index=True)
    return Solid(vertices, faces[np.sort(kept)])


SKIN: Rgba = (224, 172, 138, 255)
HAIR: Rgba = (86, 60, 44, 255)
TROUSERS: Rgba = (70, 84, 110, 255)
SHOES: Rgba = (58, 52, 50, 255)
WHITE: Rgba = (250, 250, 250, 255)
PUPIL: Rgba = (46, 38, 34, 255)
LIPS: Rgba = (184, 92, 84, 255)

_TRUNK = [(0.80, 0.0), (0.86, 0.06), (0.78, 0.3), (0.84, 0.55), (1.0, 0.8), (0.98, 0.88), (0.7, 0.97), (0.3, 1.0)]
"""Profile of a trunk: radius as a fraction of the half width, and fraction of the height."""
_ARM = [(0.5, -0.04), (0.95, 0.0), (1.05, 0.08), (1.0, 0.4), (0.86, 0.94), (0.74, 1.0), (0.4, 1.05)]
"""Profile of an upper arm or forearm, starting at the shoulder."""


def still_pieces(parts: Sequence[Part]) -> Iterator[tuple[Pose, tuple[Piece, ...]]]:
    """Yield the pieces of legs, trunk and head, each group with its frame in that of the body."""
    boxes = [part for part in parts if part.kind == SolidKind.BOX]
    *legs, trunk = boxes
    for leg in legs:
        yield leg.offset, _legs(leg, has_feet=leg.size[2] > leg.size[0] or len(legs) == 1)
    yield trunk.offset, _trunk(trunk)
    for head in (part for part in parts if part.kind == SolidKind.SPHERE):
        yield Pose(head.offset.position, trunk.offset.orientation), _head(head.size[0] / 0.2)


def limb_pieces(part: Part, side: int) -> tuple[Piece, ...]:
    """Pieces of a segment of an arm or of a hand, in its frame; ``side`` is 1 for the left arm, -1 for the right."""
    x, y, z = part.size
    if part.kind == SolidKind.CYLINDER:
        arm = lathe(_ARM).moved((x / 2, x / 2, z), (0.0, 0.0, -z / 2))
        return (Piece(shaded([arm]), _colour_of_part(part)),)
    palm = box((0.55 * x, 0.95 * y, 0.8 * z), 0.3 * z).moved(np.ones(3), (-0.2 * x, 0.0, 0.0))
    fingers = [
        tube(np.array([[0.0, at * y, 0.0], [end * x, 1.05 * at * y, -0.1 * z]]), [0.12 * y, 0.1 * y])
        for at, end in ((-0.36, 0.42), (-0.12, 0.52), (0.12, 0.5), (0.36, 0.4))
    ]
    thumb = tube(
        np.array([[-0.35 * x, 0.4 * y, 0.0], [0.02 * x, 0.75 * y, 0.0], [0.15 * x, 0.8 * y, 0.0]]), [0.14 * y] * 3
    )
    thumb = thumb if side < 0 else thumb.mirrored(1)
    return (Piece(shaded([palm, *fingers, thumb]), _colour_of_part(part)),)


def _colour_of_part(part: Part) -> Rgba:
    """Colour of clothes as in the world; colours with more red than blue become that of skin."""
    if part.color is None or part.color[0] > part.color[2]:
        return SKIN
    red, green, blue, _ = (round(255 * share) for share in part.color)
    return red, green, blue, 255


def _legs(part: Part, *, has_feet: bool) -> tuple[Piece, ...]:
    """Pieces of two legs side by side along the longer of x and z, with feet at the far or lower end."""
    x, y, z = part.size
    is_level = x > z
    length, thick = (x, z) if is_level else (z, x)
    radius = min(0.26 * y, 0.55 * thick)
    legs, feet = [], []
    for side in (-0.26 * y, 0.26 * y):
        fractions = [-0.5, -0.46, 0.0, 0.47, 0.5] if has_feet else [-0.52, -0.48, 0.0, 0.44, 0.5]
        radii = [0.6, 1.0, 0.86, 0.62, 0.4] if has_feet else [0.6, 1.0, 0.95, 0.82, 0.5]
        along = [length * fraction for fraction in fractions]
        path = np.array([[at, side, 0.0] if is_level else [0.0, side, -at] for at in along])
        legs.append(tube(path, [radius * factor for factor in radii]))
        if has_feet:
            foot = box((0.95 * radius, 1.1 * radius, 2.3 * radius), 0.45 * radius)
            if not is_level:
                foot = Solid(foot.vertices[:, [2, 1, 0]], foot.faces[:, ::-1])
            ahead, low = 0.55 * radius, length / 2 - 0.48 * radius
            feet.append(foot.moved(np.ones(3), (low, side, ahead) if is_level else (ahead, side, -low)))
    pieces = (Piece(shaded(legs), TROUSERS),)
    return (*pieces, Piece(shaded(feet), SHOES)) if feet else pieces


def _trunk(part: Part) -> tuple[Piece, ...]:
    x, y, z = part.size
    trunk = lathe(_TRUNK).moved((0.55 * x, 0.52 * y, z), (0.0, 0.0, -z / 2))
    neck = tube(np.array([[0.0, 0.0, 0.44 * z], [0.0, 0.0, 0.66 * z]]), [0.24 * x, 0.22 * x])
    return Piece(shaded([trunk]), _colour_of_part(part)), Piece(shaded([neck]), SKIN)


def _head(scale: float) -> tuple[Piece, ...]:
    """Pieces of a head that faces along x; dimensions are those of an adult [m], times ``scale``."""

    def ellipsoid(radii: tuple[float, float, float], at: tuple[float, float, float], around: int = 16) -> Solid:
        return ball(around).moved(np.array(radii) * scale, np.array(at) * scale)

    skin = [
        ellipsoid((0.088, 0.078, 0.108), (0.0, 0.0, 0.0), 24),
        ellipsoid((0.02, 0.014, 0.022), (0.086, 0.0, -0.012)),
    ]
    skin += [ellipsoid((0.018, 0.01, 0.026), (0.0, side * 0.078, -0.008)) for side in (-1, 1)]
    hair = [
        ellipsoid((0.09, 0.086, 0.084), (-0.022, 0.0, 0.04), 24),
        ellipsoid((0.06, 0.078, 0.09), (-0.044, 0.0, -0.004), 24),
    ]
    whites = [ellipsoid((0.01, 0.016, 0.012), (0.076, side * 0.031, 0.016)) for side in (-1, 1)]
    pupils = [ellipsoid((0.008, 0.008, 0.009), (0.0815, side * 0.031, 0.016)) for side in (-1, 1)]
    brows = [ellipsoid((0.006, 0.017, 0.003), (0.0745, side * 0.034, 0.043)) for side in (-1, 1)]
    smile = np.array([[0.07, -0.028, -0.046], [0.077, -0.012, -0.055], [0.077, 0.012, -0.055], [0.07, 0.028, -0.046]])
    lips = [tube(smile * scale, [0.003 * scale, 0.005 * scale, 0.005 * scale, 0.003 * scale], smooth=True)]
    return (
        Piece(shaded(skin), SKIN),
        Piece(shaded([*hair, *brows]), HAIR),
        Piece(shaded(whites), WHITE),
        Piece(shaded(pupils), PUPIL),
        Piece(shaded(lips), LIPS),
    )


_WHITE: Rgba = (255, 255, 255, 255)
_WALL: Rgba = (236, 234, 226, 255)
_FLOOR: Rgba = (190, 184, 172, 255)
_LOW = 0.12
"""Height of cut-off walls [m]."""


@dataclass(frozen=True, slots=True)
class Drawn:
    """Shapes of a body, limb or link, which move together. A path that extends another one is a child of it."""

    path: tuple[str, ...]
    shapes: tuple[Shape, ...]
    pose: Callable[[], Pose]
    """Computes the current pose in the parent's frame, or in the map."""


def drawn_in(world: Truth | PlanningWorld, wall: Callable[[Shape], Shape | None] | None = None) -> tuple[Drawn, ...]:
    """Collect all bodies of a world, with people's limbs one by one, and the links of its robot.

    Walls are as ``wall`` makes them of complete ones, and those left out for which it returns None. By default they are
    :func:`lowered`, so that one can look into rooms.
    """
    drawn: list[Drawn] = []
    for name in world.names():
        drawn += _body(world, world.scene.body(name), wall or lowered)
    for link, looks in looks_of_links(world.robot).items() if world.has_robot else ():
        drawn.append(Drawn(("robot", link), tuple(looks), partial(world.link_pose, link)))
    return tuple(drawn)


def _body(world: Truth | PlanningWorld, body: Body, wall: Callable[[Shape], Shape | None]) -> Iterator[Drawn]:
    """Yield a body, then its limbs."""
    path, parts = ("bodies", body.name), [part for part, _ in world.pieces(body.name)]
    match body.shape:
        case BodyShape.MARKER:
            return
        case BodyShape.PERSON:
            still = still_pieces([part for part in parts if not part.limb])
            shapes = [_surface(piece, pose=pose) for pose, pieces in still for piece in pieces]
        case BodyShape.ROOM:
            made = (_part(part, _FLOOR) if part.outward is None else wall(_wall(part, body)) for part in parts)
            shapes = [shape for shape in made if shape is not None]
        case _:
            shapes = list(_thing(body, parts))
    yield Drawn(path, tuple(shapes), partial(world.pose, body.name))
    limbs = [k for k, part in enumerate(parts) if part.limb]
    for order, k in enumerate(limbs):  # the right arm comes first
        pieces = limb_pieces(parts[k], -1 if 2 * order < len(limbs) else 1)
        yield Drawn((*path, f"limb{k}"), tuple(map(_surface, pieces)), partial(_limb, world, body.name, k))


def _wall(part: Part, room: Body) -> Shape:
    raised = part.offset.position[2] - part.size[2] / 2 + room.size[2] / 2
    return Shape(SolidKind.BOX, part.size, part.offset, _WALL, outward=part.outward, raised=raised)


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


def _surface(piece: Piece, colour: Rgba = GREY, pose: Pose = IDENTITY) -> Shape:
    return _mesh(piece.solid, piece.colour or colour, pose)


def _mesh(solid: Solid, colour: Rgba, pose: Pose) -> Shape:
    x, y, z = (2 * np.abs(solid.vertices).max(axis=0)).tolist()
    return Shape(SolidKind.MESH, (x, y, z), pose, colour, solid)


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


def lowered(wall: Shape) -> Shape | None:
    """Cut off a wall at a low height, above which nothing is left of it."""
    x, y, z = wall.size
    low = min(_LOW - wall.raised, z)
    if low <= 0.0:
        return None
    return replace(wall, size=(x, y, low), pose=wall.pose @ Pose((0.0, 0.0, (low - z) / 2)))


def _bytes(color: Color) -> Rgba:
    red, green, blue, opacity = (round(255 * share) for share in color)
    return red, green, blue, opacity
