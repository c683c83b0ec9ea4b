"""The result of a check."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from html import escape
from typing import Any

from planlang.diagnostics import Diagnostic
from planlang.notebooks import listed
from planlang.records import dataclass


@dataclass(frozen=True, slots=True)
class CheckResult:
    """Result of a check of a recipe, a plan, a map or a folder of recipes; notebooks display it."""

    ok: bool
    """True if there is no error."""
    kind: str
    """``recipe``, ``plan``, ``map``, ``ontology`` or ``folder``."""
    verdict: str
    """The result for people, without the diagnostics; may have several lines."""
    diagnostics: tuple[Diagnostic, ...] = ()
    data: Mapping[str, Any] = field(default_factory=dict)
    """Further data: task, fixes, state of a plan, recipes of a folder."""
    lacks_reasoner: bool = field(default=False, repr=False)
    """True if a reasoner was asked for, and it or Java is not installed."""

    @property
    def rows(self) -> list[dict[str, Any]]:
        """The diagnostics as rows, for ``pandas.DataFrame``: severity, code, message, file, line, column and help."""
        return [_row(one) for one in self.diagnostics]

    def __str__(self) -> str:
        return "\n".join([*map(str, self.diagnostics), *([self.verdict] if self.verdict else [])])

    def _repr_mimebundle_(self, include: object = None, exclude: object = None) -> dict[str, str]:
        verdict = f"<pre>{escape(self.verdict)}</pre>" if self.verdict else ""
        return {"text/plain": str(self), "text/html": listed(self.diagnostics) + verdict}


def _row(one: Diagnostic) -> dict[str, Any]:
    file, line, column = one.span or (None, None, None)
    about = {"severity": one.severity.value, "code": one.code, "message": one.message}
    return {**about, "file": file, "line": line, "column": column, "help": one.help}
