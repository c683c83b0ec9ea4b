"""Short form of the benchmark of things that look alike."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.benchmarks.ambiguity import many_looks, precision_and_recall, served


def test_the_belief_says_of_looks_whether_others_look_alike() -> None:
    precision, recall = precision_and_recall(many_looks(40))
    assert min(precision, recall) >= 0.95


@pytest.mark.long
@pytest.mark.parametrize("seed", [0, 1])
def test_where_a_mark_tells_bottles_apart_the_right_one_is_delivered(seed: int, tmp_path: Path) -> None:
    row = served(seed, tmp_path)
    assert row.is_done, row.message
    assert not row.is_wrong
