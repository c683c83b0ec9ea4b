"""The one order that is probably forgotten where the steps of a recipe form two or three sequences."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import chain, combinations, pairwise, permutations

from planlang.recipe.actions import Actions
from planlang.recipe.model import Recipe
from planlang.recipe.order import Precedence
from planlang.recipe.preconditions import Preconditions

MOST_SEQUENCES = 3
"""Sequences that are joined: where more orders are missing, the recipe does not suggest a single sequence."""

LONGEST = 100
"""Steps of a recipe whose sequences are joined: all pairs of steps are looked at."""

Why = Callable[[str, str], str | None]
"""Returns why the first step (IRI) should come before the second; None if there is no reason."""


def joints(
    actions: Actions, recipe: Recipe, order: Precedence[str], why: Why, *, single: bool = False
) -> list[tuple[str, str, str]]:
    """Return the orders of the ends of sequences (IRIs of steps, and why) that make one sequence of all steps.

    There are none unless a single arrangement of the sequences contradicts fewest reasons and preconditions. With
    ``single`` all sequences may be single steps.
    """
    parts = _sequences(order) if len(order.nodes) <= LONGEST else []
    if not 2 <= len(parts) <= MOST_SEQUENCES or (len(order.nodes) == len(parts) and not single):
        return []
    needs = Preconditions(actions, recipe, with_goal=True)

    def against(arranged: Sequence[tuple[str, ...]]) -> Iterator[str]:
        return _contradictions(needs, (*arranged, (recipe.iri,)), why)

    judged = [(list(against(arranged)), arranged) for arranged in permutations(parts)]
    (fewest, best), (more, _), *_ = sorted(judged, key=lambda one: len(one[0]))
    if len(fewest) == len(more):
        return []
    found = []
    for first, second in pairwise(best):
        turned = [second if one is first else first if one is second else one for one in best]
        reason = next(against(turned), "all other steps are in this sequence")
        found.append((first[-1], second[0], reason))
    return found


def _sequences(order: Precedence[str]) -> list[tuple[str, ...]]:
    """Return the steps as sequences that nothing orders among each other; none if they form no such sequences."""
    pairs = list(order.reduction())
    after = dict(pairs)
    before = {second: first for first, second in pairs}
    if len(after) < len(pairs) or len(before) < len(pairs):
        return []
    found = []
    for start in (node for node in order.nodes if node not in before):
        steps = [start]
        while steps[-1] in after:
            steps.append(after[steps[-1]])
        found.append(tuple(steps))
    return found


def _contradictions(needs: Preconditions, arranged: Sequence[tuple[str, ...]], why: Why) -> Iterator[str]:
    """Yield the reasons against an arrangement of sequences; the last one is the recipe itself."""
    place = {step: number for number, step in enumerate(chain.from_iterable(arranged))}
    yield from (f"otherwise {one}" for one in needs.unmet(lambda first, second: place[first] < place[second]))
    for earlier, later in combinations(arranged[:-1], 2):
        for first in earlier:
            yield from filter(None, (why(second, first) for second in later))
