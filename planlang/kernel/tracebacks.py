"""Tracebacks of plans: lines of the plan and of the program that runs it, without planlang's frames between them."""

from __future__ import annotations

import os
from types import TracebackType

from planlang.kernel.errors import CleanupOverrun, PlanStructureError, RunError
from planlang.plan_failure import PlanFailure

VARIABLE = "PLANLANG_TRACEBACK"
"""Environment variable: if it is set, tracebacks keep all frames."""
_PARTS = ("kernel", "language", "runs", "testing", "recoveries", "misuse", "records")
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
