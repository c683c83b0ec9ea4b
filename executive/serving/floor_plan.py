"""Floor plan of a map as an SVG element: outlines of its boxes from above, labelled where there is room."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

import numpy as np

from executive.maps.classes import MapObject
from executive.maps.semantic_map import SemanticMap, read_map
from executive.serving.sources import LARGEST_SHOWN
from executive.serving.uploads import load_upload
from executive.serving.vocabulary import Vocabulary
from executive.serving.workers import Busy, Failed, Workers
from planlang.designators import local_name
from planlang.diagnostics import BadInput
from planlang.geometry import Array
from planlang.geometry.shapes import area, outline_of
from planlang.geometry.shapes import corners as corners_of
from planlang.knowledge.entries import Entry, Kind
from planlang.records import dataclass
from planlang.visible import visible

MOST_THINGS = 2_000
"""Largest number of things drawn."""
WIDTH, HEIGHT, MARGIN = 720, 560, 24
"""Largest size of a drawing, and the margin around it [px]."""
LINE, LETTER = 12, 6
"""Height of a label, and width of a letter [px]."""
ROOM = 0.3
"""Share of the map's area from which on a thing counts as a room or floor, drawn below the others as an outline."""


@dataclass(frozen=True, slots=True)
class _Outlined:
    thing: MapObject
    corners: Array
    """Corners of the outline from above, counterclockwise, shape (n, 2) [m]."""
    top: float
    area: float


def plan_of(entry: Entry, data: bytes, workers: Workers) -> str:
    """Draw a map; empty for other kinds of entries, too large or damaged maps, and while the workers are busy."""
    if entry.kind is not Kind.ENVIRONMENT or len(data) > LARGEST_SHOWN:
        return ""
    try:
        return workers.call(read_plan, entry.uid, data)
    except (BadInput, Failed, Busy):
        return ""


def read_plan(uid: str, data: bytes, vocabulary: Vocabulary) -> str:
    """Read and draw a map, with a note if things were left out. Raises BadInput."""
    environment = read_map(load_upload(uid.partition(".")[2], data, vocabulary), ignore_unread=True)
    drawing, number = floor_plan(environment), len(_boxes(environment))
    if number > MOST_THINGS:
        drawing += f'<p class="hint">Only the first {MOST_THINGS:,} of its {number:,} things are drawn.</p>'
    return drawing


def floor_plan(environment: SemanticMap) -> str:
    """Draw the things of a map that have a pose and a size as an SVG element, x to the right, y upward."""
    drawn = [_outline(thing) for thing in _boxes(environment)[:MOST_THINGS]]
    if not drawn:
        return ""
    corners = np.concatenate([one.corners for one in drawn])
    low, extent = corners.min(axis=0), np.maximum(np.ptp(corners, axis=0), 1e-3)
    scale = min(WIDTH / extent[0], HEIGHT / extent[1])
    width, height = extent * scale + 2 * MARGIN

    def on_page(points: Array) -> Array:
        x, y = ((points - low) * scale + MARGIN).T
        return np.stack([x, height - y], axis=-1)

    is_room = {one.thing.iri: one.area >= ROOM * extent[0] * extent[1] for one in drawn}
    drawn.sort(key=lambda one: (not is_room[one.thing.iri], one.top))
    shapes = [
        _shape(one, on_page(one.corners), environment, "room" if is_room[one.thing.iri] else "thing") for one in drawn
    ]
    parts = {part for one in drawn if not is_room[one.thing.iri] for part in one.thing.parts}
    named = [one for one in reversed(drawn) if one.thing.iri not in parts and not is_room[one.thing.iri]]
    places = ((_name(one.thing, environment), on_page(one.corners)) for one in named)
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" role="img" aria-label="Map from above: {len(drawn)} things" '
        f'viewBox="0 0 {width:.0f} {height + 2 * LINE:.0f}" width="{width:.0f}" height="{height + 2 * LINE:.0f}">'
    )
    return "".join((head, *shapes, *_labels(places), _ruler(scale, height), "</svg>"))


def _boxes(environment: SemanticMap) -> list[MapObject]:
    """Things that have a pose and a size."""
    return [thing for thing in environment.objects if thing.pose is not None and thing.size is not None]


def _outline(thing: MapObject) -> _Outlined:
    """Project a thing's box onto the floor."""
    assert thing.pose is not None
    assert thing.size is not None
    corners = corners_of(thing.pose, thing.size)
    outline = outline_of(corners[:, :2].round(9))
    return _Outlined(thing, outline, float(corners[:, 2].max()), area(outline))


def _shape(one: _Outlined, points: Array, environment: SemanticMap, kind: str) -> str:
    thing = one.thing
    assert thing.size is not None
    size = " x ".join(f"{extent:.2f}" for extent in thing.size)
    classes = ", ".join(map(local_name, thing.types))
    title = escape(visible(f"{_name(thing, environment)}: {classes}, {size} m, top at {one.top:.2f} m"))
    drawn = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    return f'<polygon class="{kind}" points="{drawn}"><title>{title}</title></polygon>'


def _name(thing: MapObject, environment: SemanticMap) -> str:
    return (environment.ontology.label(thing.iri) or thing.name)[:40]


def _labels(places: Iterable[tuple[str, Array]]) -> Iterable[str]:
    """Yield labels centred on outlines or up to two lines beside them; labels that would overlap are left out."""
    placed: list[tuple[float, float, float]] = []
    for name, corners in places:
        half, (x, y) = LETTER * len(name) / 2, (corners.min(axis=0) + corners.max(axis=0)) / 2
        is_small = max(np.ptp(corners, axis=0)) < 2 * LINE  # a label would hide it
        for line in (1, -1, 2, -2) if is_small else (0, 1, -1, 2, -2):
            at = y + line * LINE
            if all(abs(at - other) >= LINE or abs(x - there) >= half + wide for there, other, wide in placed):
                placed.append((x, at, half))
                place = f'x="{x:.1f}" y="{at + LINE / 3:.1f}"'
                yield f'<text class="name" text-anchor="middle" {place}>{escape(visible(name))}</text>'
                break


def _ruler(scale: float, height: float) -> str:
    """Draw a scale bar whose length is 1, 2 or 5 times a power of ten [m]; ``scale`` is in px/m."""
    most = 120 / scale
    decade = 10.0 ** np.floor(np.log10(most) - 1e-9)  # less than most, even if the logarithm was rounded up
    length = max(step * decade for step in (1, 2, 5) if step * decade <= most)
    y, end = height, MARGIN + length * scale
    path = f"M{MARGIN},{y - 4:.1f}v8M{MARGIN},{y:.1f}H{end:.1f}m0,-4v8"
    return f'<path class="order" d="{path}"/><text class="small" x="{end + 6:.1f}" y="{y + 4:.1f}">{length:g} m</text>'
