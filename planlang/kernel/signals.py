"""Signals, which tasks can wait for: fluents, and expressions over fluents.

An expression is lazy: whenever it is read, its value is computed from the current values of its sources, so it never
mixes old and new values. Operators make expressions; only ``.value`` is a plain value.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any, Generic, TypeVar

from planlang.misuse import Usage, WrongType, WrongValue, contrast

T = TypeVar("T")
MISSED = ("never", "once", "always")
_COMBINED = "door_open & light_on    or    if door_open.value:"
_PULSED = Usage("fluent.pulsed", {"missed": '"once"'})


Operator = Callable[["Signal[Any]", object], "Signal[Any]"]


def _binary(operation: Callable[..., Any], symbol: str) -> tuple[Operator, Operator]:
    """Make the two methods of an operator, for the signal on its left and on its right."""

    def left(self: Signal[Any], other: object) -> Signal[Any]:
        return Expression(operation, symbol, self, other)

    def right(self: Signal[Any], other: object) -> Signal[Any]:
        return Expression(operation, symbol, other, self)

    return left, right


class Signal(Generic[T]):
    """A value that tasks can wait for: a fluent or an expression over fluents."""

    name: str | None = None

    @property
    def value(self) -> T:
        """The current value."""
        raise NotImplementedError

    def read(self) -> T:
        """Compute the value from the present state of the world, not from this step's samples."""
        return self.value

    def known(self) -> T:
        """Last value that is known, without a look at the world; for a debugger."""
        raise NotImplementedError

    def sources(self) -> dict[BaseFluent[Any], None]:
        """Fluents that the value depends on, in order."""
        raise NotImplementedError

    def arm(self) -> None:
        """Prepare for a wait; called when one begins."""

    def consume(self) -> None:
        """Mark the present value as seen; called when a wait has ended with a value."""

    def __bool__(self) -> bool:
        message = (
            f"{self} is a fluent, which has no truth value of its own: combine fluents with &, | and ~ instead of and, "
            "or and not; read the current value with .value"
        )
        raise WrongType(contrast(message, "door_open and light_on    or    if door_open:", _COMBINED))

    def __str__(self) -> str:
        return self.name or type(self).__name__.lower()

    def __repr__(self) -> str:
        try:
            return f"<{self} = {self.known()!r}>"
        except Exception:  # an event, or an operation that does not take the values of the moment
            return f"<{self}>"

    def __hash__(self) -> int:
        return id(self)  # differs from run to run, so that nothing may be ordered by it

    def __eq__(self, other: object) -> Signal[bool]:  # type: ignore[override]
        return Expression(operator.eq, "==", self, other)

    def __ne__(self, other: object) -> Signal[bool]:  # type: ignore[override]
        return Expression(operator.ne, "!=", self, other)

    __lt__, __gt__ = _binary(operator.lt, "<")[0], _binary(operator.gt, ">")[0]
    __le__, __ge__ = _binary(operator.le, "<=")[0], _binary(operator.ge, ">=")[0]
    __add__, __radd__ = _binary(operator.add, "+")
    __sub__, __rsub__ = _binary(operator.sub, "-")
    __mul__, __rmul__ = _binary(operator.mul, "*")
    __truediv__, __rtruediv__ = _binary(operator.truediv, "/")
    __floordiv__, __rfloordiv__ = _binary(operator.floordiv, "//")
    __mod__, __rmod__ = _binary(operator.mod, "%")
    __pow__, __rpow__ = _binary(operator.pow, "**")
    # These two behave as `and` and `or`: the second operand is read only if the first does not decide the value.
    __and__, __rand__ = _binary(operator.and_, "&")
    __or__, __ror__ = _binary(operator.or_, "|")

    def __neg__(self) -> Signal[Any]:
        return Expression(operator.neg, "-", self)

    def __abs__(self) -> Signal[Any]:
        return Expression(abs, "abs", self)

    def __invert__(self) -> Signal[bool]:
        return Expression(operator.not_, "~", self)

    def changed(self) -> Signal[bool]:
        """Make a signal that is true if the value has changed since now, or since the last wait for the signal."""
        return Changed(self)

    def pulsed(self, missed: str = "once") -> Signal[bool]:
        """Make a signal that is true after a pulse of any source of this one; a change is a pulse too.

        ``missed`` selects how often a later wait reacts to pulses that arrive while no task waits for the signal:
        "never", "once" for all of them, or "always", once for each.
        """
        if missed not in MISSED:
            raise _PULSED.wrong("missed", missed, f"one of {', '.join(map(repr, MISSED))}", WrongValue)
        return Pulsed(self, missed)


class Wait:
    """A wait of a task for a condition that can be checked again."""

    @property
    def uninterruptible(self) -> bool:
        """True while evaporation must not reach the waiting task, as during a call in a thread."""
        return False

    def recheck(self) -> None:
        """Wake the task if its condition is true; called on changes, and when the task is no longer held."""


class BaseFluent(Signal[T]):
    """A fluent with the waits that are notified of its changes."""

    def __init__(self) -> None:
        self.pulses = 0
        """Number of pulses so far; a change is a pulse too."""
        self._waits: dict[Wait, None] = {}

    def sources(self) -> dict[BaseFluent[Any], None]:
        """Only the fluent itself."""
        return {self: None}

    def set(self, value: T) -> None:
        """Change the value."""
        raise NotImplementedError

    def sample(self, step: int) -> bool:
        """Read the world, for world fluents only; True if the waits for this fluent have to be checked."""
        raise NotImplementedError

    def watch(self, wait: Wait) -> None:
        """Notify ``wait`` of changes."""
        self._waits[wait] = None

    def unwatch(self, wait: Wait) -> None:
        """Stop notifying ``wait``."""
        self._waits.pop(wait, None)

    def notify(self) -> None:
        """Check the conditions of all waits."""
        for wait in tuple(self._waits):
            wait.recheck()


class Expression(Signal[Any]):
    """An operation on fluents and plain values."""

    def __init__(self, operation: Callable[..., Any], symbol: str, *operands: object) -> None:
        self._operation = operation
        self._symbol = symbol
        self._operands = operands

    @property
    def value(self) -> Any:
        """Computed from the current values of the operands."""
        return self._compute(_value)

    def read(self) -> Any:
        """Computed from the present state of the world."""
        return self._compute(_read)

    def known(self) -> Any:
        """Computed from the last known values of the operands."""
        return self._compute(_known)

    def _compute(self, get: Callable[[object], Any]) -> Any:
        if self._operation is operator.and_:
            return get(self._operands[0]) and get(self._operands[1])
        if self._operation is operator.or_:
            return get(self._operands[0]) or get(self._operands[1])
        return self._operation(*map(get, self._operands))

    def sources(self) -> dict[BaseFluent[Any], None]:
        """All fluents in the expression, each once."""
        sources: dict[BaseFluent[Any], None] = {}
        stack: list[object] = [self]
        while stack:  # not recursive: an expression that is built in a loop may be deeper than Python's stack
            operand = stack.pop()
            if isinstance(operand, Expression):
                stack.extend(reversed(operand._operands))
            elif isinstance(operand, Signal):
                sources.update(operand.sources())
        return sources

    def arm(self) -> None:
        """Prepare the operands for a wait."""
        for operand in self._operands:
            if isinstance(operand, Signal):
                operand.arm()

    def consume(self) -> None:
        """Mark the present values of the operands as seen."""
        for operand in self._operands:
            if isinstance(operand, Signal):
                operand.consume()

    def __str__(self) -> str:
        if self.name is not None:
            return self.name
        if len(self._operands) == 1:
            operand = self._operands[0]
            return f"{self._symbol}({operand})" if self._symbol.isalpha() else f"{self._symbol}{operand}"
        return f"({self._operands[0]} {self._symbol} {self._operands[1]})"


class Derived(Signal[bool]):
    """A signal about an event of another signal since the last wait for it."""

    def __init__(self, signal: Signal[Any]) -> None:
        self._signal = signal

    def sources(self) -> dict[BaseFluent[Any], None]:
        """The sources of the other signal."""
        return self._signal.sources()


class Changed(Derived):
    """True if another signal has changed."""

    def __init__(self, signal: Signal[Any]) -> None:
        super().__init__(signal)
        self._seen = signal.value

    @property
    def value(self) -> bool:
        """True if the value differs from the one last seen."""
        return not same(self._seen, self._signal.value)

    def consume(self) -> None:
        """Mark the present value as seen."""
        self._seen = self._signal.value

    def __str__(self) -> str:
        return f"a change of {self._signal}"


class Pulsed(Derived):
    """True if another signal was pulsed."""

    def __init__(self, signal: Signal[Any], missed: str) -> None:
        super().__init__(signal)
        self._missed = missed
        self._seen = self._count()

    def _count(self) -> int:
        return sum(source.pulses for source in self.sources())

    @property
    def value(self) -> bool:
        """True if there is an unseen pulse."""
        return self._count() > self._seen

    def arm(self) -> None:
        """Ignore earlier pulses if ``missed`` is "never"."""
        if self._missed == "never":
            self._seen = self._count()

    def consume(self) -> None:
        """Mark one pulse, or all, as seen."""
        self._seen = self._seen + 1 if self._missed == "always" else self._count()

    def __str__(self) -> str:
        return f"a pulse of {self._signal}"


def _value(operand: object) -> Any:
    return operand.value if isinstance(operand, Signal) else operand


def _read(operand: object) -> Any:
    return operand.read() if isinstance(operand, Signal) else operand


def _known(operand: object) -> Any:
    return operand.known() if isinstance(operand, Signal) else operand


def same(a: object, b: object) -> bool:
    """Check whether two values are equal; values that cannot be compared, such as arrays, differ."""
    if a is b:
        return True
    try:
        return bool(a == b)
    except Exception:  # the truth value of an array, or an error in the user's __eq__
        return False
