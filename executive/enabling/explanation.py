"""Explanations why a robot can do a task with a knowledge base, or which side lacks what: a tree of findings."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

from executive.enabling.needs import Enabling
from executive.enabling.search import Answer, Combination, Need, Offer
from executive.robots.requirements import Availability, Finding, FindingKind
from planlang.knowledge.answers import Found
from planlang.knowledge.entries import Entry

MOST_REFUSED = 20
"""Entries that were refused for one need, of which an explanation tells."""


@dataclass(slots=True)
class Explanation:
    """The answers to what a task needs, told to people and programs."""

    enabling: Enabling
    combination: Combination
    _shown: set[Need] = field(default_factory=set)

    def tree(self) -> Finding:
        """Return the finding about the task's recipe, with all that it needs below."""
        self._shown.clear()
        (root,) = self.combination.wanted
        return self._of(root)

    def unmet(self) -> tuple[str, ...]:
        """Return what neither the robot nor the knowledge base has and everything else waits for, each once."""
        (root,) = self.combination.wanted
        return tuple(dict.fromkeys(self._unmet(root, set())))

    def _unmet(self, need: Need, seen: set[Need]) -> Iterator[str]:
        answer = self.combination.answers.get(need)
        if need in seen or answer is None or answer.is_met:
            return
        seen.add(need)
        if not answer.considered:
            yield self._named(need)
        for _, lacking in answer.considered:
            for below in lacking:
                yield from self._unmet(below, seen)

    def _named(self, need: Need) -> str:
        wanted = self.enabling.wanted[need]
        return f"{wanted.kind.value} {wanted.text}".strip()

    def _of(self, need: Need) -> Finding:
        wanted, answer = self.enabling.wanted[need], self.combination.answers[need]
        is_new = need not in self._shown
        self._shown.add(need)
        if answer.by is not None:
            return Finding(wanted.kind, wanted.text, wanted.iri, Availability.AVAILABLE, answer.by)
        below = tuple(self._below(need, answer)) if is_new else ()
        state, reason = Availability.MISSING, wanted.lacks
        if answer.offer is not None:
            state, reason = Availability.AVAILABLE, self._taken(answer.offer)
        elif any(not offer.is_own for offer, _ in answer.considered):
            reason = "what could be had for it needs what is missing"
        return Finding(wanted.kind, wanted.text, wanted.iri, state, reason, None, below)

    def _taken(self, offer: Offer) -> str:
        if offer.is_own:
            return f"{offer.about} of {self.enabling.robot.robot}, with what it needs"
        if offer.uid in self.enabling.folder.kept:
            return f"{offer.uid} is in {self.enabling.folder.path}"
        return f"{offer.uid} is taken from {self.enabling.shelf.url}"

    def _below(self, need: Need, answer: Answer) -> Iterator[Finding]:
        yield from map(self._of, answer.offer.needs if answer.offer is not None else ())
        refused = [*self._refused(answer)]
        refused += [_entry(uid, reason) for uid, reason in self.enabling.refused.get(need, ())]
        yield from refused[:MOST_REFUSED]
        if len(refused) > MOST_REFUSED:
            yield _entry(f"{len(refused) - MOST_REFUSED} more", "refused, too")

    def _refused(self, answer: Answer) -> Iterator[Finding]:
        for offer, lacking in answer.considered:
            below = tuple(map(self._of, lacking))
            if offer.is_own:
                yield from below
            elif lacking:
                yield _entry(offer.uid, f"it needs {_listed(map(self._named, lacking))}", below)

    def entries(self) -> list[Found]:
        """Return the entries that are used, taken now or before, what others need before them."""
        known = self.enabling.found
        return [known[one.uid] for one in self.combination.offers() if one.uid in known]

    def taken(self) -> list[tuple[Found, list[Need]]]:
        """Return the entries that are to be taken, with the needs that each is for."""
        answers = self.combination.answers.values()
        new = [one for one in self.entries() if one.entry.uid not in self.enabling.folder.kept]
        return [(one, [a.need for a in answers if a.offer and a.offer.uid == one.entry.uid]) for one in new]

    def maps(self) -> list[Entry]:
        """Return the maps that the task runs in."""
        needs = (need for need, wanted in self.enabling.wanted.items() if wanted.kind is FindingKind.MAP)
        answers = (self.combination.answers.get(need) for need in needs)
        uids = {one.offer.uid for one in answers if one is not None and one.offer is not None}
        return [one.entry for one in self.entries() if one.entry.uid in uids]

    def as_json(self) -> dict[str, Any]:
        """Return what is taken, what is missing and the tree as JSON data."""
        taken = [one.entry for one in self.entries()]
        kept = self.enabling.folder.kept
        return {
            "robot": self.enabling.robot.robot,
            "from": self.enabling.shelf.url,
            "enabled": not self.combination.unmet,
            "taken": [one.uid for one in taken if one.uid not in kept],
            "kept": [one.uid for one in taken if one.uid in kept],
            "missing": list(self.unmet()),
            "explanation": self.tree().as_json(),
        }


def _entry(name: str, reason: str, below: tuple[Finding, ...] = ()) -> Finding:
    return Finding(FindingKind.ENTRY, name, None, Availability.MISSING, reason, None, below, counts=False)


def _listed(names: Iterable[str]) -> str:
    return ", ".join(names)
