"""What was found when a task was compared with a robot: a tree of reasons, as text and as data."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import Enum
from typing import Any

from planlang.diagnostics import Span


class Availability(Enum):
    """Whether something is there."""

    AVAILABLE = "available"
    MISSING = "missing"
    UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True)
class Finding:
    """A node: ``kind`` is "task", "action", "alternatives", "capability" or "component".

    ``iri`` is None for an expression; ``span`` is where the robot says that it has it, ``required`` where that it is
    needed is stated; ``remedy`` tells where what is missing could be had. What does not count is told for the reason
    alone: a part of a combination, or what leads back to itself.
    """

    kind: str
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
        """This and everything below it that counts, each with the findings that it stands under, outermost first."""
        yield self, path
        for one in self.below:
            if one.counts:
                yield from one.walk((*path, self))

    def lines(self, *, all_of_it: bool = True) -> Iterator[str]:
        """The tree as lines of text; else only what is not available, and what it stands under."""
        yield from self._lines("", "", all_of_it, set())

    def _lines(self, first: str, rest: str, all_of_it: bool, told: set[tuple[str, str]]) -> Iterator[str]:
        key = (self.kind, self.iri or self.text)
        repeated = bool(self.below) and self.kind == "capability" and key in told
        told.add(key)
        label = self.text if self.kind in ("task", "action", "alternatives") else f"{self.kind} {self.text}"
        reason = f": {self.reason}" if self.reason else ""
        where = f" ({self.span})" if self.span is not None and self.kind in ("capability", "component") else ""
        yield f"{first}{label} - {self.state.value}{reason}{where}{'; see above' if repeated else ''}"
        if self.remedy:
            yield f"{rest}   {self.remedy}"
        if repeated:
            return
        below = [one for one in self.below if all_of_it or one.state is not Availability.AVAILABLE]
        for one in below:
            last = one is below[-1]
            corner, beam = ("`- ", "   ") if last else ("|- ", "|  ")
            yield from one._lines(rest + corner, rest + beam, all_of_it, told)

    def as_json(self) -> dict[str, Any]:
        """The tree as JSON data."""
        data: dict[str, Any] = {"kind": self.kind, "name": self.text, "iri": self.iri, "state": self.state.value}
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
    """What all of some states come to, or the best of them; nothing at all is available."""
    found = set(states)
    order = [Availability.MISSING, Availability.UNKNOWN, Availability.AVAILABLE]
    if any_of:
        order.reverse()
    return next((state for state in order if state in found), Availability.AVAILABLE)
