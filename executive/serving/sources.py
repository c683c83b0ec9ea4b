"""Contents as lines of a page, with the compiler's diagnostics at the lines that they are about."""

from __future__ import annotations

from collections.abc import Sequence

from planlang.diagnostics import BadInput, Diagnostic
from planlang.files import decode
from planlang.records import dataclass

LARGEST_SHOWN = 1_000_000
"""Bytes of a content that is shown, drawn and compared with robots unasked; larger ones are downloaded."""
MOST_SHOWN = 100
"""Diagnostics of one page."""
_LONGEST, _AROUND = 500, 3


@dataclass(frozen=True, slots=True)
class Line:
    """A line of a content, numbered from 1. ``follows_gap``: lines are left out before it."""

    number: int
    text: str
    diagnostics: tuple[Diagnostic, ...] = ()
    follows_gap: bool = False


def text_of(data: bytes) -> str | None:
    """Return a content as text with plain line ends; None if it is none, or too large to be shown."""
    if len(data) > LARGEST_SHOWN:
        return None
    try:
        return decode(data, "content").replace("\r\n", "\n").replace("\r", "\n")
    except BadInput:
        return None


def lines_of(text: str) -> tuple[Line, ...]:
    """Return all lines of a text."""
    return tuple(Line(number, line[:_LONGEST]) for number, line in enumerate(text.split("\n"), 1))


def is_own(diagnostic: Diagnostic) -> bool:
    """Return True for what is said of a line of the upload: files of its vocabulary have paths."""
    return diagnostic.span is not None and "/" not in diagnostic.span.file


def lines_with(text: str, diagnostics: Sequence[Diagnostic]) -> tuple[Line, ...]:
    """Return the lines that diagnostics are about, with these, and some lines around."""
    said: dict[int, list[Diagnostic]] = {}
    for one in diagnostics:
        if one.span is not None and is_own(one):
            said.setdefault(one.span.line, []).append(one)
    lines = lines_of(text)
    near = {number + by for number in said for by in range(-_AROUND, _AROUND + 1)}
    found: list[Line] = []
    for line in lines:
        if line.number in near:
            gap = line.number > (found[-1].number if found else 0) + 1
            found.append(Line(line.number, line.text, tuple(said.get(line.number, ())), gap))
    return tuple(found)
