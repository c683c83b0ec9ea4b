"""Fluents: values that tasks wait for. Waits are latched: the first true value set while a task waits ends its wait."""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import partial
from typing import Any, TypeVar, overload
from weakref import WeakValueDictionary

from planlang.kernel.cancel import checkpoint, deliver
from planlang.kernel.core import Scheduler, Task, here, park, running, serving
from planlang.kernel.errors import PlanStructureError
from planlang.kernel.signals import BaseFluent, Signal, Wait, same
from planlang.kernel.tree import Node
from planlang.misuse import Usage, WrongType, contrast, written

T = TypeVar("T")
_FLUENT = Usage("Fluent", {"value": "False"}, {"name": '"door_open"', "read": "world.door_is_open"})


class _Tracked(threading.local):
    reads: dict[BaseFluent[Any], None] | None = None


tracked = _Tracked()
"""Collects the fluents that are read in this thread, while ``reads`` is not None."""


class Fluent(BaseFluent[T]):
    """A value that plans set and wait for.

    ``Fluent(read=f)`` is a world fluent: it is sampled once per world step, before any task runs.
    """

    def __new__(cls, value: Any = None, name: str | None = None, *, read: Callable[[], Any] | None = None) -> Any:
        """Make a :class:`WorldFluent` if ``read`` is given."""
        return object.__new__(WorldFluent if read is not None and cls is Fluent else cls)

    def __init__(self, value: T = None, name: str | None = None, *, read: Callable[[], T] | None = None) -> None:  # type: ignore[assignment]
        super().__init__()
        if name is not None and not isinstance(name, str):
            raise _FLUENT.wrong("name", name, "a string")
        self.name = name
        self._value: T = value
        self.changes = 0
        """Number of changes of the value so far."""
        self.born: Node | None = None
        """The node of the tree in which it was created, if the run is observed."""
        self._home = running.home
        scheduler = self._run = running.scheduler
        if scheduler is not None and scheduler.observer is not None and scheduler.current is not None:
            self.born = scheduler.current.node
        if name is not None:
            _by_name[name] = self

    @property
    def value(self) -> T:
        """The current value."""
        if tracked.reads is not None:
            tracked.reads[self] = None
        return self._value

    def known(self) -> T:
        """The value, or that of the last sample of the world."""
        return self._value

    def set(self, value: T) -> None:
        """Change the value; an equal one changes nothing.

        When another thread sets the fluent during a run, the run sets it between two steps of its tasks: in real time
        at once, in simulation only while the run waits for a call in a thread. Any other use from a thread would make a
        simulated run depend on timing, and raises PlanStructureError here and in the run. Before and after runs any
        thread may set the fluent.
        """
        if self._handed_over(self.set, value):
            return
        if not same(self._value, value):
            self._value = value
            self.changes += 1
            self.pulses += 1
            scheduler = running.scheduler
            if scheduler is not None and scheduler.observer is not None:
                scheduler.observer.changed(self)
            self.notify()

    def pulse(self) -> None:
        """Wake the tasks that wait for pulses, without a change of the value; threads as in :meth:`set`."""
        if not self._handed_over(self.pulse):
            self.pulses += 1
            self.notify()

    def watch(self, wait: Wait) -> None:
        """Notify ``wait`` of changes."""
        self._run = running.scheduler
        super().watch(wait)

    def _handed_over(self, change: Callable[..., None], *values: Any) -> bool:
        """Queue the change for a run in another thread; False if no such run uses the fluent.

        A fluent belongs to the run that created it or waited for it last. Without such a run, or after its end, it
        belongs to any run in the thread that created it.
        """
        scheduler = self._run
        if scheduler is None or scheduler.over:
            scheduler = self._home.scheduler
        if scheduler is None or scheduler is running.scheduler or scheduler.over:
            return False
        if scheduler.live is None and not scheduler.awaits_threads:
            error = PlanStructureError(
                contrast(
                    f"{self} is set from thread {threading.current_thread().name} during a simulated run; simulated "
                    "time does not wait for threads other than those of in_thread",
                    f"on_door(lambda: {self}.set(True))    with a VirtualHost or SimulationHost",
                    f"{self}.set(await in_thread(wait_for_door))    or a RealTimeHost with host.source({str(self)!r})",
                )
            )
            scheduler.spoilt = scheduler.spoilt or error
            raise error
        scheduler.inbox.put(partial(change, *values))
        return True


_by_name: WeakValueDictionary[str, Fluent[Any]] = WeakValueDictionary()


def find(name: str) -> Fluent[Any] | None:
    """Find the newest fluent with a name, if it still exists."""
    return _by_name.get(name)


class WorldFluent(Fluent[T]):
    """A value sampled from the world once per step: at its start while a task waits for it, else at the first read."""

    def __init__(self, value: T = None, name: str | None = None, *, read: Callable[[], T]) -> None:  # type: ignore[assignment]
        super().__init__(value, name)
        _FLUENT.plain("read", read, "a function that reads the world")
        self._read = read
        self.vital = True
        """True if a wait for it is no deadlock, since the world may change the value in any step."""
        self._error: Exception | None = None
        self._at: tuple[Scheduler, int] | None = None

    @property
    def value(self) -> T:
        """The value of this step's sample."""
        if tracked.reads is not None:
            tracked.reads[self] = None
        scheduler = running.scheduler
        if scheduler is None:
            return self._read()
        if self._at is None or self._at[0] is not scheduler or self._at[1] != scheduler.now:
            self.sample(scheduler.now)
        if self._error is not None:
            raise self._error
        return self._value

    def read(self) -> T:
        """Read the present value from the world."""
        scheduler = running.scheduler
        if scheduler is not None and scheduler.recorded is not None:
            value: T = scheduler.recorded.answer(f"{self} now", self._read)
            return value
        return self._read()

    def set(self, value: T) -> None:
        """Raise WrongType: only the world sets the value."""
        message = f"{self} is read from the world and cannot be set"
        raise WrongType(contrast(message, f"{self}.set({written(value)})", "Fluent(False) makes one that plans set"))

    def sample(self, step: int) -> bool:
        """Read the world; True if the waits for this fluent have to be checked."""
        scheduler = running.scheduler
        self._at = (scheduler, step) if scheduler is not None else None
        before = self._value
        try:
            if scheduler is None or scheduler.recorded is None:
                self._value = self._read()
            else:
                self._value = scheduler.recorded.sample(self, self._read)
        except Exception as error:
            self._error = error
            return True
        self._error = None
        if same(before, self._value) and (before is not self._value or isinstance(before, _FROZEN)):
            return False
        self.changes += 1
        self.pulses += 1
        return True

    def watch(self, wait: Wait) -> None:
        """Notify ``wait`` of changes, and sample the world in each step."""
        super().watch(wait)
        scheduler = serving()
        scheduler.world_waits[self] = scheduler.world_waits.get(self, 0) + 1
        scheduler.vital_waits += self.vital

    def unwatch(self, wait: Wait) -> None:
        """Stop notifying ``wait``."""
        super().unwatch(wait)
        scheduler = serving()
        waits = scheduler.world_waits
        waits[self] -= 1
        scheduler.vital_waits -= self.vital
        if not waits[self]:
            del waits[self]


_FROZEN = (bool, int, float, str, type(None))
"""Immutable types: the same object of another type may have changed inside."""


class FluentWait(Wait):
    """Wait of a task for a signal to become true."""

    __slots__ = ("scheduler", "signal", "task")

    def __init__(self, scheduler: Scheduler, task: Task, signal: Signal[Any]) -> None:
        self.scheduler = scheduler
        self.task = task
        self.signal = signal

    def recheck(self) -> None:
        """Wake the task if the signal is true; an error while reading it is raised in the task."""
        task = self.task
        if task.holds or task.woken:
            return
        try:
            value = self.signal.value
            true = bool(value)
        except Exception as error:
            self.scheduler.throw(task, error)
        else:
            if true:
                self.scheduler.wake(task, value)

    def __str__(self) -> str:
        return str(self.signal)


_TIMED_OUT = object()
_WAIT_FOR = Usage("await wait_for", {"signal": "door_open"}, {"timeout": "5"})
SIGNAL = "a fluent or an expression over fluents (pass the fluent itself: its .value is a plain value)"
"""Description of the expected argument, for messages."""


@overload
async def wait_for(signal: Signal[T], timeout: None = None) -> T: ...
@overload
async def wait_for(signal: Signal[T], timeout: float | None) -> T | None: ...
async def wait_for(signal: Signal[T], timeout: float | None = None) -> T | None:
    """Wait until a fluent or expression is true; return the first true value.

    Returns None if it is not true within ``timeout`` [s]. If a late value is a failure of the plan, use
    ``timeout(seconds, partial(wait_for, signal))`` instead, which raises Timeout.
    """
    scheduler, task = here()
    if not isinstance(signal, Signal):
        raise _WAIT_FOR.wrong("signal", signal, SIGNAL)
    steps = None if timeout is None else scheduler.steps(timeout, _WAIT_FOR, "timeout")
    if task.doomed:
        await deliver(task)
    signal.arm()
    value: Any = signal.value
    if value:
        await checkpoint()
        signal.consume()
        return value  # type: ignore[no-any-return]
    wait = FluentWait(scheduler, task, signal)
    sources = signal.sources()
    for source in sources:
        source.watch(wait)
    timer = None if steps is None else scheduler.deadline(task, steps, lambda: scheduler.wake(task, _TIMED_OUT))
    try:
        if scheduler.live is not None or scheduler.awaits_threads:
            # A thread may have set a source between reading the value and watch(): check once more.
            wait.recheck()
        value = await park(wait)
    finally:
        for source in sources:
            source.unwatch(wait)
        if timer is not None:
            timer.drop()
    if value is _TIMED_OUT:
        return None
    signal.consume()
    return value  # type: ignore[no-any-return]
