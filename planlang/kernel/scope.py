"""A scope: a construct at work. It starts branches, decides between rounds, and ends after all of them are dead."""

from __future__ import annotations

from collections.abc import Callable
from operator import attrgetter
from typing import Any

from planlang.failures import BranchEvaporated
from planlang.kernel.cancel import checkpoint, deliver, delivery, evaporate
from planlang.kernel.core import BaseScope, Task, here, park
from planlang.kernel.errors import Evaporated, PlanStructureError
from planlang.kernel.listing import place_of
from planlang.kernel.primitives import in_node
from planlang.kernel.tree import SUCCEEDED, Node, name_of
from planlang.plan_failure import PlanFailure, attach_cleanup

MAX_DEPTH = 10_000
"""Constructs inside of each other: more than any plan that was written, and less than what fills the memory."""
_index = attrgetter("index")


class Scope(BaseScope):
    """A construct with branches. Subclasses say in :meth:`decide` when it is over."""

    transparent = False
    """True if the branches appear in the tree in the construct's place."""

    def __init__(self, kind: str, name: str | None = None) -> None:
        self.scheduler, self.owner = here()
        if self.transparent:  # a node without a name of its own under its parent, and never recorded
            self.parent, self.kind, self.base_name, self.ordinal = self.owner.node, kind, kind, 1
            self._counts = self._path = None
            self.number = 0
            self.written = ""
        else:
            Node.__init__(self, self.owner.node, kind, name or kind)
        self.above: Node = self.owner.node if self.transparent else self
        """Under which node the branches appear in the tree."""
        self.depth = self.owner.depth + 1
        if self.depth > MAX_DEPTH:
            raise PlanStructureError(
                f"more than {MAX_DEPTH} constructs nested, as in recursion without end: {_innermost(self.owner)}"
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
        """Return what is recorded with the start."""
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
        if self.scheduler.recorded is not None:
            task.branch = self.scheduler.recorded.body(task, branch)
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
                evaporate(self.scheduler, task)

    async def execute(self) -> Any:
        """Run the construct to its end.

        Raises a programming error that left a branch, before anything else; Evaporated if the owner is evaporated.
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
            elif self.cleanup:  # evaporation carries nothing: whoever evaporated the owner raises them
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
        """Attach what went wrong in cleanups to what the construct raises."""
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
            if not self.fresh:  # deciding may have started and at once evaporated branches: they are decided on first
                self.complete = True
                self._release()

    def _collect_errors(self, task: Task) -> None:
        """Keep a programming error, which beats everything, and failures of cleanups."""
        if task.crash is None:
            self.cleanup += task.cleanup_failures or ()
        elif self.crash is None:
            self.crash = task.crash
        elif self.crash is not task.crash:
            self.crash.add_note(f"at the same time, in {task.path}: {task.crash!r}")

    def _release(self) -> None:
        """Let the owner go on, or deliver its evaporation; a programming error goes before that."""
        owner = self.owner
        if self.crash is None and owner.doomed:
            self.scheduler.throw(owner, delivery(owner, self.scheduler.draining))
        else:
            self.scheduler.wake(owner)

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


class Single(All):
    """A construct around one branch, whose result or failure is its own."""

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
    """Return the failure of a branch that did not succeed: its own, or that it was evaporated from outside."""
    if task.failure is None:
        task.failure = BranchEvaporated(path=task.path)
    return task.failure


def _innermost(task: Task) -> str:
    """Return names and lines of the innermost tasks, each once."""
    found: dict[str, None] = {}
    current: Task | None = task
    for _ in range(20):
        assert current is not None  # there are MAX_DEPTH of them
        found[f"{current.base_name}{place_of(current)}"] = None
        current = None if current.group is None else current.group.owner
    return ", in ".join(found)
