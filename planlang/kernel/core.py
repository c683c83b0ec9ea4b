"""Core of the kernel: tasks, the state of a run with its queue, and the wait of a task.

A world step consists of rounds. In a round tasks run until none can. Then the most deeply nested constructs with newly
dead branches decide, in order of creation, and what this sets free runs in a round of its own before less deeply
nested ones decide; so what dies in one step is simultaneous at whatever depth. Deadlines fire when nothing else can
happen in the step, the most deeply nested first.

This file knows how a task gets into the queue and how it waits. ``event_loop`` takes tasks out of the queue and runs
them; ``scope`` decides about constructs; ``cancel`` evaporates and suspends; ``runner`` begins and ends a run.
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
from planlang.kernel.observer import Observer, Recorded
from planlang.kernel.signals import BaseFluent
from planlang.kernel.tree import SUCCEEDED, Node, Status
from planlang.misuse import Usage, amount, contrast

S = TypeVar("S")
SLEEP = Usage("await sleep", {"seconds": "2"})
PARKED = object()
"""Yielded by a task that waits. Anything else that reaches the event loop is a foreign awaitable's."""
ROUNDING = 1e-6
"""Parts of a step that a duration may be longer than the steps that it is given: 0.1 s at 240 Hz are 24 steps, although
``0.1 * 240`` is a little more in floating point."""


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
    """Its place among the branches of the construct, in textual order."""
    context: contextvars.Context
    """Copied from the owner's when the task begins; until then the owner waits, so that it is as at creation."""
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
    """Awaited object; its text is shown in listings."""
    woken: bool
    in_queue: bool
    value: Any
    error: BaseException | None
    """Result of the wait, returned or raised at the next resumption."""

    cancelled: bool
    doomed: bool
    thrown: bool
    """Evaporation was delivered: the task ends evaporated, whatever it returns or raises."""
    deliveries: int
    shields: int
    overrun: BaseException | None
    """Error that breaks the task off (expired bound of a shield, injected fault), raised at its next checkpoint."""

    count: int
    """Suspensions of the task itself that are not undone."""
    holds: int
    timers: list[Timer] | None
    hooks: list[Callable[[], object]] | None
    """Called on suspension, last first."""
    generators: list[Any] | None
    """Async generators that it has iterated, to be closed before it counts as dead."""
    stream: Random | None
    watched: list[BaseFluent[Status]] | None
    """Fluents that show the status, once someone has asked for one."""

    # Slots that are all filled: in Python 3.11 a default on the class is read ten times slower than a slot.
    __slots__ = tuple(__annotations__)

    def __init__(
        self, group: BaseScope | None, parent: Node | None, name: str, branch: Callable[[], Any], index: int
    ) -> None:
        # as Node.__init__, without the call
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
        self._counts = self._path = self.outcome = self.result = self.failure = self.crash = None
        self.cleanup_failures = self.coroutine = self.scope = self.wait = self.value = self.error = self.overrun = None
        self.timers = self.hooks = self.generators = self.stream = self.watched = None

    @property
    def depth(self) -> int:
        """Number of constructs around the task."""
        return 0 if self.group is None else self.group.depth

    @property
    def status(self) -> Status:
        """The state of a live task as its handles show it."""
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
    """The state of a construct at work, see :class:`planlang.kernel.scope.Scope`.

    Invariants: ``live`` holds the branches that are not dead; ``fresh`` those that died since the last decision;
    ``over`` means that the outcome is fixed and what is live is being evaporated.
    """

    scheduler: Scheduler
    owner: Task
    """The task that waits for the construct."""
    depth: int
    """Number of constructs around its branches, itself included."""
    birth: int
    live: dict[Task, None]
    fresh: list[Task]
    dirty: bool
    """It is among those that decide after this round."""
    over: bool
    complete: bool
    """All branches are dead, and the owner was woken."""
    crash: BaseException | None

    def stir(self) -> None:
        """Let it decide after this round."""
        if not self.dirty:
            self.dirty = True
            heappush(self.scheduler.dirty, (-self.depth, self.birth, self))

    def close(self) -> None:
        """Fix the outcome and evaporate what is live."""
        raise NotImplementedError

    def settle(self) -> None:
        """Decide after a round in which branches died."""
        raise NotImplementedError


class ChoiceSource(Protocol):
    """Picks among tasks that can run; its text is what the trace's header says of it."""

    def choose(self, ready: Sequence[Task]) -> int:
        """Return the place in ``ready``, two or more tasks in order of coming, of the one that runs next."""


class Scheduler:
    """The state of one run. Everything that happens is a function of plan, host, seed and choices."""

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
        """Told what happens."""
        self.recorded: Recorded | None = None
        """Asked for what comes from outside, if that is recorded or was recorded before."""
        self.on_start: Callable[[Node], object] | None = None
        """Called in its task when a node of the tree begins; what it raises is what the node fails with."""
        self.revision: Callable[[], int] | None = None
        """Source of the belief's revision in failures."""
        self.max_steps = max_steps

        self.current: Task | None = None
        self.choice = choice
        """Picks among tasks that can run; None is first come, first served."""
        self.queue: deque[Task] | list[Task] = deque() if choice is None else []
        """Tasks that can run, in order of coming. A choice takes them from anywhere, which a list does faster."""
        self.dirty: list[tuple[int, int, BaseScope]] = []
        """Constructs with newly dead branches, as a heap: the most deeply nested first, then in order of creation."""
        self.births = 0
        """Constructs so far."""
        self.resumptions = 0
        """Turns and decisions in this world step."""
        self.timers = TimerQueue()
        self.world_waits: dict[BaseFluent[Any], int] = {}
        """World fluents that someone waits for, with the number of waits."""
        self.vital_waits = 0
        """Number of these waits that keep the run going; the others are only checked when it goes on anyway."""
        self._services: dict[type, Any] = {}

        self.live = host if isinstance(host, LiveHost) else None
        """The host, if things happen to it that no task has done."""
        self.inbox = Inbox() if self.live is None else self.live.inbox
        self.awaits_threads = False
        """Some task waits for a call in a thread; on any host the inbox is then looked into."""
        self.idle = False
        """True while the host lets time pass, threads are waited for, or something takes long that may."""

        self.draining = False
        self.over = False
        self.beats = 0
        """Number of times that code that computes long has said that it goes on."""
        self.interrupts = 0
        self.heeded = 0
        """Number of interrupts that were handled."""
        self.spoilt: BaseException | None = None
        """Error outside of all tasks, as in writing the trace; raised when no task of the step can run any more."""
        self.fatal: BaseException | None = None
        """Error that ends the run, once the task in which it arose is dead."""
        self.overdue: Task | None = None
        """The task that the watchdog has interrupted."""

    # -- time

    @property
    def now(self) -> int:
        """World steps since the start."""
        return self.timers.now

    def steps(self, seconds: float, given_to: Usage = SLEEP, parameter: str = "seconds") -> int:
        """Return the number of steps that last at least ``seconds``; WrongValue if negative, infinite or NaN."""
        number = seconds if seconds.__class__ is float else amount(seconds)
        if number is not None and 0 <= number * self.rate < math.inf:
            return math.ceil(number * self.rate - ROUNDING)
        raise given_to.not_seconds(parameter, seconds)

    def alarm(self, task: Task, steps: int, fire: Callable[[], object]) -> Timer:
        """Call ``fire`` at the start of the step that is ``steps`` from now."""
        return Timer(self.timers, task, steps, fire, False)

    def deadline(self, task: Task, steps: int, fire: Callable[[], object]) -> Timer:
        """Call ``fire`` ``steps`` from now, when the tasks of that step have come to rest."""
        return Timer(self.timers, task, steps, fire, True)

    # -- tasks

    def enqueue(self, task: Task) -> None:
        """Put a task into the run queue, unless it is held."""
        task.woken = True
        if not task.holds:
            task.in_queue = True
            self.queue.append(task)

    def wake(self, task: Task, value: Any = None) -> None:
        """Let a task's wait return ``value``; ignored when it has been woken already."""
        if not task.woken:
            task.value = value
            self.enqueue(task)

    def throw(self, task: Task, error: BaseException) -> None:
        """Let a task's wait raise ``error``. It has not been woken yet: what came first counts."""
        assert not task.woken
        task.error = error
        self.enqueue(task)

    def finish(self, task: Task, outcome: Status) -> None:
        """Take note that the task is dead; its construct will decide."""
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
            task.node = group  # no longer itself: only the collector frees what refers to itself
            del group.live[task]
            group.fresh.append(task)
            if not group.dirty:
                group.stir()
        if task.watched is not None:
            task.show(outcome)

    def service(self, kind: type[S]) -> S:
        """Return the one object of a class that belongs to this run."""
        found = self._services.get(kind)
        if found is None:
            found = self._services[kind] = kind()
        return found

    # -- Ctrl-C and the watchdog

    @property
    def interrupted(self) -> bool:
        """True from a Ctrl-C until the event loop has seen it."""
        return self.interrupts != self.heeded

    def progress(self) -> tuple[int, ...]:
        """Return another value whenever the run has moved; read by the watchdog."""
        return self.timers.now, self.resumptions, self.births, self.beats


class Home:
    """The run that goes on in a thread, to be looked up from other threads."""

    scheduler: Scheduler | None = None


class _Running(threading.local):
    scheduler: Scheduler | None = None

    def __init__(self) -> None:
        self.home = Home()  # another one in each thread

    def begin(self, scheduler: Scheduler | None) -> None:
        """Note the run of this thread; None: it has ended."""
        self.scheduler = self.home.scheduler = scheduler


running = _Running()
"""The run of this thread."""


def here() -> tuple[Scheduler, Task]:
    """Return the scheduler of this thread and the task that runs."""
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
    """Return the scheduler of this thread, also where no task runs: in what a thread handed into the inbox."""
    return running.scheduler or here()[0]


@types.coroutine
def park(wait: object) -> Generator[object, Any, Any]:
    """Wait until the event loop resumes this task; returns or raises what it was woken with."""
    task = here()[1]
    task.wait = wait
    value = yield PARKED
    task.wait = None
    return value
