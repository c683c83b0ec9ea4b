"""The simulated world of a run, and the interface of the robot in it; both go wrong if faults are stated."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from planlang.diagnostics import Diagnostic
from planlang.protocols import RobotInterface
from sim import PyBulletWorld

if TYPE_CHECKING:
    from executive.belief import Belief
    from executive.runs.fault_report import FaultReport
    from planlang.kernel.tree import Node


class SimulatedWorld:
    """The simulated world of a run in which nothing goes wrong."""

    def __init__(self, truth: PyBulletWorld, interface: RobotInterface | None = None) -> None:
        """The robot commands and senses the world by the ``interface``, the world itself by default."""
        self.truth = truth
        self.interface: RobotInterface = truth if interface is None else interface

    def __enter__(self) -> SimulatedWorld:
        return self

    def __exit__(self, *failure: object) -> None:
        self.truth.close()

    def told_by(self, belief: Belief) -> None:
        """Record by a belief what goes wrong."""

    def begins(self, node: Node) -> None:
        """Let a step fail that is stated to, as it begins; raises its failure."""

    def report(self) -> FaultReport | None:
        """Say what has gone wrong so far; None if no faults are stated."""
        return None

    def ended(self, outcome: str, failures: Sequence[str]) -> list[Diagnostic]:
        """Say what was stated and did not come true; ``failures`` are the classes of the failure and its causes."""
        return []
