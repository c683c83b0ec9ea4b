"""Relations in locations: a class for each, with its words and what it demands of a base, a hand or a thing.

A new relation is a class in the file of similar ones, and listed at its end: recipes use its OWL property, plans its
name, phrases its forms, and the executive meets its demands. ``relation_type`` has the base class, ``demands`` what a
relation may demand; ``reaching``, ``beside`` and ``looking`` have the relations.
"""

from __future__ import annotations

from planlang.relations.beside import BESIDE
from planlang.relations.demands import Subject
from planlang.relations.looking import LOOKING
from planlang.relations.reaching import REACHING
from planlang.relations.relation_type import Meaning, RelationType

__all__ = ["RELATIONS", "Meaning", "RelationType", "add", "meaningful", "measured", "named", "of_owl_property"]

RELATIONS: dict[str, RelationType] = {}
"""All relations by name."""


def add(relation: RelationType) -> None:
    """Add a relation to the table; raises ValueError if it has no meaning, or shares a word with another."""
    for other in RELATIONS.values():
        for mine, theirs in zip(_words(relation), _words(other), strict=True):
            if mine & theirs:
                raise ValueError(f"{min(mine & theirs)!r} of the relation {relation.name} means {other.name} already")
    if not relation.name.isidentifier() or not relation.forms:
        raise ValueError(f"the relation {relation.name!r} needs a Python name and at least one spoken form")
    if not relation.meanings():
        raise ValueError(f"the relation {relation.name} means nothing for a base, a hand or a thing")
    if relation.arity not in (1, 2):
        raise ValueError(
            f"the relation {relation.name} relates to {relation.arity} things: phrases have one thing or two"
        )
    if relation.arity == 2 and any(form.startswith("not ") for form in relation.forms):
        raise ValueError(f"the relation {relation.name} relates to two things: it has no form of its complement")
    relation.check_itself()
    RELATIONS[relation.name] = relation


def _words(relation: RelationType) -> tuple[set[str], ...]:
    """Return the keywords, the OWL property and the forms in phrases."""
    return {relation.name, *relation.synonyms}, {relation.owl}, set(relation.forms)


for _one in (*REACHING, *BESIDE, *LOOKING):
    add(_one)


def named(keyword: str) -> RelationType | None:
    """Look up a relation by a keyword of ``a_location``; None if there is none."""
    found = RELATIONS.get(keyword)
    return found or next((one for one in RELATIONS.values() if keyword in one.synonyms), None)


def measured() -> tuple[str, ...]:
    """Return the names of the relations whose distance can be bounded."""
    return tuple(name for name, one in RELATIONS.items() if one.measured)


def owl_properties() -> tuple[str, ...]:
    """Return the OWL properties of all relations."""
    return tuple(one.owl for one in RELATIONS.values())


def of_owl_property(owl: str) -> str | None:
    """Look up the name of a relation by its OWL property; None if there is none."""
    return next((name for name, one in RELATIONS.items() if one.owl == owl), None)


def meaningful(subject: Subject) -> tuple[str, ...]:
    """Return the names of the relations that have a meaning for a subject."""
    return tuple(name for name, one in RELATIONS.items() if one.meaning(subject) is not None)
