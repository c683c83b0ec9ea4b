"""The command ``planlang``: its subcommands, each in a file of its name beside this one."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from typing import Annotated, Any, NoReturn

import typer

from executive.cli import check, compile, convert, inspect, locate, match, replay, run
from executive.cli.console import Answer, ExitCode, give

app = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Compile OWL action recipes to robot plans and run them in a simulated world.",
    epilog="Exit codes: 0 done, 1 the plan failed, 2 bad input, 3 the robot lacks a capability, 130 interrupted.",
)

robot_app = typer.Typer(no_args_is_help=True, rich_markup_mode=None, help="About robots.")
app.add_typer(robot_app, name="robot")


@app.callback(invoke_without_command=True)
def planlang(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False,
) -> None:
    """Compile OWL action recipes to robot plans and run them in a simulated world."""
    if version:
        from importlib.metadata import version as installed_version

        typer.echo(f"planlang {installed_version('planlang')}")
        raise typer.Exit


@robot_app.callback()
def robots_command() -> None:
    """About robots."""


def _add(to: typer.Typer, name: str, command: Callable[..., None], example: str) -> None:
    # without a short help, click cuts the first sentence off after 45 characters
    summary = (command.__doc__ or "").partition(".")[0] + "."
    to.command(name, short_help=summary, epilog=f"Example: planlang {example}")(command)


for name, command, example in (
    ("compile", compile.compile_command, "compile serve_a_drink -o serve_a_drink.py --graph serve_a_drink.svg"),
    ("check", check.check_command, "check my_recipe.owl --ontologies ../ontologies --fix"),
    ("convert", convert.convert_command, "convert my_recipe.owl --to manchester -o my_recipe.omn"),
    ("match", match.match_command, "match serve_a_drink --robot amigo"),
    ("run", run.run_command, "run serve_a_drink --seed 3 --trace run.jsonl --picture scene.png"),
    ("replay", replay.replay_command, "replay run.jsonl"),
    (
        "locate",
        locate.locate_command,
        'locate "in reach of the patient with the right arm" --robot amigo --environment hospital_room '
        "--explain where.png",
    ),
):
    _add(app, name, command, example)
_add(robot_app, "inspect", inspect.inspect_command, "robot inspect amigo --picture reach.png")


# Some versions of typer bring a click of their own: its class of usage errors is found from one that typer exports.
_UsageError: Any = next(kind for kind in typer.BadParameter.__mro__ if kind.__name__ == "UsageError")


def main() -> NoReturn:
    """Run the command; ends the process. Wrong usage is a JSON object, too, if ``--json`` is among the words."""
    try:
        code = app(prog_name="planlang", standalone_mode=False)
    except _UsageError as problem:
        if "--json" in sys.argv:
            name = problem.ctx.command_path.removeprefix("planlang").strip() if problem.ctx is not None else ""
            message = problem.format_message()
            give(name, Answer(ExitCode.BAD_INPUT, data={"error": message}), as_json=True)
        else:
            problem.show()
        code = ExitCode.BAD_INPUT
    except typer.Exit as end:
        code = end.exit_code
    except typer.Abort:
        code = ExitCode.INTERRUPTED
    except BrokenPipeError:  # the reader of stdout has had enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = ExitCode.FAILED
    sys.exit(int(code or 0))
