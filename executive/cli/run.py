"""``planlang run``: a plan or recipe is executed in a simulated world, or the run of a trace resumed."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from executive import api
from executive.cli.arguments import RunArguments
from executive.cli.console import Answer, ExitCode, printer_of, progress_of, show, silent, waiting
from executive.runs.options import Outcome, RunOptions, RunResult
from planlang.diagnostics import Diagnostic
from planlang.progress import unreported, unwatched


def command(arguments: RunArguments, *, recipes: tuple[Path, ...] = ()) -> Answer:
    """Run or resume a plan; ``recipes`` are further files with recipes of its steps. Raises BadInput."""
    at_work = unwatched if arguments.watch_tree else partial(waiting, arguments)
    options = RunOptions.of(
        arguments,
        recipes=recipes,
        inner_actions=arguments.verbose,
        progress=silent if arguments.watch_tree else printer_of(arguments),
        long_work=unreported if arguments.watch_tree else progress_of(arguments),
        waiting=at_work,
        announce=silent if arguments.json else partial(show, detail=arguments.detail),
    )
    with at_work(lambda: "preparing the run"):  # up to its first line
        result = api.run(options)
    return _answer(result, result.diagnostics if arguments.json else ())  # otherwise they were announced


def _answer(result: RunResult, diagnostics: tuple[Diagnostic, ...]) -> Answer:
    code = {
        Outcome.DONE: ExitCode.DONE,
        Outcome.FAILED: ExitCode.FAILED,
        Outcome.LACKS_CAPABILITY: ExitCode.MISSING_CAPABILITY,
        Outcome.INTERRUPTED: ExitCode.INTERRUPTED,
    }[result.outcome]
    if result.claimed and not result.reached:
        code = ExitCode.FAILED
    if result.as_expected is not None:
        code = ExitCode.DONE if result.as_expected else ExitCode.FAILED
    return Answer(code, diagnostics, str(result), result.as_json())
