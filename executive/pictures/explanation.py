"""How a resolution came to its places, as a picture: the room from above, a close view of the places, a legend."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

from PIL import Image

from executive.pictures.drawing import FAINT, FINE, INK, Colour, Sheet, wrapped
from executive.pictures.floor_plan import ACCEPTED, REGIONS, SCORES, Bounds, FloorPlan, Resolution, Scenery

WIDTH, LEGEND, MARGIN = 900, 330, 24
"""Widths of the map and of the legend, free border [pixels]."""
TALLEST = 1200
"""Height that the map has at most [pixels]."""
LINE = 22
"""Height of a line of the legend [pixels]."""
CLOSE = 0.45
"""A close view is drawn of places that fill less than this share of the room's width."""
MOST_LISTED = 6
"""Places and bodies that the legend names."""

REASONS: Mapping[str, Colour] = {
    "no room for the base": (165, 165, 165),
    "no room for the object": (165, 165, 165),
    "in collision": (204, 51, 51),
    "out of reach": (235, 140, 30),
    "not visible": (130, 80, 190),
    "too wide for the gripper": (120, 80, 40),
    "": ACCEPTED,
}
"""Reason -> colour of its places; "" of those that were accepted."""
OTHERS: tuple[Colour, ...] = ((110, 175, 205), (215, 150, 185), (150, 165, 110), (140, 140, 190), (110, 185, 180))
"""Colours of other reasons, in the order of their names."""


def save_picture(path: Path, scenery: Scenery, resolution: Resolution) -> None:
    """Write a PNG; raises OSError as writing does."""
    picture(scenery, resolution).save(path, format="PNG")


def picture(scenery: Scenery, resolution: Resolution) -> Image.Image:
    """Title, map and legend, and a close view where the places are near to each other."""
    of = colours([*resolution.counts, *(one.reason for one in resolution.judged), *dict(resolution.refused), ""])
    x_min, y_min, x_max, y_max = scenery.bounds
    scale = min(WIDTH / max(x_max - x_min, 1e-3), TALLEST / max(y_max - y_min, 1e-3))
    near = close_view(scenery, resolution.places)
    plan = FloorPlan(scenery.bounds, scale, scenery, resolution, of).drawn(numbered=1 if near else 99).image
    legend, used = _legend(scenery, resolution, of)
    width = (LEGEND - MARGIN) * FINE
    close = None
    if near is not None:
        close = (
            FloorPlan(near, (LEGEND - MARGIN) / (near[2] - near[0]), scenery, resolution, of).drawn(numbered=99).image
        )
    title = wrapped(resolution.title, 19, plan.width + width)[:3]
    top = (2 * MARGIN + 26 * len(title)) * FINE
    right = used + (0 if close is None else (MARGIN + LINE) * FINE + close.height)
    sheet = Sheet((plan.width + width) / FINE + 3 * MARGIN, (top + max(plan.height, right)) / FINE + MARGIN)
    for number, line in enumerate(title):
        sheet.text((MARGIN * FINE, (MARGIN + 26 * number) * FINE), line, 19)
    sheet.image.paste(plan, (MARGIN * FINE, top))
    left = plan.width + 2 * MARGIN * FINE
    sheet.image.paste(legend.crop((0, 0, width, used)), (left, top))
    if close is not None:
        below = top + used + MARGIN * FINE
        sheet.text((left, below), "close view", 16)
        sheet.image.paste(close, (left, below + LINE * FINE))
    return sheet.finished()


def close_view(scenery: Scenery, places: Sequence[tuple[float, float, float]]) -> Bounds | None:
    """The square around the places; None if there are none, or if they are all over the room."""
    if not places:
        return None
    xs, ys = [x for x, _, _ in places], [y for _, y, _ in places]
    extent = max(max(xs) - min(xs), max(ys) - min(ys)) + 3.2 * scenery.radius + 0.1
    if extent > CLOSE * (scenery.bounds[2] - scenery.bounds[0]):
        return None
    x, y = (max(xs) + min(xs)) / 2, (max(ys) + min(ys)) / 2
    return x - extent / 2, y - extent / 2, x + extent / 2, y + extent / 2


def colours(reasons: Sequence[str]) -> dict[str, Colour]:
    """A colour for every reason, the same whatever else there is of the well-known ones."""
    unknown = sorted(set(reasons) - REASONS.keys())
    return {
        reason: REASONS[reason] if reason in REASONS else OTHERS[unknown.index(reason) % len(OTHERS)]
        for reason in dict.fromkeys(reasons)
    }


def _legend(scenery: Scenery, resolution: Resolution, of: Mapping[str, Colour]) -> tuple[Image.Image, int]:
    """The legend on a sheet that is tall enough, and how much of it is used [pixels of the sheet]."""
    sheet = Sheet(LEGEND, 2400)
    row = 0

    def entry(
        text: str, *, size: int = 14, mark: Colour | None = None, outline: bool = False, faint: bool = False
    ) -> None:
        nonlocal row
        if mark is not None and outline:
            sheet.pen.line((0, row + 9 * FINE, 12 * FINE, row + 9 * FINE), fill=mark, width=2 * FINE)
        elif mark is not None:
            sheet.disc((5 * FINE, row + 9 * FINE), 5 * FINE, fill=mark)
        shift = 18 * FINE if mark is not None else 0
        for part in wrapped(text, size, (LEGEND - MARGIN) * FINE - shift):
            sheet.text((shift, row), part, size, FAINT if faint else INK)
            row += LINE * FINE

    def gap() -> None:
        nonlocal row
        row += LINE * FINE // 2

    places = resolution.places
    entry(f"{len(places)} place{'' if len(places) == 1 else 's'}, best first" if places else "no place", size=16)
    for number, (x, y, yaw) in enumerate(places[:MOST_LISTED], 1):
        said = resolution.details[number - 1] if number <= len(resolution.details) else ""
        entry(f"{number}:  x {x:.3f}  y {y:.3f}  yaw {yaw + 0.0:.2f}  {said}".rstrip())
    gap()
    entry("candidates, by what became of them", size=16)
    taken = sum(one.reason == "" for one in resolution.judged)
    if taken > len(places):
        entry(f"accepted: {taken}, others beside these places", mark=ACCEPTED)
    else:
        entry(f"accepted: {len(places)}", mark=ACCEPTED)
    for reason, number in Counter(resolution.counts).most_common():
        entry(f"{reason}: {number}", mark=of[reason])
    if resolution.blocking:
        gap()
        entry("in the way", size=16)
        for body, number in list(resolution.blocking.items())[:MOST_LISTED]:
            entry(f"{body}: {number}")
    if scenery.regions:
        gap()
        entry("outlines: where a conjunct holds", size=16)
        for number, region in enumerate(scenery.regions):
            entry(region.words, mark=REGIONS[number % len(REGIONS)], outline=True)
    gap()
    entry("score of a candidate", size=16)
    sheet.scale((0, row), (160 * FINE, 12 * FINE), SCORES)
    row += 16 * FINE
    entry("low ... high; where there is none: no candidate", size=12, faint=True)
    entry(
        "ring: outline of what is placed, arrow: its heading; yellow: what is meant; a line for each metre",
        size=12,
        faint=True,
    )
    return sheet.image, row
