"""Ends of a run or a task that are no plan failures: evaporation, and errors that name tasks and lines."""

from __future__ import annotations

from planlang.misuse import PlanStructureError as PlanStructureError


class Evaporated(BaseException):
    """Thrown into a task that is being evaporated, at every unshielded checkpoint until the task ends."""


class Overdue(BaseException):
    """Raised by the watchdog in code that reaches no checkpoint."""


class CleanupOverrun(Exception):
    """A shielded cleanup took longer than its bound."""


class RunError(Exception):
    """The run cannot go on. All tasks have been evaporated when it is raised."""


class DeadlockError(RunError):
    """No task can run and nothing can wake one; the message lists what each task waits for."""


class StepLimit(RunError):
    """The run took more world steps than it was given."""


class NoProgress(RunError):
    """Tasks kept running within one world step without end."""


class StuckTask(RunError):
    """A task swallowed its evaporation over and over."""


class CutShort(UserWarning):
    """An unshielded await in a ``finally`` was cut short by evaporation."""
