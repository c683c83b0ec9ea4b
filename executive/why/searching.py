"""The search for the smallest change: advice first, then single changes, then pairs, each in a whole rerun."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import combinations
from typing import Any

from executive.sweeps import Row, World, run
from executive.sweeps.records import LIMITS, READS_RUN, Done, is_reached
from executive.why.candidates import Candidate, Situation, advised, can_be_joined, cheaper, followed, pair, singles
from executive.why.evidence import Evidence
from executive.why.rerun import JOB
from planlang.advice import ROBOT, Change
from planlang.records import dataclass

MOST_LINKS = 3
"""How often what a rerun advises is added to what was advised before."""
MOST_CHEAPER = 4
"""How many single changes are tried, one of each kind, that cost less than what was advised and helps."""
Told = Callable[[Candidate, Row, int], object]


@dataclass(frozen=True, slots=True)
class Tried:
    """A candidate that was rerun, and its row."""

    candidate: Candidate
    row: Row

    @property
    def evidence(self) -> Evidence | None:
        """What is known of its failure; None if it has none, or the run did not begin or end."""
        stated = self.row.get("evidence")
        return None if stated is None else Evidence.from_json(stated)


@dataclass(frozen=True, slots=True)
class Search:
    """What a search tried, in order, and what it found."""

    tried: tuple[Tried, ...]
    left: tuple[Candidate, ...] = ()
    """What the budget did not suffice for."""
    found: Candidate | None = None
    """The candidate after which the goal is reached; None if there is none among those tried."""


class _Found(Exception):
    """The first candidate that helps is known: all before it did not."""


class Reruns:
    """Reruns candidates in workers, in the order of the list, and stops after the first that helps."""

    def __init__(
        self,
        options: Mapping[str, Any],
        *,
        base: Sequence[Change] = (),
        budget: int,
        engine: Mapping[str, Any],
        told: Told,
    ) -> None:
        """``options`` are those of the run, as JSON, ``base`` the changes that it was made with.

        ``engine`` says where they run (options of :func:`executive.sweeps.run`); ``told`` gets each
        that counts, in their order, and its number.
        """
        self._options, self._base, self._budget, self._engine, self._told = options, base, budget, engine, told
        self.tried: list[Tried] = []

    @property
    def left(self) -> int:
        """Number of reruns that are left."""
        return self._budget - len(self.tried)

    def of(self, candidates: Sequence[Candidate]) -> Candidate | None:
        """Rerun candidates until one helps or the budget is used up; return the one that helps.

        Which one does not depend on the number of processes: it is the first in the order of the list.
        """
        chosen, before = candidates[: self.left], len(self.tried)
        rows: dict[int, Row] = {}
        helping: int | None = None

        def known(done: Done) -> None:
            nonlocal helping
            rows[done.row["world"]] = done.row
            while helping is None and (number := len(self.tried) - before) in rows:  # in order, whichever ends first
                self.tried.append(Tried(chosen[number], rows[number]))
                self._told(chosen[number], rows[number], len(self.tried))
                helping = number if is_reached(rows[number]) else None
            if helping is not None:
                raise _Found

        if chosen:
            worlds: list[World] = [
                {"world": number, "options": self.options_of(candidate), "changes": self._changes(candidate)}
                for number, candidate in enumerate(chosen)
            ]
            with suppress(_Found):
                run(worlds, JOB, limits=LIMITS, told=known, reads=READS_RUN, **self._engine)
        return None if helping is None else chosen[helping]

    def options_of(self, candidate: Candidate) -> dict[str, Any]:
        """Options of a rerun, as JSON; another robot starts where it has room."""
        is_other = any(change.what == ROBOT for change in candidate.changes)
        return {name: value for name, value in self._options.items() if not (is_other and name in ("start", "urdf"))}

    def _changes(self, candidate: Candidate) -> list[dict[str, Any]]:
        return [one.as_json() for one in (*self._base, *candidate.changes)]


def search(situation: Situation, reruns: Reruns) -> Search:
    """Find the first change that helps: what was advised, with what its rerun advises; the single changes; pairs."""
    every: dict[frozenset[Change], Candidate] = {}
    for stage in (_advice, _after_advice, _singles, _pairs):
        for candidates in stage(situation, reruns):
            fresh = [one for one in candidates if frozenset(one.changes) not in every]
            every.update((frozenset(one.changes), one) for one in fresh)
            found = reruns.of(fresh)
            if found is not None:
                smallest = _smallest(found, situation, reruns, is_advised=stage in (_advice, _after_advice))
                return Search(tuple(reruns.tried), found=smallest)
    tried = {frozenset(one.candidate.changes) for one in reruns.tried}
    return Search(tuple(reruns.tried), tuple(one for key, one in every.items() if key not in tried))


def _smallest(found: Candidate, situation: Situation, reruns: Reruns, *, is_advised: bool) -> Candidate:
    """Try less than what helps: a part of it, single changes that cost less than what was advised, a shorter move."""

    def untried(candidates: Iterable[Candidate]) -> list[Candidate]:
        known = {frozenset(one.candidate.changes) for one in reruns.tried}
        return [one for one in candidates if frozenset(one.changes) not in known]

    found = reruns.of(untried(sorted(found.parts, key=lambda one: one.cost))) or found
    if is_advised:
        things = {change.thing for change in found.changes if change.thing is not None}  # their best places are known
        kinds = dict[str, Candidate]()
        for one in untried(cheaper(situation, found.cost)):
            if one.kind != ROBOT and things.isdisjoint(change.thing for change in one.changes):
                kinds.setdefault(one.kind, one)
        found = reruns.of(list(kinds.values())[:MOST_CHEAPER]) or found
    return reruns.of(untried(found.smaller)) or found


def _advice(situation: Situation, reruns: Reruns) -> Iterator[Sequence[Candidate]]:
    """Yield what was advised, then with it what its rerun advises, and so on."""
    first = advised(situation)
    yield first
    for candidate in first:
        for _ in range(MOST_LINKS):
            further = _advised_after(candidate, situation, reruns)
            yield further
            if not further:
                break
            candidate = further[0]


def _after_advice(situation: Situation, reruns: Reruns) -> Iterator[Sequence[Candidate]]:
    """Yield what was advised with single changes for the failure at which its rerun ended, if that got further."""
    for one in _ahead(situation, reruns)[-1:]:
        yield _joined_after(one, situation)[: reruns.left // 2]


def _singles(situation: Situation, reruns: Reruns) -> Iterator[Sequence[Candidate]]:
    """Yield the single changes; then the smaller moves, of which the farthest does not help."""
    farthest = singles(situation)
    yield farthest
    yield sorted((less for one in farthest for less in one.smaller), key=lambda one: one.cost)


def _pairs(situation: Situation, reruns: Reruns) -> Iterator[Sequence[Candidate]]:
    """Yield pairs: changes that got the run further with what is for the next failure, then all others."""
    ahead = [one for one in _ahead(situation, reruns) if one.candidate.kind != "pair"]
    chained = [both for one in ahead for both in _advised_after(one.candidate, situation, reruns)]
    yield sorted(chained, key=lambda one: one.cost)
    yield sorted((both for one in ahead for both in _joined_after(one, situation)), key=lambda one: one.cost)
    alone = [one.candidate for one in reruns.tried if one.candidate.kind != "pair"]
    joined = (pair(one, other) for one, other in combinations(alone, 2) if can_be_joined(one, other))
    yield sorted(joined, key=lambda one: one.cost)


def _ahead(situation: Situation, reruns: Reruns) -> list[Tried]:
    """List the reruns that got further than the run that failed."""
    return [one for one in reruns.tried if one.evidence is not None and one.evidence.is_past(situation.evidence)]


def _joined_after(one: Tried, situation: Situation) -> list[Candidate]:
    """List a candidate with each single change for the failure at which its rerun ended, in their order."""
    assert one.evidence is not None
    further = singles(replace(situation, evidence=one.evidence))
    return [pair(one.candidate, other) for other in further if can_be_joined(one.candidate, other)]


def _advised_after(one: Candidate, situation: Situation, reruns: Reruns) -> list[Candidate]:
    """A candidate with what its rerun advises."""
    changes = frozenset(one.changes)
    evidence = next((each.evidence for each in reruns.tried if frozenset(each.candidate.changes) == changes), None)
    if evidence is None:
        return []
    return [followed(one, other, situation.scene) for other in advised(replace(situation, evidence=evidence))[:1]]
