"""Settings of a run: each is declared here once.

From a declaration follow the option of the command line, the field of :class:`~executive.runs.options.RunOptions`, what
the header of a trace says of it, and whether a run that is resumed has to have the same.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import Field, fields
from functools import cache
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import typer

from planlang.records import dataclass


@dataclass(frozen=True, slots=True)
class InHeader:
    """How the header of a trace states a setting, which a run that resumes it must have in common."""

    key: str
    called: str
    """What a message calls it where it differs."""
    taken: bool = True
    """Whether the run that resumes it takes it from there unless it states another one."""


Urdf = Annotated[Path | None, typer.Option(metavar="FILE", help="The robot's URDF, if the robot's file names none.")]
Modules = Annotated[
    list[Path] | None,
    typer.Option(metavar="FILE.py", help="Also use the process modules of this file, which is executed; repeatable."),
    InHeader("modules", "the list of --modules files", taken=False),
]


@dataclass(frozen=True, kw_only=True)
class SituationSettings:
    """Settings that say with what a robot runs a plan, and what it knows."""

    urdf: Urdf = None
    models: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="FOLDER",
            help="The recognition models (and programs and maps) that the robot has: other classes are not recognised; "
            "repeatable.",
        ),
        InHeader("given", "--models", taken=False),
    ] = None
    trust_map: Annotated[
        bool,
        typer.Option("--trust-map", help="Things count as seen where the map has them; needs no camera."),
        InHeader("trusts_map", "--trust-map"),
    ] = False
    unknown: Annotated[
        list[str] | None,
        typer.Option(
            metavar="THING",
            help="The robot does not know where this thing of the map is, or things of this class; all: anything but "
            "rooms. Repeatable.",
        ),
        InHeader("unknown", "--unknown"),
    ] = None
    schedule: Annotated[
        int | None,
        typer.Option(min=0, metavar="K", help="Run concurrent tasks in another order, the same for the same number."),
    ] = None
    modules: Modules = None
    force: Annotated[
        bool,
        typer.Option(
            "--force",
            help="Run although robot or program lack something; overwrite files that planlang did not write.",
        ),
    ] = False


@dataclass(frozen=True, kw_only=True)
class RunSettings(SituationSettings):
    """Settings of one run: its world, and the files that it writes."""

    seed: Annotated[
        int | None,
        typer.Option(min=0, metavar="N", help="Displace things in the simulated world by this seed; 0: none."),
    ] = None
    gui: Annotated[bool, typer.Option("--gui", help="Show the world in a window.")] = False
    trace: Annotated[Path | None, typer.Option(metavar="FILE", help="Write the trace of the run, as JSON Lines.")] = (
        None
    )
    picture: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write a picture of the final scene, as PNG.")
    ] = None
    video: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write a video of the run beside its plan, as animated WebP.")
    ] = None
    view: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y,Z[:X,Y,Z]",
            help="Picture and video from this point of the map [m], towards another one; or overview, or top.",
        ),
    ] = None
    record: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write a recording for rerun (needs planlang[record]).")
    ] = None
    report: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Write a page that shows the run: plan, world and causes on one clock, HTML."
        ),
    ] = None
    watch: Annotated[
        bool,
        typer.Option(
            "--watch", help="Show the run in a browser on this computer while it goes on, and hold or step it."
        ),
    ] = False
    watch_tree: Annotated[
        bool, typer.Option("--watch-tree", help="Show the steps of the plan in the terminal while it runs, as a tree.")
    ] = False
    poses: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Log where things and links are, as JSON Lines, for export.")
    ] = None
    upload: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write the map that the plan uploads, in Manchester syntax.")
    ] = None
    update_map: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write the map with what the robot knows at the end, in Manchester syntax."),
    ] = None
    world_as_left: Annotated[
        bool,
        typer.Option("--world-as-left", help="With --resume: the world is as the trace left it; do not restore it."),
    ] = False


@cache
def in_header() -> Mapping[str, InHeader]:
    """Return the settings that the header of a trace states, by their names."""
    hints = get_type_hints(RunSettings, include_extras=True)
    return {
        name: one
        for name, hint in hints.items()
        for one in getattr(hint, "__metadata__", ())
        if isinstance(one, InHeader)
    }


def stated(settings: RunSettings, **instead: Any) -> dict[str, Any]:
    """Return what a header states of settings, and ``instead`` of some of them; nothing of those that are not set.

    What is there instead of one may be empty: a robot may have no recognition model.
    """
    found = {name: instead.get(name, getattr(settings, name) or None) for name in in_header()}
    return {
        one.key: list(value) if isinstance(value, tuple) else value
        for name, one in in_header().items()
        if (value := found[name]) is not None
    }


def taken(header: Mapping[str, Any]) -> dict[str, Any]:
    """Return the settings that a resumed run takes from the header of its trace."""
    values = {name: header.get(one.key) for name, one in in_header().items() if one.taken}
    return {
        name: list(map(str, value)) if isinstance(value, list) else value
        for name, value in values.items()
        if isinstance(value, list) or value is True
    }


def shared(settings: object) -> dict[str, Any]:
    """Return the settings that the arguments of a command state, by their names; None for repeatable ones without."""
    values = {one.name: getattr(settings, one.name) for one in _fields()}
    return {name: None if isinstance(value, list | tuple) and not value else value for name, value in values.items()}


@cache
def _fields() -> tuple[Field[Any], ...]:
    return fields(RunSettings)
