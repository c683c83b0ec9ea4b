"""What starts over after a suspension, so that nothing goes on halfway: process-module requests above all."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any, TypeVar

from planlang.kernel import All, Status, Task
from planlang.kernel.tree import name_of
from planlang.language.branches import Branch
from planlang.misuse import Usage

V = TypeVar("V")
_RETRY_AFTER_SUSPENSION = Usage("await retry_after_suspension", {"body": "reach"})


class Restarting(All):
    """One branch, evaporated with its cleanup when the owner is held, and started anew when it is woken up."""

    interrupted = False

    def __init__(self, kind: str, name: str, body: Branch, body_name: str) -> None:
        super().__init__(kind, name)
        self.body = body
        self.body_name = body_name
        self.result: Any = None

    def begin(self) -> None:
        hooks = self.owner.hooks
        if hooks is None:
            hooks = self.owner.hooks = []
        hooks.append(self._held)
        self.start(self.body, self.body_name, 0)

    def _held(self) -> None:
        for task in tuple(self.live):
            self.interrupted = self.scheduler.evaporate(task) or self.interrupted

    def decide(self, dead: list[Task]) -> None:
        if self.interrupted and dead[0].outcome is Status.EVAPORATED:
            self.interrupted = False
            self.start(self.body, self.body_name, 0)  # held as long as the owner is
            return
        super().decide(dead)
        self.result = dead[0].result

    def finish(self) -> Any:
        self.raise_failure()
        return self.result

    async def execute(self) -> Any:
        try:
            return await super().execute()
        finally:
            if self.owner.hooks is not None and self._held in self.owner.hooks:
                self.owner.hooks.remove(self._held)


async def retry_after_suspension(body: Callable[[], Awaitable[V]]) -> V:
    """Run a body; when it is suspended it is evaporated with its cleanup, and runs from the start when woken up."""
    _RETRY_AFTER_SUSPENSION.branch("body", body)
    result: V = await Restarting("retry_after_suspension", "retry_after_suspension", body, name_of(body)).execute()
    return result
