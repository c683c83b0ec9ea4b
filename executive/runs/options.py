"""Options of a run, and its result."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING

from executive.runs.final_state import Tilts
from planlang.diagnostics import Diagnostic
from planlang.records import dataclass
from planlang.runs import RecordedRun
from sim import PyBulletWorld

if TYPE_CHECKING:
    from executive.runs.assembly import RobotExecutive


class Outcome(Enum):
    """Outcome of a run."""

    DONE = "done"
    FAILED = "failed"
    LACKS_CAPABILITY = "lacks a capability"
    INTERRUPTED = "interrupted"


@dataclass(frozen=True, slots=True)
class RunOptions:
    """Options of a run: its inputs and the files to write."""

    plan: Path | None = None
    recipe: Path | None = None
    task: str | None = None
    accepted: tuple[str, ...] = ()
    """Codes of fixes that the recipe gets before it is compiled, though they may be guesses."""
    ontologies: tuple[Path, ...] = ()
    recipes: tuple[Path, ...] = ()
    """Files with recipes of steps that the recipe leaves to others."""
    modules: tuple[Path, ...] = ()
    """The user's files of process modules."""
    robot: Path | None = None
    urdf: Path | None = None
    environment: Path | None = None
    additions: tuple[Path, ...] = ()
    """Maps of further things in the environment."""
    start: tuple[float, float, float] | None = None
    models: tuple[Path, ...] | None = None
    """Folders with the recognition models, programs and maps that the robot has; None: it recognises all classes."""
    trust_map: bool = False
    """The poses of the map count as seen: a robot without camera works from them."""
    unknown: tuple[str, ...] = ()
    """Things and classes of things of which the robot does not know where they are."""
    bindings: Mapping[str, str] | None = None
    seed: int = 0
    schedule: int | None = None
    gui: bool = False
    trace: Path | None = None
    picture: Path | None = None
    record: Path | None = None
    poses: Path | None = None
    """The file for a log of where things and links are."""
    upload: Path | None = None
    """The file for maps that the plan uploads."""
    update_map: Path | None = None
    """The file for the map as the robot knows it at the end."""
    force: bool = False
    """Run although the robot lacks a capability, or the program a process module."""
    resume: RecordedRun | None = None
    """The trace of the run to resume."""
    world_as_left: bool = False
    """The user states that the world is as that trace left it; else it is restored."""
    notes: tuple[Diagnostic, ...] = ()
    """Diagnostics of before."""
    inner_actions: bool = False
    """Tell the progress of actions that process modules perform inside of others, too."""
    progress: Callable[[str], None] = lambda line: None
    announce: Callable[[Sequence[Diagnostic]], None] = lambda found: None
    """Given the diagnostics once, before the plan runs."""
    watchers: tuple[Callable[[PyBulletWorld], None], ...] = ()
    """Called with the true world before the plan runs and after every step of the world."""
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
