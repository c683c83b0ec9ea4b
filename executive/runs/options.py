"""Options of a run, and its result."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING

from executive.runs.final_state import Tilts
from executive.runs.settings import RunSettings
from planlang.diagnostics import Diagnostic
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


@dataclass(frozen=True, slots=True)
class RunResult:
    """Result of a run. ``final_state`` has the objects of the plan as they are in the simulator's truth."""

    outcome: Outcome
    message: str
    final_state: tuple[str, ...] = ()
    diagnostics: tuple[Diagnostic, ...] = ()
    seconds: float = 0.0
    """Plan time [s]."""
    failure: tuple[str, ...] = ()
    """Classes of the failure that ended the plan and of its causes, the failure itself first."""
    tilts: Tilts = field(default_factory=Tilts)
    """The angles by which what was carried leaned from upright, in the simulator's truth."""
