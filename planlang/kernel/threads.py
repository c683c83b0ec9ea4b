"""Slow code: calls in threads, for which a task waits while others run, and signs of life for the watchdog.

In simulation plan time stops until all calls in flight have returned, and their callers continue in order of
submission, so that a run does not depend on timing. In real time each caller continues when its call returns. Code of
asyncio runs only so: in an asyncio event loop of a separate thread.
"""

from __future__ import annotations

import contextvars
import inspect
import threading
import traceback
from collections import deque
from collections.abc import Callable, Coroutine
from functools import partial
from typing import Any, TypeVar, overload

from planlang.kernel.cancel import deliver, heed_interrupts, pending_error
from planlang.kernel.core import Scheduler, Task, here, park, running
from planlang.kernel.errors import Evaporated, PlanStructureError
from planlang.kernel.primitives import pause
from planlang.kernel.signals import Wait
from planlang.kernel.tree import name_of
from planlang.misuse import Usage, WrongType, contrast, written

ADVICE = (
    "await asyncio.sleep(1)    or await fetch()",
    "await sleep(1)    or, for an async function of asyncio, await in_thread(fetch)",
)
"""The wrong and the right code, for error messages."""


class AsyncioCall:
    """Blocking call of an asyncio function: runs it in a new event loop of the calling thread."""

    def __init__(self, function: Callable[[], Coroutine[Any, Any, Any]]) -> None:
        self._function = function
        self._lock = threading.Lock()
        self._is_cancelled = False
        self._cancel: Callable[[], object] | None = None
        """Cancels the running function; None when it is not running."""

    def __call__(self) -> Any:
        """Run the function and return its result."""
        import asyncio  # few plans need it, and it takes as long to import as the plan language

        async def main() -> Any:
            task = asyncio.current_task()
            assert task is not None
            with self._lock:
                if self._is_cancelled:
                    raise asyncio.CancelledError
                self._cancel = partial(asyncio.get_running_loop().call_soon_threadsafe, task.cancel)
            try:
                return await self._function()
            finally:
                with self._lock:
                    self._cancel = None

        return asyncio.run(main())

    def cancel(self) -> None:
        """Cancel the function from another thread; no effect after it has ended."""
        with self._lock:
            self._is_cancelled = True
            if self._cancel is not None:
                self._cancel()


def missing_loop_error(error: Exception) -> PlanStructureError | None:
    """Explain the error that asyncio code raised because a plan has no asyncio event loop; None for other errors."""
    modules = [str(frame.f_globals.get("__name__")) for frame, _ in traceback.walk_tb(error.__traceback__)]
    # Queues and locks of asyncio that are awaited in a plan fail in many ways, but always in a frame of asyncio.
    raised_in_asyncio = modules[-1].partition(".")[0] == "asyncio" and "asyncio.runners" not in modules
    if str(error) != "no running event loop" and not (
        raised_in_asyncio and isinstance(error, (RuntimeError, AttributeError))
    ):
        return None
    message = f"asyncio code needs an asyncio event loop; plans do not run in one ({type(error).__name__}: {error})"
    return PlanStructureError(contrast(message, *ADVICE)).with_traceback(error.__traceback__)


R = TypeVar("R")
_IN_THREAD = Usage("await in_thread", {"function": "read_port"}, {"takes": "0.5"})

MOST_THREADS = 256
"""Maximum number of concurrent calls of a run; further calls start as earlier ones return."""


class Call(Wait):
    """A call in flight. ``waiting`` is true until its caller has the result or has given up."""

    def __init__(
        self,
        calls: Calls,
        scheduler: Scheduler,
        task: Task,
        function: Callable[[], Any],
        name: str,
        number: int | None,
    ) -> None:
        """``number`` identifies the call in the trace; None if it is not recorded."""
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
        """Start the call in a daemon thread."""
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
        """Check whether a task still waits for the result."""
        return self.waiting and not self.task.doomed

    def _arrive(self) -> None:
        """Process the result of the call, in the run's thread."""
        self.returned = True
        if inspect.iscoroutine(self._value):
            name = self._value.__name__
            self._value.close()
            self._value = None
            self._error = _coroutine_error(
                name, f"await in_thread(lambda: {name}())", f"await in_thread({name})    or, for a plan, await {name}()"
            )
        self._calls.arrived(self)

    def hand_over(self) -> None:
        """Wake the caller with the result or error of the call, or with Evaporated if it was evaporated meanwhile."""
        scheduler, task = self.scheduler, self.task
        # The result is late if the caller has left, is being evaporated, or was woken by something else before.
        in_time = self.waiting and not task.doomed and not task.woken
        if scheduler.observer is not None and self.number is not None:
            outcome = {"result": self._value} if self._error is None else {"failure": self._error}
            late = {} if in_time else {"late": True}
            scheduler.observer.write(
                scheduler.now, "returned", self.node, call=self.number, function=self.name, **outcome, **late
            )
        if not self.waiting:
            return
        self.waiting = False
        if task.woken:
            return
        if not in_time:
            scheduler.throw(task, pending_error(task, scheduler.draining))
        elif self._error is not None:
            scheduler.throw(task, self._error)
        else:
            scheduler.wake(task, self._value)

    @property
    def uninterruptible(self) -> bool:
        """True in simulation until the call has returned, so that its thread does not outlive the caller."""
        return self.started and self.scheduler.live is None and self._calls.waits_for(self)

    def __str__(self) -> str:
        return f"the call of {self.name} in a thread"


class _Thread(threading.local):
    call: Call | None = None


_thread = _Thread()
"""The call that runs in this thread."""


class Calls:
    """The calls of one run, in order of submission."""

    def __init__(self) -> None:
        self._last_number = 0
        self._flying: dict[Call, None] = {}
        self._queued: deque[Call] = deque()
        self._threads = 0

    def submit(
        self, scheduler: Scheduler, task: Task, function: Callable[[], Any], name: str, *, recorded: bool = True
    ) -> Call:
        """Start a call, or queue it until a thread is free."""
        number = None
        if recorded:
            number = self._last_number + 1
            if scheduler.recorded is not None:
                number, function = scheduler.recorded.call(task.node, number, function)
            self._last_number = max(self._last_number, number)
            if scheduler.observer is not None:
                scheduler.observer.write(scheduler.now, "called", task.node, call=number, function=name)
        call = Call(self, scheduler, task, function, name, number)
        self._flying[call] = None
        scheduler.awaits_threads = True
        self._queued.append(call)
        try:
            self._start()
        except RuntimeError:  # the system has no more threads
            self.abandon(call)
            raise
        return call

    def _start(self) -> None:
        while self._queued and self._threads < MOST_THREADS:
            call = self._queued.popleft()
            if call in self._flying and not call.task.doomed:  # else no task waits for the result
                self._threads += 1
                call.start()

    def waits_for(self, call: Call) -> bool:
        """Check whether the result of a call is still awaited and not handed over yet."""
        return call in self._flying

    def abandon(self, call: Call) -> None:
        """Stop waiting for a call. Its thread runs on, but no longer counts towards the maximum."""
        call.waiting = False
        self._remove(call)
        self._threads -= call.started
        self._start()

    def _remove(self, call: Call) -> None:
        del self._flying[call]
        call.scheduler.awaits_threads = bool(self._flying)

    def arrived(self, call: Call) -> None:
        """Mark a call as returned. In real time its caller continues at once."""
        if call in self._flying:
            self._threads -= 1
            self._start()
            if call.scheduler.live is None:
                return  # collect() hands over all calls of the step, in order of submission
            self._remove(call)
        if not call.scheduler.over:
            call.hand_over()

    def collect(self, scheduler: Scheduler) -> bool:
        """Wait in simulation until all calls have returned, then wake their callers; False if there are no calls.

        Returns early after Ctrl-C.
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


def _coroutine_error(name: str, wrong: str, right: str) -> WrongType:
    return WrongType(contrast(f"{name}() is a coroutine; pass the async function itself", wrong, right))


@overload
async def in_thread(
    function: Callable[..., Coroutine[Any, Any, R]], /, *arguments: Any, takes: float = 0.0, **named: Any
) -> R: ...
@overload
async def in_thread(function: Callable[..., R], /, *arguments: Any, takes: float = 0.0, **named: Any) -> R: ...
async def in_thread(function: Callable[..., Any], /, *arguments: Any, takes: float = 0.0, **named: Any) -> Any:
    """Call a blocking function, or an async function of asyncio, in a separate thread; return its result.

    An async function runs in an asyncio event loop of that thread.

    In simulation plan time stops until all calls in flight have returned; callers continue in order of submission, and
    an evaporated caller is released only when its call has returned. So a call takes no plan time, unless ``takes`` [s]
    is given: the caller then waits that long, and timeouts around it fire. In real time a call takes as long as it
    takes, and an evaporated caller is released at once: its async function is cancelled, a blocking function runs on in
    a daemon thread, and a late result only appears in the trace. A run executes at most 256 calls at the same time.

    Raises TypeError if ``function`` is not callable, or returns a coroutine.
    """
    scheduler, _ = here()
    if inspect.iscoroutine(function):
        name, code = function.__name__, written(function)
        raise _coroutine_error(name, _IN_THREAD.shown("function", code), _IN_THREAD.shown("function", f"{name}, ..."))
    if not callable(function):
        raise _IN_THREAD.wrong("function", function, "a function that blocks, or an async function of asyncio")
    name = name_of(function)
    steps = scheduler.steps(takes, _IN_THREAD, "takes")
    work: Callable[[], Any] = lambda: function(*arguments, **named)  # noqa: E731
    is_async = inspect.iscoroutinefunction(function) or inspect.iscoroutinefunction(type(function).__call__)
    return await _call(AsyncioCall(work) if is_async else work, name, steps)


async def compute_in_thread(function: Callable[[], R]) -> R:
    """Compute in a separate thread a result that depends on nothing outside the run, such as a path of the arm.

    Unlike a call of :func:`in_thread` it is not recorded, but computed again when a run is repeated.
    """
    result: R = await _call(function, name_of(function), recorded=False)
    return result


async def _call(work: Callable[[], Any], name: str, steps: int = 0, *, recorded: bool = True) -> Any:
    """Call a function in a thread, then let ``steps`` of plan time pass; return its result."""
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
            await _spend(scheduler, steps, name)
        raise
    await _spend(scheduler, steps, name)
    return result


async def _spend(scheduler: Scheduler, steps: int, name: str) -> None:
    """Let the plan time of a returned call pass; in real time it has passed already."""
    if steps and scheduler.live is None:
        await pause(steps, f"the call of {name} in a thread")


def still_computing() -> None:
    """Give a sign of life from a long computation; call it now and then, also in calls :func:`in_thread`.

    Restarts the watchdog. Raises Evaporated if the result is no longer needed: after Ctrl-C, or if the caller of
    :func:`in_thread` was evaporated, unless it is shielded. It has no other effect, and none outside a run, so that
    results do not depend on when it is called.
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
