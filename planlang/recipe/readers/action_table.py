"""Dialect D4: action data tables: individuals with a first chunk as ``subAction``, chained by ``nextAction``.

A chunk is an individual of a class of actions. ``nextAction`` and ``previousAction`` are the only orders; a chunk that
only ``subAction`` names is unordered. The objects of a table have roles: the main object is acted on, the secondary one
is its target. A chunk acts on the object that it states, else on the one on its supporting plane, else on the main
object of the table, if actions of its class act on objects at all.
"""

from __future__ import annotations

from collections.abc import Iterator

from planlang.designators import local_name
from planlang.ontology import Ontology, expand
from planlang.recipe.fillers import action_class, fillings
from planlang.recipe.model import ACTION_TABLE, Ordering
from planlang.recipe.statements import Filling, Statements, SubAction, facts, is_word, named_iris

_SUBS = ("subAction", "subEvents")
_NEIGHBOURS = ("nextAction", "previousAction")
_ACTED_ON = "objectActedOn"
_ROLES = {
    _ACTED_ON: ("adtMainObject", "adtPrimaryObject"),
    "toLocation": ("adtSecondaryObject",),
}
"""Property of the action -> roles of an object in a table; the first role that is filled counts."""


def tasks(ontology: Ontology) -> Iterator[str]:
    """Yield the individuals of the main document that have sub-actions."""
    for triple in ontology.using(*_SUBS):
        if isinstance(triple.subject, str) and ontology.main(triple.subject):
            yield triple.subject


def read(ontology: Ontology, iri: str) -> Statements | None:
    """Read the chunks of a table in the order of the chain; None if the individual has no sub-action."""
    firsts = facts(ontology, iri, *_SUBS)
    if not firsts:
        return None
    chunks = dict(sorted(named_iris(firsts)))
    orderings: dict[tuple[str, str], Ordering] = {}
    reached = list(chunks)
    for chunk in reached:
        stated = [(fact.property, fact.term, fact.span, False) for fact in facts(ontology, chunk, *_NEIGHBOURS)]
        stated += [(one.predicate, one.subject, one.span, True) for one in ontology.triples(o=chunk)]
        for word, other, span, is_inverse in stated:
            if not isinstance(other, str) or not is_word(word, *_NEIGHBOURS):
                continue
            pair = (chunk, other) if is_word(word, "nextAction") is not is_inverse else (other, chunk)
            orderings.setdefault(pair, Ordering(*pair, span=span))
            if other not in chunks:
                chunks[other] = span
                reached.append(other)
    filled = tuple(filling for property_name in _ROLES for filling in _in_role(ontology, iri, property_name))
    return Statements(
        iri,
        ACTION_TABLE,
        tuple(SubAction(chunk, tuple(_acted_on(ontology, iri, chunk)), span) for chunk, span in chunks.items()),
        tuple(orderings[pair] for pair in sorted(orderings)),
        fillings=filled,
    )


def _in_role(ontology: Ontology, table: str, property_name: str) -> list[Filling]:
    """Fillings of an action's property from the objects with the matching role in a table."""
    objects = next(filter(None, (facts(ontology, table, role) for role in _ROLES[property_name])), [])
    return [Filling(expand(property_name), fact.term, fact.span) for fact in objects]


def _acted_on(ontology: Ontology, table: str, chunk: str) -> list[Filling]:
    """Object of a chunk, unless the chunk or its class states one; none for actions without objects."""
    acted_on = expand(_ACTED_ON)
    cls = action_class(ontology, chunk)
    if cls is None or acted_on not in ontology.valid_properties(cls):
        return []
    stated = (filling.property for level in fillings(ontology, chunk) for filling in level)
    if any(acted_on in ontology.superproperties(name) for name in stated):
        return []
    return _in_role(ontology, chunk, _ACTED_ON) or _supported(ontology, chunk) or _in_role(ontology, table, _ACTED_ON)


def _supported(ontology: Ontology, chunk: str) -> list[Filling]:
    """Object on the supporting plane of a chunk. Tables may name a plane of a log by its local name only."""
    objects: list[Filling] = []
    for plane in facts(ontology, chunk, "adtChunkSupport"):
        name = str(plane.term)
        described = [one for one in ontology.using("supportedObject") if isinstance(one.subject, str)]
        own = [one for one in described if one.subject == name]
        named = own or [one for one in described if local_name(str(one.subject)) == local_name(name)]
        if len({one.object for one in named}) == 1:
            objects.append(Filling(expand(_ACTED_ON), named[0].object, named[0].span))
    return objects if len(objects) == 1 else []
