"""Comparison of a replay with a trace, record by record; with the host and the schedule of the replay.

A replay follows the order of the records. Inputs from outside arrive at their recorded places, and among the tasks that
can run, the one with the next record runs first, unless the plan itself determines the order.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from planlang.kernel.core import Scheduler, Task, here, park
from planlang.kernel.hosts import VIRTUAL_HOST, checked
from planlang.kernel.primitives import pause
from planlang.kernel.signals import BaseFluent
from planlang.kernel.tree import Body, Node
from planlang.runs.codec import Exact, encode
from planlang.runs.journal import FluentKeys
from planlang.runs.recorded_run import BOOKKEEPING, DamagedTrace, Line, RecordedRun, details, value_in
from planlang.runs.repeating import agree
from planlang.runs.trace import FROM_OUTSIDE, Different, Trace, shown


class ReplayOver(BaseException):
    """Raised to end a replay after its last record, or at the first difference."""


class Opaque(Exact):
    """Stand-in for a result that could not be stored: a plan can pass it on, and the trace shows it as before."""

    __slots__ = ()


class ReplayCheck(Trace):
    """Trace that compares a replay with the records of a run.

    ``place`` is the index of the next record that the plan has to write; inputs recorded before it have been supplied.
    ``difference`` is the first one, if any.
    """

    scheduler: Scheduler
    is_compared = True

    def __init__(self, recorded: RecordedRun) -> None:
        super().__init__([])
        self.recorded = recorded
        self.lines = recorded.lines
        self.place = 0
        self.difference: Different | None = None
        self.over = False
        self._read = 0
        """Number of records whose answers are in ``_answers``."""
        self._answers: dict[str, Line] = {}
        self._series: dict[str, list[Line]] = {}
        self._turns: list[tuple[int, Task]] = []
        self._again: dict[str, int] = {}
        """Index of the record of each step that a resumed run began again, by path."""
        for place, line in enumerate(self.lines):
            if line.event == "resumed":
                self._again.update(dict.fromkeys(map(str, line.record.get("again", ())), place))
        self._pass()

    # -- the next record

    def next(self) -> Line | None:
        """The next record that the plan or a process module has to write; None at the end."""
        return self.lines[self.place] if self.place < len(self.lines) else None

    def step_after(self, now: int) -> int | None:
        """First step after ``now`` with a record, None if there is none."""
        place = bisect_right(self.lines, now, lo=min(self.place, len(self.lines)), key=lambda line: line.step)
        return self.lines[place].step if place < len(self.lines) else None

    def take(self) -> None:
        """Advance after the next record was written, and wake the tasks that waited for this."""
        self.place += 1
        self._pass()
        due = [turn for turn in self._turns if turn[0] <= self.place]
        if due:
            self._turns = [turn for turn in self._turns if turn[0] > self.place]
            for _, task in due:
                self.scheduler.wake(task)

    def _pass(self) -> None:
        """Advance to the next record that is compared."""
        while self.place < len(self.lines):
            line = self.lines[self.place]
            if line.event not in BOOKKEEPING and line.event != "header" and (line.path or line.event in FROM_OUTSIDE):
                return
            self.place += 1

    def _read_answers(self) -> None:
        """Collect the answers recorded up to the present place and step."""
        now = self.scheduler.now
        while self._read < self.place and self.lines[self._read].step <= now:
            line = self.lines[self._read]
            if line.event == "answer":
                question = str(line.record.get("asked"))
                self._answers[question] = line
                self._series.setdefault(question, []).append(line)
            self._read += 1

    async def turn(self, place: int, behind: int = 0) -> None:
        """Wait for the step of the record at ``place``, for all records before it, and for ``behind`` from it on."""
        scheduler, task = here()
        step = self.lines[place].step if place < len(self.lines) else scheduler.now
        if step > scheduler.now:
            await pause(step - scheduler.now)
        while self.place < place + behind and not self.over:
            turn = (place + behind, task)
            self._turns.append(turn)
            try:
                await park("its turn in the recorded run")
            finally:
                self._turns = [each for each in self._turns if each is not turn]

    # -- comparing

    def write(self, step: int, event: str, node: Node | None = None, /, **more: object) -> None:
        """Compare a record with the next recorded one."""
        if self.over or event in BOOKKEEPING or (node is None and event not in FROM_OUTSIDE):
            return
        line = self.next()
        path = None if node is None else node.path
        inside = {key: encode(value) for key, value in more.items()}
        if line is None:
            self.over = True
        elif event == "drained" and line.event != "drained":
            self.differ(f"nothing: the plan cannot go on ({more.get('because')})")
        elif (line.step, line.event, line.path) == (step, event, path) and agree(details(line.record), inside):
            if node is not None:
                node.number = int(line.record["node"])
            self.take()
        else:
            self.differ({"step": step, "event": event, "path": path, **inside})

    def differ(self, found: Mapping[str, Any] | str) -> None:
        """End the comparison with the first difference: ``found`` instead of the next record."""
        line = self.next()
        assert line is not None
        if self.difference is None and not self.over:
            recorded = {"step": line.step, "event": line.event, "path": line.path} | details(line.record)
            what = found if isinstance(found, str) else shown(found)
            message = f"line {line.number} is not repeated\n  recorded  {shown(recorded)}\n  found     {what}"
            self.difference = Different(message, line.number, recorded, found)
        self.over = True

    # -- planlang.kernel.tree.Recorded

    def answer(self, question: str, find: Callable[[], Any]) -> Any:
        """The last recorded answer."""
        if not self.knows(question):
            self._unknown(question)
        return self.value(self._answers[question])

    def knows(self, question: str) -> bool:
        """Check whether an answer to a question is recorded up to now."""
        self._read_answers()
        return question in self._answers

    def was_asked(self, question: str) -> bool:
        """Check whether an answer to a question is recorded anywhere in the run."""
        return any(line.event == "answer" and line.record.get("asked") == question for line in self.lines)

    def next_answer(self, question: str, find: Callable[[], Any]) -> Any:
        """The next recorded answer."""
        self._read_answers()
        lines = self._series.get(question, [])
        if not lines:
            self._unknown(question)
        return self.value(lines.pop(0))

    def sample(self, fluent: BaseFluent[Any], read: Callable[[], Any]) -> Any:
        """The value recorded for this step."""
        node, number = self.keys.of(fluent) or (None, 0)  # modules are not executed, so their fluents are not read here
        lines = self._worlds.get((None if node is None else node.path, number), [])
        place = bisect_right(lines, self.scheduler.now, key=lambda line: line.step)
        if not place:
            self._unknown(f"the value of {fluent}")
        return self.value(lines[place - 1])

    def call(self, node: Node, number: int, function: Callable[[], Any]) -> tuple[int, Callable[[], Any]]:
        """The recorded number of a call, and a function that returns its recorded result."""
        line = self.next()
        if line is not None and line.event == "called" and line.path == node.path:
            number = int(line.record.get("call", number))
        return number, lambda: self.next_answer(f"call {number}", function)

    def body(self, node: Node, body: Body) -> Body:
        """Choose the body; a branch that a resumed run began again waits for that record."""
        place = self._again.get(node.path) if self._again and isinstance(node, Task) else None
        return body if place is None else partial(self._later, place, body)

    async def _later(self, place: int, body: Body) -> Any:
        await self.turn(place, behind=2)  # the record "resumed", and the end of the last completed step
        return await body()

    def step_ends(self, step: int) -> bool:
        """False, as the host of the replay advances time."""
        return False

    def attach(self, scheduler: Scheduler) -> None:
        """Set the scheduler of the replay, and collect the recorded values of world fluents."""
        self.scheduler = scheduler
        self.keys = FluentKeys(scheduler)
        self._worlds: dict[tuple[str | None, int], list[Line]] = {}
        for line in self.lines:
            if line.event == "world":
                number = line.record.get("number", 0)
                if type(number) is not int:
                    raise ValueError(f"line {line.number}: number has to be a whole number, not {str(number)[:40]}")
                self._worlds.setdefault((line.path, number), []).append(line)

    def _unknown(self, question: str) -> None:
        if self.next() is not None:
            self.differ(f"a question that was not asked: {question}")
        self.over = True
        raise ReplayOver

    def value(self, line: Line, shown: Callable[[Line], Any] = lambda line: line.record["lost"]) -> Any:
        """Restore the value of a record, or raise its failure; ``shown`` describes a value that could not be stored."""
        if "lost" in line.record:
            return Opaque(shown(line))
        try:
            return value_in(line)
        except DamagedTrace as damage:
            self.difference = Different(f"line {line.number} is damaged: {damage}", line.number, dict(line.record))
            self.over = True
            raise ReplayOver from None


class ReplayHost:
    """Host that advances from one recorded step to the next."""

    jumps = True

    def __init__(self, rate: int, trace: ReplayCheck) -> None:
        self.rate = checked(VIRTUAL_HOST, rate, None)
        self.watchdog = None
        self._trace = trace
        self._now = 0

    def advance(self, steps: int) -> int:
        """Advance to the next recorded step, by at most ``steps``; return the number of steps passed."""
        trace = self._trace
        line = trace.next()
        if trace.over or line is None or line.event == "drained":
            trace.over = True
            raise ReplayOver
        if line.step <= self._now:
            if line.event == "interrupted":
                trace.scheduler.interrupts += 1
                return 0
            trace.differ(f"nothing: the plan waits, at step {self._now}")
            raise ReplayOver
        after = trace.step_after(self._now)
        passed = steps if after is None else min(steps, after - self._now)
        self._now += passed
        return passed


class RecordedOrder:
    """Schedule of a replay: first come, first served, but by the records where the place in the queue is not known.

    It is not known of tasks of process modules, as a request is repeated without the waits inside it. What such a task
    wakes, and what that wakes in turn, has no known place either: in the run, a task that is in front of it now may
    have gone on first, without a record, and have come back into the queue before it. With ``all_`` no place is known.
    """

    def __init__(self, trace: ReplayCheck, *, all_: bool) -> None:
        self._trace = trace
        self._all = all_
        self.modules: set[str] = set()
        """Paths of the tasks that execute process modules."""
        self._woken: set[Task] = set()
        """Tasks whose place is not known, as the task that has woken them last had none."""

    def woken(self, task: Task, by: Task | None) -> None:
        """Register that a task enters the queue, woken by another one; None for timers and decisions of constructs."""
        if by is not None and self._floats(by):
            self._woken.add(task)
        else:
            self._woken.discard(task)

    def _floats(self, task: Task) -> bool:
        """Check whether the place of a task in the queue is not known."""
        return task in self._woken or task.path in self.modules

    def choose(self, ready: Sequence[Task]) -> int:
        """Choose the innermost task around the next record if its place is not known, else the first task.

        If that task has a known place, only such tasks can be in front of it. If it is not ready, another one has to go
        on first, without a record: the first.
        """
        line = self._trace.next()
        if line is None or line.path is None:
            return 0
        best, length = 0, -1
        for place, task in enumerate(ready):
            path = task.path
            if len(path) > length and (line.path == path or line.path.startswith(f"{path}/")):
                best, length = place, len(path)
        if length < 0 or self._all or self._floats(ready[best]):
            return best
        return next(place for place, task in enumerate(ready) if not self._floats(task))


class ReplayScheduler(Scheduler):
    """State of a replay; it tells the order which task wakes which."""

    def __init__(self, host: ReplayHost, order: RecordedOrder, *, seed: int, observer: ReplayCheck) -> None:
        super().__init__(host, seed=seed, choice=order, observer=observer)
        self._order = order

    def enqueue(self, task: Task) -> None:
        """Put a task into the run queue, unless it is held."""
        self._order.woken(task, self.current)
        super().enqueue(task)
