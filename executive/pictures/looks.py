"""Looks of things: coloured solids for a thing's class and size, from the table ``ontologies/looks.toml``."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from functools import cache, lru_cache
from itertools import product
from types import MappingProxyType
from typing import Any

import numpy as np

from executive.pictures.solids import Solid, ball, box, lathe, prism, shaded, tube
from planlang.designators import local_name
from planlang.files import bundled
from planlang.geometry import Array
from planlang.geometry.shapes import Size
from planlang.records import dataclass

Rgba = tuple[int, int, int, int]
"""Red, green, blue and opacity, 0..255."""
AXES = "xyz"
WHOLE = {"x": [0, 1], "y": [0, 1], "z": [0, 1]}
PLAIN = (176, 160, 138, 255)
"""Colour of things without a look and without a colour in the map."""
BEVEL = 0.08
"""Bevel of a thing without a look, as a fraction of its smallest extent."""
TALL = 0.3
"""Height above which a thing gets the look for tall things of its class, if there is one [m]."""
OVER = 0.01
"""How far labels may protrude from the bounding box, as a fraction of its extents; vertices beyond are clamped."""


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """A surface in one colour; None stands for the thing's colour in the map, or else that of its look."""

    solid: Solid
    colour: Rgba | None = None


@cache
def table_of_looks() -> Mapping[str, Mapping[str, Any]]:
    """Looks by name; the comments of the file define its format."""
    text = (bundled("ontologies") / "looks.toml").read_text(encoding="utf-8")
    return MappingProxyType({name: row for name, row in tomllib.loads(text).items() if name != "colours"})


@cache
def colours() -> Mapping[str, Rgba]:
    """Named colours of the table."""
    text = (bundled("ontologies") / "looks.toml").read_text(encoding="utf-8")
    named: Mapping[str, str] = tomllib.loads(text)["colours"]
    return MappingProxyType({name: _rgba(value) for name, value in named.items()})


def _rgba(text: str) -> Rgba:
    red, green, blue, *opacity = bytes.fromhex(text.removeprefix("#"))
    return red, green, blue, opacity[0] if opacity else 255


@cache
def looks_of_classes() -> Mapping[str, str]:
    """Name of the look of each class in the table, by the class's local name."""
    return MappingProxyType({cls: name for name, row in table_of_looks().items() for cls in row["classes"]})


def look_of(kinds: Sequence[str], cls: str = "") -> str | None:
    """Find the look of a thing: that of the nearest of its classes that has one; None if none has.

    ``cls`` is used for things created during a run, which have no list of superclasses from a map.
    """
    known = looks_of_classes()
    return next((known[one] for one in (*kinds, local_name(cls)) if one in known), None)


def colour_of(look: str | None) -> Rgba:
    """Default colour of a look."""
    return PLAIN if look is None else colours()[table_of_looks()[look]["colour"]]


@lru_cache(maxsize=512)
def pieces_of(look: str | None, size: Size) -> tuple[Piece, ...]:
    """Build the pieces of a look, one per colour, in a bounding box of extents ``size`` [m] about the origin."""
    if look is None:
        return (Piece(shaded([box(size, BEVEL * min(size))])),)
    by_colour: dict[Rgba | None, list[Solid]] = {}
    entry = table_of_looks()[look]
    if size[2] > TALL and "tall" in entry:
        entry = table_of_looks()[entry["tall"]]
    for row in entry["pieces"]:
        colour = colours()[row["colour"]] if "colour" in row else None
        for solid in _solids(row, np.array(size)):
            most = np.array(size) * (0.5 + OVER)
            by_colour.setdefault(colour, []).append(Solid(np.clip(solid.vertices, -most, most), solid.faces))
    return tuple(Piece(shaded(solids), colour) for colour, solids in by_colour.items())


def _solids(row: Mapping[str, Any], size: Array) -> Iterator[Solid]:
    """Yield a piece of the table with its copies and mirror images, about the origin."""
    original = _solid(row, size)
    times = row.get("times", {})
    axis = next((k for k, name in enumerate(AXES) if name in times), 0)
    shift = _at(times.get("by", 0), float(size[axis])) * np.eye(3)[axis]
    copies = [original.moved(np.ones(3), shift * k - size / 2) for k in range(times.get(AXES[axis], 1))]
    for solid, turn in product(copies, _mirrorings(row.get("mirror", ""))):
        image = solid
        for k in turn:
            image = image.mirrored(k)
        yield image


def _mirrorings(axes: str) -> list[tuple[int, ...]]:
    """Axes of mirroring for each image; the first, without axes, is the original."""
    numbers = [AXES.index(axis) for axis in axes]
    return [(), *[(k,) for k in numbers], *([tuple(numbers)] if len(numbers) > 1 else [])]


def _solid(row: Mapping[str, Any], size: Array) -> Solid:
    """Build a piece with coordinates relative to the lower corner of the bounding box."""
    least = float(size.min())
    if "tube" in row:
        path = np.array([[_at(value, extent) for value, extent in zip(at, size, strict=True)] for at in row["tube"]])
        values = row["radius"] if isinstance(row["radius"], list) else [row["radius"]] * len(path)
        radii = [_at(value, least) for value in values]
        return tube(path, radii, smooth=row.get("smooth", False), flat=row.get("flat", 1.0))
    ranges = {**WHOLE, **row.get("box", {}), **row.get("ball", {}), **{k: row[k] for k in AXES if k in row}}
    ends = np.array([[_at(value, float(extent)) for value in ranges[k]] for k, extent in zip(AXES, size, strict=True)])
    # a piece given in metres may not fit into a small bounding box; it then shrinks to almost nothing
    low, extents = ends.min(axis=1), np.maximum(np.abs(ends[:, 1] - ends[:, 0]), 1e-4)
    if "box" in row:
        bevel = _at(row.get("round", 0), float(extents.min()))
        return box(extents, bevel).moved(np.ones(3), low + extents / 2)
    if "ball" in row:
        return ball().moved(extents / 2, low + extents / 2)
    axis = AXES.index(row.get("axis", "z"))
    if "lathe" in row:
        along = np.arange(3) == axis
        scales, middle = np.where(along, extents, extents / 2), np.where(along, 0.0, extents / 2)
        return _turned(lathe(row["lathe"]), axis).moved(scales, low + middle)
    outline: Array = np.array(row["prism"], float)
    return _turned(prism(outline[:, ::-1] if AXES[axis] == "y" else outline), axis).moved(extents, low)


def _turned(solid: Solid, axis: int) -> Solid:
    """Rotate z onto an axis by a cyclic permutation of the axes, which preserves orientation."""
    order = [(k - axis - 1) % 3 for k in range(3)]
    return Solid(solid.vertices[:, order], solid.faces)


def _at(value: float | str, extent: float) -> float:
    """Convert a coordinate of the table to metres from the lower end of an extent.

    Numbers are fractions of the extent, texts are metres, from the upper end if negative, and clamped to the extent.
    """
    if not isinstance(value, str):
        return value * extent
    metres = float(value)
    return min(max(extent + metres if value.startswith("-") else metres, 0.0), extent)
