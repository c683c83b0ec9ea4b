"""Checks of ordering constraints: complete, about sub-actions, acyclic, and said once."""

from __future__ import annotations

from collections.abc import Iterator
from difflib import get_close_matches

from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, Span, error, note
from planlang.ontology import BNode, Ontology
from planlang.recipe.graph import closed, recipe_graph, reduced, shortest_cycle
from planlang.recipe.model import Ordering, Recipe
from planlang.recipe.reading import AFTER, BEFORE, ORDERING, own_restrictions, sub_actions


def check_orderings(ontology: Ontology, stating: str, recipe: Recipe) -> Iterator[Diagnostic]:
    """Judge the constraints that the class ``stating`` gives the recipe."""
    yield from _incomplete(ontology, stating)
    yield from _strangers(ontology, stating, recipe)
    cycle: tuple[str, ...] | None = shortest_cycle(recipe_graph(recipe))
    if cycle:
        yield _cycle(recipe, cycle)
    yield from _repeated(recipe)
    if not cycle:
        yield from _redundant(recipe)


def _incomplete(ontology: Ontology, stating: str) -> Iterator[Diagnostic]:
    for restriction in own_restrictions(ontology, stating):
        constraint = restriction.filler
        if restriction.property != ORDERING or not isinstance(constraint, str) or isinstance(constraint, BNode):
            continue
        ends = {BEFORE: ontology.values(constraint, BEFORE), AFTER: ontology.values(constraint, AFTER)}
        missing = [local_name(end) for end, values in ends.items() if not values]
        if not ontology.defined(constraint) or len(missing) == 2:
            known = {
                local_name(triple.subject): None
                for triple in ontology.triples(p=BEFORE)
                if isinstance(triple.subject, str) and not isinstance(triple.subject, BNode)
            }
            name = local_name(constraint)
            message = f"`{local_name(stating)}` names the ordering constraint `{name}`, which orders nothing"
            similar = get_close_matches(name, known, n=1)
            advice = "give it occursBeforeInOrdering and occursAfterInOrdering"
            advice = f"did you mean `{similar[0]}`?" if similar else advice
            yield error("R011", message, restriction.span, advice)
        elif missing:
            message = f"the ordering constraint `{local_name(constraint)}` has no {missing[0]}"
            yield error("R011", message, ontology.span(constraint) or restriction.span, f"add {missing[0]} to it")


def _strangers(ontology: Ontology, stating: str, recipe: Recipe) -> Iterator[Diagnostic]:
    """Names that are ordered but no sub-actions, each once, at its first mention."""
    stated = [sub_action.iri for sub_action in sub_actions(ontology, stating) if sub_action.iri is not None]
    undefined = [iri for iri in stated if not ontology.defined(iri)]
    mentions: dict[str, list[Ordering]] = {}
    for ordering in recipe.orderings:
        for name in (ordering.before, ordering.after):
            if name not in stated:
                mentions.setdefault(name, []).append(ordering)
    for name, orderings in mentions.items():
        short = local_name(name)
        if undefined:
            other = local_name(undefined[0])
            guess = f"did you mean `{short}` as the sub-action instead of `{other}`, which is not defined?"
        elif similar := get_close_matches(short, [local_name(iri) for iri in stated], n=1):
            guess = f"did you mean `{similar[0]}`?"
        else:
            guess = f"add `subAction some {short}` to `{recipe.name}`, or remove these constraints"
        spans = [span for ordering in orderings for span in [_mention(ontology, ordering, name)] if span is not None]
        constraints = ", ".join(local_name(ordering.iri or "") for ordering in orderings)
        message = f"`{short}` is ordered (by {constraints}) but is not a sub-action of `{recipe.name}`"
        yield error("R010", message, min(spans, default=recipe.span), guess)


def _mention(ontology: Ontology, ordering: Ordering, name: str) -> Span | None:
    for triple in ontology.triples(s=ordering.iri):
        if triple.object == name:
            return triple.span
    return ordering.span


def _cycle(recipe: Recipe, cycle: tuple[str, ...]) -> Diagnostic:
    pairs = list(zip(cycle, (*cycle[1:], cycle[0]), strict=True))
    edges = [
        next(ordering for ordering in recipe.orderings if (ordering.before, ordering.after) == pair) for pair in pairs
    ]
    names = " < ".join(f"`{local_name(step)}`" for step in (*cycle, cycle[0]))
    where = [f"{local_name(edge.iri or '')} (line {edge.span.line})" for edge in edges if edge.span is not None]
    advice = f"remove one of these constraints: {', '.join(where)}" if where else "remove one of these constraints"
    spans = [edge.span for edge in edges if edge.span is not None]
    return error("R012", f"cycle in ordering constraints: {names}", min(spans, default=recipe.span), advice)


def _repeated(recipe: Recipe) -> Iterator[Diagnostic]:
    first: dict[tuple[str, str], Ordering] = {}
    for ordering in recipe.orderings:
        earlier = first.setdefault((ordering.before, ordering.after), ordering)
        if earlier is not ordering:
            message = (
                f"`{local_name(ordering.iri or '')}` says again what `{local_name(earlier.iri or '')}` says:"
                f" `{local_name(ordering.before)}` < `{local_name(ordering.after)}`"
            )
            yield note("R013", message, ordering.span, "remove one of them")


def _redundant(recipe: Recipe) -> Iterator[Diagnostic]:
    graph = recipe_graph(recipe)
    extra = graph.number_of_edges() - reduced(graph).number_of_edges()
    if extra and closed(graph).number_of_edges() != graph.number_of_edges():
        message = f"{extra} of the {graph.number_of_edges()} orderings of `{recipe.name}` follow from the others"
        yield note("R014", message, recipe.span)


def ordering_to_write(recipe: Recipe, before: str, after: str) -> str:
    """A help line with the ordering constraint to add, in Manchester syntax."""
    a, b = local_name(before), local_name(after)
    name = f"{recipe.name}_{a}_{b}"
    facts = f"occursBeforeInOrdering {a}, occursAfterInOrdering {b}"
    return (
        f"add `orderingConstraints value {name}` to `{recipe.name}`"
        f" with `Individual: {name} Types: PartialOrdering-Strict Facts: {facts}`"
    )
