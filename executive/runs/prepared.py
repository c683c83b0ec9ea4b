"""What the options of a run name is found, all that can be checked before the run is, and files are read once."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from executive.maps import SemanticMap, read_map
from executive.maps.environments import DEFAULT_ENVIRONMENT, default_environment
from executive.options.declaring import check_written, declared, names
from executive.options.headers import given_or
from executive.options.locating import LocateOptions
from executive.options.running import RunSettings
from executive.runs.files import (
    RecipeFile,
    WorldFiles,
    accepted,
    check_files,
    check_trusted,
    chosen,
    environments,
    programs,
    read,
    read_changes,
    refuse,
)
from executive.runs.options import RunOptions
from executive.runs.traces import TraceHeader, header_to_repeat, read_trace
from planlang.advice import BEFORE, Change
from planlang.diagnostics import BadInput, Diagnostic, Span, WrongOption, error
from planlang.extras import no_recorder
from planlang.files import Bundled
from planlang.language.source import PlanSource
from planlang.ontology import load
from planlang.outputs import Named
from planlang.records import dataclass
from planlang.runs import RecordedRun
from planlang.words import Blank, Option, Text

LEFT = Option("world_as_left", True)


def _check_together(options: RunOptions) -> None:
    """Raise a usage error for an option that needs or excludes another one."""
    if options.recipe is None and options.resume is None and options.repeated is None:
        raise WrongOption("name a recipe or plan, or ", Option("resume", Blank("TRACE")))
    if options.world_as_left and options.resume is None:
        raise WrongOption(LEFT, " needs ", Option("resume"))
    if options.view is not None and not (options.picture or options.video):
        raise WrongOption(Option("view"), " needs ", Option("picture"), " or ", Option("video"))
    if options.world_as_left and options.poses is not None:
        raise WrongOption(Option("poses"), " logs whole runs: leave out ", LEFT)
    if options.world_as_left and options.report is not None:
        raise WrongOption(Option("report"), " shows whole runs: leave out ", LEFT)
    if options.watch and options.watch_tree:
        raise WrongOption(
            Option("watch", True), " shows the tree of the plan, too: leave out ", Option("watch_tree", True)
        )


@dataclass(frozen=True, kw_only=True)
class RunFiles:
    """What the options of a run name: its files, and the values that a resumed run takes from its trace."""

    options: RunOptions
    """With the settings of the trace that is resumed."""
    file: PlanSource | RecipeFile
    robot: Path | None = None
    environment: Path | None = None
    additions: tuple[Path, ...] = ()
    """Maps of further things in the environment."""
    world: WorldFiles | None = None
    """What is there, if it is not stated by the maps above."""
    seed: int = 0
    recorded: RecordedRun | None = None
    """The run that is resumed, or repeated."""
    notes: tuple[Diagnostic, ...] = ()
    changes: tuple[Change, ...] = ()
    """What is changed in the map."""
    expected: str | None = None
    """How the run is expected to end, by a file of faults: done, or with a failure of this class."""

    @property
    def plan(self) -> Path | None:
        """File of a plan that is no recipe."""
        return self.file.path if isinstance(self.file, PlanSource) and not self.file.is_in_memory else None


def prepared(options: RunOptions) -> RunFiles:
    """Find the files of a run; options of a resumed run default to the header of its trace. Raises BadInput."""
    _check_together(options)
    recorded, header = options.repeated, TraceHeader()
    if recorded is not None:
        header = header_to_repeat(recorded)
    elif options.resume is not None:
        recorded, header = read_trace(options.resume)
    changes = header.changes if options.apply is None else read_changes(options.apply)
    changes = options.changes or changes
    options = _with_options(options, changes)
    options, expected = _with_faults(options)
    file = read(options.recipe if options.recipe is not None else header.plan(_trace_of(options)))
    is_bundled = isinstance(file, RecipeFile) and file.is_bundled
    problems: list[Diagnostic] = []
    check_files(problems, urdf=options.urdf, modules=options.modules)
    check_trusted(problems, programs(file, options.modules), trust=options.trust)
    robot = chosen(
        Bundled.ROBOT, options.robot or header.robot, "amigo" if is_bundled else None, problems, needs=_NEEDS
    )
    notes: list[Diagnostic] = []
    environment, *further = (*names(options.environment or ()),) or (header.environment,)
    if environment is None and is_bundled:
        environment = default_environment(file.path, (options.set or {}).values(), notes)
    semantic_map = chosen(
        Bundled.ENVIRONMENT, environment, DEFAULT_ENVIRONMENT if is_bundled else None, problems, needs=_NEEDS
    )
    additions = environments(further, problems)
    world = WorldFiles.named(names(options.world or header.world or ()), problems)
    plan = file.path if isinstance(file, PlanSource) and not file.is_in_memory else None
    recipe = file.path if isinstance(file, RecipeFile) and file.content is None else None
    inputs: dict[Named, Path | None] = {
        "the plan": plan or recipe,
        Option("urdf"): options.urdf,
        Option("robot"): robot,
        Option("environment"): semantic_map,
        **({} if world is None else {Option("world", one): one for one in world.files}),
    }
    if options.repeated is None:  # a file that shows it afterwards was checked by who asks for it
        problems += _check_outputs(options, inputs)
    refuse(problems)
    accepted(options.accept)
    options = replace(
        options,
        **{name: given_or(getattr(options, name), value) for name, value in header.settings.items()},
        task=options.task or header.task,
        start=options.start or header.start,
        schedule=header.schedule if options.schedule is None else options.schedule,
        trace=options.trace or (options.resume if options.repeated is None else None),
        models=options.models or None,
    )
    return RunFiles(
        options=options,
        file=file,
        robot=robot,
        environment=semantic_map,
        additions=additions,
        world=world,
        seed=header.seed if options.seed is None else options.seed,
        recorded=recorded,
        notes=tuple(notes),
        changes=tuple(one for one in changes if one.thing is not None),
        expected=expected,
    )


def _with_faults(options: RunOptions) -> tuple[RunOptions, str | None]:
    """Add the faults of a file to those of the options, and return how the run is expected to end. Raises BadInput."""
    if options.faults is None:
        return options, None
    from planlang.faults.named import WrongFault  # few runs have faults
    from planlang.faults.stated import StatedFaults

    try:
        stated = StatedFaults.of_file(options.faults).also(options.fault or (), options.fault_rate or 0.0)
    except WrongFault as problem:
        raise BadInput([error("X041", str(problem), Span(str(options.faults)))]) from None
    return replace(options, fault=list(map(str, stated.named)), fault_rate=stated.rate), stated.expect


def _with_options(options: RunOptions, changes: Iterable[Change]) -> RunOptions:
    """Set the options that changes state, whatever they were. Raises BadInput for an invalid value."""
    own = [one for one in changes if one.thing is None]
    stated = {one.what: one.value for one in own if one.what != BEFORE}
    acts = [str(one.value) for one in own if one.what == BEFORE]
    try:
        values: dict[str, Any] = {name: declared(RunSettings)[name].value(value) for name, value in stated.items()}
        values |= {BEFORE: [*(options.before or ()), *acts]} if acts else {}
        return replace(options, **values)
    except ValueError as problem:
        raise BadInput([error("C025", f"a change cannot be made: {problem}")]) from None


def prepared_to_replay(options: RunOptions, header: TraceHeader) -> RunFiles:
    """Find the plan of a recorded run, which is replayed without robot or world. Raises BadInput."""
    file = read(options.recipe if options.recipe is not None else header.plan(_trace_of(options)))
    problems: list[Diagnostic] = []
    check_files(problems, modules=options.modules)
    check_trusted(problems, programs(file, options.modules), trust=options.trust)
    refuse(problems)
    accepted(options.accept)
    return RunFiles(options=replace(options, task=options.task or header.task), file=file)


def _trace_of(options: RunOptions) -> str:
    return str(options.resume) if options.repeated is None else options.repeated.name


def _check_outputs(options: RunOptions, inputs: Mapping[Named, Path | None]) -> Iterator[Diagnostic]:
    """Yield an error for each output file that cannot be written or is an input, and for a missing display."""
    options = replace(options, trace=options.trace or options.resume)
    files = dict(inputs) | {Option("modules", file): file for file in options.modules or ()}
    yield from check_written(options, RunSettings, files)
    yield from no_recorder() if options.record is not None else ()
    yield from no_display() if options.gui else ()


_NEEDS = "only bundled recipes have a default: this plan"


def no_display() -> list[Diagnostic]:
    """Check that a window can be opened: PyBullet would end the process without a message.

    On systems other than Linux a display is assumed.
    """
    if not sys.platform.startswith("linux") or _opens_x_display():
        return []
    name = os.environ.get("DISPLAY")
    reason = f"the display {name} cannot be opened" if name else "there is no display (DISPLAY is not set)"
    advice = Text(Option("picture", "scene.png"), " shows the final scene")
    return [error("C013", Text(Option("gui", True), f" cannot open a window: {reason}"), help=advice)]


def _opens_x_display() -> bool:
    if not os.environ.get("DISPLAY"):
        return False
    try:
        x11 = ctypes.CDLL("libX11.so.6")
    except OSError:
        return False
    x11.XOpenDisplay.restype = ctypes.c_void_p
    display = x11.XOpenDisplay(None)
    if display is None:
        return False
    x11.XCloseDisplay(ctypes.c_void_p(display))
    return True


P = ParamSpec("P")
T = TypeVar("T")


class Inputs:
    """Cache of ontologies, maps, robots and compiled plans, none of which a run changes.

    A file that changes in the meantime is not read again.
    """

    def __init__(self) -> None:
        self._kept: dict[Hashable, Any] = {}

    def once(self, read: Callable[P, T], *arguments: P.args, **options: P.kwargs) -> T:
        """Call a function once for the same, hashable arguments, and return its result."""
        key = (read, arguments, tuple(sorted(options.items())))
        if key not in self._kept:
            self._kept[key] = read(*arguments, **options)
        result: T = self._kept[key]
        return result


def read_environment(files: RunFiles, inputs: Inputs, found: list[Diagnostic]) -> SemanticMap:
    """Read the map of a run, and change it if the run is to; problems go to ``found``. Raises BadInput."""
    assert files.environment is not None
    return read_maps((files.environment, *files.additions), files.changes, files.options, inputs, found)


def read_maps(
    maps: tuple[Path, ...],
    changes: Sequence[Change],
    options: RunOptions | LocateOptions,
    inputs: Inputs,
    found: list[Diagnostic],
) -> SemanticMap:
    """Read a map of several files, and change it; problems go to ``found``. Raises BadInput."""
    read, (first, *further) = inputs.once, maps
    ontology = read(load, first, folders=options.folders, also=tuple(further))
    semantic_map = read(read_map, ontology, ignore_unread=options.ignore_unread)
    if changes:
        from executive.maps.changed import changed_map  # imported late: few maps are changed, and writers are slow

        content = changed_map(semantic_map, maps, changes, found).encode()
        folders = (*options.folders, first.parent)
        ontology = load(first, folders=folders, content=content)  # which no other run has
        semantic_map = read_map(ontology, ignore_unread=options.ignore_unread)
    found += (*ontology.diagnostics, *semantic_map.diagnostics)
    return semantic_map
