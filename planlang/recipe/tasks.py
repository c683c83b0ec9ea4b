"""Which task of a file is meant, and the recipes below it."""

from __future__ import annotations

from difflib import get_close_matches
from graphlib import CycleError, TopologicalSorter

from planlang.designators import local_name
from planlang.diagnostics import BadInput, Span, error
from planlang.ontology import expand
from planlang.recipe.actions import Actions
from planlang.recipe.dialects import loose_parts
from planlang.recipe.model import Recipe, RecipeSet, Source
from planlang.recipe.readers import tasks_of
from planlang.recipe.reading import read_recipe_of, recipes_for

_TYPE = "http://www.w3.org/1999/02/22-rdf-syntax-ns#type"


def stated_tasks(actions: Actions) -> tuple[str, ...]:
    """The classes and individuals of the main document that state a recipe, in the order of the file."""
    ontology = actions.ontology
    tasks = [task for task in tasks_of(ontology) if actions.statements(task) is not None]
    spans = {task: ontology.span(task) or Span("") for task in tasks}
    return tuple(sorted(tasks, key=lambda task: (spans[task].line, spans[task].column, task)))


def top_tasks(actions: Actions) -> tuple[str, ...]:
    """The stated tasks that no other one uses, by a sub-action or by a name in its constraints."""
    tasks = stated_tasks(actions)
    used: set[str] = set()
    for task in tasks:
        used |= _below(actions, task) - {task}
    return tuple(task for task in tasks if task not in used)


def choose_task(actions: Actions, wanted: str | None = None) -> str:
    """The IRI of the task to compile: ``wanted`` by IRI or local name, else the only top task of the file.

    Raises BadInput when there is none or several.
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
        found = loose_parts(ontology)
        if found:
            raise BadInput(found)
        advice = "a recipe is an action class with restrictions such as `subAction some Reaching`"
        raise BadInput([error("R001", "nothing in this file states sub-actions", span, advice)])
    names = ", ".join(local_name(task) for task in tops or stated)
    advice = f"choose one with --task: {names}"
    if tops:
        raise BadInput([error("R002", f"this file holds {len(tops)} tasks", span, advice)])
    message = "each task of this file is a sub-action of another: there is no first one"
    raise BadInput([error("R002", message, span, advice)])


def circular_task(actions: Actions) -> str | None:
    """Of tasks of which each is, through others, a sub-action of its own, the first stated; None if there are none."""
    tasks = stated_tasks(actions)
    below = {task: sorted(_below(actions, task)) for task in tasks}
    try:
        TopologicalSorter(below).prepare()
    except CycleError as found:
        circle: list[str] = found.args[1]
        return min(circle, key=tasks.index)
    return None


def _below(actions: Actions, task: str) -> set[str]:
    """The tasks that one uses, by a sub-action or by a name in its constraints."""
    statements = actions.statements(task)
    assert statements is not None
    below = set(statements.mentioned())
    return below | {recipe for name in below for recipe in recipes_for(actions, name)[0]}


def _named(actions: Actions, wanted: str, span: Span) -> str:
    ontology = actions.ontology
    stated = stated_tasks(actions)
    matches = [task for task in stated if wanted in (task, local_name(task))]
    if not matches:
        own = [triple.subject for triple in ontology.triples(p=_TYPE) if isinstance(triple.subject, str)]
        named = [iri for iri in dict.fromkeys(own) if local_name(iri) == wanted and ontology.defined(iri)]
        matches = named or [wanted if ontology.defined(wanted) else expand(wanted)]
    task = matches[0]
    if len(matches) > 1:
        raise BadInput([error("R002", f"{wanted} names several tasks", span, "use one of " + ", ".join(matches))])
    if not ontology.defined(task):
        known = {local_name(name): name for name in stated}
        similar = get_close_matches(wanted, known, n=1)
        guess = f"did you mean {similar[0]}? " if similar else ""
        raise BadInput(
            [error("R001", f"there is no task {wanted}", span, f"{guess}this file states {', '.join(known) or 'none'}")]
        )
    if recipes_for(actions, task)[0]:
        return task
    where = ontology.span(task) or span
    advice = "add restrictions such as `subAction some Reaching` to it, or choose another task"
    raise BadInput([error("R004", f"`{local_name(task)}` has no sub-actions: the recipe is empty", where, advice)])


def read_recipes(actions: Actions, task: str) -> RecipeSet:
    """The recipe of a task and all recipes below it, the task first, then in the order of use.

    A task without sub-actions of its own takes those of its nearest ancestor that has any.
    """
    found: dict[str, Recipe] = {}
    waiting = [(task, recipes_for(actions, task)[0][0])]
    while waiting:
        cls, stating = waiting.pop()
        if cls in found:
            continue
        recipe = found[cls] = read_recipe_of(actions, stating, cls)
        below = [callee for step in recipe.steps for callee in step.recipes]
        waiting += [(callee, callee) for callee in reversed(below) if callee not in found]
    document = actions.ontology.documents[0]
    return RecipeSet(task, found, Source(document.path.name, document.sha256))
