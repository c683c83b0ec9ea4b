"""The result of comparing a task with a robot: a tree of reasons, as text and as data."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import Enum
from typing import Any

from planlang.diagnostics import Span


class Availability(Enum):
    """Whether a robot has something."""

    AVAILABLE = "available"
    MISSING = "missing"
    UNKNOWN = "unknown"


class FindingKind(Enum):
    """What a node of the tree is about."""

    TASK = "task"
    ACTION = "action"
    ALTERNATIVES = "alternatives"
    CAPABILITY = "capability"
    COMPONENT = "component"


NEEDED = (FindingKind.CAPABILITY, FindingKind.COMPONENT)
"""Kinds that a robot has or lacks; the others are parts of the task."""


@dataclass(frozen=True, slots=True)
class Finding:
    """A node of the tree of reasons.

    ``iri`` is None for an expression; ``span`` is where the robot claims it, ``required`` where the requirement is
    stated; ``remedy`` says where a missing thing could be had. A node that does not count is listed for its reason
    alone: a part of a combination, or a requirement that leads back to itself.
    """

    kind: FindingKind
    text: str
    iri: str | None
    state: Availability
    reason: str = ""
    span: Span | None = None
    below: tuple[Finding, ...] = ()
    required: Span | None = None
    remedy: str = ""
    counts: bool = True

    def walk(self, path: tuple[Finding, ...] = ()) -> Iterator[tuple[Finding, tuple[Finding, ...]]]:
        """Yield this and everything below it that counts, each with the findings above it, outermost first."""
        yield self, path
        for one in self.below:
            if one.counts:
                yield from one.walk((*path, self))

    def lines(self, *, all_of_it: bool = True) -> Iterator[str]:
        """Yield the tree as lines of text; without ``all_of_it`` only what is not available, and what is above that."""
        yield from self._lines("", "", all_of_it, set())

    def _lines(self, first: str, rest: str, all_of_it: bool, shown: set[tuple[str, str]]) -> Iterator[str]:
        key = (self.kind.value, self.iri or self.text)
        repeated = bool(self.below) and self.kind is FindingKind.CAPABILITY and key in shown
        shown.add(key)
        label = f"{self.kind.value} {self.text}" if self.kind in NEEDED else self.text
        reason = f": {self.reason}" if self.reason else ""
        where = f" ({self.span})" if self.span is not None and self.kind in NEEDED else ""
        yield f"{first}{label} - {self.state.value}{reason}{where}{'; see above' if repeated else ''}"
        if self.remedy:
            yield f"{rest}   {self.remedy}"
        if repeated:
            return
        below = [one for one in self.below if all_of_it or one.state is not Availability.AVAILABLE]
        for one in below:
            last = one is below[-1]
            corner, beam = ("`- ", "   ") if last else ("|- ", "|  ")
            yield from one._lines(rest + corner, rest + beam, all_of_it, shown)

    def as_json(self) -> dict[str, Any]:
        """Return the tree as JSON data."""
        data: dict[str, Any] = {"kind": self.kind.value, "name": self.text, "iri": self.iri, "state": self.state.value}
        for key, value in (("reason", self.reason), ("remedy", self.remedy)):
            if value:
                data[key] = value
        for key, span in (("stated_at", self.span), ("required_at", self.required)):
            if span is not None:
                data[key] = str(span)
        if self.below:
            data["requires"] = [one.as_json() for one in self.below]
        return data


def together(states: Iterable[Availability], *, any_of: bool = False) -> Availability:
    """Return the worst of some states, or the best with ``any_of``; AVAILABLE for none at all."""
    found = set(states)
    order = [Availability.MISSING, Availability.UNKNOWN, Availability.AVAILABLE]
    if any_of:
        order.reverse()
    return next((state for state in order if state in found), Availability.AVAILABLE)
