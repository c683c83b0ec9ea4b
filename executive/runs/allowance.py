"""What a run may use before it gives up: plan time, further attempts, and searches for places; counted, never timed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from executive.locations.search_count import SEARCHES
from planlang.diagnostics import Diagnostic, note
from planlang.failures import BudgetExceeded, PlanFailure
from planlang.words import Option, Text

if TYPE_CHECKING:
    from executive.options.running import SituationSettings
    from executive.runs.parameters import Bound
    from planlang.language.source import PlanSource
    from planlang.runs import RecordedRun

SECONDS, SECONDS_PER_STEP = 600.0, 60.0
"""Plan time, beside waiting, after which a run gives up: a constant, and more for each step of the plan [s]."""
ATTEMPTS, ATTEMPTS_PER_STEP = 100, 2
"""Further attempts after which a run gives up: a constant, and more for each step of the plan.

Each retry of a recovery, and each further base pose of a location, is one.
"""
MOST_SEARCHES, SEARCHES_PER_STEP = 200, 10
"""Searches for places after which a run gives up: a constant, and more for each step of the plan."""


class Allowance(NamedTuple):
    """What a run may use before it gives up."""

    seconds: float
    """Plan time [s]."""
    attempts: int
    """Retries of recoveries and further base poses."""
    searches: int
    """Searches for places."""

    @staticmethod
    def of(source: PlanSource, bound: Mapping[str, Bound], before: int, settings: SituationSettings) -> Allowance:
        """Compute it from the steps of a plan and the number of actions that come ``before`` it or them.

        Stated waiting times extend it, and settings multiply it: how often each recovery may try, and their patience.
        """
        waiting = source.waiting + sum(value for value in bound.values() if isinstance(value, float))
        steps, patience = len(source.actions) + before, settings.patience or 1.0
        times = patience * (1 + (settings.attempts or 0))
        return Allowance(
            patience * (SECONDS + SECONDS_PER_STEP * steps) + waiting,
            round(times * (ATTEMPTS + ATTEMPTS_PER_STEP * steps)),
            round(times * (MOST_SEARCHES + SEARCHES_PER_STEP * steps)),
        )

    def most_steps(self, rate: int, repeated: RecordedRun | None) -> int:
        """Maximum number of world steps, at a rate [Hz]; a repeated run ends with its trace."""
        return int(2 * self.seconds * rate) if repeated is None else repeated.last + 1

    def told(self, failure: PlanFailure | None, settings: SituationSettings) -> Sequence[Diagnostic]:
        """Say how a run with these settings is given more, if it has failed because this is used up."""
        if failure is None or not any(isinstance(one, BudgetExceeded) and self._ends(one) for one in failure.chain()):
            return ()
        counts = f"{self.seconds:g} s of plan time, {self.attempts} further attempts or {self.searches} searches"
        twice = 2 * (settings.patience or 1.0)
        patience = Option("patience", int(twice) if twice == int(twice) else twice)
        advice = Text(patience, " lets it take twice as much of each")
        return (note("X043", f"the run gives up after {counts}", help=advice),)

    def _ends(self, failure: BudgetExceeded) -> bool:
        """Check whether a failure is of this, and not of a budget in the plan."""
        is_mine = (failure.seconds, failure.attempts) == (self.seconds, self.attempts)
        return is_mine or failure.used.get(SEARCHES) == self.searches
