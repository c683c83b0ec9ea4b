"""Explanation why a robot can do a task with a knowledge base, or what is missing on which side: a tree of findings.

For a task that cannot be done, an alternative is a set of entries that would do it, with the needs that stay unmet.
The alternatives of a need are the union of those of its offers; those of an offer combine one alternative of each of
its needs (k best derivations of an AND/OR graph). They are computed by passes over all needs up to the fixed point.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import field
from typing import Any

from executive.enabling.needs import Enabling
from executive.enabling.search import Answer, Combination, Need, Offer
from executive.robots.requirements import NEEDED, Availability, Finding, FindingKind
from planlang.knowledge.answers import Found
from planlang.knowledge.entries import Entry
from planlang.records import dataclass

MOST_REFUSED = 20
"""Refused entries shown for one need."""

DEEPEST = 100
"""Depth at which the tree of findings is cut off."""


@dataclass(slots=True)
class Explanation:
    """Result of enabling a robot for a task, as text and as JSON data."""

    enabling: Enabling
    combination: Combination
    _shown: set[Need] = field(default_factory=set)
    _path: list[Need] = field(default_factory=list)
    """Requirements that depend on the reported one, the task first."""
    _alternatives: tuple[Alternative, ...] | None = None

    def tree(self) -> Finding:
        """Build the finding for the task's recipe, with the findings for its needs below it."""
        self._shown.clear()
        (root,) = self.combination.roots
        return self._of(root)

    def alternatives(self) -> tuple[Alternative, ...]:
        """Alternatives for a task that cannot be done, those with the fewest unmet needs first."""
        if self._alternatives is None:
            (root,) = self.combination.roots
            self._alternatives = alternatives(self.combination, root) if self.combination.unmet else ()
        return self._alternatives

    def unmet(self) -> tuple[str, ...]:
        """Unmet needs of the best alternative, in words."""
        return tuple(self._named(need) for one in self.alternatives()[:1] for need in one.missing)

    def verdict(self) -> Iterator[str]:
        """Yield the lines why a task cannot be done: what each alternative lacks, and on which side."""
        robot, options = self.enabling.robot.robot, self.alternatives()
        if len(options) == 1:
            yield f"{robot} cannot do it; neither side has {', '.join(self.unmet())}"
        elif options:
            yield f"{robot} cannot do it; alternatives and what they lack, the most complete first:"
            for one in options:
                yield f"  {', '.join(one.entries) or 'without entries'}: {'; '.join(self._lacking(one))}"
        if options and (unread := sum(self.enabling.unread.values())):
            limit = self.enabling.stock.limit
            yield f"this is not certain: {unread} candidates were not examined after the first {limit}, the limit"

    def _lacking(self, alternative: Alternative) -> Iterator[str]:
        robot, url = self.enabling.robot.robot, self.enabling.url
        for side, verb in ((robot, "lacks"), (f"{robot} and {url}", "lack"), (url, "lacks")):
            names = [self._named(need) for need in alternative.missing if self._side(need) == side]
            if names:
                yield f"{side} {verb} {', '.join(names)}"

    def _side(self, need: Need) -> str:
        """Name who could meet a need: the robot (hardware), the knowledge base (recipes, models, maps), or both."""
        details, robot, url = self.enabling.details[need], self.enabling.robot.robot, self.enabling.url
        if details.kind not in NEEDED:
            return url
        return robot if details.is_hardware else f"{robot} and {url}"

    def _named(self, need: Need) -> str:
        details = self.enabling.details[need]
        return f"{details.kind.value} {details.text}".strip()

    def _of(self, need: Need) -> Finding:
        details, answer = self.enabling.details[need], self.combination.answers[need]
        is_new = need not in self._shown and len(self._path) < DEEPEST
        self._shown.add(need)
        if answer.by is not None:
            return Finding(details.kind, details.text, details.iri, Availability.AVAILABLE, answer.by)
        is_circular = need in self._path
        self._path.append(need)
        below = tuple(self._below(need, answer)) if is_new else ()
        self._path.pop()
        state, reason = Availability.MISSING, details.lacks
        if answer.offer is not None:
            state, reason = Availability.AVAILABLE, self._taken(answer.offer)
        elif is_circular:
            reason = "it depends on itself"
        elif any(not offer.is_own for offer, _ in answer.considered):
            reason = "every candidate needs something that is missing"
        return Finding(details.kind, details.text, details.iri, state, reason, None, below)

    def _taken(self, offer: Offer) -> str:
        if offer.is_own:
            return f"{offer.about} of {self.enabling.robot.robot}, with its dependencies"
        return self.enabling.stock.provenance(offer.uid)

    def _below(self, need: Need, answer: Answer) -> Iterator[Finding]:
        yield from map(self._of, answer.offer.needs if answer.offer is not None else ())
        refused = [*self._refused(answer)]
        refused += [_entry(uid, reason) for uid, reason in self.enabling.refused.get(need, {}).items()]
        yield from refused[:MOST_REFUSED]
        if len(refused) > MOST_REFUSED:
            yield _entry(f"... and {len(refused) - MOST_REFUSED} more", "refused as well")
        if unread := self.enabling.unread.get(need):
            reason = f"not examined, after the first {self.enabling.stock.limit}, the limit"
            yield _entry(f"... and {unread} more", reason)

    def _refused(self, answer: Answer) -> Iterator[Finding]:
        for offer, lacking in answer.considered:
            below = tuple(map(self._of, lacking))
            if offer.is_own:
                yield from below
            elif lacking:
                yield _entry(offer.uid, f"it needs {', '.join(map(self._named, lacking))}", below)

    def entries(self) -> list[Found]:
        """Entries that the task uses, downloaded now or before; dependencies come before the entries that need them."""
        known = self.enabling.stock.found
        return [known[one.uid] for one in self.combination.offers() if one.uid in known]

    def taken(self) -> list[tuple[Found, list[Need]]]:
        """Entries to download, each with the needs that it meets."""
        answers = self.combination.answers.values()
        new = [one for one in self.entries() if not self.enabling.stock.is_kept(one.entry.uid)]
        return [(one, [a.need for a in answers if a.offer and a.offer.uid == one.entry.uid]) for one in new]

    def maps(self) -> list[Entry]:
        """Maps among the used entries, in which the task can run."""
        needs = (need for need, details in self.enabling.details.items() if details.kind is FindingKind.MAP)
        answers = (self.combination.answers.get(need) for need in needs)
        uids = {one.offer.uid for one in answers if one is not None and one.offer is not None}
        return [one.entry for one in self.entries() if one.entry.uid in uids]

    def as_json(self) -> dict[str, Any]:
        """JSON data: downloaded and missing entries, alternatives, and the tree of findings."""
        used, stock = [one.entry.uid for one in self.entries()], self.enabling.stock
        new = [one for one in used if not stock.is_kept(one)]
        return {
            "robot": self.enabling.robot.robot,
            "from": self.enabling.url,
            "enabled": not self.combination.unmet,
            "taken": [one for one in new if one not in stock.renewed],
            "renewed": [one for one in new if one in stock.renewed],
            "kept": [one for one in used if stock.is_kept(one)],
            "missing": list(self.unmet()),
            "alternatives": [self._as_json(one) for one in self.alternatives()],
            "unread": sum(self.enabling.unread.values()),
            "explanation": self.tree().as_json(),
        }

    def _as_json(self, alternative: Alternative) -> dict[str, Any]:
        robot, url = self.enabling.robot.robot, self.enabling.url
        sides = {name: (side, f"{robot} and {url}") for name, side in (("robot", robot), ("knowledge_base", url))}
        lacking = {
            name: [self._named(need) for need in alternative.missing if self._side(need) in owners]
            for name, owners in sides.items()
        }
        return {"entries": list(alternative.entries), **lacking}


def _entry(name: str, reason: str, below: tuple[Finding, ...] = ()) -> Finding:
    return Finding(FindingKind.ENTRY, name, None, Availability.MISSING, reason, None, below, counts=False)


MOST_KEPT = 5
"""Alternatives kept for each need; the number of combinations would grow exponentially without a bound."""
MOST_PASSES = 50


@dataclass(frozen=True, slots=True)
class Alternative:
    """Identifiers of entries that meet a need, except for the ``missing`` needs, which nothing meets."""

    entries: tuple[str, ...]
    missing: tuple[Need, ...]


def alternatives(combination: Combination, root: Need) -> tuple[Alternative, ...]:
    """Find the alternatives for an unmet need, those with the fewest missing needs first, then in the order of offers.

    Of alternatives with the same missing needs only the first is kept. Where all of them are circular, one need of
    each cycle counts as missing.
    """
    answers = combination.answers
    unmet = [need for need, answer in reversed(answers.items()) if not answer.is_met]
    known: dict[Need, tuple[Alternative, ...]] = dict.fromkeys(unmet, ())
    known.update((need, (Alternative((), (need,)),)) for need in unmet if not answers[need].considered)
    _propagate(combination, unmet, known)
    while not known[root]:
        circular = next(need for need in unmet if not known[need])
        known[circular] = (Alternative((), (circular,)),)
        _propagate(combination, unmet, known)
    return known[root]


def _propagate(combination: Combination, unmet: Iterable[Need], known: dict[Need, tuple[Alternative, ...]]) -> None:
    """Recompute the alternatives of each need from those of its offers until nothing changes."""
    for _ in range(MOST_PASSES):
        is_changed = False
        for need in unmet:
            derived = [way for one in combination.answers[need].considered for way in _ways(*one, known)]
            best = _best(derived or known[need])
            is_changed |= best != known[need]
            known[need] = best
        if not is_changed:
            return


def _ways(offer: Offer, lacking: Iterable[Need], known: Mapping[Need, tuple[Alternative, ...]]) -> list[Alternative]:
    """Combine the alternatives of all unmet needs of an offer."""
    combined: tuple[Alternative, ...] = (Alternative((), ()),)
    for need in lacking:
        combined = _best(_joined(one, other) for one in combined for other in known[need])
    own_entry = Alternative(() if offer.is_own else (offer.uid,), ())
    return [_joined(one, own_entry) for one in combined]


def _joined(one: Alternative, other: Alternative) -> Alternative:
    entries, missing = (*one.entries, *other.entries), (*one.missing, *other.missing)
    return Alternative(tuple(dict.fromkeys(entries)), tuple(dict.fromkeys(missing)))


def _best(ways: Iterable[Alternative]) -> tuple[Alternative, ...]:
    """Select the alternatives with the fewest missing needs, the first of each set of missing needs."""
    distinct: dict[frozenset[Need], Alternative] = {}
    for one in ways:
        distinct.setdefault(frozenset(one.missing), one)
    return tuple(sorted(distinct.values(), key=lambda one: len(one.missing))[:MOST_KEPT])
