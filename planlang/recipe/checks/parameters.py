"""Checks of the fillers of actions: known properties, defined names, ranges, units, places.

Unambiguous mistakes are repaired, with a note: swapped fillers, and things given only by their class.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from itertools import chain, combinations

from planlang.closure import reached
from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, Rename, Severity, Span, error, note, warning
from planlang.files import bundled
from planlang.ontology import BNode, Literal, Ontology, Term, expand, shorten
from planlang.ontology.terms import OWL, RDF, RDFS, XSD, is_vocabulary
from planlang.recipe.actions import Actions
from planlang.recipe.checks import CheckedFile, CheckedRecipe, check, listing
from planlang.recipe.checks.expressions import unread_expressions, unread_filling
from planlang.recipe.checks.fillers import wrong_kinds
from planlang.recipe.fillers import (
    NUMERIC,
    OBJECT_PROPERTY,
    action_class,
    classes_of,
    fillings,
    is_of_unknown_kind,
    is_place,
    is_relation,
    names_device,
    read_filler,
    read_literal,
    read_thing,
    references,
    references_of_unknown_kind,
    takes_numbers,
    takes_things,
    unread_facts,
    unread_references,
)
from planlang.recipe.guesses import SURE, class_called, classes_of_vocabulary, guess, names_of_file
from planlang.recipe.model import Kind, Name, Parameter, Place, Recipe, RecipeSet, Step, Thing
from planlang.recipe.readers import OUTPUTS
from planlang.recipe.readers.workflow import is_interval_relation
from planlang.recipe.statements import Filling, is_word
from planlang.relations import RELATIONS, owl_properties
from planlang.units import dimension_of, si_unit, unit, unit_of


@check("R030", "R034", unless=("R022", "R023"))
def with_repairs(ontology: Ontology, recipes: RecipeSet) -> tuple[RecipeSet, list[Diagnostic]]:
    """Make all unambiguous repairs, with a note for each."""
    notes: dict[Diagnostic, None] = {}
    swapped: dict[str, Recipe] = {}
    for iri, recipe in recipes.recipes.items():
        steps = []
        for step in recipe.steps:
            parameters, new_notes = _exchanged(ontology, step.parameters, step.name)
            notes.update(dict.fromkeys(new_notes))
            steps.append(replace(step, parameters=parameters))
        parameters, new_notes = _exchanged(ontology, recipe.parameters, recipe.name)
        notes.update(dict.fromkeys(new_notes))
        swapped[iri] = replace(recipe, steps=tuple(steps), parameters=parameters)
    repairable = replace(recipes, recipes=swapped)
    bound = {}
    for iri, recipe in swapped.items():
        bound[iri], new_notes = _bound(ontology, recipe, repairable)
        notes.update(dict.fromkeys(new_notes))
    return replace(recipes, recipes=bound), list(notes)


def violates_range(ontology: Ontology, property_name: str, cls: str) -> bool:
    """True if a class (IRI) is known to be outside the range of the property."""
    if is_of_unknown_kind(ontology, cls):
        return False
    return any(not ontology.is_a(cls, required) for required in ranges_of(ontology, property_name))


def ranges_of(ontology: Ontology, property_name: str) -> list[str]:
    """Classes (IRIs) in the range of a property."""
    return [
        triple.object
        for triple in ontology.triples(s=expand(property_name), p=RDFS.range)
        if isinstance(triple.object, str) and ontology.is_class(triple.object)
    ]


def _exchanged(
    ontology: Ontology, parameters: tuple[Parameter, ...], owner: str
) -> tuple[tuple[Parameter, ...], list[Diagnostic]]:
    """Swap two fillers if one violates the range of its property and the swap violates none.

    Only parts of a robot may become the device: a pancake maker, too, is a physical device, and it may be what a bottle
    (which is not one) is used on.
    """
    pair = exchanged_pair(ontology, parameters)
    if pair is None:
        return parameters, []
    (first, a), (second, b) = pair
    swap = {first: replace(first, filler=b), second: replace(second, filler=a)}
    message = (
        f"{first.property} `{a.name}` and {second.property} `{b.name}` of `{owner}` are swapped:"
        f" read as {first.property} `{b.name}` and {second.property} `{a.name}`"
    )
    diagnostic = note("R030", message, first.span, "swap them in the file")
    return tuple(swap.get(parameter, parameter) for parameter in parameters), [diagnostic]


def exchanged_pair(
    ontology: Ontology, parameters: tuple[Parameter, ...]
) -> tuple[tuple[Parameter, Thing], tuple[Parameter, Thing]] | None:
    """Find the first two parameters, with their fillers, that should be swapped; None if there are none."""
    things = [(parameter, parameter.filler) for parameter in parameters if isinstance(parameter.filler, Thing)]
    single = [(p, thing) for p, thing in things if sum(q.property == p.property for q in parameters) == 1]
    for (first, a), (second, b) in combinations(single, 2):
        is_violated = violates_range(ontology, first.property, a.stated) or violates_range(
            ontology, second.property, b.stated
        )
        if is_violated and _fits(ontology, first.property, b) and _fits(ontology, second.property, a):
            return (first, a), (second, b)
    return None


def _fits(ontology: Ontology, property_name: str, thing: Thing) -> bool:
    is_device = thing.kind is Kind.DEVICE
    return not violates_range(ontology, property_name, thing.stated) and (property_name != "deviceUsed" or is_device)


def _bound(ontology: Ontology, recipe: Recipe, recipes: RecipeSet) -> tuple[Recipe, list[Diagnostic]]:
    """Replace a thing given only by its class by the only individual of that class in the recipe."""
    individuals = dict.fromkeys(thing for thing in _things_below(recipe, recipes) if thing.iri is not None)
    notes: list[Diagnostic] = []

    def bind(parameter: Parameter) -> Parameter:
        thing = parameter.filler
        if not isinstance(thing, Thing) or thing.iri is not None:
            return parameter
        fitting = [
            other for other in individuals if other.kind is thing.kind and ontology.is_a(other.stated, thing.stated)
        ]
        if len(fitting) != 1:
            return parameter
        only = fitting[0]
        message = f"{parameter.property} `{thing.name}` is read as `{only.name}`, the only one that the recipe names"
        notes.append(note("R034", message, parameter.span, f"write `{only.name}` if this is intended"))
        return replace(parameter, filler=only)

    steps = tuple(replace(step, parameters=tuple(map(bind, step.parameters))) for step in recipe.steps)
    return replace(recipe, steps=steps, parameters=tuple(map(bind, recipe.parameters))), notes


def _things_below(recipe: Recipe, recipes: RecipeSet) -> Iterator[Thing]:
    """Yield the things in a recipe, and in the recipes that it calls."""
    recipe_of = {**recipes.recipes, recipe.iri: recipe}

    def called(iri: str) -> Iterator[str]:
        return (callee for step in recipe_of[iri].steps for callee in step.recipes if callee in recipe_of)

    for one in (recipe_of[iri] for iri in reached((recipe.iri,), called)):
        for parameters in (one.parameters, *(step.parameters for step in one.steps)):
            for parameter in parameters:
                if isinstance(parameter.filler, Thing):
                    yield parameter.filler
                elif isinstance(parameter.filler, Place):
                    yield from parameter.filler.things()


DATA_PROPERTY = OWL.DatatypeProperty
AGENTS = frozenset({"performedBy", "doneBy"})
"""Properties for the performer of an action, which the plan ignores: it is always the robot."""


UNDEFINED = "define it with its class, or as outputsCreated of the step that makes it"


@check("R032", "R033", "R035", "R037", "R049")
def fillers(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report values, things and places that do not fit the property that they fill.

    Names are checked as the file states them for a task and its sub-actions, including statements that are dropped
    later; ranges are checked after repairs. An undefined name is reported once.
    """
    reported = {one.span for one in wrong_kinds(checked)}
    yield from (one for one in _fillers(checked) if one.code != "R032" or one.span not in reported)


def _fillers(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    ontology = checked.ontology
    yield from unread_expressions(checked)
    undefined: set[Term] = set(checked.created)
    reported = set(undefined)
    for owner, more in _owners(checked):
        for filling in _stated(ontology, owner, more):
            if filling.term not in undefined:
                problems = list(_filler(ontology, owner, filling))
                yield from (one for one in problems if one.code != "R049" or filling.term not in reported)
                if isinstance(filling.term, str) and any(one.code in ("R033", "R049") for one in problems):
                    undefined.add(filling.term)
                    reported.add(filling.term)
                yield from _references(ontology, filling, reported)
    for one in checked.owners:
        yield from _out_of_range(ontology, one, checked.created)


@check("R031")
def unlisted_properties(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report properties that the vocabulary does not list for the class of the action."""
    ontology = checked.ontology
    for owner, more in _owners(checked):
        cls = owner if ontology.is_class(owner) else action_class(ontology, owner) or owner
        listed = checked.actions.properties(cls)
        for filling in _stated(ontology, owner, more) if listed else ():
            if filling.property in listed or is_word(filling.property, *OUTPUTS):  # any action may create something
                continue
            short = local_name(filling.property)
            message = f"{short} is not a property of actions such as `{local_name(owner)}`; it is kept"
            if not is_vocabulary(short) and not ontology.is_property(filling.property):
                message = f"the property {short} of `{local_name(owner)}` is not declared; it is kept"
            yield warning(
                "R031", message, filling.span, f"listed properties: {', '.join(sorted(map(local_name, listed)))}"
            )


@check("R038")
def left_out(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report facts of individuals, and statements about places, that have no effect."""
    yield from _unused_facts(checked.ontology, [owner for owner, _ in _owners(checked)])
    for owner in checked.owners:
        for parameter in owner.parameters:
            if isinstance(parameter.filler, Place):
                for place in parameter.filler.places():
                    yield from statements_without_use(checked.ontology, place)


def _owners(checked: CheckedRecipe) -> Iterator[tuple[str, tuple[Filling, ...]]]:
    """Yield the task and its sub-actions (IRIs), with the properties filled where they are mentioned."""
    yield checked.statements.iri, checked.statements.fillings
    for sub in checked.statements.sub_actions:
        if sub.iri is not None:
            yield sub.iri, sub.fillings


def _stated(ontology: Ontology, owner: str, more: tuple[Filling, ...]) -> Iterator[Filling]:
    """Yield all stated fillers of an action (IRI), nearest first."""
    return chain.from_iterable(fillings(ontology, owner, more))


def _out_of_range(ontology: Ontology, owner: Step | Recipe, created: frozenset[str]) -> Iterator[Diagnostic]:
    """Report fillers of a step, or of the task itself, outside the range of their property."""
    for parameter in owner.parameters:
        filler = parameter.filler
        match filler:
            case Thing():
                like = expand("HolderGripper") if filler.kind is Kind.DEVICE else filler.stated  # arms are body parts
                cls, is_wrong = filler.stated, violates_range(ontology, parameter.property, like)
                is_individual = filler.iri is not None
            case Place() | Name() if filler.iri not in created:
                classes = classes_of(ontology, filler.iri)
                cls, is_individual = next(iter(classes), filler.iri), classes != (filler.iri,)
                is_wrong = all(violates_range(ontology, parameter.property, one) for one in classes or (cls,))
            case _:
                continue
        if is_wrong:
            required = " and ".join(f"`{local_name(one)}`" for one in ranges_of(ontology, parameter.property))
            described = f"`{filler.name}`" + (f" (a `{local_name(cls)}`)" if is_individual else "")
            message = f"{parameter.property} of `{owner.name}` is {described}, but must be a {required}"
            yield warning("R032", message, parameter.span, "check the property and the class of its filler")


def _references(ontology: Ontology, filling: Filling, reported: set[Term]) -> Iterator[Diagnostic]:
    """Report things of unknown kind that a place refers to, except those in ``reported``, to which they are added."""
    if isinstance(filling.term, str) and is_place(ontology, filling.term):
        for relation, other in references_of_unknown_kind(ontology, filling.term):
            if other not in reported:
                reported.add(other)
                what = f"{RELATIONS[relation].owl} of the place `{local_name(filling.term)}`"
                yield _of_unknown_kind(ontology, what, other, ontology.span(filling.term) or filling.span)


def _unused_facts(ontology: Ontology, owners: list[str]) -> Iterator[Diagnostic]:
    """Report facts of individuals with properties that actions do not have, one message per property."""
    spans_of: dict[str, dict[str, Span]] = {}
    for owner in owners:
        if not ontology.is_class(owner):
            for fact in unread_facts(ontology, owner):
                if is_interval_relation(fact.property):
                    continue
                spans_of.setdefault(fact.property, {}).setdefault(owner, fact.span)
    for name, spans in spans_of.items():
        owner, span = next(iter(spans.items()))
        others = f" and {len(spans) - 1} more" if len(spans) > 1 else ""
        message = f"{local_name(name)} of `{local_name(owner)}`{others} is ignored: it is not a property of actions"
        cls = action_class(ontology, owner)
        listed = ontology.valid_properties(cls) if cls is not None else ()
        advice = "use a property of actions if the plan needs it"
        if listed:
            advice += f": {', '.join(sorted(map(local_name, listed)))}"
        yield warning("R038", message, span, advice)


def _filler(ontology: Ontology, owner: str, filling: Filling) -> Iterator[Diagnostic]:
    short, term, span = local_name(shorten(filling.property)), filling.term, filling.span
    kinds = ontology.values(filling.property, RDF.type)
    if isinstance(term, Literal):
        yield from _literal(ontology, owner, filling.property, term, span)
        if OBJECT_PROPERTY in kinds and DATA_PROPERTY not in kinds:
            message = f"{short} of `{local_name(owner)}` is the value {term.value!r}, but must be a thing or a place"
            yield warning("R032", message, span, "name a class or an individual")
        return
    unread = unread_filling(ontology, owner, filling)
    if unread is not None:
        # no step acts on who performs it, always the robot, nor on the kind of room in which it happens
        is_ignored = short in (*AGENTS, "eventOccursAt") or not is_vocabulary(short)
        yield replace(unread, severity=Severity.WARNING) if is_ignored else unread
    if isinstance(term, BNode):
        return
    if takes_numbers(ontology, filling.property) and not term.startswith(XSD):
        message = f"{short} of `{local_name(owner)}` is `{local_name(term)}`, but must be a number"
        yield error("R032", message, span, f"write a number in its place, such as `{short} value 0.5`")
        return
    if DATA_PROPERTY in kinds and OBJECT_PROPERTY not in kinds:
        message = f"{short} of `{local_name(owner)}` is `{local_name(term)}`, but must be a value"
        yield warning("R032", message, span, 'write a value, such as 0.5 or "text"')
        return
    if read_filler(ontology, term) is None:
        message = f"{short} of `{local_name(owner)}` is `{local_name(term)}`, which is not defined"
        severity = Severity.ERROR
        if short in AGENTS or not is_vocabulary(short):
            message, severity = f"{message}; it is ignored", Severity.WARNING
        suggestion = _similar(ontology, term)
        yield Diagnostic(severity, "R033", message, span, _question(suggestion), suggestion)
    elif (
        takes_things(ontology, filling.property)
        and is_of_unknown_kind(ontology, term)
        and not is_place(ontology, term)
        and not names_device(ontology, term, filling.property)
    ):
        yield _of_unknown_kind(ontology, f"{short} of `{local_name(owner)}`", term, span)
    for missing in unread_references(ontology, term):
        message = f"`{local_name(term)}` refers to `{local_name(missing)}`, which is not defined"
        suggestion = _similar(ontology, missing)
        yield error("R033", message, ontology.span(term) or span, _question(suggestion), suggestion)


def _of_unknown_kind(ontology: Ontology, what: str, term: str, span: Span) -> Diagnostic:
    """Report a filler, or a thing that a place refers to, of an unknown class."""
    cls = next(iter(classes_of(ontology, term)), term)
    other = classes_of_vocabulary(ontology).guess(cls, SURE) or class_called(ontology, cls)
    is_what = f", of the class `{local_name(cls)}`" if cls != term else ""
    message = f"{what} is `{local_name(term)}`{is_what}, which is not a subclass of a known class; treated as an object"
    advice = f"make `{local_name(cls)}` a subclass of one such as HumanScaleObject, or import the file that does"
    return warning("R049", message, span, f"did you mean {other}? If not, {advice}" if other else advice, other)


def _literal(ontology: Ontology, owner: str, property_name: str, literal: Literal, span: Span) -> Iterator[Diagnostic]:
    """Check a value: a number where its type or the property requires one, in a unit of the property's dimension."""
    name, short = unit_of(literal), local_name(shorten(property_name))
    used, required = None if name is None else unit(name), dimension_of(short)
    if used is not None and required is not None and used.dimension != required:
        message = (
            f"{short} of `{local_name(owner)}` is in {name} ({si_unit(used.dimension)}),"
            f" but needs a unit of {si_unit(required)}"
        )
        yield error("R037", message, span, f"convert it to {si_unit(required)}")
        return
    is_numeric = local_name(literal.datatype or "") in NUMERIC
    if name is not None or is_numeric or takes_numbers(ontology, property_name):
        value = read_literal(ontology, literal, property_name)
        if isinstance(value, str | bool):
            message = f"{short} of `{local_name(owner)}` is {literal.value!r}, which is not a number"
            yield error("R037", message, span, "write a number, such as 0.5")
            return
    if name is not None and used is None:
        message = f"{short} of `{local_name(owner)}` is in {name}, an unknown unit; the number is read without it"
        yield warning("R037", message, span, "use a unit of QUDT, such as Meter, SecondTime or MeterPerSecond")


def _similar(ontology: Ontology, undefined: str) -> Rename | None:
    """Find a name of the main document or a class of the vocabulary that is like an undefined one, or is so called."""
    in_file, in_vocabulary = names_of_file(ontology), classes_of_vocabulary(ontology)
    called = class_called(ontology, undefined)
    return in_file.guess(undefined, SURE) or called or in_file.guess(undefined) or in_vocabulary.guess(undefined, SURE)


def _question(suggestion: Rename | None) -> str:
    return f"did you mean {suggestion}?" if suggestion else UNDEFINED


ANNOTATION_PROPERTY = OWL.AnnotationProperty

_NO_NAME = re.compile(r"pose|posture|position|[\W_\d]+", re.IGNORECASE)
"""Uninformative parts of a posture's name."""


@check("R036")
def unrelated_places(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report places without relations that are not a posture of the robot."""
    created = checked.created
    for owner in checked.owners:
        for parameter in owner.parameters:
            if isinstance(parameter.filler, Place) and parameter.filler.iri not in created:
                yield from _unrelated(checked.actions, owner, parameter.filler, parameter.span)


def _unrelated(actions: Actions, owner: Step | Recipe, place: Place, span: Span | None) -> Iterator[Diagnostic]:
    """Report a place without relations: an error for the base, a warning for the hand unless it names a posture."""
    if not place.is_posture or place.pose is not None:
        return
    is_own = actions.ontology.main(place.iri)  # else blame the step, not the vocabulary
    where = (actions.ontology.span(place.iri) if is_own else None) or span
    reference = "anything" if not any(references(actions.ontology, place.iri)) else "anything with a position"
    target = f"`{place.name}`" if is_own else f"a place of your own below `{place.name}`, and name that"
    advice = f"add one of {', '.join(owl_properties())} to {target}"
    if isinstance(owner, Step) and actions.is_base_motion(owner):
        message = f"`{owner.name}` moves the base to `{place.name}`, which has no relation to {reference}"
        yield error("R036", message, where, advice)
    elif _NO_NAME.sub("", place.name).lower() not in postures():
        message = (
            f"`{place.name}`, a place of `{owner.name}`, has no relation to {reference}, and no bundled robot"
            f" has a posture of that name"
        )
        yield warning("R036", message, where, f"{advice}; known postures: {', '.join(sorted(postures()))}")


def statements_without_use(ontology: Ontology, place: Place) -> Iterator[Diagnostic]:
    """Report statements about a place that are not spatial relations (R038)."""
    stated = [(triple.predicate, triple.span) for triple in ontology.triples(s=place.iri)]
    stated = [one for one in stated if one[0].partition("#")[0] not in _LANGUAGES]
    stated += [(one.property, one.span) for one in ontology.restrictions(place.iri)]
    for property_name, span in dict(reversed(stated)).items() if place.pose is None else ():
        if is_relation(property_name) or ANNOTATION_PROPERTY in ontology.values(property_name, RDF.type):
            continue
        short = local_name(property_name)
        whole = [name for name in owl_properties() if name.partition("-")[0] == short]  # inFrontOf-Generally
        suggestion = guess(property_name, map(expand, whole or owl_properties()), least=0.5 if whole else 0.75)
        advice = f"did you mean {suggestion}?" if suggestion else f"relations: {', '.join(owl_properties())}"
        message = f"{short} of the place `{place.name}` is ignored: it is not a relation"
        yield warning("R038", message, span, advice, suggestion)


_LANGUAGES = {iri.partition("#")[0] for iri in (RDF.type, RDFS.label, RDFS.comment, OWL)}


@cache
def postures() -> frozenset[str]:
    """Names of the postures of bundled robots, without separators."""
    names: set[str] = set()
    for path in (bundled("ontologies") / "robots").glob("*.toml"):
        names |= set(tomllib.loads(path.read_text(encoding="utf-8")).get("postures", {}))
    return frozenset(_NO_NAME.sub("", name).lower() for name in names)


@check("R039")
def unused_names(checked: CheckedFile) -> Iterator[Diagnostic]:
    """Report location designators (a warning) and things (a note) of the main document that nothing refers to.

    In a file that is also a map, because things have positions, unused things are not reported.
    """
    ontology = checked.ontology
    places, things = unused_designators(ontology)
    if places:
        yield _unused(ontology, Severity.WARNING, "location designator", places)
    if things:
        yield _unused(ontology, Severity.NOTE, "thing", things)


def unused_designators(ontology: Ontology) -> tuple[list[str], list[str]]:
    """Find unused location designators and unused things of the main document, in the order of the file.

    There are no unused things if the file is also a map. Supporting planes and things with roles count as used, because
    action tables and workflows refer to them indirectly.
    """
    used = {triple.subject for triple in ontology.using("supportedObject", "hasRole", "isClassifiedBy")}
    places: list[str] = []
    things: list[str] = []
    is_map = any(True for _ in ontology.triples(p="eventOccursAt"))
    for name in ontology.unused():
        if ontology.is_class(name) or name in used:
            continue
        if is_place(ontology, name):
            places.append(name)
        elif not is_map and read_thing(ontology, name) is not None:
            things.append(name)
    for names in (places, things):
        names.sort(key=lambda name: (ontology.span(name) or Span(""), name))
    return places, things


def _unused(ontology: Ontology, severity: Severity, what: str, names: list[str]) -> Diagnostic:
    message = f"unused {what}{'s' if len(names) > 1 else ''}: {listing(names)}"
    spans = [span for span in map(ontology.span, names) if span is not None]
    return Diagnostic(severity, "R039", message, min(spans, default=None), "remove it, or refer to it in a parameter")
