"""Errors of this package, for its callers to turn into plan failures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from planlang.motion_constraints import MotionConstraint


class MotionError(Exception):
    """Root of everything that motion planning raises on purpose."""


class OutOfEffort(MotionError):
    """A search has computed as much as it may."""

    def __init__(self, most: int, unit: str) -> None:
        super().__init__(f"the search was given up after {most} {unit}")


class StartInCollision(MotionError):
    """The start of a path is not free; ``pairs`` are names of what would be in each other, if known."""

    def __init__(self, start: Sequence[float], pairs: Sequence[tuple[str, str]] = ()) -> None:
        self.start = tuple(float(value) for value in start)
        self.pairs = tuple(pairs)
        super().__init__(f"the start is in collision: {_numbers(self.start)}{_told(self.pairs)}")


class GoalInCollision(MotionError):
    """The goal of a path is not free; ``pairs`` are names of what would be in each other, if known."""

    def __init__(self, goal: Sequence[float], pairs: Sequence[tuple[str, str]] = ()) -> None:
        self.goal = tuple(float(value) for value in goal)
        self.pairs = tuple(pairs)
        super().__init__(f"the goal is in collision: {_numbers(self.goal)}{_told(self.pairs)}")


class OutsideLimits(MotionError):
    """A configuration leaves the limits of its joints (or a place leaves the map)."""

    def __init__(self, what: str, values: Sequence[float], lower: Sequence[float], upper: Sequence[float]) -> None:
        self.values = tuple(float(value) for value in values)
        super().__init__(
            f"{what} is outside its limits: {_numbers(self.values)} not in {_numbers(lower)} .. {_numbers(upper)}"
        )


class NoPath(MotionError):
    """The search ended without a path; ``counts`` are its statistics."""

    def __init__(self, start: Sequence[float], goal: Sequence[float], counts: Mapping[str, int]) -> None:
        self.start = tuple(float(value) for value in start)
        self.goal = tuple(float(value) for value in goal)
        self.counts = dict(counts)
        done = ", ".join(f"{name} {number}" for name, number in self.counts.items())
        super().__init__(f"no path from {_numbers(self.start)} to {_numbers(self.goal)} ({done})")


class ConstraintsContradict(MotionError):
    """Constraints of a phase that cannot all hold; ``pairs`` are bodies that would be in each other where they do.

    ``constraints`` is a smallest such set: each is needed for it. One alone contradicts the reach of the arm.
    """

    def __init__(
        self, phase: int, constraints: Sequence[MotionConstraint], pairs: Sequence[tuple[str, str]] = ()
    ) -> None:
        self.phase, self.constraints, self.pairs = phase, tuple(constraints), tuple(pairs)
        names = "; ".join(map(str, self.constraints))
        if self.pairs:
            problem = f"what these ask for is blocked: {names}{_told(self.pairs)}"
        elif len(self.constraints) == 1:
            problem = f"this is beyond the arm's reach, or is never so: {names}"
        else:
            problem = f"these contradict each other within the arm's reach: {names}"
        super().__init__(f"phase {phase + 1}: {problem}")


class NoConstrainedPath(MotionError):
    """The end of a phase is known, but no way to it that keeps ``constraints`` and touches nothing of ``pairs``."""

    def __init__(
        self, phase: int, constraints: Sequence[MotionConstraint], pairs: Sequence[tuple[str, str]] = ()
    ) -> None:
        self.phase, self.constraints, self.pairs = phase, tuple(constraints), tuple(pairs)
        kept = f" that keeps {'; '.join(map(str, self.constraints))}" if self.constraints else ""
        super().__init__(f"phase {phase + 1}: no way was found to where it ends{kept}{_told(self.pairs)}")


def _told(pairs: Sequence[tuple[str, str]]) -> str:
    return "".join(f"; {part} in {body}" for part, body in pairs[:3])


def _numbers(values: Sequence[float]) -> str:
    return "(" + ", ".join(f"{float(value):.3f}" for value in values) + ")"
