"""Options that commands share: what they print, and where they read ontologies."""

from __future__ import annotations

import os
from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from planlang.diagnostics import BadInput, WrongOption, error
from planlang.records import dataclass
from planlang.words import Option, Text


class Detail(Enum):
    """How many of its notes and warnings a command prints; it prints all errors."""

    NONE = "none"
    CODES = "codes"
    """The first of each code, with the number of others: many would hide the result."""
    ADVICE = "advice"
    """The first of each code and advice: for commands whose result they are."""
    ALL = "all"


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """Options of every command."""

    json: Annotated[bool, typer.Option("--json", help="Print one JSON object to stdout.")] = False
    verbose: Annotated[
        bool, typer.Option("--verbose", help="List all notes and warnings, not only the first of each code.")
    ] = False
    quiet: Annotated[bool, typer.Option("--quiet", help="Print only errors to stderr, and no progress.")] = False

    @property
    def detail(self) -> Detail:
        """How many notes and warnings to print. Raises a usage error for contradictory options."""
        if self.quiet and self.verbose:
            raise WrongOption(Option("quiet"), " and ", Option("verbose"), " exclude each other")
        return Detail.NONE if self.quiet else Detail.ALL if self.verbose else self.summed

    @property
    def summed(self) -> Detail:
        """How many to print by default."""
        return Detail.CODES

    @property
    def is_silent(self) -> bool:
        """True if only results and diagnostics are printed."""
        return self.json or self.quiet


@dataclass(frozen=True, kw_only=True)
class OntologyArguments(Arguments):
    """Options of commands that read ontologies."""

    ontologies: Annotated[
        list[Path] | None, typer.Option(metavar="DIR", help="Also search this folder for imports; repeatable.")
    ] = None

    @property
    def folders(self) -> tuple[Path, ...]:
        """Folders to search for imports. Raises BadInput if one is no folder."""
        folders = tuple(self.ontologies or ())
        wrong = [path for path in folders if not os.path.isdir(path)]
        if wrong:
            raise BadInput([error("C001", Text(Option("ontologies", path), " is not a folder")) for path in wrong])
        return folders


@dataclass(frozen=True, kw_only=True)
class TaskArguments(OntologyArguments):
    """Options of commands that read recipes."""

    task: Annotated[
        str | None, typer.Option(metavar="CLASS", help="The task: local name or IRI of an action class in the recipe.")
    ] = None
