"""The classes above a class of actions, by what the plan states and what the vocabulary knows."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import zip_longest

from planlang.designators import ActionClass, local_name

Known = Callable[[str], Sequence[str]]
"""Returns a class of the vocabulary itself, then what is above it, nearest first."""


def stated_levels(cls: str) -> Iterator[tuple[str, ...]]:
    """Yield a class, then what the plan states directly above it, and so on, each class once."""
    seen: set[str] = set()
    level: tuple[str, ...] = (cls,)
    while level:
        seen.update(level)
        yield level
        above = (up for one in level if isinstance(one, ActionClass) for up in one.below)
        level = tuple(dict.fromkeys(up for up in above if up not in seen))


def nearest_unstated(cls: str) -> tuple[str, ...]:
    """Return the class, or the classes nearest above it, of which the plan states no superclasses."""
    return tuple(one for level in stated_levels(cls) for one in level if not isinstance(one, ActionClass))


def levels_above(cls: str, known: Known) -> Iterator[tuple[str, ...]]:
    """Yield a class, then what is directly above it, and so on; ``known`` tells what the plan does not state.

    What is above classes of the vocabulary comes after all that is stated, one by one, as ``known`` gives no distances.
    Beside the IRI of a class stands its local name, unless that means another class of the vocabulary.
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
    """Return the IRI of a class and, if that means nothing else, its local name."""
    short = local_name(cls)
    return (cls, short) if short != cls and len(known(short)) < 2 else (cls,)


def ancestors_of(cls: str, known: Known) -> tuple[str, ...]:
    """Return a class itself, then what is above it, nearest first."""
    return tuple(one for level in levels_above(cls, known) for one in level)
