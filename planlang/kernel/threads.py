"""Code that takes long: calls in threads, for which a task waits without stopping the others, and signs of life.

In simulation the world stands still until all calls in flight have returned, and their callers go on in order of
submission, so threads do not make a run depend on timing. In real time callers go on as their calls return.
"""

from __future__ import annotations

import contextvars
import inspect
import threading
from collections import deque
from collections.abc import Callable, Coroutine
from typing import Any, TypeVar, overload

from planlang.kernel.asyncio_calls import AsyncioCall
from planlang.kernel.cancel import deliver, delivery, heed_interrupts
from planlang.kernel.core import Scheduler, Task, here, park, running
from planlang.kernel.errors import Evaporated
from planlang.kernel.primitives import pause
from planlang.kernel.signals import Wait
from planlang.kernel.tree import name_of
from planlang.misuse import Usage, WrongType, contrast, written

R = TypeVar("R")
_IN_THREAD = Usage("await in_thread", {"function": "read_port"}, {"takes": "0.5"})

MOST_THREADS = 256
"""Calls of one run that are executed at the same time; further ones begin as earlier ones return."""


class Call(Wait):
    """One call in flight. ``waiting``: its caller still waits for it, and goes on when it is handed over."""

    def __init__(
        self,
        calls: Calls,
        scheduler: Scheduler,
        task: Task,
        function: Callable[[], Any],
        name: str,
        number: int | None,
    ) -> None:
        """``number`` is that in the trace; None for what is not recorded."""
        self.scheduler = scheduler
        self.task = task
        self.name = name
        self.number = number
        self.node = task.node
        self.waiting = True
        self.started = False
        self.returned = False
        self._calls = calls
        self._function = function
        self._context = contextvars.copy_context()
        self._value: Any = None
        self._error: BaseException | None = None

    def start(self) -> None:
        """Begin, on a thread that does not keep the process alive."""
        self.started = True
        threading.Thread(target=self._work, name=f"planlang {self.name}", daemon=True).start()

    def _work(self) -> None:
        _thread.call = self
        try:
            self._value = self._context.run(self._function)
        except BaseException as error:
            self._error = error
        self.scheduler.inbox.put(self._arrive)

    @property
    def is_wanted(self) -> bool:
        """Return whether somebody still waits for what it gives."""
        return self.waiting and not self.task.doomed

    def _arrive(self) -> None:
        """Hand the result of the call over, in the run's thread."""
        self.returned = True
        if inspect.iscoroutine(self._value):
            name = self._value.__name__
            self._value.close()
            self._value = None
            self._error = _is_called(
                name, f"await in_thread(lambda: {name}())", f"await in_thread({name})    or, for a plan, await {name}()"
            )
        self._calls.arrived(self)

    def hand_over(self) -> None:
        """Let the caller go on with what the call gave. One that was evaporated is evaporated, the result is late."""
        scheduler, task = self.scheduler, self.task
        # The result is late if the caller has left, is being evaporated, or was woken by something before.
        taken = self.waiting and not task.doomed and not task.woken
        if scheduler.observer is not None and self.number is not None:
            outcome = {"result": self._value} if self._error is None else {"failure": self._error}
            late = {} if taken else {"late": True}
            scheduler.observer.write(
                scheduler.now, "returned", self.node, call=self.number, function=self.name, **outcome, **late
            )
        if not self.waiting:
            return
        self.waiting = False
        if task.woken:
            return
        if not taken:
            scheduler.throw(task, delivery(task, scheduler.draining))
        elif self._error is not None:
            scheduler.throw(task, self._error)
        else:
            scheduler.wake(task, self._value)

    @property
    def undisturbed(self) -> bool:
        """In simulation the caller is left alone until its call has returned, so that no thread outlives it."""
        return self.started and self.scheduler.live is None and self._calls.waits_for(self)

    def __str__(self) -> str:
        return f"the call of {self.name} in a thread"


class _Thread(threading.local):
    call: Call | None = None


_thread = _Thread()
"""The call that this thread executes."""


class Calls:
    """The calls of one run, in order of submission."""

    def __init__(self) -> None:
        self._made = 0
        """The highest number of a call."""
        self._flying: dict[Call, None] = {}
        self._queued: deque[Call] = deque()
        self._threads = 0

    def submit(
        self, scheduler: Scheduler, task: Task, function: Callable[[], Any], name: str, *, recorded: bool = True
    ) -> Call:
        """Begin a call, now or when there is a thread for it."""
        number = None
        if recorded:
            number = self._made + 1
            if scheduler.recorded is not None:
                number, function = scheduler.recorded.call(task.node, number, function)
            self._made = max(self._made, number)
            if scheduler.observer is not None:
                scheduler.observer.write(scheduler.now, "called", task.node, call=number, function=name)
        call = Call(self, scheduler, task, function, name, number)
        self._flying[call] = None
        scheduler.awaits_threads = True
        self._queued.append(call)
        try:
            self._start()
        except RuntimeError:  # the system gives no more threads
            self.abandon(call)
            raise
        return call

    def _start(self) -> None:
        while self._queued and self._threads < MOST_THREADS:
            call = self._queued.popleft()
            if call in self._flying and not call.task.doomed:  # else nobody waits for what it would give
                self._threads += 1
                call.start()

    def waits_for(self, call: Call) -> bool:
        """Return whether its caller still waits, and it was not handed over."""
        return call in self._flying

    def abandon(self, call: Call) -> None:
        """Stop waiting for a call. Its thread goes on; another may take its place."""
        call.waiting = False
        self._land(call)
        self._threads -= call.started
        self._start()

    def _land(self, call: Call) -> None:
        del self._flying[call]
        call.scheduler.awaits_threads = bool(self._flying)

    def arrived(self, call: Call) -> None:
        """Take note that a call has returned. In real time its caller goes on at once."""
        if call in self._flying:
            self._threads -= 1
            self._start()
            if call.scheduler.live is None:
                return  # collect() hands all of a step over at once, in order of submission
            self._land(call)
        if not call.scheduler.over:
            call.hand_over()

    def collect(self, scheduler: Scheduler) -> bool:
        """Wait in simulation until all calls have returned, then let their callers go on; False if there are none.

        Comes back early after Ctrl-C.
        """
        flying = self._flying
        if not flying or scheduler.live is not None or scheduler.draining:
            return False
        scheduler.idle = True
        try:
            while not all(call.returned for call in flying):
                scheduler.inbox.wait()
                for item in scheduler.inbox.take():
                    item()
                if scheduler.interrupted:
                    return True
        finally:
            scheduler.idle = False
        calls = tuple(flying)
        flying.clear()
        scheduler.awaits_threads = False
        for call in calls:
            call.hand_over()
        return True


def _is_called(name: str, wrong: str, right: str) -> WrongType:
    return WrongType(
        contrast(f"{name}() is a coroutine, which nothing runs here; pass the async function", wrong, right)
    )


def _is_asynchronous(function: object) -> bool:
    return inspect.iscoroutinefunction(function) or inspect.iscoroutinefunction(type(function).__call__)


@overload
async def in_thread(
    function: Callable[..., Coroutine[Any, Any, R]], /, *arguments: Any, takes: float = 0.0, **named: Any
) -> R: ...
@overload
async def in_thread(function: Callable[..., R], /, *arguments: Any, takes: float = 0.0, **named: Any) -> R: ...
async def in_thread(function: Callable[..., Any], /, *arguments: Any, takes: float = 0.0, **named: Any) -> Any:
    """Call blocking code, or an async function of asyncio, on a thread of its own; wait for what it returns or raises.

    An async function runs in an asyncio event loop of that thread.

    In simulation the world stands still until all calls in flight have returned, callers go on in order of submission,
    and an evaporated caller is released when its call has returned. So the call takes no plan time, unless ``takes``
    says how much [s]: the caller then waits so long for the result, and timeouts around it fire. In real time a call
    takes as long as it takes. An evaporated caller is released at once and leaves its call behind: an async function is
    cancelled, a plain one goes on on a daemon thread; a late result stands in the trace only. At most 256 calls of a
    run are executed at the same time.

    Raises TypeError if ``function`` is not callable, or returns a coroutine.
    """
    scheduler, _ = here()
    if inspect.iscoroutine(function):
        name, code = function.__name__, written(function)
        raise _is_called(name, _IN_THREAD.shown("function", code), _IN_THREAD.shown("function", f"{name}, ..."))
    if not callable(function):
        raise _IN_THREAD.wrong("function", function, "a function that blocks, or an async function of asyncio")
    name = name_of(function)
    steps = scheduler.steps(takes, _IN_THREAD, "takes")
    work: Callable[[], Any] = lambda: function(*arguments, **named)  # noqa: E731
    return await _called(AsyncioCall(work) if _is_asynchronous(function) else work, name, steps)


async def compute_in_thread(function: Callable[[], R]) -> R:
    """Compute on a thread of its own what depends on nothing outside of the run; the world stands still meanwhile.

    Unlike a call :func:`in_thread` it is not recorded, and computed again when a run is repeated.
    """
    result: R = await _called(function, name_of(function), recorded=False)
    return result


async def _called(work: Callable[[], Any], name: str, steps: int = 0, *, recorded: bool = True) -> Any:
    """Call on a thread, and let so many world steps pass that the call takes; return its result."""
    scheduler, task = here()
    if task.doomed:
        await deliver(task)
    calls = scheduler.service(Calls)
    call = calls.submit(scheduler, task, work, name, recorded=recorded)
    try:
        result = await park(call)
    except BaseException as error:
        if call.waiting:
            calls.abandon(call)
            if isinstance(work, AsyncioCall):
                work.cancel()
        elif isinstance(error, Exception):
            await _take(scheduler, steps, name)
        raise
    await _take(scheduler, steps, name)
    return result


async def _take(scheduler: Scheduler, steps: int, name: str) -> None:
    """Let the plan time of a call pass, which has returned; in real time it has passed."""
    if steps and scheduler.live is None:
        await pause(steps, f"the call of {name} in a thread")


def still_computing() -> None:
    """Say that code of a plan that computes long, and has an end, goes on; to be called now and then, in threads too.

    The watchdog counts anew from here. Raises Evaporated where nobody waits for the result any more: after Ctrl-C, or
    when the caller of :func:`in_thread` has been evaporated; a shielded task goes on. Nothing else happens, and outside
    of a run nothing at all, so that results do not depend on when this is called.
    """
    scheduler, call = running.scheduler, _thread.call
    if call is not None and not call.is_wanted:
        raise Evaporated
    if scheduler is None:
        return
    scheduler.beats += 1
    task = scheduler.current
    if task is None or scheduler.draining or not scheduler.interrupted:
        return
    root = task
    while root.group is not None:
        root = root.group.owner
    heed_interrupts(scheduler, root)
    if task.doomed:
        task.thrown = True
        raise Evaporated
