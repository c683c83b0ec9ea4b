"""The mapping of the last few values."""

from __future__ import annotations

from planlang.kept import Latest


def test_a_new_key_replaces_the_one_that_was_set_first() -> None:
    latest = Latest[str, list[int]](2)
    latest.of("a", list).append(1)
    assert latest.of("a", list) == [1], "it is not computed again"
    latest["b"] = [2]
    latest.of("c", list)
    assert latest == {"b": [2], "c": []}


def test_a_renewed_key_is_the_last() -> None:
    latest = Latest[str, int](2, {"a": 1, "b": 2})
    latest.renew("a", 3)
    latest["c"] = 4
    assert latest == {"a": 3, "c": 4}
