"""The order in which changes are tried, with reruns whose ends are made up: no plan runs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

from executive.sweeps.records import Done, World
from executive.why.evidence import Evidence
from executive.why.reruns import Reruns
from executive.why.searching import Search, search
from tests.support.failed_situation import EVIDENCE, SITUATION

Stated = frozenset[tuple[str, Any]]
"""Changes: what, and the value."""


class Scripted:
    """Workers whose worlds end as a function of their changes says: reached, or the evidence of a failure."""

    def __init__(self, ends: Callable[[Stated], Evidence | None]) -> None:
        self._ends = ends
        self.batches: list[int] = []

    @contextmanager
    def done(self, worlds: Sequence[World]) -> Iterator[Iterator[Done]]:
        self.batches.append(len(worlds))
        yield (Done(self._row(world), 0.0) for world in worlds)

    def _row(self, world: World) -> dict[str, Any]:
        stated = frozenset((one.get("option") or one["thing"], _plain(one["value"])) for one in world["changes"])
        evidence = self._ends(stated)
        failed = {"outcome": "failed", "message": "no", "evidence": None if evidence is None else evidence.as_json()}
        return {"world": world["world"], **({"outcome": "done"} if evidence is None else failed)}


def _plain(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


def searched(ends: Callable[[Stated], Evidence | None], budget: int = 200) -> Search:
    return search(SITUATION, Reruns({}, Scripted(ends), budget=budget))


def test_what_only_two_choices_mend_together_is_found_with_both() -> None:
    both = {("arm", "left"), ("grasp", "top")}
    found = searched(lambda stated: None if both <= stated else EVIDENCE).found
    assert found is not None
    assert ([(one.what, one.value) for one in found.changes], found.cost) == ([("arm", "left"), ("grasp", "top")], 2.0)


def test_after_a_change_that_gets_further_come_changes_for_the_next_failure_before_all_other_pairs() -> None:
    """Of the second failure, which names another thing, moving that is the reason."""
    second = replace(EVIDENCE, steps=2, where="serve/pour", texts=("box1 cannot be reached",), blocking={})

    def ends(stated: Stated) -> Evidence | None:
        if ("attempts", 1) not in stated:
            return EVIDENCE
        places = [value for name, value in stated if name == "box1" and isinstance(value, tuple)]
        return None if any(y > 0.25 for _, y, _ in places) else second

    result = searched(ends)
    assert result.found is not None
    first, moved, along = result.found.changes
    assert (first.what, moved.thing, moved.value, along.thing) == ("attempts", "box1", (1.9, 0.3, 0.79), "saucer1")
    pairs = [one.candidate for one in result.tried if one.candidate.kind == "pair"]
    assert all(one.changes[0].what == "attempts" for one in pairs)


def test_the_budget_limits_the_reruns_and_the_rest_is_listed() -> None:
    result = searched(lambda stated: EVIDENCE, budget=7)
    assert (len(result.tried), result.found) == (7, None)
    assert result.left
    assert not {one.candidate.changes for one in result.tried} & {one.changes for one in result.left}


def test_the_first_in_the_order_of_the_list_is_found_whichever_ends_first() -> None:
    class Reversed(Scripted):
        @contextmanager
        def done(self, worlds: Sequence[World]) -> Iterator[Iterator[Done]]:
            with super().done(worlds) as results:
                yield reversed(list(results))

    helps = {("arm", "left"), ("grasp", "top")}
    reruns = Reruns({}, Reversed(lambda stated: None if stated & helps else EVIDENCE), budget=20)
    found = search(SITUATION, reruns).found
    assert found is not None
    assert found.changes[0].value == "left"
    assert len(reruns.tried) == 2
