"""A scope: a running construct. It starts branches, decides between rounds, and ends when all branches are dead."""

from __future__ import annotations

from collections.abc import Callable
from operator import attrgetter
from typing import Any

from planlang.failures import BranchEvaporated
from planlang.kernel.cancel import checkpoint, deliver, evaporate, pending_error
from planlang.kernel.core import BaseScope, Task, here, park
from planlang.kernel.errors import Evaporated, PlanStructureError
from planlang.kernel.primitives import in_node
from planlang.kernel.tracebacks import place_of
from planlang.kernel.tree import SUCCEEDED, Node, name_of
from planlang.plan_failure import PlanFailure, attach_cleanup

MAX_DEPTH = 10_000
"""Limit of nested constructs: far above that of written plans, low enough that endless recursion does not fill the
memory."""
_index = attrgetter("index")


class Scope(BaseScope):
    """A construct with branches. Subclasses decide in :meth:`decide` when it is over."""

    transparent = False
    """True if the construct has no node of its own, so that its branches appear directly under its parent."""

    def __init__(self, kind: str, name: str | None = None) -> None:
        self.scheduler, self.owner = here()
        if self.transparent:  # a node that is never recorded and has no name under its parent
            self.parent, self.kind, self.base_name, self.ordinal = self.owner.node, kind, kind, 1
            self._counts = self._before = self._path = None
            self.number = 0
            self.written = ""
        else:
            Node.__init__(self, self.owner.node, kind, name or kind)
        self.above: Node = self.owner.node if self.transparent else self
        """The node under which the branches appear in the tree."""
        self.depth = self.owner.depth + 1
        if self.depth > MAX_DEPTH:
            raise PlanStructureError(
                f"more than {MAX_DEPTH} nested constructs, as in an endless recursion: {_innermost(self.owner)}"
            )
        self.scheduler.births += 1
        self.birth = self.scheduler.births
        self.live = {}
        self.fresh = []
        self.dirty = self.over = self.complete = False
        self.crash = None
        self.cleanup: list[PlanFailure] = []
        """Plan failures of branches that were being evaporated, to be attached to what the construct raises."""

    # -- for subclasses

    def begin(self) -> None:
        """Start the first branches."""
        raise NotImplementedError

    def details(self) -> dict[str, object]:
        """Details to record with the start of the construct."""
        return {}

    def decide(self, dead: list[Task]) -> None:
        """React to the branches that died in the last round, in textual order; :meth:`close` to fix the outcome.

        May start branches. If no branch is live afterwards, the scope is over.
        """
        raise NotImplementedError

    def finish(self) -> Any:
        """Return or raise the outcome, after all branches are dead."""
        raise NotImplementedError

    def start(self, branch: Callable[[], Any], name: str, index: int) -> Task:
        """Start a branch; it is queued behind the tasks that can run already."""
        task = Task(self, self.above, name, branch, index)
        if self.above is not self:
            task.kind = self.kind
        self.live[task] = None
        if self.scheduler.recorded is not None:
            task.branch = self.scheduler.recorded.body(task, branch)
        owner = self.owner
        if owner.holds:
            task.holds = owner.holds
        self.scheduler.enqueue(task)
        return task

    def close(self) -> None:
        """Fix the outcome and evaporate the live branches."""
        if not self.over:
            self.over = True
            for task in tuple(self.live):
                evaporate(self.scheduler, task)

    async def execute(self) -> Any:
        """Run the construct to its end.

        Raises a programming error of a branch, which takes precedence, or Evaporated if the owner was evaporated.
        """
        if self.owner.doomed:
            await deliver(self.owner)
        if self.transparent:
            return await self._run()
        return await in_node(self, self._run, **self.details())

    async def _run(self) -> Any:
        owner = self.owner
        outer, owner.scope = owner.scope, self
        try:
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
        except BaseException as error:
            if not isinstance(error, Evaporated):
                attach_cleanup(error, self.cleanup)
            elif self.cleanup:  # Evaporated has no attachments: the construct that evaporated the owner raises them
                owner.cleanup_failures = [*(owner.cleanup_failures or ()), *self.cleanup]
            raise
        finally:
            owner.scope = outer
        if self.crash is not None:
            if self.cleanup:
                attach_cleanup(self.crash, self.cleanup)
            raise self.crash
        return self.finish()

    def attach(self, failure: PlanFailure) -> PlanFailure:
        """Attach the failures of cleanups to the failure that the construct raises."""
        if self.cleanup:
            attach_cleanup(failure, self.cleanup)
        return failure

    # -- for the event loop

    def settle(self) -> None:
        """Decide after a round in which branches died."""
        dead, self.fresh = self.fresh, []
        if len(dead) > 1:
            dead.sort(key=_index)
        for task in dead:
            if task.crash is not None or task.cleanup_failures:
                self._collect_errors(task)
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
            if not self.fresh:  # decide() may have started and evaporated branches, which need a decision first
                self.complete = True
                self._release()

    def _collect_errors(self, task: Task) -> None:
        """Collect the programming error of a branch, which takes precedence, or its failures of cleanups."""
        if task.crash is None:
            self.cleanup += task.cleanup_failures or ()
        elif self.crash is None:
            self.crash = task.crash
        elif self.crash is not task.crash:
            self.crash.add_note(f"at the same time, in {task.path}: {task.crash!r}")

    def _release(self) -> None:
        """Wake the owner, with its evaporation if that is pending and no programming error takes precedence."""
        owner = self.owner
        if self.crash is None and owner.doomed:
            self.scheduler.throw(owner, pending_error(owner, self.scheduler.draining))
        else:
            self.scheduler.wake(owner)

    def __str__(self) -> str:
        return f"{self.kind} of {len(self.live)} live branches"


class All(Scope):
    """A scope that fails with its first failure; within one round that of the textually first branch."""

    failed: Task | None = None
    siblings: tuple[tuple[str, PlanFailure], ...] = ()

    def decide(self, dead: list[Task]) -> None:
        failures = [task for task in dead if task.outcome is not SUCCEEDED]
        if failures:
            self.fail(failures)

    def fail(self, failures: list[Task]) -> None:
        """Fix the first failure as the outcome, with the others as its siblings."""
        self.failed = failures[0]
        self.siblings = tuple((task.name, failure_of(task)) for task in failures[1:])
        self.close()

    def raise_failure(self) -> None:
        """Raise the failure that is the outcome, if there is one, with its attachments."""
        if self.failed is not None:
            failure = failure_of(self.failed)
            failure.siblings += tuple((name, other) for name, other in self.siblings if other is not failure)
            raise self.attach(failure)


class Single(All):
    """A construct with one branch, whose result or failure it passes on."""

    def __init__(self, kind: str, body: Callable[[], Any], name: str | None = None, body_name: str = "") -> None:
        super().__init__(kind, name)
        self.body = body
        self.body_name = body_name or name_of(body)
        self.result: Any = None

    def begin(self) -> None:
        self.start(self.body, self.body_name, 0)

    def decide(self, dead: list[Task]) -> None:
        super().decide(dead)
        self.result = dead[0].result

    def finish(self) -> Any:
        self.raise_failure()
        return self.result


def failure_of(task: Task) -> PlanFailure:
    """Failure of a branch that did not succeed: its own, or BranchEvaporated if it was evaporated from outside."""
    if task.failure is None:
        task.failure = BranchEvaporated(path=task.path)
    return task.failure


def _innermost(task: Task) -> str:
    """List names and lines of the innermost tasks, without repetitions."""
    places: dict[str, None] = {}
    current: Task | None = task
    for _ in range(20):
        assert current is not None  # there are MAX_DEPTH of them
        places[f"{current.base_name}{place_of(current)}"] = None
        current = None if current.group is None else current.group.owner
    return ", in ".join(places)
