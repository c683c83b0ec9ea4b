"""A task: one branch of a plan, driven by the scheduler."""

from __future__ import annotations

import contextvars
from collections.abc import Callable, Coroutine, Generator
from enum import Enum
from random import Random
from typing import TYPE_CHECKING, Any

from planlang.kernel.tree import Node

if TYPE_CHECKING:
    from planlang.failures import PlanFailure
    from planlang.kernel.fluent import Fluent
    from planlang.kernel.scope import Scope
    from planlang.kernel.timers import Timer


class Status(Enum):
    """Life of a task; the last three are final. Handles also show ``EVAPORATING``."""

    CREATED = "created"
    RUNNING = "running"
    SUSPENDED = "suspended"
    EVAPORATING = "evaporating"
    SUCCEEDED = "succeeded"
    FAILED = "failed"
    EVAPORATED = "evaporated"

    @property
    def final(self) -> bool:
        """True for a task that is dead."""
        return self in _FINAL


# Members as plain names: looking one up on an Enum costs as much as starting a coroutine.
SUCCEEDED, FAILED, EVAPORATED = Status.SUCCEEDED, Status.FAILED, Status.EVAPORATED
_FINAL = frozenset({SUCCEEDED, FAILED, EVAPORATED})


class Task(Node):
    """One branch. Invariants: ``doomed`` iff evaporation reaches the task now (``cancelled`` and not shielded, or the
    run is drained); ``holds`` counts the tasks among itself and its ancestors that are suspended; a task is in the
    run queue iff ``in_queue``; ``woken`` without ``in_queue`` means woken while held.
    """

    # Slots that are all filled: in Python 3.11 a default on the class is read ten times slower than a slot.
    __slots__ = (
        "begun",
        "branch",
        "cancelled",
        "cleanup_failure",
        "context",
        "coroutine",
        "count",
        "crash",
        "dead",
        "deliveries",
        "doomed",
        "error",
        "failure",
        "generators",
        "group",
        "holds",
        "hooks",
        "in_queue",
        "index",
        "node",
        "outcome",
        "overrun",
        "result",
        "scope",
        "shields",
        "stream",
        "thrown",
        "timers",
        "value",
        "wait",
        "watched",
        "woken",
    )

    context: contextvars.Context
    """Copied from the owner's when the task begins; until then the owner waits, so that it is as at creation."""
    begun: bool
    dead: bool
    outcome: Status | None
    result: Any
    failure: PlanFailure | None
    crash: BaseException | None
    """A programming error that left the task."""
    cleanup_failure: PlanFailure | None
    """A plan failure that left the task after it was evaporated."""

    coroutine: Coroutine[Any, Any, Any] | Generator[Any, Any, Any] | None
    scope: Scope | None
    """The construct whose branches this task waits for."""
    node: Node
    """The innermost open node of this task."""
    wait: object
    """What the task waits for; its text is shown in listings."""
    woken: bool
    in_queue: bool
    value: Any
    error: BaseException | None
    """What the wait returns or raises at the next resumption."""

    cancelled: bool
    doomed: bool
    thrown: bool
    """Evaporation was delivered: the task ends evaporated, whatever it returns or raises."""
    deliveries: int
    shields: int
    overrun: BaseException | None
    """What breaks the task off: a bound of a shield that ran out, an injected fault; raised at its next checkpoint."""

    count: int
    """How often the task itself was suspended and not woken up."""
    holds: int
    timers: list[Timer] | None
    hooks: list[Callable[[], object]] | None
    """Called on suspension, last first."""
    generators: list[Any] | None
    """Async generators that it has iterated, to be closed before it counts as dead."""
    stream: Random | None
    watched: Fluent[Status] | None
    """The status as a fluent, once someone asked for it."""

    def __init__(
        self, group: Scope | None, parent: Node | None, name: str, branch: Callable[[], Any], index: int
    ) -> None:
        # as Node.__init__, without the call
        self.parent = parent
        self.kind = "branch"
        self.base_name = name
        self.ordinal = 1
        self.number = 0
        self.told = ""
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
        self.cleanup_failure = self.coroutine = self.scope = self.wait = self.value = self.error = self.overrun = None
        self.timers = self.hooks = self.generators = self.stream = self.watched = None

    @property
    def depth(self) -> int:
        """Number of constructs around the task."""
        return 0 if self.group is None else self.group.depth

    @property
    def status(self) -> Status:
        """The state as its handle shows it."""
        if self.outcome is not None:
            return self.outcome
        if self.cancelled:
            return Status.EVAPORATING
        if self.holds:
            return Status.SUSPENDED
        return Status.RUNNING if self.begun else Status.CREATED
