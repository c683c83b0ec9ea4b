"""All orders in which the steps of a partial order can be done one after another, or a sample of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from random import Random
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from planlang.recipe.model import Recipe, RecipeSet

Order = tuple[str, ...]
DOWNSETS = 30_000
"""Sets of done steps that are counted at most: more take seconds."""


class Extensions(tuple[Order, ...]):
    """Orders of all steps. ``complete`` if these are all; ``total`` is their number, if counted."""

    complete: bool
    total: int | None

    def __new__(cls, orders: Iterable[Order], complete: bool, total: int | None) -> Extensions:
        """Make a tuple of orders."""
        found = super().__new__(cls, orders)
        found.complete = complete
        found.total = total
        return found


def all_linear_extensions(
    steps: Iterable[str] | Recipe | RecipeSet,
    orderings: Iterable[tuple[str, str]] = (),
    *,
    limit: int = 1000,
    seed: int = 0,
) -> Extensions:
    """Return the total orders that respect a partial one: of a recipe, or of steps and pairs (before, after).

    The steps of a recipe are called by their local names; its stated orderings, data flow and location scopes count. At
    most ``limit`` orders are all given, in the order of the steps as written; of more, ``limit`` different ones are
    drawn: uniformly if they can be counted, else step by step. Raises ValueError for a cycle or an unknown step.
    """
    names, pairs = _order_of(steps, orderings)
    before = _masks(names, pairs)
    counts = _counted(before)
    total = None if counts is None else counts[0]
    if total == 0 or _cyclic(before):
        raise ValueError("the orderings have a cycle: no order of the steps respects them")
    if total is not None and total <= limit:
        return Extensions((tuple(names[n] for n in order) for order in _all(before)), True, total)
    random = Random(f"extensions {seed}")
    found: dict[Order, None] = {}
    for _ in range(limit * 20):
        if len(found) == limit:
            break
        found[tuple(names[n] for n in _drawn(before, counts, random))] = None
    return Extensions(found, False, total)


def _order_of(
    steps: Iterable[str] | Recipe | RecipeSet, orderings: Iterable[tuple[str, str]]
) -> tuple[Sequence[str], Iterable[tuple[str, str]]]:
    recipe: Any = getattr(steps, "main", steps)
    if hasattr(recipe, "steps") and hasattr(recipe, "orderings"):
        short = {step.iri: step.name for step in recipe.steps}
        pairs = [(o.before, o.after) for o in recipe.orderings if o.before in short and o.after in short]
        return list(short.values()), [*((short[a], short[b]) for a, b in pairs), *orderings]
    return list(recipe), orderings


def _masks(names: Sequence[str], pairs: Iterable[tuple[str, str]]) -> list[int]:
    """Return for each step the set of steps directly before it, as bits."""
    place = {name: number for number, name in enumerate(names)}
    if len(place) != len(names):
        raise ValueError("two steps have the same name")
    before = [0] * len(names)
    for first, second in pairs:
        for name in (first, second):
            if name not in place:
                raise ValueError(f"ordering ({first}, {second}): no step {name!r}; steps: {', '.join(names)}")
        before[place[second]] |= 1 << place[first]
    return before


def _ready(before: Sequence[int], done: int) -> list[int]:
    return [n for n, needed in enumerate(before) if not done >> n & 1 and needed & done == needed]


def _cyclic(before: Sequence[int]) -> bool:
    done = 0
    while ready := _ready(before, done):
        for step in ready:
            done |= 1 << step
    return done != (1 << len(before)) - 1


def _counted(before: Sequence[int]) -> dict[int, int] | None:
    """Return for each set of done steps in how many ways the rest can be done; None if there are too many sets."""
    layers: list[list[int]] = [[0]]
    known = {0}
    for _ in before:
        layer = dict.fromkeys(done | 1 << step for done in layers[-1] for step in _ready(before, done))
        known.update(layer)
        if len(known) > DOWNSETS:
            return None
        layers.append(list(layer))
    counts = dict.fromkeys(layers[-1], 1)
    for layer_ in reversed(layers[:-1]):
        for done in layer_:
            counts[done] = sum(counts[done | 1 << step] for step in _ready(before, done))
    return counts if 0 in counts else {0: 0}


def _all(before: Sequence[int]) -> Iterable[list[int]]:
    whole = (1 << len(before)) - 1
    stack: list[tuple[int, list[int]]] = [(0, [])]
    while stack:
        done, order = stack.pop()
        if done == whole:
            yield order
        stack.extend((done | 1 << step, [*order, step]) for step in reversed(_ready(before, done)))


def _drawn(before: Sequence[int], counts: dict[int, int] | None, rng: Random) -> list[int]:
    done, order = 0, list[int]()
    while len(order) < len(before):
        ready = _ready(before, done)
        if counts is None:
            step = rng.choice(ready)
        else:
            pick = rng.randrange(counts[done])
            for step in ready:
                pick -= counts[done | 1 << step]
                if pick < 0:
                    break
        done |= 1 << step
        order.append(step)
    return order
