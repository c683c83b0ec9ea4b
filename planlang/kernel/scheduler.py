"""The scheduler: runs tasks in rounds, lets constructs decide between rounds, and steps the host when all is at rest.

A world step consists of rounds. In a round tasks run until none can. Then the most deeply nested constructs with newly
dead branches decide, in order of creation, and what this sets free runs in a round of its own before less deeply
nested ones decide; so what dies in one step is simultaneous at whatever depth. Deadlines fire when nothing else can
happen in the step, the most deeply nested first.
"""

from __future__ import annotations

import heapq
import math
import sys
from collections import deque
from collections.abc import AsyncGenerator, Callable
from contextvars import copy_context
from types import CoroutineType, FrameType
from typing import TYPE_CHECKING, Any, TypeVar

from planlang.failures import BranchEvaporated, PlanFailure
from planlang.kernel import evaporation, forgotten
from planlang.kernel.choices import Schedule, source_of
from planlang.kernel.closing import close_generators
from planlang.kernel.environment import quiet_collector, signals
from planlang.kernel.errors import (
    DeadlockError,
    Evaporated,
    NoProgress,
    PlanStructureError,
    StepLimit,
    StuckTask,
    contrast,
)
from planlang.kernel.hosts import WATCHDOG
from planlang.kernel.inbox import Inbox
from planlang.kernel.listing import blocked, explain_recursion, line_of, listing, locate
from planlang.kernel.park import PARKED, STUCK, running
from planlang.kernel.realtime import LiveHost
from planlang.kernel.task import EVAPORATED, FAILED, SUCCEEDED, Status, Task
from planlang.kernel.threads import Calls
from planlang.kernel.timers import Timer, TimerQueue
from planlang.kernel.tree import name_of
from planlang.kernel.watchdog import Overdue, Watch, watchdog, where

if TYPE_CHECKING:
    from planlang.kernel.fluent import WorldFluent
    from planlang.kernel.hosts import Host
    from planlang.kernel.scope import Scope
    from planlang.kernel.trace import Trace
    from planlang.kernel.tree import Node

S = TypeVar("S")

MAX_RESUMPTIONS = 100_000
"""Resumptions and decisions in one world step after which the run is considered to make no progress."""


def _call(task: Task) -> object:
    """Call the branch, in its task, and run to the first wait."""
    coroutine = task.branch()
    if coroutine.__class__ is not CoroutineType and not hasattr(coroutine, "send"):
        if not hasattr(coroutine, "__await__"):
            raise TypeError(
                contrast(
                    f"branch {task.path} returned {type(coroutine).__name__}, which cannot be awaited; "
                    "a branch is a function written with async def",
                    f"def {task.base_name}(): ...",
                    f"async def {task.base_name}(): ...",
                )
            )
        coroutine = coroutine.__await__()
    task.coroutine = coroutine
    return coroutine.send(None)


def _unfinished(generators: list[AsyncGenerator[Any, Any]]) -> list[AsyncGenerator[Any, Any]]:
    return [generator for generator in generators if getattr(generator, "ag_frame", None) is not None]


def _keep(generator: AsyncGenerator[Any, Any]) -> None:
    """Generators are closed by the task that iterated them; nothing is left to the collector."""


def _never_close(coroutine: object) -> None:
    """Keep a coroutine that refuses to end from being closed, which it would refuse too, even by the interpreter."""
    import ctypes

    ctypes.pythonapi.Py_IncRef(ctypes.py_object(coroutine))


class Scheduler:
    """Drives one run. Everything that happens is a function of plan, host, seed and schedule."""

    def __init__(
        self,
        host: Host,
        *,
        seed: int = 0,
        schedule: Schedule = None,
        trace: Trace | None = None,
        max_steps: int | None = None,
    ) -> None:
        self.host = host
        self.rate = host.rate
        self.seed = seed
        self.trace = trace
        self.max_steps = max_steps
        self.current: Task | None = None
        self.timers = TimerQueue()
        self.live = host if isinstance(host, LiveHost) else None
        """The host, if things happen to it that no task has done."""
        self.inbox = Inbox() if self.live is None else self.live.inbox
        self.calls = Calls(self)
        self.draining = False
        self.over = False
        self.idle = False
        """True while the host lets time pass or threads are waited for: no code of the plan runs."""
        self.interrupts = 0
        self.world_waits: dict[WorldFluent[Any], int] = {}
        """World fluents that someone waits for, with the number of waits."""
        self.vital_waits = 0
        """How many of these waits keep the run going; the others are only looked at when it goes on anyway."""
        self._services: dict[type, Any] = {}
        self._choice = source_of(schedule)
        self._queue: deque[Task] = deque()
        self._pool: list[Task] = []  # the queue when a schedule picks from it, in order of coming
        self._dirty: list[tuple[int, int, Scope]] = []
        self._births = 0
        self._resumptions = 0
        self._fatal: BaseException | None = None
        self._heeded = 0
        self._overdue: Task | None = None
        self.revision: Callable[[], int] | None = None
        """Where failures get the revision of the belief from."""
        self.on_start: Callable[[Node], object] | None = None
        """Called in its task when a node of the tree begins; what it raises is what the node fails with."""

    # -- time

    @property
    def now(self) -> int:
        """World steps since the start."""
        return self.timers.now

    def steps(self, seconds: float) -> int:
        """The number of steps that last at least ``seconds``; ValueError if negative or NaN."""
        if not seconds >= 0:
            raise ValueError(f"a duration must be a number of seconds >= 0, not {seconds!r}")
        return math.ceil(seconds * self.rate - 1e-6) if seconds < math.inf else sys.maxsize

    def alarm(self, task: Task, steps: int, fire: Callable[[], object]) -> Timer:
        """Call ``fire`` at the start of the step that is ``steps`` from now."""
        return Timer(self.timers, task, steps, fire, False)

    def deadline(self, task: Task, steps: int, fire: Callable[[], object]) -> Timer:
        """Call ``fire`` ``steps`` from now, when the tasks of that step have come to rest."""
        return Timer(self.timers, task, steps, fire, True)

    # -- tasks

    def next_birth(self) -> int:
        """A number for each scope, in order of creation."""
        self._births += 1
        return self._births

    def enqueue(self, task: Task) -> None:
        """Put a task into the run queue, unless it is held."""
        task.woken = True
        if not task.holds:
            task.in_queue = True
            if self._choice is None:
                self._queue.append(task)
            else:
                self._pool.append(task)

    def wake(self, task: Task, value: Any = None) -> None:
        """Let a task's wait return ``value``; ignored when it has been woken already."""
        if not task.woken:
            task.value = value
            self.enqueue(task)

    def throw(self, task: Task, error: BaseException) -> None:
        """Let a task's wait raise ``error``; ignored when it has been woken already."""
        if not task.woken:
            task.error = error
            self.enqueue(task)

    def release(self, owner: Task, evaporate: bool) -> None:
        """Let the owner of a completed scope go on, or deliver its evaporation."""
        if evaporate and owner.doomed:
            self.throw(owner, self.delivery(owner))
        else:
            self.wake(owner)

    def delivery(self, task: Task) -> BaseException:
        """What is raised in a doomed task."""
        if task.overrun is not None:
            error, task.overrun = task.overrun, None
            evaporation.review(self, task)
            return error
        return Evaporated()

    def note_delivery(self, task: Task) -> None:
        """Evaporation is about to be raised at a checkpoint of the running task."""
        if task.thrown and not self.draining:
            evaporation.warn_cut_short(task)
        task.thrown = True

    def evaporate(self, task: Task) -> bool:
        """Evaporate a subtree, children first; True if this changed something."""
        return evaporation.evaporate(self, task)

    def finish(self, task: Task, outcome: Status) -> None:
        """The task is dead; its construct will decide."""
        task.outcome = outcome
        task.dead = True
        task.coroutine = None
        task.wait = None
        group = task.group
        if self.trace is not None:
            error = task.crash or task.failure or task.cleanup_failure
            self.trace.ended(self.timers.now, task, outcome, task.result, error)
        if group is not None:
            task.node = group  # no longer itself: what refers to itself only the collector frees
            del group.live[task]
            group.fresh.append(task)
            if not group.dirty:
                group.dirty = True
                heapq.heappush(self._dirty, (-group.depth, group.birth, group))
        if task.watched is not None:
            task.watched.set(outcome)
        if task.listeners is not None:
            listeners, task.listeners = task.listeners, None
            for listener in listeners:
                listener()

    def service(self, kind: type[S]) -> S:
        """The one object of a class that belongs to this run."""
        found = self._services.get(kind)
        if found is None:
            found = self._services[kind] = kind()
        return found

    # -- the run

    def run(self, branch: Callable[[], Any]) -> Any:
        """Run a plan to its end and return its result, or raise what left it."""
        if running.scheduler is not None:
            raise PlanStructureError("a plan is running already; await the inner plan instead of running it")
        root = Task(None, None, name_of(branch), branch, 0)
        running.scheduler = self
        forgotten.watch()
        period = getattr(self.host, "watchdog", WATCHDOG)
        hooks = sys.get_asyncgen_hooks()
        sys.set_asyncgen_hooks(firstiter=self._adopt, finalizer=_keep)
        try:
            with quiet_collector(), signals(self._interrupt) as ours:
                self._watch = Watch(self, period, ours)
                with watchdog.watching(self._watch):
                    self.enqueue(root)
                    if self.live is not None:
                        self.live.begin()
                    try:
                        self._loop(root)
                    except BaseException as error:
                        self._drain(root, error)
                        if isinstance(error, Overdue):
                            raise self._unresponsive(period, error) from None
                        raise
        finally:
            self.over = True
            sys.set_asyncgen_hooks(*hooks)
            running.scheduler = None
            if self.trace is not None:
                self.trace.flush()
        return self._result(root)

    def _result(self, root: Task) -> Any:
        if root.crash is not None:
            raise root.crash
        if self.interrupts:
            raise KeyboardInterrupt
        if root.outcome is Status.FAILED and root.failure is not None:
            raise root.failure
        if root.outcome is Status.EVAPORATED:
            raise BranchEvaporated(path=root.path)
        return root.result

    def _loop(self, root: Task) -> None:
        while True:
            self._rest(root)
            if root.dead:
                return
            if self.interrupts != self._heeded:
                self._heed_interrupts(root)
            else:
                self._advance(root)

    def _rest(self, root: Task) -> None:
        """Rounds, decisions and deadlines until nothing more can happen in this step."""
        while True:
            self._round(root)
            if self._decide():
                continue
            if self.calls.in_flight and self.calls.collect():
                self._heed_interrupts(root)
            elif self.draining or not self.timers.expire():
                return

    def _round(self, root: Task) -> None:
        queue, pool, choice = self._queue, self._pool, self._choice
        while queue or pool:
            if self.interrupts != self._heeded:
                self._heed_interrupts(root)
            if self._resumptions > MAX_RESUMPTIONS and not self.draining:
                raise NoProgress(listing("no progress within one world step; still running", [*queue, *pool]))
            if choice is None:
                task = queue.popleft()
            else:
                task = pool.pop(choice.choose(pool) if len(pool) > 1 else 0)
            task.in_queue = False
            if task.holds or task.dead:
                continue
            self._resumptions += task.begun  # a beginning is no resumption: wide constructs are no loops
            self._resume(task)
            if self._fatal is not None:
                fatal, self._fatal = self._fatal, None
                raise fatal

    def _decide(self) -> bool:
        """Let the most deeply nested scopes with newly dead branches decide; False if there are none."""
        dirty = self._dirty
        if not dirty:
            return False
        depth = dirty[0][0]
        while dirty and dirty[0][0] == depth:
            scope = heapq.heappop(dirty)[2]
            scope.dirty = False
            self._resumptions += 1
            scope.settle()
        return True

    def _advance(self, root: Task) -> None:
        """Let the world go on by one step, or jump to the next due one."""
        timers, live = self.timers, self.live
        if live is not None and self._attend():
            return
        due = timers.next_due()
        outside = live is not None and (live.sources or self.calls.in_flight)
        if due is None and not self.vital_waits and not outside:
            raise DeadlockError(listing("nothing can go on", blocked(root)))
        # without a world only tasks change what is read: one look after they have run is enough
        looked_at = self.vital_waits or (self.world_waits and self._resumptions)
        if live is not None:
            target = timers.now + (1 if self.world_waits else self.rate)
            if due is not None:
                target = max(min(due, target), timers.now + 1)
            if self.max_steps is not None and target > self.max_steps > timers.now:
                target = self.max_steps
        elif due is None or looked_at or not self.host.jumps:
            target = timers.now + 1
        else:
            target = max(due, timers.now + 1)
        if self.max_steps is not None and target > self.max_steps:
            raise StepLimit(listing(f"more than {self.max_steps} world steps", blocked(root)))
        self.idle = True
        passed = self.host.advance(target - timers.now)
        self.idle = False
        if passed is not None:
            target = timers.now + passed
            if not passed:
                return
        timers.now = target
        self._resumptions = 0
        if self.world_waits:
            fluents = tuple(self.world_waits)
            changed = [fluent for fluent in fluents if fluent.sample(target)]
            for fluent in changed:
                fluent.notify()
        timers.ring()

    def _attend(self) -> bool:
        """Call what came into the inbox; False if there was nothing."""
        items = self.inbox.take()
        for item in items:
            item()
        return bool(items)

    # -- one task

    def _resume(self, task: Task) -> None:
        error, value = task.error, task.value
        task.woken = False
        task.error = task.value = None
        self.current = task
        try:
            coroutine = task.coroutine
            if coroutine is None:
                task.begun = True
                if task.watched is not None:
                    task.watched.set(Status.RUNNING)
                if self.trace is not None:
                    self.trace.started(self.timers.now, task)
                if self.on_start is not None:
                    self.on_start(task)
                group = task.group
                task.context = copy_context() if group is None else group.owner.context.copy()
                signal = task.context.run(_call, task)
            elif error is None:
                signal = task.context.run(coroutine.send, value)
            else:
                if error.__class__ is Evaporated:
                    task.thrown = True
                    task.deliveries += 1
                signal = task.context.run(coroutine.throw, error)
        except StopIteration as stop:
            if task.thrown or task.generators or stop.value.__class__ is CoroutineType:
                self._returned(task, stop.value)
            else:
                task.result = stop.value
                del task.context
                self.finish(task, SUCCEEDED)
        except BaseException as raised:
            self._raised(task, raised)
        else:
            if signal is not PARKED:
                self._unexpected(task, signal)
        finally:
            self.current = None

    def _returned(self, task: Task, value: Any) -> None:
        if task.generators and (left := _unfinished(task.generators)):
            self._close_first(task, left, value, None)
        elif task.thrown:
            self.finish(task, EVAPORATED)
        elif value.__class__ is CoroutineType:
            self._raised(task, forgotten.returned(task, value))
        else:
            task.result = value
            self.finish(task, SUCCEEDED)

    def _raised(self, task: Task, error: BaseException) -> None:
        if task.generators and (left := _unfinished(task.generators)):
            self._close_first(task, left, None, error)
            return
        if isinstance(error, Evaporated) and task.thrown:
            pass
        elif isinstance(error, PlanFailure):
            if error.where is None:
                locate(error, task.node, self.revision)
            if task.thrown:
                task.cleanup_failure = error
            else:
                task.failure = error
        elif isinstance(error, Overdue):
            self._fatal = error
            self._overdue = task
        elif isinstance(error, Evaporated):
            task.crash = PlanStructureError(f"{task.path} raised Evaporated itself; evaporate its handle instead")
        else:
            task.crash = error
            if isinstance(error, RecursionError):
                explain_recursion(error, task.path)
            if not isinstance(error, Exception):
                self._fatal = error
            forgotten.explain(error)
        self.finish(task, EVAPORATED if task.thrown else FAILED)

    def _unexpected(self, task: Task, signal: object) -> None:
        if signal is STUCK:
            _never_close(task.coroutine)
            line = line_of(task)
            task.crash = StuckTask(f"{task.path} does not end although it was evaporated 100 times, at {line}")
            task.generators = None
            self._fatal = self._fatal or task.crash
            self.finish(task, EVAPORATED)
            return
        where = line_of(task)
        self.throw(
            task,
            TypeError(
                contrast(
                    f"{where} awaits {type(signal).__module__}.{type(signal).__qualname__}, which belongs to another "
                    "event loop; plans await planlang's own sleep, wait_for and constructs",
                    "await asyncio.sleep(1)",
                    "await sleep(1)    after: from planlang import sleep",
                )
            ),
        )

    # -- endings

    def _adopt(self, generator: AsyncGenerator[Any, Any]) -> None:
        task = self.current
        if task is not None:
            task.generators = [*_unfinished(task.generators or []), generator]

    def _close_first(
        self, task: Task, generators: list[AsyncGenerator[Any, Any]], value: Any, error: BaseException | None
    ) -> None:
        """Close the async generators that the task left open, shielded, before it counts as dead."""
        task.generators = None
        task.node = task
        task.coroutine = close_generators(task, generators, value, error)
        task.shields += 1
        if not self.draining:
            task.doomed = False
        self.wake(task)

    @property
    def interrupted(self) -> bool:
        """True from a Ctrl-C until the scheduler has seen it."""
        return self.interrupts != self._heeded

    def progress(self) -> tuple[int, ...]:
        """Another value whenever the run has moved; read by the watchdog."""
        return self.timers.now, self._resumptions, self._births

    def _interrupt(self, frame: FrameType | None) -> None:
        """Ctrl-C, called between byte codes: only takes note. The watchdog insists where the plan does not react."""
        if not self._watch.answer(frame):
            self.interrupts += 1
            self.inbox.put(None)
            if self.interrupts > 1:
                watchdog.nudge()

    def _heed_interrupts(self, root: Task) -> None:
        """The first Ctrl-C evaporates the plan, its cleanups run; the second one drains it."""
        if self.interrupts != self._heeded and not self.draining:
            self._heeded = self.interrupts
            if self.interrupts > 1:
                raise KeyboardInterrupt
            if self.trace is not None:
                self.trace.write(self.now, "interrupted")
            self.evaporate(root)

    def _unresponsive(self, period: float | None, error: Overdue) -> NoProgress:
        task = "the run" if self._overdue is None else self._overdue.path
        return NoProgress(
            f"{task} did not reach a checkpoint for more than {period} s, at {where(error.__traceback__)}; "
            "blocking code belongs into await in_thread(f), long loops await checkpoint() now and then"
        )

    def _drain(self, root: Task, cause: BaseException) -> None:
        """Evaporate everything, shields or not; time stands still and every wait raises."""
        if self.trace is not None and not isinstance(cause, Overdue):
            self.trace.write(self.now, "drained", because=type(cause).__name__)
        self.draining = True
        self.idle = False
        self._fatal = None
        self._heeded = self.interrupts
        stuck: BaseException | None = None
        while not root.dead:
            evaporation.evaporate(self, root, through_shields=True)
            try:
                self._rest(root)
            except BaseException as error:  # of a task that would not end; all others still have to
                self._heeded = self.interrupts
                stuck = stuck or error
        if stuck is not None:
            raise stuck from cause
