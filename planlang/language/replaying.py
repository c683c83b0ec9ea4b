"""Replay of a run from its trace: the plan is executed again on its recorded inputs.

Nothing moves and no real time passes: the answers of the executive, the results of process modules, the values of world
fluents and the results of calls in threads come from the trace. The first record that the plan does not write again
shows where it would act differently now.
"""

from __future__ import annotations

import contextvars
from collections.abc import Awaitable, Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from typing import Any, NoReturn, cast

from planlang.designators import Action
from planlang.faults.named import NamedFault, WrongFault
from planlang.faults.steps import FAULT, stated_failure
from planlang.kernel import shield
from planlang.kernel.core import here, park
from planlang.kernel.errors import DeadlockError, Evaporated
from planlang.kernel.tree import Node
from planlang.language.budgets import charge
from planlang.language.executive import Executive, RecordedExecutive
from planlang.language.resources import Arbiter, Lease, holding
from planlang.language.running import inside_of
from planlang.misuse import Usage
from planlang.records import dataclass
from planlang.runs import Different, RecordedRun
from planlang.runs.codec import failure_class
from planlang.runs.recorded_run import BOOKKEEPING, Line
from planlang.runs.replay_check import RecordedOrder, ReplayCheck, ReplayHost, ReplayOver, ReplayScheduler


@dataclass(frozen=True)
class Replay:
    """Result of a replay: ``lines`` of the ``of`` records were repeated."""

    difference: Different | None
    lines: int
    of: int
    outcome: str | None
    """Outcome of the recorded run; None if the trace ends before the plan."""

    @property
    def equal(self) -> bool:
        """True if all records were repeated."""
        return self.difference is None

    def __str__(self) -> str:
        if self.difference is None:
            end = "" if self.outcome is not None else ", and the trace ends before the plan"
            return f"equal to the end: {self.of} lines{end}"
        return str(self.difference)


_REPLAY = Usage("replay", {"plan": "serve", "recorded": "recorded"})


def replay(plan: Callable[[], Awaitable[Any]], recorded: RecordedRun) -> Replay:
    """Run a plan on the recorded inputs of an earlier run, and compare them up to the first difference.

    Raises ValueError if the run cannot be replayed: it was not ``resumable``, it was in real time, or an older planlang
    wrote it.
    """
    _REPLAY.branch("plan", plan)
    recorded.check_repeatable()
    header = recorded.header
    rate, seed, schedule = header.get("rate"), header.get("seed"), header.get("schedule")
    if header.get("resumable") is not True:
        raise ValueError("the trace does not contain the plan's inputs: it was not written with resumable=True")
    if header.get("real_time"):
        raise ValueError(
            "a run in real time can be resumed, but not replayed: its trace does not contain the actions of threads"
        )
    if type(rate) is not int or type(seed) is not int:
        raise ValueError("the header of the trace has no rate and seed")
    trace = ReplayCheck(recorded)
    order = RecordedOrder(trace, all_=schedule is not None)
    scheduler = ReplayScheduler(ReplayHost(rate, trace), order, seed=seed, observer=trace)
    trace.attach(scheduler)
    scheduler.recorded = trace
    scheduler.on_start = partial(_fail_again, trace)
    executive = _ReplayedExecutive(trace, order) if trace.was_asked("modules") else None
    try:
        contextvars.copy_context().run(inside_of, scheduler, plan, executive)
    except DeadlockError as error:
        line = trace.next()
        if line is not None and line.event != "drained":
            trace.differ(f"nothing: {error}")
        trace.over = True
    except (ReplayOver, KeyboardInterrupt, Exception):  # the outcome of the plan is compared in its records
        pass
    if not trace.over and trace.next() is not None:
        trace.differ("nothing: the plan has ended")
    of = len(recorded.lines)
    last = None if trace.difference is None else trace.difference.line
    return Replay(trace.difference, of if last is None else last - 1, of, recorded.outcome)


def _fail_again(trace: ReplayCheck, node: Node) -> None:
    """Let a step fail as it begins, if it was stated to fail there in the recorded run."""
    line = trace.next()
    if line is not None and (line.event, line.path) == (FAULT, node.path):
        stated = str(line.record.get("fault"))
        trace.write(here()[0].now, FAULT, node, fault=stated)
        with suppress(WrongFault):  # a damaged trace: the end of the step is the first difference
            raise stated_failure(NamedFault.read(stated))()


class _ReplayedExecutive(RecordedExecutive):
    """Executive that only has recorded answers."""

    def __init__(self, trace: ReplayCheck, order: RecordedOrder) -> None:
        super().__init__(cast(Executive, None), trace)
        self._trace = trace
        self._order = order

    @property
    def modules(self) -> Sequence[_ReplayedModule]:
        """Stand-ins for the recorded process modules."""
        return [
            _ReplayedModule(str(name), tuple(actions), tuple(map(failure_class, failures)), self._trace, self._order)
            for name, actions, failures in self._trace.answer("modules", _nothing)
        ]

    # For an action that was not performed before, these two questions have no recorded answer. Any answer will do, as
    # the start of that action is the difference to report.

    def ancestors(self, action_type: str) -> Sequence[str]:
        """The recorded superclasses, by default only the class itself."""
        return super().ancestors(action_type) if self._trace.knows(f"ancestors of {action_type}") else (action_type,)

    def releases(self, action: Action) -> bool:
        """The recorded answer, by default False."""
        return self._trace.knows(f"{action} releases") and super().releases(action)

    def record(self, write: Callable[[str, Mapping[str, Any]], None]) -> None:
        """Write nothing, as events of the executive are not compared."""


def _nothing() -> NoReturn:
    raise NotImplementedError  # a replay uses recorded answers only


class _ReplayedModule:
    """Process module that repeats a recorded request, with its duration, resources and result."""

    once = False

    def __init__(
        self,
        name: str,
        actions: Sequence[str],
        failures: Sequence[type[Exception]],
        trace: ReplayCheck,
        order: RecordedOrder,
    ) -> None:
        self.name, self.actions, self.failures = name, actions, failures
        self._trace, self._order = trace, order

    def performs(self, action: Action) -> bool:
        """The recorded answer, by default True."""
        question = f"{self.name} performs {action}"
        return bool(self._trace.answer(question, _nothing)) if self._trace.knows(question) else True

    def resources(self, action: Action) -> tuple[str, ...]:
        """The recorded resources, by default none."""
        question = f"resources of {self.name} for {action}"
        return tuple(self._trace.answer(question, _nothing)) if self._trace.knows(question) else ()

    async def execute(self, action: Action) -> Any:
        """Repeat the records inside the request, then return its result or raise its failure."""
        trace = self._trace
        _, task = here()
        path = task.path
        self._order.modules.add(path)
        inside, end = _request(trace, path)
        work = _Work(trace)
        ending = _cut_short(trace, inside) if end is None or trace.lines[end].event != "performed" else []
        try:
            await work.do(inside)
            while end is None or trace.lines[end].event != "performed":
                await park("its evaporation")
            await trace.turn(end)
        except Evaporated:
            with shield(), suppress(ReplayOver):
                await work.do(inside)
                await work.do(ending)
                await trace.turn(_after(trace, path))
            raise
        finally:
            work.release()
        return trace.value(trace.lines[end], lambda line: _shown_result(trace, line))


class _Work:
    """Replay of the records inside a request."""

    def __init__(self, trace: ReplayCheck) -> None:
        self._trace = trace
        self._leases: dict[tuple[str | None, tuple[str, ...]], Lease] = {}
        self._start_steps: dict[str | None, int] = {}

    async def do(self, inside: list[int]) -> None:
        """Repeat the records at these places, each in its turn, and remove them from the list."""
        trace = self._trace
        while inside:
            place = inside[0]
            await trace.turn(place)
            inside.pop(0)
            line = trace.lines[place]
            trace.take()
            if line.event == "acquired":
                await self._acquire(line)
            elif line.event == "released" and (lease := self._leases.pop(_lease_key(line), None)) is not None:
                self._arbiter.release(lease)
            elif line.record.get("kind") == "perform":
                if line.event == "started":
                    self._start_steps[line.path] = line.step
                else:
                    name = str(line.record.get("name")).partition("#")[0]
                    charge("spent", name, line.step - self._start_steps.get(line.path, line.step))

    async def _acquire(self, line: Line) -> None:
        scheduler, task = here()
        self._arbiter = scheduler.service(Arbiter)
        lease = Lease(self._arbiter, scheduler, task, _lease_key(line)[1], self._around(line.path))
        await self._arbiter.acquire(lease)
        self._leases[_lease_key(line)] = lease

    def _around(self, path: str | None) -> Lease | None:
        """Find the innermost lease around a record: of a request inside this one, or that of this one."""
        around = [key for key in self._leases if path is not None and path.startswith(f"{key[0]}/")]
        return self._leases[max(around, key=lambda key: len(str(key[0])))] if around else holding()

    def release(self) -> None:
        """Release the resources that are still held."""
        for lease in self._leases.values():
            self._arbiter.release(lease)
        self._leases.clear()


def _lease_key(line: Line) -> tuple[str | None, tuple[str, ...]]:
    return line.path, tuple(map(str, line.record.get("resources", ())))


def _request(trace: ReplayCheck, path: str) -> tuple[list[int], int | None]:
    """Find the indices of the records inside a request that begins here, and of its end; None if it has no end."""
    inside: list[int] = []
    below = f"{path}/"
    held = 0
    first = trace.place
    while first and trace.lines[first - 1].event in BOOKKEEPING:  # records of the request that the check has skipped
        first -= 1
    for place in range(first, len(trace.lines)):
        line = trace.lines[place]
        if line.path == path:
            if line.event in ("performed", "ended") or (line.event == "released" and not held):
                return inside, place
            held += {"acquired": 1, "released": -1}.get(line.event, 0)
            if line.event not in BOOKKEEPING:
                inside.append(place)
        elif line.path is not None and line.path.startswith(below) and line.event not in BOOKKEEPING:
            inside.append(place)
    return inside, None


def _cut_short(trace: ReplayCheck, inside: list[int]) -> list[int]:
    """Split off the records that the evaporation of the request has caused, which are repeated at its evaporation."""
    evaporated = {
        trace.lines[place].path: trace.lines[place].step
        for place in inside
        if trace.lines[place].record.get("status") == "evaporated"
    }
    last_step = max(evaporated.values(), default=None)
    for number, place in enumerate(inside):
        line = trace.lines[place]
        if line.event in ("released", "ended") and line.step == last_step == evaporated.get(line.path):
            ending = inside[number:]
            del inside[number:]
            return ending
    return []


def _after(trace: ReplayCheck, path: str) -> int:
    """Index of the record with which a request releases its resources."""
    for place in range(trace.place, len(trace.lines)):
        line = trace.lines[place]
        if line.path == path and line.event in ("released", "ended"):
            return place
    return len(trace.lines)


def _shown_result(trace: ReplayCheck, line: Line) -> Any:
    """Result in the record of the end, for one that could not be stored."""
    ends = [later for later in trace.lines[trace.place :] if later.path == line.path and later.event == "ended"]
    return ends[0].record.get("result") if ends else None
