"""From what a file states to the recipe model: which recipe performs a class, its steps, and what is among them.

Everything that the file says is kept, right or wrong; :mod:`planlang.recipe.checks` judges it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from planlang.ontology import BNode, Literal, Ontology, expand, shorten
from planlang.recipe.actions import Actions
from planlang.recipe.fillings import action_class, read_parameters
from planlang.recipe.intervals import implied_by_overlaps
from planlang.recipe.model import Description, Ordering, Parameter, Reason, Recipe, Step
from planlang.recipe.readers.data_flow import made
from planlang.recipe.statements import KINDS, Statements, SubAction, facts, is_word
from planlang.recipe.terms import nearest_in_vocabulary, read_filler


def recipes_for(actions: Actions, iri: str) -> tuple[tuple[str, ...], str | None]:
    """Who performs an action: the classes whose recipes do, or the primitive class that does; the nearer wins.

    An individual's own recipe is nearer than any of its class. On a tie the recipe wins. Several recipes at the same
    distance are alternatives.
    """
    if iri not in actions.performers:
        actions.performers[iri] = _performers(actions, iri)
    return actions.performers[iri]


def _performers(actions: Actions, iri: str) -> tuple[tuple[str, ...], str | None]:
    for level in levels(actions.ontology, iri):
        found = tuple(ancestor for ancestor in level if actions.statements(ancestor) is not None)
        if found:
            return found, None
        for ancestor in level:
            if ancestor in actions.primitives:
                return (), ancestor
    return (), None


def levels(ontology: Ontology, iri: str) -> Iterator[tuple[str, ...]]:
    """An individual; a class, its direct superclasses, theirs, ...: each class once, at its least distance."""
    cls = iri
    if not ontology.is_class(iri):
        yield (iri,)
        cls = action_class(ontology, iri) or iri
    known = set(ontology.ancestors(cls))
    seen = {cls, iri}
    level: tuple[str, ...] = (cls,) if cls != iri or ontology.is_class(iri) else ()
    while level:
        yield level
        above: list[str] = []
        for member in level:
            for ancestor in ontology.parents(member):
                if ancestor in known and ancestor not in seen:
                    seen.add(ancestor)
                    above.append(ancestor)
        level = tuple(above)


def read_step(actions: Actions, sub_action: SubAction, known: frozenset[str] = frozenset()) -> Step | None:
    """A sub-action as a step; None if it names nothing that is defined.

    ``known`` are individuals that need not be defined, as another step creates them.
    """
    ontology, iri = actions.ontology, sub_action.iri
    if iri is None or not ontology.defined(iri):
        return None
    cls = None if ontology.is_class(iri) else action_class(ontology, iri)
    recipes, primitive = recipes_for(actions, iri)
    return Step(
        iri,
        nearest_in_vocabulary(ontology, cls or iri, primitive),
        read_parameters(ontology, iri, sub_action.fillings, known),
        recipes,
        primitive,
        _label(ontology, iri) if shorten(iri) == iri else None,
        sub_action.span,
        cls,
        _condition(ontology, cls or iri),
    )


def read_recipe_of(actions: Actions, stating: str, task: str | None = None) -> Recipe:
    """The recipe that a class or an individual states: repeated and undefined sub-actions left out.

    ``task`` is what it is read for, when that inherits it. Raises KeyError if it states none.
    """
    ontology, statements = actions.ontology, actions.statements(stating)
    if statements is None:
        raise KeyError(stating)
    task = task or statements.iri
    known = made(ontology, statements)
    steps: dict[str, Step] = {}
    for sub_action in (*statements.sub_actions, *_states(actions, statements)):
        if sub_action.iri is None or sub_action.iri not in steps:
            step = read_step(actions, sub_action, known)
            if step is not None:
                steps[step.iri] = step
    cls = None if ontology.is_class(task) else action_class(ontology, task)
    recipe = Recipe(
        task,
        nearest_in_vocabulary(ontology, cls or task),
        tuple(steps.values()),
        () if statements.is_finite_state else statements.orderings,
        read_parameters(ontology, task, statements.fillings, known),
        _label(ontology, task),
        ontology.span(task),
        statements.dialect,
        statements.overlaps,
        statements.flows,
        statements.machine,
        cls,
    )
    implied = [Ordering(before, after, reason=Reason.OVERLAP) for before, after in implied_by_overlaps(recipe)]
    return replace(recipe, orderings=(*recipe.orderings, *implied)) if implied else recipe


def _states(actions: Actions, statements: Statements) -> Iterator[SubAction]:
    """States that transitions name and something defines, though they are no sub-actions."""
    if statements.is_finite_state:
        span = actions.ontology.span(statements.iri)
        for name in statements.mentioned():
            where = actions.ontology.span(name) or span
            if where is not None and name not in statements.names:
                yield SubAction(name, (), where)


def _label(ontology: Ontology, iri: str) -> str | None:
    """What an action says in words: its label, else what an action data table says about it."""
    label = ontology.label(iri)
    for filling in () if label is not None else facts(ontology, iri, "instruction", "taskContext"):
        if isinstance(filling.term, Literal):
            return filling.term.value
    return label


def _condition(ontology: Ontology, cls: str) -> Description | None:
    """What a class of actions checks: the class expression, class or individual that ``conditionEvaluated`` names."""
    known: dict[str, Description | None] = ontology.kept.setdefault("conditions", {})
    for ancestor in ontology.ancestors(cls):
        if ancestor not in known:
            known[ancestor] = _stated_condition(ontology, ancestor)
        if known[ancestor] is not None:
            return known[ancestor]
    return None


def _stated_condition(ontology: Ontology, cls: str) -> Description | None:
    for restriction in ontology.restrictions(cls):
        if is_word(restriction.property, "conditionEvaluated") and restriction.kind in KINDS:
            return read_description(ontology, restriction.filler)
    return None


def read_description(ontology: Ontology, term: object) -> Description | None:
    """A class with restrictions as a description; None if it names no class."""
    if isinstance(term, str):
        return Description(term)
    if not isinstance(term, BNode):
        return None
    cls = next((member for member in ontology.members(term) if isinstance(member, str)), expand("Situation"))
    parameters = []
    for restriction in ontology.restrictions(term):
        filler = read_filler(ontology, restriction.filler, restriction.property)
        if restriction.kind in KINDS and filler is not None:
            parameters.append(Parameter(shorten(restriction.property), filler, restriction.span))
    return Description(cls, tuple(parameters))
