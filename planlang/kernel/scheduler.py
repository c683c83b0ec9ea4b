"""The scheduler: the state of one run, and what tasks, constructs and timers ask of it.

A world step consists of rounds. In a round tasks run until none can. Then the most deeply nested constructs with newly
dead branches decide, in order of creation, and what this sets free runs in a round of its own before less deeply
nested ones decide; so what dies in one step is simultaneous at whatever depth. Deadlines fire when nothing else can
happen in the step, the most deeply nested first.

``rounds`` is that loop, ``turn`` what one task does when it is its turn, ``endings`` how a run ends.
"""

from __future__ import annotations

import math
import sys
from collections import deque
from collections.abc import Callable
from functools import partial
from types import FrameType
from typing import TYPE_CHECKING, Any, TypeVar

from planlang.kernel import closing, endings, evaporation, rounds
from planlang.kernel.choices import Schedule, source_of
from planlang.kernel.environment import quiet_collector, signals
from planlang.kernel.errors import Evaporated, PlanStructureError
from planlang.kernel.hosts import WATCHDOG
from planlang.kernel.inbox import Inbox
from planlang.kernel.park import running
from planlang.kernel.realtime import LiveHost
from planlang.kernel.task import SUCCEEDED, Status, Task
from planlang.kernel.threads import Calls
from planlang.kernel.timers import Timer, TimerQueue
from planlang.kernel.tree import name_of
from planlang.kernel.unawaited import unawaited_are_errors
from planlang.kernel.watchdog import Overdue, Watch, watchdog
from planlang.misuse import Usage, amount

if TYPE_CHECKING:
    from planlang.kernel.answers import Answers
    from planlang.kernel.fluent import WorldFluent
    from planlang.kernel.hosts import Host
    from planlang.kernel.journal import Journal
    from planlang.kernel.scope import Scope
    from planlang.kernel.trace import Trace
    from planlang.kernel.tree import Node

S = TypeVar("S")
SLEEP = Usage("await sleep", {"seconds": "2"})


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
        self.choice = source_of(schedule)
        self.queue: deque[Task] = deque()
        self.pool: list[Task] = []
        """The queue when a schedule picks from it, in order of coming."""
        self.dirty: list[tuple[int, int, Scope]] = []
        """Constructs with newly dead branches, as a heap: the most deeply nested first, then in order of creation."""
        self.births = 0
        """Constructs so far."""
        self.resumptions = 0
        """Turns and decisions in this world step."""
        self.spoilt: BaseException | None = None
        """What went wrong in no task, as in writing the trace; raised when the tasks of the step have come to rest."""
        self.fatal: BaseException | None = None
        """What has to end the run, once the task in which it arose is dead."""
        self.heeded = 0
        """How many interrupts were seen to."""
        self.overdue: Task | None = None
        """The task that the watchdog has interrupted."""
        self.watch: Watch
        """What the watchdog sees of this run."""
        self.revision: Callable[[], int] | None = None
        """Where failures get the revision of the belief from."""
        self.on_start: Callable[[Node], object] | None = None
        """Called in its task when a node of the tree begins; what it raises is what the node fails with."""
        self.answers: Answers | None = None
        """Where the plan is told what it is told from outside, if that is noted or replayed."""
        self.journal: Journal | None = None
        """Notes which steps of the plan have completed, if the run is to be resumed."""

    # -- time

    @property
    def now(self) -> int:
        """World steps since the start."""
        return self.timers.now

    def steps(self, seconds: float, given_to: Usage = SLEEP, parameter: str = "seconds") -> int:
        """The number of steps that last at least ``seconds``; WrongValue if negative, infinite or NaN."""
        number = seconds if seconds.__class__ is float else amount(seconds)
        if number is not None and 0 <= number * self.rate < math.inf:
            return math.ceil(number * self.rate - 1e-6)
        raise given_to.not_seconds(parameter, seconds)

    def alarm(self, task: Task, steps: int, fire: Callable[[], object]) -> Timer:
        """Call ``fire`` at the start of the step that is ``steps`` from now."""
        return Timer(self.timers, task, steps, fire, False)

    def deadline(self, task: Task, steps: int, fire: Callable[[], object]) -> Timer:
        """Call ``fire`` ``steps`` from now, when the tasks of that step have come to rest."""
        return Timer(self.timers, task, steps, fire, True)

    # -- tasks

    def next_birth(self) -> int:
        """A number for each scope, in order of creation."""
        self.births += 1
        return self.births

    def enqueue(self, task: Task) -> None:
        """Put a task into the run queue, unless it is held."""
        task.woken = True
        if not task.holds:
            task.in_queue = True
            if self.choice is None:
                self.queue.append(task)
            else:
                self.pool.append(task)

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
            error = None if outcome is SUCCEEDED else task.crash or task.failure or task.cleanup_failure
            self.trace.ended(self.timers.now, task, outcome, task.result, error)
        if group is not None:
            task.node = group  # no longer itself: what refers to itself only the collector frees
            del group.live[task]
            group.fresh.append(task)
            if not group.dirty:
                group.stir()
        if task.watched is not None:
            task.watched.set(outcome)

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
        with unawaited_are_errors():
            return self._run(root)

    def _run(self, root: Task) -> Any:
        running.scheduler = self
        period = getattr(self.host, "watchdog", WATCHDOG)
        hooks = sys.get_asyncgen_hooks()
        sys.set_asyncgen_hooks(firstiter=partial(closing.adopt, self), finalizer=closing.keep)
        try:
            with quiet_collector(), signals(self._interrupt) as ours:
                self.watch = Watch(self, period, ours)
                with watchdog.watching(self.watch):
                    if self.trace is not None:
                        self.trace.tell_failure(self._untold)
                    if self.journal is not None:
                        self.journal.begin(root)
                    self.enqueue(root)
                    if self.live is not None:
                        self.live.begin()
                    try:
                        rounds.loop(self, root)
                    except BaseException as error:
                        endings.drain(self, root, error)
                        if isinstance(error, Overdue):
                            raise endings.unresponsive(self, period, error) from None
                        raise
        finally:
            self.over = True
            sys.set_asyncgen_hooks(*hooks)
            running.scheduler = None
            if self.trace is not None:
                self.trace.tell_failure(None)
                self.trace.flush()
        return endings.outcome_of(self, root)

    def _untold(self, error: BaseException) -> None:
        """The trace cannot be written any further: the run ends, for nobody could tell what it did."""
        error.add_note(f"raised by the trace at world step {self.now}; the run was ended")
        self.spoilt = self.spoilt or error

    # -- Ctrl-C and the watchdog

    @property
    def interrupted(self) -> bool:
        """True from a Ctrl-C until the scheduler has seen it."""
        return self.interrupts != self.heeded

    def progress(self) -> tuple[int, ...]:
        """Another value whenever the run has moved; read by the watchdog."""
        return self.timers.now, self.resumptions, self.births

    def _interrupt(self, frame: FrameType | None) -> None:
        """Ctrl-C, called between byte codes: only takes note. The watchdog insists where the plan does not react."""
        if not self.watch.answer(frame):
            self.interrupts += 1
            self.inbox.put(None)
            if self.interrupts > 1:
                watchdog.nudge()
