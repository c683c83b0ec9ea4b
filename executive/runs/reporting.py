"""What the page of a run shows beside its trace and its world: plan and recipe, their lines, words and graph."""

from __future__ import annotations

import hashlib
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from executive.runs.options import RunOptions
from executive.runs.plan_files import compiled
from executive.runs.settings import in_header
from planlang.diagnostics import BadInput
from planlang.files import Bundled, decode, read_file
from planlang.ontology import load
from planlang.outputs import LONGEST, header
from planlang.report import Context
from planlang.report.sources import labels_of, plan_source, recipe_source

if TYPE_CHECKING:
    from planlang.compiler.compile import CompiledPlan


def context_of(
    plan: Path | None,
    made: CompiledPlan | None,
    recipe: Path | None,
    performed: frozenset[str],
    folders: Sequence[Path] = (),
    *,
    of: Mapping[str, Any] | None = None,
) -> Context:
    """Return the context of a run by a plan, by what was compiled for it, or by a recipe that is compiled now.

    For a plan that was compiled before, the recipe that its header names is read. What is not there any more, or
    cannot be read, is left out; so is the text of a plan that is not that of the trace with the header ``of``.
    """
    text = None if plan is None else _text(plan)
    if plan is not None and text is not None and made is None and (origin := header(text[:LONGEST])) is not None:
        recipe = origin.find_recipe(plan, folders)
        made = None if recipe is None else _compiled(recipe, origin.task, performed, folders)
    elif made is None and recipe is not None:
        made = _compiled(recipe, None, performed, folders)
    if text is None and made is not None:
        text = made.source
    name = f"{made.functions[-1]}.py" if plan is None and made is not None else "plan.py" if plan is None else plan.name
    if of is not None and text is not None and of.get("plan_sha256") != hashlib.sha256(text.encode()).hexdigest():
        text = None
    shown = Context(None if text is None else plan_source(name, text))
    if made is None:
        return shown
    source = None if recipe is None else _text(recipe)
    return replace(
        shown,
        recipe=None if recipe is None or source is None else recipe_source(made.recipes, recipe.name, source),
        labels=labels_of(made.recipes),
        graph=made.graph.graph,
    )


def command_of(options: RunOptions, start: Sequence[float], bindings: Mapping[str, str], *, forced: bool) -> str:
    """Return the command line that repeats a run; files that do not come with planlang are named without folders.

    ``bindings`` are those of the plan's parameters that are not its own, ``forced`` runs lack something.
    """
    words = ["planlang", "run"]
    words += [_named(path, Bundled.RECIPE) for path in (options.plan or options.recipe,) if path is not None]
    words += ["--task", options.task] if options.task is not None else []
    for option, kind, path in (
        ("--robot", Bundled.ROBOT, options.robot),
        ("--environment", Bundled.ENVIRONMENT, options.environment),
    ):
        words += [] if path is None else [option, _named(path, kind)]
    words += [word for path in options.additions for word in ("--environment", path.name)]
    words += [f"--start={','.join(f'{number:g}' for number in start)}", "--seed", str(options.seed)]
    words += [] if options.schedule is None else ["--schedule", str(options.schedule)]
    words += [word for name, value in bindings.items() for word in ("--set", f"{name}={value}")]
    for setting in in_header():
        values, option = getattr(options, setting) or (), f"--{setting.replace('_', '-')}"
        stated = [one.name if isinstance(one, Path) else str(one) for one in (() if values is True else values)]
        words += [option] if values is True else [word for one in stated for word in (option, one)]
    return shlex.join([*words, *(["--force"] if forced else [])])


def _named(path: Path, kind: Bundled) -> str:
    return path.name.partition(".")[0] if path.parent == kind.folder else path.name


def _compiled(
    recipe: Path, task: str | None, performed: frozenset[str], folders: Sequence[Path]
) -> CompiledPlan | None:
    try:
        return compiled(load(recipe, folders=folders), task, performed)
    except BadInput:
        return None


def _text(file: Path) -> str | None:
    try:
        return decode(read_file(file), file.name)
    except BadInput:
        return None
