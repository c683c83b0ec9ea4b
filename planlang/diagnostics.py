"""Diagnostics for bad input: positions, severities, codes, and the one renderer."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from enum import Enum


class Severity(Enum):
    """How bad it is. Only errors stop."""

    ERROR = "error"
    WARNING = "warning"
    NOTE = "note"


@dataclass(frozen=True, slots=True, order=True)
class Span:
    """A position in a file; line and column count from 1."""

    file: str
    line: int = 1
    column: int = 1

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}"


@dataclass(frozen=True, slots=True)
class Diagnostic:
    """One message about the user's input. ``code`` is a key of :data:`CODES`."""

    severity: Severity
    code: str
    message: str
    span: Span | None = None
    help: str | None = None

    def __str__(self) -> str:
        where = f"{self.span}: " if self.span else ""
        text = f"{where}{self.severity.value} {self.code} {self.message}"
        return f"{text}\n    help: {self.help}" if self.help else text

    def as_json(self) -> dict[str, object]:
        """A JSON object with severity, code, message, span (or null) and help (or null)."""
        return {
            "severity": self.severity.value,
            "code": self.code,
            "message": self.message,
            "span": asdict(self.span) if self.span else None,
            "help": self.help,
        }


class BadInput(Exception):
    """Input that cannot be used; carries all diagnostics found."""

    def __init__(self, diagnostics: Sequence[Diagnostic]) -> None:
        self.diagnostics = tuple(diagnostics)
        super().__init__("\n".join(map(str, diagnostics)))


def error(code: str, message: str, span: Span | None = None, help: str | None = None) -> Diagnostic:
    """An error: the input cannot be used."""
    return Diagnostic(Severity.ERROR, code, message, span, help)


def warning(code: str, message: str, span: Span | None = None, help: str | None = None) -> Diagnostic:
    """A warning: usable, but probably not what was meant."""
    return Diagnostic(Severity.WARNING, code, message, span, help)


def note(code: str, message: str, span: Span | None = None, help: str | None = None) -> Diagnostic:
    """A note: what was repaired or assumed."""
    return Diagnostic(Severity.NOTE, code, message, span, help)


def has_errors(diagnostics: Iterable[Diagnostic]) -> bool:
    """True if any of them is an error."""
    return any(d.severity is Severity.ERROR for d in diagnostics)


CODES: dict[str, str] = {
    # O: reading ontologies
    # R: recipes
    # M: maps and worlds
    # B: binding robots
    # X: running
    # C: command line
    "C001": "a file or folder that was named is not there or cannot be read",
    "C002": "the file is neither a recipe nor a plan",
    "C003": "the file is Python, but no plan",
    "C004": "an output cannot be written where it was asked for",
    "C005": "an output would overwrite what a person wrote",
    "C006": "the plan of an earlier recipe was kept under another name",
    "C007": "a plan was given where a recipe is needed",
    "C008": "the robot or the environment is not named and has no default",
    "C009": "the recipe has changed since the plan was compiled from it",
    "C010": "the plan was edited since it was compiled",
    "C011": "the recipe of a plan was not found",
    "C012": "recordings need a package that is not installed",
}
"""Code -> what it means, one line each; the README's table is made from it."""
