"""The tasks of the series: recipe, place and goals, as somebody would state them for ``planlang run``."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from executive.runs.options import RunOptions
from tests.benchmarks.faults.cameras import TOP, robot_with

HERE = Path(__file__).resolve().parent
FOLDER = HERE / "files"


@dataclass(frozen=True)
class Task:
    """A task: a bundled recipe, or a file, with the goals that are decided in the true world."""

    recipe: str | Path
    goals: tuple[str, ...]
    environment: str | Path | None = None
    """Map; None for that of the bundled recipe."""
    there: str | Path | None = None
    """What is there, if it is not as the map."""
    more: tuple[tuple[str, str], ...] = ()
    """Bindings of parameters."""

    def options(self, world: Mapping[str, Any]) -> dict[str, Any]:
        """Options of its run in a world of the series."""
        given = {
            "recipe": str(self.recipe),
            "robot": robot_with(world["robot"], world["camera"]),
            "environment": None if self.environment is None else [str(self.environment)],
            "world": None if self.there is None else [str(self.there)],
            "set": dict(self.more) or None,
            "goal": list(self.goals),
            "seed": world["seed"],
            "fault": list(world["faults"]) or None,
            "fault_rate": world["rate"] or None,
            "no_recoveries": world["bare"],
        }
        return {name: value for name, value in given.items() if value is not None and value is not False}

    def run(self, world: Mapping[str, Any], **observers: Any) -> RunOptions:
        """The options as a run takes them."""
        return RunOptions(**self.options(world), **observers)

    def command(self, world: Mapping[str, Any]) -> str:
        """The command that repeats it in the checkout."""
        words = ["planlang", "run"]
        for name, value in self.options(world).items():
            option = f"--{name.replace('_', '-')}"
            match value:
                case True:
                    words.append(option)
                case list():
                    words += [word for one in value for word in (option, _short(one))]
                case dict():
                    words += [word for one, thing in value.items() for word in (option, f"{one}={thing}")]
                case _:
                    words += [_short(value)] if name == "recipe" else [option, _short(value)]
        return shlex.join(words)


def _short(value: object) -> str:
    return str(value).removeprefix(f"{TOP}/")


TASKS: Mapping[str, Task] = {
    "serve": Task("serve_a_drink", ("bottle1 held by patient1",)),
    "fetch": Task("fetch_from_cabinet", ("bottle1 held by robot", "cabinet_door1 closed")),
    "table": Task(
        FOLDER / "set_the_table.omn",
        ("bottle1 on table1", "cup1 on table1", "cabinet_door1 closed"),
        FOLDER / "dinette.omn",
    ),
    "tidy": Task(FOLDER / "tidy_up.omn", ("cup1 on sideboard1", "cup2 on sideboard1"), FOLDER / "strewn_room.omn"),
    "tray": Task(
        "carry_the_tray",
        ("tray2 on tea_table1", "cup3 on tray2"),
        "tea_room",
        more=(("tray", "tray2"),),
    ),
    "cups": Task(
        FOLDER / "bring_the_cup.omn",
        ("1 Cup on sideboard1",),
        FOLDER / "two_cups.omn",
        FOLDER / "three_cups.omn",
    ),
    "marked": Task(
        FOLDER / "bring_the_cup.omn",
        ("cup1 on sideboard1", "cup2 on table1", "cup3 on table1"),
        FOLDER / "two_marked_cups.omn",
        FOLDER / "three_marked_cups.omn",
    ),
    "light": Task(FOLDER / "light_the_room.omn", ("lamp1 switched on",), FOLDER / "lamp_room.omn"),
}
