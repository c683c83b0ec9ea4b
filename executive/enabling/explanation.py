"""Explanations why a robot can do a task with a knowledge base, or which side lacks what: a tree of findings.

For a task that cannot be done, alternatives are the entries that would do it, with the needs that each leaves unmet.
Those of a need are those of its offers; of an offer, the combinations of those of its needs (k best derivations of an
AND/OR graph), found by rounds over all needs until nothing changes. What leads back to itself alone has none.
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
"""Entries that were refused for one need, of which an explanation tells."""

DEEPEST = 100
"""Needs of needs of which an explanation tells."""


@dataclass(slots=True)
class Explanation:
    """The answers to what a task needs, told to people and programs."""

    enabling: Enabling
    combination: Combination
    _shown: set[Need] = field(default_factory=set)
    _path: list[Need] = field(default_factory=list)
    """Needs above the one that is told."""
    _alternatives: tuple[Alternative, ...] | None = None

    def tree(self) -> Finding:
        """Return the finding about the task's recipe, with all that it needs below."""
        self._shown.clear()
        (root,) = self.combination.wanted
        return self._of(root)

    def alternatives(self) -> tuple[Alternative, ...]:
        """Return the ways to do a task that cannot be done, with what each lacks, the nearest to complete first."""
        if self._alternatives is None:
            (root,) = self.combination.wanted
            self._alternatives = alternatives(self.combination, root) if self.combination.unmet else ()
        return self._alternatives

    def unmet(self) -> tuple[str, ...]:
        """Return what the alternative that is nearest to complete lacks."""
        return tuple(self._named(need) for one in self.alternatives()[:1] for need in one.missing)

    def verdict(self) -> Iterator[str]:
        """Yield why a task cannot be done: what neither side has, or what each alternative lacks on which side."""
        robot, found = self.enabling.robot.robot, self.alternatives()
        if len(found) == 1:
            yield f"{robot} cannot do it; neither side has {', '.join(self.unmet())}"
        elif found:
            yield f"{robot} cannot do it; its alternatives, the nearest to complete first, and what they lack:"
            for one in found:
                yield f"  {', '.join(one.entries) or 'without entries'}: {'; '.join(self._lacking(one))}"
        if found and (unread := sum(self.enabling.unread.values())):
            limit = self.enabling.stock.limit
            yield f"that is not sure: of what could be had {unread} were not looked at, as {limit} were (--limit)"

    def _lacking(self, alternative: Alternative) -> Iterator[str]:
        robot, url = self.enabling.robot.robot, self.enabling.url
        for side, verb in ((robot, "lacks"), (f"{robot} and {url}", "lack"), (url, "lacks")):
            names = [self._named(need) for need in alternative.missing if self._side(need) == side]
            if names:
                yield f"{side} {verb} {', '.join(names)}"

    def _side(self, need: Need) -> str:
        """Return who would have to have something: the robot its hardware, a knowledge base recipes, models, maps."""
        wanted, robot, url = self.enabling.wanted[need], self.enabling.robot.robot, self.enabling.url
        if wanted.kind not in NEEDED:
            return url
        return robot if wanted.is_hardware else f"{robot} and {url}"

    def _named(self, need: Need) -> str:
        wanted = self.enabling.wanted[need]
        return f"{wanted.kind.value} {wanted.text}".strip()

    def _of(self, need: Need) -> Finding:
        wanted, answer = self.enabling.wanted[need], self.combination.answers[need]
        is_new = need not in self._shown and len(self._path) < DEEPEST
        self._shown.add(need)
        if answer.by is not None:
            return Finding(wanted.kind, wanted.text, wanted.iri, Availability.AVAILABLE, answer.by)
        is_circular = need in self._path
        self._path.append(need)
        below = tuple(self._below(need, answer)) if is_new else ()
        self._path.pop()
        state, reason = Availability.MISSING, wanted.lacks
        if answer.offer is not None:
            state, reason = Availability.AVAILABLE, self._taken(answer.offer)
        elif is_circular:
            reason = "it is needed for itself"
        elif any(not offer.is_own for offer, _ in answer.considered):
            reason = "what could be had for it needs what is missing"
        return Finding(wanted.kind, wanted.text, wanted.iri, state, reason, None, below)

    def _taken(self, offer: Offer) -> str:
        if offer.is_own:
            return f"{offer.about} of {self.enabling.robot.robot}, with what it needs"
        return self.enabling.stock.said_of(offer.uid)

    def _below(self, need: Need, answer: Answer) -> Iterator[Finding]:
        yield from map(self._of, answer.offer.needs if answer.offer is not None else ())
        refused = [*self._refused(answer)]
        refused += [_entry(uid, reason) for uid, reason in self.enabling.refused.get(need, {}).items()]
        yield from refused[:MOST_REFUSED]
        if len(refused) > MOST_REFUSED:
            yield _entry(f"... and {len(refused) - MOST_REFUSED} more", "refused, too")
        if unread := self.enabling.unread.get(need):
            yield _entry(f"... and {unread} more", f"not looked at, as {self.enabling.stock.limit} were (--limit)")

    def _refused(self, answer: Answer) -> Iterator[Finding]:
        for offer, lacking in answer.considered:
            below = tuple(map(self._of, lacking))
            if offer.is_own:
                yield from below
            elif lacking:
                yield _entry(offer.uid, f"it needs {_listed(map(self._named, lacking))}", below)

    def entries(self) -> list[Found]:
        """Return the entries that are used, taken now or before, what others need before them."""
        known = self.enabling.stock.found
        return [known[one.uid] for one in self.combination.offers() if one.uid in known]

    def taken(self) -> list[tuple[Found, list[Need]]]:
        """Return the entries that are to be taken, with the needs that each is for."""
        answers = self.combination.answers.values()
        new = [one for one in self.entries() if not self.enabling.stock.is_kept(one.entry.uid)]
        return [(one, [a.need for a in answers if a.offer and a.offer.uid == one.entry.uid]) for one in new]

    def maps(self) -> list[Entry]:
        """Return the maps that the task runs in."""
        needs = (need for need, wanted in self.enabling.wanted.items() if wanted.kind is FindingKind.MAP)
        answers = (self.combination.answers.get(need) for need in needs)
        uids = {one.offer.uid for one in answers if one is not None and one.offer is not None}
        return [one.entry for one in self.entries() if one.entry.uid in uids]

    def as_json(self) -> dict[str, Any]:
        """Return what is taken, what is missing and the tree as JSON data."""
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
            name: [self._named(need) for need in alternative.missing if self._side(need) in meant]
            for name, meant in sides.items()
        }
        return {"entries": list(alternative.entries), **lacking}


def _entry(name: str, reason: str, below: tuple[Finding, ...] = ()) -> Finding:
    return Finding(FindingKind.ENTRY, name, None, Availability.MISSING, reason, None, below, counts=False)


def _listed(names: Iterable[str]) -> str:
    return ", ".join(names)


MOST_KEPT = 5
"""Alternatives of a need that are kept, the nearest to complete."""
MOST_ROUNDS = 50


@dataclass(frozen=True, slots=True)
class Alternative:
    """Entries (identifiers) that meet a need but for what is ``missing``: needs that nothing meets."""

    entries: tuple[str, ...]
    missing: tuple[Need, ...]


def alternatives(combination: Combination, root: Need) -> tuple[Alternative, ...]:
    """Return the ways to meet a need that nothing meets, those that lack least first, then as they were offered.

    Of ways that lack the same, the first. Where all ways lead in circles, one need in each counts as missing.
    """
    answers = combination.answers
    unmet = [need for need, answer in reversed(answers.items()) if not answer.is_met]
    known: dict[Need, tuple[Alternative, ...]] = dict.fromkeys(unmet, ())
    known.update((need, (Alternative((), (need,)),)) for need in unmet if not answers[need].considered)
    _spread(combination, unmet, known)
    while not known[root]:
        circular = next(need for need in unmet if not known[need])
        known[circular] = (Alternative((), (circular,)),)
        _spread(combination, unmet, known)
    return known[root]


def _spread(combination: Combination, unmet: Iterable[Need], known: dict[Need, tuple[Alternative, ...]]) -> None:
    """Complete what is known of needs with the alternatives of what these need."""
    for _ in range(MOST_ROUNDS):
        is_changed = False
        for need in unmet:
            ways = [way for one in combination.answers[need].considered for way in _ways(*one, known)]
            found = _nearest([*ways, *(known[need] if not ways else ())])
            is_changed |= found != known[need]
            known[need] = found
        if not is_changed:
            return


def _ways(offer: Offer, lacking: Iterable[Need], known: Mapping[Need, tuple[Alternative, ...]]) -> list[Alternative]:
    """Return the ways to take an offer."""
    found: tuple[Alternative, ...] = (Alternative((), ()),)
    for need in lacking:
        found = _nearest(_joined(one, other) for one in found for other in known[need])
    taken = Alternative(() if offer.is_own else (offer.uid,), ())
    return [_joined(one, taken) for one in found]


def _joined(one: Alternative, other: Alternative) -> Alternative:
    entries, missing = (*one.entries, *other.entries), (*one.missing, *other.missing)
    return Alternative(tuple(dict.fromkeys(entries)), tuple(dict.fromkeys(missing)))


def _nearest(ways: Iterable[Alternative]) -> tuple[Alternative, ...]:
    """Return the ways that lack least, the first of those that lack the same."""
    found: dict[frozenset[Need], Alternative] = {}
    for one in ways:
        found.setdefault(frozenset(one.missing), one)
    return tuple(sorted(found.values(), key=lambda one: len(one.missing))[:MOST_KEPT])
