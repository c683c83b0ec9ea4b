"""Figures of a sweep: goals reached with intervals, worlds not yet reached over plan time, and causes of failure.

Each takes variants by name with the rows of their worlds; a sweep without variants is one variant.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

from executive.sweeps.records import Row, is_reached
from executive.sweeps.table import rows_by_cause
from planlang.proportions import wilson
from planlang.sheets import FAINT, FINE, INK, PAPER, Colour, Sheet, font, hex_of, wrapped
from planlang.visible import visible

Rows = Mapping[str, Sequence[Row]]
"""Variants -> rows of their worlds."""
LINE: Colour = (220, 223, 229)
COLOURS: tuple[tuple[Colour, Colour], ...] = (
    ((36, 89, 196), (138, 180, 255)),
    ((192, 90, 0), (255, 171, 94)),
    ((23, 120, 90), (95, 211, 166)),
    ((138, 63, 176), (209, 155, 255)),
    ((176, 58, 120), (255, 159, 208)),
    ((91, 102, 117), (163, 173, 186)),
    ((122, 92, 18), (220, 200, 114)),
    ((179, 38, 30), (255, 157, 148)),
)
"""Colours of variants, in turn: on white, and on a dark page."""
WIDTH, MARGIN, HEAD = 860, 20, 36
"""Width of a figure, its margins, and the height of its title [pixels]."""
_NAMES, _VALUES = 220, 140
"""Width of the names at the left and of the numbers at the right [pixels]."""
_ROW, _BAR, _PLOT = 24, 14, 260
"""Heights of a row, of a bar with its gap, and of the plot of curves [pixels]."""
MOST_CAUSES = 8
"""Maximum number of causes that are drawn."""
_SMALL, _NORMAL, _LARGE = 12, 13, 16
"""Sizes of text [pixels]."""
_WIDER = 1.2
"""Width of text in fonts with which SVG may be shown, relative to the font of pictures."""


def figure(rows: Rows) -> Sheet:
    """Draw all figures below each other."""
    parts = list(figures(rows))
    whole = Sheet(WIDTH, sum(sheet.image.height for _, sheet in parts) / FINE)
    top = 0
    for _, sheet in parts:
        whole.paste(sheet, (0, top))
        top += sheet.image.height
    return whole


def figures(rows: Rows) -> Iterator[tuple[str, Sheet]]:
    """Yield titles and figures, without those that would be empty."""
    yield _success(rows)
    if any(_times(own) for own in rows.values()):
        yield _survival(rows)
    if any(not is_reached(row) for own in rows.values() for row in own):
        yield _causes(rows)


def style_of(figures_name: str) -> str:
    """CSS that gives figures in an element of this class the colours of a dark page, and of its text and lines."""
    named = {INK: "var(--ink)", FAINT: "var(--faint)", PAPER: "var(--paper)", LINE: "var(--line)"}
    rules = [(f".{figures_name}", colour, value) for colour, value in named.items()]
    rules += [(f".dark .{figures_name}", light, hex_of(dark)) for light, dark in COLOURS]
    return "\n".join(
        f'{where} [{name}="{hex_of(colour)}"] {{ {name}: {value}; }}'
        for where, colour, value in rules
        for name in ("fill", "stroke")
    )


def colour_of(number: int) -> Colour:
    """Colour of a variant by its number."""
    return COLOURS[number % len(COLOURS)][0]


# The figures


def _success(rows: Rows) -> tuple[str, Sheet]:
    """Shares of worlds that reached their goal, with intervals."""
    title = "Worlds in which the goal was reached, with 95 % intervals"
    left, right = MARGIN + _NAMES, WIDTH - MARGIN - _VALUES
    bottom = HEAD + _ROW * len(rows) + 6
    panel = _Panel(title, bottom + 34)
    for percent in range(0, 101, 20):
        x = left + (right - left) * percent / 100
        panel.line((x, HEAD), (x, bottom))
        panel.text((x, bottom + 5), f"{percent} %", _SMALL, FAINT, "ma")
    for number, (name, own) in enumerate(rows.items()):
        y, colour = HEAD + _ROW * (number + 0.5) + 2, colour_of(number)
        count = sum(map(is_reached, own))
        low, high = (left + (right - left) * end for end in wilson(count, len(own)))
        panel.text((MARGIN, y), fitted(name, _NORMAL, _NAMES - 12), _NORMAL, INK, "lm")
        panel.line((low, y), (high, y), colour, 3)
        for end in (low, high):
            panel.line((end, y - 5), (end, y + 5), colour, 2)
        share = 100 * count / len(own) if own else 0.0
        if own:
            panel.disc((left + (right - left) * share / 100, y), 5, colour)
        said = f"{count} of {len(own)}, {share:.1f} %" if own else "no world"
        panel.text((WIDTH - MARGIN, y), said, _NORMAL, INK, "rm")
    return title, panel.sheet


def _survival(rows: Rows) -> tuple[str, Sheet]:
    """Shares of worlds whose goal is not reached yet, over plan time.

    A world that never reaches its goal counts to the end, so that the curve ends at the share of these. To censor it
    there, as the estimator of Kaplan and Meier does, would tell of worlds that might still have been reached.
    """
    title = "Worlds not yet reached, over plan time"
    left, right = MARGIN + 46, WIDTH - MARGIN - 220
    top, bottom = HEAD + 6, HEAD + 6 + _PLOT
    panel = _Panel(title, bottom + 48)
    times = {name: _times(own) for name, own in rows.items()}
    step, number = nice_step(max(own[-1] for own in times.values() if own))
    end = step * number

    def at(time: float, share: float) -> tuple[float, float]:
        return left + (right - left) * time / end, bottom - (bottom - top) * share

    for percent in range(0, 101, 20):
        panel.line(at(0, percent / 100), at(end, percent / 100))
        panel.text((left - 8, at(0, percent / 100)[1]), f"{percent} %", _SMALL, FAINT, "rm")
    for tick in range(number + 1):
        panel.line(at(step * tick, 0), at(step * tick, 1))
        panel.text((at(step * tick, 0)[0], bottom + 5), f"{step * tick:g}", _SMALL, FAINT, "ma")
    panel.text((right, bottom + 22), "plan time [s]", _SMALL, FAINT, "ra")
    ends = []
    for index, (name, own) in enumerate(rows.items()):
        worlds = sum(not is_reached(row) or "duration" in row for row in own)
        if worlds:
            panel.curve([at(*point) for point in curve(times[name], worlds, end)], colour_of(index))
            ends.append((at(end, 1 - len(times[name]) / worlds)[1], index, name))
    labels = spread([y for y, _, _ in sorted(ends)], _ROW - 8, top, bottom)
    for y, (_, index, name) in zip(labels, sorted(ends), strict=True):
        panel.line((right + 10, y), (right + 22, y), colour_of(index), 3)
        panel.text((right + 28, y), fitted(name, _SMALL, WIDTH - MARGIN - right - 28), _SMALL, INK, "lm")
    return title, panel.sheet


def _causes(rows: Rows) -> tuple[str, Sheet]:
    """Causes of failure by frequency, with a bar for each variant."""
    title = "Causes of failure, in worlds"
    variant_of = {id(row): name for name, own in rows.items() for row in own}
    found = rows_by_cause([row for own in rows.values() for row in own])
    drawn, rest = found[:MOST_CAUSES], found[MOST_CAUSES:]
    counts = [Counter(variant_of[id(row)] for row in same) for _, same in drawn]
    wide = WIDTH - 2 * MARGIN
    named = [wrapped(_line(f"{one.name}: {one.sentence}"), _NORMAL, wide * FINE / _WIDER) for one, _ in drawn]
    texts = [[fitted(line, _NORMAL, wide) for line in lines[:2]] for lines in named]
    tall = [18 * len(lines) + _BAR * len(rows) + 12 for lines in texts]
    panel = _Panel(title, HEAD + sum(tall) + (22 if rest else 0) + 8)
    left, right = MARGIN + _NAMES, WIDTH - MARGIN - 40
    most = max(max(own.values()) for own in counts)
    top = float(HEAD)
    for lines, own, height in zip(texts, counts, tall, strict=True):
        for number, line in enumerate(lines):
            panel.text((MARGIN, top + 18 * number), line, _NORMAL)
        for number, name in enumerate(rows):
            y = top + 18 * len(lines) + _BAR * number + 4
            panel.text((left - 8, y + 5), fitted(name, 11, _NAMES - 12), 11, FAINT, "rm")
            length = (right - left) * own[name] / most
            if own[name]:
                panel.box((left, y), (left + length, y + _BAR - 4), colour_of(number))
            panel.text((left + length + 5, y + 5), str(own[name]), 11, FAINT, "lm")
        top += height
    if rest:
        worlds = sum(len(same) for _, same in rest)
        panel.text((MARGIN, top), f"{len(rest)} further causes, in {worlds} worlds", _SMALL, FAINT)
    return title, panel.sheet


class _Panel:
    """A figure with its title; positions and widths are in pixels of the result."""

    def __init__(self, title: str, height: float) -> None:
        self.sheet = Sheet(WIDTH, height)
        self.text((MARGIN, 8), title, _LARGE)

    def text(self, at: tuple[float, float], text: str, size: int, colour: Colour = INK, anchor: str = "la") -> None:
        self.sheet.text((at[0] * FINE, at[1] * FINE), text, size, colour, anchor)

    def line(self, start: tuple[float, float], end: tuple[float, float], colour: Colour = LINE, width: int = 1) -> None:
        self.curve([start, end], colour, width)

    def curve(self, points: Sequence[tuple[float, float]], colour: Colour, width: int = 2) -> None:
        self.sheet.pen.line([(x * FINE, y * FINE) for x, y in points], colour, width * FINE)

    def box(self, corner: tuple[float, float], opposite: tuple[float, float], colour: Colour) -> None:
        (left, top), (right, bottom) = corner, opposite
        self.sheet.pen.rectangle((left * FINE, top * FINE, right * FINE, bottom * FINE), colour)

    def disc(self, at: tuple[float, float], radius: float, colour: Colour) -> None:
        self.sheet.disc((at[0] * FINE, at[1] * FINE), radius * FINE, fill=colour)


# Numbers and texts


def _times(rows: Sequence[Row]) -> list[float]:
    """Plan times at which goals were reached, sorted [s]."""
    return sorted(float(row["duration"]) for row in rows if is_reached(row) and "duration" in row)


def curve(times: Sequence[float], worlds: int, end: float) -> list[tuple[float, float]]:
    """Corners (time [s], share not yet reached) of the curve up to ``end`` for goals reached at sorted ``times``."""
    points = [(0.0, 1.0)]
    for time in dict.fromkeys(times):
        points += [(time, points[-1][1]), (time, 1 - bisect_right(times, time) / worlds)]
    return [*points, (end, points[-1][1])]


def nice_step(longest: float) -> tuple[float, int]:
    """Distance and number of the ticks of an axis from 0 to at least ``longest``: at most eight, at round numbers."""
    unit = 10.0 ** math.floor(math.log10(max(longest, 1e-3) / 8))
    step = next(unit * factor for factor in (1, 2, 5, 10) if longest <= 8 * unit * factor)
    return step, max(1, math.ceil(longest / step))


def spread(places: Sequence[float], gap: float, low: float, high: float) -> list[float]:
    """Move sorted places apart to a distance of ``gap``, from ``low`` to ``high`` if they have room there."""
    found = list[float]()
    for place in places:
        found.append(max(place, found[-1] + gap if found else low))
    limit = max(high, low + gap * (len(found) - 1))
    for index in reversed(range(len(found))):
        found[index] = min(found[index], limit - gap * (len(found) - 1 - index))
    return found


def fitted(text: str, size: int, width: float) -> str:
    """A text in one line of at most ``width`` [pixels]; of a longer one both ends, as names may differ in either."""
    line, letters, room = _line(text), font(size), width * FINE / _WIDER
    if letters.getlength(line) <= room:
        return line

    def ends(length: int) -> str:
        return f"{line[: (length + 1) // 2].rstrip()}...{line[len(line) - length // 2 :].lstrip()}"

    return ends(bisect_right(range(1, len(line)), room, key=lambda length: letters.getlength(ends(length))))


def _line(text: str) -> str:
    return " ".join(visible(text).split())
