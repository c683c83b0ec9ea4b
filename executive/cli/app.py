"""The command ``planlang``: its subcommands, each in a file of its name beside this one."""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Iterable
from importlib import import_module
from types import ModuleType
from typing import NoReturn

import click

from executive.cli.arguments import Arguments
from executive.cli.command_lines import Commands, command_of, explain, guessed_value, parsed
from executive.cli.console import Answer, ExitCode, answer, give, say, usage
from planlang.machine import check_memory

_RUNNING = ("run", "sweep", "compare", "replay", "report", "why", "locate", "enable", "show")
"""Commands that build the simulated world."""


def _module(name: str) -> ModuleType:
    """A file of this package, imported late: of many only those of one command are needed, and some are slow."""
    return import_module(f"executive.cli.{name}")


def _arguments(name: str, file: str) -> type[Arguments]:
    """The arguments of a command: of ``sweep-merge`` they are ``SweepMergeArguments``."""
    word = name.split()[-1].title().replace("-", "")
    kind: type[Arguments] = getattr(_module(file), f"{word}Arguments")
    return kind


def _command(name: str, file: str, example: str) -> click.Command:
    """Make a command. The module of the same name does the work."""

    def called(given: Arguments) -> None:
        def work() -> Answer:
            if name in _RUNNING:
                check_memory()
            module = _module(name.split()[-1].replace("-", "_"))
            reply: Answer = module.command(parsed(given))
            return reply

        with usage():
            detail = given.detail
        answer(name, work, as_json=given.json, detail=detail)

    return command_of(name, _arguments(name, file), called, example)


RUNS, AUTHORING, SERVER = "arguments", "authoring_arguments", "server_arguments"
"""Files of arguments."""
_COMMANDS: tuple[tuple[str, str, str], ...] = (
    ("new", AUTHORING, "project my_task"),
    ("compile", AUTHORING, "serve_a_drink -o serve_a_drink.py --graph serve_a_drink.svg"),
    ("check", AUTHORING, "my_recipe.owl --ontologies ../ontologies --fix"),
    ("convert", AUTHORING, "my_recipe.owl --to manchester -o my_recipe.omn"),
    ("merge", AUTHORING, "hospital_room seen_today.omn -o room.omn"),
    ("list", AUTHORING, "classes bottle"),
    ("faults", AUTHORING, "gripper"),
    ("show", AUTHORING, "hospital_room -o room.png --view top"),
    ("match", AUTHORING, "serve_a_drink --robot amigo"),
    ("run", RUNS, "serve_a_drink --seed 3 --trace run.jsonl --picture scene.png"),
    ("sweep", RUNS, "serve_a_drink --worlds 100 --output drinks.jsonl"),
    ("compare", RUNS, "serve_a_drink --vary robot=amigo,pr2 --worlds 100 --output robots.jsonl"),
    ("sweep-merge", RUNS, "shard1.jsonl shard2.jsonl --output drinks.jsonl"),
    ("sweep-table", RUNS, "drinks.jsonl --csv drinks.csv"),
    ("enable", RUNS, "serve_a_drink --robot amigo --from http://localhost:8080 --run"),
    ("replay", RUNS, "run.jsonl"),
    ("report", RUNS, "run.jsonl --output run.html"),
    ("why", RUNS, "run.jsonl --budget 20 --report why.html"),
    ("export", RUNS, "run.jsonl --to neem -o experience"),
    (
        "locate",
        RUNS,
        '"in reach of the patient with the right arm" --robot amigo --environment hospital_room --explain where.png',
    ),
    ("serve", SERVER, "--store kb.sqlite --port 8080"),
    ("backup", SERVER, "kb.sqlite kb-2026-11-28.sqlite"),
    (
        "search",
        SERVER,
        '"ServingFoodOrDrink and objectActedOn some DrinkingBottle" --robot amigo --from URL',
    ),
    ("pull", SERVER, "serveadrink.ward -o pulled --from URL"),
    ("push", SERVER, "my_recipe.owl --kind recipe --name ward --to URL --key-file my.key"),
    ("rate", SERVER, "serveadrink.ward 8 --to URL --key-file my.key"),
    ("delete", SERVER, "serveadrink.ward --file pouring.py --from URL --key-file my.key"),
    ("watch", SERVER, "serveadrink.ward --from URL --key-file my.key"),
    ("robot inspect", AUTHORING, "amigo --picture reach.png"),
    ("robot make", AUTHORING, "my_arm.urdf -o my_arm.toml"),
)
"""Name, file of the arguments, and example of each command."""


_EXIT_CODES = "Exit codes: 0 done, 1 the plan failed, 2 bad input, 3 robot or program lacks something, 130 interrupted."


def app_of(commands: Iterable[tuple[str, str, str]]) -> click.Group:
    """Make the command line of some commands."""
    made = Commands(
        "planlang",
        no_args_is_help=True,
        context_settings={"help_option_names": ["-h", "--help"]},
        help="Compile OWL action recipes to robot plans and run them in a simulated world.",
        epilog=_EXIT_CODES,
    )
    robots = Commands("robot", no_args_is_help=True, help="Inspect robots, make robot files.")
    for name, file, example in commands:
        (robots if name.startswith("robot") else made).add_command(_command(name, file, example))
    if robots.commands:
        made.add_command(robots)
    told = "Print the version and exit."
    return click.version_option(package_name="planlang", message="planlang %(version)s", help=told)(made)


def __getattr__(name: str) -> click.Group:
    """Make ``app``, the command line of all commands, when it is first used."""
    if name != "app":
        raise AttributeError(name)
    globals()["app"] = made = app_of(_COMMANDS)
    return made


def main() -> NoReturn:
    """Run the command and end the process. With ``--json``, wrong usage is printed as a JSON object, too."""
    try:
        # of the command that the words name, else of all
        named = [one for one in _COMMANDS if [one[0]] == sys.argv[1:2]]
        code = app_of(named or _COMMANDS)(prog_name="planlang", standalone_mode=False)
    except click.UsageError as problem:
        if "--json" in sys.argv:
            name, message, advice = explain(problem)
            give(name, Answer(ExitCode.BAD_INPUT, data={"error": message, "help": advice}), as_json=True)
        else:
            shown = io.StringIO()
            problem.show(file=shown)
            say(shown.getvalue().removesuffix("\n"))
            if guessed := guessed_value(problem.format_message()):
                say(f"    help: {guessed}")
        code = ExitCode.BAD_INPUT
    except click.exceptions.Exit as end:
        code = end.exit_code
    except click.Abort:
        code = ExitCode.INTERRUPTED
    except BrokenPipeError:  # the reader of stdout has closed it
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = ExitCode.FAILED
    sys.exit(int(code or 0))
