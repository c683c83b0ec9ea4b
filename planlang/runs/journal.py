"""Journal of a run: records its inputs and the completed steps of its top-level plan, so that it can be resumed.

The top-level plan is the outermost plan function, whether or not ``budget`` or ``timeout`` surround it. Its steps are
the nodes directly below it in the tree, and the parts of a ``seq``, ``state_machine`` or ``partial_order`` among these.
Nodes further below are not steps: a step that has not completed runs again as a whole.

The inputs are the answers of the executive, the values of world fluents and the results of calls in threads. Besides
plan, seed and schedule, a run depends on nothing else.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

from planlang.failures import PlanFailure
from planlang.kernel.core import Scheduler, Task, here, park
from planlang.kernel.errors import PlanStructureError
from planlang.kernel.fluent import Fluent, find
from planlang.kernel.primitives import pause
from planlang.kernel.schedule import CountedRandom
from planlang.kernel.signals import BaseFluent
from planlang.kernel.tracebacks import locate
from planlang.kernel.tree import EVAPORATED, Body, Node, Status
from planlang.runs.codec import Exact, Lost, dump, dump_failure
from planlang.runs.recorded_run import Done, Past, outcome_of, value_in
from planlang.runs.repeating import ONCE, RepeatedTrace
from planlang.runs.trace import ResumedTrace, Trace

DIVIDED = ("seq", "state_machine", "partial_order")
"""Constructs whose parts are steps."""
AROUND = ("budget", "timeout")
"""Constructs that may surround the top-level plan."""


class _OpenStep:
    """A step that has begun but not ended."""

    __slots__ = ("fluents", "moved", "spent", "used")

    def __init__(self, moved: object) -> None:
        self.moved = moved
        """Position of the task's random stream at the start of the step."""
        self.fluents: dict[Fluent[Any], None] = {}
        self.spent: dict[str, int] = {}
        self.used: dict[str, int] = {}


class Journal:
    """Recorder of the inputs and completed steps of a run; in a resumed run it supplies the recorded ones.

    Implements both interfaces of :mod:`planlang.kernel.tree`. Invariants: ``spine`` holds the open nodes whose
    children are steps, with True if the top-level plan function is still to come below them; ``open_steps`` the steps
    that have begun but not ended; ``skipped`` the nodes that return recorded results.
    """

    def __init__(
        self,
        scheduler: Scheduler,
        trace: Trace,
        *,
        snapshot: Callable[[], Any] | None = None,
        past: Past | None = None,
        charge: Callable[[str, str, int], None],
    ) -> None:
        """``past`` holds the completed steps of the run to resume. ``snapshot`` returns the state of the world and the
        robot's belief as JSON. ``charge`` charges the budgets around the running task, for steps that are skipped.
        """
        self._scheduler = scheduler
        self._trace = trace if past is None else ResumedTrace(trace, past)
        self._past = past
        self._ahead = self._trace if isinstance(self._trace, ResumedTrace) else None
        """The trace, while the run repeats its past; then None."""
        self._repeated = trace if isinstance(trace, RepeatedTrace) else None
        self._answers: dict[str, Any] = {} if past is None else past.answers()
        """Last answer to each question."""
        self._keys = FluentKeys(scheduler)
        self._samples: dict[BaseFluent[Any], Any] = {}
        self._snapshot = snapshot
        self._last_snapshot: Any = None
        self._charge = charge
        self._spine: dict[Node, bool] = {}
        self._open_steps: dict[Node, _OpenStep] = {}
        self._skipped: set[Node] = set()
        self._order: Iterator[Done] = iter(() if past is None else past.order)
        self._due = next(self._order, None)
        """The completed step that ends next."""
        self._waiting: dict[str, Task] = {}
        self._later: list[Task] = []
        if past is not None and past.last is None:
            self._go_on()

    # -- Observer

    def begin(self, root: Node, fail: Callable[[BaseException], object]) -> None:
        """Start the trace."""
        self._trace.begin(root, fail)
        self._spine[root] = True

    def started(self, step: int, node: Node, /, **details: object) -> None:
        """Record the start of a node. Raises Different if a resumed plan deviates from its past."""
        self._trace.started(step, node, **details)
        if self._ahead is not None and self._ahead.problem is not None:
            raise self._ahead.problem
        if node not in self._skipped:
            self._enter(node)

    def ended(
        self, step: int, node: Node, outcome: Status, result: object = None, failure: BaseException | None = None
    ) -> None:
        """Record the end of a node; a step is completed if it ended with a result or a plan failure."""
        self._spine.pop(node, None)
        opened = self._open_steps.pop(node, None)
        if opened is not None and outcome is not EVAPORATED and (failure is None or isinstance(failure, PlanFailure)):
            task = node if isinstance(node, Task) else here()[1]
            if not task.cancelled:  # a step that was cut short by evaporation is not completed
                self._completed(node, task, opened, result, failure)
        self._trace.ended(step, node, outcome, result, failure)
        self._skipped.discard(node)

    def write(self, step: int, event: str, node: Node | None = None, /, **details: Any) -> None:
        """Record any other event."""
        if event == "plan" and node is not None and self._spine.get(node):  # a branch that is the plan function itself
            self._spine[node] = False
        elif event == "returned" and node is not None:
            self.note_call(node, details["call"], details)
        self._trace.write(step, event, node, **details)

    def changed(self, fluent: BaseFluent[Any]) -> None:
        """Register a change of a fluent with the open steps, except for the statuses of tasks."""
        task = self._scheduler.current
        if task is not None and isinstance(fluent, Fluent) and not isinstance(fluent.value, Status):
            for opened in self._around(task.node):
                opened.fluents[fluent] = None

    def charged(self, kind: str, part: str, number: int) -> None:
        """Record a charge to budgets: ``kind`` is "spent" [world steps] or "used" [attempts]."""
        for opened in self._around(here()[1].node):
            counts = opened.spent if kind == "spent" else opened.used
            counts[part] = counts.get(part, 0) + number

    def end(self) -> None:
        """End the trace."""
        self._trace.end()

    # -- which nodes are steps

    def _enter(self, node: Node) -> None:
        parent = node.parent
        outer = None if parent is None else self._spine.get(parent)
        if outer is None or parent is None:
            return
        is_branch = isinstance(node, Task)
        # A budget or timeout around the top-level plan is a node with one branch, and neither is a step. Below the
        # top-level plan, which is the first plan function on the way down, every node is a step, even a budget.
        if outer and (parent.kind in AROUND if is_branch else node.kind in AROUND):
            self._spine[node] = True
        elif outer and node.kind == "plan":
            self._spine[node] = False
        else:
            if node.kind in DIVIDED:
                self._spine[node] = False
            self._open_steps[node] = _OpenStep(None if is_branch else _moved(here()[1]))

    def _around(self, node: Node | None) -> Iterator[_OpenStep]:
        while node is not None:
            opened = self._open_steps.get(node)
            if opened is not None:
                yield opened
            node = node.parent

    # -- completed steps

    def _completed(
        self, node: Node, task: Task, opened: _OpenStep, result: object, failure: BaseException | None
    ) -> None:
        step = self._scheduler.now
        try:
            details = self._details(node, task, opened, result, failure)
        except Lost as lost:
            what = "its failure" if failure is not None else "its result, or what it left behind,"
            self._trace.write(step, "completed", node, lost=f"{what} does not survive JSON: {lost}")
        else:
            self._trace.write(step, "completed", node, **details)
        self._trace.sync()

    def _details(
        self, node: Node, task: Task, opened: _OpenStep, result: object, failure: BaseException | None
    ) -> dict[str, object]:
        """Details of a completed step: result, changed fluents, random draws, charges, state; raises Lost."""
        details: dict[str, object] = {}
        if failure is not None:
            details["failure"] = Exact(dump_failure(failure))
        elif result is not None:
            details["value"] = Exact(dump(result))
        outer = [fluent for fluent in opened.fluents if _is_outside(fluent, node)]
        details["fluents"] = {_unique_name(fluent): dump(fluent.value) for fluent in outer}
        if task is not node and _moved(task) != opened.moved:  # the stream of a branch ends with it
            details["draws"] = _draws(task)
        details["spent"] = opened.spent
        details["used"] = opened.used
        details["open"] = [each.path for each in self._open_steps if each not in self._spine]
        choices = getattr(self._scheduler.choice, "state", None)
        if self._snapshot is not None and (snapshot := self._snapshot()) != self._last_snapshot:
            self._last_snapshot = snapshot
            details["left"] = Exact(snapshot)
        if choices is not None:
            details["choices"] = Exact(choices())
        return {key: value if isinstance(value, Exact) else Exact(value) for key, value in details.items() if value}

    # -- Recorded: inputs

    def answer(self, question: str, find: Callable[[], Any]) -> Any:
        """Compute an answer, and record it if it differs from the last one."""
        value = find()
        if self._ahead is not None:
            return value
        encoded = _encoded(value)
        if self._answers.get(question) != (outcome := outcome_of(encoded)):
            self._answers[question] = outcome
            self._note("answer", self._node(), asked=question, **encoded)
        return value

    def next_answer(self, question: str, find: Callable[[], Any]) -> Any:
        """Compute and record an answer."""
        try:
            value = find()
        except Exception as error:
            self._note("answer", self._node(), asked=question, **_encoded(None, error))
            raise
        self._note("answer", self._node(), asked=question, **_encoded(value))
        return value

    def sample(self, fluent: BaseFluent[Any], read: Callable[[], Any]) -> Any:
        """Read a world fluent, and record changes, except for fluents that a process module waits for."""
        if self._ahead is not None:
            return self._sample_past(fluent)
        value, error = None, None
        try:
            value = read()
        except Exception as raised:
            error = raised
        key = self._keys.of(fluent)
        if key is not None:
            encoded = _encoded(value, error)
            if self._samples.get(fluent) != (outcome := outcome_of(encoded)):
                self._samples[fluent] = outcome
                self._note("world", key[0] or self._node(), fluent=str(fluent), number=key[1], **encoded)
        if error is not None:
            raise error
        return value

    def _sample_past(self, fluent: BaseFluent[Any]) -> Any:
        assert self._past is not None
        node, number = self._keys.of(fluent) or (None, 0)
        line = self._past.value_of(None if node is None else node.path, number, self._scheduler.now)
        if line is None:
            raise PlanStructureError(
                f"{fluent} was not read in the recorded run, and cannot be read while its completed steps are skipped"
            )
        self._samples[fluent] = outcome_of(line.record)
        return value_in(line)

    def call(self, node: Node, number: int, function: Callable[[], Any]) -> tuple[int, Callable[[], Any]]:
        """Choose the call itself, or its recorded result while a run repeats its past."""
        if self._repeated is not None:
            return self._repeated.call(node, number, function)
        if self._past is None:
            return number, function
        if self._ahead is None:
            return max(number, self._past.calls + 1), function
        number, line = self._past.call(node.path)
        return number, partial(value_in, line)

    def note_call(self, node: Node, number: int, outcome: dict[str, Any]) -> None:
        """Record the result or failure of a call in a thread."""
        if self._ahead is None:
            self._note(
                "answer", node, asked=f"call {number}", **_encoded(outcome.get("result"), outcome.get("failure"))
            )

    async def once(self, body: Body) -> Any:
        """Run a body that must not be executed twice, and record its result; or return the recorded result."""
        scheduler, task = here()
        self._note("outside", task.node)
        line = None if self._repeated is None else self._repeated.once(task.node)
        if line is not None and line.step > scheduler.now:
            await pause(line.step - scheduler.now, "the recorded end of its process module")
        try:
            result = await body() if line is None else value_in(line)
        except Exception as error:
            locate_here(error)
            self._note("answer", task.node, asked=ONCE, **_encoded(None, error))
            raise
        self._note("answer", task.node, asked=ONCE, **_encoded(result))
        return result

    def _node(self) -> Node | None:
        task = self._scheduler.current
        return None if task is None else task.node

    def _note(self, event: str, node: Node | None, **details: object) -> None:
        if not self._scheduler.draining:
            self._trace.write(self._scheduler.now, event, node, **details)

    # -- Recorded: completed steps of a resumed run

    def body(self, node: Node, body: Body) -> Body:
        """Choose the body of a node, or a function with its recorded result, or the body after the past is repeated."""
        past = self._past
        if self._ahead is None or past is None or node.parent not in self._spine:
            return body
        done = past.done.get(node.path)
        if done is not None:
            self._skipped.add(node)
            return partial(self._skip, done)
        outer = self._spine[node.parent]
        if isinstance(node, Task) and not (outer and node.parent.kind in AROUND):
            return partial(self._begin_later, body)
        return body

    async def _begin_later(self, body: Body) -> Any:
        """Run the body of a step that was not completed, after all completed steps are skipped."""
        task = here()[1]
        while self._ahead is not None:
            self._later.append(task)
            try:
                await park("the recorded steps before it")
            finally:
                self._later.remove(task)
        return await body()

    async def _skip(self, done: Done) -> Any:
        """Let the time of a completed step pass, restore its effects, and return its recorded result or failure."""
        scheduler, task = here()
        if done.step > scheduler.now:
            await pause(done.step - scheduler.now, done.path)
        # Steps of the same time end in their recorded order, as fluents and budgets may depend on it.
        while self._due is not done:
            self._waiting[done.path] = task
            await park(f"the recorded end of {self._due.path if self._due else 'the run'}")
        self._due = next(self._order, None)
        if self._due is not None and self._due.path in self._waiting:
            scheduler.wake(self._waiting.pop(self._due.path))
        if done.draws is not None:
            _draw(scheduler, task, done)
        for name, value in done.fluents.items():
            fluent = find(name)
            if fluent is None:
                raise PlanStructureError(
                    f"the recorded step {done.path} has set a fluent {name!r}, which is missing now"
                )
            fluent.set(value)
        for kind, counts in (("spent", done.spent), ("used", done.used)):
            for part, number in counts.items():
                self._charge(kind, part, number)
        if self._due is None:
            self._go_on()
        if done.failure is not None:
            raise done.failure
        return done.value

    def _go_on(self) -> None:
        """Execute the plan from here on."""
        past, ahead = self._past, self._ahead
        assert past is not None
        assert ahead is not None
        self._ahead = None
        self._last_snapshot = past.left
        restore = getattr(self._scheduler.choice, "restore", None)
        if restore is not None:
            restore(past.choices)
        ahead.go_on(self._scheduler.now, past)
        for task in self._later:
            self._scheduler.wake(task)

    def step_ends(self, step: int) -> bool:
        """Check whether the run still repeats its past; raises Different if a record was not repeated."""
        if self._ahead is not None:
            self._ahead.check(step)
        return self._ahead is not None

    def check_repeated(self) -> None:
        """Raise Different if a resumed plan has ended before it repeated its past."""
        self.step_ends(sys.maxsize)


class FluentKeys:
    """Identification of world fluents: by the node in which they were first read, and a number in that node."""

    def __init__(self, scheduler: Scheduler) -> None:
        self._scheduler = scheduler
        self._keys: dict[BaseFluent[Any], tuple[Node | None, int] | None] = {}
        self._numbers: dict[Node | None, int] = {}

    def of(self, fluent: BaseFluent[Any]) -> tuple[Node | None, int] | None:
        """Node and number of a fluent; None for a fluent of a process module."""
        if fluent not in self._keys:
            task = self._scheduler.current
            node = None if task is None else task.node
            enclosing = node
            while enclosing is not None and enclosing.kind not in ("perform", "plan"):
                enclosing = enclosing.parent
            if enclosing is not None and enclosing.kind == "perform":  # below a plan it would be a recipe's fluent
                self._keys[fluent] = None
            else:
                number = self._numbers[node] = self._numbers.get(node, 0) + 1
                self._keys[fluent] = (node, number)
        return self._keys[fluent]


def locate_here(error: Exception) -> None:
    """Store in a failure where it was raised, so that the place is recorded with it."""
    if isinstance(error, PlanFailure) and error.where is None:
        scheduler, task = here()
        locate(error, task.node, scheduler.revision)


def _encoded(value: object, error: BaseException | None = None) -> dict[str, Any]:
    try:
        if error is not None:
            return {"failure": Exact(dump_failure(error))}
        return {} if value is None else {"value": Exact(dump(value))}
    except Lost as lost:
        return {"lost": str(lost)}


def _moved(task: Task) -> tuple[int, float | None]:
    """Position of a task's random stream, with ``gauss_next``, as every second number of ``gauss`` needs no draw."""
    stream = task.stream
    return (stream.moved, stream.gauss_next) if isinstance(stream, CountedRandom) else (0, None)


def _draws(task: Task) -> Any:
    """Draws from a task's random stream; raises Lost if the plan has seeded it."""
    assert isinstance(task.stream, CountedRandom)
    try:
        return task.stream.draws
    except ValueError as problem:
        raise Lost(str(problem)) from None


def _draw(scheduler: Scheduler, task: Task, done: Done) -> None:
    stream = CountedRandom(f"{scheduler.seed} {task.path}") if task.stream is None else task.stream
    assert isinstance(stream, CountedRandom)
    task.stream = stream
    try:
        stream.go_to(done.draws)
    except ValueError as problem:
        raise PlanStructureError(f"the recorded step {done.path} does not fit the plan: {problem}") from None


def _unique_name(fluent: Fluent[Any]) -> str:
    if fluent.name is None:
        raise Lost("a fluent without a name, which is from outside of the step")
    if find(fluent.name) is not fluent:
        raise Lost(f"a fluent {fluent.name}, which is not the only one of that name")
    return fluent.name


def _is_outside(fluent: Fluent[Any], node: Node) -> bool:
    """Check whether a fluent was created outside a step."""
    ancestor: Node | None = fluent.born
    while ancestor is not None and ancestor is not node:
        ancestor = ancestor.parent
    return ancestor is None
