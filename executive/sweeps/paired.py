"""Statistics of two variants in the same worlds: numbers of counts and arrays, nothing of plans.

A pair of variants has four counts of worlds: reached by both (``n11``), by the first only (``n10``), by the second only
(``n01``), by neither (``n00``). Worlds in which both end alike tell nothing about which is better.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from statistics import NormalDist

import numpy as np
import numpy.typing as npt

from planlang.proportions import wilson
from planlang.records import dataclass

LEVEL = 0.05
"""Probability with which variants that are equally good are called different, at most."""
POWER = 0.8
"""Probability with which a difference is found that counts as found."""
MOST_WORLDS = 1_000_000
"""Above this number of worlds none is said to be needed: a sweep has no more."""
RESAMPLES = 4000
"""Resamples of a bootstrap interval."""
FEWEST_TIMES = 5
"""Fewest differences of plan time that have an interval."""
_DRAWN_AT_ONCE = 1_000_000
_NORMAL = NormalDist()


@dataclass(frozen=True, slots=True)
class Counts:
    """Worlds by which of two variants reached the goal."""

    n11: int
    n10: int
    n01: int
    n00: int

    @property
    def worlds(self) -> int:
        """Number of worlds."""
        return self.n11 + self.n10 + self.n01 + self.n00

    @property
    def difference(self) -> float:
        """Share of worlds that the second reached, less that of the first; 0 without worlds."""
        return (self.n01 - self.n10) / self.worlds if self.worlds else 0.0

    @property
    def differing(self) -> float:
        """Share of worlds that only one of them reached; 0 without worlds."""
        return (self.n01 + self.n10) / self.worlds if self.worlds else 0.0


def mcnemar(counts: Counts) -> float:
    """Two-sided p-value of the exact McNemar test: of ``n10`` and ``n01`` as throws of a fair coin.

    It is the probability, were both equally good, of counts that differ at least as much. The test keeps its level in
    any number of worlds; it is conservative, as p has few values: of m worlds that differ, at least 6 have to agree.
    """
    fewer, total = min(counts.n10, counts.n01), counts.n10 + counts.n01
    if 2 * fewer >= total:
        return 1.0
    return min(1.0, 2.0 * _at_most(fewer, total, 0.5))


def _at_most(count: int, total: int, chance: float) -> float:
    """Probability of at most ``count`` successes, of each with a ``chance`` of at least their share and below 1.

    Summed from the largest term on, each smaller by a ratio: no factorial of a large number.
    """
    ways = math.lgamma(total + 1) - math.lgamma(count + 1) - math.lgamma(total - count + 1)
    largest = ways + count * math.log(chance) + (total - count) * math.log1p(-chance)
    term, tail, odds = 1.0, 1.0, (1 - chance) / chance
    for number in range(count, 0, -1):
        term *= odds * number / (total - number + 1)
        tail += term
        if term < 1e-18 * tail:
            break
    return math.exp(largest) * tail


def holm(values: Sequence[float]) -> list[float]:
    """Adjust the p-values of several tests by Holm, so that any of them errs with the level of one at most."""
    adjusted, least = [0.0] * len(values), 0.0
    for rank, index in enumerate(sorted(range(len(values)), key=values.__getitem__)):
        least = max(least, min(1.0, (len(values) - rank) * values[index]))
        adjusted[index] = least
    return adjusted


def difference_interval(counts: Counts) -> tuple[float, float]:
    """95 % confidence interval of the difference of the shares that two variants reach in the same worlds.

    That of :func:`newcombe`, on the side of no difference as far as the exact test, inverted, allows: 0 is inside
    unless p is below 0.05. (-1, 1) without worlds.
    """
    if counts.worlds == 0:
        return -1.0, 1.0
    low, high = newcombe(counts)
    if counts.difference > 0:
        return min(low, _bound_of_test(counts)), high
    return (low, max(high, _bound_of_test(counts))) if counts.difference < 0 else (low, high)


def _bound_of_test(counts: Counts) -> float:
    """Bound of the difference on the side of none, from the interval of Clopper and Pearson for worlds that differ."""
    fewer, total = min(counts.n10, counts.n01), counts.n10 + counts.n01
    low, high = fewer / total, 1.0
    while high - low > 1e-12 and fewer < total:
        middle = (low + high) / 2
        low, high = (middle, high) if _at_most(fewer, total, middle) > LEVEL / 2 else (low, middle)
    bound = (1 - 2 * high) * total / counts.worlds
    return bound if counts.difference > 0 else -bound


def newcombe(counts: Counts) -> tuple[float, float]:
    """95 % interval by Newcombe's tenth method, from the Wilson intervals of both shares and their correlation.

    Statistics in Medicine 17, 1998; needs a world.
    """
    total = counts.worlds
    first, second = counts.n11 + counts.n10, counts.n11 + counts.n01
    (low1, high1), (low2, high2) = wilson(first, total), wilson(second, total)
    share1, share2 = first / total, second / total
    phi = _correlation(counts)

    def half(one: float, other: float) -> float:
        return math.sqrt(max(0.0, one * one - 2 * phi * one * other + other * other))

    difference = share2 - share1
    low = difference - half(share2 - low2, high1 - share1)
    high = difference + half(high2 - share2, share1 - low1)
    return max(-1.0, low), min(1.0, high)


def _correlation(counts: Counts) -> float:
    """Correlation of both outcomes, with the correction for continuity of that method; 0 if one never varies."""
    n11, n10, n01, n00 = counts.n11, counts.n10, counts.n01, counts.n00
    sums = (n11 + n10) * (n01 + n00) * (n11 + n01) * (n10 + n00)
    if sums == 0:
        return 0.0
    excess = float(n11 * n00 - n10 * n01)
    if excess > 0:
        excess = max(excess - counts.worlds / 2, 0)
    return excess / math.sqrt(sums)


def power(worlds: int, differing: float, difference: float, tests: int = 1) -> float:
    """Probability that the exact McNemar test finds a difference of shares in a number of worlds.

    ``differing`` is the share of worlds that only one variant reaches, at least the difference. Of several ``tests`` it
    is that of the first one of Holm. An approximation by normal distributions, with a correction for continuity.
    """
    difference = abs(difference)
    differing = max(differing, difference)
    if worlds <= 0 or difference <= 0:
        return 0.0
    quantile = _NORMAL.inv_cdf(1 - LEVEL / tests / 2)
    excess = worlds * difference - 1 - quantile * math.sqrt(worlds * differing)
    spread = math.sqrt(worlds * max(differing - difference * difference, 0.0))
    if spread == 0:
        return float(excess >= 0)
    return _NORMAL.cdf(excess / spread)


def least_difference(worlds: int, differing: float, tests: int = 1) -> float | None:
    """The least difference of shares that a number of worlds finds with 80 %; None if they find none."""
    low, high = 0.0, 1.0
    if power(worlds, differing, high, tests) < POWER:
        return None
    while high - low > 1e-4:
        middle = (low + high) / 2
        low, high = (low, middle) if power(worlds, differing, middle, tests) >= POWER else (middle, high)
    return high


def worlds_needed(differing: float, difference: float, tests: int = 1) -> int | None:
    """How many worlds find a difference of shares with 80 %; None if there is none, or it takes too many."""
    low, high = 0, MOST_WORLDS
    if power(high, differing, difference, tests) < POWER:
        return None
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if power(middle, differing, difference, tests) >= POWER else (middle, high)
    return high


def mean_interval(values: Sequence[float]) -> tuple[float, float] | None:
    """95 % bootstrap interval of the mean of differences, one for each world; None of fewer than five.

    Percentiles of the means of resamples, widened for small numbers as the quantiles of Student's t are (Hesterberg,
    The American Statistician 69, 2015). The draws follow from the values alone: equal rows have equal intervals.
    """
    count = len(values)
    if count < FEWEST_TIMES:
        return None
    numbers = np.asarray(values, dtype=np.float64)
    key = int.from_bytes(hashlib.sha256(numbers.astype("<f8").tobytes()).digest()[:16], "little")
    draws = np.random.Philox(key=key)
    at_once = max(1, _DRAWN_AT_ONCE // count)
    means = np.concatenate(
        [_means(numbers, draws, min(at_once, RESAMPLES - begin)) for begin in range(0, RESAMPLES, at_once)]
    )
    tail = _NORMAL.cdf(-math.sqrt(count / (count - 1)) * _student(count - 1))
    low, high = np.quantile(means, [tail, 1 - tail])
    return float(low), float(high)


def _means(numbers: npt.NDArray[np.float64], draws: np.random.Philox, resamples: int) -> npt.NDArray[np.float64]:
    """Means of resamples; of the generator only raw numbers are used, whose stream numpy never changes."""
    indices = draws.random_raw(resamples * len(numbers)) % np.uint64(len(numbers))
    means: npt.NDArray[np.float64] = numbers[indices.astype(np.intp)].reshape(resamples, -1).mean(axis=1)
    return means


def _student(degrees: int) -> float:
    """97.5 % quantile of Student's t, to 1 % from 4 degrees of freedom on (expansion of Cornish and Fisher)."""
    z = _NORMAL.inv_cdf(1 - LEVEL / 2)
    terms = (z**3 + z) / 4, (5 * z**5 + 16 * z**3 + 3 * z) / 96, (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / 384
    return z + math.fsum(term / float(degrees**power) for power, term in enumerate(terms, 1))
