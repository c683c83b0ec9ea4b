"""Asynchronous requests to process modules: perform_async makes one and goes on, monitor waits for one.

A request belongs to the ``with_requests`` block in whose branch it is made, so that none outlives its caller.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from contextvars import ContextVar
from functools import partial
from typing import Any, TypeVar

from planlang.designators import Action
from planlang.kernel import All, Fluent, PlanStructureError, Status, Task, checkpoint, wait_for
from planlang.kernel.expressions import Expression
from planlang.kernel.park import here
from planlang.kernel.tree import name_of
from planlang.language.branches import Branch
from planlang.language.context import executive_for
from planlang.language.performing import asked, check_action, perform
from planlang.language.tags import Handle, join
from planlang.misuse import Usage, WrongType, contrast, written

V = TypeVar("V")
_WITH_REQUESTS = Usage("await with_requests", {"body": "serve"})
_PERFORM_ASYNC = Usage("await perform_async", {"action": 'action("Reaching")'}, {"name": '"reach"'})
_MONITOR = Usage("await monitor", {"request": "await perform_async(action(...))"})


class Request(Handle):
    """An asynchronous request. As a handle it can be observed, joined, suspended, woken up and evaporated."""

    def __init__(self, action: Action, task: Task) -> None:
        if not isinstance(task, Task):
            message, code = "a request is made by perform_async()", f"Request({written(action)}, ...)"
            raise WrongType(contrast(message, code, _PERFORM_ASYNC.shown("action")))
        super().__init__(task.name, task)
        self.action = action
        self.made = task


async def with_requests(body: Callable[[], Awaitable[V]]) -> V:
    """Run a body that may make asynchronous requests with :func:`perform_async`; returns its result.

    Requests finish or fail one by one, without effect on the body. When the body has succeeded, those that are left
    are waited for; then the first failure that was not monitored is raised, later ones as its siblings. When the body
    fails or is evaporated, the requests that are left are cancelled. A programming error ends everything.
    """
    _WITH_REQUESTS.branch("body", body)
    scope = _Requests(body)
    token = _requests.set(scope)
    try:
        result: V = await scope.execute()
    finally:
        _requests.reset(token)
    return result


async def perform_async(action: Action, name: str | None = None) -> Request:
    """Ask a process module to perform an action, and go on; :func:`monitor` the request for its outcome.

    Suspending or evaporating the caller does to the request what it does to :func:`perform`. The request does not
    take part in resources that the caller holds at the time: holding the arm while monitoring a request for the arm
    is a deadlock.
    """
    check_action(_PERFORM_ASYNC, action, name)
    executive_for("perform_async")
    scope = _requests.get()
    if scope is None or here()[1] is not scope.body_task:
        raise PlanStructureError(
            "perform_async() outside of a with_requests() block of this branch\n"
            f"  wrong: request = await perform_async({action})\n"
            "  right: async def body(): request = await perform_async(...); ...; await monitor(request)\n"
            "         await with_requests(body)"
        )
    await checkpoint()
    queued: Fluent[bool] = Fluent(False, "a place in the queue")
    request = scope.request(partial(_perform, action, name, queued), action)
    await wait_for(queued | Expression(lambda status: status.final, "the end of", request.status))
    return request


async def monitor(request: Request) -> Any:
    """Wait until an asynchronous request has ended; returns its result, or raises its failure, the same object.

    It waits for no other request, and raises no other's failure.
    """
    _MONITOR.instance("request", request, Request, "a request")
    return await join(request)


async def _perform(action: Action, name: str | None, queued: Fluent[bool]) -> Any:
    asked.set(queued)
    return await perform(action, name)


class _Requests(All):
    body_task: Task | None = None

    def __init__(self, body: Branch) -> None:
        super().__init__("with_requests")
        self.body = body
        self.requests: list[Request] = []

    def begin(self) -> None:
        self.body_task = self.start(self.body, name_of(self.body), 0)

    def request(self, branch: Branch, action: Action) -> Request:
        """Start a request."""
        if self.over:
            raise PlanStructureError(
                "perform_async() in the cleanup of its with_requests() block\n"
                f"  wrong: await perform_async({action})\n"
                f"  right: await perform({action})"
            )
        task = self.start(branch, "request", len(self.requests) + 1)
        request = Request(action, task)
        self.requests.append(request)
        return request

    def decide(self, dead: list[Task]) -> None:
        if not dead[0].index:
            super().decide(dead[:1])

    def finish(self) -> Any:
        self.raise_failure()
        lost = [one.made for one in self.requests if one.made.outcome is Status.FAILED and not one.joined]
        if lost:
            self.fail(lost)
            self.raise_failure()
        assert self.body_task is not None
        return self.body_task.result


_requests: ContextVar[_Requests | None] = ContextVar("requests", default=None)
