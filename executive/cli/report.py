"""``planlang report``: a page of a recorded run, which is repeated, if possible, to find where things were."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from executive import api
from executive.cli.arguments import ReportArguments
from executive.cli.console import Answer, progress_of, say, waiting
from executive.options.declaring import check_written, values_of
from executive.options.running import SituationSettings
from executive.runs.files import RecipeFile, read, refuse
from executive.runs.options import RunOptions
from executive.runs.reporting import context_of
from executive.runs.traces import TraceHeader, bundled_recipe, recorded_run
from planlang.diagnostics import BadInput, Diagnostic, Span, error, warning
from planlang.outputs import write_text
from planlang.report import Context, Told, model_of, page
from planlang.runs import RecordedRun

_MODEL = re.compile(r'id="model">(.*?)</script>')
"""The model of a run in its page."""


def command(arguments: ReportArguments) -> Answer:
    """Write the page; raises BadInput."""
    recorded = recorded_run(arguments.trace)
    output = arguments.output or arguments.trace.with_suffix(".html")
    refuse(check_written(replace(arguments, output=output), ReportArguments, {"the trace": arguments.trace}))
    missing = _repeated(arguments, recorded, output)
    if missing:
        context = _context(arguments, recorded.header)
        missing = (*missing, *(_without_texts(context) if "robot" in recorded.header else ()))
        told = Told.of(line.record for line in recorded.lines)
        model = model_of(told, replace(context, missing=missing))
        if not arguments.force:
            _keep_fuller_page(output, model, missing)
        for line in missing if not arguments.is_silent else ():
            say(line)
        write_text(output, page(model))
    text = f"{output}: {'the run was repeated' if not missing else 'without the world'}"
    torn: list[Diagnostic] = []
    if recorded.torn:
        span = Span(recorded.name, len(recorded.lines) + 1)
        torn.append(warning("X026", "the last line is incomplete and left out", span))
    data = {"report": str(output), "repeated": not missing, "missing": list(missing)}
    return Answer(diagnostics=tuple(torn), text=text, data=data)


def _without_texts(context: Context) -> Iterator[str]:
    if context.plan is None:
        yield "The plan is not shown: it was not found, or is not the plan of the trace."
    if context.recipe is None:
        yield "The recipe is not shown: it was not found."


def _keep_fuller_page(output: Path, model: Mapping[str, Any], missing: Sequence[str]) -> None:
    """Raise BadInput if the new page lacks views of the page that it would replace."""
    lost = sorted(_views(_model_in(output)) - _views(model))
    if lost:
        message = f"{output} shows {', '.join(lost)}, the new page would not: {' '.join(missing)}"
        advice = "-o FILE writes the new page beside it; --force replaces the old one"
        raise BadInput([error("C005", message, help=advice)])


def _model_in(file: Path) -> Mapping[str, Any]:
    """Model in an existing page; empty if the file has none."""
    with suppress(OSError, ValueError):
        match = _MODEL.search(file.read_text(encoding="utf-8")) if file.is_file() else None
        model = json.loads(match[1]) if match is not None else None
        return model if isinstance(model, dict) else {}
    return {}


def _views(model: Mapping[str, Any]) -> set[str]:
    sources = [str(one.get("name")) for one in model.get("sources") or () if isinstance(one, dict)]
    return {name for name in ("scene", "map", "graph") if model.get(name)} | set(sources)


def _repeated(arguments: ReportArguments, recorded: RecordedRun, output: Path) -> tuple[str, ...]:
    """Repeat the run and write its page. Returns sentences that explain why that failed; empty if it was done."""
    if "robot" not in recorded.header:
        return ("The run was scripted, without a world: the page shows plan, lanes and failures only.",)
    try:
        options = RunOptions(
            **values_of(arguments, SituationSettings),
            recipe=arguments.file,
            report=output,
            repeated=recorded,
            long_work=progress_of(arguments),
            waiting=partial(waiting, arguments),
        )
        result = api.run(options)
    except BadInput as problem:
        first = problem.diagnostics[0]
        return (f"The world is not shown: the run could not be repeated: {first.message.splitlines()[0]}.",)
    if result.diagnostics and not output.exists():
        return ("The world is not shown: the run could not be repeated.",)
    return ()


def _context(arguments: ReportArguments, header: Mapping[str, Any]) -> Context:
    """Plan and recipe of a run that is not repeated, if they are found and match the trace."""
    with suppress(BadInput):
        source = read(arguments.file or TraceHeader(recipe=bundled_recipe(header)).plan(str(arguments.trace)))
        plan, recipe = (None, source) if isinstance(source, RecipeFile) else (source, None)
        return context_of(plan, None, recipe, frozenset(), arguments.folders, of=header)
    return Context()
