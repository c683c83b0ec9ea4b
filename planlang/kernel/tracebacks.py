"""Source lines of plans: where tasks wait, where failures arose, and tracebacks without planlang's own frames."""

from __future__ import annotations

import os
import sys
import traceback
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator
from types import CodeType, FrameType, TracebackType

from planlang.kernel.core import Task, running
from planlang.kernel.errors import CleanupOverrun, PlanStructureError, RunError
from planlang.kernel.tree import Node, unbound
from planlang.plan_failure import PlanFailure, Where

_PACKAGE = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
_OWN = tuple(os.path.join(_PACKAGE, part) for part in ("kernel/", "language/", "runs/", "faults/", "recoveries.py"))
DELIVERED = frozenset({"executive", "sim"})
"""Packages that come with the plan language: a line of theirs tells the author of a plan nothing."""
SHOWN = 20
"""Maximum number of tasks or functions listed in an error: about a screen."""


def is_own(filename: str) -> bool:
    """Check whether a source file is part of the plan language itself."""
    return filename.startswith(_OWN)


def place_in(frame: FrameType) -> str:
    """Format the file and line of a frame."""
    return f"{os.path.basename(frame.f_code.co_filename)}:{frame.f_lineno}"


def user_frame() -> FrameType:
    """Find the innermost running frame outside the plan language; the caller of ``run`` always has one."""
    frame: FrameType | None = sys._getframe(1)
    while frame is not None and is_own(frame.f_code.co_filename):
        frame = frame.f_back
    assert frame is not None
    return frame


def innermost_frame(coroutine: object) -> FrameType | None:
    """Find the innermost frame of a waiting coroutine that is outside the plan language."""
    own = (frame for frame in _frames(coroutine) if not is_own(frame.f_code.co_filename))
    return next(reversed(list(own)), None)


def _frames(coroutine: object) -> Iterator[FrameType]:
    """Yield the frames of a waiting coroutine, outermost first."""
    link = coroutine
    while link is not None:
        frame = getattr(link, "cr_frame", None) or getattr(link, "gi_frame", None) or getattr(link, "ag_frame", None)
        if isinstance(frame, FrameType):
            yield frame
        link = getattr(link, "cr_await", None) or getattr(link, "gi_yieldfrom", None) or getattr(link, "ag_await", None)


def frames_around() -> Iterator[FrameType]:
    """Yield the frames of the running task, innermost first, then those of each task that waits for it."""
    task = None if running.scheduler is None else running.scheduler.current
    frame: FrameType | None = sys._getframe(1)
    last = getattr(getattr(task, "coroutine", None), "cr_frame", None)
    while task is not None and frame is not None:
        yield frame
        frame = None if frame is last else frame.f_back
    while task is not None and task.group is not None:
        task = task.group.owner
        yield from reversed(list(_frames(task.coroutine)))


def place_of(task: Task) -> str:
    """Format the source line of a task, to be appended to a message.

    `` at file.py:12`` is where the task waits or where its branch is defined; ``, started at file.py:12`` is the line
    of the surrounding plan, if the task runs only planlang's own code; empty if neither is known.
    """
    frame = innermost_frame(task.coroutine)
    if frame is not None:
        return f" at {place_in(frame)}"
    code = getattr(unbound(task.branch), "__code__", None)
    if isinstance(code, CodeType) and not is_own(code.co_filename):
        return f" at {os.path.basename(code.co_filename)}:{code.co_firstlineno}"
    scope = task.group
    while scope is not None:
        frame = innermost_frame(scope.owner.coroutine)
        if frame is not None:
            return f", started at {place_in(frame)}"
        scope = scope.owner.group
    return ""


def blocked(root: Task) -> Iterable[Task]:
    """List the live tasks, without those that only wait for their branches."""
    stack = [root]
    while stack:
        task = stack.pop()
        if task.scope is not None and task.scope.live:
            stack.extend(reversed(task.scope.live))
        else:
            yield task


def listing(title: str, tasks: Iterable[Task]) -> str:
    """Format a title and one line per task: its path, what it waits for, and where."""
    lines = [f"{title}:"]
    more = 0
    for task in tasks:
        if len(lines) > SHOWN:
            more += 1
            continue
        what = " is suspended" if task.holds else ""
        if task.wait is not None:
            what = f"{what}, waiting for {task.wait}" if what else f" waits for {task.wait}"
        lines.append(f"  {task.path}{what}{place_of(task)}")
    if more:
        lines.append(f"  and {more} more")
    return "\n".join(lines)


def lines_of(error: BaseException, *, but: Collection[str] = ()) -> list[tuple[str, int]]:
    """File and line of each frame of an error's traceback outside the plan language, the innermost last.

    Frames in the packages ``but`` are left out.
    """
    passed = ((frame, line) for frame, line in traceback.walk_tb(error.__traceback__))
    others = ((frame, line) for frame, line in passed if not is_own(frame.f_code.co_filename))
    of_package = ((str(frame.f_globals.get("__name__")).partition(".")[0], frame, line) for frame, line in others)
    return [(os.path.basename(frame.f_code.co_filename), line) for name, frame, line in of_package if name not in but]


def locate(failure: PlanFailure, node: Node, revision: Callable[[], int] | None) -> None:
    """Store in a failure where it arose: the node, and the innermost line that an author has written, if any."""
    file, line = next(reversed(lines_of(failure, but=DELIVERED)), ("", 0))
    failure.where = Where(node.path, file, line, revision() if revision is not None else None)


def explain_recursion(error: RecursionError, path: str) -> None:
    """Add a note that names the plan's functions in an endless recursion, unless the error has one already."""
    if any("recursion without end" in note for note in getattr(error, "__notes__", ())):
        return
    passed = traceback.walk_tb(error.__traceback__)
    own = ((frame.f_code, line) for frame, line in passed if not is_own(frame.f_code.co_filename))
    counts = Counter(f"{code.co_qualname} at {os.path.basename(code.co_filename)}:{line}" for code, line in own)
    recursive = [where for where, count in counts.items() if count > 10]
    error.add_note(f"in {path}: recursion without end: {', then '.join(recursive[:SHOWN]) or 'unknown functions'}")


VARIABLE = "PLANLANG_TRACEBACK"
"""Environment variable: if it is set, tracebacks keep all frames."""
_PARTS = ("kernel", "language", "runs", "faults", "testing", "recoveries", "misuse", "records")
_INTERNAL = tuple(f"planlang.{part}" for part in _PARTS)
"""Modules whose frames are removed."""
_INTENTIONAL = (PlanFailure, PlanStructureError, RunError, CleanupOverrun, AssertionError, KeyboardInterrupt)
"""Exceptions that planlang raises on purpose, for authors of plans to see."""


def without_internals(error: BaseException) -> BaseException:
    """Remove planlang's own frames from the tracebacks of an exception, its causes and contexts; return it.

    There are a dozen frames of the kernel between a line of a plan and the line that awaits it. The traceback of an
    unintended error inside planlang is kept whole, as its frames show what went wrong.
    """
    if os.environ.get(VARIABLE):
        return error
    pending: list[BaseException | None] = [error]
    seen: set[int] = set()
    while pending:
        linked = pending.pop()
        if linked is not None and id(linked) not in seen:
            seen.add(id(linked))
            linked.__traceback__ = _trimmed(linked)
            pending += (linked.__cause__, linked.__context__)
    return error


def _trimmed(error: BaseException) -> TracebackType | None:
    links: list[TracebackType] = []
    link = error.__traceback__
    while link is not None:
        links.append(link)
        link = link.tb_next
    if not links or (_is_internal(links[-1]) and not isinstance(error, _INTENTIONAL)):
        return error.__traceback__
    trimmed: TracebackType | None = None
    for link in reversed(links):
        if not _is_internal(link):
            trimmed = TracebackType(trimmed, link.tb_frame, link.tb_lasti, link.tb_lineno)
    return trimmed


def _is_internal(link: TracebackType) -> bool:
    return str(link.tb_frame.f_globals.get("__name__")).startswith(_INTERNAL)
