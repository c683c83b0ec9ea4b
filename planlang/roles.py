"""Roles of actions: properties of the vocabulary in snake case, such as ``to_location``."""

from __future__ import annotations

from functools import cache

from planlang.designators import local_name, snake_case
from planlang.files import bundled
from planlang.ontology import load, terms
from planlang.spelling import similar

SURE = 0.85
"""Similarity (difflib) above which an unknown role is a misspelling; others may belong to a user's own module."""

USUAL = (
    "amount", "condition_evaluated", "constrained_by", "device_used", "duration", "location_searched",
    "object_acted_on", "outputs_created", "recipient", "to_location",
)  # fmt: skip
"""The roles that planlang's own process modules read."""


@cache
def known_roles() -> frozenset[str]:
    """Return the roles of the bundled vocabulary; it is read once, which takes about 0.4 s."""
    ontology = load(bundled("ontologies") / "knowrob.omn")
    kinds = (terms.OWL.ObjectProperty, terms.OWL.DatatypeProperty)
    subjects = (triple.subject for kind in kinds for triple in ontology.triples(p=terms.RDF.type, o=kind))
    return frozenset(snake_case(local_name(one)) for one in subjects if isinstance(one, str))


def meant_role(written: str) -> str | None:
    """Find the role that a misspelt one stands for; None if it is a known role or similar to none.

    The vocabulary is read only for a name that is similar to a usual role.
    """
    near = [] if written in USUAL else similar(written, USUAL, least=SURE)
    return near[0] if near and written not in known_roles() else None
