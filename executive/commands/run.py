"""Options of a run, from the arguments of ``planlang run``; all that can be checked before the run is."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from executive.commands.arguments import RunArguments
from executive.commands.inputs import (
    RecipeFile,
    accepted,
    check_files,
    check_trusted,
    chosen,
    environments,
    planar,
    programs,
    read,
    refuse,
)
from executive.maps.environments import DEFAULT_ENVIRONMENT, default_environment
from executive.runs.options import RunOptions
from executive.runs.settings import settings_of
from executive.runs.traces import TraceHeader, read_trace
from planlang.diagnostics import BadInput, Diagnostic, Span, WrongOption, error
from planlang.files import Bundled, decode, read_file
from planlang.language.source import PlanSource
from planlang.outputs import PNG, WEBP, Named, check_outputs
from planlang.words import Blank, Option, Text

LEFT = Option("world_as_left", True)


def _check_together(arguments: RunArguments) -> None:
    """Raise a usage error for an option that needs or excludes another one."""
    if arguments.file is None and arguments.resume is None:
        raise WrongOption("name a recipe or plan, or ", Option("resume", Blank("TRACE")))
    if arguments.world_as_left and arguments.resume is None:
        raise WrongOption(LEFT, " needs ", Option("resume"))
    if arguments.view is not None:
        _check_view(arguments.view, is_used=bool(arguments.picture or arguments.video))
    if arguments.world_as_left and arguments.poses is not None:
        raise WrongOption(Option("poses"), " logs whole runs: leave out ", LEFT)
    if arguments.world_as_left and arguments.report is not None:
        raise WrongOption(Option("report"), " shows whole runs: leave out ", LEFT)
    if arguments.watch and arguments.watch_tree:
        raise WrongOption(
            Option("watch", True), " shows the tree of the plan, too: leave out ", Option("watch_tree", True)
        )


def options_of(arguments: RunArguments) -> RunOptions:
    """Make the options of a run; those of a resumed run default to the header of its trace. Raises BadInput."""
    _check_together(arguments)
    start, bindings = planar(arguments.start), _bindings(arguments.set_ or [])
    recorded, header = None, TraceHeader()
    if arguments.resume is not None:
        recorded, header = read_trace(arguments.resume)
    file = read(arguments.file or header.plan(str(arguments.resume)))
    is_bundled = isinstance(file, RecipeFile) and file.is_bundled
    problems: list[Diagnostic] = []
    check_files(problems, urdf=arguments.urdf, modules=arguments.modules)
    check_trusted(problems, programs(file, arguments.modules), trust=arguments.trust)
    robot = chosen(
        Bundled.ROBOT, arguments.robot or header.robot, "amigo" if is_bundled else None, problems, needs=_NEEDS
    )
    notes: list[Diagnostic] = []
    environment, *further = (*(arguments.environment or ()),) or (header.environment,)
    if environment is None and is_bundled:
        environment = default_environment(file.path, bindings.values(), notes)
    semantic_map = chosen(
        Bundled.ENVIRONMENT, environment, DEFAULT_ENVIRONMENT if is_bundled else None, problems, needs=_NEEDS
    )
    additions = environments(further, problems)
    inputs: dict[Named, Path | None] = {
        "the plan": file.path,
        Option("urdf"): arguments.urdf,
        Option("robot"): robot,
        Option("environment"): semantic_map,
    }
    problems += _check_outputs(arguments, inputs)
    refuse(problems)
    settings = {name: value or header.settings.get(name, value) for name, value in settings_of(arguments).items()}
    settings |= {
        "seed": header.seed if arguments.seed is None else arguments.seed,
        "schedule": header.schedule if arguments.schedule is None else arguments.schedule,
        "trace": arguments.trace or arguments.resume,
    }
    return RunOptions(
        **settings,
        plan=file.path if isinstance(file, PlanSource) else None,
        recipe=file.path if isinstance(file, RecipeFile) else None,
        task=arguments.task or header.task,
        accepted=accepted(arguments.accept),
        ontologies=arguments.folders,
        robot=robot,
        environment=semantic_map,
        additions=additions,
        start=start or header.start,
        bindings=bindings,
        resume=recorded,
        notes=tuple(notes),
        inner_actions=arguments.verbose,
    )


WRITTEN = ("picture", "video", "record", "poses", "report", "upload", "update_map")
"""Options of files that a run writes, beside its trace."""


def _check_outputs(arguments: RunArguments, inputs: Mapping[Named, Path | None]) -> Iterator[Diagnostic]:
    """Yield an error for each output file that cannot be written or is an input, and for a missing display."""
    outputs: dict[Named, Path | None] = {Option(name): getattr(arguments, name) for name in WRITTEN}
    outputs[Option("trace")] = arguments.trace or arguments.resume
    files = dict(inputs) | {Option("modules", file): file for file in arguments.modules or ()}
    formats: dict[Named, Sequence[str]] = {Option("picture"): PNG, Option("video"): WEBP}
    yield from check_outputs(outputs, files, formats=formats, force=arguments.force)
    if arguments.record is not None:
        from executive.pictures.drawn import missing  # most runs draw nothing

        yield from missing()
    yield from no_display() if arguments.gui else ()


def _check_view(view: str, *, is_used: bool) -> None:
    """Raise a usage error for a viewpoint that is invalid or unused."""
    from executive.pictures.scene_picture import is_view  # Pillow is slow to import

    if not is_used:
        raise WrongOption(Option("view"), " needs ", Option("picture"), " or ", Option("video"))
    if not is_view(view):
        raise WrongOption(Option("view", view), ": write X,Y,Z or X,Y,Z:X,Y,Z in metres of the map, overview, or top")


MOST_SETTINGS = 1_000_000
"""Maximum size of a file of bindings [bytes]."""
_NEEDS = "only bundled recipes have a default: this plan"


def _bindings(texts: Sequence[str]) -> dict[str, str]:
    """Parse settings: parameter -> value; ``@FILE`` stands for its lines. Raises a usage error or BadInput."""
    bindings: dict[str, str] = {}
    for text, span in _settings(texts):
        name, equals, value = (part.strip() for part in text.partition("="))
        problem = Text(f"{name!r} is set twice") if name in bindings else None
        if not (name and equals and value):
            problem = Text(f"{text!r} is not NAME=THING; write for example ", Option("set", {"bottle": "bottle2"}))
        if problem is not None and span is None:
            raise WrongOption(problem)
        if problem is not None:
            raise BadInput([error("C018", problem, span, "each line is NAME=THING, or begins with #")])
        bindings[name] = value
    return bindings


def _settings(texts: Sequence[str]) -> Iterator[tuple[str, Span | None]]:
    """Yield bindings one by one, those of files with their line."""
    for text in texts:
        if not text.startswith("@"):
            yield text, None
            continue
        lines = decode(read_file(Path(text[1:]), largest=MOST_SETTINGS), text[1:]).splitlines()
        for number, line in enumerate(lines, 1):
            if line.strip() and not line.lstrip().startswith("#"):
                yield line, Span(text[1:], number)


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
