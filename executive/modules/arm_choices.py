"""Choices of arms where a plan leaves them open: one in each concurrent branch of the run, kept there."""

from __future__ import annotations

from dataclasses import field

from planlang.kernel import Task
from planlang.language.branches import concurrent_branches
from planlang.records import dataclass

ALONE = ""
"""Path of the branch while no plan is running."""
MOST = 256
"""Choices to remember; those of finished branches are forgotten first."""


@dataclass(frozen=True, slots=True)
class _Choice:
    arm: str
    branch: Task | None
    """None if restored from a snapshot, or if no plan is running."""

    @property
    def over(self) -> bool:
        return self.branch is not None and self.branch.dead


@dataclass(slots=True)
class ArmChoices:
    """Last chosen arm of each concurrent branch of the plan.

    Concurrent branches may use different arms. A branch without a choice inherits that of its last finished child, else
    that of its parent, and avoids arms that other running branches have chosen.
    """

    made: dict[str, _Choice] = field(default_factory=dict)
    """Path of a branch -> its choice, least recent first."""

    def choose(self, arm: str) -> None:
        """Record that the running branch uses this arm from now on."""
        running = next(iter(concurrent_branches()), None)
        path = ALONE if running is None else running.path
        self.made.pop(path, None)
        self.made[path] = _Choice(arm, running)
        if len(self.made) > MOST:
            ended = (name for name, choice in self.made.items() if choice.over)
            del self.made[next(ended, next(iter(self.made)))]

    def mine(self) -> str | None:
        """Look up the arm of the running branch; None if there is no choice yet."""
        own, *ancestors = [branch.path for branch in concurrent_branches()] or [ALONE]
        if own in self.made:
            return self.made[own].arm
        inner = [c.arm for path, c in self.made.items() if c.over and _inside(path, own)]
        if inner:
            return inner[-1]
        return next((self.made[path].arm for path in ancestors if path in self.made), None)

    def others(self) -> frozenset[str]:
        """Collect the arms that other unfinished branches have chosen and may still be using."""
        lineage = [branch.path for branch in concurrent_branches()] or [ALONE]
        taken = (
            choice.arm
            for path, choice in self.made.items()
            if not choice.over and path not in lineage and not _inside(path, lineage[0])
        )
        return frozenset(taken) - {self.mine()}


def _inside(path: str, outer: str) -> bool:
    return path.startswith(f"{outer}/") if outer else path != outer
