"""The command ``planlang``; what its parts do stands beside it."""

from __future__ import annotations

from typing import Annotated

import typer

from executive.cli import places, recipes, runs

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
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


for name, command, example in (
    ("compile", recipes.compile_command, "compile serve_a_drink -o serve_a_drink.py --graph serve_a_drink.svg"),
    ("check", recipes.check_command, "check my_recipe.owl --ontologies ../ontologies --fix"),
    ("convert", recipes.convert_command, "convert my_recipe.owl --to manchester -o my_recipe.omn"),
    ("match", recipes.match_command, "match serve_a_drink --robot amigo"),
    ("run", runs.run_command, "run serve_a_drink --seed 3 --trace run.jsonl --picture scene.png"),
    ("replay", runs.replay_command, "replay run.jsonl"),
    (
        "locate",
        places.locate_command,
        'locate "in reach of the patient with the right arm" --robot amigo --environment hospital_room '
        "--explain where.png",
    ),
):
    app.command(name, epilog=f"Example: planlang {example}")(command)
robot_app.command("inspect", epilog="Example: planlang robot inspect amigo --picture reach.png")(places.inspect_command)
