"""budget: one allowance of time and attempts for everything inside, nested recoveries included."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterator
from contextvars import ContextVar
from typing import TYPE_CHECKING, Any, TypeVar

from planlang.failures import BudgetExceeded, PlanFailure, Timeout
from planlang.kernel import Task, checkpoint
from planlang.kernel.core import here, park
from planlang.kernel.primitives import charge as note_charge
from planlang.kernel.scope import Single
from planlang.kernel.tree import name_of
from planlang.language.branches import Branch
from planlang.misuse import Usage, WrongType, amount, contrast, written

if TYPE_CHECKING:
    from planlang.kernel.hosts import Timer

V = TypeVar("V")

_TIMEOUT = Usage("await timeout", {"seconds": "2", "body": "reach"})


class Limited(Single):
    """One branch with a deadline, which stands still while the owner is held."""

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
        """End the body: the allowance is used up."""
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
        """Return the failure of a body whose allowance is used up."""
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
        return Timeout(seconds=self.seconds, construct=f"{name_of(self.body)} in {self.path}")


async def timeout(seconds: float, body: Callable[[], Awaitable[V]]) -> V:
    """Run a body; when it has not ended after ``seconds`` of plan time it is evaporated, and Timeout is raised.

    A body that is dead when all other tasks of that step have come to rest was in time.
    """
    if amount(body) is not None and callable(seconds):
        code, right = f"await timeout({written(seconds)}, {body})", f"await timeout({body}, {written(seconds)})"
        raise WrongType(contrast("the arguments of timeout are swapped: the seconds come first", code, right))
    _TIMEOUT.branch("body", body)
    result: V = await _Timeout(seconds, here()[0].steps(seconds, _TIMEOUT), body).execute()
    return result


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
        """True once a task has asked for an attempt when none was left."""
        self.waiting: list[Task] = []
        """Tasks that have asked for an attempt when there was none left, until that is decided."""

    def decide(self, dead: list[Task]) -> None:
        if self.used_up:
            self.expire()
            for task in self.waiting:
                self.scheduler.wake(task)  # to go on if a shield keeps it
        else:
            super().decide(dead)

    def failure(self) -> PlanFailure:
        rate = self.scheduler.rate
        spent = {part: steps / rate for part, steps in self.spent.items() if steps}
        return BudgetExceeded(seconds=self.seconds, attempts=self.attempts, spent=spent, used=dict(self.used))


_budget: ContextVar[_Budget | None] = ContextVar("budget", default=None)


async def budget(body: Callable[[], Awaitable[V]], seconds: float | None = None, attempts: int | None = None) -> V:
    """Run a body with one allowance for everything inside: of plan time, and of attempts after the first ones.

    Each retry by a recovery and each further place of a location scope takes an attempt from all budgets around it.
    When one is used up its body is evaporated and BudgetExceeded raised, which says where the time went, by action,
    and where the attempts went, by construct.
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
    """Take an attempt from the budgets around the running task; evaporates the task when none is left.

    That one is used up is decided after the round, as everything is: so it is the same under every schedule. What goes
    on all the same, since a shield keeps it, takes its attempt from those that have some left.
    """
    passed: list[_Budget] = []
    while empty := [around for around in _around() if around.left == 0 and around not in passed]:
        await _pass(empty)
        passed += empty
    charge("used", construct, 1)


async def _pass(empty: list[_Budget]) -> None:
    """Let these budgets that are used up end what is in them; returns in what is kept by a shield."""
    undecided = [around for around in empty if not around.over]
    if not undecided:
        await checkpoint()
        return
    task = here()[1]
    for around in undecided:
        around.used_up = True
        around.waiting.append(task)
        around.stir()
    try:
        await park("the end of its budget")
    finally:  # what it waits for afterwards is not the budget's matter
        for around in undecided:
            around.waiting.remove(task)


def _around() -> Iterator[_Budget]:
    """Yield the budgets around the running task, innermost first."""
    around = _budget.get()
    while around is not None:
        yield around
        around = around.outer


def charge(kind: str, part: str, number: int) -> None:
    """Charge the budgets around the running task: world steps "spent" by an action, or attempts "used" by a construct.

    A budget that is used up has no attempts to give: what goes on under a shield takes none from it.
    """
    note_charge(kind, part, number)
    for around in _around():
        counts = around.spent if kind == "spent" else around.used
        counts[part] = counts.get(part, 0) + number
        if kind == "used" and around.left is not None:
            around.left = max(0, around.left - number)
