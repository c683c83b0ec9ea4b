"""Which steps of the top-level plan have completed: written into the trace, so that the run can be resumed.

The top-level plan is the outermost plan function; ``budget`` and ``timeout`` around it are looked through. Its steps
are the nodes of the tree directly in it. Of a ``seq``, ``state_machine`` or ``partial_order`` among them the branches,
states and steps are steps too. Nothing deeper is: what has not completed runs again as a whole.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from random import Random
from typing import TYPE_CHECKING, Any

from planlang.failures import PlanFailure
from planlang.kernel.errors import PlanStructureError
from planlang.kernel.exact import Exact, Lost, dump, dump_failure
from planlang.kernel.fluent import Fluent, find
from planlang.kernel.numbers import packed
from planlang.kernel.park import here, park
from planlang.kernel.past import Done, Past
from planlang.kernel.task import Status, Task
from planlang.kernel.tree import Node, path_of_next

if TYPE_CHECKING:
    from planlang.kernel.continued import Continued
    from planlang.kernel.scheduler import Scheduler

LOOKED_INTO = ("seq", "state_machine", "partial_order")
"""Constructs whose parts are steps."""
AROUND = ("budget", "timeout")
"""Constructs that may be around the top-level plan."""


class _Open:
    """A step that has begun and not ended."""

    __slots__ = ("fluents", "numbers", "spent", "used")

    def __init__(self, numbers: object) -> None:
        self.numbers = numbers
        self.fluents: dict[Fluent[Any], None] = {}
        self.spent: dict[str, int] = {}
        self.used: dict[str, int] = {}


class Journal:
    """Notes the completed steps of one run; in a resumed run it also hands out what is taken over.

    Invariants: ``spine`` holds the open nodes whose parts are steps, with whether a plan function in them is still
    looked into; ``opened`` the steps that have begun and not ended.
    """

    def __init__(
        self,
        scheduler: Scheduler,
        *,
        snapshot: Callable[[], Any] | None = None,
        past: Past | None = None,
        account: Callable[[Mapping[str, int], Mapping[str, int]], None],
    ) -> None:
        """``snapshot`` gives the state of the world and the robot's belief as JSON. ``account`` charges the budgets
        around the running task with what a step that is taken over has used.
        """
        self._scheduler = scheduler
        self._snapshot = snapshot
        self._left: Any = None
        self._past = past
        self._account = account
        self._spine: dict[Node, bool] = {}
        self._opened: dict[Node, _Open] = {}
        self._turns: Iterator[Done] = iter(() if past is None else past.order)
        self._turn = next(self._turns, None)
        self._waiting: dict[str, Task] = {}
        self._later: list[Task] = []
        self.ahead: Continued | None = None
        """The trace, as long as the run repeats what it takes over."""

    @property
    def resuming(self) -> bool:
        """True until the plan goes on where its past ends."""
        return self.ahead is not None

    # -- which nodes are steps

    def begin(self, root: Task) -> None:
        """The run begins."""
        self._spine[root] = True

    def plan(self, node: Node) -> None:
        """A branch turns out to be a plan function."""
        if self._spine.get(node):
            self._spine[node] = False

    def enter(self, node: Node) -> None:
        """A node begins, in its task. Raises Different where a resumed plan does not repeat what it did."""
        if self.ahead is not None and self.ahead.problem is not None:
            raise self.ahead.problem
        parent = node.parent
        outer = None if parent is None else self._spine.get(parent)
        if outer is None:
            return
        if outer and node.kind in AROUND:
            self._spine[node] = True
            return
        if outer and node.kind == "plan":
            self._spine[node] = False
            return
        if node.kind in LOOKED_INTO:
            self._spine[node] = False
        stream = here()[1].stream
        self._opened[node] = _Open(None if stream is None else stream.getstate())

    def start(self, task: Task) -> None:
        """A branch is created: it is a step, or part of what is around the top-level plan."""
        parent = task.parent
        outer = None if parent is None else self._spine.get(parent)
        if outer is None:
            return
        if outer and parent is not None and parent.kind in AROUND:
            self._spine[task] = True
        else:
            task.branch = partial(self._step, task, task.branch)

    async def _step(self, task: Task, branch: Callable[[], Any]) -> Any:
        """Run a branch that is a step, unless it is taken over."""
        past = self._past
        if self.resuming and past is not None:
            done = past.done.get(task.path)
            if done is not None:
                return await self._take_over(done, task)
            while self.resuming:  # they begin together, as written, once all that has completed is taken over
                self._later.append(task)
                try:
                    await park("what the run takes over")
                finally:
                    self._later.remove(task)
        self._opened[task] = _Open(None)
        try:
            result = await branch()
        except PlanFailure as failure:
            self.leave(task, None, failure)
            raise
        self.leave(task, result, None)
        return result

    def leave(self, node: Node, result: object, failure: BaseException | None) -> None:
        """A node ends, in its task: with a result, or with a plan failure. A step has completed then."""
        self._spine.pop(node, None)
        opened = self._opened.pop(node, None)
        if opened is None or not (failure is None or isinstance(failure, PlanFailure)):
            return
        task = here()[1]
        if task.cancelled:  # what evaporation has cut short does not count
            return
        details: dict[str, object] = {}
        try:
            if failure is not None:
                details["failure"] = Exact(dump_failure(failure))
            elif result is not None:
                details["value"] = Exact(dump(result))
            fluents = {self._named(fluent): dump(fluent.value) for fluent in opened.fluents if _outside(fluent, node)}
        except Lost as lost:
            told = "its failure" if failure is not None else "its result, or a fluent that it set,"
            self._write("completed", node, lost=f"{told} does not survive JSON: {lost}")
            return
        if fluents:
            details["fluents"] = Exact(fluents)
        if task.stream is not None and task is not node and task.stream.getstate() != opened.numbers:
            details["numbers"] = Exact(packed(task.stream))
        for key, counts in (("spent", opened.spent), ("used", opened.used)):
            if counts:
                details[key] = Exact(counts)
        others = [one.path for one in self._opened if one not in self._spine]
        if others:
            details["open"] = Exact(others)
        choices = getattr(self._scheduler.choice, "state", None)
        if choices is not None:
            details["choices"] = Exact(choices())
        if self._snapshot is not None:
            left = self._snapshot()
            if left != self._left:
                self._left = left
                details["left"] = Exact(left)
        self._write("completed", node, **details)

    def _write(self, event: str, node: Node, **details: object) -> None:
        trace = self._scheduler.trace
        assert trace is not None  # a journal is written into one
        trace.write(self._scheduler.now, event, node, **details)

    @staticmethod
    def _named(fluent: Fluent[Any]) -> str:
        if fluent.name is None:
            raise Lost("a fluent without a name, which is from outside of the step")
        if find(fluent.name) is not fluent:
            raise Lost(f"a fluent {fluent.name}, which is not the only one of that name")
        return fluent.name

    # -- what steps leave behind

    def changed(self, fluent: Fluent[Any]) -> None:
        """A task sets a fluent."""
        task = self._scheduler.current
        if task is not None and not isinstance(fluent.value, Status):
            for opened in self._around(task.node):
                opened.fluents[fluent] = None

    def used(self, kind: str, part: str, number: int) -> None:
        """Something is charged to budgets: ``kind`` is "spent" [world steps] or "used" [attempts]."""
        for opened in self._around(here()[1].node):
            counts = opened.spent if kind == "spent" else opened.used
            counts[part] = counts.get(part, 0) + number

    def _around(self, node: Node | None) -> Iterator[_Open]:
        while node is not None:
            opened = self._opened.get(node)
            if opened is not None:
                yield opened
            node = node.parent

    # -- taking over

    def taken_over(self, parent: Node, kind: str, name: str) -> Callable[[], Any] | None:
        """What to await instead of running the next node of this name under ``parent``; None if it has to run."""
        past = self._past
        if not self.resuming or past is None or parent not in self._spine:
            return None
        done = past.done.get(path_of_next(parent, name))
        if done is None:
            return None
        return partial(self._pass, done, Node(parent, kind, name))

    def scope_taken_over(self, scope: Node) -> Any:
        """A coroutine that gives what a construct gave before, if it is a step that completed; else None."""
        past = self._past
        done = None if past is None or scope.parent not in self._spine else past.done.get(scope.path)
        return None if done is None else self._pass(done, scope)

    async def _pass(self, done: Done, node: Node) -> Any:
        scheduler, past = self._scheduler, self._past
        trace = scheduler.trace
        assert past is not None
        assert trace is not None
        trace.write(scheduler.now, "started", node, **past.beginning(done.path))
        try:
            result = await self._take_over(done, node)
        except PlanFailure as failure:
            trace.ended(scheduler.now, node, Status.FAILED, None, failure)
            raise
        trace.ended(scheduler.now, node, Status.SUCCEEDED, result)
        return result

    async def _take_over(self, done: Done, node: Node) -> Any:
        """Let the time pass that the step took, and give what it gave; in the order in which steps completed."""
        scheduler = self._scheduler
        await self._until(done.step, done.path)
        task = here()[1]
        while self._turn is not done:
            self._waiting[done.path] = task
            await park(f"the end of {self._turn.path if self._turn else 'the run'}, which was before its own")
        self._turn = next(self._turns, None)
        if self._turn is not None and self._turn.path in self._waiting:
            scheduler.wake(self._waiting.pop(self._turn.path))
        if done.numbers is not None:
            task.stream = task.stream or Random()
            task.stream.setstate(done.numbers)
        for name, value in done.fluents.items():
            fluent = find(name)
            if fluent is None:
                raise PlanStructureError(f"{done.path} has set the fluent {name}, which there is not")
            fluent.set(value)
        self._account(done.spent, done.used)
        if self._turn is None:
            self.go_on()
        if done.failure is not None:
            raise done.failure
        return done.value

    async def _until(self, step: int, what: str) -> None:
        scheduler, task = here()
        if step > scheduler.now:
            timer = scheduler.alarm(task, step - scheduler.now, lambda: scheduler.wake(task))
            try:
                await park(what)
            finally:
                timer.drop()

    def go_on(self) -> None:
        """From here on the plan runs."""
        scheduler, past, ahead = self._scheduler, self._past, self.ahead
        assert past is not None
        assert ahead is not None
        self.ahead = None
        self._left = past.left
        scheduler.calls.made = max(scheduler.calls.made, past.calls)
        restore = getattr(scheduler.choice, "restore", None)
        if restore is not None:
            restore(past.choices)
        ahead.go_on(scheduler.now, past)
        for task in self._later:
            scheduler.wake(task)


def _outside(fluent: Fluent[Any], node: Node) -> bool:
    """Whether a fluent was made outside of a step."""
    born: Node | None = fluent.born
    while born is not None and born is not node:
        born = born.parent
    return born is None


def taken_over(kind: str, name: str) -> Any:
    """In a resumed run: a coroutine that gives what this node gave before, if it has completed then; else None."""
    scheduler, task = here()
    journal = scheduler.journal
    if journal is None or not journal.resuming:
        return None
    found = journal.taken_over(task.node, kind, name)
    return None if found is None else found()


def note(kind: str, part: str, number: int) -> None:
    """Something is charged to the budgets around the running task; see :meth:`Journal.used`."""
    journal = here()[0].journal
    if journal is not None:
        journal.used(kind, part, number)
