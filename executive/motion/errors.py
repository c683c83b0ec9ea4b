"""Errors of motion planning, which callers turn into plan failures, and the budgets of searches.

Budgets are in units that are the same on every machine: results never depend on the clock.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, ClassVar

from planlang.kernel import still_computing
from planlang.records import dataclass

if TYPE_CHECKING:
    from planlang.motion_constraints import MotionConstraint


class MotionError(Exception):
    """Base class of the errors of motion planning."""


class OutOfEffort(MotionError):
    """A search has used up its budget."""

    def __init__(self, most: int, unit: str) -> None:
        super().__init__(f"the search was given up after {most} {unit}")


class InCollision(MotionError):
    """An end of a path is in collision; ``pairs`` names the colliding bodies, if known."""

    end: ClassVar[str]

    def __init__(self, place: Sequence[float], pairs: Sequence[tuple[str, str]] = ()) -> None:
        self.place, self.pairs = tuple(map(float, place)), tuple(pairs)
        super().__init__(f"the {self.end} is in collision: {_numbers(self.place)}{_named(self.pairs)}")


class StartInCollision(InCollision):
    """The start of a path is in collision."""

    end = "start"


class GoalInCollision(InCollision):
    """The goal of a path is in collision."""

    end = "goal"


class OutsideLimits(MotionError):
    """A configuration exceeds joint limits (or a place is off the map)."""

    def __init__(self, what: str, values: Sequence[float], lower: Sequence[float], upper: Sequence[float]) -> None:
        self.values = tuple(float(value) for value in values)
        super().__init__(
            f"{what} is outside its limits: {_numbers(self.values)} not in {_numbers(lower)} .. {_numbers(upper)}"
        )


class NoPath(MotionError):
    """The search ended without a path; ``counts`` holds its statistics."""

    def __init__(self, start: Sequence[float], goal: Sequence[float], counts: Mapping[str, int]) -> None:
        self.start = tuple(float(value) for value in start)
        self.goal = tuple(float(value) for value in goal)
        self.counts = dict(counts)
        statistics = ", ".join(f"{name} {number}" for name, number in self.counts.items())
        super().__init__(f"no path from {_numbers(self.start)} to {_numbers(self.goal)} ({statistics})")


class ConstraintsContradict(MotionError):
    """Constraints of a phase that cannot all hold; ``pairs`` names bodies that would collide where they do.

    ``constraints`` is a minimal conflicting set: without any one of them the rest can hold. A single one is out of
    reach.
    """

    def __init__(
        self, phase: int, constraints: Sequence[MotionConstraint], pairs: Sequence[tuple[str, str]] = ()
    ) -> None:
        self.phase, self.constraints, self.pairs = phase, tuple(constraints), tuple(pairs)
        names = _listed(self.constraints)
        if self.pairs:
            problem = f"bodies block these constraints: {names}{_named(self.pairs)}"
        elif len(self.constraints) == 1:
            problem = f"out of the arm's reach, or impossible: {names}"
        else:
            problem = f"these constraints contradict each other within the arm's reach: {names}"
        super().__init__(f"phase {phase + 1}: {problem}")


class NoConstrainedPath(MotionError):
    """No path was found to the known end of a phase that keeps ``constraints`` and avoids collisions (``pairs``)."""

    def __init__(
        self, phase: int, constraints: Sequence[MotionConstraint], pairs: Sequence[tuple[str, str]] = ()
    ) -> None:
        self.phase, self.constraints, self.pairs = phase, tuple(constraints), tuple(pairs)
        kept = f" that keeps {_listed(self.constraints)}" if self.constraints else ""
        super().__init__(f"phase {phase + 1}: no path to its end was found{kept}{_named(self.pairs)}")


def _listed(constraints: Sequence[MotionConstraint]) -> str:
    """List constraints, equal texts once with their number: a stroke has one for each of its places."""
    counts = Counter(map(str, constraints))
    return "; ".join(text if number == 1 else f"{text} ({number} times)" for text, number in counts.items())


def _named(pairs: Sequence[tuple[str, str]]) -> str:
    return "".join(f"; {part} in {body}" for part, body in pairs[:3])


def _numbers(values: Sequence[float]) -> str:
    return "(" + ", ".join(f"{float(value):.3f}" for value in values) + ")"


@dataclass(slots=True)
class Effort:
    """Budget of a search, counted in units of computing; interrupting the run ends the search as well."""

    most: int
    unit: str
    """Name of the unit."""
    spent: int = 0

    def spend(self, units: int) -> None:
        """Add to the count; raises :class:`OutOfEffort` beyond the budget, and Evaporated after an interrupt."""
        still_computing()
        self.spent += units
        if self.spent > self.most:
            raise OutOfEffort(self.most, self.unit)
