"""What this package raises for its callers to turn into plan failures."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path


class MotionError(Exception):
    """Root of everything that motion planning raises on purpose."""


class BadRobotDescription(MotionError):
    """A URDF file cannot be used: what is wrong with it, and where."""

    def __init__(self, path: Path, problem: str) -> None:
        self.path = path
        self.problem = problem
        super().__init__(f"{path}: {problem}")


class NoSuchChain(MotionError):
    """Two links do not hang together as base and tip of one chain."""

    def __init__(self, base_link: str, tip_link: str, problem: str, links: Iterable[str]) -> None:
        self.base_link = base_link
        self.tip_link = tip_link
        self.links = tuple(links)
        shown = ", ".join(self.links[:12]) + (", ..." if len(self.links) > 12 else "")
        super().__init__(f"no chain from {base_link!r} to {tip_link!r}: {problem} (links: {shown})")


class StartInCollision(MotionError):
    """Where a path should start is not free; ``pairs`` are names of what would be in each other, if known."""

    def __init__(self, start: Sequence[float], pairs: Sequence[tuple[str, str]] = ()) -> None:
        self.start = tuple(float(value) for value in start)
        self.pairs = tuple(pairs)
        super().__init__(f"the start is in collision: {_numbers(self.start)}{_told(self.pairs)}")


class GoalInCollision(MotionError):
    """Where a path should end is not free; ``pairs`` are names of what would be in each other, if known."""

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
    """The search ended without a path; ``counts`` says what it did."""

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
