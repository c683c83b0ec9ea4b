"""How often comparisons err: simulated sweeps with known rates, whose worlds are independent.

``python -m tests.benchmarks.comparing`` prints how often equally good variants are called different (at most 100 of
2,000 are allowed), how often 60 against 80 % is found in 130 worlds, and how often intervals have the true value.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from functools import cache
from itertools import combinations

import numpy as np

from executive.sweeps.paired import (
    LEVEL,
    Counts,
    difference_interval,
    holm,
    least_difference,
    mcnemar,
    mean_interval,
    power,
)

PAIRS = 2000
"""Simulated comparisons with equal rates."""
RATES = (0.5, 0.6, 0.7, 0.8, 0.9, 0.95)
WORLDS = (30, 130, 500)
cached = cache(mcnemar)


def outcomes(draw: np.random.Generator, rates: tuple[float, ...], worlds: int) -> np.ndarray:
    """True where a variant reaches its goal in a world; variants by worlds."""
    return draw.random((len(rates), worlds)) < np.array(rates)[:, None]


def counts_of(first: np.ndarray, second: np.ndarray) -> Counts:
    """Counts of two variants."""
    return Counts(*(int(np.sum(both)) for both in (first & second, first & ~second, ~first & second, ~first & ~second)))


def is_called_different(reached: np.ndarray) -> bool:
    """Check whether a comparison calls any two variants different."""
    values = [cached(_tested(counts_of(*pair))) for pair in combinations(reached, 2)]
    return min(holm(values)) < LEVEL


def _tested(counts: Counts) -> Counts:
    """What the test depends on, so that it is computed once."""
    return Counts(0, counts.n10, counts.n01, 0)


def called_different(rates: tuple[float, ...], worlds: int, number: int, seed: int = 1) -> int:
    """Count the simulated comparisons in which variants of these rates are called different."""
    draw = np.random.default_rng([seed, worlds, *(round(1000 * rate) for rate in rates)])
    return sum(is_called_different(outcomes(draw, rates, worlds)) for _ in range(number))


def level(worlds: int, rate: float) -> float:
    """Exact probability that two equal variants with independent rows are called different."""
    share, total = 2 * rate * (1 - rate), 0.0
    for differing in range(worlds + 1):
        log_choose = math.lgamma(worlds + 1) - math.lgamma(differing + 1) - math.lgamma(worlds - differing + 1)
        weight = math.exp(log_choose + differing * math.log(share) + (worlds - differing) * math.log(1 - share))
        if weight > 1e-12:
            values = (cached(Counts(0, fewer, differing - fewer, 0)) for fewer in range(differing // 2 + 1))
            total += weight * max((value for value in values if value < LEVEL), default=0.0)
    return total


def covered(rates: tuple[float, float], worlds: int, number: int) -> float:
    """Share of simulated comparisons in whose interval the true difference of rates is."""
    draw = np.random.default_rng([2, worlds, *(round(1000 * rate) for rate in rates)])
    intervals = (difference_interval(counts_of(*outcomes(draw, rates, worlds))) for _ in range(number))
    return sum(low <= rates[1] - rates[0] <= high for low, high in intervals) / number


def times_covered(worlds: int, number: int) -> float:
    """Share of simulated comparisons in whose bootstrap interval the mean difference of skewed times is."""
    draw = np.random.default_rng([3, worlds])
    times = (draw.lognormal(2.0, 0.5, (2, worlds)) for _ in range(number))
    found = (mean_interval(list(first - second)) for first, second in times)
    return sum(one is not None and one[0] <= 0.0 <= one[1] for one in found) / number


def found_with_least(worlds: int, differing: float, number: int) -> tuple[float, float]:
    """The least difference that a number of worlds is said to find with 80 %, and how often it is found."""
    least = least_difference(worlds, differing)
    assert least is not None
    all_differing = max(differing, least)
    only_second = (all_differing + least) / 2
    draw = np.random.default_rng([4, worlds, round(1000 * differing)])
    drawn = draw.multinomial(worlds, [all_differing - only_second, only_second, 1 - all_differing], size=number)
    return least, sum(cached(Counts(0, int(n10), int(n01), 0)) < LEVEL for n10, n01, _ in drawn) / number


def lines() -> Iterator[str]:
    """Yield the measurements."""
    for variants in (2, 4):
        for worlds in WORLDS:
            numbers = [called_different((rate,) * variants, worlds, PAIRS) for rate in RATES]
            told = ", ".join(f"{number} at {rate:g}" for rate, number in zip(RATES, numbers, strict=True))
            yield f"{variants} equal variants, {worlds} worlds: of {PAIRS} called different {told}"
    for worlds in WORLDS:
        exact = ", ".join(f"{level(worlds, rate):.4f} at {rate:g}" for rate in RATES)
        yield f"2 equal variants, {worlds} worlds: probability to be called different {exact}"
    found = called_different((0.6, 0.8), 130, 2000, seed=5)
    yield f"60 against 80 %, 130 worlds: found in {found} of 2000; said to be {power(130, 0.44, 0.2):.3f}"
    for worlds, differing in ((8, 0.25), (30, 0.2), (130, 0.44), (500, 0.1)):
        least, share = found_with_least(worlds, differing, 4000)
        yield f"least difference of {worlds} worlds, {differing:g} differing: {least:.3f}, found in {share:.3f}"
    for rates in ((0.6, 0.8), (0.9, 0.95), (0.95, 0.95)):
        shares = ", ".join(f"{covered(rates, worlds, 2000):.3f} of {worlds} worlds" for worlds in WORLDS)
        yield f"interval of the difference, {rates[0]:g} and {rates[1]:g}: true value inside in {shares}"
    shares = ", ".join(f"{times_covered(worlds, 1000):.3f} of {worlds} worlds" for worlds in (5, 10, 30, 130))
    yield f"interval of plan times: true value inside in {shares}"


if __name__ == "__main__":
    for line in lines():
        sys.stdout.write(f"{line}\n")
        sys.stdout.flush()
