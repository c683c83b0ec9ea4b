"""Which task of a file is meant, and the recipes below it."""

from __future__ import annotations

from difflib import get_close_matches

from planlang.designators import local_name
from planlang.diagnostics import BadInput, Span, error
from planlang.ontology import Ontology, expand
from planlang.recipe.actions import Actions
from planlang.recipe.dialects import other_dialects
from planlang.recipe.model import Recipe, RecipeSet, Source
from planlang.recipe.reading import read_orderings, read_recipe_of, recipes_for, states_recipe, sub_actions

_TYPE = "http://www.w3.org/1999/02/22-rdf-syntax-ns#type"
_SUBCLASS = "http://www.w3.org/2000/01/rdf-schema#subClassOf"


def stated_tasks(ontology: Ontology) -> tuple[str, ...]:
    """The classes of the main document that state sub-actions, in the order of the file."""
    subjects: dict[str, None] = {}
    for predicate in (_TYPE, _SUBCLASS):
        for triple in ontology.triples(p=predicate):
            if isinstance(triple.subject, str) and ontology.main(triple.subject) and ontology.is_class(triple.subject):
                subjects[triple.subject] = None
    tasks = [subject for subject in subjects if states_recipe(ontology, subject)]
    lines = {task: ontology.span(task) or Span("") for task in tasks}
    return tuple(sorted(tasks, key=lambda task: (lines[task].line, lines[task].column)))


def top_tasks(ontology: Ontology, actions: Actions) -> tuple[str, ...]:
    """The stated tasks that no other one uses, by a sub-action or by a name in its ordering constraints."""
    tasks = stated_tasks(ontology)
    used: set[str] = set()
    for task in tasks:
        below = {sub_action.iri for sub_action in sub_actions(ontology, task) if sub_action.iri is not None}
        below |= {name for ordering in read_orderings(ontology, task) for name in (ordering.before, ordering.after)}
        below |= {recipe for name in below for recipe in recipes_for(ontology, name, actions.primitives)[0]}
        used |= below - {task}
    return tuple(task for task in tasks if task not in used)


def choose_task(ontology: Ontology, actions: Actions, wanted: str | None = None) -> str:
    """The IRI of the task to compile: ``wanted`` by IRI or local name, else the only top task of the file.

    Raises BadInput when there is none or several, or the file is written in a dialect that is not read.
    """
    span = Span(str(ontology.documents[0].path))
    if wanted is not None:
        return _named(ontology, actions, wanted, span)
    tops = top_tasks(ontology, actions)
    if len(tops) == 1:
        return tops[0]
    stated = stated_tasks(ontology)
    if not stated:
        found = other_dialects(ontology)
        if found:
            raise BadInput(found)
        advice = "a recipe is an action class with restrictions such as `subAction some Reaching`"
        raise BadInput([error("R001", "no class of this file states sub-actions", span, advice)])
    names = ", ".join(local_name(task) for task in tops or stated)
    advice = f"choose one with --task: {names}"
    if tops:
        raise BadInput([error("R002", f"this file holds {len(tops)} tasks", span, advice)])
    message = "each task of this file is a sub-action of another: there is no first one"
    raise BadInput([error("R002", message, span, advice)])


def _named(ontology: Ontology, actions: Actions, wanted: str, span: Span) -> str:
    stated = stated_tasks(ontology)
    matches = [task for task in stated if wanted in (task, local_name(task))]
    if not matches:
        full = wanted if ontology.is_class(wanted) else expand(wanted)
        own = [triple.subject for triple in ontology.triples(p=_TYPE) if isinstance(triple.subject, str)]
        matches = [iri for iri in dict.fromkeys(own) if local_name(iri) == wanted and ontology.is_class(iri)] or [full]
    task = matches[0]
    if len(matches) > 1:
        raise BadInput([error("R002", f"{wanted} names several tasks", span, "use one of " + ", ".join(matches))])
    if not ontology.is_class(task):
        known = {local_name(name): name for name in stated}
        similar = get_close_matches(wanted, known, n=1)
        guess = f"did you mean {similar[0]}? " if similar else ""
        raise BadInput(
            [error("R001", f"there is no task {wanted}", span, f"{guess}this file states {', '.join(known) or 'none'}")]
        )
    if recipes_for(ontology, task, actions.primitives)[0]:
        return task
    found = other_dialects(ontology, task)
    where = ontology.span(task) or span
    advice = "add restrictions such as `subAction some Reaching` to it, or choose another task"
    raise BadInput(
        found or [error("R004", f"`{local_name(task)}` has no sub-actions: the recipe is empty", where, advice)]
    )


def read_recipes(ontology: Ontology, actions: Actions, task: str) -> RecipeSet:
    """The recipe of a task and all recipes below it, the task first, then in the order of use.

    A task without sub-actions of its own takes those of its nearest ancestor that has any.
    """
    found: dict[str, Recipe] = {}

    def visit(cls: str, stating: str) -> None:
        recipe = read_recipe_of(ontology, stating, actions.primitives, cls)
        found[cls] = recipe
        for step in recipe.steps:
            for callee in step.recipes:
                if callee not in found:
                    visit(callee, callee)

    visit(task, recipes_for(ontology, task, actions.primitives)[0][0])
    document = ontology.documents[0]
    return RecipeSet(task, found, Source(document.path.name, document.sha256))
