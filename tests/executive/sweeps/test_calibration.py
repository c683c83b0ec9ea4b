"""Comparisons of simulated sweeps err as rarely as is said; ``python -m tests.benchmarks.comparing`` simulates more."""

from __future__ import annotations

import pytest

from executive.sweeps.paired import LEVEL, POWER, power
from tests.benchmarks.comparing import PAIRS, called_different, covered, found_with_least, level, times_covered


@pytest.mark.parametrize("rate", [0.5, 0.8, 0.95])
def test_equal_variants_are_called_different_with_at_most_the_stated_probability(rate: float) -> None:
    assert all(level(worlds, rate) < LEVEL for worlds in (10, 30, 130))


@pytest.mark.parametrize("variants", [2, 4])
@pytest.mark.parametrize("rate", [0.5, 0.7, 0.95])
def test_equal_variants_are_called_different_in_at_most_100_of_2000_simulated_sweeps(
    variants: int, rate: float
) -> None:
    assert called_different((rate,) * variants, 130, PAIRS) <= LEVEL * PAIRS


def test_60_against_80_percent_is_found_in_130_worlds() -> None:
    assert called_different((0.6, 0.8), 130, 100) >= 85
    assert power(130, 0.6 * 0.2 + 0.8 * 0.4, 0.2) > 0.9


def test_the_least_difference_is_found_about_as_often_as_is_said() -> None:
    _, share = found_with_least(130, 0.44, 1000)
    assert share == pytest.approx(POWER, abs=0.04)


def test_intervals_have_the_true_value_in_about_95_of_100_cases() -> None:
    assert covered((0.6, 0.8), 60, 400) == pytest.approx(0.95, abs=0.03)
    assert times_covered(20, 300) > 0.9
