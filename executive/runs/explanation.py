"""What was found out about a failed run: the smallest change after which a rerun reaches the goal."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import field
from pathlib import Path
from typing import Any

from planlang.advice import Change
from planlang.diagnostics import Diagnostic
from planlang.records import dataclass
from planlang.words import Text, joined

KINDS = {
    "advice": ("change that was advised", "changes that were advised"),
    "arm": ("arm", "arms"),
    "grasp": ("class of grasps", "classes of grasps"),
    "order": ("order of steps", "orders of steps"),
    "attempts": ("further attempt", "further attempts"),
    "before": ("door opened or closed first", "doors opened or closed first"),
    "put down": ("thing put down first", "things put down first"),
    "thing moved": ("place of a thing", "places of things"),
    "furniture moved": ("place of furniture", "places of furniture"),
    "door": ("door open or shut", "doors open or shut"),
    "away": ("thing taken away", "things taken away"),
    "robot": ("other robot", "other robots"),
    "pair": ("pair of changes", "pairs of changes"),
}
"""Kind of a candidate -> what one, and several, are called."""


def counts_in_words(counts: Mapping[str, int]) -> str:
    """Say how many candidates of each kind there are: ``2 arms, 12 places of things``."""
    return ", ".join(f"{number} {KINDS[kind][number != 1]}" for kind, number in counts.items())


@dataclass(frozen=True, slots=True)
class Explanation:
    """What was found out about a failed run; ``str()`` is for people."""

    failure: str
    """The failure in one line; "" for a run that reached its goal."""
    sentence: str
    """What has to change, or that nothing was found."""
    changes: tuple[Change, ...] = ()
    """The changes, those included that the failed run was made with; empty if none was found."""
    cost: float = 0.0
    """How small the change is: a choice of the run is 1 (docs/guides/why.md)."""
    command: Text | None = None
    """The call that repeats the run with the changes."""
    applied: Path | None = None
    """The file of the changes, if it was written."""
    tried: Mapping[str, int] = field(default_factory=dict)
    """Number of reruns by kind of change."""
    left: Mapping[str, int] = field(default_factory=dict)
    """Number of changes for which the budget did not suffice, by kind."""
    diagnostics: tuple[Diagnostic, ...] = ()

    @property
    def found(self) -> bool:
        """True if a change was found, or none is needed."""
        return bool(self.changes) or not self.failure

    @property
    def reruns(self) -> int:
        """Number of reruns up to the first that reached the goal."""
        return sum(self.tried.values())

    def as_json(self) -> dict[str, Any]:
        """The explanation as JSON, which ``planlang run --apply`` takes."""
        return {
            "failure": self.failure,
            "found": self.found,
            "sentence": self.sentence,
            "changes": [one.as_json() for one in self.changes],
            "cost": round(self.cost, 3),
            "command": self.command,
            "applied": None if self.applied is None else str(self.applied),
            "reruns": self.reruns,
            "tried": dict(self.tried),
            "not_tried": dict(self.left),
        }

    def __str__(self) -> str:
        return joined("\n", self._lines())

    def _lines(self) -> Iterator[str]:
        if self.failure:
            yield self.failure
        yield self.sentence
        if self.command is not None:
            yield Text("  ", self.command)
        if self.tried:
            yield f"{self.reruns} rerun{'s' if self.reruns != 1 else ''}: {counts_in_words(self.tried)}"
        if self.left:
            yield f"not tried: {counts_in_words(self.left)}; a larger budget tries more"
