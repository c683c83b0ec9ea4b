"""Diagnostics for bad input: positions, severities, codes, and the one renderer."""

from __future__ import annotations

import traceback
from collections.abc import Iterable, Sequence
from dataclasses import asdict, replace
from enum import Enum
from typing import NamedTuple

from planlang.records import dataclass
from planlang.visible import visible
from planlang.words import Face, Option, Part, Text, said


class Severity(Enum):
    """Severity of a diagnostic; only errors stop the work."""

    ERROR = "error"
    WARNING = "warning"
    NOTE = "note"


class Span(NamedTuple):
    """A position in a file; line and column count from 1."""

    file: str
    line: int = 1
    column: int = 1

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}"


@dataclass(frozen=True, slots=True)
class Rename:
    """Replace an undefined name (IRI) by a similar one; ``is_sure`` if no other name is nearly as similar."""

    written: str
    meant: str
    is_sure: bool = False

    def __str__(self) -> str:
        written, meant = self.written, self.meant
        short = meant.rsplit("#", 1)[-1].rsplit("/", 1)[-1]
        is_elsewhere = written.removesuffix(written.rsplit("#", 1)[-1]) != meant.removesuffix(meant.rsplit("#", 1)[-1])
        return f"`{short}` ({meant})" if is_elsewhere else f"`{short}`"


@dataclass(frozen=True, slots=True)
class Order:
    """Add an ordering to a task: one step before another (all IRIs)."""

    task: str
    before: str
    after: str


@dataclass(frozen=True, slots=True)
class Declaration:
    """Declare an XML entity; ``is_sure`` if only one value is known for it."""

    entity: str
    value: str
    is_sure: bool = True

    def __str__(self) -> str:
        return f'<!ENTITY {self.entity} "{self.value}">'


Suggestion = Rename | Order | Declaration
"""A change to the file that the help proposes."""


@dataclass(frozen=True, slots=True)
class Diagnostic:
    """One message about the user's input; docs/reference/codes.md explains each ``code``.

    ``suggestion`` is the help as a change to the file, if it can be expressed as one.
    """

    severity: Severity
    code: str
    message: str
    span: Span | None = None
    help: str | None = None
    suggestion: Suggestion | None = None

    def __str__(self) -> str:
        where = f"{self.span}: " if self.span else ""
        text = f"{where}{self.severity.value} {self.code} {self.message}"
        return visible(f"{text}\n    help: {self.help}" if self.help else text)

    def said(self, face: Face) -> Diagnostic:
        """Say it in the words of a face, also where its file is an option; ``str()`` has the words of Python."""
        help = None if self.help is None else said(self.help, face)
        span = None if self.span is None else self.span._replace(file=said(self.span.file, face))
        return replace(self, message=said(self.message, face), help=help, span=span)

    def as_json(self) -> dict[str, object]:
        """Convert to a JSON object; span and help may be null, the suggestion may be missing."""
        suggestion = {"suggestion": asdict(self.suggestion)} if self.suggestion is not None else {}
        return {
            "severity": self.severity.value,
            "code": self.code,
            "message": self.message,
            "span": self.span._asdict() if self.span else None,
            "help": self.help,
            **suggestion,
        }


class BadInput(Exception):
    """Input that cannot be used; carries all diagnostics found."""

    def __init__(self, diagnostics: Sequence[Diagnostic]) -> None:
        self.diagnostics = tuple(diagnostics)
        super().__init__("\n".join(map(str, diagnostics)))

    def _render_traceback_(self) -> list[str]:
        """Show the diagnostics alone in a notebook: the stack below the call says nothing about the input."""
        return [str(self)]


class WrongOption(BadInput):
    """Options that contradict each other, or a value that an option cannot have (C040)."""

    def __init__(self, *message: Part) -> None:
        super().__init__([error("C040", Text(*message))])


def error(
    code: str,
    message: str,
    span: Span | None = None,
    help: str | None = None,
    suggestion: Suggestion | None = None,
) -> Diagnostic:
    """Make an error: the input cannot be used."""
    return Diagnostic(Severity.ERROR, code, message, span, help, suggestion)


def warning(
    code: str,
    message: str,
    span: Span | None = None,
    help: str | None = None,
    suggestion: Suggestion | None = None,
) -> Diagnostic:
    """Make a warning: the input can be used, but is probably not what its author meant."""
    return Diagnostic(Severity.WARNING, code, message, span, help, suggestion)


def note(code: str, message: str, span: Span | None = None, help: str | None = None) -> Diagnostic:
    """Make a note: something was repaired or assumed."""
    return Diagnostic(Severity.NOTE, code, message, span, help)


GO_ON = Text(Option("ignore_unread", True), " goes on without it")
"""Advice about what cannot be read of a map."""


def unread(code: str, message: str, span: Span | None = None, help: str | None = None) -> Diagnostic:
    """Make an error about something of a map that has a shape or a pose, and is not in the world as the map states it.

    It would be an obstacle that nobody sees, or a thing at another place. Where a map states no shape at all, nothing
    is unread: the object is a mere place. The option ``ignore_unread`` makes a warning of it.
    """
    return error(code, message, span, Text(help, "; ", GO_ON) if help else GO_ON)


def settled(found: Iterable[Diagnostic], *, ignore_unread: bool) -> list[Diagnostic]:
    """Return the diagnostics of reading a map; with ``ignore_unread``, its errors are warnings.

    Otherwise raises BadInput with all of them if one is an error.
    """
    found = list(found)
    if not ignore_unread and has_errors(found):
        raise BadInput(found)
    return [replace(one, severity=Severity.WARNING) if one.severity is Severity.ERROR else one for one in found]


def has_errors(diagnostics: Iterable[Diagnostic]) -> bool:
    """Check whether any diagnostic is an error."""
    return any(d.severity is Severity.ERROR for d in diagnostics)


def line_in(problem: BaseException, file: str) -> int | None:
    """Line of a file of Python that an exception passed last, or that a SyntaxError names."""
    lines = [frame.lineno for frame in traceback.extract_tb(problem.__traceback__) if frame.filename == file]
    return lines[-1] if lines else getattr(problem, "lineno", None)
