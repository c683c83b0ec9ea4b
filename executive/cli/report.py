"""``planlang report``: a page that shows the run of a trace, repeated to see where things were, if that can be done."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from executive.cli.arguments import ReportArguments, RunArguments, SituationArguments
from executive.cli.console import Answer, silent
from executive.cli.inputs import RecipeFile, read, refuse
from executive.cli.run import options_of
from executive.runs.plan_run import run_plan_file
from executive.runs.reporting import context_of
from executive.runs.traces import TraceHeader, damaged
from planlang.diagnostics import BadInput, Diagnostic, Span, error, warning
from planlang.outputs import check_outputs, write_text
from planlang.report import Context, Told, model_of, page
from planlang.runs import DamagedTrace, RecordedRun


def command(arguments: ReportArguments) -> Answer:
    """Write the page; raises BadInput."""
    output = arguments.output or arguments.trace.with_suffix(".html")
    refuse(check_outputs({"--output": output}, {"the trace": arguments.trace}, force=arguments.force))
    recorded = _recorded(arguments.trace)
    missing = _repeated(arguments, recorded, output)
    if missing:
        context = replace(_context(arguments, recorded.header), missing=missing)
        told = Told.of(line.record for line in recorded.lines)
        write_text(output, page(model_of(told, context)))
    text = "\n".join([f"{output}: {'the run was repeated' if not missing else 'without the world'}", *missing])
    torn: list[Diagnostic] = []
    if recorded.torn:
        span = Span(recorded.name, len(recorded.lines) + 1)
        torn.append(warning("X026", "the last line is incomplete and left out", span))
    data = {"report": str(output), "repeated": not missing, "missing": list(missing)}
    return Answer(diagnostics=tuple(torn), text=text, data=data)


def _recorded(path: Path) -> RecordedRun:
    try:
        return RecordedRun.read(path)
    except OSError as problem:
        raise BadInput([error("C001", f"{path} cannot be read: {problem.strerror}")]) from None
    except DamagedTrace as damage:
        raise BadInput([damaged(str(path), damage)]) from None


def _repeated(arguments: ReportArguments, recorded: RecordedRun, output: Path) -> tuple[str, ...]:
    """Repeat the run and write its page; return why that cannot be, in sentences, nothing if it was done."""
    if "robot" not in recorded.header:
        return ("The run had no world: it was scripted, so there are plan, lanes and failures only.",)
    try:
        options = options_of(_as_run(arguments))
        result = run_plan_file(
            replace(options, report=output, trace=None, repeats=True, announce=lambda found: None, progress=silent)
        )
    except BadInput as problem:
        first = problem.diagnostics[0]
        return (f"The world is not shown, as the run could not be repeated: {first.message.splitlines()[0]}.",)
    if result.diagnostics and not output.exists():
        return ("The world is not shown, as the run could not be repeated.",)
    return ()


def _as_run(arguments: ReportArguments) -> RunArguments:
    """Return the arguments by which ``planlang run --resume`` would be asked for the same run."""
    same = {one.name: getattr(arguments, one.name) for one in fields(SituationArguments)}
    return RunArguments(**same, file=arguments.file, resume=arguments.trace)


def _context(arguments: ReportArguments, header: Mapping[str, Any]) -> Context:
    """Return plan and recipe of a run that is not repeated, as far as they are there and those of the trace."""
    named = arguments.file or header.get("plan")
    with suppress(BadInput):
        found = read(arguments.file or TraceHeader(recipe=str(named)).plan(str(arguments.trace)))
        is_recipe = isinstance(found, RecipeFile)
        plan, recipe = (None, found.path) if is_recipe else (found.path, None)
        return context_of(plan, None, recipe, frozenset(), arguments.folders, of=header)
    return Context()
