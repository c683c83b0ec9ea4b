"""Forgotten ``await``: a coroutine that a plan makes and never awaits ends the task, or the run, that has dropped it.

The interpreter tells when it frees a coroutine that never ran; ``leftovers`` finds those that are held to the end of
the run. A coroutine that an exception has kept from being awaited, as it does with what
was made first to be awaited later, is nobody's mistake, unless nothing could have awaited it.
"""

from __future__ import annotations

import dis
import functools
import gc
import inspect
import sys
import warnings
from collections.abc import Callable, Mapping
from types import CoroutineType, FrameType, FunctionType
from typing import TYPE_CHECKING, Any

from planlang.failures import dropping
from planlang.kernel.errors import PlanStructureError
from planlang.kernel.listing import is_own, place_in
from planlang.kernel.park import running
from planlang.kernel.suspects import Suspect, suspects
from planlang.misuse import contrast

if TYPE_CHECKING:
    from planlang.kernel.scheduler import Scheduler
    from planlang.kernel.task import Task

    Coroutine = CoroutineType[Any, Any, Any]

_ATTRIBUTE = "_warn_unawaited_coroutine"  # what the interpreter calls when it frees a coroutine that never ran
_BASES = ("take", "_work")
"""Functions of ours that call the plan's: in the run's thread, and in one of :func:`in_thread`."""
_POP_EXCEPT = dis.opmap["POP_EXCEPT"]


class _Watch:
    """What the interpreter's own warning was, once we stand before it; what goes on in the process."""

    warn: Callable[[Any], None] | None = None
    collecting = False
    """The collector is at work: what it frees says nothing about who runs."""


def watch() -> None:
    """Stand before the interpreter's warning about coroutines that were never awaited; once per process."""
    if _Watch.warn is None:
        _Watch.warn = getattr(warnings, _ATTRIBUTE, None)
        if _Watch.warn is not None:
            setattr(warnings, _ATTRIBUTE, _dropped)


def collector(phase: str, details: dict[str, int]) -> None:
    """Called by the collector while runs go on."""
    _Watch.collecting = phase == "start"


def _dropped(coroutine: Coroutine) -> None:
    """A coroutine was freed that never ran. Nothing may be raised here."""
    scheduler, call = running.scheduler, running.call
    if call is None and scheduler is None:
        if _Watch.warn is not None:
            _Watch.warn(coroutine)
        return
    task = call.task if call is not None else scheduler.current if scheduler is not None else None
    thrown = call is None and task is not None and task.thrown
    unwound = thrown or dropping.depth > 0 or _Watch.collecting or _handled(sys._getframe(1))
    around = task if task is not None or scheduler is None else scheduler.coroutines.root
    try:
        frames = [] if task is None else _frames()
        error = judged(around, coroutine, calls_of(around, coroutine, frames), frames, unwound)
    except RecursionError:  # at the end of the stack, where the run fails with that
        return
    if call is not None:
        call.forgotten = call.forgotten or error
    elif error is not None and scheduler is not None and not scheduler.draining:
        _blame(scheduler, task, error)


def _handled(frame: FrameType) -> bool:
    """Whether it is at the end of an ``except``, or of a ``with`` that lets an error go no further.

    That is where the error is freed: POP_EXCEPT, or if it has a name LOAD_CONST None and a STORE after that.
    """
    code, last = frame.f_code.co_code, frame.f_lasti
    return _POP_EXCEPT in (code[last], code[last - 4])


def _frames() -> list[FrameType]:
    """The plan's frames that run, innermost first."""
    found: list[FrameType] = []
    frame = sys._getframe(1)
    while not ((own := is_own(frame.f_code.co_filename)) and frame.f_code.co_name in _BASES):
        if not own:
            found.append(frame)
        assert frame.f_back is not None
        frame = frame.f_back
    return found


def calls_of(task: Task | None, coroutine: Coroutine, frames: list[FrameType]) -> list[Suspect]:
    """Calls that may have made it: in what runs, in the functions of the branches around, and in modules of plans."""
    files: dict[str, Mapping[str, Any]] = {frame.f_code.co_filename: frame.f_globals for frame in frames}
    while task is not None:
        function: Any = task.branch
        while isinstance(function, functools.partial):
            function = function.func
        function = inspect.unwrap(function)
        if isinstance(function, FunctionType) and not is_own(function.__code__.co_filename):
            files.setdefault(function.__code__.co_filename, function.__globals__)
        task = None if task.group is None else task.group.owner
    near = {*files, coroutine.cr_code.co_filename}
    for file, space in _modules(len(sys.modules)):
        files.setdefault(file, space)
    return suspects(coroutine, files, near)


@functools.lru_cache(maxsize=1)
def _modules(number: int) -> list[tuple[str, Mapping[str, Any]]]:
    """Files and names of the modules that are no library, of so many that are imported."""
    found: list[tuple[str, Mapping[str, Any]]] = []
    for name, module in tuple(sys.modules.items()):
        file = getattr(module, "__file__", None)
        library = name.partition(".")[0] in sys.stdlib_module_names and name != "__main__"
        if isinstance(file, str) and not library and "-packages" not in file and not is_own(file):
            found.append((file, vars(module)))
    return found


def judged(
    task: Task | None, coroutine: Coroutine, calls: list[Suspect], frames: list[FrameType], unwound: bool
) -> PlanStructureError | None:
    """The error that the coroutine is, or None if it is nobody's mistake."""
    name = coroutine.__name__
    inner = frames[0] if frames else None
    here = [call for call in calls if inner is not None and call.covers(inner.f_code.co_filename, inner.f_lineno)]
    if any(call.goes_on for call in here):
        return None  # what comes after it may have failed
    if unwound and not here and not (calls and all(call.certain for call in calls)):
        return None
    chosen = here[:1] or _likeliest(calls, frames)
    possible = here[:1] or [call for call in calls if call.near or call in chosen]
    if any(call.catches and not call.certain and (call.stored or not here) for call in possible):
        return None  # what was to await it may have failed before
    named = inner is not None and name in inner.f_code.co_names
    if not any(call.near or (call.certain and not named) for call in chosen):
        chosen = []  # lines of files that nothing leads to
    if len({call.where for call in chosen}) == 1:
        return PlanStructureError(
            contrast(
                f"{chosen[0].where} calls {name}() without await, so nothing was done",
                chosen[0].wrong,
                chosen[0].right,
            )
        )
    if chosen:
        lines = ", ".join(dict.fromkeys(call.where for call in chosen))
        return PlanStructureError(
            contrast(
                f"one of these lines calls {name}() without await, so nothing was done: {lines}",
                chosen[0].wrong,
                chosen[0].right,
            )
        )
    where = place_in(inner) if named and inner else task.path if task else "the run"
    return PlanStructureError(
        contrast(f"{where} calls {name}() without await, so nothing was done", f"{name}(...)", f"await {name}(...)")
    )


def _likeliest(guilty: list[Suspect], frames: list[FrameType]) -> list[Suspect]:
    """Of several lines those of functions that exist and run, and rather those whose coroutine nothing could await."""
    if len(guilty) > 1:
        codes = [one.__code__ for one in gc.get_objects() if type(one) is FunctionType]
        run = {(frame.f_code.co_filename, frame.f_code.co_firstlineno) for frame in frames}
        exist = run | {(code.co_filename, code.co_firstlineno) for code in codes}
        guilty = [call for call in guilty if not call.function or (call.file, call.function) in exist] or guilty
        guilty = [call for call in guilty if call.certain] or guilty
        guilty = [call for call in guilty if (call.file, call.function) in run] or guilty
    return sorted(guilty, key=lambda call: (call.file, call.line))


def _blame(scheduler: Scheduler, task: Task | None, error: PlanStructureError) -> None:
    """Raise it in the task that runs, at its next checkpoint or end; where none runs, end the run with it."""
    if task is None or task.dead:
        scheduler.spoilt = scheduler.spoilt or error
    elif task.overrun is None:
        task.overrun = error
        task.doomed = True
        task.generators = [*(task.generators or []), _Forgotten(task, error)]


def returned(task: Task, coroutine: Coroutine) -> PlanStructureError:
    """The error of a branch that returned a coroutine instead of its result."""
    name = coroutine.__name__
    coroutine.close()
    return PlanStructureError(
        contrast(
            f"branch {task.path} returned a call of {name}() that was not awaited, so nothing was done",
            f"return {name}(...)",
            f"return await {name}(...)",
        )
    )


def explain(error: BaseException) -> None:
    """Add what to write instead to errors of other event loops."""
    if isinstance(error, RuntimeError) and str(error) == "no running event loop":
        error.add_note(contrast("asyncio does not work in a plan", "await asyncio.sleep(1)", "await sleep(1)"))


class _Forgotten:
    """Closed with the generators that a task left open, if it ends without another checkpoint."""

    def __init__(self, task: Task, error: BaseException) -> None:
        self.task = task
        self.error = error

    @property
    def ag_frame(self) -> object:
        """None once the error was raised."""
        return self if self.task.overrun is self.error else None

    async def aclose(self) -> None:
        """Raise the error."""
        self.task.overrun = None
        raise self.error
