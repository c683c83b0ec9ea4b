"""Reading and checking a recipe: choose its task, read the recipes below it, report all problems in one run."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from graphlib import CycleError, TopologicalSorter
from typing import TypeVar

from planlang.designators import is_called, local_name
from planlang.diagnostics import BadInput, Diagnostic, Severity, Span, error
from planlang.files import printable
from planlang.kept import kept
from planlang.ontology import BNode, Literal, Ontology, expand, shorten
from planlang.ontology.terms import UPPER
from planlang.recipe.actions import Actions, best_recipes, recipes_for, recipes_of_task, statements_for
from planlang.recipe.checks import (
    Check,
    CheckedFile,
    CheckedRecipe,
    check,
    fillers,
    leaving,
    loops,
    losses,
    orderings,
    parameters,
    resources,
    steps,
)
from planlang.recipe.checks.misspellings import misspellings, with_corrections
from planlang.recipe.checks.parameters import with_repairs
from planlang.recipe.constraints import read_constraints
from planlang.recipe.fillers import action_class, nearest_in_vocabulary, read_filler, read_parameters
from planlang.recipe.inheritance import with_filled_slots
from planlang.recipe.model import Description, Ordering, Parameter, Reason, Recipe, RecipeSet, Source, Step
from planlang.recipe.order import implied_by_overlaps
from planlang.recipe.readers import created_individuals, loose_parts, tasks_of
from planlang.recipe.statements import KINDS, Statements, SubAction, facts, is_word
from planlang.records import dataclass
from planlang.spelling import guess
from planlang.words import Option, Text

_TYPE = "http://www.w3.org/1999/02/22-rdf-syntax-ns#type"


def stated_tasks(actions: Actions) -> tuple[str, ...]:
    """Classes and individuals of the main document that state a recipe, in the order of the file."""
    ontology = actions.ontology
    tasks = [task for task in tasks_of(ontology) if actions.statements(task) is not None]
    spans = {task: ontology.span(task) or Span("") for task in tasks}
    return tuple(sorted(tasks, key=lambda task: (spans[task].line, spans[task].column, task)))


def top_tasks(actions: Actions) -> tuple[str, ...]:
    """Stated tasks that no other task uses, in a sub-action or a constraint."""
    tasks = stated_tasks(actions)
    used: set[str] = set()
    for task in tasks:
        used |= _below(actions, task) - {task}
    return tuple(task for task in tasks if task not in used)


@check("R001", "R002", "R003", "R004", unless=("R022",))
def choose_task(actions: Actions, wanted: str | None = None) -> str:
    """Choose the task to compile: ``wanted`` by IRI or local name, else the only top task of the file. Gives its IRI.

    Raises BadInput if there is none, or several.
    """
    ontology = actions.ontology
    span = Span(str(ontology.documents[0].path))
    if wanted is not None:
        return _named(actions, wanted, span)
    tops = top_tasks(actions)
    if len(tops) == 1:
        return tops[0]
    stated = stated_tasks(actions)
    if not stated:
        problems = loose_parts(ontology)
        if problems:
            raise BadInput(problems)
        what, advice = _no_recipe(ontology)
        raise BadInput([error("R001", f"no class or individual of this file states sub-actions{what}", span, advice)])
    names = ", ".join(local_name(task) for task in tops or stated)
    advice = Text("choose one with ", Option("task"), f": {names}")
    if tops:
        raise BadInput([error("R002", f"this file has {len(tops)} tasks", span, advice)])
    message = "every task of this file is a sub-action of another one, so there is no top task"
    raise BadInput([error("R002", message, span, advice)])


RECORDED = frozenset(
    ("isExecutedIn", "executesTask", "isPerformedBy", "hasTimeInterval", "includesRecord", "hasParticipant", "hasRole")
)
"""Properties of what was done (local names), in narratives of DUL and SOMA."""


def _no_recipe(ontology: Ontology) -> tuple[str, str]:
    """Say what a file without a task is, if it is in SOMA's words, and how a recipe is written."""
    advice = "a recipe is an action class with restrictions such as `subAction some Reaching`"
    document = ontology.documents[0]
    own = [triple for triple in ontology.triples() if triple.span.file == str(document.path)]
    used = {term for triple in own for term in (triple.predicate, triple.object) if isinstance(term, str)}
    if not any(term.startswith(UPPER) for term in used):
        return "", advice
    advice = (
        "a recipe in SOMA's words is a dul:Workflow with `dul:definesTask` and `soma:hasStep`: tasks, such as "
        "individuals of soma:PickingUp, with `soma:before` between them"
    )
    if any(local_name(triple.predicate) in RECORDED for triple in own):
        return ": in SOMA's words, it tells what was done (a NEEM), not what to do", advice
    if any(ontology.is_individual(triple.subject) for triple in own if isinstance(triple.subject, str)):
        advice += "; a map states soma:hasShape and soma:hasLocalization of its objects"
        return ": it is in SOMA's words, and has neither a workflow nor objects with a pose", advice
    return ": in SOMA's words, it defines classes", advice


def circular_task(actions: Actions) -> str | None:
    """First stated task that is a sub-action of itself, directly or not; None if there is none."""
    tasks = stated_tasks(actions)
    below = {task: sorted(_below(actions, task)) for task in tasks}
    try:
        TopologicalSorter(below).prepare()
    except CycleError as found:
        circle: list[str] = found.args[1]
        return min(circle, key=tasks.index)
    return None


def _below(actions: Actions, task: str) -> set[str]:
    """Tasks that a task uses, in a sub-action or a constraint."""
    statements = actions.statements(task)
    assert statements is not None
    below = set(statements.mentioned())
    below |= {way.iri for sub in statements.sub_actions for _, way in sub.alternatives if way.iri is not None}
    return below | {recipe for name in below for recipe in recipes_for(actions, name)[0]}


def _named(actions: Actions, wanted: str, span: Span) -> str:
    task, ontology = named_action(actions, wanted, span), actions.ontology
    if recipes_of_task(actions, task):
        return task
    where = ontology.span(task) or span
    advice = "add restrictions such as `subAction some Reaching` to it, or choose another task"
    raise BadInput([error("R004", f"`{local_name(task)}` has no sub-actions: the recipe is empty", where, advice)])


def named_action(actions: Actions, wanted: str, span: Span) -> str:
    """Find the class or individual with an IRI or local name.

    Recipes of the file come first, then other names of the file, then the vocabulary, then other documents. Raises
    BadInput if there is none, or several.
    """
    ontology = actions.ontology
    stated = stated_tasks(actions)
    matches = [task for task in stated if is_called(task, wanted)]
    if not matches:
        own = [triple.subject for triple in ontology.triples(p=_TYPE) if isinstance(triple.subject, str)]
        named = [iri for iri in dict.fromkeys(own) if is_called(iri, wanted) and ontology.defined(iri)]
        main = [iri for iri in named if ontology.main(iri)]
        matches = main or [iri for iri in named if iri == expand(wanted)] or named
        matches = matches or [wanted if ontology.defined(wanted) else expand(wanted)]
    task = matches[0]
    if len(matches) > 1:
        raise BadInput([error("R002", f"{wanted} names several tasks", span, "use one of " + ", ".join(matches))])
    if not ontology.defined(task):
        known = [local_name(name) for name in stated]
        suggestion = guess(wanted, known) or guess(wanted, map(local_name, ontology.subclasses(expand("Action"))))
        advice = f"{suggestion}this file states {', '.join(known) or 'none'}"
        raise BadInput([error("R001", f"there is no task {wanted}", span, advice)])
    return task


def read_recipes(actions: Actions, task: str) -> RecipeSet:
    """Read the recipe of a task and all recipes below it, the task first, then in order of use.

    A task without sub-actions inherits the recipe of its nearest ancestor that has one.
    """
    recipes: dict[str, Recipe] = {}
    waiting: list[tuple[str, str, Recipe | None]] = [(task, recipes_of_task(actions, task)[0], None)]
    while waiting:
        cls, stating, within = waiting.pop()
        if cls in recipes:
            continue
        recipe = read_recipe_of(actions, stating, cls)
        if within is not None:
            inherited = (replace(one, is_inherited=True) for one in within.parameters)
            recipe = replace(recipe, parameters=tuple(inherited), within=within.within or within.iri)
        recipes[cls] = recipe
        below = [(callee, recipe if step.is_choice else None) for step in recipe.steps for callee in step.recipes]
        waiting += [(callee, callee, enclosing) for callee, enclosing in reversed(below) if callee not in recipes]
    document = actions.ontology.documents[0]
    return RecipeSet(task, recipes, Source(printable(document.path.name), document.sha256))


def read_step(actions: Actions, sub_action: SubAction, created: frozenset[str] = frozenset()) -> Step | None:
    """Read a sub-action as a step; None if it names nothing that is defined.

    ``known`` are individuals that another step creates, which may be undefined.
    """
    ontology, iri = actions.ontology, sub_action.iri
    if sub_action.alternatives:
        return _read_choice(ontology, sub_action)
    if iri is None or not ontology.defined(iri):
        return None
    cls = None if ontology.is_class(iri) else action_class(ontology, iri)
    recipes, primitive = recipes_for(actions, iri)
    parameters = read_constraints(ontology, read_parameters(ontology, iri, sub_action.fillings, created))
    conditions = (_stated_condition(ontology, ancestor) for ancestor in ontology.ancestors(cls or iri))
    return Step(
        iri,
        nearest_in_vocabulary(ontology, cls or iri, primitive),
        parameters,
        best_recipes(actions, recipes, parameters),
        primitive,
        _label(ontology, iri) if shorten(iri) == iri else None,
        sub_action.span,
        cls,
        next(filter(None, conditions), None),
    )


def _read_choice(ontology: Ontology, sub_action: SubAction) -> Step:
    """Read a union of classes as a step; the class of an anonymous union is the nearest common ancestor."""
    assert sub_action.iri is not None
    iri, members = sub_action.iri, [member.iri for _, member in sub_action.alternatives if member.iri is not None]
    cls = None if ontology.is_class(iri) else action_class(ontology, iri)
    if not ontology.defined(iri):
        above = [ontology.ancestors(member) for member in members]
        cls = next((one for one in above[0] if all(one in others for others in above)), None) if above else None
    label = _label(ontology, iri)
    labels = [(_label(ontology, member), local_name(member)) for member in members]
    if label is None and any(own for own, _ in labels):
        label = ", else ".join(own or name for own, name in labels)
    names = tuple(name for name, _ in sub_action.alternatives)
    action = nearest_in_vocabulary(ontology, cls or iri)
    return Step(iri, action, (), names, None, label, sub_action.span, cls, is_choice=True)


def read_recipe_of(actions: Actions, stating: str, task: str | None = None) -> Recipe:
    """Read the recipe that a class or an individual states, without repeated and undefined sub-actions.

    ``task`` is the task that inherits the recipe, if any. Raises KeyError if ``stating`` states no recipe.
    """
    ontology, statements = actions.ontology, actions.statements(stating)
    if statements is None:
        raise KeyError(stating)
    task = task or statements.iri
    created = created_individuals(ontology, statements)
    steps: dict[str, Step] = {}
    for sub_action in (*statements.sub_actions, *_states(actions, statements)):
        if sub_action.iri is None or sub_action.iri not in steps:
            step = read_step(actions, sub_action, created)
            if step is not None:
                steps[step.iri] = step
    cls = None if ontology.is_class(task) else action_class(ontology, task)
    span = ontology.span(task)
    syntaxes = (one.syntax for one in ontology.documents if span is not None and str(one.path) == span.file)
    recipe = Recipe(
        task,
        nearest_in_vocabulary(ontology, cls or task),
        tuple(steps.values()),
        statements.orderings if statements.states is None else (),
        read_parameters(ontology, task, statements.fillings, created),
        _label(ontology, task),
        span,
        statements.dialect,
        statements.overlaps,
        statements.flows,
        statements.states.machine() if statements.states is not None else None,
        cls,
        statements.phases,
        syntax=next(syntaxes, None),
    )
    implied = [Ordering(before, after, reason=Reason.OVERLAP) for before, after in implied_by_overlaps(recipe)]
    return replace(recipe, orderings=(*recipe.orderings, *implied)) if implied else recipe


def _states(actions: Actions, statements: Statements) -> Iterator[SubAction]:
    """Yield the defined states that transitions name but that are not listed as sub-actions."""
    if statements.states is not None:
        span, listed = actions.ontology.span(statements.iri), {*statements.names}
        for name in statements.mentioned():
            where = actions.ontology.span(name) or span
            if where is not None and name not in listed:
                yield SubAction(name, (), where)


def _label(ontology: Ontology, iri: str) -> str | None:
    """Description of an action: its label, else the text of its action data table."""
    label = ontology.label(iri)
    for filling in () if label is not None else facts(ontology, iri, "instruction", "taskContext"):
        if isinstance(filling.term, Literal):
            return filling.term.value
    return label


@kept
def _stated_condition(ontology: Ontology, cls: str) -> Description | None:
    for restriction in ontology.restrictions(cls):
        if is_word(restriction.property, "conditionEvaluated") and restriction.kind in KINDS:
            return read_description(ontology, restriction.filler)
    return None


def read_description(ontology: Ontology, term: object) -> Description | None:
    """Read a class with restrictions as a description; None if it names no class."""
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


FILE_CHECKS: tuple[Check[[CheckedFile], Iterable[Diagnostic]], ...] = (
    steps.recursion,
    parameters.unused_names,
    losses.lost_statements,
    steps.requirements,
    fillers.declarations,
)
"""Checks of a whole file. Here as in the other lists, a check follows those that suppress it."""

ANY_RECIPE: tuple[Check[[CheckedRecipe], Iterable[Diagnostic]], ...] = (
    steps.undefined_sub_actions,
    steps.repeated_sub_actions,
    steps.foreign_words,
    steps.same_names,
    steps.abstract_steps,
    orderings.incomplete_constraints,
    parameters.unlisted_properties,
    fillers.wrong_kinds,
    fillers.unstated,
    parameters.fillers,
    parameters.left_out,
    parameters.unrelated_places,
    fillers.numbers_of_references,
    fillers.incomplete_constraints,
)
"""Checks of recipes in any dialect."""

ORDERED_STEPS: tuple[Check[[CheckedRecipe], Iterable[Diagnostic]], ...] = (
    orderings.ordered_strangers,
    orderings.cycles,
    orderings.repeated_constraints,
    orderings.redundant_constraints,
    orderings.contradictions,
    orderings.late_preconditions,
    orderings.missing_orders,
    orderings.unordered_base_motions,
    resources.shared_resources,
    orderings.free_steps,
    leaving.left_behind,
)
"""Checks of recipes with a partial order of steps."""

FINITE_STATE: tuple[Check[[CheckedRecipe], Iterable[Diagnostic]], ...] = (
    steps.undefined_states,
    steps.unlisted_sub_actions,
    steps.starts_and_ends,
    steps.orders_of_states,
    steps.ambiguous_transitions,
    steps.unreachable_states,
    steps.uncovered_endings,
    steps.unhandled_failures,
    loops.one_of_several,
)
"""Checks of recipes whose steps are states."""

_Subject = TypeVar("_Subject")


@dataclass(frozen=True, slots=True)
class Reading:
    """Result of reading a file: its recipes, or None if no task was found, and all diagnostics.

    ``actions`` belong to the ontology as it was read, with ``misspelt`` names corrected. ``diagnostics`` include those
    of the ontology; misspellings come first, then the order is that of the lines.
    """

    recipes: RecipeSet | None
    diagnostics: tuple[Diagnostic, ...]
    actions: Actions
    misspelt: tuple[Diagnostic, ...] = ()


def read_recipe(actions: Actions, task: str | None = None, *, scopes: bool = True) -> Reading:
    """Read the task of the main document and all recipes below it, repair what is unambiguous, and check the result.

    User errors never raise; they are among the diagnostics.
    """
    misspelt = misspellings(actions.ontology)
    right = with_corrections(actions.ontology, misspelt)
    if right is not actions.ontology:
        actions = Actions(right, actions.performed)
    recipes, diagnostics = _read(actions, task, scopes=scopes)
    diagnostics = (*actions.ontology.diagnostics, *diagnostics)
    guessed = with_corrections(actions.ontology, misspelt, guessing=True)
    if guessed is not actions.ontology:  # problems that disappear with the guessed names only follow from the typo
        remaining = _read(Actions(guessed, actions.performed), task, scopes=scopes)[1]
        diagnostics = tuple(one for one in diagnostics if one in {*guessed.diagnostics, *remaining})
    return Reading(recipes, (*misspelt, *diagnostics), actions, misspelt)


def _read(actions: Actions, task: str | None, *, scopes: bool) -> tuple[RecipeSet | None, tuple[Diagnostic, ...]]:
    """Recipes, or None without a task, and their diagnostics."""
    try:
        chosen = choose_task(actions, task)
    except BadInput as problem:
        # tasks that use each other have no top task: start from any of them to report the cycle and its other problems
        circular = None if task is not None or top_tasks(actions) else circular_task(actions)
        if circular is None:
            return None, problem.diagnostics
        within = _read(actions, circular, scopes=scopes)[1]
        is_reported = choose_task.applies({one.code for one in within})
        return None, (*(problem.diagnostics if is_reported else ()), *within)
    recipes = read_recipes(actions, chosen)
    file = CheckedFile(actions, recipes, scopes)
    diagnostics = _checked(FILE_CHECKS, file, ())
    wrong = {one.code for one in diagnostics}
    if with_repairs.applies(wrong):
        recipes, notes = with_repairs(actions.ontology, recipes)
        diagnostics += notes
    if with_filled_slots.applies(wrong):
        recipes, missing = with_filled_slots(actions, recipes)
        diagnostics += missing
    file = replace(file, recipes=recipes)
    for recipe in recipes.recipes.values():
        statements = statements_for(actions, recipe.iri)
        checks = (*ANY_RECIPE, *(ORDERED_STEPS if statements.states is None else FINITE_STATE))
        diagnostics += _checked(checks, CheckedRecipe(file, recipe, statements), wrong)
    return recipes, _sorted(diagnostics)


def _checked(
    checks: Iterable[Check[[_Subject], Iterable[Diagnostic]]], subject: _Subject, before: Iterable[str]
) -> list[Diagnostic]:
    """Diagnostics of all checks that are not suppressed; ``before`` are codes that were reported earlier."""
    reported = set(before)
    diagnostics: list[Diagnostic] = []
    for one in checks:
        if one.applies(reported):
            new = list(one(subject))
            reported.update(diagnostic.code for diagnostic in new)
            diagnostics += new
    return diagnostics


def _sorted(diagnostics: Iterable[Diagnostic]) -> tuple[Diagnostic, ...]:
    """Each diagnostic once: errors, warnings, then notes, each by file and line."""
    rank = {severity: index for index, severity in enumerate(Severity)}
    nowhere = Span("")
    return tuple(sorted(dict.fromkeys(diagnostics), key=lambda found: (rank[found.severity], found.span or nowhere)))
