"""Linear extensions: all of them for small orders, a fair sample of large ones."""

from __future__ import annotations

from collections import Counter
from functools import partial
from itertools import pairwise, permutations
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from planlang import checkpoint, partial_order, seq
from planlang.files import bundled
from planlang.ontology import load
from planlang.recipe import Actions, read_recipe
from planlang.testing import all_linear_extensions, run_plan


def respects(order: tuple[str, ...], pairs: list[tuple[str, str]]) -> bool:
    return all(order.index(a) < order.index(b) for a, b in pairs)


@given(st.integers(0, 6), st.data())
def test_they_are_the_permutations_that_respect_the_orderings(size: int, data: st.DataObject) -> None:
    names = [f"s{n}" for n in range(size)]
    possible = [(a, b) for number, a in enumerate(names) for b in names[number + 1 :]]
    pairs = data.draw(st.lists(st.sampled_from(possible), max_size=8)) if possible else []
    found = all_linear_extensions(names, pairs)
    assert list(found) == [order for order in permutations(names) if respects(order, pairs)]
    assert found.complete
    assert found.total == len(found)


def test_large_orders_are_sampled_without_repetition_and_the_same_each_time() -> None:
    names = [f"s{n}" for n in range(10)]
    pairs = [("s3", "s1"), ("s1", "s0")]
    found = all_linear_extensions(names, pairs, limit=50)
    assert not found.complete
    assert found.total == 3_628_800 // 6
    assert len(found) == len(set(found)) == 50
    assert all(respects(order, pairs) for order in found)
    assert found == all_linear_extensions(names, pairs, limit=50)
    assert found != all_linear_extensions(names, pairs, limit=50, seed=1)


def test_orders_that_can_be_counted_are_drawn_uniformly() -> None:
    # a before b beside a chain c < d < e: ten orders, of which choosing step by step prefers some
    drawn: Counter[tuple[str, ...]] = Counter()
    for seed in range(2000):
        drawn.update(all_linear_extensions("abcde", ["ab", "cd", "de"], limit=1, seed=seed))  # type: ignore[list-item]
    assert len(drawn) == 10
    assert min(drawn.values()) > 140
    assert max(drawn.values()) < 260


def test_orders_that_cannot_be_counted_are_sampled_all_the_same() -> None:
    names = [f"s{n}" for n in range(40)]
    pairs = [(f"s{n}", f"s{n + 20}") for n in range(20)]
    found = all_linear_extensions(names, pairs, limit=30)
    assert found.total is None
    assert len(found) == 30
    assert all(respects(order, pairs) for order in found)


def test_chains_of_many_steps_are_no_problem() -> None:
    names = [f"s{n}" for n in range(800)]
    found = all_linear_extensions(names, list(pairwise(names)))
    assert found == (tuple(names),)


@pytest.mark.parametrize("pairs", [[("a", "b"), ("b", "a")], [("a", "a")]])
def test_a_cycle_is_refused(pairs: list[tuple[str, str]]) -> None:
    with pytest.raises(ValueError, match="cycle"):
        all_linear_extensions(["a", "b"], pairs)
    with pytest.raises(ValueError, match="cycle"):
        all_linear_extensions([*"ab", *(f"s{n}" for n in range(30))], pairs)


def test_unknown_and_doubled_steps_are_refused() -> None:
    with pytest.raises(ValueError, match=r"ordering \(a, c\): no step 'c'; steps: a, b"):
        all_linear_extensions(["a", "b"], [("a", "c")])
    with pytest.raises(ValueError, match="same name"):
        all_linear_extensions(["a", "a"])


def test_a_recipe_gives_the_orders_of_its_steps() -> None:
    reading = read_recipe(Actions(load(bundled("recipes") / "serve_a_drink.omn")), None)
    assert reading.recipes is not None
    for recipe in reading.recipes.recipes.values():
        found = all_linear_extensions(recipe)
        assert found.complete
        for order in found:
            assert sorted(order) == sorted(step.name for step in recipe.steps)
    assert all_linear_extensions(reading.recipes) == all_linear_extensions(reading.recipes.main)


def test_every_order_is_one_in_which_a_partial_order_can_run() -> None:
    names, pairs = ["reach", "grasp", "look", "lift"], [("reach", "grasp"), ("grasp", "lift"), ("look", "lift")]
    for order in all_linear_extensions(names, pairs):

        async def one_by_one(order: tuple[str, ...] = order) -> None:
            steps: dict[str, Any] = dict.fromkeys(order, checkpoint)
            await seq(**steps)

        run = run_plan(one_by_one)
        assert all(run.happened_before(a, b) for a, b in pairs)
    limited = run_plan(partial(partial_order, dict.fromkeys(names, checkpoint), pairs, limit=1))
    began = sorted((step for name in names for step in limited.steps(name)), key=lambda step: step.first)
    assert tuple(step.name for step in began) in all_linear_extensions(names, pairs)
