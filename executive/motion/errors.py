"""Errors of this package, for its callers to turn into plan failures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence


class MotionError(Exception):
    """Root of everything that motion planning raises on purpose."""


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


def _told(pairs: Sequence[tuple[str, str]]) -> str:
    return "".join(f"; {part} in {body}" for part, body in pairs[:3])


def _numbers(values: Sequence[float]) -> str:
    return "(" + ", ".join(f"{float(value):.3f}" for value in values) + ")"
