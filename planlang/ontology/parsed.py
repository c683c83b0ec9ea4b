"""What a reader makes of a file, whatever its syntax."""

from __future__ import annotations

from dataclasses import dataclass, field

from planlang.diagnostics import Diagnostic
from planlang.ontology.terms import Triple


@dataclass
class Parsed:
    """What a file says: its triples in document order, what was repaired on the way, the prefixes that it declares."""

    triples: list[Triple]
    diagnostics: list[Diagnostic] = field(default_factory=list)
    prefixes: dict[str, str] = field(default_factory=dict)
