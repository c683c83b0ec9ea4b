"""Orders that are probably missing where the steps of a recipe form two or three unconnected sequences."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import chain, combinations, pairwise, permutations

from planlang.recipe.actions import Actions
from planlang.recipe.model import Recipe
from planlang.recipe.order import Precedence
from planlang.recipe.preconditions import Preconditions

MOST_SEQUENCES = 3
"""Maximum number of sequences to join: a recipe with more of them does not suggest a single sequence."""

LONGEST = 100
"""Maximum number of steps, because the search compares all pairs of steps."""

Why = Callable[[str, str], str | None]
"""Reason why the first step (IRI) should come before the second; None if there is no reason."""


def joints(
    actions: Actions, recipe: Recipe, order: Precedence[str], why: Why, *, single: bool = False
) -> list[tuple[str, str, str]]:
    """Find orders between the ends of sequences that connect all steps to one sequence: pairs of IRIs, with reasons.

    Gives none unless exactly one arrangement of the sequences has the fewest contradictions with reasons and
    preconditions. With ``single`` all sequences may be single steps.
    """
    parts = _sequences(order) if len(order.nodes) <= LONGEST else []
    if not 2 <= len(parts) <= MOST_SEQUENCES or (len(order.nodes) == len(parts) and not single):
        return []
    needs = Preconditions(actions, recipe, with_goal=True)

    def against(arranged: Sequence[tuple[str, ...]]) -> Iterator[str]:
        return _contradictions(needs, (*arranged, (recipe.iri,)), why)

    rated = [(list(against(arranged)), arranged) for arranged in permutations(parts)]
    (fewest, best), (more, _), *_ = sorted(rated, key=lambda one: len(one[0]))
    if len(fewest) == len(more):
        return []
    orders = []
    for first, second in pairwise(best):
        swapped = [second if one is first else first if one is second else one for one in best]
        reason = next(against(swapped), "all other steps are in this sequence")
        orders.append((first[-1], second[0], reason))
    return orders


def _sequences(order: Precedence[str]) -> list[tuple[str, ...]]:
    """Split the steps into sequences without orders between them; none if the order has branches."""
    pairs = list(order.reduction())
    after = dict(pairs)
    before = {second: first for first, second in pairs}
    if len(after) < len(pairs) or len(before) < len(pairs):
        return []
    sequences = []
    for start in (node for node in order.nodes if node not in before):
        steps = [start]
        while steps[-1] in after:
            steps.append(after[steps[-1]])
        sequences.append(tuple(steps))
    return sequences


def _contradictions(needs: Preconditions, arranged: Sequence[tuple[str, ...]], why: Why) -> Iterator[str]:
    """Yield the reasons against an arrangement of sequences; the last one is the recipe itself."""
    position = {step: number for number, step in enumerate(chain.from_iterable(arranged))}
    yield from (f"otherwise {one}" for one in needs.unmet(lambda first, second: position[first] < position[second]))
    for earlier, later in combinations(arranged[:-1], 2):
        for first in earlier:
            yield from filter(None, (why(second, first) for second in later))
