"""Tracebacks of plans: the lines of the plan and of whoever runs it, without the planlang frames between them."""

from __future__ import annotations

import os
from types import TracebackType

from planlang.kernel.errors import CleanupOverrun, PlanStructureError, RunError
from planlang.plan_failure import PlanFailure

VARIABLE = "PLANLANG_TRACEBACK"
"""Environment variable: if it is set, tracebacks keep all frames."""
_PARTS = ("kernel", "language", "runs", "testing", "recoveries", "misuse", "records")
_INTERNAL = tuple(f"planlang.{part}" for part in _PARTS)
"""Modules whose frames say nothing about a plan."""
_MEANT = (PlanFailure, PlanStructureError, RunError, CleanupOverrun, AssertionError, KeyboardInterrupt)
"""Exceptions that planlang raises for authors of plans to see."""


def without_internals(error: BaseException) -> BaseException:
    """Remove planlang's own frames from the traceback of an exception and of those it was raised from; return it.

    Between a line of a plan and the line that awaits it stand a dozen frames of the kernel. An exception that arose
    inside planlang, and is none that it raises on purpose, keeps them all: there they show what went wrong.
    """
    if os.environ.get(VARIABLE):
        return error
    open_: list[BaseException | None] = [error]
    seen: set[int] = set()
    while open_:
        one = open_.pop()
        if one is not None and id(one) not in seen:
            seen.add(id(one))
            one.__traceback__ = _trimmed(one)
            open_ += (one.__cause__, one.__context__)
    return error


def _trimmed(error: BaseException) -> TracebackType | None:
    links: list[TracebackType] = []
    link = error.__traceback__
    while link is not None:
        links.append(link)
        link = link.tb_next
    if not links or (_is_internal(links[-1]) and not isinstance(error, _MEANT)):
        return error.__traceback__
    kept: TracebackType | None = None
    for link in reversed(links):
        if not _is_internal(link):
            kept = TracebackType(kept, link.tb_frame, link.tb_lasti, link.tb_lineno)
    return kept


def _is_internal(link: TracebackType) -> bool:
    return str(link.tb_frame.f_globals.get("__name__")).startswith(_INTERNAL)
