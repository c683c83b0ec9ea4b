"""The text that explains a failure to a person: what, where in the plan, and because of what."""

from __future__ import annotations

from collections.abc import Iterator

from planlang.failures import CompositeFailure, PlanFailure
from planlang.misuse import Usage

_EXPLAIN = Usage("explain", {"failure": "failure"})


def explain(failure: BaseException) -> str:
    """Several lines: the failure, where in the plan, what it was raised from, what else failed with it."""
    _EXPLAIN.instance("failure", failure, BaseException, "a failure, or another exception")
    lines: list[str] = []
    links = list(failure.chain()) if isinstance(failure, PlanFailure) else [failure]
    for number, link in enumerate(links):
        lead = "" if number == 0 else "because of "
        lines.extend(_explain_one(link, lead, "  " * number))
    return "\n".join(lines)


def _explain_one(link: BaseException, lead: str, indent: str) -> Iterator[str]:
    message = str(link)
    yield f"{indent}{lead}{type(link).__name__}: {message}" if message else f"{indent}{lead}{type(link).__name__}"
    if not isinstance(link, PlanFailure):
        return
    if link.where is not None:
        yield f"{indent}  in {link.where}"
    if isinstance(link, CompositeFailure):
        for name, member in zip(link.names, link.failures, strict=True):
            yield f"{indent}  branch {name}: {type(member).__name__}: {member}"
    for name, sibling in link.siblings:
        yield f"{indent}  at the same time, {name}: {type(sibling).__name__}: {sibling}"
    for cleanup in link.cleanup_failures:
        yield f"{indent}  during cleanup: {type(cleanup).__name__}: {cleanup}"
