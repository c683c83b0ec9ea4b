"""Options of a run, and its result."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import field
from enum import Enum
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from executive.runs.failure import Failure
from executive.runs.final_state import Tilts
from executive.runs.settings import RunSettings
from planlang.diagnostics import BadInput, Diagnostic, error
from planlang.notebooks import framed
from planlang.progress import Report, unreported
from planlang.records import dataclass
from planlang.runs import RecordedRun
from planlang.runs.trace import Listener
from sim.truth import Truth

if TYPE_CHECKING:
    from executive.runs.assembly import RobotExecutive


class Outcome(Enum):
    """Outcome of a run."""

    DONE = "done"
    FAILED = "failed"
    LACKS_CAPABILITY = "lacks a capability"
    INTERRUPTED = "interrupted"


@dataclass(frozen=True, kw_only=True)
class RunOptions(RunSettings):
    """Options of a run: its settings, the inputs that the user's words mean, and who looks on."""

    plan: Path | None = None
    recipe: Path | None = None
    task: str | None = None
    accepted: tuple[str, ...] = ()
    """Codes of fixes that the recipe gets before it is compiled, though they may be guesses."""
    ontologies: tuple[Path, ...] = ()
    recipes: tuple[Path, ...] = ()
    """Files with recipes of steps that the recipe leaves to others."""
    robot: Path | None = None
    environment: Path | None = None
    additions: tuple[Path, ...] = ()
    """Maps of further things in the environment."""
    start: tuple[float, float, float] | None = None
    bindings: Mapping[str, str] | None = None
    seed: int = 0
    resume: RecordedRun | None = None
    """The trace of the run to resume."""
    repeats: bool = False
    """Repeat the run of the trace to its last record, to look on: it may have ended, and nothing new is done."""
    notes: tuple[Diagnostic, ...] = ()
    """Diagnostics of before."""
    inner_actions: bool = False
    """Tell the progress of actions that process modules perform inside of others, too."""
    progress: Callable[[str], None] = lambda line: None
    long_work: Report = unreported
    """Given the progress of long work: of maps that have to be built, of a video."""
    announce: Callable[[Sequence[Diagnostic]], None] = lambda found: None
    """Given the diagnostics once, before the plan runs."""
    watchers: tuple[Callable[[Truth], None], ...] = ()
    """Called with the true world before the plan runs and after every step of the world."""
    listeners: tuple[Listener, ...] = ()
    """Given each record of the trace as it is written."""
    around: Callable[[RobotExecutive], None] = lambda executive: None
    """Given the executive before the plan runs: it may wrap its process modules, to let requests fail, for example."""


class Ended(Protocol):
    """A run that has ended, and is repeated for what it was not asked for; see :mod:`executive.runs.ended_run`."""

    @property
    def page(self) -> str:
        """The page of the run."""

    def records(self) -> Sequence[Mapping[str, Any]]:
        """Return the records of the trace."""

    def write(self, what: str, path: Path, *, force: bool = False, view: str | None = None) -> Path:
        """Write a file of the run."""


@dataclass(frozen=True, slots=True)
class RunResult:
    """Result of a run, which shows itself in a notebook. Equal inputs and seeds give equal results."""

    outcome: Outcome
    message: str
    """What is printed for people: ``done``, or the failure with its places and causes, in several lines."""
    final_state: tuple[str, ...] = ()
    """Where the objects of the plan are in the end, in the simulator's truth: ``bottle1: held by patient1``."""
    diagnostics: tuple[Diagnostic, ...] = ()
    duration: float = 0.0
    """Plan time [s]."""
    failure: Failure | None = None
    """Why the run did not succeed; ``str(run.failure)`` is a sentence. None if it did, or was interrupted."""
    tilts: Tilts = field(default_factory=Tilts)
    """The angles by which what was carried leaned from upright, in the simulator's truth."""
    seed: int = 0
    ended: Ended | None = field(default=None, repr=False, compare=False)
    """What can still be shown of the run; None if it did not begin."""

    @property
    def succeeded(self) -> bool:
        """True if the plan ended without a failure."""
        return self.outcome is Outcome.DONE

    @property
    def failures(self) -> tuple[str, ...]:
        """The class of the failure, then those of its causes; empty without a failure."""
        return () if self.failure is None else self.failure.types

    @property
    def trace(self) -> Sequence[Mapping[str, Any]]:
        """The records of the trace, for ``pandas.DataFrame`` or :class:`planlang.TaskTree`; docs/reference/trace.md.

        Raises BadInput if the file of the trace cannot be read any more.
        """
        return () if self.ended is None else self.ended.records()

    @property
    def row(self) -> dict[str, Any]:
        """The run as a row of a table: seed, outcome, succeeded, duration [s], failure (its class) and reason."""
        return {
            "seed": self.seed,
            "outcome": self.outcome.value,
            "succeeded": self.succeeded,
            "duration": round(self.duration, 3),
            "failure": None if self.failure is None else self.failure.type,
            "reason": None if self.failure is None else str(self.failure),
        }

    def as_json(self) -> dict[str, Any]:
        """Return what ``planlang run --json`` prints of a run."""
        return {
            "outcome": self.outcome.value,
            "succeeded": self.succeeded,
            "failure": None if self.failure is None else self.failure.as_json(),
            "message": self.message,
            "final_state": list(self.final_state),
            "largest_tilts": self.tilts.degrees(),
            "duration": self.duration,
        }

    def report(self, path: str | PathLike[str], *, force: bool = False) -> Path:
        """Write the page that shows the run, plan, world and causes on one clock, and return its path.

        The run is repeated for it: that takes about as long as the run did. ``force`` overwrites files that planlang
        did not write. Raises BadInput if the file cannot be written, or the run cannot be repeated.
        """
        return self._shown().write("report", Path(path), force=force)

    def picture(self, path: str | PathLike[str], *, view: str | None = None, force: bool = False) -> Path:
        """Write a picture of the final scene, as PNG, and return its path; the run is repeated for it.

        ``view`` is that of ``planlang run --view``: ``overview``, ``top``, or points of the map [m]. Raises BadInput as
        :meth:`report` does.
        """
        return self._shown().write("picture", Path(path), force=force, view=view)

    def _shown(self) -> Ended:
        if self.ended is None:
            raise BadInput([error("C041", "the run did not begin: there is nothing to show", help=self.message)])
        return self.ended

    def __str__(self) -> str:
        return "\n".join(line for line in (self.message, *self.final_state, *self.tilts.lines()) if line)

    def _repr_mimebundle_(self, include: object = None, exclude: object = None) -> dict[str, str]:
        """Show the page of the run in a notebook; text where it cannot be repeated."""
        bundle = {"text/plain": str(self)}
        if self.ended is not None:
            with suppress(BadInput):
                bundle["text/html"] = framed(self.ended.page, "planlang run")
        return bundle
