"""Options of a search for poses."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from executive.options.declaring import argument, option, written
from executive.options.running import (
    Environment,
    Force,
    IgnoreUnread,
    OntologyOptions,
    Robot,
    Start,
    Units,
    Urdf,
    World,
)
from planlang.outputs import PNG_OR_SVG
from planlang.records import dataclass


@dataclass(frozen=True, kw_only=True)
class LocateOptions(OntologyOptions):
    """Options of a search for poses."""

    phrase: Annotated[
        str, argument(metavar="PHRASE", help='The location, e.g. "in reach of the bottle and near the bed".')
    ]
    robot: Robot = None
    urdf: Urdf = None
    environment: Environment = None
    world: World = None
    start: Start = None
    of: Annotated[
        str | None,
        option(metavar="THING", help='Find poses of this thing, e.g. "the bottle"; default: of the base.'),
    ] = None
    count: Annotated[int, option(least=1, most=1000, metavar="N", help="Number of poses, best first.")] = 3
    explain: Annotated[
        Path | None, written("Draw the candidates and the reasons for rejection, as PNG or SVG.", PNG_OR_SVG)
    ] = None
    units: Units = None
    ignore_unread: IgnoreUnread = False
    force: Force = False
