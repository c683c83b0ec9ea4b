"""Options that commands share: what they print, and where they read ontologies."""

from __future__ import annotations

from enum import Enum
from typing import Annotated

from executive.options.declaring import option
from executive.options.running import OntologyOptions, TaskOptions
from planlang.diagnostics import WrongOption
from planlang.records import dataclass
from planlang.words import Option


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

    json: Annotated[bool, option(help="Print one JSON object to stdout.")] = False
    verbose: Annotated[bool, option(help="List all notes and warnings, not only the first of each code.")] = False
    quiet: Annotated[bool, option(help="Print only errors to stderr, and no progress.")] = False

    @property
    def detail(self) -> Detail:
        """How many notes and warnings to print. Raises WrongOption for contradictory options."""
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
class OntologyArguments(OntologyOptions, Arguments):
    """Options of commands that read ontologies."""


@dataclass(frozen=True, kw_only=True)
class TaskArguments(TaskOptions, Arguments):
    """Options of commands that read recipes."""
