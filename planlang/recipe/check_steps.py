"""Checks of sub-actions: defined, executable, said once, without recursion; base motions in one order."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

from planlang.designators import local_name, told_apart
from planlang.diagnostics import Diagnostic, Order, Rename, Severity, error, note, warning
from planlang.ontology import Ontology, expand
from planlang.recipe.actions import Actions
from planlang.recipe.check_orderings import ordering_to_write
from planlang.recipe.graph import recipe_order
from planlang.recipe.guesses import guess
from planlang.recipe.model import Recipe, RecipeSet, Step
from planlang.recipe.statements import Statements

DEEPEST = 50
"""Recipes that may be nested in each other."""


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
            advice, meant = _instead(ontology, statements, iri)
            yield error("R020", message, sub_action.span, advice, meant)
        if sub_action.times > 1:
            short = local_name(iri)
            message = f"`{recipe.name}` asks for {sub_action.times} times `{short}`, but a step is performed once"
            advice = (
                f"state a class of its own for each time: sub-actions {short}1, {short}2, ..., classes below {short}"
            )
            yield error("R024", message, sub_action.span, advice)
    for filling in statements.foreign:
        word = local_name(filling.property)
        message = f"{word} stands in a namespace of its own ({filling.property}): it is read as KnowRob's"
        yield note("R005", message, filling.span, f"write knowrob:{word}")
    yield from _same_names(recipe)
    for step in recipe.steps:
        if step.is_abstract:
            message = f"nothing performs `{step.name}`: it is no primitive and has no recipe"
            severity = Severity.WARNING if allow_abstract else Severity.ERROR
            advice = _abstract_help(actions, step.action_class, allow_abstract)
            yield Diagnostic(severity, "R021", message, step.span, advice)


def check_recursion(recipes: RecipeSet) -> list[Diagnostic]:
    """An error for each step through which a recipe calls itself, with the whole way round, or nests too deeply."""
    found: list[Diagnostic] = []
    done: set[str] = set()
    path = [recipes.task]
    waiting = [_calls(recipes, recipes.task)]
    while waiting:
        call = next(waiting[-1], None)
        if call is None:
            waiting.pop()
            done.add(path.pop())
            continue
        step, callee = call
        if callee in path:
            circle = (*path[path.index(callee) :], callee)
            through = f" (`{step.name}` takes the recipe of its superclass)" if step.iri != callee else ""
            message = "the recipe performs itself: " + " > ".join(f"`{local_name(name)}`" for name in circle)
            advice = f"give `{step.name}` a recipe of its own, or make it a primitive"
            found.append(error("R022", message + through, step.span, advice))
        elif len(path) > DEEPEST:
            message = f"`{step.name}` is nested in more than {DEEPEST} recipes"
            return [*found, error("R023", message, step.span, "make the recipes between flatter")]
        elif callee not in done:
            path.append(callee)
            waiting.append(_calls(recipes, callee))
    return found


def _calls(recipes: RecipeSet, iri: str) -> Iterator[tuple[Step, str]]:
    for step in recipes.recipes[iri].steps:
        for callee in step.recipes:
            yield step, callee


def _same_names(recipe: Recipe) -> Iterator[Diagnostic]:
    """Steps that cannot be told apart by what a person reads."""
    first: dict[str, Step] = {}
    for step in recipe.steps:
        for name in dict.fromkeys((step.name, step.label or step.name)):
            earlier = first.setdefault(name.lower(), step)
            if earlier is not step:
                one, other = told_apart(earlier.iri, step.iri)
                message = f"two steps of `{recipe.name}` are called {name!r}: `{one}` and `{other}`"
                yield warning("R048", message, step.span, "give one of them another name or label")
                break


def check_base_motions(actions: Actions, recipe: Recipe, recipes: RecipeSet) -> Iterator[Diagnostic]:
    """An error for each two consecutive base motions that nothing orders; the orders of the recipe are acyclic."""
    order = recipe_order(recipe)
    movers = actions.movers(recipe, recipes)
    moving = [step for step in order.extension if step in movers.opening | movers.ending]
    for first, second in pairwise(moving):
        if not order.before(first, second):
            one, other = told_apart(first, second)
            message = f"`{one}` and `{other}` both move the base, and nothing says which comes first"
            advice = ordering_to_write(recipe, first, second)
            yield error("R040", message, recipe.step(second).span, advice, Order(recipe.iri, first, second))


def _instead(ontology: Ontology, statements: Statements, undefined: str) -> tuple[str, Rename | None]:
    """What may have been meant by a name that nothing defines, in words and as a change."""
    for name in statements.mentioned():
        if name not in statements.names and ontology.defined(name):
            return f"did you mean `{local_name(name)}`, which is ordered but is not a sub-action?", None
    meant = guess(undefined, _classes(ontology))
    if meant:
        return f"did you mean {meant}?", meant
    return f"define `{local_name(undefined)}` as a subclass of an action class", None


def _classes(ontology: Ontology) -> Iterator[str]:
    yield from ontology.subclasses(expand("Action"))


def _abstract_help(actions: Actions, iri: str, allow_abstract: bool) -> str:
    primitives = ", ".join(sorted(local_name(name) for name in actions.primitives))
    if len(actions.ontology.ancestors(iri)) == 1:
        return f"`{local_name(iri)}` has no superclass that is known: import the ontology that defines it"
    also = "" if allow_abstract else "; --allow-abstract compiles it all the same"
    return f"give it sub-actions, or put it below a primitive ({primitives}){also}"
