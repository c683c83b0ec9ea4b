"""Settings of a run, each declared once.

A declaration defines the option of the command line, the field of :class:`~executive.runs.options.RunOptions`, the key
in the header of a trace, and whether a resumed run must have the same value.
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
    """Key of a setting in the header of a trace; a run that resumes the trace must have the same value."""

    key: str
    taken: bool = True
    """True if a resumed run takes the value from the header by default."""


Urdf = Annotated[Path | None, typer.Option(metavar="FILE", help="The robot's URDF, if the robot file names none.")]
Modules = Annotated[
    list[Path] | None,
    typer.Option(metavar="FILE.py", help="Also load the process modules of this Python file; repeatable."),
    InHeader("modules", taken=False),
]


_IGNORE_UNREAD = typer.Option(
    "--ignore-unread", help="Go on without things of a map, with a shape or a pose, that cannot be read."
)
IgnoreUnread = Annotated[bool, _IGNORE_UNREAD]


@dataclass(frozen=True, kw_only=True)
class SituationSettings:
    """What a robot knows and has at its disposal when it runs a plan."""

    urdf: Urdf = None
    models: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="FOLDER",
            help="Folder of the recognition models (and programs and maps) that the robot has; it recognises no other "
            "classes. Repeatable.",
        ),
        InHeader("given", taken=False),
    ] = None
    trust_map: Annotated[
        bool,
        typer.Option("--trust-map", help="Take the map's poses as seen; needs no camera."),
        InHeader("trusts_map"),
    ] = False
    unknown: Annotated[
        list[str] | None,
        typer.Option(
            metavar="THING",
            help="Hide the pose of this thing, or of the things of this class, from the robot; all: of everything "
            "except rooms. Repeatable.",
        ),
        InHeader("unknown"),
    ] = None
    ignore_unread: Annotated[bool, _IGNORE_UNREAD, InHeader("ignores_unread")] = False
    schedule: Annotated[
        int | None,
        typer.Option(min=0, metavar="K", help="Run concurrent tasks in another order, which K determines."),
    ] = None
    modules: Modules = None
    force: Annotated[
        bool,
        typer.Option(
            "--force",
            help="Run even if robot or program lacks something; overwrite files that planlang did not write.",
        ),
    ] = False


@dataclass(frozen=True, kw_only=True)
class RunSettings(SituationSettings):
    """Settings of one run: its world and its output files."""

    seed: Annotated[
        int | None,
        typer.Option(
            min=0, metavar="N", help="Seed for displacing things in the simulated world; 0: displace nothing."
        ),
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
            help="Viewpoint of picture and video [m], and the point to look at; or overview, or top.",
        ),
    ] = None
    record: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write a recording for rerun (needs the extra record).")
    ] = None
    report: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write an HTML page of the run: plan, world and causes on one time line."),
    ] = None
    watch: Annotated[
        bool,
        typer.Option(
            "--watch", help="Show the run in a browser on this computer while it runs; pause or step it there."
        ),
    ] = False
    watch_tree: Annotated[
        bool, typer.Option("--watch-tree", help="Show the steps of the plan as a tree in the terminal while it runs.")
    ] = False
    poses: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Log the poses of things and links, as JSON Lines, for planlang export."),
    ] = None
    upload: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write the map that the plan uploads, in Manchester syntax.")
    ] = None
    update_map: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Write the map, updated with what the robot knows at the end, in Manchester syntax."
        ),
    ] = None
    world_as_left: Annotated[
        bool,
        typer.Option(
            "--world-as-left", help="With --resume: the world is still as the trace left it; do not restore it."
        ),
    ] = False


@cache
def in_header() -> Mapping[str, InHeader]:
    """Settings that the header of a trace states, by name."""
    hints = get_type_hints(RunSettings, include_extras=True)
    return {
        name: one
        for name, hint in hints.items()
        for one in getattr(hint, "__metadata__", ())
        if isinstance(one, InHeader)
    }


def header_entries(settings: RunSettings, **instead: Any) -> dict[str, Any]:
    """Make the entries of a header: settings that are set, with the values of ``instead`` for some of them.

    A value of ``instead`` may be empty, and is stated then: a robot may have no recognition model.
    """
    values = {name: instead.get(name, getattr(settings, name) or None) for name in in_header()}
    return {
        one.key: list(value) if isinstance(value, tuple) else value
        for name, one in in_header().items()
        if (value := values[name]) is not None
    }


def settings_from_header(header: Mapping[str, Any]) -> dict[str, Any]:
    """Settings that a resumed run takes from the header of its trace."""
    values = {name: header.get(one.key) for name, one in in_header().items() if one.taken}
    return {
        name: list(map(str, value)) if isinstance(value, list) else value
        for name, value in values.items()
        if isinstance(value, list) or value is True
    }


def settings_of(settings: object) -> dict[str, Any]:
    """Settings among the arguments of a command, by name; None for a repeatable one without values."""
    values = {one.name: getattr(settings, one.name) for one in _fields()}
    return {name: None if isinstance(value, list | tuple) and not value else value for name, value in values.items()}


@cache
def _fields() -> tuple[Field[Any], ...]:
    return fields(RunSettings)
