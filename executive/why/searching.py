"""The search for the smallest change: advice first, then single changes, then pairs, each in a whole rerun."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import combinations

from executive.why.candidates import Candidate, Situation, advised, cheaper, singles
from executive.why.joining import followed, pair
from executive.why.reruns import Reruns, Tried
from planlang.advice import ROBOT, Change
from planlang.records import dataclass

MOST_LINKS = 3
"""How often what a rerun advises is added to what was advised before."""
MOST_CHEAPER = 4
"""How many single changes are tried, one of each kind, that cost less than what was advised and helps."""


@dataclass(frozen=True, slots=True)
class Search:
    """What a search tried, in order, and what it found."""

    tried: tuple[Tried, ...]
    left: tuple[Candidate, ...] = ()
    """What the budget did not suffice for."""
    found: Candidate | None = None
    """The candidate after which the goal is reached; None if there is none among those tried."""


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
    joined = (pair(one, other, situation.scene) for one, other in combinations(alone, 2))
    yield sorted(filter(None, joined), key=lambda one: one.cost)


def _ahead(situation: Situation, reruns: Reruns) -> list[Tried]:
    """List the reruns that got further than the run that failed."""
    return [one for one in reruns.tried if one.evidence is not None and one.evidence.is_past(situation.evidence)]


def _joined_after(one: Tried, situation: Situation) -> list[Candidate]:
    """List a candidate with each single change for the failure at which its rerun ended, in their order."""
    assert one.evidence is not None
    further = singles(replace(situation, evidence=one.evidence))
    joined = (pair(one.candidate, other, situation.scene) for other in further)
    return list(filter(None, joined))


def _advised_after(one: Candidate, situation: Situation, reruns: Reruns) -> list[Candidate]:
    """A candidate with what its rerun advises."""
    changes = frozenset(one.changes)
    evidence = next((each.evidence for each in reruns.tried if frozenset(each.candidate.changes) == changes), None)
    if evidence is None:
        return []
    further = advised(replace(situation, evidence=evidence))[:1]
    return list(filter(None, (followed(one, other, situation.scene) for other in further)))
