"""The result of a command, before it is printed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from enum import IntEnum
from typing import Any

from executive.commands.checked import CheckResult
from planlang.diagnostics import Diagnostic
from planlang.records import dataclass


class ExitCode(IntEnum):
    """Exit codes of the command; after a signal, 128 plus its number: 130 for Ctrl-C."""

    DONE = 0
    FAILED = 1
    BAD_INPUT = 2
    MISSING_CAPABILITY = 3
    INTERNAL_ERROR = 70
    OUT_OF_RESOURCES = 71
    INTERRUPTED = 130


@dataclass(frozen=True, slots=True)
class Answer:
    """Result of a command."""

    exit_code: ExitCode = ExitCode.DONE
    diagnostics: tuple[Diagnostic, ...] = ()
    text: str = ""
    """The result for people, printed to stdout."""
    data: Mapping[str, Any] = field(default_factory=dict)
    """The result for machines: further keys of the JSON object."""


def answer_of(checked: CheckResult) -> Answer:
    """The answer of a command that checks a file."""
    code = ExitCode.DONE if checked.ok else ExitCode.BAD_INPUT
    code = ExitCode.MISSING_CAPABILITY if checked.lacks_reasoner else code
    return Answer(code, checked.diagnostics, checked.verdict, {"kind": checked.kind, **checked.data})
