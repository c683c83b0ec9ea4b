"""The command ``planlang``: its subcommands, each in a file of its name beside this one."""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Callable, Iterable
from importlib import import_module
from typing import Annotated, Any, NoReturn

import typer

from executive.cli import arguments as local
from executive.cli import authoring_arguments as authoring
from executive.cli import server_arguments as server
from executive.cli.answers import Answer, ExitCode
from executive.cli.base_arguments import Arguments
from executive.cli.command_lines import Commands, command_of, parsed, with_parameters
from executive.cli.console import answer, give, say, usage
from executive.cli.usage import explain, guessed_value
from executive.commands.resources import check_memory

_RUNNING = ("run", "sweep", "replay", "report", "locate", "enable", "show")
"""Commands that build the simulated world."""


def _command(name: str, arguments: type[Arguments]) -> Callable[..., None]:
    """Make the function of a command. The module of the same name does the work, imported late as some are slow."""

    def called(given: Arguments) -> None:
        def work() -> Answer:
            if name in _RUNNING:
                check_memory()
            word = name.split()[-1].replace("-", "_")
            module = import_module(f"executive.cli.{word}")  # one command of many
            reply: Answer = module.command(parsed(given))
            return reply

        with usage():
            detail = given.detail
        answer(name, work, as_json=given.json, detail=detail)

    return with_parameters(name, arguments, called)


_COMMANDS: tuple[tuple[str, type[Arguments], str], ...] = (
    ("new", authoring.NewArguments, "project my_task"),
    ("compile", local.CompileArguments, "serve_a_drink -o serve_a_drink.py --graph serve_a_drink.svg"),
    ("check", local.CheckArguments, "my_recipe.owl --ontologies ../ontologies --fix"),
    ("convert", local.ConvertArguments, "my_recipe.owl --to manchester -o my_recipe.omn"),
    ("merge", local.MergeArguments, "hospital_room seen_today.omn -o room.omn"),
    ("list", local.ListArguments, "classes bottle"),
    ("show", local.ShowArguments, "hospital_room -o room.png --view top"),
    ("match", local.MatchArguments, "serve_a_drink --robot amigo"),
    ("run", local.RunArguments, "serve_a_drink --seed 3 --trace run.jsonl --picture scene.png"),
    ("sweep", local.SweepArguments, "serve_a_drink --worlds 100 --output drinks.jsonl"),
    ("sweep-merge", local.SweepMergeArguments, "shard1.jsonl shard2.jsonl --output drinks.jsonl"),
    ("sweep-table", local.SweepTableArguments, "drinks.jsonl --csv drinks.csv"),
    ("enable", local.EnableArguments, "serve_a_drink --robot amigo --from http://localhost:8080 --run"),
    ("replay", local.ReplayArguments, "run.jsonl"),
    ("report", local.ReportArguments, "run.jsonl --output run.html"),
    ("export", local.ExportArguments, "run.jsonl --to neem -o experience"),
    (
        "locate",
        local.LocateArguments,
        '"in reach of the patient with the right arm" --robot amigo --environment hospital_room --explain where.png',
    ),
    ("serve", server.ServeArguments, "--store kb.sqlite --port 8080"),
    ("backup", server.BackupArguments, "kb.sqlite kb-2026-11-28.sqlite"),
    (
        "search",
        server.SearchArguments,
        '"ServingFoodOrDrink and objectActedOn some DrinkingBottle" --robot amigo --from URL',
    ),
    ("pull", server.PullArguments, "serveadrink.ward -o pulled --from URL"),
    ("push", server.PushArguments, "my_recipe.owl --kind recipe --name ward --to URL --key-file my.key"),
    ("rate", server.RateArguments, "serveadrink.ward 8 --to URL --key-file my.key"),
    ("delete", server.DeleteArguments, "serveadrink.ward --file pouring.py --from URL --key-file my.key"),
    ("watch", server.WatchArguments, "serveadrink.ward --from URL --key-file my.key"),
    ("robot inspect", local.InspectArguments, "amigo --picture reach.png"),
    ("robot make", local.MakeArguments, "my_arm.urdf -o my_arm.toml"),
)
"""Name, arguments and example of each command."""


_EXIT_CODES = "Exit codes: 0 done, 1 the plan failed, 2 bad input, 3 robot or program lacks something, 130 interrupted."


def app_of(commands: Iterable[tuple[str, type[Arguments], str]]) -> typer.Typer:
    """Make the command line of some commands."""
    made = typer.Typer(
        cls=Commands,
        no_args_is_help=True,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
        help="Compile OWL action recipes to robot plans and run them in a simulated world.",
        epilog=_EXIT_CODES,
    )
    made.callback(invoke_without_command=True)(planlang)
    about_robots = "Inspect robots, make robot files."
    robot_app = typer.Typer(cls=Commands, no_args_is_help=True, rich_markup_mode=None, help=about_robots)
    robot_app.callback()(robots_command)
    made.add_typer(robot_app, name="robot")
    for name, arguments, example in commands:
        # without a short help, click cuts the first sentence off after 45 characters
        summary = (arguments.__doc__ or "").partition(".")[0] + "."
        group = robot_app if name.startswith("robot") else made
        kind, epilog = command_of(arguments), f"Example: planlang {name} {example}"
        add = group.command(name.split()[-1], cls=kind, short_help=summary, epilog=epilog)
        add(_command(name, arguments))
    return made


def __getattr__(name: str) -> typer.Typer:
    """Make ``app``, the command line of all commands, when it is first used."""
    if name != "app":
        raise AttributeError(name)
    globals()["app"] = made = app_of(_COMMANDS)
    return made


def planlang(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False,
) -> None:
    """Compile OWL action recipes to robot plans and run them in a simulated world."""
    if version:
        from importlib.metadata import version as installed_version  # slow to import

        typer.echo(f"planlang {installed_version('planlang')}")
        raise typer.Exit


def robots_command() -> None:
    """Inspect robots, make robot files."""


# Some versions of typer vendor click: find the class of usage errors among the bases of one that typer exports.
_UsageError: Any = next(kind for kind in typer.BadParameter.__mro__ if kind.__name__ == "UsageError")


def main() -> NoReturn:
    """Run the command and end the process. With ``--json``, wrong usage is printed as a JSON object, too."""
    try:
        # of the command that the words name, else of all
        named = [one for one in _COMMANDS if [one[0]] == sys.argv[1:2]]
        code = app_of(named or _COMMANDS)(prog_name="planlang", standalone_mode=False)
    except _UsageError as problem:
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
    except typer.Exit as end:
        code = end.exit_code
    except typer.Abort:
        code = ExitCode.INTERRUPTED
    except BrokenPipeError:  # the reader of stdout has closed it
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = ExitCode.FAILED
    sys.exit(int(code or 0))
