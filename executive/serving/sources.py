"""Contents as numbered lines of a page, with the compiler's diagnostics at their lines."""

from __future__ import annotations

from collections.abc import Sequence

from planlang.diagnostics import BadInput, Diagnostic
from planlang.files import decode
from planlang.records import dataclass

LARGEST_SHOWN = 1_000_000
"""Largest content that is shown, drawn and compared with all robots [bytes]; larger ones can be downloaded."""
MOST_SHOWN = 100
"""Diagnostics of one page."""
_LONGEST, _AROUND = 500, 3


@dataclass(frozen=True, slots=True)
class Line:
    """A line of a content, numbered from 1. ``follows_gap`` is True if lines before it were left out."""

    number: int
    text: str
    diagnostics: tuple[Diagnostic, ...] = ()
    follows_gap: bool = False


def text_of(data: bytes) -> str | None:
    """Decode a content, with line ends as ``\\n``; None if it is no text, or too large to be shown."""
    if len(data) > LARGEST_SHOWN:
        return None
    try:
        return decode(data, "content").replace("\r\n", "\n").replace("\r", "\n")
    except BadInput:
        return None


def lines_of(text: str) -> tuple[Line, ...]:
    """Split a text into numbered lines, long ones cut off."""
    return tuple(Line(number, line[:_LONGEST]) for number, line in enumerate(text.split("\n"), 1))


def is_own(diagnostic: Diagnostic) -> bool:
    """Check whether a diagnostic refers to a line of the upload, not to an imported file (these have directories)."""
    return diagnostic.span is not None and "/" not in diagnostic.span.file


def lines_with(text: str, diagnostics: Sequence[Diagnostic]) -> tuple[Line, ...]:
    """Select the lines with diagnostics, and some lines of context around them."""
    by_line: dict[int, list[Diagnostic]] = {}
    for one in diagnostics:
        if one.span is not None and is_own(one):
            by_line.setdefault(one.span.line, []).append(one)
    near = {number + offset for number in by_line for offset in range(-_AROUND, _AROUND + 1)}
    selected: list[Line] = []
    for line in lines_of(text):
        if line.number in near:
            gap = line.number > (selected[-1].number if selected else 0) + 1
            selected.append(Line(line.number, line.text, tuple(by_line.get(line.number, ())), gap))
    return tuple(selected)
