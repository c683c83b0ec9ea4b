"""The looks of a person's parts: legs with feet, a trunk with a neck, a head with a face, arms and hands.

Each fills about the primitive that stands for it in the world; the primitives are those of :mod:`sim.people`.
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
"""Profile of a trunk: shares of its half width, and of its height."""
_ARM = [(0.5, -0.04), (0.95, 0.0), (1.05, 0.08), (1.0, 0.4), (0.86, 0.94), (0.74, 1.0), (0.4, 1.05)]
"""Profile of an arm's piece, from the shoulder on."""


def still_pieces(parts: Sequence[Part]) -> Iterator[tuple[Pose, tuple[Piece, ...]]]:
    """Yield frames in that of the body, and what is drawn in each, of all that is no arm."""
    boxes = [part for part in parts if part.kind == SolidKind.BOX]
    *legs, trunk = boxes
    for leg in legs:
        yield leg.offset, _legs(leg, has_feet=leg.size[2] > leg.size[0] or len(legs) == 1)
    yield trunk.offset, _trunk(trunk)
    for head in (part for part in parts if part.kind == SolidKind.SPHERE):
        yield Pose(head.offset.position, trunk.offset.orientation), _head(head.size[0] / 0.2)


def limb_pieces(part: Part, side: int) -> tuple[Piece, ...]:
    """Return what is drawn of a piece of an arm, in its frame; ``side`` is 1 for the left one, -1 for the right."""
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
    """Return the colour of clothes as the world has it, and that of skin."""
    if part.color is None or part.color[0] > part.color[2]:
        return SKIN
    red, green, blue, _ = (round(255 * share) for share in part.color)
    return red, green, blue, 255


def _legs(part: Part, *, has_feet: bool) -> tuple[Piece, ...]:
    """Return two legs side by side along the longer of x and z, with feet at the far or lower end."""
    x, y, z = part.size
    is_level = x > z
    length, thick = (x, z) if is_level else (z, x)
    radius = min(0.26 * y, 0.55 * thick)
    legs, feet = [], []
    for side in (-0.26 * y, 0.26 * y):
        shares = [-0.5, -0.46, 0.0, 0.47, 0.5] if has_feet else [-0.52, -0.48, 0.0, 0.44, 0.5]
        radii = [0.6, 1.0, 0.86, 0.62, 0.4] if has_feet else [0.6, 1.0, 0.95, 0.82, 0.5]
        along = [length * share for share in shares]
        path = np.array([[at, side, 0.0] if is_level else [0.0, side, -at] for at in along])
        legs.append(tube(path, [radius * share for share in radii]))
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
    """Return a head that looks along x, of a person of this size."""

    def round_(extents: tuple[float, float, float], at: tuple[float, float, float], around: int = 16) -> Solid:
        return ball(around).moved(np.array(extents) * scale, np.array(at) * scale)

    skin = [round_((0.088, 0.078, 0.108), (0.0, 0.0, 0.0), 24), round_((0.02, 0.014, 0.022), (0.086, 0.0, -0.012))]
    skin += [round_((0.018, 0.01, 0.026), (0.0, side * 0.078, -0.008)) for side in (-1, 1)]
    hair = [
        round_((0.09, 0.086, 0.084), (-0.022, 0.0, 0.04), 24),
        round_((0.06, 0.078, 0.09), (-0.044, 0.0, -0.004), 24),
    ]
    whites = [round_((0.01, 0.016, 0.012), (0.076, side * 0.031, 0.016)) for side in (-1, 1)]
    pupils = [round_((0.008, 0.008, 0.009), (0.0815, side * 0.031, 0.016)) for side in (-1, 1)]
    brows = [round_((0.006, 0.017, 0.003), (0.0745, side * 0.034, 0.043)) for side in (-1, 1)]
    smile = np.array([[0.07, -0.028, -0.046], [0.077, -0.012, -0.055], [0.077, 0.012, -0.055], [0.07, 0.028, -0.046]])
    lips = [tube(smile * scale, [0.003 * scale, 0.005 * scale, 0.005 * scale, 0.003 * scale], smooth=True)]
    return (
        Piece(shaded(skin), SKIN),
        Piece(shaded([*hair, *brows]), HAIR),
        Piece(shaded(whites), WHITE),
        Piece(shaded(pupils), PUPIL),
        Piece(shaded(lips), LIPS),
    )
