"""Names of IRIs: their last part, readable names where that is a number or random letters, and names in Python."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Container, Mapping
from itertools import chain, count

_READABLE: dict[str, str] = {}
"""IRI, or its local part -> readable name."""
_NAMED: dict[str, str] = {}
"""Readable name -> its IRI."""


def local_part(iri: str) -> str:
    """Return the part of an IRI after ``#`` or the last ``/``."""
    return iri.rsplit("#", 1)[-1].rsplit("/", 1)[-1]


def local_name(iri: str) -> str:
    """Return the readable name of an IRI if :func:`label_iris` gave it one, else its :func:`local_part`."""
    return _READABLE.get(iri) or local_part(iri)


def names_of(iri: str) -> tuple[str, ...]:
    """Return what people may write for an IRI that :func:`label_iris` named; nothing for other IRIs."""
    name = _READABLE.get(iri)
    return () if name is None else (name, name.replace("_", " "), local_part(iri))


def is_called(iri: str, name: str) -> bool:
    """Check whether a person may call an IRI so: by itself, its local name, or a name of :func:`names_of`."""
    return name in (iri, local_name(iri)) or name in names_of(iri)


def label_iris(names: Mapping[str, str]) -> None:
    """Give readable names to IRIs (IRI -> name) whose local part is a number or random letters.

    Plans and ontologies do so for what they load; the names are for people, the IRIs identify things. An IRI keeps the
    first name that it gets in a process; a name that another IRI has is extended by the end of the local part.
    """
    for iri, name in names.items():
        if iri in _READABLE:
            continue
        part = local_part(iri)
        if _NAMED.get(name, iri) != iri:
            name = f"{name}_{part[-4:]}"
        if _NAMED.get(name, iri) != iri:
            name = f"{name}_{part}"
        _READABLE[iri] = name
        _NAMED[name] = iri
        _READABLE.setdefault(part, name)


def snake_case(name: str) -> str:
    """Convert ``MoveBaseToGraspPose`` to ``move_base_to_grasp_pose``, a valid Python identifier.

    Digits stay with the word before them (``bottle1``). Other characters become ``_``, as does the place before a
    leading digit.
    """
    text = unicodedata.normalize("NFKC", name)
    parts: list[str] = []
    for index, character in enumerate(text):
        if not f"a{character}".isidentifier():
            parts.append("_")
            continue
        before, after = text[index - 1 : index] if index else "", text[index + 1 : index + 2]
        if character.isupper() and (before.islower() or before.isdigit() or (before.isupper() and after.islower())):
            parts.append("_")
        parts.append(character.lower())
    result = re.sub("_+", "_", unicodedata.normalize("NFKC", "".join(parts))).strip("_")
    return result if result.isidentifier() else f"_{result}"


def unused_name(wanted: str, taken: Container[str]) -> str:
    """Return the first of ``wanted``, ``wanted_2``, ``wanted_3``, ... that is not taken."""
    every = chain([wanted], (f"{wanted}_{number}" for number in count(2)))
    return next(name for name in every if name not in taken)


def told_apart(first: str, second: str) -> tuple[str, str]:
    """Return distinct names of two things (IRIs): their local names or, if these are equal, the whole IRIs."""
    short = local_name(first), local_name(second)
    return short if short[0] != short[1] else (f"<{first}>", f"<{second}>")
