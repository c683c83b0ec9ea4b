"""Reasons why candidates were rejected: counts per reason and per body in the way, and the places themselves."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field, replace
from typing import Literal

import numpy as np

from executive.belief.scene_collisions import BasePose
from planlang.failures import LocationUnresolvable
from planlang.geometry import Array
from planlang.protocols import Contact
from planlang.records import dataclass

MOST_PLACES = 200
"""Places that are remembered for each reason, for a picture."""


@dataclass(frozen=True, slots=True)
class Reason:
    """The reason why a candidate was rejected, and the body that was in its way, if one was."""

    text: str
    body: str | None = None


COLLISION, NO_ROOM, NOT_VISIBLE = "in collision", "no room for the base", "not visible"
NO_WAY = "no way for the base"
NOT_LOOKED_AT = "not looked at"
OUT_OF_REACH = Reason("out of reach")
NO_HOLD = Reason("no hold for the fingers")


@dataclass(frozen=True, slots=True)
class Validated:
    """A place that was looked at: the reason for its rejection, "" if it was accepted."""

    base: BasePose
    score: float
    reason: str
    body: str | None = None
    """The body that was in the way."""


@dataclass(slots=True)
class Rejections:
    """Counts of one resolution, for the failure and the trace."""

    explained: bool = False
    """True if they are shown even if a place is found: then bodies that block other places are counted, too."""
    remembers: bool = False
    """True if places are remembered for somebody who looks on; nothing else is counted for that."""
    counts: Counter[str] = field(default_factory=Counter)
    blocking: Counter[str] = field(default_factory=Counter)
    places: list[Validated] = field(default_factory=list)
    """Places that were looked at, in that order, if they are shown; the first of each reason."""
    scored: list[tuple[Array, Array]] = field(default_factory=list)
    """Candidates (m, 3) before they were looked at, and their scores (m,)."""
    hopeless: bool = False
    """True if no base pose will do, however many are looked at: a larger search is spared."""
    refused: list[tuple[str, Array]] = field(default_factory=list)
    """Candidates (m, 2 or more) that were refused before they were looked at, with the reason."""
    hands: list[tuple[str, Array]] = field(default_factory=list)
    """Grasp candidates (m, 3) that were refused before base poses were looked for, with the reason; "": not refused."""
    _shown: Counter[str] = field(default_factory=Counter)
    figures: dict[str, str] = field(default_factory=dict)
    """Reason -> a sentence with what was measured, and what would do."""

    @property
    def keeps(self) -> bool:
        """True if places are remembered."""
        return self.explained or self.remembers

    def refuse(self, reason: str, candidates: Array) -> None:
        """Count candidates (m, 2 or more) rejected for a reason, and remember where they are."""
        if len(candidates):
            self.add(reason, len(candidates))
            self.show(reason, candidates)

    def show(self, reason: str, candidates: Array) -> None:
        """Remember for a picture where candidates (m, 2 or more) are that were counted for a reason."""
        if self.keeps and len(candidates):
            self.refused.append((reason, candidates))

    def show_hands(self, reason: str, candidates: Array) -> None:
        """Remember for a picture where grasp candidates (m, 3) are; "" is the reason of those that will do."""
        if self.keeps and len(candidates):
            self.hands.append((reason, candidates))

    def weigh(self, candidates: Array, scores: Array) -> None:
        """Remember for a picture what scores (m,) candidates (m, 3) had before they were looked at."""
        if self.explained:
            self.scored.append((candidates, scores))

    def add(self, reason: str, number: int = 1) -> None:
        """Count ``number`` candidates rejected for a reason."""
        if number:
            self.counts[reason] += number

    def count(self, reasons: Iterable[Reason | None]) -> None:
        """Count candidates, one for each reason that is one."""
        for reason in reasons:
            if reason is not None:
                self.counts[reason.text] += 1
                if reason.body is not None:
                    self.blocking[reason.body] += 1

    def count_at(self, reasons: Sequence[Reason | None], candidates: Array) -> None:
        """Count candidates (m, 2 or more), one for each reason that is one, and remember where they are."""
        self.count(reasons)
        if self.keeps:
            texts = np.array(["" if reason is None else reason.text for reason in reasons], object)
            for text in dict.fromkeys(texts[texts != ""].tolist()):
                self.show(text, candidates[texts == text])

    def crowded(self, body: str, number: int = 1) -> None:
        """Count candidates rejected because a body leaves the robot no room to stand there."""
        self.counts[NO_ROOM] += number
        self.blocking[body] += number

    def include(self, other: Rejections) -> None:
        """Add what another counted and remembered."""
        self.counts.update(other.counts)
        self.blocking.update(other.blocking)
        self.figures.update(other.figures)
        for place in other.places:
            self.remember(place.base, place.score, place.reason, place.body)
        self.scored.extend(other.scored)
        self.refused.extend(other.refused)
        self.hands.extend(other.hands)

    def uncounted(self) -> Rejections:
        """Return where to count candidates that have been counted already, but for those in collision."""
        counts = Counter({COLLISION: self.counts[COLLISION]})
        return replace(self, counts=counts, blocking=Counter(), hopeless=False)

    def copy(self) -> Rejections:
        """Return the same, to go on from twice."""
        fresh = Rejections(self.explained, self.remembers)
        fresh.include(self)
        return fresh

    def begin_again(self, before: Rejections) -> None:
        """Forget what was counted since a copy was made, as it is all looked at once more; places are remembered."""
        self.counts, self.blocking = Counter(before.counts), Counter(before.blocking)

    def remember(self, base: BasePose, score: float, reason: str = "", body: str | None = None) -> None:
        """Remember a place and what became of it."""
        if self.keeps and self._shown[reason] < MOST_PLACES:
            self._shown[reason] += 1
            self.places.append(Validated(base, score, reason, body))

    def reject(self, base: BasePose, score: float, reason: str) -> Literal[False]:
        """Count and remember a place that is rejected for a reason."""
        self.add(reason)
        self.remember(base, score, reason)
        return False

    def ordered(self) -> Mapping[str, int]:
        """Return the counts of reasons, most frequent first."""
        return _ordered(self.counts)

    def ordered_blocking(self) -> Mapping[str, int]:
        """Return the bodies in the way with their counts, most frequent first."""
        return _ordered(self.blocking)

    def failure(self, designator: object, after: int = 0) -> LocationUnresolvable:
        """Return the failure that states all this, most frequent first; ``after`` so many places that were found."""
        counts = self.ordered()
        figures = (self.figures[reason] for reason in counts if reason in self.figures)
        return LocationUnresolvable(
            designator=str(designator),
            counts=counts,
            blocking=self.ordered_blocking(),
            figures=next(figures, ""),
            after=after,
        )


def first_body(contacts: Iterable[Contact]) -> str:
    """Return the body of the deepest contact; by name among equals."""
    return min(contacts, key=lambda contact: (-contact.depth, contact.body)).body


def _ordered(counts: Counter[str]) -> Mapping[str, int]:
    return dict(sorted(counts.items(), key=lambda item: (-item[1], item[0])))
