"""Arguments of ``planlang new``."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import Annotated

from executive.cli.base_arguments import Arguments
from executive.options.declaring import argument, option
from executive.options.running import Force
from planlang.records import dataclass


class Template(Enum):
    """What ``planlang new`` writes."""

    PROJECT = "project"
    RECIPE = "recipe"
    MAP = "map"
    ROBOT = "robot"
    MODULE = "module"
    PLAN = "plan"


@dataclass(frozen=True, kw_only=True)
class NewArguments(Arguments):
    """Write a commented recipe, map, robot, module or plan to start from, or a project of them with a test.

    All of them run as they are. planlang robot make writes a robot file for your URDF.
    """

    kind: Annotated[Template, argument(help="What to write.")]
    name: Annotated[str, argument(metavar="NAME", help="Its name: lower-case letters, digits and _.")]
    folder: Annotated[Path, option(metavar="DIR", help="Write to this folder.")] = Path()
    force: Force = False
