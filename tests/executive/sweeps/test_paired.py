"""Statistics of paired worlds agree with other programs, with exact arithmetic, and with what they are said to mean."""

from __future__ import annotations

import math
import random
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st
from statsmodels.stats.contingency_tables import mcnemar as mcnemar_of_statsmodels
from statsmodels.stats.multitest import multipletests
from statsmodels.stats.proportion import proportion_confint

from executive.sweeps.paired import (
    LEVEL,
    POWER,
    Counts,
    difference_interval,
    holm,
    least_difference,
    mcnemar,
    mean_interval,
    newcombe,
    power,
    worlds_needed,
)
from planlang.proportions import wilson

COUNTS = st.builds(Counts, *[st.integers(0, 60)] * 4)


@given(COUNTS)
def test_p_values_are_those_of_statsmodels(counts: Counts) -> None:
    table = [[counts.n11, counts.n10], [counts.n01, counts.n00]]
    if counts.n10 + counts.n01:
        assert mcnemar(counts) == pytest.approx(float(mcnemar_of_statsmodels(table, exact=True).pvalue), abs=1e-9)
    else:
        assert mcnemar(counts) == 1.0


@given(st.integers(0, 3000), st.integers(0, 3000))
def test_p_values_of_many_worlds_are_exact(n10: int, n01: int) -> None:
    total = n10 + n01
    tail, term = Fraction(0), Fraction(1)
    for number in range(min(n10, n01) + 1):
        tail += term
        term = term * (total - number) / (number + 1)
    exact = min(1.0, float(2 * tail / 2**total)) if 2 * min(n10, n01) < total else 1.0
    assert mcnemar(Counts(7, n10, n01, 3)) == pytest.approx(exact, abs=1e-9)


@given(st.lists(st.floats(0, 1), min_size=1, max_size=12))
def test_corrected_p_values_are_those_of_statsmodels(values: list[float]) -> None:
    assert holm(values) == pytest.approx(list(multipletests(values, method="holm")[1]), abs=1e-9)


@given(st.integers(0, 500), st.integers(1, 500))
def test_intervals_of_shares_are_those_of_statsmodels(count: int, more: int) -> None:
    total = count + more
    assert wilson(count, total) == pytest.approx(proportion_confint(count, total, method="wilson"), abs=1e-9)


@given(COUNTS)
def test_an_interval_has_the_difference_and_is_mirrored_when_the_variants_are_swapped(counts: Counts) -> None:
    low, high = difference_interval(counts)
    assert -1 <= low <= counts.difference + 1e-12
    assert counts.difference - 1e-12 <= high <= 1
    swapped = difference_interval(Counts(counts.n11, counts.n01, counts.n10, counts.n00))
    assert swapped == pytest.approx((-high, -low), abs=1e-12)


@given(COUNTS)
def test_no_difference_is_in_the_interval_unless_the_test_finds_one(counts: Counts) -> None:
    low, high = difference_interval(counts)
    assert (low <= 0 <= high) == (mcnemar(counts) >= LEVEL)


def test_the_interval_of_a_published_example_is_that_of_its_author() -> None:
    assert newcombe(Counts(36, 2, 12, 0)) == pytest.approx((0.0569, 0.3404), abs=5e-5)


@given(COUNTS)
def test_swapping_the_variants_changes_no_p_value(counts: Counts) -> None:
    assert mcnemar(counts) == mcnemar(Counts(counts.n00, counts.n01, counts.n10, counts.n11))


@given(st.integers(1, 400), st.floats(0.01, 1), st.integers(1, 6))
def test_the_least_difference_is_found_with_80_percent_and_a_smaller_one_is_not(
    worlds: int, differing: float, tests: int
) -> None:
    least = least_difference(worlds, differing, tests)
    if least is None:
        assert power(worlds, differing, 1.0, tests) < POWER
    else:
        assert power(worlds, differing, least, tests) >= POWER > power(worlds, differing, least - 2e-4, tests)


@given(st.floats(0.05, 1), st.floats(0.05, 1), st.integers(1, 6))
def test_the_worlds_that_are_needed_find_the_difference_and_fewer_do_not(
    differing: float, difference: float, tests: int
) -> None:
    needed = worlds_needed(differing, difference, tests)
    assert needed is not None
    assert power(needed, differing, difference, tests) >= POWER > power(needed - 1, differing, difference, tests)


def test_no_number_of_worlds_finds_what_is_not_there() -> None:
    assert worlds_needed(0.4, 0.0) is None
    assert least_difference(5, 1.0) is None


def test_an_interval_of_times_follows_from_the_times_alone() -> None:
    draw = random.Random(7)
    values = [draw.gauss(3.0, 2.0) for _ in range(40)]
    low, high = mean_interval(values) or (math.nan, math.nan)
    assert low < sum(values) / 40 < high
    assert mean_interval(values) == (low, high)
    assert mean_interval(values[:4]) is None
    assert mean_interval([2.5] * 9) == (2.5, 2.5)
