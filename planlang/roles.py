"""The roles of actions: the properties of the vocabulary in snake case, such as ``to_location``."""

from __future__ import annotations

from functools import cache

from planlang.designators import local_name, snake_case
from planlang.files import bundled
from planlang.spelling import similar

SURE = 0.85
"""Least similarity (difflib) for an unknown role to be taken for a slip: anything else may be a module's own."""

USUAL = (
    "amount", "condition_evaluated", "constrained_by", "device_used", "duration", "location_searched",
    "object_acted_on", "outputs_created", "recipient", "to_location",
)  # fmt: skip
"""The roles that planlang's own process modules read."""


@cache
def known_roles() -> frozenset[str]:
    """Return the roles that the bundled vocabulary knows; it is read once, which takes about 0.4 s."""
    from planlang.ontology import load, terms  # only for a role that looks misspelt

    ontology = load(bundled("ontologies") / "knowrob.omn")
    kinds = (terms.OWL.ObjectProperty, terms.OWL.DatatypeProperty)
    subjects = (triple.subject for kind in kinds for triple in ontology.triples(p=terms.RDF.type, o=kind))
    return frozenset(snake_case(local_name(one)) for one in subjects if isinstance(one, str))


def meant_role(written: str) -> str | None:
    """Return the usual role that a misspelt one stands for; None for one that is known, or not like any that is.

    The vocabulary is read only for one that is nearly a usual one.
    """
    near = [] if written in USUAL else similar(written, USUAL, least=SURE)
    return near[0] if near and written not in known_roles() else None
