"""The search for the smallest change: advice first, then single changes, then pairs, each in a whole rerun."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import combinations
from typing import Any

from executive.sweeps import Row, World, run
from executive.sweeps.records import LIMITS, Done, is_reached
from executive.why.candidates import Candidate, Situation, advised, can_be_joined, pair, singles
from executive.why.costs import cost_of
from executive.why.rerun import JOB
from planlang.advice import ROBOT, Change
from planlang.records import dataclass

MOST_LINKS = 3
"""How often what a rerun advises is added to what was advised before."""
Told = Callable[[Candidate, Row, int], object]


@dataclass(frozen=True, slots=True)
class Tried:
    """A candidate that was rerun, and its row."""

    candidate: Candidate
    row: Row

    @property
    def helped(self) -> bool:
        """True if the goal was reached."""
        return is_reached(self.row)


@dataclass(frozen=True, slots=True)
class Search:
    """What a search tried, in order; the last one helped if any did."""

    tried: tuple[Tried, ...]
    left: tuple[Candidate, ...]
    """What the budget did not suffice for."""

    @property
    def found(self) -> Candidate | None:
        """The candidate after which the goal is reached; None if there is none among those tried."""
        return self.tried[-1].candidate if self.tried and self.tried[-1].helped else None


class _Found(Exception):
    """The first candidate that helps is known: all before it did not."""


class Reruns:
    """Reruns candidates in workers, in the order of the list, and stops after the first that helps."""

    def __init__(
        self,
        options: Mapping[str, Any],
        first: Row,
        *,
        base: Sequence[Change] = (),
        budget: int,
        processes: int | None,
        on: str,
        told: Told,
    ) -> None:
        """``options`` are those of the run, as JSON, ``first`` its row, ``base`` the changes that it was made with.

        ``told`` gets each rerun and its number.
        """
        self._options, self._budget, self._processes, self._on, self._told = options, budget, processes, on, told
        self._first, self._base = first, base
        self.tried: list[Tried] = []

    @property
    def left(self) -> int:
        """Number of reruns that are left."""
        return self._budget - len(self.tried)

    def of(self, candidates: Sequence[Candidate]) -> bool:
        """Rerun candidates until one helps or the budget is used up; True if one helps.

        Which one does not depend on the number of processes: it is the first in the order of the list.
        """
        chosen = candidates[: self.left]
        rows: dict[int, Row] = {}

        def known(done: Done) -> None:
            rows[done.row["world"]] = done.row
            self._told(chosen[done.row["world"]], done.row, len(self.tried) + len(rows))
            if _first_helping(rows) is not None:
                raise _Found

        if chosen:
            worlds: list[World] = [
                {"world": number, "options": self.options_of(candidate), "changes": self._changes(candidate)}
                for number, candidate in enumerate(chosen)
            ]
            with suppress(_Found):
                run(worlds, JOB, self._on, processes=self._processes, limits=LIMITS, told=known)
        helping = _first_helping(rows)
        most = len(chosen) if helping is None else helping + 1
        self.tried += [Tried(chosen[number], rows[number]) for number in range(most)]
        return helping is not None

    def options_of(self, candidate: Candidate) -> dict[str, Any]:
        """Options of a rerun, as JSON; another robot starts where it has room."""
        is_other = any(change.what == ROBOT for change in candidate.changes)
        return {name: value for name, value in self._options.items() if not (is_other and name in ("start", "urdf"))}

    def _changes(self, candidate: Candidate) -> list[dict[str, Any]]:
        return [one.as_json() for one in (*self._base, *candidate.changes)]

    def got_further(self, one: Tried) -> bool:
        """Check whether a rerun did more steps than the run that failed, or as many and failed elsewhere."""
        steps, before = one.row.get("steps", -1), self._first["steps"]
        return bool(steps > before or (steps == before and one.row.get("where") != self._first["where"]))


def _first_helping(rows: Mapping[int, Row]) -> int | None:
    """Number of the first row that reached its goal if all before it are known and did not."""
    number = 0
    while number in rows:
        if is_reached(rows[number]):
            return number
        number += 1
    return None


def search(situation: Situation, reruns: Reruns) -> Search:
    """Find the first change that helps: what was advised, with what its rerun advises; the single changes; pairs."""
    every: dict[frozenset[Change], Candidate] = {}

    def new(candidates: Sequence[Candidate]) -> list[Candidate]:
        fresh = [one for one in candidates if frozenset(one.changes) not in every]
        every.update((frozenset(one.changes), one) for one in fresh)
        return fresh

    stages = (_advice, _singles, _pairs)
    for stage in stages:
        for candidates in stage(situation, reruns):
            if reruns.of(new(candidates)):
                return Search(tuple(reruns.tried), ())
    tried = {frozenset(one.candidate.changes) for one in reruns.tried}
    return Search(tuple(reruns.tried), tuple(one for key, one in every.items() if key not in tried))


def _advice(situation: Situation, reruns: Reruns) -> Iterator[Sequence[Candidate]]:
    first = advised(situation)
    yield first
    for candidate in first:
        for _ in range(MOST_LINKS):
            further = [pair(candidate, other) for other in _advised_after(candidate, situation, reruns)]
            yield further
            if not further:
                break
            candidate = further[0]


def _singles(situation: Situation, reruns: Reruns) -> Iterator[Sequence[Candidate]]:
    yield singles(situation)


def _pairs(situation: Situation, reruns: Reruns) -> Iterator[Sequence[Candidate]]:
    """Yield pairs: a change with what its rerun advised, then changes that got the run further with others."""
    own = [one for one in reruns.tried if one.candidate.kind != "pair"]
    ahead = [one.candidate for one in own if reruns.got_further(one)]
    chained = [pair(one, other) for one in ahead for other in _advised_after(one, situation, reruns)]
    yield sorted(chained, key=lambda one: one.cost)
    every = [one.candidate for one in own]
    joined = [pair(one, other) for one, other in combinations(every, 2) if can_be_joined(one, other)]
    helps = {one.changes for one in ahead}
    yield sorted(joined, key=lambda one: (not any(set(part) <= set(one.changes) for part in helps), one.cost))


def _advised_after(one: Candidate, situation: Situation, reruns: Reruns) -> list[Candidate]:
    """What the rerun of a candidate advised, if that can be joined to it."""
    row = next((tried.row for tried in reruns.tried if tried.candidate == one), {})
    changes = tuple(map(Change.of, row.get("advised", ())))
    other = Candidate(changes, "advice", cost_of(changes, situation.scene))
    return [other] if changes and can_be_joined(one, other) else []
