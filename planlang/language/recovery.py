"""Recovery from failures: rules that match failures, handle them a limited number of times, and say what follows."""

from __future__ import annotations

import re
from collections.abc import Awaitable, Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import field
from enum import Enum
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from planlang.advice import Change
from planlang.failures import CompositeFailure, HighLevelFailure, LocationUnresolvable, PlanFailure
from planlang.kernel.core import here
from planlang.kernel.primitives import called, node, record
from planlang.language.branches import evaporating
from planlang.language.budgets import take_attempt
from planlang.misuse import Usage, WrongType, WrongValue, contrast, is_iterable, takes, written
from planlang.plan_failure import each_once, links_of
from planlang.records import dataclass

if TYPE_CHECKING:
    from planlang.kernel.hosts import Timer

T = TypeVar("T")
V = TypeVar("V")

_RECOVERY = Usage(
    "Recovery",
    {"on": "GraspMissed", "do": "look_again"},
    {
        "retries": "3",
        "within": "30",
        "alternatives": '{"grasp": lambda: ["side", "top"]}',
        "otherwise": "ObjectUnfetchable",
    },
)
_EXPLAIN = Usage("explain", {"failure": "failure"})
_WITH_FAILURE_HANDLING = Usage("await with_failure_handling", {"body": "grasp", "recovery": "Recovery(GraspMissed)"})
_ALTERNATIVES = "a mapping from keywords of the body to functions that return the values"
_RECOVERIES = "a list of recoveries"
_OTHERWISE = "None, a failure class, a function from failure to failure, or Return(value)"
_DECIDES = "async def do(failure): ...; return RETRY"
"""The right form of a recovery function, for messages."""


class _Decision(Enum):
    RETRY = "retry"
    PROPAGATE = "propagate"


RETRY = _Decision.RETRY
"""Decision of a recovery: run the body again."""
PROPAGATE = _Decision.PROPAGATE
"""Decision of a recovery: let the failure propagate to the caller."""


@dataclass(frozen=True, slots=True)
class Return(Generic[T]):
    """Decision of a recovery, or of the body of ``whenever``: end the construct with this value."""

    value: T


RecoveryResult = _Decision | Return[Any]
"""What a recovery function returns: RETRY, PROPAGATE or ``Return(value)``."""
Do = Callable[[PlanFailure], Awaitable[RecoveryResult]]
Otherwise = type[PlanFailure] | Callable[[PlanFailure], PlanFailure] | Return[Any]
_FROM_DO: Any = object()
"""Default of ``otherwise``: the attribute of ``do``, see :class:`Recovery`."""


async def retry(failure: PlanFailure) -> RecoveryResult:
    """Recovery function that only runs the body again."""
    return RETRY


@dataclass(frozen=True)
class Recovery:
    """A rule for failures of the classes ``on``: how to handle them, how often, and what follows the last attempt.

    ``do`` is an async function of the failure. It is called after the body is fully unwound, at most ``retries`` times
    for each execution of the construct, and returns a ``RecoveryResult``: RETRY, ``Return(value)`` or PROPAGATE. It is
    no longer called after ``within`` [s] of plan time, without suspensions, since the start of the construct.
    ``alternatives`` maps keyword arguments of the body to functions that return iterables: the first run gets the first
    value of each, and every retry by this recovery the next one. When retries, time or alternatives are used up,
    ``otherwise`` applies instead of ``do``: None lets the failure propagate, a failure class or a function of the
    failure makes the failure that is raised from it, and ``Return(value)`` ends the construct with a value. The default
    is the attribute ``otherwise`` of ``do``, which strategies with a fixed final failure have
    (:func:`planlang.recovery_strategy`), or None. ``attempts``, the former name of ``retries``, is still read.
    """

    on: type[PlanFailure] | tuple[type[PlanFailure], ...]
    do: Do = retry
    retries: int = field(default=1, kw_only=True)
    attempts: int | None = field(default=None, kw_only=True, repr=False, compare=False)
    within: float | None = field(default=None, kw_only=True)
    alternatives: Mapping[str, Callable[[], Iterable[Any]]] | None = field(default=None, kw_only=True)
    otherwise: Otherwise | None = field(default=_FROM_DO, kw_only=True)

    def __post_init__(self) -> None:
        _RECOVERY.branch("do", self.do)
        if not takes(self.do, 1):
            name = written(self.do)
            message = f"{name} does not take the failure; a recovery function has the failure as its only parameter"
            right = _DECIDES.replace("do(", f"{name}(" if name.isidentifier() else "do(")
            raise WrongType(contrast(message, _RECOVERY.shown("do", name), right))
        if self.otherwise is _FROM_DO:
            object.__setattr__(self, "otherwise", getattr(self.do, "otherwise", None))
        for kind in self.on if isinstance(self.on, tuple) else (self.on,):
            if not (isinstance(kind, type) and issubclass(kind, PlanFailure)):
                message = f"recovery handles plan failures; {written(kind)} is not a subclass of PlanFailure"
                raise WrongType(contrast(message, _RECOVERY.shown("on", written(kind)), _RECOVERY.shown("on")))
        if self.on == ():
            raise _RECOVERY.wrong("on", self.on, "a failure class, or a tuple with some", WrongValue)
        if self.attempts is not None:
            if self.retries != 1:
                raise _RECOVERY.refused("retries", "attempts is the former name of retries; give one", self.retries)
            object.__setattr__(self, "retries", self.attempts)
            object.__setattr__(self, "attempts", None)
        _RECOVERY.whole("retries", self.retries, 0, "times")
        if self.within is not None:
            _RECOVERY.seconds("within", self.within)
        self._check_alternatives()
        otherwise = self.otherwise
        if isinstance(otherwise, type) and not issubclass(otherwise, PlanFailure):
            raise _RECOVERY.wrong("otherwise", otherwise, _OTHERWISE)
        if otherwise is not None and not isinstance(otherwise, Return):
            _RECOVERY.plain("otherwise", otherwise, _OTHERWISE, arguments=0 if isinstance(otherwise, type) else 1)

    def _check_alternatives(self) -> None:
        if self.alternatives is None:
            return
        if not isinstance(self.alternatives, Mapping):
            raise _RECOVERY.wrong("alternatives", self.alternatives, _ALTERNATIVES)
        for key, make in self.alternatives.items():
            if not isinstance(key, str) or not callable(make):
                raise _RECOVERY.wrong("alternatives", {key: make}, _ALTERNATIVES)


_are_on: ContextVar[bool] = ContextVar("recoveries", default=True)
"""False where no recovery handles a failure."""


@contextmanager
def without_recoveries() -> Iterator[None]:
    """Let no recovery handle a failure inside, and location scopes try only their first base pose.

    What a plan without its failure handling reaches tells what that is worth.
    """
    token = _are_on.set(False)
    try:
        yield
    finally:
        _are_on.reset(token)


_further: ContextVar[int] = ContextVar("further retries", default=0)
"""How many times more each recovery may try than it states."""


@contextmanager
def trying_more(retries: int) -> Iterator[None]:
    """Let each recovery inside try so many times more than it states."""
    token = _further.set(retries)
    try:
        yield
    finally:
        _further.reset(token)


def recoveries_are_on() -> bool:
    """Check whether recoveries handle failures here."""
    return _are_on.get()


def _values(key: str, make: Callable[[], Iterable[Any]]) -> Iterator[Any]:
    values = make()
    if not is_iterable(values):
        code = written(values)
        raise _RECOVERY.wrong("alternatives", {key: make}, f"{_ALTERNATIVES}; {key!r} returned {code}")
    return iter(values)


class _Entry:
    """State of a recovery during one execution of with_failure_handling."""

    def __init__(self, recovery: Recovery) -> None:
        self.recovery = recovery
        self.used = 0
        self.late = False
        self.values: dict[str, Iterator[Any]] = {
            key: _values(key, make) for key, make in (recovery.alternatives or {}).items()
        }
        self.timer: Timer | None = None
        if recovery.within is not None:
            scheduler, task = here()
            steps = scheduler.steps(recovery.within, _RECOVERY, "within")
            self.timer = scheduler.deadline(task, steps, self._expire)

    def _expire(self) -> None:
        self.late = True

    def next_values(self) -> dict[str, Any] | None:
        """Take the next value of each alternative; None if one of them is exhausted."""
        chosen: dict[str, Any] = {}
        for key, values in self.values.items():
            try:
                chosen[key] = next(values)
            except StopIteration:
                return None
        return chosen


async def with_failure_handling(body: Callable[..., Awaitable[V]], *recoveries: Recovery) -> V:
    """Run a body; the first recovery, in textual order, that matches the class of a failure handles it.

    Retries are counted anew in each execution, so the body runs at most 1 + sum of all ``retries`` times. A failure
    of ``do`` propagates to the caller, with the original failure as its cause.
    """
    _WITH_FAILURE_HANDLING.branch("body", body)
    for recovery in recoveries:
        _WITH_FAILURE_HANDLING.instance("recovery", recovery, Recovery, "a Recovery")
    kind = "with_failure_handling"
    return await node(kind, kind, partial(_handled, body, recoveries))  # type: ignore[no-any-return]


def recovering(body: Callable[[], Awaitable[V]], recoveries: tuple[Recovery, ...]) -> Awaitable[V]:
    """Run a body with the recoveries, if any, that another construct was given."""
    if not recoveries:
        return called(body)  # type: ignore[no-any-return]
    return with_failure_handling(body, *recoveries)


def recoveries_of(usage: Usage, recoveries: Iterable[Recovery]) -> tuple[Recovery, ...]:
    """Check the argument ``recoveries`` of a construct; raises WrongType, or WrongValue for alternatives."""
    usage.iterable("recoveries", recoveries, _RECOVERIES)
    checked = tuple(recoveries)
    for recovery in checked:
        if not isinstance(recovery, Recovery):
            raise usage.wrong("recoveries", [recovery], _RECOVERIES)
        _check_keywords(usage, recovery, usage.shown("recoveries", "[Recovery(..., alternatives=...)]"))
    return checked


def check_recoveries(usage: Usage, recoveries: Iterable[Recovery]) -> None:
    """Check the recoveries after the body of a construct; raises WrongType, or WrongValue for alternatives."""
    for recovery in recoveries:
        usage.instance("recovery", recovery, Recovery, "a Recovery")
        _check_keywords(usage, recovery, usage.shown("recovery", "Recovery(..., alternatives=...)"))


def _check_keywords(usage: Usage, recovery: Recovery, wrong: str) -> None:
    if recovery.alternatives is not None:
        message = f"alternatives are keyword arguments of a body, and {usage.name} passes none to its body"
        raise WrongValue(contrast(message, wrong, "await with_failure_handling(body, Recovery(..., alternatives=...))"))


async def _handled(body: Callable[..., Awaitable[Any]], recoveries: Iterable[Recovery]) -> Any:
    entries = [_Entry(recovery) for recovery in recoveries]
    try:
        return await _attempts(body, entries)
    finally:
        for entry in entries:
            if entry.timer is not None:
                entry.timer.drop()


async def _attempts(body: Callable[..., Awaitable[V]], entries: list[_Entry]) -> Any:
    keywords: dict[str, Any] = {}
    for entry in entries:
        first = entry.next_values()
        if first is None:
            message = "alternatives need at least one value for the first run"
            raise _RECOVERY.refused("alternatives", message, entry.recovery.alternatives)
        keywords.update(first)
    attempt = 0
    while True:
        attempt += 1
        here()[1].node.begin_attempt()
        record("attempt", attempt=attempt, **({"alternatives": keywords} if keywords else {}))
        try:
            return await called(body, **keywords)
        except PlanFailure as raised:
            failure = raised
        if evaporating():
            record("recovery", decision="evaporated", failure=failure)
            raise failure
        decision = await _recover(failure, entries, keywords)
        if isinstance(decision, Return):
            return decision.value


async def _recover(failure: PlanFailure, entries: list[_Entry], keywords: dict[str, Any]) -> Return[Any] | None:
    """Handle a failure; None if the body is to run again, else the result of the construct."""
    known = enumerate(entries if recoveries_are_on() else ())
    number = next((n for n, entry in known if matches(failure, entry.recovery.on)), None)
    if number is None:
        record("recovery", decision="none", failure=failure)
        raise failure
    entry = entries[number]
    recovery = entry.recovery
    most = recovery.retries + _further.get()
    values = entry.next_values() if entry.used < most and not entry.late else None
    if values is None:
        record("recovery", recovery=number, decision="used up", used=entry.used, failure=failure)
        return _otherwise(recovery.otherwise, failure)
    entry.used += 1
    try:
        decision = await _call_do(recovery, failure)
    except PlanFailure as raised:
        record("recovery", recovery=number, decision="failed", used=entry.used, failure=raised)
        if raised is not failure and raised.__cause__ is None:
            raise raised from failure
        raise
    if isinstance(decision, Return):
        record("recovery", recovery=number, decision="return", used=entry.used, failure=failure)
        return decision
    if decision is PROPAGATE:
        record("recovery", recovery=number, decision="propagate", used=entry.used, failure=failure)
        raise failure
    if decision is not RETRY:
        message = f"the recovery for {type(failure).__name__} returned {written(decision)}; it must return "
        raise WrongType(contrast(f"{message}RETRY, PROPAGATE or Return(value)", "async def do(failure): ...", _DECIDES))
    record("recovery", recovery=number, decision="retry", used=entry.used, failure=failure)
    if evaporating():  # do() has swallowed Evaporated
        raise failure
    await take_attempt("with_failure_handling")
    keywords.update(values)
    return None


def _call_do(recovery: Recovery, failure: PlanFailure) -> Awaitable[RecoveryResult]:
    result = recovery.do(failure)
    if hasattr(result, "__await__"):
        return result
    name = type(failure).__name__
    code = result.name if isinstance(result, _Decision) else written(result)
    message = f"do of the Recovery for {name} returned {code} without being async; write it with async def"
    raise WrongType(contrast(message, _RECOVERY.shown("do", written(recovery.do)), _DECIDES))


def _otherwise(otherwise: Otherwise | None, failure: PlanFailure) -> Return[Any]:
    if isinstance(otherwise, Return):
        return otherwise
    if otherwise is None:
        raise failure
    make: Callable[[PlanFailure], PlanFailure] = getattr(otherwise, "caused_by", otherwise)
    raised = make(failure)
    if not isinstance(raised, PlanFailure):
        message = f"otherwise returned {written(raised)}; it must return a plan failure"
        wrong = _RECOVERY.shown("otherwise", "lambda failure: None")
        raise WrongType(contrast(message, wrong, _RECOVERY.shown("otherwise"))) from failure
    raise raised from failure


def explain(failure: BaseException) -> str:
    """Format a failure in several lines: where it arose in the plan, its causes, and its simultaneous failures.

    A failure that was raised while an earlier one was handled, as in a cleanup, is followed by the earlier one with
    ``after``, since that is not its cause. The first line has at most 40 words. If the cause is a
    location that could not be found, it says why, unless its own message does; the causes below do not repeat that.
    A failure that was raised again on its way to the caller is listed once.
    """
    _EXPLAIN.instance("failure", failure, BaseException, "a failure, or another exception")
    runs = _causal_runs(links_of(failure))
    message = str(failure)
    first, said = _first_sentence(message, _reason_of(runs[0]))
    lines = [f"{type(failure).__name__}: {first}" if first else type(failure).__name__]
    if not first.startswith(message):
        lines.append(f"  in full: {message}")
    lines.extend(_beside(failure, ""))
    lines.extend(f"  {sentence}" for sentence in getattr(failure, "afterwards", ()))
    links = [("because of ", link) for link in runs[0][1:]]
    links += [("because of " if number else "after ", link) for run in runs[1:] for number, link in enumerate(run)]
    for depth, (lead, link) in enumerate(links, 1):
        message, indent = str(link), "  " * depth
        if said:  # the same reason is told once
            message = "" if message == said else message.replace(f": {said}", "")
        name = type(link).__name__
        lines.append(f"{indent}{lead}{name}: {message}" if message else f"{indent}{lead}{name}")
        lines.extend(_beside(link, indent))
    return "\n".join(lines)


MOST_WORDS = 40
"""Maximum number of words in the first line of an explanation, after the class of the failure."""
_CLAUSE = re.compile(r"; | \(")


def _first_sentence(message: str, reason: str) -> tuple[str, str]:
    """Join a message and the reason to at most :data:`MOST_WORDS` words; also return the reason if it is said whole.

    What is too long is cut between clauses. Of a long reason the last clauses are kept: they say what would help.
    """
    words = message.split()
    if len(words) > MOST_WORDS:
        heads = [message[: one.start()] for one in _CLAUSE.finditer(message)]
        short = [head for head in heads if len(head.split()) <= MOST_WORDS]
        return (short[-1] if short else f"{' '.join(words[:MOST_WORDS])} ...", "")
    if not reason or reason in message:
        return message, reason
    measured, *others = clauses = reason.split("; ")
    ends = ["; ".join(clauses[first:]) for first in range(1, len(clauses))]
    for said in dict.fromkeys((reason, "; ".join((measured, *others[-1:])), *ends, measured)):
        if len(words) + len(said.split()) <= MOST_WORDS:
            return f"{message}; {said}" if message else said, reason if said == reason else ""
    return message, ""


def _reason_of(links: Sequence[BaseException]) -> str:
    """The reason for the first of ``links``, each caused by the next, that its own message does not tell."""
    first, *causes = links
    if sentence := why_unresolvable(causes):
        return sentence
    if isinstance(first, HighLevelFailure) and not first.message:
        told = [one for one in causes if isinstance(one, PlanFailure) and not isinstance(one, LocationUnresolvable)]
        return str(told[-1]) if told else ""
    return ""


def why_unresolvable(links: Iterable[BaseException]) -> str:
    """Reason of the first location among failures that could not be found, as a sentence; "" if none tells one."""
    reasons = (link.because() for link in links if isinstance(link, LocationUnresolvable))
    return next(filter(None, reasons), "")


def advised_changes(links: Iterable[BaseException]) -> tuple[Change, ...]:
    """Changes that the first of some failures that advises any states as data."""
    return next(filter(None, (getattr(link, "changes", ()) for link in links)), ())


def _causal_runs(links: list[BaseException]) -> list[list[BaseException]]:
    """Split a chain of failures where one did not cause the next; in each run, a failure raised again counts once."""
    runs = [links[:1]]
    for above, link in pairwise(links):
        if above.__cause__ is link:
            runs[-1].append(link)
        else:
            runs.append([link])
    return [each_once(run) for run in runs]


def _beside(link: BaseException, indent: str) -> Iterator[str]:
    """Yield lines for the place of a failure, and for those that arose with it."""
    if not isinstance(link, PlanFailure):
        return
    if link.where is not None:
        yield f"{indent}  in {link.where}"
    if isinstance(link, CompositeFailure):
        for name, member in zip(link.names, link.failures, strict=True):
            yield f"{indent}  branch {name}: {type(member).__name__}: {member}"
    for name, sibling in link.siblings:
        yield f"{indent}  at the same time, {name}: {type(sibling).__name__}: {sibling}"
    for cleanup in link.cleanup_failures:
        yield f"{indent}  during cleanup: {type(cleanup).__name__}: {cleanup}"


def matches(failure: BaseException, kinds: type[PlanFailure] | tuple[type[PlanFailure], ...]) -> bool:
    """Check whether a failure belongs to one of the classes; a composite failure does if all its leaves do."""
    if isinstance(failure, kinds):
        return True
    pending: list[BaseException] = [failure]
    while pending:
        member = pending.pop()
        if isinstance(member, kinds):
            continue
        if not isinstance(member, CompositeFailure) or not member.failures:
            return False
        pending.extend(member.failures)
    return True
