"""How much of what costs time the suite tries; ``make test-long`` tries all of it, ``.ci/run`` more than the suite."""

import os
from collections.abc import Iterable
from typing import Any

import pytest


def examples(number: int) -> int:
    """Return how many random examples are tried where the long form tries ``number``: a fiftieth; ten at least."""
    return max(min(number, 10), number * int(os.environ.get("PLANLANG_EXAMPLES", "100")) // 5000)


def some(cases: Iterable[Any], every: int = 3) -> list[Any]:
    """Return cases for ``parametrize`` of which the first of ``every`` so many is in the suite, and the others long.

    A tuple is values for several arguments.
    """
    return [
        pytest.param(*(one if isinstance(one, tuple) else (one,)), marks=pytest.mark.long if number % every else ())
        for number, one in enumerate(cases)
    ]
