"""Assignments: a name for as many as possible, none twice, with the least sum."""

from __future__ import annotations

from itertools import permutations

from hypothesis import given, settings
from hypothesis import strategies as st

from planlang.graphs import assigned
from tests.support.examples import examples


@given(st.lists(st.lists(st.floats(0, 9), min_size=4, max_size=4), max_size=4))
@settings(max_examples=examples(100))
def test_an_assignment_has_the_least_sum(table: list[list[float]]) -> None:
    rows = [dict(zip("abcd", costs, strict=True)) for costs in table]
    chosen = [str(one) for one in assigned(rows)]
    assert len({*chosen}) == len(rows)
    sums = [sum(map(dict.__getitem__, rows, names)) for names in (chosen, *permutations("abcd", len(rows)))]
    assert sums[0] <= min(sums) + 1e-9


def test_as_many_as_possible_are_assigned_a_name() -> None:
    assert assigned([{"a": 1.0, "b": 2.0}, {"a": 5.0}, {"b": 9.0}, {}]) == ["b", "a", None, None]
