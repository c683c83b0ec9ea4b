"""Strands of a run: what is done one after another, while other strands go on beside it.

A strand begins with a run, and with every branch of par, par_each, pursue, race and try_all. The steps of a
partial_order belong together, since what one has begun another may go on with.
"""

from __future__ import annotations

from dataclasses import dataclass

from planlang.kernel.park import running
from planlang.kernel.task import Task
from planlang.language.parallel import SIDE_BY_SIDE


@dataclass(frozen=True, slots=True)
class Strand:
    """One strand, by the task that it begins with."""

    task: Task

    @property
    def path(self) -> str:
        """Unlike that of any other strand of the run."""
        return self.task.path

    @property
    def over(self) -> bool:
        """Whether it has ended."""
        return self.task.dead


def strands() -> tuple[Strand, ...]:
    """The strand of the running task, then those around it, outwards; none where no plan is running."""
    scheduler = running.scheduler
    task = None if scheduler is None else scheduler.current
    found: list[Strand] = []
    while task is not None:
        group = task.group
        if group is None or isinstance(group, SIDE_BY_SIDE):
            found.append(Strand(task))
        task = None if group is None else group.owner
    return tuple(found)
