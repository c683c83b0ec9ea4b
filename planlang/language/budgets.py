"""timeout and budget: limits of plan time, and of attempts, for everything inside a body."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterator
from contextvars import ContextVar
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar

from planlang.designators import Action, local_name
from planlang.failures import BudgetExceeded, PlanFailure, Timeout
from planlang.kernel import Task, checkpoint
from planlang.kernel.core import here, park
from planlang.kernel.event_loop import MAX_RESUMPTIONS
from planlang.kernel.primitives import charge as note_charge
from planlang.kernel.scope import Single
from planlang.kernel.tree import name_of
from planlang.language.branches import Branch
from planlang.misuse import Usage, WrongType, amount, contrast, written

if TYPE_CHECKING:
    from planlang.kernel.hosts import Timer

V = TypeVar("V")

_TIMEOUT = Usage("await timeout", {"seconds": "2", "body": "reach"})


def _step_of(body: Branch) -> str:
    """Name of the step that a body performs, as the author of the plan knows it; else that of its function."""
    if isinstance(body, partial) and body.args and isinstance(action := body.args[0], Action):
        return str(body.keywords.get("name") or action.name or local_name(action.type))
    return name_of(body)


class Limited(Single):
    """One branch with a deadline, which is postponed while the owner is held."""

    expired = False
    timer: Timer | None = None

    def __init__(self, kind: str, steps: int | None, body: Branch) -> None:
        super().__init__(kind, body)
        self.steps = steps

    def begin(self) -> None:
        super().begin()
        if self.steps is not None:
            self.timer = self.scheduler.deadline(self.owner, self.steps, self.expire)

    def expire(self) -> None:
        """Evaporate the body, as its limit is reached."""
        if not self.over:
            self.expired = True
            self.close()

    async def execute(self) -> Any:
        try:
            return await super().execute()
        finally:
            if self.timer is not None:
                self.timer.drop()

    def failure(self) -> PlanFailure:
        """Failure of a body that has reached its limit."""
        raise NotImplementedError

    def finish(self) -> Any:
        if self.expired:
            raise self.attach(self.failure())
        return super().finish()


class _Timeout(Limited):
    def __init__(self, seconds: float, steps: int, body: Branch) -> None:
        super().__init__("timeout", steps, body)
        self.seconds = seconds

    def failure(self) -> PlanFailure:
        return Timeout(seconds=self.seconds, construct=f"{_step_of(self.body)} in {self.path}")


async def timeout(seconds: float, body: Callable[[], Awaitable[V]]) -> V:
    """Run a body; if it has not ended after ``seconds`` of plan time, evaporate it and raise Timeout.

    A body that finishes in the same step as the deadline, once all other tasks of that step have settled, counts as in
    time.
    """
    if amount(body) is not None and callable(seconds):
        code, right = f"await timeout({written(seconds)}, {body})", f"await timeout({body}, {written(seconds)})"
        raise WrongType(contrast("the arguments of timeout are swapped: the seconds come first", code, right))
    _TIMEOUT.branch("body", body)
    result: V = await _Timeout(seconds, here()[0].steps(seconds, _TIMEOUT), body).execute()
    return result


RESUMPTIONS = 10
"""Resumptions of a task that count as long as an attempt takes."""
_BUDGET = Usage("await budget", {"body": "reach"}, {"seconds": "30", "attempts": "3"})


class _Budget(Limited):
    def __init__(self, seconds: float | None, attempts: int | None, body: Branch) -> None:
        super().__init__("budget", None if seconds is None else here()[0].steps(seconds, _BUDGET), body)
        self.seconds = seconds
        self.attempts = attempts
        self.left = attempts
        self.outer = _budget.get()
        self.spent: dict[str, int] = {}
        self.used: dict[str, int] = {}
        self.used_up = False
        """True once a task has requested an attempt when none was left."""
        self.waiting: list[Task] = []
        """Tasks with such a request, until the budget has decided."""

    def decide(self, dead: list[Task]) -> None:
        if self.used_up:
            self.expire()
            for task in self.waiting:
                self.scheduler.wake(task)  # a shielded task continues
        else:
            super().decide(dead)

    def failure(self) -> PlanFailure:
        rate = self.scheduler.rate
        spent = {part: steps / rate for part, steps in self.spent.items() if steps}
        return BudgetExceeded(seconds=self.seconds, attempts=self.attempts, spent=spent, used=dict(self.used))


_budget: ContextVar[_Budget | None] = ContextVar("budget", default=None)


async def budget(body: Callable[[], Awaitable[V]], seconds: float | None = None, attempts: int | None = None) -> V:
    """Run a body with a limit of plan time, and of further attempts, for everything inside it.

    Each retry by a recovery and each further base pose of a location scope takes an attempt from all enclosing budgets.
    When a budget is used up, its body is evaporated and BudgetExceeded raised, which lists the time spent by each
    action and the attempts used by each construct.
    """
    _BUDGET.branch("body", body)
    if attempts is not None:
        attempts = _BUDGET.whole("attempts", attempts, 0, "times")
    scope = _Budget(seconds, attempts, body)
    token = _budget.set(scope)
    try:
        result: V = await scope.execute()
    finally:
        _budget.reset(token)
    return result


async def take_attempt(construct: str) -> None:
    """Take an attempt from all enclosing budgets; a budget without attempts left evaporates its body.

    The budget decides after the round, as all constructs do, so that the outcome is the same under every schedule. A
    shielded task continues, and its attempt is charged to the budgets that have attempts left. Attempts without end in
    one world step, which only a plan without a budget makes, end the run with NoProgress.
    """
    scheduler = here()[0]
    scheduler.resumptions += RESUMPTIONS
    if scheduler.resumptions > MAX_RESUMPTIONS:
        await checkpoint()  # where the event loop ends the run
    decided: list[_Budget] = []
    while empty := [each for each in _enclosing_budgets() if each.left == 0 and each not in decided]:
        await _expire(empty)
        decided += empty
    charge("used", construct, 1)


async def _expire(empty: list[_Budget]) -> None:
    """Wait until exhausted budgets have evaporated their bodies; only a shielded task returns from this."""
    undecided = [enclosing for enclosing in empty if not enclosing.over]
    if not undecided:
        await checkpoint()
        return
    task = here()[1]
    for enclosing in undecided:
        enclosing.used_up = True
        enclosing.waiting.append(task)
        enclosing.stir()
    try:
        await park("the end of its budget")
    finally:  # the budget must not wake the task in a later wait
        for enclosing in undecided:
            enclosing.waiting.remove(task)


def _enclosing_budgets() -> Iterator[_Budget]:
    """Yield the budgets of the running task, innermost first."""
    enclosing = _budget.get()
    while enclosing is not None:
        yield enclosing
        enclosing = enclosing.outer


def charge(kind: str, part: str, number: int) -> None:
    """Charge all enclosing budgets: world steps "spent" by an action, or attempts "used" by a construct.

    The attempts left of an exhausted budget stay at zero when a shielded task continues.
    """
    note_charge(kind, part, number)
    for enclosing in _enclosing_budgets():
        counts = enclosing.spent if kind == "spent" else enclosing.used
        counts[part] = counts.pop(part, 0) + number  # what was charged last comes last
        if kind == "used" and enclosing.left is not None:
            enclosing.left = max(0, enclosing.left - number)
