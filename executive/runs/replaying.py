"""Replays the run of a trace: no world, no robot; the first difference is shown side by side."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

from executive.cli.console import DONE, FAILED, Answer
from executive.runs.plan_files import compiled_plan, import_plan, main_plan
from executive.runs.resuming import parameters_of, sha256, told
from executive.runs.running import BUDGET
from planlang import budget
from planlang.diagnostics import BadInput, Diagnostic, Span, error, warning
from planlang.language.plans import Plan
from planlang.language.replaying import replay
from planlang.ontology import load
from planlang.runs import Different, RecordedRun

WIDTH = 56
"""Characters of a value that are shown; of longer ones the end."""


def replay_trace(
    recorded: RecordedRun,
    *,
    plan: Path | None = None,
    recipe: Path | None = None,
    task: str | None = None,
    folders: tuple[Path, ...] = (),
    allow_abstract: bool = False,
) -> Answer:
    """Replay with a plan or recipe; exit code 1 at a difference. Raises BadInput for input that cannot be used."""
    with ExitStack() as stack:
        found: list[Diagnostic] = []
        if plan is None:
            assert recipe is not None
            read = load(recipe, folders=folders)
            plan, _ = compiled_plan(read, stack, found, task=task, allow_abstract=allow_abstract)
            task = None
        if sha256(plan) != recorded.header.get("plan_sha256"):
            found.append(warning("X022", "the plan is another one than that of the trace", Span(recorded.name)))
        function = main_plan(import_plan(plan), task)
        try:
            result = replay(_as_run(function, recorded), recorded)
        except ValueError as problem:
            raise BadInput([error("X020", str(problem), Span(recorded.name, 1))]) from None
    data: dict[str, Any] = {"equal": result.equal, "lines": result.of, "repeated": result.lines}
    if result.difference is None:
        return Answer(DONE, tuple(found), f"{recorded.name}: {result}", data)
    data |= {"line": result.difference.line, "recorded": result.difference.recorded, "found": result.difference.found}
    return Answer(FAILED, tuple(found), "\n".join(_side_by_side(recorded.name, result.difference)), data)


def _as_run(plan: Plan[Any, Any], recorded: RecordedRun) -> Callable[[], Awaitable[Any]]:
    """The plan with its parameters and budget, as ``planlang run`` runs it."""
    bound = parameters_of(recorded, plan)

    async def body() -> Any:
        return await budget(partial(plan, **bound), seconds=BUDGET)

    body.__name__ = plan.name
    return body


def _side_by_side(name: str, difference: Different) -> list[str]:
    where = "after the last line" if difference.line is None else f"line {difference.line}"
    recorded = told(difference.recorded)
    found = told(difference.found)
    if not recorded or not isinstance(difference.found, Mapping):
        return [
            f"{name}: {where} is not repeated",
            *(f"  recorded  {key} {value}" for key, value in recorded.items()),
            f"  found     {difference.found}",
        ]
    keys = list(dict.fromkeys((*recorded, *found)))
    wide = max(map(len, keys))
    lines = [f"{name}: {where} is not repeated", f"    {'':{wide}}  {'recorded':{WIDTH}}  found"]
    for key in keys:
        one, other = recorded.get(key, ""), found.get(key, "")
        mark = " " if one == other else "*"
        lines.append(f"  {mark} {key:{wide}}  {_end(one):{WIDTH}}  {_end(other)}".rstrip())
    return lines


def _end(text: str) -> str:
    return text if len(text) <= WIDTH else f"...{text[3 - WIDTH :]}"
