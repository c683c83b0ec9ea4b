"""Plans in a file, about whose coroutines nothing is printed."""

from __future__ import annotations

import gc
import warnings
from collections.abc import Iterator
from pathlib import Path

import pytest
from written_plan import WrittenPlan


@pytest.fixture
def written(tmp_path: Path) -> Iterator[WrittenPlan]:
    """Runs the body of a plan that stands in a file; nothing may be printed about coroutines, then or later."""
    plan = WrittenPlan(tmp_path)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield plan
        plan.space.clear()
        gc.collect(1)
    assert [str(one.message) for one in caught] == []
