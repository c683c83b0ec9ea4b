"""Checks of sub-actions: defined, executable, said once, without recursion; base motions in one order."""

from __future__ import annotations

from collections.abc import Iterator
from difflib import get_close_matches
from itertools import pairwise

from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, Severity, error, note
from planlang.ontology import Ontology, expand
from planlang.recipe.actions import Actions
from planlang.recipe.check_orderings import ordering_to_write
from planlang.recipe.graph import closed, recipe_graph, sorted_nodes
from planlang.recipe.model import Recipe, RecipeSet
from planlang.recipe.statements import Statements


def check_sub_actions(
    actions: Actions, statements: Statements, recipe: Recipe, *, allow_abstract: bool
) -> Iterator[Diagnostic]:
    """Judge the sub-actions that the file states for the recipe."""
    ontology = actions.ontology
    seen: dict[str, int] = {}
    for sub_action in statements.sub_actions:
        iri = sub_action.iri
        if iri is None:
            message = f"a sub-action of `{recipe.name}` is an expression without a named action class"
            yield error("R020", message, sub_action.span, "name an action class in it")
            continue
        if iri in seen:
            yield note("R024", f"`{local_name(iri)}` is a sub-action of `{recipe.name}` twice", sub_action.span)
            continue
        seen[iri] = sub_action.span.line
        if not ontology.defined(iri):
            message = f"sub-action `{local_name(iri)}` of `{recipe.name}` is not defined"
            yield error("R020", message, sub_action.span, _instead(ontology, statements, iri))
    for step in recipe.steps:
        if step.is_abstract:
            message = f"nothing performs `{step.name}`: it is no primitive and has no recipe"
            severity = Severity.WARNING if allow_abstract else Severity.ERROR
            yield Diagnostic(severity, "R021", message, step.span, _abstract_help(actions, step.iri, allow_abstract))


def check_recursion(recipes: RecipeSet) -> list[Diagnostic]:
    """An error for each step through which a recipe calls itself, with the whole way round."""
    found: list[Diagnostic] = []
    done: set[str] = set()

    def visit(iri: str, path: tuple[str, ...]) -> None:
        for step in recipes.recipes[iri].steps:
            for callee in step.recipes:
                if callee in path:
                    circle = (*path[path.index(callee) :], callee)
                    through = f" (`{step.name}` takes the recipe of its superclass)" if step.iri != callee else ""
                    message = "the recipe performs itself: " + " > ".join(f"`{local_name(name)}`" for name in circle)
                    advice = f"give `{step.name}` a recipe of its own, or make it a primitive"
                    found.append(error("R022", message + through, step.span, advice))
                elif callee not in done:
                    visit(callee, (*path, callee))
        done.add(iri)

    visit(recipes.task, (recipes.task,))
    return found


def check_base_motions(actions: Actions, recipe: Recipe, recipes: RecipeSet) -> Iterator[Diagnostic]:
    """An error for each two consecutive base motions that nothing orders; the orders of the recipe are acyclic."""
    graph = recipe_graph(recipe)
    closure = closed(graph)
    movers = actions.movers(recipe, recipes)
    ordered: list[str] = sorted_nodes(graph)
    moving = [step for step in ordered if step in movers.opening | movers.ending]
    for first, second in pairwise(moving):
        if not closure.has_edge(first, second):
            both = f"`{local_name(first)}` and `{local_name(second)}`"
            message = f"{both} both move the base, and nothing says which comes first"
            yield error("R040", message, recipe.step(second).span, ordering_to_write(recipe, first, second))


def _instead(ontology: Ontology, statements: Statements, undefined: str) -> str:
    """What may have been meant by a name that nothing defines."""
    for name in statements.mentioned():
        if name not in statements.names and ontology.defined(name):
            return f"did you mean `{local_name(name)}`, which is ordered but is not a sub-action?"
    names = {local_name(name): None for name in _classes(ontology)}
    similar = get_close_matches(local_name(undefined), names, n=1)
    if similar:
        return f"did you mean `{similar[0]}`?"
    return f"define `{local_name(undefined)}` as a subclass of an action class"


def _classes(ontology: Ontology) -> Iterator[str]:
    yield from ontology.subclasses(expand("Action"))


def _abstract_help(actions: Actions, iri: str, allow_abstract: bool) -> str:
    primitives = ", ".join(sorted(local_name(name) for name in actions.primitives))
    if len(actions.ontology.ancestors(iri)) == 1:
        return f"`{local_name(iri)}` has no superclass that is known: import the ontology that defines it"
    also = "" if allow_abstract else "; --allow-abstract compiles it all the same"
    return f"give it sub-actions, or put it below a primitive ({primitives}){also}"
