"""A trace that is compared, record by record, with one that was written before; and the host and order of a replay.

The records of a run are in one order, and a replay follows it: what comes from outside comes when the records say
so, and of the tasks that can run the one whose record is next runs first, where the order is not the plan's own.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from planlang.kernel.core import Scheduler, Task, here, park
from planlang.kernel.hosts import VIRTUAL_HOST, checked
from planlang.kernel.observer import Body
from planlang.kernel.primitives import pause
from planlang.kernel.signals import BaseFluent
from planlang.kernel.tree import Node
from planlang.runs.codec import Exact, encode
from planlang.runs.comparing import agree
from planlang.runs.journal import FluentKeys
from planlang.runs.recorded_run import BOOKKEEPING, DamagedTrace, Line, RecordedRun, details, value_in
from planlang.runs.trace import Different, Trace, shown


class ReplayOver(BaseException):
    """The records are at their end, or the first difference was found: nothing is compared any more."""


class Opaque(Exact):
    """A result that did not survive JSON: it can be handed on, and is shown as before."""

    __slots__ = ()


class ReplayCheck(Trace):
    """Compares what a replay writes with the records of a run.

    ``place`` is where the next record is that the plan has to write; what came from outside before it has been
    given. ``difference`` is the first one.
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
        self._heard = 0
        self._answers: dict[str, Line] = {}
        self._series: dict[str, list[Line]] = {}
        self._turns: list[tuple[int, Task]] = []
        self._again: dict[str, int] = {}
        """Paths of the steps that a resumed run began again -> place of the record that tells so."""
        for place, line in enumerate(self.lines):
            if line.event == "resumed":
                self._again.update(dict.fromkeys(map(str, line.record.get("again", ())), place))
        self._pass()

    # -- the next record

    def next(self) -> Line | None:
        """Return the next record that the plan or a process module has to write; None at the end."""
        return self.lines[self.place] if self.place < len(self.lines) else None

    def step_after(self, now: int) -> int | None:
        """Return the first step later than ``now`` of which something is recorded."""
        place = bisect_right(self.lines, now, lo=min(self.place, len(self.lines)), key=lambda line: line.step)
        return self.lines[place].step if place < len(self.lines) else None

    def take(self) -> None:
        """Go on to the record after the next, which has been written."""
        self.place += 1
        self._pass()
        due = [turn for turn in self._turns if turn[0] <= self.place]
        if due:
            self._turns = [turn for turn in self._turns if turn[0] > self.place]
            for _, task in due:
                self.scheduler.wake(task)

    def _pass(self) -> None:
        """Go on to the next record that is compared."""
        while self.place < len(self.lines):
            line = self.lines[self.place]
            if line.event not in BOOKKEEPING and line.event != "header" and (line.path or line.event in ENDINGS):
                return
            self.place += 1

    def _hear(self) -> None:
        """Note the answers that were given by now."""
        now = self.scheduler.now
        while self._heard < self.place and self.lines[self._heard].step <= now:
            line = self.lines[self._heard]
            if line.event == "answer":
                question = str(line.record.get("asked"))
                self._answers[question] = line
                self._series.setdefault(question, []).append(line)
            self._heard += 1

    async def turn(self, place: int, behind: int = 0) -> None:
        """Wait until its step has come and all records before a place have been written, and as many ``behind`` it."""
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
                self._turns = [one for one in self._turns if one is not turn]

    # -- comparing

    def write(self, step: int, event: str, node: Node | None = None, /, **more: object) -> None:
        """Compare one record."""
        if self.over or event in BOOKKEEPING or (node is None and event not in ENDINGS):
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
        """Note the first difference: what was found in place of the next record."""
        line = self.next()
        assert line is not None
        if self.difference is None and not self.over:
            recorded = {"step": line.step, "event": line.event, "path": line.path} | details(line.record)
            what = found if isinstance(found, str) else shown(found)
            message = f"line {line.number} is not repeated\n  recorded  {shown(recorded)}\n  found     {what}"
            self.difference = Different(message, line.number, recorded, found)
        self.over = True

    # -- planlang.kernel.observer.Recorded

    def answer(self, question: str, find: Callable[[], Any]) -> Any:
        """Return what was answered last."""
        if not self.knows(question):
            self._unknown(question)
        return self.value(self._answers[question])

    def knows(self, question: str) -> bool:
        """Return whether a question was asked by now."""
        self._hear()
        return question in self._answers

    def was_asked(self, question: str) -> bool:
        """Return whether a question is recorded, at any time of the run."""
        return any(line.event == "answer" and line.record.get("asked") == question for line in self.lines)

    def next_answer(self, question: str, find: Callable[[], Any]) -> Any:
        """Return the next of the answers."""
        self._hear()
        lines = self._series.get(question, [])
        if not lines:
            self._unknown(question)
        return self.value(lines.pop(0))

    def sample(self, fluent: BaseFluent[Any], read: Callable[[], Any]) -> Any:
        """Return the value that was recorded for this step."""
        node, number = self.keys.of(fluent) or (None, 0)  # a process module's own are not recorded, nor asked for here
        lines = self._worlds.get((None if node is None else node.path, number), [])
        place = bisect_right(lines, self.scheduler.now, key=lambda line: line.step)
        if not place:
            self._unknown(f"the value of {fluent}")
        return self.value(lines[place - 1])

    def call(self, node: Node, number: int, function: Callable[[], Any]) -> tuple[int, Callable[[], Any]]:
        """Return the recorded number, and a function that gives what the call gave."""
        line = self.next()
        if line is not None and line.event == "called" and line.path == node.path:
            number = int(line.record.get("call", number))
        return number, lambda: self.next_answer(f"call {number}", function)

    def body(self, node: Node, body: Body) -> Body:
        """Return the body; that of a branch that a resumed run began again waits until it did."""
        place = self._again.get(node.path) if self._again and isinstance(node, Task) else None
        return body if place is None else partial(self._later, place, body)

    async def _later(self, place: int, body: Body) -> Any:
        await self.turn(place, behind=2)  # that it was resumed, and the end of what was taken over last
        return await body()

    def step_ends(self, step: int) -> bool:
        """Return False: the host of the replay lets time pass."""
        return False

    def attach(self, scheduler: Scheduler) -> None:
        """Replay with this scheduler."""
        self.scheduler = scheduler
        self.keys = FluentKeys(scheduler)
        self._worlds: dict[tuple[str | None, int], list[Line]] = {}
        for line in self.lines:
            if line.event == "world":
                number = line.record.get("number", 0)
                if type(number) is not int:
                    raise ValueError(f"line {line.number} tells of no watch: its number is {str(number)[:40]}")
                self._worlds.setdefault((line.path, number), []).append(line)

    def _unknown(self, question: str) -> None:
        if self.next() is not None:
            self.differ(f"a question that was not asked: {question}")
        self.over = True
        raise ReplayOver

    def value(self, line: Line, shown: Callable[[Line], Any] = lambda line: line.record["lost"]) -> Any:
        """Return the value that a record tells, or raise its failure; ``shown`` tells of one that did not survive."""
        if "lost" in line.record:
            return Opaque(shown(line))
        try:
            return value_in(line)
        except DamagedTrace as damage:
            self.difference = Different(f"line {line.number} is damaged: {damage}", line.number, dict(line.record))
            self.over = True
            raise ReplayOver from None


ENDINGS = frozenset({"interrupted", "drained"})


class ReplayHost:
    """Time as the records say: from one recorded step to the next."""

    jumps = True

    def __init__(self, rate: int, trace: ReplayCheck) -> None:
        self.rate = checked(VIRTUAL_HOST, rate, None)
        self.watchdog = None
        self._trace = trace
        self._now = 0

    def advance(self, steps: int) -> int:
        """Go on to the next step of which something is recorded, at most ``steps``; returns how many have passed."""
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
    """Lets the task whose record is next run first, if it is a process module's; with ``all_``, whosever it is."""

    def __init__(self, trace: ReplayCheck, *, all_: bool) -> None:
        self._trace = trace
        self._all = all_
        self.modules: set[str] = set()
        """Paths of the tasks in which process modules work."""

    def choose(self, ready: Sequence[Task]) -> int:
        """Return the place of that task."""
        line = self._trace.next()
        if line is None or line.path is None:
            return 0
        best, length = 0, -1
        for place, task in enumerate(ready):
            path = task.path
            inside = line.path == path or line.path.startswith(f"{path}/")
            if inside and len(path) > length and (self._all or path in self.modules):
                best, length = place, len(path)
        return best
