"""How the command answers: diagnostics and progress on stderr, results on stdout, for machines one JSON object."""

from __future__ import annotations

import errno
import json
import os
import sys
import traceback
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import typer

from planlang.diagnostics import BadInput, Diagnostic, Severity, error

DONE, FAILED, BAD_INPUT, MISSING_CAPABILITY, INTERNAL_ERROR, INTERRUPTED = 0, 1, 2, 3, 70, 130
"""Exit codes of the command."""

_FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS}
"""What a file system answers that takes no more."""

_COLOURS = {Severity.ERROR: typer.colors.RED, Severity.WARNING: typer.colors.YELLOW, Severity.NOTE: typer.colors.CYAN}


@dataclass(frozen=True, slots=True)
class Answer:
    """What a command came to."""

    exit_code: int = DONE
    diagnostics: tuple[Diagnostic, ...] = ()
    text: str = ""
    """The result for people, printed to stdout."""
    data: Mapping[str, Any] = field(default_factory=dict)
    """The result for machines: further keys of the JSON object."""


def answer(command: str, work: Callable[[], Answer], *, as_json: bool) -> None:
    """Do a command's work and say what it came to; always ends by raising ``typer.Exit``.

    A user's mistake is shown as diagnostics. A programming error is told in one line; with ``PLANLANG_TRACEBACK=1``
    in the environment its traceback is printed too.
    """
    try:
        reply = work()
    except BadInput as problem:
        reply = Answer(BAD_INPUT, problem.diagnostics)
    except KeyboardInterrupt:
        reply = Answer(INTERRUPTED, data={"error": "interrupted"})
        say("interrupted")
    except (BrokenPipeError, typer.Exit, typer.BadParameter):
        raise
    except Exception as problem:
        if isinstance(problem, OSError) and problem.errno in _FULL:
            told = "; ".join((f"what was to be written does not fit: {problem}", *getattr(problem, "__notes__", ())))
            reply = Answer(BAD_INPUT, (error("C004", told, help="make room on the disk, or name another place"),))
        else:
            reply = _internal_error(problem)
    if as_json:
        whole = {"command": command, "exit_code": reply.exit_code, **reply.data}
        whole["diagnostics"] = [diagnostic.as_json() for diagnostic in reply.diagnostics]
        typer.echo(json.dumps(whole, indent=2, ensure_ascii=False, default=str))
    else:
        show(reply.diagnostics)
        if reply.text:
            typer.echo(reply.text.removesuffix("\n"))
    raise typer.Exit(reply.exit_code)


def show(diagnostics: Iterable[Diagnostic]) -> None:
    """Print diagnostics to stderr, in their order, and how many there are of each severity.

    What helps several of them is told once.
    """
    counts: Counter[Severity] = Counter()
    told: set[str | None] = {None}
    for diagnostic in diagnostics:
        severity = diagnostic.severity
        counts[severity] += 1
        label = f"{severity.value} {diagnostic.code}"
        text = str(diagnostic if diagnostic.help not in told else replace(diagnostic, help=None))
        told.add(diagnostic.help)
        if _is_colourful():
            text = text.replace(label, typer.style(label, fg=_COLOURS[severity], bold=True), 1)
        typer.echo(text, err=True)
    if counts[Severity.ERROR] or counts[Severity.WARNING]:
        said = [_counted(counts[severity], severity.value) for severity in Severity if counts[severity]]
        typer.echo(", ".join(said), err=True)


def say(line: str) -> None:
    """Print one line of progress to stderr."""
    typer.echo(line, err=True)


def _counted(number: int, word: str) -> str:
    return f"{number} {word}" + ("s" if number != 1 else "")


def _is_colourful() -> bool:
    return sys.stderr.isatty() and "NO_COLOR" not in os.environ


def _internal_error(problem: Exception) -> Answer:
    where = traceback.extract_tb(problem.__traceback__)[-1]
    reason = f"{type(problem).__name__}: {problem}"
    say(f"internal error in {where.name} ({os.path.basename(where.filename)}:{where.lineno}): {reason}")
    if os.environ.get("PLANLANG_TRACEBACK"):
        say("".join(traceback.format_exception(problem)).removesuffix("\n"))
    else:
        say(
            "    help: this is a mistake in planlang, not in your input; PLANLANG_TRACEBACK=1 shows where it comes from"
        )
    return Answer(INTERNAL_ERROR, data={"error": f"internal error: {reason}"})
