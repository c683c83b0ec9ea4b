"""Suggestions for misspelt names: the most similar known ones."""

from __future__ import annotations

import re
from bisect import bisect_left
from collections import Counter
from collections.abc import Iterable
from difflib import get_close_matches

_OPPOSITES = (
    ("left", "right"), ("upper", "lower"), ("top", "bottom"), ("up", "down"), ("front", "back"), ("front", "rear"),
    ("inner", "outer"), ("inside", "outside"), ("in", "out"), ("on", "off"), ("open", "close"), ("opening", "closing"),
    ("opened", "closed"), ("before", "after"), ("first", "last"), ("start", "end"), ("north", "south"),
    ("east", "west"), ("l", "r"),
)  # fmt: skip
_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|[0-9]+")


def are_opposite(one: str, other: str) -> bool:
    """Check whether two names differ in a side or direction, so that neither is a misspelling of the other."""
    first, second = (Counter(word.lower() for word in _WORD.findall(name)) for name in (one, other))
    here, there = first - second, second - first
    return any((a in here and b in there) or (b in here and a in there) for a, b in _OPPOSITES)


def guess(written: str, names: Iterable[str], *, least: float = 0.6) -> str:
    """Return ``did you mean NAME? `` with the most similar name, or "" if none is similar; advice may follow it."""
    alike = similar(written, names, least=least)
    return f"did you mean {alike[0]}? " if alike else ""


def similar(written: str, names: Iterable[str], *, n: int = 1, least: float = 0.6) -> list[str]:
    """Return the names most similar to a written one, best first; see :meth:`Spellings.similar`."""
    return Spellings(names).similar(written, n=n, least=least)


class Spellings:
    """Known names, indexed for many searches."""

    def __init__(self, names: Iterable[str]) -> None:
        known = sorted(dict.fromkeys(names), key=len)
        self._lengths = [len(name) for name in known]
        self._bits: dict[tuple[str, int], int] = {}
        self._known = [(self._letters(name, add=True), len(name), name) for name in known]
        self._parts: dict[str, list[str]] = {}
        for name in known:
            self._parts.setdefault(name.lower().partition("-")[0], []).append(name)

    def similar(self, written: str, *, n: int = 1, least: float = 0.6) -> list[str]:
        """Return the names most similar to a written one, best first.

        ``Table`` matches ``Table-PieceOfFurniture`` first of all, because KnowRob adds the second part only to
        distinguish namesakes. Other names need a similarity of at least ``least`` (difflib). Names that differ in a
        side, such as left and right, are never similar.
        """
        parts = self._parts.get(written.lower(), ()) if written else ()
        # difflib compares two names in 50 us, and a file may have thousands of unknown ones: names that cannot be
        # similar, because they have too few letters in common, are excluded before
        length, letters, half = len(written), self._letters(written), least / 2
        first = bisect_left(self._lengths, length * least / (2 - least) - 1)
        end = bisect_left(self._lengths, length * (2 - least) / least + 1)
        near = [
            name
            for own, size, name in self._known[first:end]
            if (own & letters).bit_count() >= half * (size + length) - 1e-9
        ]
        close = get_close_matches(written, near, n=len(near), cutoff=least) if near else ()
        alike = (name for name in dict.fromkeys((*parts, *close)) if not are_opposite(written, name))
        return [name for name, _ in zip(alike, range(n), strict=False)]

    def _letters(self, name: str, *, add: bool = False) -> int:
        """Set of the letters of a name, one bit for each letter's first, second, ... occurrence."""
        counts: dict[str, int] = {}
        letters = 0
        for letter in name:
            counts[letter] = count = counts.get(letter, 0) + 1
            bit = self._bits.get((letter, count))
            if bit is None and add:
                bit = self._bits[letter, count] = 1 << len(self._bits)
            letters |= bit or 0
        return letters
