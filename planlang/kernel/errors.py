"""Exceptions that end a run or a task without being plan failures."""

from __future__ import annotations

from planlang.misuse import PlanStructureError as PlanStructureError


class Evaporated(BaseException):
    """Raised in an evaporating task at every unshielded checkpoint until the task ends."""


class Overdue(BaseException):
    """Raised by the watchdog in code that does not reach a checkpoint."""


class CleanupOverrun(Exception):
    """A shielded block took longer than its time limit."""


class RunError(Exception):
    """The run cannot go on. All tasks have been evaporated when it is raised."""


class DeadlockError(RunError):
    """No task can run and nothing can wake one; the message lists what each task waits for."""


class StepLimit(RunError):
    """The run exceeded its limit of world steps."""


class NoProgress(RunError):
    """The plan loops within one world step, or does not reach a checkpoint."""


class StuckTask(RunError):
    """A task swallowed Evaporated again and again."""


class CutShort(UserWarning):
    """An unshielded await in a ``finally`` was cut short by evaporation."""
