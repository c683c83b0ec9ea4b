"""Arguments of the commands that run a plan in many worlds."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from executive.cli.arguments import Arguments, RecipeOrPlan, SituationArguments
from planlang.records import dataclass

Csv = Annotated[Path | None, typer.Option(metavar="FILE", help="Also write the rows as a table of CSV.")]
Overwrite = Annotated[bool, typer.Option("--force", help="Overwrite files that planlang did not write.")]


@dataclass(frozen=True, kw_only=True)
class SweepArguments(SituationArguments):
    """Run a plan or a recipe in many worlds, and count how the runs end.

    The worlds are those of planlang run --seed 1, 2, ...: the same robot and map, but things lie elsewhere.
    Exit code 1: in some worlds the plan failed or the run crashed.
    """

    recipe: RecipeOrPlan
    worlds: Annotated[int, typer.Option(min=1, max=1_000_000, metavar="N", help="Number of worlds.")] = 100
    first: Annotated[int, typer.Option(min=0, metavar="N", help="The first seed; 0: things lie as in the map.")] = 1
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Append a line of JSON for each world; if the file is there, go on with it."),
    ] = None
    processes: Annotated[
        int | None, typer.Option(min=1, max=1000, metavar="N", help="Worlds at a time; default: one for each core.")
    ] = None
    shard: Annotated[
        str | None,
        typer.Option(metavar="K/N", help="Run every N-th world only, from the K-th on: a part for this machine."),
    ] = None
    csv: Csv = None
    reports: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER", help="Write a page of each world in which the plan fails, HTML; that run is made twice."
        ),
    ] = None
    seconds: Annotated[int, typer.Option(min=1, metavar="S", help="Most CPU time of one world [s].")] = 120
    memory: Annotated[int, typer.Option(min=100, metavar="MB", help="Most memory of one world [MB].")] = 2000


@dataclass(frozen=True, kw_only=True)
class SweepMergeArguments(Arguments):
    """Merge the shards of a sweep into one file."""

    files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="Files of planlang sweep --out.")]
    out: Annotated[Path, typer.Option(metavar="FILE", help="Write the sweep to this file.")]
    csv: Csv = None
    force: Overwrite = False


@dataclass(frozen=True, kw_only=True)
class SweepTableArguments(Arguments):
    """Print the table of a sweep again."""

    file: Annotated[Path, typer.Argument(metavar="FILE", help="A file of planlang sweep --out.")]
    csv: Csv = None
    force: Overwrite = False
