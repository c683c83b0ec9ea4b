"""What is remembered between questions: results up to some bytes, and nothing of what strangers sent along."""

from __future__ import annotations

import tracemalloc
from typing import cast

from hypothesis import given
from hypothesis import strategies as st

from executive.robots import Availability
from executive.serving.abilities import OVERHEAD, Abilities, Cache, Judgement, digest
from executive.serving.workers import Workers
from planlang.knowledge.entries import Entry, Kind, Revision, Store, Syntax

MODEL = 1_000_000
CUP = Entry("cup.ada", Kind.OBJECT, "urn:cup", "cup", "ada", Syntax.TURTLE, "", Revision(1, "00", "ada", ""))


class Counting:
    """Workers and a store in one, which count the calls."""

    calls = 0

    def call(self, *_: object) -> Judgement:
        self.calls += 1
        return Judgement(Availability.AVAILABLE)

    def content(self, _: str) -> bytes:
        return b""


def test_of_many_self_models_of_a_megabyte_none_is_kept_but_each_is_compared_once() -> None:
    asked = Counting()
    abilities = Abilities(cast(Store, asked), cast(Workers, asked))
    tracemalloc.start()
    for number in range(20):
        model = f"{number}".rjust(MODEL)
        assert abilities.of(model, CUP) == abilities.of(model, CUP) == Judgement(Availability.AVAILABLE)
    del model
    used, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert asked.calls == 20
    assert used < MODEL


@given(st.lists(st.tuples(st.binary(max_size=2), st.integers(0, 999))))
def test_the_latest_results_are_remembered_up_to_some_bytes(asked: list[tuple[bytes, int]]) -> None:
    remembered, most = Cache[int](5 * OVERHEAD), 5 * OVERHEAD
    expected: dict[bytes, int] = {}
    for key, size in asked:
        remembered.keep(key, size, size)
        expected.pop(key, None)
        expected[key] = size
        while sum(expected.values()) + OVERHEAD * len(expected) > most:
            del expected[next(iter(expected))]
    assert {key: remembered.get(key) for key, _ in asked} == {key: expected.get(key) for key, _ in asked}


def test_texts_that_are_divided_otherwise_have_another_digest() -> None:
    assert digest(("ab", "c")) != digest(("a", "bc"))
