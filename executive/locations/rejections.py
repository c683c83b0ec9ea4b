"""Rejected candidates: counts by reason and by body in the way, and their places."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import field, replace
from typing import Literal

import numpy as np

from executive.belief.believed_bodies import BelievedBodies
from executive.belief.scene_collisions import BasePose
from planlang.advice import Change
from planlang.designators import Action
from planlang.failures import LocationUnresolvable
from planlang.geometry import Array
from planlang.geometry.areas import Clear, Facing, Region
from planlang.protocols import Contact
from planlang.records import dataclass

MOST_PLACES = 200
"""Number of places kept per reason, for a picture."""


@dataclass(frozen=True, slots=True)
class Reason:
    """Reason for rejecting a candidate, and the body in its way, if any."""

    text: str
    body: str | None = None


COLLISION, NO_ROOM, NOT_VISIBLE = "in collision", "no room for the base", "not visible"
NOT_LOOKED_AT = "not looked at"
OUT_OF_REACH = Reason("out of reach")
NO_HOLD = Reason("no hold for the fingers")


@dataclass(frozen=True, slots=True)
class Validated:
    """Place that was validated, with the reason for its rejection, or "" if it was accepted."""

    base: BasePose
    score: float
    reason: str
    body: str | None = None
    """The body in the way."""


@dataclass(slots=True)
class Rejections:
    """Counts of one resolution, for the failure and the trace."""

    explained: bool = False
    """True if they are shown even on success: then bodies that block other places are counted as well."""
    remembers: bool = False
    """True to keep places for an observer, without counting more."""
    counts: Counter[str] = field(default_factory=Counter)
    blocking: Counter[str] = field(default_factory=Counter)
    places: list[Validated] = field(default_factory=list)
    """Validated places in order, if they are shown; the first of each reason."""
    scored: list[tuple[Array, Array]] = field(default_factory=list)
    """Candidates (m, 3) before validation, and their scores (m,)."""
    hopeless: bool = False
    """True if no base pose can work, so that a larger search is pointless."""
    refused: list[tuple[str, Array]] = field(default_factory=list)
    """Candidates (m, 2 or more) rejected before validation, with the reason."""
    hands: list[tuple[str, Array]] = field(default_factory=list)
    """Grasp candidates (m, 3) rejected before the search for base poses, with the reason; "" if accepted."""
    _shown: Counter[str] = field(default_factory=Counter)
    figures: dict[str, str] = field(default_factory=dict)
    """Reason -> a sentence with measurements and a change that would help."""
    first: Action | None = None
    """Action of the robot after which the search finds a place, if one was found."""
    changes: tuple[Change, ...] = ()
    """What the sentence of :attr:`figures` advises to change, as data."""

    @property
    def keeps(self) -> bool:
        """Whether places are kept."""
        return self.explained or self.remembers

    def refuse(self, reason: str, candidates: Array) -> None:
        """Count candidates (m, 2 or more) rejected for a reason, and keep their places."""
        if len(candidates):
            self.add(reason, len(candidates))
            self.show(reason, candidates)

    def show(self, reason: str, candidates: Array) -> None:
        """Keep the places of candidates (m, 2 or more) that were counted for a reason, for a picture."""
        if self.keeps and len(candidates):
            self.refused.append((reason, candidates))

    def show_hands(self, reason: str, candidates: Array) -> None:
        """Keep the places of grasp candidates (m, 3) for a picture; the reason of accepted ones is ""."""
        if self.keeps and len(candidates):
            self.hands.append((reason, candidates))

    def weigh(self, candidates: Array, scores: Array) -> None:
        """Keep the scores (m,) of candidates (m, 3) before validation, for a picture."""
        if self.explained:
            self.scored.append((candidates, scores))

    def add(self, reason: str, number: int = 1) -> None:
        """Count ``number`` candidates rejected for a reason."""
        if number:
            self.counts[reason] += number

    def count(self, reasons: Iterable[Reason | None], candidates: Array | None = None) -> None:
        """Count the candidates with a reason, and keep their places if they are given, (m, 2 or more)."""
        each = list(reasons)
        for reason in each:
            if reason is not None:
                self.counts[reason.text] += 1
                if reason.body is not None:
                    self.blocking[reason.body] += 1

        if self.keeps and candidates is not None:
            texts = np.array(["" if reason is None else reason.text for reason in each], object)
            for text in dict.fromkeys(texts[texts != ""].tolist()):
                self.show(text, candidates[texts == text])

    def crowded(self, body: str, number: int = 1) -> None:
        """Count candidates rejected because a body leaves the robot no room to stand."""
        self.counts[NO_ROOM] += number
        self.blocking[body] += number

    def include(self, other: Rejections) -> None:
        """Add the counts and places of another."""
        self.counts.update(other.counts)
        self.blocking.update(other.blocking)
        self.figures.update(other.figures)
        for place in other.places:
            self.remember(place.base, place.score, place.reason, place.body)
        self.scored.extend(other.scored)
        self.refused.extend(other.refused)
        self.hands.extend(other.hands)

    def uncounted(self) -> Rejections:
        """Create a log for candidates that were counted already; only collisions carry over."""
        counts = Counter({COLLISION: self.counts[COLLISION]})
        return replace(self, counts=counts, blocking=Counter(), hopeless=False)

    def remember(self, base: BasePose, score: float, reason: str = "", body: str | None = None) -> None:
        """Keep a place and its outcome."""
        if self.keeps and self._shown[reason] < MOST_PLACES:
            self._shown[reason] += 1
            self.places.append(Validated(base, score, reason, body))

    def reject(self, base: BasePose, score: float, reason: str) -> Literal[False]:
        """Count and keep a place that is rejected for a reason."""
        self.add(reason)
        self.remember(base, score, reason)
        return False

    def ordered(self) -> Mapping[str, int]:
        """Counts of reasons, most frequent first."""
        return _ordered(self.counts)

    def ordered_blocking(self) -> Mapping[str, int]:
        """Counts of bodies in the way, most frequent first."""
        return _ordered(self.blocking)

    def failure(self, designator: object, bodies: BelievedBodies, after: int = 0) -> LocationUnresolvable:
        """Create the failure with these counts; ``after`` is the number of places found before.

        It names the ``bodies`` in the way in words, and all links of the robot as one.
        """
        counts, blocking = self.ordered(), Counter[str]()
        for name, number in self.blocking.items():
            blocking[bodies.as_obstacle(name)] += number
        figures = (self.figures[reason] for reason in counts if reason in self.figures)
        return LocationUnresolvable(
            designator=str(designator),
            counts=counts,
            blocking=_ordered(blocking),
            figures=next(figures, ""),
            after=after,
            first=self.first,
            changes=self.changes,
        )


def unmet(area: Region | Facing | Clear) -> str:
    """Reason for rejecting places outside an area, or headings."""
    return f"not {area.words}".replace("not not ", "")


def first_body(contacts: Iterable[Contact]) -> str:
    """Name the body of the deepest contact; by name among equals."""
    return min(contacts, key=lambda contact: (-contact.depth, contact.body)).body


def _ordered(counts: Counter[str]) -> Mapping[str, int]:
    return dict(sorted(counts.items(), key=lambda item: (-item[1], item[0])))
