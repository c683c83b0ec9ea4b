"""Proportions of trials: what their number says of the probability."""

from __future__ import annotations

import math
import statistics

_Z = statistics.NormalDist().inv_cdf(0.975)
"""Two-sided 95 % quantile of the standard normal distribution."""


def wilson(count: int, total: int) -> tuple[float, float]:
    """95 % confidence interval of a probability from ``count`` of ``total`` trials (Wilson score interval)."""
    if total == 0:
        return 0.0, 1.0
    share, square = count / total, _Z * _Z / total
    middle = (share + square / 2) / (1 + square)
    half = _Z / (1 + square) * math.sqrt(share * (1 - share) / total + square / (4 * total))
    return max(0.0, middle - half), min(1.0, middle + half)
