"""Root class of plan failures: message, place, causes, and failures of sibling branches."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import field, fields
from typing import Any, ClassVar, Self

from planlang.failure_wording import in_words
from planlang.records import dataclass


@dataclass(frozen=True, slots=True)
class Where:
    """Place in the plan where a failure arose: task path, source line and, if known, revision of the belief."""

    path: str
    file: str = ""
    line: int = 0
    revision: int | None = None

    def __str__(self) -> str:
        return f"{self.path} ({self.file}:{self.line})" if self.file else self.path


@dataclass(eq=False, repr=False)
class PlanFailure(Exception):
    """A failure that a plan may handle.

    The text is ``message`` or, without one, built from the fields. The first construct that the failure passes sets
    ``where``. ``siblings`` are the failures of other branches that ended in the same decision, by branch name;
    ``cleanup_failures`` those of branches that were evaporated because of this failure, also attached as notes.
    ``afterwards`` are sentences about what the robot did once the failure had ended the plan: where it has put what it
    held.
    """

    message: str = ""
    where: Where | None = field(default=None, init=False)
    siblings: tuple[tuple[str, PlanFailure], ...] = field(default=(), init=False)
    cleanup_failures: tuple[PlanFailure, ...] = field(default=(), init=False)
    afterwards: tuple[str, ...] = field(default=(), init=False)

    text: ClassVar[str] = "the plan failed"

    def __str__(self) -> str:
        return self.message or self.describe()

    def __repr__(self) -> str:
        return f"{type(self).__name__}({str(self)!r})"

    def describe(self) -> str:
        """Build the message from the fields."""
        details = in_words(self.details())
        return f"{self.text}: {details}" if details else self.text

    def details(self) -> dict[str, Any]:
        """Return the fields that have a value, by name, in order of definition."""
        skipped = {"message", "where", "siblings", "cleanup_failures", "afterwards"}
        own = ((f.name, getattr(self, f.name)) for f in fields(self) if f.name not in skipped)
        return {name: value for name, value in own if value not in (None, (), "") and value != {}}

    def chain(self) -> Iterator[BaseException]:
        """Yield the failure, its cause, the cause of that, and so on."""
        seen: set[int] = set()
        link: BaseException | None = self
        while link is not None and id(link) not in seen:
            seen.add(id(link))
            yield link
            link = link.__cause__ or (None if link.__suppress_context__ else link.__context__)

    @classmethod
    def caused_by(cls, failure: PlanFailure) -> Self:
        """Make a failure of this class from ``failure``: copy the fields that both have, and set it as the cause."""
        names = (f.name for f in fields(cls) if f.init and f.name != "message" and hasattr(failure, f.name))
        raised = cls(**{name: getattr(failure, name) for name in names})
        raised.__cause__ = failure
        return raised


def links_of(problem: BaseException) -> list[BaseException]:
    """List an exception and, if it is a failure of a plan, its causes, the nearest first."""
    return list(problem.chain()) if isinstance(problem, PlanFailure) else [problem]


def each_once(links: Sequence[BaseException]) -> list[BaseException]:
    """List causes without those that repeat class and message: one raised again on its way, of which the last stays."""
    return list({(type(link), str(link)): link for link in reversed(links)}.values())[::-1]


PlanFailure.__module__ = "planlang.failures"  # plans import it from there, and traces name it so


def attach_cleanup(error: BaseException, failures: Iterable[PlanFailure]) -> None:
    """Attach failures of cleanups to an exception, as notes and, for a plan failure, as ``cleanup_failures``."""
    others = tuple(failure for failure in failures if failure is not error)
    if isinstance(error, PlanFailure):
        error.cleanup_failures += others
    for other in others:
        error.add_note(f"during cleanup: {type(other).__name__}: {other}{f' in {other.where}' if other.where else ''}")
