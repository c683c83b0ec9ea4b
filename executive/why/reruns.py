"""Reruns of a failed run with changes, in workers of a sweep."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from executive.sweeps.records import Row, Workers, World, is_reached
from executive.why.candidates import Candidate
from executive.why.evidence import Evidence
from planlang.advice import ROBOT, Change
from planlang.records import dataclass

ALSO = "executive.why.evidence:Evidence.in_row"
"""What the row of a rerun has besides."""
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


class Reruns:
    """Reruns candidates in workers, in the order of the list, and stops after the first that helps."""

    def __init__(
        self,
        options: Mapping[str, Any],
        workers: Workers,
        *,
        base: Sequence[Change] = (),
        budget: int,
        told: Told = lambda candidate, row, number: None,
    ) -> None:
        """``options`` are those of the run, as JSON, ``base`` the changes that it was made with.

        ``told`` gets each that counts, in their order, and its number.
        """
        self._options, self._workers, self._base, self._budget, self._told = options, workers, base, budget, told
        self.tried: list[Tried] = []

    @property
    def left(self) -> int:
        """Number of reruns that are left."""
        return self._budget - len(self.tried)

    def of(self, candidates: Sequence[Candidate]) -> Candidate | None:
        """Rerun candidates until one helps or the budget is used up; return the one that helps.

        Which one does not depend on the number of processes: it is the first in the order of the list.
        """
        chosen = candidates[: self.left]
        if not chosen:
            return None
        worlds: list[World] = [
            {
                "world": number,
                "options": self.options_of(candidate),
                "changes": [one.as_json() for one in (*self._base, *candidate.changes)],
                "also": ALSO,
            }
            for number, candidate in enumerate(chosen)
        ]
        rows, next_number = dict[int, Row](), 0
        with self._workers.done(worlds) as results:
            for done in results:
                rows[done.row["world"]] = done.row
                while next_number in rows:  # in order, whichever ends first
                    candidate, row = chosen[next_number], rows[next_number]
                    self.tried.append(Tried(candidate, row))
                    self._told(candidate, row, len(self.tried))
                    if is_reached(row):
                        return candidate
                    next_number += 1
        return None

    def options_of(self, candidate: Candidate) -> dict[str, Any]:
        """Options of a rerun, as JSON; another robot starts where it has room."""
        is_other = any(change.what == ROBOT for change in candidate.changes)
        return {name: value for name, value in self._options.items() if not (is_other and name in ("start", "urdf"))}
