"""Visual shapes of a robot's links: the primitives and meshes of its URDF, with the colours of its materials."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import TYPE_CHECKING
from xml.etree.ElementTree import Element

import numpy as np

from executive.pictures.looks import Rgba
from executive.pictures.solids import Solid, shaded
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import rigid, rotation_of
from planlang.geometry.mesh import mesh_of
from planlang.geometry.shapes import Size, SolidKind
from planlang.geometry.urdf import tree_of
from planlang.geometry.urdf_schema import numbers
from planlang.records import dataclass

if TYPE_CHECKING:
    from sim.robot import Robot

MOST_TRIANGLES = 1500
"""Triangles above which a mesh is simplified."""
CELLS = 48
"""Initial number of grid cells along the longest side for vertex clustering; reduced until the mesh is small enough."""


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """A visual shape of a link, in its frame: a primitive with extents [m], or the surface of a mesh."""

    kind: str
    size: Size
    pose: Pose
    colour: Rgba | None = None
    surface: Solid | None = None


def looks_of_links(robot: Robot) -> dict[str, list[Look]]:
    """Visual shapes of each link; links without any get their collision shapes."""
    root = tree_of(robot.description.text.encode())
    materials = {one.get("name", ""): _colour(one) for one in root.iter("material") if one.find("color") is not None}
    by_link: dict[str, list[Look]] = {}
    for link in root.iterfind("link"):
        looks = [look for visual in link.iterfind("visual") for look in _looks(visual, robot, materials)]
        if looks:
            by_link[link.get("name", "")] = looks
    for number, name in enumerate(robot.solid_names):
        if name not in by_link:
            by_link[name] = [
                Look(SolidKind.BOX if kind == SolidKind.MESH else kind, size, pose)
                for kind, size, pose in robot.shapes(number)
            ]
    return by_link


def _looks(visual: Element, robot: Robot, materials: dict[str, Rgba | None]) -> Iterator[Look]:
    shape, origin, material = visual.find("geometry/*"), visual.find("origin"), visual.find("material")
    if shape is None:
        return
    xyz, rpy = (numbers("0 0 0" if origin is None else origin.get(name, "0 0 0")) for name in ("xyz", "rpy"))
    pose = Pose.from_matrix(rigid(rotation_of(*rpy), np.array(xyz)))
    colour = None if material is None else _colour(material) or materials.get(material.get("name", ""))
    if shape.tag == "mesh":
        name = shape.get("filename", "")
        content = robot.description.meshes.get(name)
        if content is None:
            return
        scale = numbers(shape.get("scale", "1 1 1"))
        surface = _surface(content, "." + name.rpartition(".")[2], (scale[0], scale[1], scale[2]))
        x, y, z = (2 * np.abs(surface.vertices).max(axis=0)).tolist()
        yield Look(SolidKind.MESH, (x, y, z), pose, colour, surface)
        return
    size = _extents(shape)
    if size is not None:
        kind = SolidKind.CYLINDER if shape.tag == "capsule" else SolidKind(shape.tag)
        yield Look(kind, size, pose, colour)


def _extents(shape: Element) -> Size | None:
    if shape.tag == "box":
        x, y, z = numbers(shape.get("size", "0 0 0"))
        return x, y, z
    radius, length = (numbers(shape.get(name, "0"))[0] for name in ("radius", "length"))
    if shape.tag == "sphere":
        return 2 * radius, 2 * radius, 2 * radius
    return (2 * radius, 2 * radius, length) if shape.tag in ("cylinder", "capsule") else None


def _colour(material: Element) -> Rgba | None:
    color = material.find("color")
    if color is None:
        return None
    red, green, blue, opacity = (round(255 * min(max(value, 0.0), 1.0)) for value in numbers(color.get("rgba", "")))
    return red, green, blue, opacity


@lru_cache(maxsize=256)
def _surface(content: bytes, suffix: str, scale: tuple[float, float, float]) -> Solid:
    mesh = mesh_of(content, suffix)
    faces = np.concatenate(mesh.parts)
    if np.prod(scale) < 0:  # a mirrored mesh would be inside out
        faces = faces[:, ::-1]
    return shaded([fewer(Solid(mesh.vertices * np.array(scale), faces))])


def fewer(solid: Solid, most: int = MOST_TRIANGLES) -> Solid:
    """Simplify a surface to at most ``most`` triangles by vertex clustering (J. Rossignac and P. Borrel, 1993).

    Vertices in the same cell of a grid are replaced by their mean. Equal vertices are always merged.
    """
    low = solid.vertices.min(axis=0)
    longest = max(float((solid.vertices.max(axis=0) - low).max()), 1e-9)
    cells: float = 1 << 20  # so fine that only equal vertices are merged
    while True:
        simplified = _clustered(solid, low, longest / cells)
        if len(simplified.faces) <= most:
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
