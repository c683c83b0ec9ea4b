"""The result of a command, and its output: diagnostics and progress on stderr, the rest on stdout, or all as JSON."""

from __future__ import annotations

import json
import os
import sys
import traceback
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import field, replace
from enum import IntEnum
from pathlib import Path
from typing import Any

import click

from executive.cli.arguments import Arguments, Detail
from executive.cli.progress import PROGRESS
from planlang.diagnostics import BadInput, Diagnostic, Severity, WrongOption
from planlang.machine import file_problem, out_of_resources
from planlang.outputs import write_text
from planlang.progress import Report, unreported
from planlang.records import dataclass
from planlang.visible import visible
from planlang.words import COMMAND_LINE, said


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


def text_answer(
    text: str, output: Path | None, told: str, diagnostics: Iterable[Diagnostic] = (), **data: Any
) -> Answer:
    """Answer with the text of a file: printed, or written to ``output`` and ``told`` of. Raises BadInput."""
    found = tuple(diagnostics)
    if output is None:
        return Answer(diagnostics=found, text=text, data={**data, "source": text})
    write_text(output, text)
    return Answer(diagnostics=found, text=f"{output}: {told}", data={**data, "output": str(output)})


_COLOURS = {Severity.ERROR: "red", Severity.WARNING: "yellow", Severity.NOTE: "cyan"}


def answer(command: str, work: Callable[[], Answer], *, as_json: bool, detail: Detail = Detail.CODES) -> None:
    """Do a command's work and print its result; always raises ``click.exceptions.Exit``.

    A user's mistake is shown as diagnostics. A programming error is reported in one line; with
    ``PLANLANG_TRACEBACK=1`` in the environment its traceback is printed too.
    """
    try:
        with usage():
            reply = work()
    except BadInput as problem:
        reply = Answer(ExitCode.BAD_INPUT, problem.diagnostics)
    except KeyboardInterrupt:
        reply = Answer(ExitCode.INTERRUPTED, data={"error": "interrupted"})
        say("interrupted")
    except (BrokenPipeError, click.exceptions.Exit, click.BadParameter):
        raise
    except Exception as problem:
        if (lacking := out_of_resources(problem)) is not None:
            reply = Answer(ExitCode.OUT_OF_RESOURCES, (lacking,))
        elif (full := file_problem(problem)) is not None:
            reply = Answer(ExitCode.BAD_INPUT, (full,))
        else:
            reply = _internal_error(problem)
    finally:
        PROGRESS.close()
    give(command, reply, as_json=as_json, detail=detail)
    raise click.exceptions.Exit(reply.exit_code)


@contextmanager
def usage() -> Iterator[None]:
    """Turn what is wrong with options into the usage error of click."""
    try:
        yield
    except WrongOption as problem:
        raise click.BadParameter(said(problem.diagnostics[0].message, COMMAND_LINE)) from None


def give(command: str, reply: Answer, *, as_json: bool, detail: Detail = Detail.CODES) -> None:
    """Print a result. Raises ``click.exceptions.Exit`` if stdout cannot be written."""
    if as_json:
        whole: dict[str, object] = {"command": command, "exit_code": int(reply.exit_code), **_in_words(reply.data)}
        whole["diagnostics"] = [diagnostic.said(COMMAND_LINE).as_json() for diagnostic in reply.diagnostics]
        text = json.dumps(whole, indent=2, ensure_ascii=False, default=str)
        if text != visible(text):
            text = json.dumps(whole, indent=2, default=str)
    else:
        show(reply.diagnostics, detail)
        text = said(reply.text, COMMAND_LINE).removesuffix("\n")
        if "source" not in reply.data or sys.stdout.isatty():  # a file keeps its characters
            text = visible(text)
    try:
        if text:
            # a name of a file need not be text, and a terminal need not have all characters
            encoding = sys.stdout.encoding or "utf-8"
            click.echo(text.encode(encoding, "backslashreplace").decode(encoding))
        sys.stdout.flush()
    except BrokenPipeError:
        raise
    except OSError as problem:  # a full disk, say; flushing the buffer at exit would fail again
        say(f"error: stdout cannot be written: {problem.strerror or problem}")
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise click.exceptions.Exit(ExitCode.BAD_INPUT) from None


def _in_words(data: Any) -> Any:
    """Say all texts in some data in the words of the command line."""
    if isinstance(data, str):
        return said(data, COMMAND_LINE)
    if isinstance(data, Mapping):
        return {key: _in_words(value) for key, value in data.items()}
    return [_in_words(one) for one in data] if isinstance(data, list | tuple) else data


def show(diagnostics: Iterable[Diagnostic], detail: Detail = Detail.CODES) -> None:
    """Print diagnostics to stderr, in their order, then the number of each severity.

    Equal helps are printed once; of diagnostics that ``detail`` groups only the first, with the number of others.
    """
    diagnostics = [one.said(COMMAND_LINE) for one in diagnostics]
    if detail is Detail.NONE:
        diagnostics = [one for one in diagnostics if one.severity is Severity.ERROR]
    per_kind = Counter(_kind(one, detail) for one in diagnostics)
    shown: set[object] = set()
    printed: set[str | None] = {None}
    PROGRESS.clear()
    for diagnostic in diagnostics:
        kind = _kind(diagnostic, detail)
        others = per_kind[kind] - 1
        if others and kind in shown:
            continue
        shown.add(kind)
        _print(diagnostic if diagnostic.help not in printed else replace(diagnostic, help=None), others)
        printed.add(diagnostic.help)
    counts = Counter(one.severity for one in diagnostics)
    if counts[Severity.ERROR] or counts[Severity.WARNING] or len(diagnostics) > len(shown):
        numbers = ((counts[one], one.value) for one in Severity if counts[one])
        listed = ", ".join(f"{number} {word}" + ("s" if number != 1 else "") for number, word in numbers)
        click.echo(listed + ("; --verbose lists all" if len(diagnostics) > len(shown) else ""), err=True)


def _kind(diagnostic: Diagnostic, detail: Detail) -> object:
    """Key of the group of which only the first diagnostic is printed; each error is a group of its own."""
    if diagnostic.severity is Severity.ERROR or detail in (Detail.ALL, Detail.NONE):
        return id(diagnostic)
    return diagnostic.severity, diagnostic.code, diagnostic.help if detail is Detail.ADVICE else None


def _print(diagnostic: Diagnostic, others: int) -> None:
    label = f"{diagnostic.severity.value} {diagnostic.code}"
    message = f"{diagnostic.message} (and {others} more {diagnostic.code})" if others else diagnostic.message
    text = str(replace(diagnostic, message=message))
    if sys.stderr.isatty() and "NO_COLOR" not in os.environ:
        text = text.replace(label, click.style(label, fg=_COLOURS[diagnostic.severity], bold=True), 1)
    click.echo(text, err=True)


def say(line: str) -> None:
    """Print one line to stderr."""
    PROGRESS.clear()
    click.echo(visible(said(line, COMMAND_LINE)), err=True)


def silent(_: object) -> None:
    """Print nothing, in place of :func:`say`."""


def printer_of(arguments: Arguments) -> Callable[[str], None]:
    """Function that prints a line about what the command does; prints nothing with ``--json`` or ``--quiet``."""
    return silent if arguments.is_silent else say


def progress_of(arguments: Arguments) -> Report:
    """Function that shows the progress of long work, unless the command is silent."""
    return unreported if arguments.is_silent else PROGRESS


def waiting(arguments: Arguments, what: Callable[[], str], most: float | None = None) -> AbstractContextManager[None]:
    """Show work whose end is unknown, unless the command is silent; see :meth:`Progress.during`."""
    return nullcontext() if arguments.is_silent else PROGRESS.during(what, most)


def _internal_error(problem: Exception) -> Answer:
    where = traceback.extract_tb(problem.__traceback__)[-1]
    reason = f"{type(problem).__name__}: {problem}"
    say(f"internal error in {where.name} ({os.path.basename(where.filename)}:{where.lineno}): {reason}")
    if os.environ.get("PLANLANG_TRACEBACK"):
        say("".join(traceback.format_exception(problem)).removesuffix("\n"))
    else:
        say("    help: this is a bug in planlang, not in your input; PLANLANG_TRACEBACK=1 prints the traceback")
    return Answer(ExitCode.INTERNAL_ERROR, data={"error": f"internal error: {reason}"})
