"""Checks of what fills the properties of actions: known properties, defined fillers, ranges, places for the base."""

from __future__ import annotations

from collections.abc import Iterator
from difflib import get_close_matches

from planlang.designators import RELATIONS, local_name
from planlang.diagnostics import Diagnostic, Severity, Span, error, warning
from planlang.ontology import BNode, Literal, Ontology, shorten
from planlang.ontology.terms import OWL, TYPE, is_vocabulary
from planlang.recipe.actions import Actions
from planlang.recipe.fillings import action_class, fillings
from planlang.recipe.model import Place, Recipe, Step, Thing
from planlang.recipe.readers.data_flow import made
from planlang.recipe.repairs import violates_range
from planlang.recipe.statements import Filling, Statements
from planlang.recipe.terms import NUMERIC, read_filler, read_literal, unread_references
from planlang.recipe.units import dimension_of, si_unit, unit, unit_of

OBJECT_PROPERTY = OWL + "ObjectProperty"
DATA_PROPERTY = OWL + "DatatypeProperty"
AGENTS = frozenset({"performedBy", "doneBy"})
"""Properties whose filler is not looked up to perform the action: the robot is known without it."""


def check_parameters(actions: Actions, owner: Step | Recipe, known: frozenset[str]) -> Iterator[Diagnostic]:
    """Judge the fillers of a step, or of a task itself, after repairs; ``known`` are individuals that steps create."""
    ontology = actions.ontology
    for parameter in owner.parameters:
        filler = parameter.filler
        if isinstance(filler, Thing) and violates_range(ontology, parameter.property, filler):
            message = f"{parameter.property} of `{owner.name}` is `{filler.name}`, which is not in the property's range"
            yield warning("R032", message, parameter.span, "check the property, or the class of what fills it")
    if isinstance(owner, Step) and actions.is_base_motion(owner):
        for filler in owner.fillers("toLocation"):
            if isinstance(filler, Place) and filler.is_posture and filler.iri not in known:
                message = f"`{owner.name}` moves the base to `{filler.name}`, which has no relation to anything"
                advice = f"give `{filler.name}` one of {', '.join(RELATIONS.values())}"
                yield error("R036", message, ontology.span(filler.iri) or owner.span, advice)


def check_fillers(actions: Actions, statements: Statements) -> Iterator[Diagnostic]:
    """Judge the fillers that the file states for a task and its sub-actions, before anything is left out."""
    ontology = actions.ontology
    known = set(made(ontology, statements))
    owners = [(statements.iri, statements.fillings)]
    owners += [(sub.iri, sub.fillings) for sub in statements.sub_actions if sub.iri is not None]
    for owner, more in owners:
        cls = owner if ontology.is_class(owner) else action_class(ontology, owner) or owner
        listed = actions.properties(cls)
        for level in fillings(ontology, owner, more):
            for filling in level:
                yield from _property(owner, listed, filling)
                if filling.term not in known:
                    found = list(_filler(ontology, owner, filling))
                    yield from found
                    if isinstance(filling.term, str) and any(one.code == "R033" for one in found):
                        known.add(filling.term)  # what nothing defines is told once


def _property(owner: str, listed: frozenset[str], filling: Filling) -> Iterator[Diagnostic]:
    if not listed or filling.property in listed:
        return
    names = sorted(local_name(name) for name in listed)
    short = local_name(filling.property)
    similar = get_close_matches(short, names, n=1, cutoff=0.85)
    is_misspelt = bool(similar) and not is_vocabulary(short)
    severity = Severity.ERROR if is_misspelt else Severity.WARNING
    advice = f"did you mean {similar[0]}?" if similar else f"its properties are {', '.join(names)}"
    yield Diagnostic(severity, "R031", f"`{local_name(owner)}` has no property {short}", filling.span, advice)


def _filler(ontology: Ontology, owner: str, filling: Filling) -> Iterator[Diagnostic]:
    short, term, span = local_name(shorten(filling.property)), filling.term, filling.span
    kinds = ontology.values(filling.property, TYPE)
    if isinstance(term, Literal):
        yield from _literal(owner, short, term, span)
        if OBJECT_PROPERTY in kinds and DATA_PROPERTY not in kinds:
            message = f"{short} of `{local_name(owner)}` is the value {term.value!r}, but takes a thing or a place"
            yield warning("R032", message, span, "name a class or an individual")
        return
    if isinstance(term, BNode):
        message = f"{short} of `{local_name(owner)}` is an anonymous expression, which is left out"
        yield warning("R035", message, span, "name a class or an individual")
        return
    if DATA_PROPERTY in kinds and OBJECT_PROPERTY not in kinds:
        message = f"{short} of `{local_name(owner)}` is `{local_name(term)}`, but takes a value"
        yield warning("R032", message, span, 'write a value, such as 0.5 or "text"')
        return
    if read_filler(ontology, term) is None:
        message = f"{short} of `{local_name(owner)}` is `{local_name(term)}`, which nothing defines"
        severity = Severity.WARNING if short in AGENTS else Severity.ERROR
        yield Diagnostic(severity, "R033", message, span, _guess(ontology, term))
    for missing in unread_references(ontology, term):
        message = f"`{local_name(term)}` relates to `{local_name(missing)}`, which nothing defines"
        yield error("R033", message, ontology.span(term) or span, _guess(ontology, missing))


def _literal(owner: str, short: str, literal: Literal, span: Span) -> Iterator[Diagnostic]:
    """Judge a value: a number where its type says so, in a unit that fits the property."""
    name = unit_of(literal)
    datatype = local_name(literal.datatype or "")
    if (name is not None or datatype in NUMERIC) and isinstance(read_literal(literal), str):
        message = f"{short} of `{local_name(owner)}` is {literal.value!r}, which is no number"
        yield error("R037", message, span, f"write a number, such as 0.5, for its type {datatype}")
        return
    if name is None:
        return
    known, wanted = unit(name), dimension_of(short)
    if known is None:
        message = (
            f"{short} of `{local_name(owner)}` is in {name}, a unit that is not known: the number is taken as it is"
        )
        yield warning("R037", message, span, "use a unit of QUDT, such as Meter, SecondTime or MeterPerSecond")
    elif wanted is not None and known.dimension != wanted:
        message = (
            f"{short} of `{local_name(owner)}` is in {name} ({si_unit(known.dimension)}),"
            f" but is measured in {si_unit(wanted)}"
        )
        yield error("R037", message, span, "give it in a unit of that kind")


def _guess(ontology: Ontology, undefined: str) -> str:
    names = {
        local_name(triple.subject): None
        for triple in ontology.triples(p=TYPE)
        if isinstance(triple.subject, str) and not isinstance(triple.subject, BNode) and ontology.main(triple.subject)
    }
    similar = get_close_matches(local_name(undefined), names, n=1)
    return f"did you mean `{similar[0]}`?" if similar else "define it in the file, with its class"
