"""Sweeps: a plan or recipe is run in many worlds, each in a process of its own."""

from __future__ import annotations

import hashlib
import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from executive.commands.arguments import SweepArguments
from executive.commands.command_lines import parsed, words_of
from executive.commands.inputs import refuse
from executive.commands.run import options_of
from executive.runs.options import RunOptions
from executive.sweeps import Row, World, run
from executive.sweeps.records import LIMITS, Done
from planlang.diagnostics import Diagnostic, WrongOption
from planlang.outputs import Named, check_outputs
from planlang.words import Option

JOB = "executive.commands.swept_world:ended"
_WALL_PER_CPU = 5.0
"""Wall-clock limit of a world in multiples of its CPU limit: other programs may use the cores, too."""


def swept(
    arguments: SweepArguments,
    *,
    announce: Callable[[Sequence[Diagnostic]], object] = lambda found: None,
    finished: Callable[[Done], object] = lambda done: None,
    resumed: Callable[[Sequence[Row]], object] = lambda rows: None,
) -> list[Row]:
    """Run a sweep, or the rest of it, and return its rows in the order of the worlds. Raises BadInput.

    ``announce`` gets diagnostics before the first world, ``resumed`` the rows of an earlier call, ``finished`` each
    world that is done.
    """
    words = [arguments.recipe, *words_of(arguments)]
    seeds = range(arguments.first, arguments.first + arguments.worlds)
    pages = arguments.reports
    worlds: list[World] = [
        {
            "world": seed,
            "repeat": shlex.join(["planlang", "run", *words, "--seed", str(seed)]),
            **({} if pages is None else {"report": str(pages / f"world-{seed}.html")}),
        }
        for seed in seeds
    ]
    options = options_of(parsed(words))  # reports what is wrong for all worlds before the first
    _check(arguments, options)
    announce(options.notes)
    return run(
        worlds,
        JOB,
        processes=arguments.processes,
        limits=replace(LIMITS, **_limits(arguments)),
        out=arguments.output,
        about=_about(arguments, words, options),
        shard=shard_of(arguments.shard),
        told=finished,
        resumed=resumed,
    )


def _limits(arguments: SweepArguments) -> dict[str, Any]:
    seconds = arguments.seconds
    return {"seconds": seconds, "memory": arguments.memory * 1_000_000, "wall": _WALL_PER_CPU * seconds}


def _check(arguments: SweepArguments, options: RunOptions) -> None:
    """Raise BadInput if a file cannot be written, or would overwrite an input."""
    outputs: dict[Named, Path | None] = {Option("output"): arguments.output, Option("csv"): arguments.csv}
    refuse(check_outputs(outputs, dict(_inputs(options)), force=arguments.force))


def _inputs(options: RunOptions) -> Iterator[tuple[str, Path]]:
    """Yield names and paths of the files that the runs depend on."""
    named = {"recipe": options.recipe, "plan": options.plan, "robot": options.robot, "urdf": options.urdf}
    named["environment"] = options.environment
    yield from ((name, path) for name, path in named.items() if path is not None)
    for name, paths in (("environment", options.additions), ("modules", options.modules or ())):
        yield from ((f"{name} {number}", path) for number, path in enumerate(paths, 2))


def _about(arguments: SweepArguments, words: Sequence[str], options: RunOptions) -> Mapping[str, Any]:
    """Header of the rows, all that they depend on: the command and its settings, limits, digests of the files."""
    digests = {f"content of {name}": hashlib.sha256(path.read_bytes()).hexdigest() for name, path in _inputs(options)}
    return {
        "arguments": shlex.join(words),
        "settings": dict(options.bindings or {}),
        "--seconds": arguments.seconds,
        "--memory": arguments.memory,
        **digests,
    }


def shard_of(text: str | None) -> tuple[int, int]:
    """Parse "k/n" to (k, n). Raises a usage error."""
    if text is None:
        return 1, 1
    try:
        part, parts = map(int, text.split("/"))
    except ValueError:
        part, parts = 0, 0
    if not 1 <= part <= parts:
        raise WrongOption(
            Option("shard", text), " is not K/N with K from 1 to N; write for example ", Option("shard", "3/16")
        )
    return part, parts
