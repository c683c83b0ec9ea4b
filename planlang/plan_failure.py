"""The root of the failures of plans: its message, the place and the causes, and what failed beside it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import field, fields
from typing import Any, ClassVar, Self

from planlang.records import dataclass


@dataclass(frozen=True, slots=True)
class Where:
    """The place in the plan where a failure arose: task path, source line, revision of the belief if known."""

    path: str
    file: str = ""
    line: int = 0
    revision: int | None = None

    def __str__(self) -> str:
        return f"{self.path} ({self.file}:{self.line})" if self.file else self.path


@dataclass(eq=False, repr=False)
class PlanFailure(Exception):
    """A failure that a plan may handle.

    The message is ``message``, or else is built from the fields. ``where`` is filled in by the first construct that
    the failure passes; ``siblings`` are failures of other branches that died at the same decision, by branch name;
    ``cleanup_failures`` are those of branches that were evaporated because of this one, each named in a note, too.
    """

    message: str = ""
    where: Where | None = field(default=None, init=False)
    siblings: tuple[tuple[str, PlanFailure], ...] = field(default=(), init=False)
    cleanup_failures: tuple[PlanFailure, ...] = field(default=(), init=False)

    text: ClassVar[str] = "the plan failed"

    def __str__(self) -> str:
        return self.message or self.describe()

    def __repr__(self) -> str:
        return f"{type(self).__name__}({str(self)!r})"

    def describe(self) -> str:
        """Return the message that the fields make."""
        details = in_words(self.details())
        return f"{self.text}: {details}" if details else self.text

    def details(self) -> dict[str, Any]:
        """Return the typed fields that are known, by name, in order of definition."""
        skipped = {"message", "where", "siblings", "cleanup_failures"}
        own = ((f.name, getattr(self, f.name)) for f in fields(self) if f.name not in skipped)
        return {name: value for name, value in own if value not in (None, (), "") and value != {}}

    def chain(self) -> Iterator[BaseException]:
        """Yield the failure itself, then what it was raised from, and so on."""
        seen: set[int] = set()
        link: BaseException | None = self
        while link is not None and id(link) not in seen:
            seen.add(id(link))
            yield link
            link = link.__cause__ or (None if link.__suppress_context__ else link.__context__)

    @classmethod
    def caused_by(cls, failure: PlanFailure) -> Self:
        """Return a failure of this class that has the fields it shares with ``failure``, and that as its cause."""
        names = (f.name for f in fields(cls) if f.init and f.name != "message" and hasattr(failure, f.name))
        raised = cls(**{name: getattr(failure, name) for name in names})
        raised.__cause__ = failure
        return raised


PlanFailure.__module__ = "planlang.failures"  # where plans import it from, and as what traces name it


def in_words(details: Mapping[str, Any]) -> str:
    """Return fields of a failure as a message states them, first the object that it is about, which needs no name."""
    about = [_plain(details["what"])] if "what" in details else []
    others = (f"{name.replace('_', ' ')} {_plain(value)}" for name, value in details.items() if name != "what")
    return ", ".join([*about, *others])


def attach_cleanup(error: BaseException, failures: Iterable[PlanFailure]) -> None:
    """Attach failures of cleanups to what is raised: a note for each, and in a plan failure ``cleanup_failures``."""
    others = tuple(failure for failure in failures if failure is not error)
    if isinstance(error, PlanFailure):
        error.cleanup_failures += others
    for other in others:
        error.add_note(f"during cleanup: {type(other).__name__}: {other}{f' in {other.where}' if other.where else ''}")


def _plain(value: object) -> str:
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, tuple):
        return f"({', '.join(map(_plain, value))})"
    return str(value)
