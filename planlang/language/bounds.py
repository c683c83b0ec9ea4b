"""Constructs that bound or protect a body: timeout, unwind_protect."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import TYPE_CHECKING, Any, TypeVar

from planlang.failures import PlanFailure, Timeout
from planlang.kernel import All, Task, shield
from planlang.kernel.calling import called
from planlang.kernel.park import here
from planlang.kernel.tree import name_of
from planlang.language.branches import Branch
from planlang.misuse import Usage

if TYPE_CHECKING:
    from planlang.kernel.timers import Timer

V = TypeVar("V")
_TIMEOUT = Usage("await timeout", {"seconds": "2", "body": "reach"})
_UNWIND_PROTECT = Usage("await unwind_protect", {"body": "reach", "cleanup": "retract"}, {"within": "30"})


class Limited(All):
    """One branch with a deadline, which stands still while the owner is held."""

    expired = False
    timer: Timer | None = None

    def __init__(self, kind: str, steps: int | None, body: Branch) -> None:
        super().__init__(kind)
        self.steps = steps
        self.body = body
        self.result: Any = None

    def begin(self) -> None:
        self.start(self.body, name_of(self.body), 0)
        if self.steps is not None:
            self.timer = self.scheduler.deadline(self.owner, self.steps, self.expire)

    def expire(self) -> None:
        """The allowance is used up."""
        if not self.over:
            self.expired = True
            self.close()

    def decide(self, dead: list[Task]) -> None:
        super().decide(dead)
        self.result = dead[0].result

    async def execute(self) -> Any:
        try:
            return await super().execute()
        finally:
            if self.timer is not None:
                self.timer.drop()

    def failure(self) -> PlanFailure:
        """What is raised when the time is over."""
        raise NotImplementedError

    def finish(self) -> Any:
        if self.expired:
            raise self.attach(self.failure())
        self.raise_failure()
        return self.result


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
    _TIMEOUT.branch("body", body)
    result: V = await _Timeout(seconds, here()[0].steps(seconds, _TIMEOUT), body).execute()
    return result


async def unwind_protect(
    body: Callable[[], Awaitable[V]], cleanup: Callable[[], Awaitable[Any]], *, within: float = 10.0
) -> V:
    """Run a body, then ``cleanup`` in any case: after success, failure and evaporation, shielded from evaporation.

    A cleanup longer than ``within`` seconds of plan time is a programming error, CleanupOverrun. A failure of the
    cleanup replaces the outcome, as in ``finally``; in an evaporated task it is recorded.
    """
    _UNWIND_PROTECT.branches(body=body, cleanup=cleanup)
    _UNWIND_PROTECT.seconds("within", within)
    try:
        return await called(body)  # type: ignore[no-any-return]
    finally:
        with shield(within):
            await called(cleanup)
