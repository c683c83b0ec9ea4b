"""What may have been meant by a name that nothing defines."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from difflib import SequenceMatcher, get_close_matches

from planlang.designators import local_name
from planlang.diagnostics import Rename

SURE = 0.85
"""How alike two names have to be, as difflib measures it, to take the one for the other if no third is as like."""

SHORTEST = 4
"""Letters that a name needs for one that differs in a single letter to be taken for it."""

SHORTEST_REPLACED = 6
"""Letters that a part of a name needs for another letter in it to be a slip: a plate is no place, basil no basin."""

_PART = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+")


def guess(
    written: str, names: Iterable[str], *, least: float = 0.6, telling: Callable[[str], str] = local_name
) -> Rename | None:
    """The name (IRI) whose local part is most like that of what is written (IRI); None if none is ``least`` like it.

    ``telling`` gives the part of an IRI that is compared, where names end alike whatever they mean.
    It is sure if it is the only one that is nearly the same, and not the same with another number: of ``cup1`` and
    ``cup2`` neither is a misspelling of the other.
    """
    known: dict[str, str] = {}
    for name in names:
        if name != written:
            known.setdefault(telling(name), name)
    short = telling(written)
    similar = get_close_matches(short, known, n=2, cutoff=least)
    if not similar:
        return None
    near = [name for name in similar if SequenceMatcher(None, name, short).ratio() >= SURE]
    is_sure = len(near) == 1 and _digits(near[0]) == _digits(short)
    return Rename(written, known[similar[0]], is_sure=is_sure)


class Neighbours:
    """Names that differ from others in one letter: one left out, added, another one, or two exchanged.

    Names that differ in a digit, or in a part of one letter (``MoveToA``, ``MoveToB``), are names of different things,
    as are those with another letter in a short part (``TakeCup``, ``TakeCap``), or with which they begin.
    """

    def __init__(self, names: Iterable[str]) -> None:
        self._shortened: dict[str, list[str]] = {}
        for name in dict.fromkeys(names):
            for variant in _variants(name):
                self._shortened.setdefault(variant, []).append(name)

    def of(self, written: str) -> list[str]:
        """The names that ``written``, which is none of them, differs from in one letter, sorted."""
        near = {name for variant in _variants(written) for name in self._shortened.get(variant, ())}
        return sorted(name for name in near if _is_slip(written, name))


def _variants(name: str) -> set[str]:
    return {name, *(name[:place] + name[place + 1 :] for place in range(len(name)))}


def _is_slip(written: str, name: str) -> bool:
    """True if one slip of a finger makes one name of the other, and hardly a person's will."""
    shorter, longer = sorted((written, name), key=len)
    if len(shorter) < SHORTEST or written == name or _digits(written) != _digits(name):
        return False
    start = next((place for place, (a, b) in enumerate(zip(shorter, longer, strict=False)) if a != b), len(shorter))
    a, b = shorter[start:], longer[start:]
    part = next((found[0] for found in _PART.finditer(longer) if found.start() <= start < found.end()), "--")
    if len(a) < len(b):
        return a == b[1:] and len(part) > 1
    is_exchanged = a[:2] == b[1::-1] and a[2:] == b[2:]
    if not start and a[0].lower() != b[0].lower():
        return is_exchanged
    return is_exchanged or (a[1:] == b[1:] and len(part) >= SHORTEST_REPLACED)


def _digits(name: str) -> str:
    return "".join(filter(str.isdecimal, name))
