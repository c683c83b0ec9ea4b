"""Plan functions, tagged tasks in them, and handles to observe, suspend and evaporate tasks."""

from __future__ import annotations

import dis
import functools
import inspect
import itertools
from collections.abc import AsyncIterator, Awaitable, Callable, Coroutine
from contextlib import asynccontextmanager
from contextvars import ContextVar
from functools import partial
from types import FunctionType, MethodType
from typing import Any, Concatenate, Generic, ParamSpec, TypeVar, overload

from planlang.failures import BranchEvaporated, PlanFailure
from planlang.kernel import Fluent, PlanStructureError, Status, Task, cancel, wait_for
from planlang.kernel.core import here, running, serving
from planlang.kernel.primitives import called, node, record
from planlang.kernel.scope import Single
from planlang.kernel.signals import Expression, Signal
from planlang.kernel.tree import name_of
from planlang.language.branches import Branch
from planlang.misuse import Usage, WrongType, contrast

P = ParamSpec("P")
Q = ParamSpec("Q")
R = TypeVar("R")
V = TypeVar("V")
_PLAN = Usage("plan", {"function": "serve"}, {"iri": '"http://example.org/recipe#Serve"'})


class Plan(Generic[P, R]):
    """A plan function, created by :func:`plan`; a call returns a coroutine, as with any ``async def``."""

    def __init__(self, function: Callable[P, Awaitable[R]], iri: str | None) -> None:
        _PLAN.branch("function", function)
        if (
            isinstance(function, FunctionType)
            and not inspect.iscoroutinefunction(function)
            and _always_returns_none(function)
        ):
            name = name_of(function)
            message = f"{name} is not an async function; write a plan with async def"
            raise WrongType(contrast(message, f"@plan def {name}(): ...", f"@plan async def {name}(): ..."))
        if iri is not None:
            _PLAN.text("iri", iri)
        functools.update_wrapper(self, function)
        self.function = function
        self.iri = iri
        self.name: str = getattr(function, "__name__", "plan")

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> Coroutine[Any, Any, R]:
        """Make a coroutine of the plan; constructs such as par take the plan itself, not a call."""
        coroutine = self._execute(args, kwargs)
        coroutine.__qualname__ = coroutine.__name__ = self.name  # type: ignore[attr-defined]  # not in typeshed's Coroutine
        return coroutine

    async def _execute(self, args: tuple[Any, ...], kwargs: dict[str, Any]) -> R:
        task = here()[1]
        details: dict[str, object] = {}
        if self.iri is not None:
            details["iri"] = self.iri
        if args:
            details["arguments"] = args
        if kwargs:
            details["parameters"] = kwargs
        own = Frame(frame.get())
        token = frame.set(own)
        try:
            if isinstance(task.node, Task) and task.node.unused and task.node.base_name == self.name:
                record("plan", **details)  # the branch is this plan and needs no second node in the tree
                return await called(self.function, *args, **kwargs)  # type: ignore[no-any-return]
            body = partial(called, self.function, *args, **kwargs)
            return await node("plan", self.name, body, **details)  # type: ignore[no-any-return]
        finally:
            own.leave()
            frame.reset(token)

    @overload
    def __get__(self, instance: None, owner: object) -> Plan[P, R]: ...
    @overload
    def __get__(
        self: Plan[Concatenate[Any, Q], R], instance: object, owner: object
    ) -> Callable[Q, Coroutine[Any, Any, R]]: ...
    def __get__(self, instance: object, owner: object) -> Any:
        """Bind the plan to an object if it is a method."""
        return self if instance is None else MethodType(self, instance)

    def __repr__(self) -> str:
        return f"<plan {self.name}>"


def _always_returns_none(function: object) -> bool:
    """Check in the byte code whether a function only returns None; others may return an awaitable, as wrappers do."""
    return isinstance(function, FunctionType) and not any(
        instruction.opname == "RETURN_VALUE" and previous.opname != "LOAD_CONST"
        for previous, instruction in itertools.pairwise(dis.get_instructions(function))
    )


def innermost_plan() -> str:
    """Path of the innermost plan function around the running task; "" if no plan is running."""
    scheduler = running.scheduler
    task = None if scheduler is None else scheduler.current
    node = None if task is None else task.node
    while node is not None and node.parent is not None and node.kind != "plan":
        node = node.parent
    return "" if node is None else node.path


@overload
def plan(iri: str | None = None, /) -> Callable[[Callable[P, Awaitable[R]]], Plan[P, R]]: ...
@overload
def plan(function: Callable[P, Awaitable[R]], /) -> Plan[P, R]: ...
def plan(what: Any = None, /) -> Any:
    """Mark a plan function: ``@plan("http://...#ServeADrink")`` or ``@plan``."""
    if callable(what) or not (what is None or isinstance(what, str)):
        return Plan(what, None)
    if what is not None:
        _PLAN.text("iri", what)
    return functools.partial(_plan_with_iri, what)


def _plan_with_iri(iri: str | None, function: Callable[P, Awaitable[R]]) -> Plan[P, R]:
    return Plan(function, iri)


# -- tags

_TAG = Usage("await tag", {"name": '"reach"', "body": "reach"})
_HANDLE = Usage("Handle", {"name": '"reach"'})
_TASK = Usage("task", {"name": '"reach"'})
_ON_SUSPENSION = Usage("async with on_suspension", {"function": "stop"})


class Frame:
    """Scope of names in one call of a plan function: its tags, and handles of inner plans that await a tag here."""

    __slots__ = ("outer", "tags", "unresolved")

    def __init__(self, outer: Frame | None) -> None:
        self.outer = outer
        self.tags: dict[str, Handle] = {}
        self.unresolved: dict[str, dict[Handle, None]] = {}

    def leave(self) -> None:
        """End the call: its handles no longer await tags in outer plans."""
        outer = self.outer
        while outer is not None:
            for name, handle in self.tags.items():
                if name in outer.unresolved:
                    outer.unresolved[name].pop(handle, None)
            outer = outer.outer


frame: ContextVar[Frame | None] = ContextVar("frame", default=None)


class Handle:
    """Handle of a task, for other parts of the plan. It may exist before the task."""

    def __init__(self, name: str, task: Task | None = None) -> None:
        _HANDLE.text("name", name)
        self.name = name
        self._task: Task | None = None
        self.bindings = 0
        """Number of tasks that the handle was bound to so far."""
        self._status: Fluent[Status] = Fluent(Status.CREATED, f"the status of {name}")
        self._suspensions = 0
        self._evaporated = False
        self.home: Frame | None = None
        """Frame of the plan in which the task is tagged."""
        self.joined = False
        """True once the task's failure was raised in another task by :func:`join`."""
        if task is not None:
            self.bind(task)

    def bind(self, task: Task) -> None:
        """Bind the handle to a task, with the suspensions and evaporation that were requested before."""
        scheduler = here()[0]
        self._task = task
        self.bindings += 1
        task.watched = [*(task.watched or ()), self._status]
        self._status.set(task.status)
        for _ in range(self._suspensions):
            cancel.suspend(scheduler, task)
        self._suspensions = 0
        if self._evaporated:
            self._evaporated = False
            cancel.evaporate(scheduler, task)

    @property
    def status(self) -> Fluent[Status]:
        """The task's state, as a fluent."""
        return self._status

    @property
    def result(self) -> Any:
        """The result of the task, None until it has succeeded."""
        return None if self._task is None else self._task.result

    @property
    def failure(self) -> PlanFailure | None:
        """The failure of the task, None if it has not failed."""
        return None if self._task is None else self._task.failure

    @property
    def children(self) -> tuple[Handle, ...]:
        """Handles of the live branches that the task waits for."""
        if self._task is None or self._task.scope is None:
            return ()
        return tuple(Handle(task.name, task) for task in self._task.scope.live)

    @property
    def path(self) -> str | None:
        """The task's path in the tree, None before it exists."""
        return None if self._task is None else self._task.path

    @property
    def live(self) -> bool:
        """True from start to end of the task."""
        return self._task is not None and not self._task.dead

    def __repr__(self) -> str:
        return f"<task {self.path or self.name}, {self._status.value.value}>"


class _Tag(Single):
    transparent = True

    def __init__(self, body: Branch, handle: Handle, home: Frame) -> None:
        super().__init__("tag", body, body_name=handle.name)
        self.handle = handle
        self.home = home

    def begin(self) -> None:
        handle = self.handle
        name = handle.name
        if handle.live and handle.home is self.home:
            raise PlanStructureError(
                f"two live tasks tagged {name!r} in one plan; give them two names\n"
                f'  wrong: par(partial(tag, "{name}", reach), partial(tag, "{name}", look))\n'
                f'  right: par(partial(tag, "{name}", reach), partial(tag, "{name} 2", look))'
            )
        task = self.start(self.body, name, 0)
        for each in (handle, *self.home.unresolved.pop(name, ())):
            if each is handle or not each.live:
                each.home = self.home
                each.bind(task)


async def tag(name: str, body: Callable[[], Awaitable[V]]) -> V:
    """Run a body as a named task and return its result; ``task(name)`` is its handle in the same plan."""
    _TAG.branch("body", body)
    _TAG.text("name", name)
    own = _frame()
    handle = own.tags.get(name)
    if handle is None:
        handle = own.tags[name] = Handle(name)
    result: V = await _Tag(body, handle, own).execute()
    return result


def task(name: str) -> Handle:
    """Find the handle of a tagged task, in the nearest enclosing plan that has the name.

    If no plan has it yet, the handle will be bound to the first task of that name in this plan or an enclosing one.
    """
    here()
    _TASK.text("name", name)
    own = _frame()
    enclosing: Frame | None = own
    while enclosing is not None:
        if name in enclosing.tags:
            return enclosing.tags[name]
        enclosing = enclosing.outer
    handle = own.tags[name] = Handle(name)
    enclosing = own.outer
    while enclosing is not None:
        enclosing.unresolved.setdefault(name, {})[handle] = None
        enclosing = enclosing.outer
    return handle


async def join(handle: Handle) -> Any:
    """Wait until the task has ended; return its result or raise its failure."""
    _check_handle("await join", handle)
    over: Signal[bool] = Expression(lambda status: status.final, "final", handle.status)
    over.name = f"the end of task {handle.name!r}"
    await wait_for(over)
    if handle.status.value is Status.SUCCEEDED:
        return handle.result
    joined = handle._task
    if joined is not None and joined.crash is not None:
        raise joined.crash
    if handle.failure is not None:
        handle.joined = True
        raise handle.failure
    raise BranchEvaporated(path=handle.path)


def suspend(handle: Handle) -> bool:
    """Suspend the task and all tasks below it, at once; True if this changed anything."""
    _check_handle("suspend", handle)
    if handle._task is not None:
        return cancel.suspend(serving(), handle._task)
    if handle._evaporated:
        return False
    handle._suspensions += 1
    return True


def wake_up(handle: Handle) -> bool:
    """Undo one suspension of the task; True if this changed anything."""
    _check_handle("wake_up", handle)
    if handle._task is not None:
        return cancel.wake_up(serving(), handle._task)
    if not handle._suspensions:
        return False
    handle._suspensions -= 1
    return True


def evaporate(handle: Handle) -> bool:
    """Evaporate the task and all tasks below it; True if this changed anything."""
    _check_handle("evaporate", handle)
    if handle._task is not None:
        return cancel.evaporate(serving(), handle._task)
    changed, handle._evaporated, handle._suspensions = not handle._evaporated, True, 0
    return changed


@asynccontextmanager
async def task_suspended(handle: Handle) -> AsyncIterator[Handle]:
    """Suspend the task during the block of ``async with task_suspended(h):``, and always wake it up afterwards."""
    _check_handle("async with task_suspended", handle)
    # The suspension applies to the present task of the handle, or to the first one that it will be bound to. A later
    # task is not woken up here, as another part of the plan may have suspended it.
    last = handle.bindings + (handle._task is None)
    suspend(handle)
    try:
        yield handle
    finally:
        if handle.bindings <= last:
            wake_up(handle)


@asynccontextmanager
async def on_suspension(function: Callable[[], object]) -> AsyncIterator[None]:
    """Call a plain function whenever the task is suspended inside the block of ``async with on_suspension(f):``."""
    _ON_SUSPENSION.plain("function", function, "a plain function without await, as suspension takes effect at once")
    owner = here()[1]
    if owner.hooks is None:
        owner.hooks = []
    owner.hooks.append(function)
    try:
        yield
    finally:
        owner.hooks.remove(function)


def _check_handle(function: str, handle: object) -> None:
    if not isinstance(handle, Handle):
        raise Usage(function, {"handle": 'task("reach")'}).wrong("handle", handle, "the handle of a task")


def _frame() -> Frame:
    own = frame.get()
    assert own is not None  # run() has set it
    return own


_RETRY_AFTER_SUSPENSION = Usage("await retry_after_suspension", {"body": "reach"})


class Restarting(Single):
    """One branch that is evaporated with its cleanup when the owner is suspended, and restarted on wake-up."""

    interrupted = False

    def begin(self) -> None:
        hooks = self.owner.hooks
        if hooks is None:
            hooks = self.owner.hooks = []
        hooks.append(self._on_suspension)
        super().begin()

    def _on_suspension(self) -> None:
        for task in tuple(self.live):
            self.interrupted = cancel.evaporate(self.scheduler, task) or self.interrupted

    def decide(self, dead: list[Task]) -> None:
        if self.interrupted and dead[0].outcome is Status.EVAPORATED:
            self.interrupted = False
            self.begin_attempt()
            self.start(self.body, self.body_name, 0)  # stays suspended until the owner is woken up
            return
        super().decide(dead)

    async def execute(self) -> Any:
        try:
            return await super().execute()
        finally:
            if self.owner.hooks is not None and self._on_suspension in self.owner.hooks:
                self.owner.hooks.remove(self._on_suspension)


async def retry_after_suspension(body: Callable[[], Awaitable[V]]) -> V:
    """Run a body that is evaporated with its cleanup on suspension, and starts again from the beginning on wake-up."""
    _RETRY_AFTER_SUSPENSION.branch("body", body)
    result: V = await Restarting("retry_after_suspension", body).execute()
    return result
