"""``planlang replay``: a plan is replayed from its trace; the first difference is shown side by side."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from executive.cli.arguments import ReplayArguments
from executive.cli.console import Answer, ExitCode
from executive.runs.options import RunOptions
from executive.runs.plan_run import Run
from executive.runs.prepared import prepared_to_replay
from executive.runs.traces import read_trace
from planlang.runs import Different

WIDTH = 56
"""Maximum length of a value [characters], of longer ones the end is shown: two columns fit into 120."""


def command(arguments: ReplayArguments) -> Answer:
    """Replay a trace; raises BadInput."""
    recorded, header = read_trace(arguments.trace)
    options = RunOptions(
        recipe=arguments.file,
        task=arguments.task,
        accept=arguments.accept,
        ontologies=arguments.ontologies,
        modules=arguments.modules,
        trust=arguments.trust,
        repeated=recorded,
    )
    with Run(prepared_to_replay(options, header)) as run:
        result = run.replay(recorded)
    data: dict[str, Any] = {"equal": result.equal, "lines": result.of, "repeated": result.lines}
    if result.difference is None:
        return Answer(ExitCode.DONE, tuple(run.found), f"{recorded.name}: {result}", data)
    data |= {"line": result.difference.line, "recorded": result.difference.recorded, "found": result.difference.found}
    text = "\n".join(_side_by_side(recorded.name, result.difference))
    return Answer(ExitCode.FAILED, tuple(run.found), text, data)


def _side_by_side(name: str, difference: Different) -> Iterator[str]:
    where = "after the last line" if difference.line is None else f"line {difference.line}"
    recorded, now = _texts(difference.recorded), _texts(difference.found)
    yield f"{name}: {where} is not repeated"
    if not recorded or not isinstance(difference.found, Mapping):
        yield from (f"  recorded  {key} {value}" for key, value in recorded.items())
        yield f"  found     {difference.found}"
        return
    keys = list(dict.fromkeys((*recorded, *now)))
    wide = max(map(len, keys))
    yield f"    {'':{wide}}  {'recorded':{WIDTH}}  found"
    for key in keys:
        one, other = recorded.get(key, ""), now.get(key, "")
        mark = " " if one == other else "*"
        yield f"  {mark} {key:{wide}}  {_end(one):{WIDTH}}  {_end(other)}".rstrip()


def _texts(record: object) -> dict[str, str]:
    """Values of a record as text."""
    if not isinstance(record, Mapping):
        return {}
    return {str(key): value if isinstance(value, str) else str(value) for key, value in record.items()}


def _end(text: str) -> str:
    return text if len(text) <= WIDTH else f"...{text[3 - WIDTH :]}"
