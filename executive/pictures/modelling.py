"""Convert drawable shapes to triangles for the renderer."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from executive.pictures.drawn import Shape
from executive.pictures.solids import Solid, ball, box, lathe, shaded, vertex_normals
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import moved, rotated
from planlang.geometry.shapes import Size, SolidKind
from planlang.records import dataclass

LONGEST = 1.0
"""Longest edge of a triangle [m]: the renderer does not clip, but drops triangles that reach behind the near plane."""

MOST_VIVID = 110
"""Largest difference between red, green and blue of a colour that is not toned down."""


@dataclass(frozen=True, slots=True, eq=False)
class Model:
    """Triangles: ``vertices`` and ``normals`` (n, 3); ``triangles`` (m, 3), ``colours`` (m, 4), ``owners`` (m,)."""

    vertices: Array
    normals: Array
    triangles: NDArray[np.int64]
    colours: NDArray[np.uint8]
    owners: NDArray[np.int64]
    """Number of the shape that a triangle belongs to; outlines are drawn between shapes."""

    def at(self, pose: Pose) -> Model:
        """Transform the model by a pose."""
        return Model(
            moved(pose.matrix(), self.vertices),
            rotated(pose.rotation, self.normals),
            self.triangles,
            self.colours,
            self.owners,
        )

    def only(self, kept: NDArray[np.bool_]) -> Model:
        """Select triangles by a mask (m,)."""
        return Model(self.vertices, self.normals, self.triangles[kept], self.colours[kept], self.owners[kept])


def joined(models: Sequence[Model]) -> Model:
    """Concatenate models."""
    if not models:
        none = np.zeros((0, 3))
        return Model(none, none, none.astype(np.int64), np.zeros((0, 4), np.uint8), np.zeros(0, np.int64))
    first = np.cumsum([0, *(len(model.vertices) for model in models)])
    return Model(
        np.concatenate([model.vertices for model in models]),
        np.concatenate([model.normals for model in models]),
        np.concatenate([model.triangles + start for model, start in zip(models, first, strict=False)]),
        np.concatenate([model.colours for model in models]),
        np.concatenate([model.owners for model in models]),
    )


def model_of(shapes: Iterable[Shape], first: int = 0) -> Model:
    """Triangulate shapes in the frame of their body or link; owners are numbered from ``first``."""
    models = []
    for number, shape in enumerate(shapes, first):
        solid, normals = _triangulated(shape.mesh or (shape.kind, shape.size))
        count = len(solid.faces)
        colours = np.tile(_toned_down(shape.colour), (count, 1))
        model = Model(solid.vertices, normals, solid.faces, colours, np.full(count, number, np.int64))
        models.append(model.at(shape.pose))
    return joined(models)


@lru_cache(maxsize=512)
def _triangulated(shape: Solid | tuple[str, Size]) -> tuple[Solid, Array]:
    """Triangulate a mesh, or a primitive of a kind and size, with the normals of its vertices (n, 3)."""
    solid = _subdivided(shape if isinstance(shape, Solid) else _primitive(*shape))
    return solid, vertex_normals(solid.vertices, solid.faces)


def _toned_down(colour: tuple[int, int, int, int]) -> NDArray[np.uint8]:
    """Desaturate a glaring colour, (4,): URDFs often use pure red, green and blue to distinguish links."""
    rgb = np.array(colour[:3], float)
    glare = max(0.0, (float(rgb.max() - rgb.min()) - MOST_VIVID) / 255)
    return np.array([*(rgb + (rgb.mean() * 0.6 + 90 - rgb) * glare), colour[3]], np.uint8)


def _primitive(kind: str, size: Size) -> Solid:
    x, y, z = size
    if kind == SolidKind.CYLINDER:
        return shaded([lathe([(1, -0.5), (1, 0.5)]).moved((x / 2, y / 2, z), (0, 0, 0))])
    if kind == SolidKind.SPHERE:
        return shaded([ball().moved((x / 2, y / 2, z / 2), (0, 0, 0))])
    return shaded([box(size)])


def _subdivided(solid: Solid) -> Solid:
    """Bisect triangles at their longest edge until no edge is longer than ``LONGEST``."""
    for _ in range(16):
        corners = solid.vertices[solid.faces]
        lengths = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
        long = lengths.max(axis=1) > LONGEST
        if not long.any():
            break
        faces = solid.faces[long]
        turned = np.take_along_axis(faces, (lengths[long].argmax(axis=1)[:, None] + np.arange(3)) % 3, axis=1)
        middles = solid.vertices[turned[:, :2]].mean(axis=1)
        new = len(solid.vertices) + np.arange(len(turned))
        halves = [
            np.column_stack([turned[:, 0], new, turned[:, 2]]),
            np.column_stack([new, turned[:, 1], turned[:, 2]]),
        ]
        solid = Solid(np.vstack([solid.vertices, middles]), np.concatenate([solid.faces[~long], *halves]))
    return solid
