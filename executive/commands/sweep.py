"""Sweeps: a plan or recipe is run in many worlds, each in a process of its own."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from executive.options.declaring import as_json, check_written, stated, values_of
from executive.options.running import SituationSettings, SweepOptions
from executive.runs.files import RecipeFile, refuse
from executive.runs.options import RunOptions
from executive.runs.prepared import RunFiles, prepared
from executive.sweeps import Row, World, run
from executive.sweeps.records import LIMITS, Done
from planlang.diagnostics import Diagnostic
from planlang.language.source import PlanSource
from planlang.words import COMMAND_LINE, calling

JOB = "executive.commands.swept_world:ended"
_WALL_PER_CPU = 5.0
"""Wall-clock limit of a world in multiples of its CPU limit: other programs may use the cores, too."""


def swept(
    options: SweepOptions,
    *,
    announce: Callable[[Sequence[Diagnostic]], object] = lambda found: None,
    finished: Callable[[Done], object] = lambda done: None,
    resumed: Callable[[Sequence[Row]], object] = lambda rows: None,
) -> list[Row]:
    """Run a sweep, or the rest of it, and return its rows in the order of the worlds. Raises BadInput.

    ``announce`` gets diagnostics before the first world, ``resumed`` the rows of an earlier call, ``finished`` each
    world that is done.
    """
    run_options = RunOptions(**values_of(options, SituationSettings), recipe=options.recipe)
    files = prepared(run_options)  # reports what is wrong for all worlds before the first
    refuse(check_written(options, SweepOptions, dict(_inputs(files))))
    announce(files.notes)
    given = as_json(run_options, SituationSettings)
    plan = files.file.text if isinstance(files.file, PlanSource) and files.file.is_in_memory else options.recipe
    recipe = os.fspath(plan) if isinstance(plan, str | os.PathLike) else files.file.path.name
    named = files.file.path.name if "\n" in recipe else recipe
    told = dict(stated(run_options, SituationSettings))
    worlds: list[World] = [
        {
            "world": seed,
            "repeat": COMMAND_LINE.call(calling("run", named, **told, seed=seed)),
            "options": {**given, "recipe": recipe, "seed": seed},
            **({} if options.reports is None else {"report": str(options.reports / f"world-{seed}.html")}),
        }
        for seed in range(options.first, options.first + options.worlds)
    ]
    return run(
        worlds,
        JOB,
        processes=options.processes,
        limits=replace(
            LIMITS,
            seconds=options.seconds,
            memory=options.memory * 1_000_000,
            wall=_WALL_PER_CPU * options.seconds,
        ),
        out=options.output,
        about=_about(options, COMMAND_LINE.call(calling("run", named, **told)), files),
        shard=options.shard or (1, 1),
        told=finished,
        resumed=resumed,
    )


def _inputs(files: RunFiles) -> Iterator[tuple[str, Path]]:
    """Yield names and paths of the files that the runs depend on."""
    file, options = files.file, files.options
    is_file = not (file.is_in_memory if isinstance(file, PlanSource) else file.content is not None)
    named = {"recipe" if isinstance(file, RecipeFile) else "plan": file.path if is_file else None}
    named |= {"robot": files.robot, "urdf": options.urdf, "environment": files.environment}
    yield from ((name, path) for name, path in named.items() if path is not None)
    for name, paths in (("environment", files.additions), ("modules", options.modules or ())):
        yield from ((f"{name} {number}", path) for number, path in enumerate(paths, 2))


def _about(options: SweepOptions, call: str, files: RunFiles) -> Mapping[str, Any]:
    """Header of the rows, all that they depend on: the call and its settings, limits, digests of the files."""
    digests = {f"content of {name}": hashlib.sha256(path.read_bytes()).hexdigest() for name, path in _inputs(files)}
    return {
        "arguments": call,
        "settings": dict(files.options.set or {}),
        "seconds": options.seconds,
        "memory": options.memory,
        **digests,
    }
