"""Three-way merge of texts by lines, as diff3 and git do it.

Lines that neither side changed divide the texts into chunks. A chunk that one side changed is taken from that side; if
both changed it, differently, the result has a conflict with both versions. (S. Khanna, K. Kunal, B. C. Pierce, "A
formal investigation of diff3", 2007.) The library for this, merge3, is under the GPL.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from difflib import SequenceMatcher
from typing import NamedTuple

from planlang.records import dataclass

OURS, MIDDLE, THEIRS = "<<<<<<<", "=======", ">>>>>>>"
"""How git marks a conflict: before our version, between the two, after theirs."""


@dataclass(frozen=True, slots=True)
class Merged:
    """A merged text, and the lines, counted from 1, at which its conflicts begin."""

    text: str
    conflicts: tuple[int, ...] = ()


class _Common(NamedTuple):
    """A run of lines common to all three texts, with its start in each."""

    base: int
    ours: int
    theirs: int
    length: int


def merged(base: str, ours: str, theirs: str, *, our_name: str, their_name: str) -> Merged:
    """Merge two texts derived from a base; lines end with a line feed.

    Conflicts are marked as git does, with the names of the two sides.
    """
    texts = [text.splitlines(keepends=True) for text in (base, ours, theirs)]
    lines: list[str] = []
    conflicts = []
    at = (0, 0, 0)
    for common in _common(*texts):
        ends = common[:3]
        old, own, new = (text[start:end] for text, start, end in zip(texts, at, ends, strict=True))
        if own in (old, new):
            lines += new
        elif new == old:
            lines += own
        else:
            conflicts.append(len(lines) + 1)
            lines += [f"{OURS} {our_name}\n", *_ended(own), f"{MIDDLE}\n", *_ended(new), f"{THEIRS} {their_name}\n"]
        lines += texts[0][common.base : common.base + common.length]
        at = (common.base + common.length, common.ours + common.length, common.theirs + common.length)
    return Merged("".join(lines), tuple(conflicts))


def has_conflicts(text: str) -> bool:
    """Check whether a text has conflict markers."""
    starts = {line.split(" ")[0] for line in text.splitlines()}
    return {OURS, MIDDLE, THEIRS} <= starts


def _ended(lines: Sequence[str]) -> list[str]:
    """End the last line with a line feed, so that a marker can follow."""
    return [line if line.endswith("\n") else f"{line}\n" for line in lines]


def _common(base: list[str], ours: list[str], theirs: list[str]) -> Iterator[_Common]:
    """Yield the runs of lines common to all three texts, in order; a last, empty one stands at their ends."""
    first, second = (
        [block for block in SequenceMatcher(None, base, other, autojunk=False).get_matching_blocks() if block.size]
        for other in (ours, theirs)
    )
    i = j = 0
    while i < len(first) and j < len(second):
        a, b = first[i], second[j]
        start, end = max(a.a, b.a), min(a.a + a.size, b.a + b.size)
        if start < end:
            yield _Common(start, a.b + start - a.a, b.b + start - b.a, end - start)
        if a.a + a.size < b.a + b.size:
            i += 1
        else:
            j += 1
    yield _Common(len(base), len(ours), len(theirs), 0)
