"""Sweeps: a plan or recipe is run in many worlds, each in a process of its own, also with several variants."""

from __future__ import annotations

import hashlib
import os
import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

from executive.options.declaring import as_json, stated, values_of
from executive.options.engines import in_seconds
from executive.options.results import ResultFiles
from executive.options.running import SituationSettings, SweepOptions
from executive.runs.files import RecipeFile, refuse
from executive.runs.options import RunOptions
from executive.runs.prepared import RunFiles, prepared
from executive.sweeps import Row, World, run
from executive.sweeps.comparison import Comparison
from executive.sweeps.installations import check_options, installation
from executive.sweeps.jobs import READS_RUN, RUNS
from executive.sweeps.records import LIMITS, Done, of_variant
from executive.sweeps.results import check_results, page_file, pages_of, write_results
from executive.sweeps.variants import Variant, variants_of
from planlang.diagnostics import BadInput, Diagnostic, WrongOption, warning
from planlang.language.source import PlanSource
from planlang.shell import quoted
from planlang.words import COMMAND_LINE, Blank, Option, Text, calling

_WALL_PER_CPU = 5.0
"""Wall-clock limit of a world in multiples of its CPU limit: other programs may use the cores, too."""


def swept(
    options: SweepOptions,
    *,
    announce: Callable[[Sequence[Diagnostic]], object] = lambda found: None,
    finished: Callable[[Done], object] = lambda done: None,
    resumed: Callable[[Sequence[Row]], object] = lambda rows: None,
    say: Callable[[str], object] = lambda line: None,
    command: str = "sweep",
) -> list[Row]:
    """Run a sweep, or the rest of it, and return its rows: of each world in turn that of each variant. Raises BadInput.

    Once all worlds are done, the files that show the results are written.

    ``announce`` gets diagnostics before the first world, ``resumed`` the rows of an earlier call, ``finished`` each
    world that is done, ``say`` sentences on what happens to a cluster. Advice names the ``command`` that was given.
    """
    variants = variants_of(options)
    parts = [_Part(options, one, number) for number, one in enumerate(variants)] or [_Part(options)]
    seeds = range(options.first, options.first + options.worlds)
    for part in parts:
        refuse(check_results(options, SweepOptions, dict(part.inputs())))
    announce([*dict.fromkeys(one for part in parts for one in part.files.notes), *_other_worlds(parts)])
    rows = run(
        [part.world(seed) for seed in seeds for part in parts],
        RUNS,
        options.on,
        processes=options.processes,
        limits=replace(
            LIMITS,
            seconds=options.seconds,
            memory=options.memory * 1_000_000,
            wall=_WALL_PER_CPU * options.seconds,
        ),
        out=options.output,
        about=_about(options, parts),
        shard=options.shard or (1, 1),
        together=len(parts),
        cluster_wait=options.cluster_wait,
        reads=READS_RUN,
        resume=_again(command, options, parts[0]),
        say=say,
        told=finished,
        resumed=resumed,
    )
    _write(options, rows, parts)
    return rows


def _write(options: SweepOptions, rows: Sequence[Row], parts: Sequence[_Part]) -> None:
    """Write the files that show the results; a sweep without variants is one, called as its recipe."""
    if not any(values_of(options, ResultFiles).values()):
        return
    title = parts[0].named
    variants = {one.variant.name: one.variant.columns for one in parts if one.variant is not None}
    alike = rows if variants else [{**row, "variant": title, "seed": row["world"]} for row in rows]
    comparison = Comparison.of(alike, variants or {title: {}})
    write_results(options, title, rows, comparison, pages_of(options.reports, rows, alike, list(variants)))


class _Part:
    """The worlds of a variant, or of a sweep that has none."""

    def __init__(self, options: SweepOptions, variant: Variant | None = None, number: int = 0) -> None:
        """Find the files; what is wrong for all worlds is reported before the first. Raises BadInput."""
        self.variant, self._number = variant, number
        self.options = options if variant is None else variant.options(options)
        self._run = RunOptions(**values_of(self.options, SituationSettings), recipe=self.options.recipe)
        try:
            self.files = prepared(self._run)
            self._other = None if self.options.python is None else installation(self.options.python)
            if any(map(callable, self.options.goal or ())):
                raise WrongOption(Option("goal"), ": in the processes of its worlds, goals are phrases only")
            if self._other is not None:
                check_options(self._other, self._given)
        except BadInput as problem:
            if variant is None:
                raise
            raise of_variant(variant.name, problem) from None

    @cached_property
    def _given(self) -> dict[str, Any]:
        """Options of each run, of which another installation need not know those that are off."""
        given = as_json(self._run, SituationSettings)
        return {name: value for name, value in given.items() if value is not False}

    @cached_property
    def _recipe(self) -> str:
        """The recipe or plan for a worker: its text, if it is in memory."""
        file = self.files.file
        plan = file.text if isinstance(file, PlanSource) and file.is_in_memory else self.options.recipe
        return os.fspath(plan) if isinstance(plan, str | os.PathLike) else file.path.name

    @property
    def named(self) -> str:
        """The recipe or plan in a command."""
        return self.files.file.path.name if "\n" in self._recipe else self._recipe

    def call(self, **more: object) -> str:
        """The command that runs a world."""
        call = COMMAND_LINE.call(calling("run", self.named, **dict(stated(self._run, SituationSettings)), **more))
        if self._other is None:
            return call
        return f"{quoted(self._other.python)} -m executive {call.removeprefix('planlang ')}"

    def world(self, seed: int) -> World:
        """The world of a seed."""
        world: dict[str, Any] = {
            "world": seed if self.variant is None else self.variant.key(seed),
            "repeat": self.call(seed=seed),
            "options": {**self._given, "recipe": self._recipe, "seed": seed},
        }
        if self._other is not None:
            world["python"] = self._other.python
        if self.variant is not None:
            world["columns"] = {"variant": self.variant.name, "seed": seed, **self.variant.columns}
            world["programs"] = self._programs
        if self.options.reports is not None:
            name = None if self.variant is None else self.variant.name
            world["report"] = str(page_file(self.options.reports, seed, name, self._number))
        return world

    @cached_property
    def _programs(self) -> str:
        """Code of the user that the runs import."""
        return " ".join(map(str, filter(None, (self.files.plan, *(self.options.modules or ())))))

    def inputs(self) -> Iterator[tuple[str, Path]]:
        """Yield names and paths of the files that the runs depend on."""
        file, files = self.files.file, self.files
        is_file = not (file.is_in_memory if isinstance(file, PlanSource) else file.content is not None)
        named = {"recipe" if isinstance(file, RecipeFile) else "plan": file.path if is_file else None}
        named |= {"robot": files.robot, "urdf": self._run.urdf, "environment": files.environment}
        yield from ((name, path) for name, path in named.items() if path is not None)
        if self._run.faults is not None:
            yield "faults", self._run.faults
        for name, paths in (("environment", files.additions), ("modules", self._run.modules or ())):
            yield from ((f"{name} {number}", path) for number, path in enumerate(paths, 2))
        there = () if files.world is None else files.world.files
        yield from ((f"world {number}", path) for number, path in enumerate(there, 1))

    def about(self) -> Iterator[tuple[str, Any]]:
        """Yield all that the rows depend on, for the header: the call and its settings, digests of the files."""
        before = "" if self.variant is None else f"{self.variant.name}: "
        yield f"{before}arguments", self.call()
        yield f"{before}settings", dict(self.files.options.set or {})
        if self._other is not None:
            yield f"{before}planlang", {"version": self._other.version, "sha256": self._other.sha256}
        for name, path in self.inputs():
            yield f"{before}content of {name}", hashlib.sha256(path.read_bytes()).hexdigest()


def _again(command: str, options: SweepOptions, part: _Part) -> Text:
    """Say how to run the rest of a sweep, of which nothing is kept without a file."""
    if options.output is None:
        return Text(Option("output", Blank("FILE")), " keeps what is done, so that the rest can be run later")
    values = {**dict(stated(options, SweepOptions)), "output": options.output}
    values |= values_of(options, ResultFiles)  # files only show, and are not among those stated
    texts: dict[str, object] = {
        "vary": [f"{name}={text}" for name, each in (options.vary or {}).items() for text in _texts(each)],
        "shard": None if options.shard is None else "/".join(map(str, options.shard)),
        "cluster_wait": in_seconds(options.cluster_wait),
    }
    if all(isinstance(words, list) for words in (options.variant or {}).values()):  # as the command line has them
        texts["variant"] = [f"{name}: {shlex.join(words)}" for name, words in (options.variant or {}).items()]
    values |= {name: text for name, text in texts.items() if name in values}
    return Text("run the rest with ", calling(command, part.named, **values))


def _texts(values: Sequence[Any]) -> list[str]:
    """Texts for the values of what varies, one if no comma is part of a value."""
    texts = list(map(str, values))
    return texts if any("," in one for one in texts) else [",".join(texts)]


def _other_worlds(parts: Sequence[_Part]) -> list[Diagnostic]:
    """Warn of variants in other environments: their worlds are not the same."""
    chosen = dict.fromkeys(_maps(one.files) for one in parts if one.files.environment)
    if len(chosen) < 2:
        return []
    names = ", ".join(" and ".join(path.name.partition(".")[0] for path in paths if path) for paths in chosen)
    varied = (part.variant.columns for part in parts if part.variant is not None)
    if any("environment" in columns or "world" in columns for columns in varied):
        advice = Text("compare how often they reach their goals: world N of one is not world N of another")
    else:
        advice = Text(Option("environment"), " names one for all")
    return [warning("C038", f"the variants are in different environments: {names}", help=advice)]


def _maps(files: RunFiles) -> tuple[Path, ...]:
    """Files that state what is there."""
    environment = () if files.environment is None else (files.environment, *files.additions)
    return environment if files.world is None else (*(files.world.maps or environment), *files.world.lists)


def _about(options: SweepOptions, parts: Sequence[_Part]) -> Mapping[str, Any]:
    """Header of the rows: the variants, what each depends on, and the limits of worlds."""
    variants = {part.variant.name: dict(part.variant.columns) for part in parts if part.variant is not None}
    about = dict(one for part in parts for one in part.about())
    limits = {"seconds": options.seconds, "memory": options.memory}
    if not variants:  # the call first, which says most
        first = {name: about.pop(name) for name in ("arguments", "settings")}
        return {**first, **limits, **about}
    return {"variants": variants, **limits, **about}
