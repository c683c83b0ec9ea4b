"""Superclasses of action classes, from the plan's own statements and from the vocabulary."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import zip_longest

from planlang.designators import ActionClass, local_name

Known = Callable[[str], Sequence[str]]
"""Maps a class of the vocabulary to itself and its superclasses, nearest first."""


def stated_levels(cls: str) -> Iterator[tuple[str, ...]]:
    """Yield a class, then the superclasses that the plan states for it, level by level; each class once."""
    seen: set[str] = set()
    level: tuple[str, ...] = (cls,)
    while level:
        seen.update(level)
        yield level
        above = (up for one in level if isinstance(one, ActionClass) for up in one.below)
        level = tuple(dict.fromkeys(up for up in above if up not in seen))


def nearest_unstated(cls: str) -> tuple[str, ...]:
    """Return the nearest classes, from ``cls`` upwards, for which the plan states no superclasses."""
    return tuple(one for level in stated_levels(cls) for one in level if not isinstance(one, ActionClass))


def levels_above(cls: str, known: Known) -> Iterator[tuple[str, ...]]:
    """Yield a class, then its superclasses level by level; ``known`` provides those that the plan does not state.

    The levels that the plan states come first. Superclasses from the vocabulary follow one at a time, because
    ``known`` gives no distances. Each level has the IRI of a class and its local name, unless the local name means
    another class of the vocabulary.
    """
    seen: set[str] = set()
    for level in stated_levels(cls):
        names = tuple(name for one in level for name in _names(one, known))
        seen.update(names)
        yield names
    for row in zip_longest(*map(known, nearest_unstated(cls))):
        for one in row:
            if one is not None and one not in seen:
                seen.add(one)
                yield (one,)


def _names(cls: str, known: Known) -> tuple[str, ...]:
    """Return the IRI of a class and, if unambiguous, its local name."""
    short = local_name(cls)
    return (cls, short) if short != cls and len(known(short)) < 2 else (cls,)


def ancestors_of(cls: str, known: Known) -> tuple[str, ...]:
    """Return a class and its superclasses, nearest first."""
    return tuple(one for level in levels_above(cls, known) for one in level)
