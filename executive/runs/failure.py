"""Failures for programs: class, message, place in the plan, advice, and causes."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import sim
from planlang.advice import Change
from planlang.diagnostics import line_in
from planlang.failures import PlanFailure
from planlang.language.recovery import advised_changes, why_unresolvable
from planlang.plan_failure import each_once, links_of
from planlang.records import dataclass


@dataclass(frozen=True, slots=True)
class Failure:
    """Failure that ended a plan or a search; ``str()`` is its first sentence, with the advice."""

    type: str
    """Class of the failure, such as ``GraspMissed``."""
    message: str
    where: str | None = None
    """Place in the plan: task path, file and line."""
    advice: str | None = None
    """What to change, in a sentence, if known."""
    causes: tuple[Failure, ...] = ()
    """Failures that caused it, the nearest first."""
    changes: tuple[Change, ...] = ()
    """What the advice changes in the map or in the call, as data, which ``apply`` of a run takes."""

    @staticmethod
    def of(problem: BaseException, where: str | None = None) -> Failure:
        """Describe an exception; causes of equal class and message are listed once."""
        links = links_of(problem)
        first, *causes = each_once(links)
        return Failure(
            type(first).__name__,
            str(first),
            where or _where(first),
            why_unresolvable(links) or None,
            tuple(Failure(type(link).__name__, str(link), _where(link)) for link in causes),
            advised_changes(links),
        )

    def reworded(self, reword: Callable[[str], str]) -> Failure:
        """Make the same failure with other words in its sentences, and in those of its causes."""
        advice = None if self.advice is None else reword(self.advice)
        causes = tuple(one.reworded(reword) for one in self.causes)
        return replace(self, message=reword(self.message), advice=advice, causes=causes)

    @property
    def types(self) -> tuple[str, ...]:
        """Class of the failure, then those of its causes."""
        return (self.type, *(one.type for one in self.causes))

    def __str__(self) -> str:
        message = self.message.strip().partition("\n")[0]
        # messages of location searches include the advice, before the counts of candidates
        advice = f"; {self.advice}" if self.advice is not None and self.advice not in message else ""
        return f"{self.type}: {message}{advice}"

    def as_json(self) -> dict[str, Any]:
        """Class, message, where and advice (or null), its changes, and causes, for JSON."""
        own = {"class": self.type, "message": self.message, "where": self.where, "advice": self.advice}
        changes = [one.as_json() for one in self.changes]
        return {**own, "changes": changes, "causes": [one.as_json() for one in self.causes]}


def _where(link: BaseException) -> str | None:
    return str(link.where) if isinstance(link, PlanFailure) and link.where is not None else None


def line_of_user(problem: Exception, plan: Path, modules: Sequence[Path]) -> str | None:
    """Line of the plan, or of a user's process module, that raised; None if planlang itself did."""
    own = Path(__file__).parents[1], Path(sim.__file__).parent  # the executive and the simulator
    files = [Path(frame.filename) for frame in traceback.extract_tb(problem.__traceback__)]
    for path, what in [(plan, "the plan"), *((file, "the process modules") for file in modules)]:
        line = line_in(problem, str(path))
        below = files[len(files) - files[::-1].index(path) :] if path in files else files
        if line is not None and not any(file.is_relative_to(folder) for file in below for folder in own):
            return f"in {what}, {path.name}:{line}"
    return None
