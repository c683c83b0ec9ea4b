"""Suggestions for misspelt names: the most similar known ones."""

from __future__ import annotations

import re
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


def guess(written: str, names: Iterable[str]) -> str:
    """Return ``did you mean NAME? `` with the most similar name, or "" if none is similar; advice may follow it."""
    alike = similar(written, names)
    return f"did you mean {alike[0]}? " if alike else ""


def similar(written: str, names: Iterable[str], *, n: int = 1, least: float = 0.6) -> list[str]:
    """Return the names most similar to a written one, best first.

    ``Table`` matches ``Table-PieceOfFurniture`` first of all, because KnowRob adds the second part only to distinguish
    namesakes. Other names need a similarity of at least ``least`` (difflib). Names that differ in a side, such as left
    and right, are never similar.
    """
    known = [name for name in dict.fromkeys(names) if not are_opposite(written, name)]
    plain = written.lower()
    parts = sorted((name for name in known if plain and name.lower().partition("-")[0] == plain), key=len)
    close = get_close_matches(written, known, n=n, cutoff=least)
    return list(dict.fromkeys((*parts, *close)))[:n]
