"""What a reader makes of a file, whatever its syntax."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from planlang.diagnostics import Diagnostic
from planlang.ontology.triples import Triples

MOST_TRIPLES = 1_000_000
"""Triples of one file."""


@dataclass
class Parsed:
    """What a file says: its triples in document order, what was repaired on the way, the prefixes that it declares."""

    triples: Triples
    diagnostics: list[Diagnostic] = field(default_factory=list)
    prefixes: dict[str, str] = field(default_factory=dict)


def counted(shown: list[Diagnostic], more: int) -> list[Diagnostic]:
    """The diagnostics that are shown; the last says how many there are besides, so that nothing is silent."""
    if more <= 0 or not shown:
        return shown
    return [*shown[:-1], replace(shown[-1], message=f"{shown[-1].message}; {more} more like this are not shown")]
