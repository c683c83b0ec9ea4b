"""Checks of what fills the properties of actions: known properties, defined fillers, ranges, units."""

from __future__ import annotations

from collections.abc import Iterator

from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, Rename, Severity, Span, error, warning
from planlang.ontology import BNode, Literal, Ontology, Term, shorten
from planlang.ontology.terms import OWL, TYPE, XSD, is_vocabulary
from planlang.recipe.actions import Actions
from planlang.recipe.fillings import action_class, fillings, unread_facts
from planlang.recipe.guesses import SURE, guess
from planlang.recipe.model import Name, Place, Recipe, Step, Thing
from planlang.recipe.readers.data_flow import OUTPUTS, made
from planlang.recipe.readers.workflow import is_interval_relation
from planlang.recipe.repairs import ranges_of, violates_range
from planlang.recipe.statements import Filling, Statements, is_word
from planlang.recipe.terms import (
    NUMERIC,
    OBJECT_PROPERTY,
    classes_of,
    is_of_unknown_kind,
    is_place,
    is_vocabulary_class,
    read_filler,
    read_literal,
    references_of_unknown_kind,
    takes_numbers,
    takes_things,
    unread_references,
)
from planlang.recipe.units import dimension_of, si_unit, unit, unit_of
from planlang.relations import RELATIONS

DATA_PROPERTY = OWL + "DatatypeProperty"
AGENTS = frozenset({"performedBy", "doneBy"})
"""Properties whose filler is not looked up to perform the action: the robot is known without it."""


UNDEFINED = "define it in the file, with its class, or name it as outputsCreated of the step that makes it"


def check_ranges(actions: Actions, owner: Step | Recipe, known: frozenset[str]) -> Iterator[Diagnostic]:
    """Judge the fillers of a step, or of a task itself, after repairs; ``known`` are individuals that steps create."""
    ontology = actions.ontology
    for parameter in owner.parameters:
        filler = parameter.filler
        match filler:
            case Thing():
                cls, is_wrong = filler.stated, violates_range(ontology, parameter.property, filler.stated)
                is_individual = filler.iri is not None
            case Place() | Name() if filler.iri not in known:
                classes = classes_of(ontology, filler.iri)
                cls, is_individual = next(iter(classes), filler.iri), classes != (filler.iri,)
                is_wrong = all(violates_range(ontology, parameter.property, one) for one in classes or (cls,))
            case _:
                continue
        if is_wrong:
            wanted = " and ".join(f"`{local_name(one)}`" for one in ranges_of(ontology, parameter.property))
            is_what = f"`{filler.name}`" + (f" (a `{local_name(cls)}`)" if is_individual else "")
            message = f"{parameter.property} of `{owner.name}` is {is_what}, but takes what is below {wanted}"
            yield warning("R032", message, parameter.span, "check the property, or the class of what fills it")


def check_fillers(actions: Actions, statements: Statements) -> Iterator[Diagnostic]:
    """Judge the fillers that the file states for a task and its sub-actions, before anything is left out."""
    ontology = actions.ontology
    known: set[Term] = set(made(ontology, statements))
    told = set(known)
    owners = [(statements.iri, statements.fillings)]
    owners += [(sub.iri, sub.fillings) for sub in statements.sub_actions if sub.iri is not None]
    for owner, more in owners:
        cls = owner if ontology.is_class(owner) else action_class(ontology, owner) or owner
        listed = actions.properties(cls)
        for level in fillings(ontology, owner, more):
            for filling in level:
                yield from _property(ontology, owner, listed, filling)
                if filling.term not in known:
                    found = [
                        one
                        for one in _filler(ontology, owner, filling)
                        if not (filling.term in told and one.code == "R049")
                    ]
                    yield from found
                    if isinstance(filling.term, str) and any(one.code in ("R033", "R049") for one in found):
                        known.add(filling.term)  # what nothing defines is told once
                        told.add(filling.term)
                    yield from _references(ontology, filling, told)
    yield from _left_out(ontology, [owner for owner, _ in owners])


def _references(ontology: Ontology, filling: Filling, told: set[Term]) -> Iterator[Diagnostic]:
    """What a place relates to without anything saying what that is; ``told`` is what need not be told, and grows."""
    if isinstance(filling.term, str) and is_place(ontology, filling.term):
        for relation, other in references_of_unknown_kind(ontology, filling.term):
            if other not in told:
                told.add(other)
                what = f"{RELATIONS[relation].owl} of the place `{local_name(filling.term)}`"
                yield _of_unknown_kind(ontology, what, other, ontology.span(filling.term) or filling.span)


def _left_out(ontology: Ontology, owners: list[str]) -> Iterator[Diagnostic]:
    """Facts of individuals that no property of actions says, one message for each property."""
    found: dict[str, dict[str, Span]] = {}
    for owner in owners:
        if not ontology.is_class(owner):
            for fact in unread_facts(ontology, owner):
                if is_interval_relation(fact.property):
                    continue
                found.setdefault(fact.property, {}).setdefault(owner, fact.span)
    for name, spans in found.items():
        owner, span = next(iter(spans.items()))
        others = f" and {len(spans) - 1} more" if len(spans) > 1 else ""
        message = f"{local_name(name)} of `{local_name(owner)}`{others} is left out: it is no property of actions"
        cls = action_class(ontology, owner)
        listed = ontology.valid_properties(cls) if cls is not None else ()
        advice = "say it by such a property if a plan should know it"
        if listed:
            advice += f": {', '.join(sorted(map(local_name, listed)))}"
        yield warning("R038", message, span, advice)


def _property(ontology: Ontology, owner: str, listed: frozenset[str], filling: Filling) -> Iterator[Diagnostic]:
    if not listed or filling.property in listed or is_word(filling.property, *OUTPUTS):  # any action may make something
        return
    short = local_name(filling.property)
    message = f"{short} is not listed for actions such as `{local_name(owner)}`: it is kept as it is"
    if not is_vocabulary(short) and not ontology.is_property(filling.property):
        message = f"nothing declares the property {short} of `{local_name(owner)}`: it is kept as it is"
    yield warning("R031", message, filling.span, f"listed are {', '.join(sorted(map(local_name, listed)))}")


def _filler(ontology: Ontology, owner: str, filling: Filling) -> Iterator[Diagnostic]:
    short, term, span = local_name(shorten(filling.property)), filling.term, filling.span
    kinds = ontology.values(filling.property, TYPE)
    if isinstance(term, Literal):
        yield from _literal(ontology, owner, filling.property, term, span)
        if OBJECT_PROPERTY in kinds and DATA_PROPERTY not in kinds:
            message = f"{short} of `{local_name(owner)}` is the value {term.value!r}, but takes a thing or a place"
            yield warning("R032", message, span, "name a class or an individual")
        return
    if isinstance(term, BNode):
        message = f"{short} of `{local_name(owner)}` is an anonymous expression, which is left out"
        yield warning("R035", message, span, "name a class or an individual")
        return
    if takes_numbers(ontology, filling.property) and not term.startswith(XSD):
        message = f"{short} of `{local_name(owner)}` is `{local_name(term)}`, but takes a number"
        yield error("R032", message, span, f"write a number in its place, such as `{short} value 0.5`")
        return
    if DATA_PROPERTY in kinds and OBJECT_PROPERTY not in kinds:
        message = f"{short} of `{local_name(owner)}` is `{local_name(term)}`, but takes a value"
        yield warning("R032", message, span, 'write a value, such as 0.5 or "text"')
        return
    if read_filler(ontology, term) is None:
        message = f"{short} of `{local_name(owner)}` is `{local_name(term)}`, which nothing defines"
        severity = Severity.ERROR
        if short in AGENTS or not is_vocabulary(short):
            message, severity = f"{message}: it is left out", Severity.WARNING
        meant = _meant(ontology, term)
        yield Diagnostic(severity, "R033", message, span, _asked(meant), meant)
    elif (
        takes_things(ontology, filling.property) and is_of_unknown_kind(ontology, term) and not is_place(ontology, term)
    ):
        yield _of_unknown_kind(ontology, f"{short} of `{local_name(owner)}`", term, span)
    for missing in unread_references(ontology, term):
        message = f"`{local_name(term)}` relates to `{local_name(missing)}`, which nothing defines"
        meant = _meant(ontology, missing)
        yield error("R033", message, ontology.span(term) or span, _asked(meant), meant)


def _of_unknown_kind(ontology: Ontology, what: str, term: str, span: Span) -> Diagnostic:
    """What fills a property, or a place relates to, is defined, but not as anything of which it is known what it is."""
    cls = next(iter(classes_of(ontology, term)), term)
    meant = guess(cls, filter(is_vocabulary_class, ontology.class_names()), least=SURE)
    is_what = f", of the class `{local_name(cls)}`" if cls != term else ""
    message = (
        f"{what} is `{local_name(term)}`{is_what}, which is below no class of the vocabulary: it is taken as an object"
    )
    advice = f"put `{local_name(cls)}` below a class such as HumanScaleObject, or import the file that does"
    return warning("R049", message, span, f"did you mean {meant}? else {advice}" if meant else advice, meant)


def _literal(ontology: Ontology, owner: str, property_name: str, literal: Literal, span: Span) -> Iterator[Diagnostic]:
    """Judge a value: a number where its type or the property says so, in a unit that fits the property."""
    name, short = unit_of(literal), local_name(shorten(property_name))
    datatype = local_name(literal.datatype or "")
    is_number = takes_numbers(ontology, property_name)
    if name is not None or datatype in NUMERIC or is_number:
        value = read_literal(literal, is_number=is_number)
        if isinstance(value, str | bool):
            message = f"{short} of `{local_name(owner)}` is {literal.value!r}, which is no number"
            why = f"for its type {datatype}" if datatype in NUMERIC or name else f"as {short} takes numbers"
            yield error("R037", message, span, f"write a number, such as 0.5, {why}")
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


def _meant(ontology: Ontology, undefined: str) -> Rename | None:
    """A name of the main document that is like one that nothing defines."""
    names = {
        triple.subject: None
        for triple in ontology.triples(p=TYPE)
        if isinstance(triple.subject, str) and not isinstance(triple.subject, BNode) and ontology.main(triple.subject)
    }
    return guess(undefined, names)


def _asked(meant: Rename | None) -> str:
    return f"did you mean {meant}?" if meant else UNDEFINED
