"""Which arm a plan uses where it leaves the choice: chosen once in each branch of the run, and kept there."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from planlang.kernel import Task
from planlang.language.parallel import concurrent_branches

ALONE = ""
"""The branch where no plan is running."""
MOST = 256
"""Choices that are remembered; branches that have ended are forgotten first."""


@dataclass(frozen=True, slots=True)
class _Choice:
    arm: str
    branch: Task | None
    """None if it was read from a snapshot, or no plan is running."""

    @property
    def over(self) -> bool:
        return self.branch is not None and self.branch.dead


@dataclass(slots=True)
class ArmChoices:
    """Branch -> the arm that was chosen in it last.

    Two branches that go on side by side may use two arms. A branch without a choice goes on with that of what has ended
    inside of it, else with that of the branch around it, and leaves arms alone that others have chosen.
    """

    made: dict[str, _Choice] = field(default_factory=dict)
    """In the order of the last choices; by path."""

    def choose(self, arm: str) -> None:
        """The branch that runs uses this arm from now on."""
        mine = next(iter(concurrent_branches()), None)
        path = ALONE if mine is None else mine.path
        self.made.pop(path, None)
        self.made[path] = _Choice(arm, mine)
        if len(self.made) > MOST:
            ended = (name for name, choice in self.made.items() if choice.over)
            del self.made[next(ended, next(iter(self.made)))]

    def mine(self) -> str | None:
        """The arm of the branch that runs, None while there is no choice."""
        around = [branch.path for branch in concurrent_branches()] or [ALONE]
        if around[0] in self.made:
            return self.made[around[0]].arm
        inner = [c.arm for path, c in self.made.items() if c.over and _inside(path, around[0])]
        if inner:
            return inner[-1]
        return next((self.made[path].arm for path in around[1:] if path in self.made), None)

    def others(self) -> frozenset[str]:
        """Arms that branches beside the one that runs have chosen and may be in the middle of using."""
        around = [branch.path for branch in concurrent_branches()] or [ALONE]
        beside = (
            choice.arm
            for path, choice in self.made.items()
            if not choice.over and path not in around and not _inside(path, around[0])
        )
        return frozenset(beside) - {self.mine()}

    def state(self) -> dict[str, str]:
        """What a run that is resumed needs to know."""
        return {path: choice.arm for path, choice in self.made.items() if not choice.over}

    @staticmethod
    def restored(state: Mapping[str, str], arms: Iterable[str]) -> ArmChoices:
        """From :meth:`state`; raises KeyError for an arm that is not one of ``arms``."""
        known = dict.fromkeys(arms)
        unknown = [arm for arm in state.values() if arm not in known]
        if unknown:
            raise KeyError(unknown[0])
        return ArmChoices({str(path): _Choice(str(arm), None) for path, arm in state.items()})


def _inside(path: str, outer: str) -> bool:
    return path.startswith(f"{outer}/") if outer else path != outer
