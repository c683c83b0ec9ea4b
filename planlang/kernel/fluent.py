"""Fluents: values that tasks wait for, and expressions over them.

An expression is lazy: its value is computed from the current values of its sources whenever it is read, so it never
shows a mixture of old and new. Waiting is latched: the first true value set while a task waits ends the wait.
"""

from __future__ import annotations

import operator
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from planlang.kernel.park import checkpoint, deliver, here, park, running
from planlang.kernel.suspension import Recheck

if TYPE_CHECKING:
    from planlang.kernel.scheduler import Scheduler
    from planlang.kernel.task import Task

T = TypeVar("T")
MISSED = ("never", "once", "always")


class _Tracked(threading.local):
    reads: dict[Source[Any], None] | None = None


tracked = _Tracked()
"""Notes which fluents are read, while ``reads`` is not None."""


class Signal(Generic[T]):
    """Something with a value that can be waited for: a fluent or an expression over fluents."""

    name: str | None = None

    @property
    def value(self) -> T:
        """The current value."""
        raise NotImplementedError

    def read(self) -> T:
        """The value, world fluents read anew instead of as sampled."""
        return self.value

    def sources(self) -> dict[Source[Any], None]:
        """The fluents whose change may change the value."""
        raise NotImplementedError

    def arm(self) -> None:
        """A wait begins."""

    def consume(self) -> None:
        """A wait has ended with a value."""

    def __bool__(self) -> bool:
        raise TypeError(f"the truth of {self} is ambiguous: write .value for now, or wait_for(...) it")

    def __str__(self) -> str:
        return self.name or type(self).__name__.lower()

    def __repr__(self) -> str:
        return f"<{self}>"

    def __hash__(self) -> int:
        return id(self)  # identity, never used for order

    def __eq__(self, other: object) -> Signal[bool]:  # type: ignore[override]
        return Expression(operator.eq, "==", self, other)

    def __ne__(self, other: object) -> Signal[bool]:  # type: ignore[override]
        return Expression(operator.ne, "!=", self, other)

    def __lt__(self, other: object) -> Signal[bool]:
        return Expression(operator.lt, "<", self, other)

    def __le__(self, other: object) -> Signal[bool]:
        return Expression(operator.le, "<=", self, other)

    def __gt__(self, other: object) -> Signal[bool]:
        return Expression(operator.gt, ">", self, other)

    def __ge__(self, other: object) -> Signal[bool]:
        return Expression(operator.ge, ">=", self, other)

    def __add__(self, other: object) -> Signal[Any]:
        return Expression(operator.add, "+", self, other)

    def __radd__(self, other: object) -> Signal[Any]:
        return Expression(operator.add, "+", other, self)

    def __sub__(self, other: object) -> Signal[Any]:
        return Expression(operator.sub, "-", self, other)

    def __rsub__(self, other: object) -> Signal[Any]:
        return Expression(operator.sub, "-", other, self)

    def __mul__(self, other: object) -> Signal[Any]:
        return Expression(operator.mul, "*", self, other)

    def __rmul__(self, other: object) -> Signal[Any]:
        return Expression(operator.mul, "*", other, self)

    def __truediv__(self, other: object) -> Signal[Any]:
        return Expression(operator.truediv, "/", self, other)

    def __rtruediv__(self, other: object) -> Signal[Any]:
        return Expression(operator.truediv, "/", other, self)

    def __neg__(self) -> Signal[Any]:
        return Expression(operator.neg, "-", self)

    def __abs__(self) -> Signal[Any]:
        return Expression(abs, "abs", self)

    def __and__(self, other: object) -> Signal[Any]:
        return Both(None, "&", self, other)

    def __rand__(self, other: object) -> Signal[Any]:
        return Both(None, "&", other, self)

    def __or__(self, other: object) -> Signal[Any]:
        return Either(None, "|", self, other)

    def __ror__(self, other: object) -> Signal[Any]:
        return Either(None, "|", other, self)

    def __invert__(self) -> Signal[bool]:
        return Expression(operator.not_, "~", self)

    def changed(self) -> Signal[bool]:
        """True when the value has changed since this was asked, or since the last wait for it ended."""
        return Changed(self)


class Source(Signal[T]):
    """A fluent at the root of expressions: knows who waits."""

    def __init__(self) -> None:
        self._waits: dict[Recheck, None] = {}

    def sources(self) -> dict[Source[Any], None]:
        """Itself."""
        return {self: None}

    def watch(self, wait: Recheck) -> None:
        """Tell ``wait`` about changes."""
        self._waits[wait] = None

    def unwatch(self, wait: Recheck) -> None:
        """No longer tell ``wait``."""
        self._waits.pop(wait, None)

    def notify(self) -> None:
        """Let all waits look at their condition."""
        for wait in tuple(self._waits):
            wait.recheck()


class Fluent(Source[T]):
    """A value that plans set and wait for.

    ``Fluent(read=f)`` is a world fluent: it is sampled once per world step, before any task runs.
    """

    def __new__(cls, value: Any = None, name: str | None = None, *, read: Callable[[], Any] | None = None) -> Any:
        """A world fluent if ``read`` is given."""
        return object.__new__(WorldFluent if read is not None and cls is Fluent else cls)

    def __init__(self, value: T = None, name: str | None = None, *, read: Callable[[], T] | None = None) -> None:  # type: ignore[assignment]
        super().__init__()
        self.name = name
        self._value: T = value
        self.changes = 0
        """How often the value has changed."""
        self.pulses = 0
        """How often the fluent was pulsed; a change is a pulse too."""

    @property
    def value(self) -> T:
        """The current value."""
        if tracked.reads is not None:
            tracked.reads[self] = None
        return self._value

    def set(self, value: T) -> None:
        """Change the value; an equal one changes nothing."""
        if not _same(self._value, value):
            self._value = value
            self.changes += 1
            self.pulses += 1
            self.notify()

    def pulse(self) -> None:
        """Let those who wait for pulses go on, without a change."""
        self.pulses += 1
        self.notify()

    def pulsed(self, missed: str = "once") -> Signal[bool]:
        """True after a pulse.

        Pulses that come while nobody waits on this object are missed ("never" seen later), seen "once" for all, or
        "always": one wait for each.
        """
        if missed not in MISSED:
            raise ValueError(f"missed is one of {', '.join(MISSED)}, not {missed!r}")
        return Pulsed(self, missed)


class WorldFluent(Fluent[T]):
    """A value read from the world, once per world step: at its start while someone waits, else when first read."""

    def __init__(self, value: T = None, name: str | None = None, *, read: Callable[[], T]) -> None:  # type: ignore[assignment]
        super().__init__(value, name)
        self._read = read
        self.vital = True
        """Whether a wait for it keeps the run going, step by step."""
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
        """The value in the world now."""
        return self._read()

    def set(self, value: T) -> None:
        """Refused: the world sets it."""
        raise TypeError(f"{self} is read from the world and cannot be set")

    def sample(self, step: int) -> bool:
        """Read the world; True if those who wait should look."""
        scheduler = running.scheduler
        self._at = (scheduler, step) if scheduler is not None else None
        before = self._value
        try:
            self._value = self._read()
        except Exception as error:
            self._error = error
            return True
        self._error = None
        if _same(before, self._value) and (before is not self._value or isinstance(before, _FROZEN)):
            return False
        self.changes += 1
        self.pulses += 1
        return True

    def watch(self, wait: Recheck) -> None:
        """Tell ``wait`` about changes, and have the world sampled in each step."""
        super().watch(wait)
        waits = wait.scheduler.world_waits
        waits[self] = waits.get(self, 0) + 1
        wait.scheduler.vital_waits += self.vital

    def unwatch(self, wait: Recheck) -> None:
        """No longer tell ``wait``."""
        super().unwatch(wait)
        waits = wait.scheduler.world_waits
        waits[self] -= 1
        wait.scheduler.vital_waits -= self.vital
        if not waits[self]:
            del waits[self]


_FROZEN = (bool, int, float, str, type(None))


class Expression(Signal[Any]):
    """An operation on fluents and plain values."""

    def __init__(self, operation: Callable[..., Any] | None, symbol: str, *operands: object) -> None:
        self._operation = operation
        self._symbol = symbol
        self._operands = operands

    @property
    def value(self) -> Any:
        """Computed from the current values of the operands."""
        return self._compute(_value)

    def read(self) -> Any:
        """Computed from operands read anew."""
        return self._compute(_read)

    def _compute(self, get: Callable[[object], Any]) -> Any:
        assert self._operation is not None
        return self._operation(*map(get, self._operands))

    def sources(self) -> dict[Source[Any], None]:
        """All fluents below, each once."""
        found: dict[Source[Any], None] = {}
        stack: list[object] = [self]
        while stack:
            one = stack.pop()
            if isinstance(one, Expression):
                stack.extend(reversed(one._operands))
            elif isinstance(one, Signal):
                found.update(one.sources())
        return found

    def arm(self) -> None:
        """A wait begins."""
        for one in self._operands:
            if isinstance(one, Signal):
                one.arm()

    def consume(self) -> None:
        """A wait has ended with a value."""
        for one in self._operands:
            if isinstance(one, Signal):
                one.consume()

    def __str__(self) -> str:
        if len(self._operands) == 1:
            return f"{self._symbol}({self._operands[0]})"
        return f"({self._operands[0]} {self._symbol} {self._operands[1]})"


class Both(Expression):
    """``a & b``: the value of ``a`` if false, else that of ``b``."""

    def _compute(self, get: Callable[[object], Any]) -> Any:
        return get(self._operands[0]) and get(self._operands[1])


class Either(Expression):
    """``a | b``: the value of ``a`` if true, else that of ``b``."""

    def _compute(self, get: Callable[[object], Any]) -> Any:
        return get(self._operands[0]) or get(self._operands[1])


class Changed(Signal[bool]):
    """Whether a signal has changed since it was last looked at by a wait."""

    def __init__(self, signal: Signal[Any]) -> None:
        self._signal = signal
        self._seen = signal.value

    @property
    def value(self) -> bool:
        """True if the value is another than the one seen."""
        return not _same(self._seen, self._signal.value)

    def sources(self) -> dict[Source[Any], None]:
        """Those of the signal."""
        return self._signal.sources()

    def consume(self) -> None:
        """The change has been seen."""
        self._seen = self._signal.value

    def __str__(self) -> str:
        return f"a change of {self._signal}"


class Pulsed(Signal[bool]):
    """Whether a fluent was pulsed."""

    def __init__(self, fluent: Fluent[Any], missed: str) -> None:
        self._fluent = fluent
        self._missed = missed
        self._seen = fluent.pulses

    @property
    def value(self) -> bool:
        """True if there is a pulse that was not seen."""
        return self._fluent.pulses > self._seen

    def sources(self) -> dict[Source[Any], None]:
        """The fluent."""
        return self._fluent.sources()

    def arm(self) -> None:
        """What came before this wait is missed, if so chosen."""
        if self._missed == "never":
            self._seen = self._fluent.pulses

    def consume(self) -> None:
        """One pulse, or all, have been seen."""
        self._seen = self._seen + 1 if self._missed == "always" else self._fluent.pulses

    def __str__(self) -> str:
        return f"a pulse of {self._fluent}"


class FluentWait(Recheck):
    """One task's wait for a signal to become true."""

    __slots__ = ("scheduler", "signal", "task")

    def __init__(self, scheduler: Scheduler, task: Task, signal: Signal[Any]) -> None:
        self.scheduler = scheduler
        self.task = task
        self.signal = signal

    def recheck(self) -> None:
        """Wake the task if the signal is true; what reading it raises is raised in the task."""
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


_LATE = object()


async def wait_for(signal: Signal[T], timeout: float | None = None) -> T | None:
    """Wait until a fluent or expression is true; returns the first true value, or None when ``timeout`` [s] is over."""
    scheduler, task = here()
    steps = None if timeout is None else scheduler.steps(timeout)
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
    timer = None if steps is None else scheduler.deadline(task, steps, lambda: scheduler.wake(task, _LATE))
    try:
        value = await park(wait)
    finally:
        for source in sources:
            source.unwatch(wait)
        if timer is not None:
            timer.drop()
    if value is _LATE:
        return None
    signal.consume()
    return value  # type: ignore[no-any-return]


def _value(operand: object) -> Any:
    return operand.value if isinstance(operand, Signal) else operand


def _read(operand: object) -> Any:
    return operand.read() if isinstance(operand, Signal) else operand


def _same(a: object, b: object) -> bool:
    if a is b:
        return True
    try:
        return bool(a == b)
    except Exception:  # arrays and the like: not comparable as a whole
        return False
