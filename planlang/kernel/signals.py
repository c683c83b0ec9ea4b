"""Signals: what can be waited for, fluents at the root, and expressions over them.

An expression is lazy: its value is computed from the current values of its sources whenever it is read, so it never
shows a mixture of old and new. Operators give expressions; only ``.value`` gives values.
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
    """Return the methods of an operator with the signal on its left, and on its right."""

    def left(self: Signal[Any], other: object) -> Signal[Any]:
        return Expression(operation, symbol, self, other)

    def right(self: Signal[Any], other: object) -> Signal[Any]:
        return Expression(operation, symbol, other, self)

    return left, right


class Signal(Generic[T]):
    """Something with a value that can be waited for: a fluent or an expression over fluents."""

    name: str | None = None

    @property
    def value(self) -> T:
        """The current value."""
        raise NotImplementedError

    def read(self) -> T:
        """Return the value, world fluents read anew instead of as sampled."""
        return self.value

    def sources(self) -> dict[BaseFluent[Any], None]:
        """Return the fluents whose change may change the value."""
        raise NotImplementedError

    def arm(self) -> None:
        """Take note that a wait begins."""

    def consume(self) -> None:
        """Take note that a wait has ended with a value."""

    def __bool__(self) -> bool:
        message = (
            f"{self} is a fluent, which is not true or false itself: &, | and ~ combine fluents, not and, or and not; "
            "its current value is .value"
        )
        raise WrongType(contrast(message, "door_open and light_on    or    if door_open:", _COMBINED))

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

    __lt__, __gt__ = _binary(operator.lt, "<")[0], _binary(operator.gt, ">")[0]
    __le__, __ge__ = _binary(operator.le, "<=")[0], _binary(operator.ge, ">=")[0]
    __add__, __radd__ = _binary(operator.add, "+")
    __sub__, __rsub__ = _binary(operator.sub, "-")
    __mul__, __rmul__ = _binary(operator.mul, "*")
    __truediv__, __rtruediv__ = _binary(operator.truediv, "/")
    __floordiv__, __rfloordiv__ = _binary(operator.floordiv, "//")
    __mod__, __rmod__ = _binary(operator.mod, "%")
    __pow__, __rpow__ = _binary(operator.pow, "**")
    # These two give values as `and` and `or` do: the second operand is read only where the first does not decide.
    __and__, __rand__ = _binary(operator.and_, "&")
    __or__, __ror__ = _binary(operator.or_, "|")

    def __neg__(self) -> Signal[Any]:
        return Expression(operator.neg, "-", self)

    def __abs__(self) -> Signal[Any]:
        return Expression(abs, "abs", self)

    def __invert__(self) -> Signal[bool]:
        return Expression(operator.not_, "~", self)

    def changed(self) -> Signal[bool]:
        """Return a signal that is true when the value has changed, since now or since the last wait for it ended."""
        return Changed(self)

    def pulsed(self, missed: str = "once") -> Signal[bool]:
        """Return a signal that is true after a pulse of the fluent, or of one of an expression's; a change is a pulse.

        Pulses that come while nobody waits on this object are missed ("never" seen later), seen "once" for all, or
        "always": one wait for each.
        """
        if missed not in MISSED:
            raise _PULSED.wrong("missed", missed, f"one of {', '.join(map(repr, MISSED))}", WrongValue)
        return Pulsed(self, missed)


class Wait:
    """Something that a task, or a part of it, waits for and that may have to be looked at again."""

    @property
    def undisturbed(self) -> bool:
        """True while evaporation has to leave the waiting task alone, as during a call in a thread."""
        return False

    def recheck(self) -> None:
        """Wake the task if what it waits for is there; called on changes, and when the task is no longer held."""


class BaseFluent(Signal[T]):
    """A fluent at the root of expressions: knows who waits."""

    def __init__(self) -> None:
        self.pulses = 0
        """Number of pulses so far; a change is a pulse too."""
        self._waits: dict[Wait, None] = {}

    def sources(self) -> dict[BaseFluent[Any], None]:
        """Return itself."""
        return {self: None}

    def set(self, value: T) -> None:
        """Change the value."""
        raise NotImplementedError

    def sample(self, step: int) -> bool:
        """Read the world; True if those who wait should look. Of world fluents only."""
        raise NotImplementedError

    def watch(self, wait: Wait) -> None:
        """Tell ``wait`` about changes."""
        self._waits[wait] = None

    def unwatch(self, wait: Wait) -> None:
        """Tell ``wait`` no longer."""
        self._waits.pop(wait, None)

    def notify(self) -> None:
        """Let all waits look at their condition."""
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
        """Return the value computed from operands that are read anew."""
        return self._compute(_read)

    def _compute(self, get: Callable[[object], Any]) -> Any:
        if self._operation is operator.and_:
            return get(self._operands[0]) and get(self._operands[1])
        if self._operation is operator.or_:
            return get(self._operands[0]) or get(self._operands[1])
        return self._operation(*map(get, self._operands))

    def sources(self) -> dict[BaseFluent[Any], None]:
        """Return all fluents below, each once."""
        found: dict[BaseFluent[Any], None] = {}
        stack: list[object] = [self]
        while stack:  # no recursion: expressions that a loop has put together may be deeper than Python's stack
            one = stack.pop()
            if isinstance(one, Expression):
                stack.extend(reversed(one._operands))
            elif isinstance(one, Signal):
                found.update(one.sources())
        return found

    def arm(self) -> None:
        """Take note that a wait begins."""
        for one in self._operands:
            if isinstance(one, Signal):
                one.arm()

    def consume(self) -> None:
        """Take note that a wait has ended with a value."""
        for one in self._operands:
            if isinstance(one, Signal):
                one.consume()

    def __str__(self) -> str:
        if self.name is not None:
            return self.name
        if len(self._operands) == 1:
            operand = self._operands[0]
            return f"{self._symbol}({operand})" if self._symbol.isalpha() else f"{self._symbol}{operand}"
        return f"({self._operands[0]} {self._symbol} {self._operands[1]})"


class Derived(Signal[bool]):
    """A signal that is true when something has happened to another since a wait last looked at it."""

    def __init__(self, signal: Signal[Any]) -> None:
        self._signal = signal

    def sources(self) -> dict[BaseFluent[Any], None]:
        """Return those of the signal."""
        return self._signal.sources()


class Changed(Derived):
    """A signal that is true when another has changed."""

    def __init__(self, signal: Signal[Any]) -> None:
        super().__init__(signal)
        self._seen = signal.value

    @property
    def value(self) -> bool:
        """True if the value is another than the one seen."""
        return not same(self._seen, self._signal.value)

    def consume(self) -> None:
        """Take the current value as seen."""
        self._seen = self._signal.value

    def __str__(self) -> str:
        return f"a change of {self._signal}"


class Pulsed(Derived):
    """A signal that is true when another was pulsed."""

    def __init__(self, signal: Signal[Any], missed: str) -> None:
        super().__init__(signal)
        self._missed = missed
        self._seen = self._count()

    def _count(self) -> int:
        return sum(source.pulses for source in self.sources())

    @property
    def value(self) -> bool:
        """True if there is a pulse that was not seen."""
        return self._count() > self._seen

    def arm(self) -> None:
        """Miss what came before this wait, if so chosen."""
        if self._missed == "never":
            self._seen = self._count()

    def consume(self) -> None:
        """Take one pulse, or all, as seen."""
        self._seen = self._seen + 1 if self._missed == "always" else self._count()

    def __str__(self) -> str:
        return f"a pulse of {self._signal}"


def _value(operand: object) -> Any:
    return operand.value if isinstance(operand, Signal) else operand


def _read(operand: object) -> Any:
    return operand.read() if isinstance(operand, Signal) else operand


def same(a: object, b: object) -> bool:
    """Return whether two values are equal as a whole."""
    if a is b:
        return True
    try:
        return bool(a == b)
    except Exception:  # arrays and the like: not comparable as a whole
        return False
