"""Linear extensions of a partial order: all total orders of its steps, or a sample of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from random import Random
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from planlang.recipe.model import Recipe, RecipeSet

Order = tuple[str, ...]
DOWNSETS = 30_000
"""Maximum number of downsets (sets of done steps) to count; more would take seconds."""


class Extensions(tuple[Order, ...]):
    """Linear extensions. ``complete`` is true if these are all; ``total`` is the number of all, None if unknown."""

    complete: bool
    total: int | None

    def __new__(cls, orders: Iterable[Order], complete: bool, total: int | None) -> Extensions:
        """Make a tuple of orders."""
        extensions = super().__new__(cls, orders)
        extensions.complete = complete
        extensions.total = total
        return extensions


def all_linear_extensions(
    steps: Iterable[str] | Recipe | RecipeSet,
    orderings: Iterable[tuple[str, str]] = (),
    *,
    limit: int = 1000,
    seed: int = 0,
) -> Extensions:
    """Find the linear extensions of a partial order, given by a recipe or by steps and pairs (before, after).

    Steps of a recipe have their local names; its stated orderings, data flow and location scopes are respected. If
    there are at most ``limit`` orders, all are returned, in the textual order of the steps. Otherwise ``limit``
    different ones are drawn: uniformly if the orders can be counted, else by random choices among the ready steps.
    Raises ValueError for a cycle or an unknown step.
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
    sample: dict[Order, None] = {}
    for _ in range(limit * 20):  # with repetitions
        if len(sample) == limit:
            break
        sample[tuple(names[n] for n in _drawn(before, counts, random))] = None
    return Extensions(sample, False, total)


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
    """Set of direct predecessors of each step, as a bit mask."""
    number = {name: n for n, name in enumerate(names)}
    if len(number) != len(names):
        raise ValueError("two steps have the same name")
    before = [0] * len(names)
    for first, second in pairs:
        for name in (first, second):
            if name not in number:
                raise ValueError(f"ordering ({first}, {second}): no step {name!r}; steps: {', '.join(names)}")
        before[number[second]] |= 1 << number[first]
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
    """Count for each downset the orders of the remaining steps, by dynamic programming; None if it has too many."""
    layers: list[list[int]] = [[0]]
    downsets = {0}
    for _ in before:
        layer = dict.fromkeys(done | 1 << step for done in layers[-1] for step in _ready(before, done))
        downsets.update(layer)
        if len(downsets) > DOWNSETS:
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
