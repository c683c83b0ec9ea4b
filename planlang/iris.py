"""Names of IRIs: their last part, and readable names where that is a number or random letters."""

from __future__ import annotations

from collections.abc import Mapping

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
