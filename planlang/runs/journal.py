"""The journal of a run: its inputs, and the steps of its top-level plan that have completed, so that it can be resumed.

The top-level plan is the outermost plan function; ``budget`` and ``timeout`` around it are looked through. Its steps
are the nodes of the tree directly in it. Of a ``seq``, ``state_machine`` or ``partial_order`` among them the branches,
states and steps are steps too. Nothing deeper is: what has not completed runs again as a whole.

Besides it notes the inputs of the plan, to be given again when the run is repeated: the executive's answers, the values
of world fluents and the results of calls in threads are all that a run depends on besides plan, seed and schedule.
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
from planlang.kernel.listing import locate
from planlang.kernel.observer import Body
from planlang.kernel.primitives import pause
from planlang.kernel.schedule import CountedRandom
from planlang.kernel.signals import BaseFluent
from planlang.kernel.tree import EVAPORATED, Node, Status
from planlang.runs.codec import Exact, Lost, dump, dump_failure
from planlang.runs.recorded_run import Done, Past, outcome_of, value_in
from planlang.runs.repeating import ONCE, RepeatedTrace
from planlang.runs.trace import ResumedTrace, Trace

LOOKED_INTO = ("seq", "state_machine", "partial_order")
"""Constructs whose parts are steps."""
AROUND = ("budget", "timeout")
"""Constructs that may be around the top-level plan."""


class _Open:
    """A step that has begun and not ended."""

    __slots__ = ("fluents", "moved", "spent", "used")

    def __init__(self, moved: object) -> None:
        self.moved = moved
        """Position of its task's random stream at its start."""
        self.fluents: dict[Fluent[Any], None] = {}
        self.spent: dict[str, int] = {}
        self.used: dict[str, int] = {}


class Journal:
    """Observes one run, and notes its inputs and its completed steps; in a resumed run it gives what is taken over.

    Implements both interfaces of :mod:`planlang.kernel.observer`. Invariants: ``spine`` holds the open nodes whose
    parts are steps, with whether a plan function in them is still looked into; ``opened`` the steps that have begun
    and not ended; ``given`` the nodes whose results are taken over.
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
        """``past`` is what a resumed run takes over. ``snapshot`` gives the state of the world and the robot's belief
        as JSON. ``charge`` charges the budgets around the running task with what a step that is taken over has used.
        """
        self._scheduler = scheduler
        self._trace = trace if past is None else ResumedTrace(trace, past)
        self._past = past
        self._ahead = self._trace if isinstance(self._trace, ResumedTrace) else None
        """The trace, as long as the run repeats what it takes over."""
        self._repeated = trace if isinstance(trace, RepeatedTrace) else None
        self._answers: dict[str, Any] = {} if past is None else past.answers()
        """Question -> the last answer to it."""
        self._keys = FluentKeys(scheduler)
        self._samples: dict[BaseFluent[Any], Any] = {}
        self._snapshot = snapshot
        self._left: Any = None
        self._charge = charge
        self._spine: dict[Node, bool] = {}
        self._opened: dict[Node, _Open] = {}
        self._given: set[Node] = set()
        self._order: Iterator[Done] = iter(() if past is None else past.order)
        self._due = next(self._order, None)
        """The step whose end comes next."""
        self._waiting: dict[str, Task] = {}
        self._later: list[Task] = []
        if past is not None and past.last is None:
            self._go_on()

    # -- Observer

    def begin(self, root: Node, fail: Callable[[BaseException], object]) -> None:
        """Hear that the run begins."""
        self._trace.begin(root, fail)
        self._spine[root] = True

    def started(self, step: int, node: Node, /, **details: object) -> None:
        """Hear that a node begins, in its task. Raises Different where a resumed plan does not repeat what it did."""
        self._trace.started(step, node, **details)
        if self._ahead is not None and self._ahead.problem is not None:
            raise self._ahead.problem
        if node not in self._given:
            self._enter(node)

    def ended(
        self, step: int, node: Node, outcome: Status, result: object = None, failure: BaseException | None = None
    ) -> None:
        """Hear that a node ends; a step has completed if it ended with a result or a plan failure."""
        self._spine.pop(node, None)
        opened = self._opened.pop(node, None)
        if opened is not None and outcome is not EVAPORATED and (failure is None or isinstance(failure, PlanFailure)):
            task = node if isinstance(node, Task) else here()[1]
            if not task.cancelled:  # what evaporation has cut short does not count
                self._completed(node, task, opened, result, failure)
        self._trace.ended(step, node, outcome, result, failure)
        self._given.discard(node)

    def write(self, step: int, event: str, node: Node | None = None, /, **details: Any) -> None:
        """Hear of anything else."""
        if event == "plan" and node is not None and self._spine.get(node):  # a branch turns out to be the plan function
            self._spine[node] = False
        elif event == "returned" and node is not None:
            self.note_call(node, details["call"], details)
        self._trace.write(step, event, node, **details)

    def changed(self, fluent: BaseFluent[Any]) -> None:
        """Note that a task sets a fluent; statuses of tasks come about by themselves."""
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
        """Hear that the run is over."""
        self._trace.end()

    # -- which nodes are steps

    def _enter(self, node: Node) -> None:
        parent = node.parent
        outer = None if parent is None else self._spine.get(parent)
        if outer is None or parent is None:
            return
        is_branch = isinstance(node, Task)
        # A budget or timeout around the plan is a node with one branch: both are looked through. In the plan itself,
        # which is the first plan function met, every node is a step, also a budget.
        if outer and (parent.kind in AROUND if is_branch else node.kind in AROUND):
            self._spine[node] = True
        elif outer and node.kind == "plan":
            self._spine[node] = False
        else:
            if node.kind in LOOKED_INTO:
                self._spine[node] = False
            self._opened[node] = _Open(None if is_branch else _moved(here()[1]))

    def _around(self, node: Node | None) -> Iterator[_Open]:
        while node is not None:
            opened = self._opened.get(node)
            if opened is not None:
                yield opened
            node = node.parent

    # -- what steps leave behind

    def _completed(self, node: Node, task: Task, opened: _Open, result: object, failure: BaseException | None) -> None:
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
        self, node: Node, task: Task, opened: _Open, result: object, failure: BaseException | None
    ) -> dict[str, object]:
        """Return what a completed step is recorded with; raises Lost."""
        details: dict[str, object] = {}
        if failure is not None:
            details["failure"] = Exact(dump_failure(failure))
        elif result is not None:
            details["value"] = Exact(dump(result))
        details["fluents"] = {_named(fluent): dump(fluent.value) for fluent in opened.fluents if _outside(fluent, node)}
        if task is not node and _moved(task) != opened.moved:  # the stream of a branch ends with it
            details["draws"] = _draws(task)
        details["spent"] = opened.spent
        details["used"] = opened.used
        details["open"] = [one.path for one in self._opened if one not in self._spine]
        choices = getattr(self._scheduler.choice, "state", None)
        if self._snapshot is not None and (left := self._snapshot()) != self._left:
            self._left = left
            details["left"] = Exact(left)
        if choices is not None:
            details["choices"] = Exact(choices())
        return {key: value if isinstance(value, Exact) else Exact(value) for key, value in details.items() if value}

    # -- Recorded: inputs

    def answer(self, question: str, find: Callable[[], Any]) -> Any:
        """Ask, and note the answer if it is another one than before."""
        value = find()
        if self._ahead is not None:
            return value
        noted = _noted(value)
        if self._answers.get(question) != (outcome := outcome_of(noted)):
            self._answers[question] = outcome
            self._note("answer", self._node(), asked=question, **noted)
        return value

    def next_answer(self, question: str, find: Callable[[], Any]) -> Any:
        """Ask, and note the answer."""
        try:
            value = find()
        except Exception as error:
            self._note("answer", self._node(), asked=question, **_noted(None, error))
            raise
        self._note("answer", self._node(), asked=question, **_noted(value))
        return value

    def sample(self, fluent: BaseFluent[Any], read: Callable[[], Any]) -> Any:
        """Read, and note the value if it has changed; what process modules wait for is their own and not noted."""
        if self._ahead is not None:
            return self._sample_past(fluent)
        value, error = None, None
        try:
            value = read()
        except Exception as raised:
            error = raised
        key = self._keys.of(fluent)
        if key is not None:
            noted = _noted(value, error)
            if self._samples.get(fluent) != (outcome := outcome_of(noted)):
                self._samples[fluent] = outcome
                self._note("world", key[0] or self._node(), fluent=str(fluent), number=key[1], **noted)
        if error is not None:
            raise error
        return value

    def _sample_past(self, fluent: BaseFluent[Any]) -> Any:
        assert self._past is not None
        node, number = self._keys.of(fluent) or (None, 0)
        line = self._past.value_of(None if node is None else node.path, number, self._scheduler.now)
        if line is None:
            raise PlanStructureError(f"{fluent} was not read before, and cannot be read before the run goes on")
        self._samples[fluent] = outcome_of(line.record)
        return value_in(line)

    def call(self, node: Node, number: int, function: Callable[[], Any]) -> tuple[int, Callable[[], Any]]:
        """Return the call itself; in the part of a run that is taken over or repeated, what it gave then."""
        if self._repeated is not None:
            return self._repeated.call(node, number, function)
        if self._past is None:
            return number, function
        if self._ahead is None:
            return max(number, self._past.calls + 1), function
        found, line = self._past.call(node.path)
        return found, partial(value_in, line)

    def note_call(self, node: Node, number: int, outcome: dict[str, Any]) -> None:
        """Note the result or the failure of a call in a thread."""
        if self._ahead is None:
            self._note("answer", node, asked=f"call {number}", **_noted(outcome.get("result"), outcome.get("failure")))

    async def once(self, body: Body) -> Any:
        """Return what a body gives that must not be executed again: what is recorded of it, or else note its result."""
        scheduler, task = here()
        self._note("outside", task.node)
        line = None if self._repeated is None else self._repeated.once(task.node)
        if line is not None and line.step > scheduler.now:
            await pause(line.step - scheduler.now, "what is recorded of its process module")
        try:
            result = await body() if line is None else value_in(line)
        except Exception as error:
            locate_here(error)
            self._note("answer", task.node, asked=ONCE, **_noted(None, error))
            raise
        self._note("answer", task.node, asked=ONCE, **_noted(result))
        return result

    def _node(self) -> Node | None:
        task = self._scheduler.current
        return None if task is None else task.node

    def _note(self, event: str, node: Node | None, **details: object) -> None:
        if not self._scheduler.draining:
            self._trace.write(self._scheduler.now, event, node, **details)

    # -- Recorded: taking over

    def body(self, node: Node, body: Body) -> Body:
        """Return the body, or what gives the result that the node had, or the body once the run goes on."""
        past = self._past
        if self._ahead is None or past is None or node.parent not in self._spine:
            return body
        done = past.done.get(node.path)
        if done is not None:
            self._given.add(node)
            return partial(self._give, done)
        outer = self._spine[node.parent]
        if isinstance(node, Task) and not (outer and node.parent.kind in AROUND):
            return partial(self._begin_later, body)
        return body

    async def _begin_later(self, body: Body) -> Any:
        """Run a branch that is a step and has not completed: as it was written, once all others are taken over."""
        task = here()[1]
        while self._ahead is not None:
            self._later.append(task)
            try:
                await park("what the run takes over")
            finally:
                self._later.remove(task)
        return await body()

    async def _give(self, done: Done) -> Any:
        """Let the time pass that the step took, and give what it gave; in the order in which steps completed."""
        scheduler, task = here()
        if done.step > scheduler.now:
            await pause(done.step - scheduler.now, done.path)
        # Steps that ended at the same time did so in an order, on which fluents and budgets may depend.
        while self._due is not done:
            self._waiting[done.path] = task
            await park(f"the end of {self._due.path if self._due else 'the run'}, which was before its own")
        self._due = next(self._order, None)
        if self._due is not None and self._due.path in self._waiting:
            scheduler.wake(self._waiting.pop(self._due.path))
        if done.draws is not None:
            _draw(scheduler, task, done)
        for name, value in done.fluents.items():
            fluent = find(name)
            if fluent is None:
                raise PlanStructureError(f"{done.path} has set the fluent {name}, which there is not")
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
        """Let the plan run from here on."""
        past, ahead = self._past, self._ahead
        assert past is not None
        assert ahead is not None
        self._ahead = None
        self._left = past.left
        restore = getattr(self._scheduler.choice, "restore", None)
        if restore is not None:
            restore(past.choices)
        ahead.go_on(self._scheduler.now, past)
        for task in self._later:
            self._scheduler.wake(task)

    def step_ends(self, step: int) -> bool:
        """Return True while the run repeats what it takes over; raises Different if something is missing."""
        if self._ahead is not None:
            self._ahead.check(step)
        return self._ahead is not None

    def check_repeated(self) -> None:
        """Raise Different if a resumed plan has ended otherwise than by going on from its past."""
        self.step_ends(sys.maxsize)


class FluentKeys:
    """World fluents by the node in which they were first looked at, and their number there."""

    def __init__(self, scheduler: Scheduler) -> None:
        self._scheduler = scheduler
        self._keys: dict[BaseFluent[Any], tuple[Node | None, int] | None] = {}
        self._numbers: dict[Node | None, int] = {}

    def of(self, fluent: BaseFluent[Any]) -> tuple[Node | None, int] | None:
        """Return node and number; None for a fluent of a process module at work."""
        if fluent not in self._keys:
            task = self._scheduler.current
            node = None if task is None else task.node
            around = node
            while around is not None and around.kind not in ("perform", "plan"):
                around = around.parent
            if around is not None and around.kind == "perform":  # a plan below it is a recipe that performs the action
                self._keys[fluent] = None
            else:
                number = self._numbers[node] = self._numbers.get(node, 0) + 1
                self._keys[fluent] = (node, number)
        return self._keys[fluent]


def locate_here(error: Exception) -> None:
    """Note where a failure was raised, so that the place is recorded with it."""
    if isinstance(error, PlanFailure) and error.where is None:
        scheduler, task = here()
        locate(error, task.node, scheduler.revision)


def _noted(value: object, error: BaseException | None = None) -> dict[str, Any]:
    try:
        if error is not None:
            return {"failure": Exact(dump_failure(error))}
        return {} if value is None else {"value": Exact(dump(value))}
    except Lost as lost:
        return {"lost": str(lost)}


def _moved(task: Task) -> tuple[int, float | None]:
    """Return another value after whatever was drawn: ``gauss`` gives every other number without a draw."""
    stream = task.stream
    return (stream.moved, stream.gauss_next) if isinstance(stream, CountedRandom) else (0, None)


def _draws(task: Task) -> Any:
    """Return how far a task's stream of random numbers has come; raises Lost."""
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
        raise PlanStructureError(f"{done.path} cannot be taken over: {problem}") from None


def _named(fluent: Fluent[Any]) -> str:
    if fluent.name is None:
        raise Lost("a fluent without a name, which is from outside of the step")
    if find(fluent.name) is not fluent:
        raise Lost(f"a fluent {fluent.name}, which is not the only one of that name")
    return fluent.name


def _outside(fluent: Fluent[Any], node: Node) -> bool:
    """Return whether a fluent was made outside of a step."""
    born: Node | None = fluent.born
    while born is not None and born is not node:
        born = born.parent
    return born is None
