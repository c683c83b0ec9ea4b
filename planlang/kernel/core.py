"""Core of the kernel: tasks, the run queue and the other state of a run, and how a task waits.

A world step consists of rounds. In a round tasks run until none can. Then the most deeply nested constructs with newly
dead branches decide, in order of creation, and the tasks that this wakes run in a round of their own before less deeply
nested constructs decide; so all branches that die in one step die simultaneously, whatever their depth. Deadlines fire
when nothing else can happen in the step, the most deeply nested first.

This file puts tasks into the queue. ``event_loop`` takes them out and runs them; ``scope`` makes the decisions of
constructs; ``cancel`` evaporates and suspends; ``runner`` starts and ends a run.
"""

from __future__ import annotations

import contextvars
import math
import threading
import types
from collections import deque
from collections.abc import Callable, Coroutine, Generator, Sequence
from heapq import heappush
from random import Random
from typing import Any, Protocol, TypeVar

from planlang.failures import PlanFailure
from planlang.kernel.errors import PlanStructureError
from planlang.kernel.hosts import Host, Inbox, LiveHost, Timer, TimerQueue
from planlang.kernel.signals import BaseFluent
from planlang.kernel.tree import SUCCEEDED, Node, Observer, Recorded, Status
from planlang.misuse import Usage, amount, contrast

S = TypeVar("S")
SLEEP = Usage("await sleep", {"seconds": "2"})
PARKED = object()
"""Yielded by a task that waits. Anything else that reaches the event loop comes from a foreign awaitable."""
ROUNDING = 1e-6
"""Tolerance [steps] when a duration is rounded up to steps: 1.1 s at 100 Hz are 110 steps, although ``1.1 * 100`` is a
little more in floating point."""


class Task(Node):
    """One branch of a plan, driven by the event loop.

    Invariants: ``doomed`` iff evaporation reaches the task now (``cancelled`` and not shielded, or the run is drained);
    ``holds`` counts the tasks among itself and its ancestors that are suspended; a task is in the run queue iff
    ``in_queue``; ``woken`` without ``in_queue`` means woken while held.
    """

    group: BaseScope | None
    """The construct whose branch it is; None for the top-level task."""
    branch: Callable[[], Any]
    index: int
    """Index among the branches of the construct, in textual order."""
    context: contextvars.Context
    """Copy of the owner's context, made when the task begins. The owner waits, so it has not changed since creation."""
    begun: bool
    dead: bool
    outcome: Status | None
    result: Any
    failure: PlanFailure | None
    crash: BaseException | None
    """A programming error that left the task."""
    cleanup_failures: list[PlanFailure] | None
    """Plan failures that left the task, or constructs in it, after it was evaporated."""

    coroutine: Coroutine[Any, Any, Any] | Generator[Any, Any, Any] | None
    scope: BaseScope | None
    """The construct whose branches this task waits for."""
    node: Node
    """The innermost open node of this task."""
    wait: object
    """Awaited object; its ``str`` is shown in listings."""
    woken: bool
    in_queue: bool
    value: Any
    error: BaseException | None
    """Result of the wait, or error to raise, at the next resumption."""

    cancelled: bool
    doomed: bool
    thrown: bool
    """Evaporated was raised in the task: it ends evaporated, whatever it returns or raises."""
    deliveries: int
    shields: int
    overrun: BaseException | None
    """Error to raise at the next checkpoint: the expired time limit of a shield, or an injected fault."""

    count: int
    """Suspensions of the task itself, not of its ancestors, that are in force."""
    holds: int
    timers: list[Timer] | None
    hooks: list[Callable[[], object]] | None
    """Called on suspension, last first."""
    generators: list[Any] | None
    """Async generators that the task iterates; those left open are closed before it counts as dead."""
    stream: Random | None
    watched: list[BaseFluent[Status]] | None
    """Fluents that show the status; None until one is requested."""

    # All slots are set in the constructor: in Python 3.11 a class-level default is read ten times slower than a slot.
    __slots__ = tuple(__annotations__)

    def __init__(
        self, group: BaseScope | None, parent: Node | None, name: str, branch: Callable[[], Any], index: int
    ) -> None:
        # Node.__init__ written out, as a call costs time in wide constructs
        self.parent = parent
        self.kind = "branch"
        self.base_name = name
        self.ordinal = 1
        self.number = 0
        self.written = ""
        if parent is not None:
            counts = parent._counts
            if counts is None:
                parent._counts = {name: 1}
            elif name in counts:
                self.ordinal = counts[name] = counts[name] + 1
            else:
                counts[name] = 1
        self.group = group
        self.branch = branch
        self.index = index
        self.node = self
        self.begun = self.dead = self.woken = self.in_queue = self.cancelled = self.doomed = self.thrown = False
        self.deliveries = self.shields = self.count = self.holds = 0
        self._counts = self._before = self._path = self.outcome = self.result = self.failure = self.crash = None
        self.cleanup_failures = self.coroutine = self.scope = self.wait = self.value = self.error = self.overrun = None
        self.timers = self.hooks = self.generators = self.stream = self.watched = None

    @property
    def depth(self) -> int:
        """Number of constructs around the task."""
        return 0 if self.group is None else self.group.depth

    @property
    def status(self) -> Status:
        """State of a live task as shown by its handles."""
        if self.cancelled:
            return Status.EVAPORATING
        if self.holds:
            return Status.SUSPENDED
        return Status.RUNNING if self.begun else Status.CREATED

    def show(self, status: Status) -> None:
        """Set the fluents that show the status."""
        for fluent in self.watched or ():
            fluent.set(status)


class BaseScope(Node):
    """State of a running construct, see :class:`planlang.kernel.scope.Scope`.

    Invariants: ``live`` holds the branches that are not dead; ``fresh`` those that died since the last decision;
    ``over`` means that the outcome is fixed and the live branches are being evaporated.
    """

    scheduler: Scheduler
    owner: Task
    """The task that waits for the construct."""
    depth: int
    """Number of constructs around its branches, including itself."""
    birth: int
    live: dict[Task, None]
    fresh: list[Task]
    dirty: bool
    """It is scheduled to decide after this round."""
    over: bool
    complete: bool
    """All branches are dead, and the owner was woken."""
    crash: BaseException | None

    def stir(self) -> None:
        """Schedule a decision after this round."""
        # Deepest first: par inside race has to tell the race that it failed before the race asks who ended. Depths, not
        # the tree, are compared, because scopes of one depth never contain each other, and the order of their creation
        # is the same in each run.
        if not self.dirty:
            self.dirty = True
            heappush(self.scheduler.dirty, (-self.depth, self.birth, self))

    def close(self) -> None:
        """Fix the outcome and evaporate the live branches."""
        raise NotImplementedError

    def settle(self) -> None:
        """Decide after a round in which branches died."""
        raise NotImplementedError


class ChoiceSource(Protocol):
    """Chooses the next task to run; its ``str`` is written into the header of the trace."""

    def choose(self, ready: Sequence[Task]) -> int:
        """Choose the index in ``ready``, two or more tasks in order of arrival, of the task to run next."""


class Scheduler:
    """State of one run. Everything that happens is a function of plan, host, seed and choices."""

    def __init__(
        self,
        host: Host,
        *,
        seed: int = 0,
        choice: ChoiceSource | None = None,
        observer: Observer | None = None,
        max_steps: int | None = None,
    ) -> None:
        self.host = host
        self.rate = host.rate
        self.seed = seed
        self.observer = observer
        """Receives the events of the run."""
        self.recorded: Recorded | None = None
        """Supplies inputs from outside the run, if they are recorded or repeated."""
        self.on_start: Callable[[Node], object] | None = None
        """Called in the task when a node of the tree begins; if it raises, the node fails with that error."""
        self.revision: Callable[[], int] | None = None
        """Revision number of the belief state, stored in failures."""
        self.max_steps = max_steps

        self.current: Task | None = None
        self.choice = choice
        """Chooses the next task to run; None is first come, first served."""
        self.queue: deque[Task] | list[Task] = deque() if choice is None else []
        """Run queue in order of arrival. A choice removes tasks from the middle, which is faster in a list."""
        self.dirty: list[tuple[int, int, BaseScope]] = []
        """Constructs with newly dead branches, as a heap: the most deeply nested first, then in order of creation."""
        self.births = 0
        """Number of constructs created so far."""
        self.resumptions = 0
        """Number of resumptions and decisions in this world step."""
        self.timers = TimerQueue()
        self.world_waits: dict[BaseFluent[Any], int] = {}
        """Number of waits for each world fluent; only fluents with waits are sampled in each step."""
        self.vital_waits = 0
        """Number of these waits that prevent a deadlock; the others do not keep a run going by themselves."""
        self._services: dict[type, Any] = {}

        self.live = host if isinstance(host, LiveHost) else None
        """The host, if other threads may act on the run through it."""
        self.inbox = Inbox() if self.live is None else self.live.inbox
        self.awaits_threads = False
        """A task waits for a call in a thread; the inbox is then read on any host."""
        self.idle = False
        """True while the watchdog must not count: during steps of the host, waits for threads, and :func:`unwatched`
        code."""

        self.draining = False
        self.over = False
        self.beats = 0
        """Number of signs of life of long computations."""
        self.interrupts = 0
        self.heeded = 0
        """Number of interrupts that were handled."""
        self.spoilt: BaseException | None = None
        """Error outside all tasks, such as a trace that cannot be written; ends the run at the end of the step."""
        self.fatal: BaseException | None = None
        """Error of a task that ends the whole run."""
        self.overdue: Task | None = None
        """The task that the watchdog interrupted."""

    # -- time

    @property
    def now(self) -> int:
        """World steps since the start."""
        return self.timers.now

    def steps(self, seconds: float, given_to: Usage = SLEEP, parameter: str = "seconds") -> int:
        """Convert a duration to steps, rounded up; WrongValue if negative, infinite or NaN."""
        number = seconds if seconds.__class__ is float else amount(seconds)
        if number is not None and 0 <= number * self.rate < math.inf:
            return math.ceil(number * self.rate - ROUNDING)
        raise given_to.not_seconds(parameter, seconds)

    def alarm(self, task: Task, steps: int, fire: Callable[[], object]) -> Timer:
        """Call ``fire`` after ``steps``, at the start of that step."""
        return Timer(self.timers, task, steps, fire, False)

    def deadline(self, task: Task, steps: int, fire: Callable[[], object]) -> Timer:
        """Call ``fire`` after ``steps``, when no task of that step can run any more."""
        return Timer(self.timers, task, steps, fire, True)

    # -- tasks

    def enqueue(self, task: Task) -> None:
        """Put a task into the run queue, unless it is held."""
        task.woken = True
        if not task.holds:
            task.in_queue = True
            self.queue.append(task)

    def wake(self, task: Task, value: Any = None) -> None:
        """Make a task's wait return ``value``; ignored if the task has been woken already."""
        if not task.woken:
            task.value = value
            self.enqueue(task)

    def throw(self, task: Task, error: BaseException) -> None:
        """Make a task's wait raise ``error``. The task must not have been woken already."""
        assert not task.woken
        task.error = error
        self.enqueue(task)

    def finish(self, task: Task, outcome: Status) -> None:
        """Mark a task as dead and let its construct decide."""
        task.outcome = outcome
        task.dead = True
        task.coroutine = None
        task.wait = None
        group = task.group
        if self.observer is not None:
            error = None if outcome is SUCCEEDED else task.crash or task.failure
            if error is None and task.cleanup_failures:
                error = task.cleanup_failures[0]
            self.observer.ended(self.timers.now, task, outcome, task.result, error)
        if group is not None:
            task.node = group  # breaks the cycle of a task that refers to itself, so that it is freed at once
            del group.live[task]
            group.fresh.append(task)
            if not group.dirty:
                group.stir()
        if task.watched is not None:
            task.show(outcome)

    def service(self, kind: type[S]) -> S:
        """Look up the run's only object of a class, created at the first request."""
        service = self._services.get(kind)
        if service is None:
            service = self._services[kind] = kind()
        return service

    # -- Ctrl-C and the watchdog

    @property
    def interrupted(self) -> bool:
        """True from a Ctrl-C until the event loop has handled it."""
        return self.interrupts != self.heeded

    def progress(self) -> tuple[int, ...]:
        """Counters that change whenever the run makes progress, for the watchdog."""
        return self.timers.now, self.resumptions, self.births, self.beats


class Home:
    """Run of a thread, as seen from other threads; None between runs."""

    scheduler: Scheduler | None = None


class _Running(threading.local):
    scheduler: Scheduler | None = None

    def __init__(self) -> None:
        self.home = Home()  # one per thread, since this is called once in each

    def begin(self, scheduler: Scheduler | None) -> None:
        """Set the run of this thread; None when it has ended."""
        self.scheduler = self.home.scheduler = scheduler


running = _Running()
"""The run of this thread."""


def here() -> tuple[Scheduler, Task]:
    """Find the scheduler of this thread and its running task; PlanStructureError outside a plan."""
    scheduler = running.scheduler
    if scheduler is None or scheduler.current is None:
        raise PlanStructureError(
            contrast(
                "no plan is running in this thread; the plan language works only inside planlang.run()",
                "asyncio.run(serve()), in_thread(serve), or a thread of your own",
                "run(serve, host=VirtualHost())    or, inside a plan, await serve()",
            )
        )
    return scheduler, scheduler.current


def serving() -> Scheduler:
    """Find the scheduler of this thread, even between tasks, as in calls from the inbox."""
    return running.scheduler or here()[0]


@types.coroutine
def park(wait: object) -> Generator[object, Any, Any]:
    """Wait until the event loop resumes this task; return the value, or raise the error, that it was woken with."""
    task = here()[1]
    task.wait = wait
    value = yield PARKED
    task.wait = None
    return value
