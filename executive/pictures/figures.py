"""Surfaces of people: legs with feet, a trunk with a neck, a head with a face, arms and hands.

Each roughly fills the primitive that represents it in the world (:mod:`sim.people`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from executive.pictures.looks import Piece, Rgba
from executive.pictures.solids import Solid, ball, box, lathe, shaded, tube
from planlang.geometry import Pose
from planlang.geometry.shapes import SolidKind
from sim.bodies import Part

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
        return (Piece(shaded([arm]), _colour(part)),)
    palm = box((0.55 * x, 0.95 * y, 0.8 * z), 0.3 * z).moved(np.ones(3), (-0.2 * x, 0.0, 0.0))
    fingers = [
        tube(np.array([[0.0, at * y, 0.0], [end * x, 1.05 * at * y, -0.1 * z]]), [0.12 * y, 0.1 * y])
        for at, end in ((-0.36, 0.42), (-0.12, 0.52), (0.12, 0.5), (0.36, 0.4))
    ]
    thumb = tube(
        np.array([[-0.35 * x, 0.4 * y, 0.0], [0.02 * x, 0.75 * y, 0.0], [0.15 * x, 0.8 * y, 0.0]]), [0.14 * y] * 3
    )
    thumb = thumb if side < 0 else thumb.mirrored(1, 0.0)
    return (Piece(shaded([palm, *fingers, thumb]), _colour(part)),)


def _colour(part: Part) -> Rgba:
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
    return Piece(shaded([trunk]), _colour(part)), Piece(shaded([neck]), SKIN)


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
