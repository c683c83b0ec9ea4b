"""A scope: a construct at work. It starts branches, decides between rounds, and ends after all of them are dead."""

from __future__ import annotations

from collections.abc import Callable
from heapq import heappush
from operator import attrgetter
from typing import Any

from planlang.failures import BranchEvaporated, PlanFailure, attach_cleanup
from planlang.kernel.errors import Evaporated, PlanStructureError
from planlang.kernel.listing import locate, place_of
from planlang.kernel.park import checkpoint, deliver, here, park
from planlang.kernel.task import SUCCEEDED, Status, Task
from planlang.kernel.tree import Node

MAX_DEPTH = 10_000
_index = attrgetter("index")


class Scope(Node):
    """A construct with branches. Subclasses say in :meth:`decide` when it is over.

    Invariants: ``live`` holds the branches that are not dead; ``fresh`` those that died since the last decision;
    ``over`` means that the outcome is fixed and what is live is being evaporated.
    """

    transparent = False
    """Whether the branches appear in the tree in the construct's place."""

    def __init__(self, kind: str, name: str | None = None) -> None:
        self.scheduler, self.owner = here()
        if self.transparent:
            self.parent, self.kind, self.base_name, self.ordinal = self.owner.node, kind, kind, 1
            self._counts = self._path = None
            self.number = 0
            self.told = ""
        else:
            Node.__init__(self, self.owner.node, kind, name or kind)
        self.above: Node = self.owner.node if self.transparent else self
        """Under which node the branches appear in the tree."""
        self.depth = self.owner.depth + 1
        if self.depth > MAX_DEPTH:
            raise PlanStructureError(
                f"more than {MAX_DEPTH} constructs nested, as in recursion without end: {_innermost(self.owner)}"
            )
        self.birth = self.scheduler.next_birth()
        self.live: dict[Task, None] = {}
        self.fresh: list[Task] = []
        self.dirty = False
        self.over = False
        self.complete = False
        self.crash: BaseException | None = None
        self.cleanup: list[PlanFailure] = []

    # -- for subclasses

    def begin(self) -> None:
        """Start the first branches."""
        raise NotImplementedError

    def details(self) -> dict[str, object]:
        """What the trace tells about the start."""
        return {}

    def decide(self, dead: list[Task]) -> None:
        """Look at the branches that died in the last round, in textual order; :meth:`close` when the outcome is fixed.

        May start branches. When none is live afterwards, the scope is over.
        """
        raise NotImplementedError

    def finish(self) -> Any:
        """Return or raise the outcome, when all branches are dead."""
        raise NotImplementedError

    def start(self, branch: Callable[[], Any], name: str, index: int) -> Task:
        """Start a branch; it runs after what is already in the queue."""
        task = Task(self, self.above, name, branch, index)
        if self.above is not self:
            task.kind = self.kind
        self.live[task] = None
        if self.scheduler.journal is not None:
            self.scheduler.journal.start(task)
        owner = self.owner
        if owner.holds:
            task.holds = owner.holds
        self.scheduler.enqueue(task)
        return task

    def close(self) -> None:
        """Fix the outcome and evaporate what is live."""
        if not self.over:
            self.over = True
            for task in tuple(self.live):
                self.scheduler.evaporate(task)

    async def execute(self) -> Any:
        """Run the construct to its end.

        Raises a programming error that left a branch, before anything else; Evaporated if the owner is evaporated.
        """
        scheduler, owner = self.scheduler, self.owner
        journal = None if self.transparent else scheduler.journal
        if journal is not None and journal.resuming and (before := journal.scope_taken_over(self)) is not None:
            return await before
        trace = None if self.transparent else scheduler.trace
        if owner.doomed:
            await deliver(owner)
        if trace is not None:
            trace.started(scheduler.now, self, **self.details())
        outer, outer_node = owner.scope, owner.node
        owner.scope, owner.node = self, self
        if journal is not None:
            journal.enter(self)
        try:
            if scheduler.on_start is not None and not self.transparent:
                scheduler.on_start(self)
            try:
                self.begin()
            except Exception as error:
                self.crash = error
                self.close()
            if self.live or self.fresh:
                await park(self)
            else:
                self.complete = True
                await checkpoint()
            if self.crash is not None:
                if self.cleanup:
                    attach_cleanup(self.crash, self.cleanup)
                raise self.crash
            owner.scope = outer
            result = self.finish()
        except BaseException as error:
            owner.scope, owner.node = outer, outer_node
            if isinstance(error, PlanFailure) and error.where is None:
                locate(error, self, scheduler.revision)
            if journal is not None:
                journal.leave(self, None, error)
            if trace is not None and not isinstance(error, GeneratorExit):
                if isinstance(error, Evaporated):
                    trace.ended(scheduler.now, self, Status.EVAPORATED)
                else:
                    trace.ended(scheduler.now, self, Status.FAILED, None, error)
            raise
        owner.node = outer_node
        if journal is not None:
            journal.leave(self, result, None)
        if trace is not None:
            trace.ended(scheduler.now, self, Status.SUCCEEDED, result)
        return result

    def attach(self, failure: PlanFailure) -> PlanFailure:
        """Attach what went wrong in cleanups to what the construct raises."""
        if self.cleanup:
            attach_cleanup(failure, self.cleanup)
        return failure

    # -- for the scheduler

    def stir(self) -> None:
        """Have it decide after this round."""
        if not self.dirty:
            self.dirty = True
            heappush(self.scheduler.dirty, (-self.depth, self.birth, self))

    def settle(self) -> None:
        """The decision after a round in which branches died."""
        dead, self.fresh = self.fresh, []
        if len(dead) > 1:
            dead.sort(key=_index)
        for task in dead:
            if task.crash is not None:
                if self.crash is None:
                    self.crash = task.crash
                elif self.crash is not task.crash:
                    self.crash.add_note(f"at the same time, in {task.path}: {task.crash!r}")
            elif task.cleanup_failure is not None:
                self.cleanup.append(task.cleanup_failure)
        if self.crash is not None:
            self.close()
        elif not self.over:
            try:
                self.decide(dead)
            except Exception as error:
                self.crash = error
                self.close()
        if not self.live:
            self.over = True
            if not self.fresh:
                self.complete = True
                self.scheduler.release(self.owner, evaporate=self.crash is None)

    def __str__(self) -> str:
        return f"{self.kind} of {len(self.live)} live branches"


class All(Scope):
    """Over at the first failure; the failure is the earliest round's, then the textually first."""

    failed: Task | None = None
    siblings: tuple[tuple[str, PlanFailure], ...] = ()

    def decide(self, dead: list[Task]) -> None:
        failures = [task for task in dead if task.outcome is not SUCCEEDED]
        if failures:
            self.fail(failures)

    def fail(self, failures: list[Task]) -> None:
        """Fix the first of these as the outcome, the others as its siblings."""
        self.failed = failures[0]
        self.siblings = tuple((task.name, failure_of(task)) for task in failures[1:])
        self.close()

    def raise_failure(self) -> None:
        """Raise the failure that was fixed, if any, with its attachments."""
        if self.failed is not None:
            failure = failure_of(self.failed)
            failure.siblings += tuple((name, other) for name, other in self.siblings if other is not failure)
            raise self.attach(failure)


def failure_of(task: Task) -> PlanFailure:
    """The failure of a branch that did not succeed: its own, or that it was evaporated from outside."""
    if task.failure is None:
        task.failure = BranchEvaporated(path=task.path)
    return task.failure


def _innermost(task: Task) -> str:
    """Names and lines of the innermost tasks, each once."""
    found: dict[str, None] = {}
    current: Task | None = task
    for _ in range(20):
        assert current is not None  # there are MAX_DEPTH of them
        found[f"{current.base_name}{place_of(current)}"] = None
        current = None if current.group is None else current.group.owner
    return ", in ".join(found)
