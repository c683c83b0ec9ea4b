"""Scenarios: a run as a user types it, and what must hold in the simulator's truth when it has ended.

Each module of this package has the scenarios of one family of recipes in a list ``SCENARIOS``. Goals ask the simulated
world alone, never the plan or the belief.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import chdir
from dataclasses import dataclass, field, replace
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from tempfile import TemporaryDirectory

from executive.cli import command_lines
from executive.cli.app import app
from executive.cli.arguments import RunArguments
from executive.runs.options import Outcome, RunOptions, RunResult
from executive.runs.plan_run import Run
from executive.runs.prepared import prepared
from planlang.geometry import Pose
from sim import PyBulletWorld
from sim.truth import tilt

TOP = Path(__file__).resolve().parents[3]
CORPUS = TOP.parent / "shared" / "corpus"


@dataclass
class Watched:
    """The true world of a run: as it began, what was seen of it at each step, and as it is now."""

    world: PyBulletWorld = field(init=False)
    start: dict[str, Pose] = field(default_factory=dict)
    """Poses of all bodies before the plan ran."""
    base: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Pose of the robot's base then: x, y [m] and yaw [rad] in the map."""
    tilts: dict[str, float] = field(default_factory=dict)
    """Largest angle between up and the z axis of each body while the robot held it [rad]."""
    notes: dict[str, object] = field(default_factory=dict)
    """Notes of the scenario's own watchers."""

    def __call__(self, world: PyBulletWorld) -> None:
        """Take note of the world after one more step."""
        if not self.start:
            self.world, self.start = world, {name: world.pose(name) for name in world.names()}
            self.base = world.configuration().base
        for name in world.attached():
            self.tilts[name] = max(self.tilts.get(name, 0.0), tilt(world.pose(name)))


Goal = Callable[[Watched], Iterable[str]]
"""Says what does not hold; nothing if the goal is reached."""


@dataclass(frozen=True)
class Scenario:
    """A run and its goal. ``arguments`` are those of ``planlang run``; ``corpus/`` begins paths in the corpus,
    ``docs/`` those of examples here."""

    name: str
    arguments: tuple[str, ...]
    goal: Goal
    watchers: tuple[Callable[[Watched], None], ...] = ()
    """Called after each step, to keep something in ``notes``."""
    seconds: float = 5.0
    """Wall-clock time that a run takes here, roughly [s]: the suite runs what README shows if it takes 6 at most."""

    @property
    def command(self) -> str:
        """The command as a user types it."""
        return " ".join(("planlang run", *(f'"{one}"' if " " in one else one for one in self.arguments)))

    @property
    def is_quick(self) -> bool:
        """Return whether the suite has time for it."""
        return self.seconds <= 6.0

    def is_run_by(self, words: Sequence[str]) -> bool:
        """Return whether the words of a command, wherever its files are, run this and write the trace or a picture."""
        bare = [Path(word).name for word in words]
        for option in ("--trace", "--picture"):
            if option in bare:
                del bare[bare.index(option) : bare.index(option) + 2]
        return sorted(bare) == sorted(["run", *(Path(one).name for one in self.arguments)])

    @property
    def needs_corpus(self) -> bool:
        """Return whether files of the corpus are used."""
        return any(one.startswith("corpus/") for one in self.arguments)


@dataclass(frozen=True)
class Judged:
    """The ending of a scenario's run, and what of its goal does not hold."""

    result: RunResult
    unmet: tuple[str, ...]
    tilts: dict[str, float]

    @property
    def reached(self) -> bool:
        """Return whether the run ended without failure and its goal holds."""
        return self.result.outcome is Outcome.DONE and not self.unmet


def judged(scenario: Scenario, seed: int = 0) -> Judged:
    """Run a scenario in this process, in a folder of its own; raises BadInput as the command does."""
    texts = [at_home(one) for one in scenario.arguments]
    with TemporaryDirectory() as folder, chdir(folder):
        return judged_run(scenario, RunOptions.of(parsed([*texts, "--seed", str(seed), "--json"])))


def judged_run(scenario: Scenario, options: RunOptions) -> Judged:
    """Run what options say, which are those of the scenario's command; raises BadInput as the command does."""
    watched = Watched()

    def watch(world: PyBulletWorld) -> None:
        watched(world)
        for watcher in scenario.watchers:
            watcher(watched)

    with Run(prepared(replace(options, watchers=(watch,)))) as run:
        result = run.execute()
        unmet = tuple(scenario.goal(watched)) if watched.start else ("the run did not begin",)
    return Judged(result, unmet, watched.tilts)


def at_home(text: str) -> str:
    """Return an argument with the path of the corpus, or of this checkout, if it names a file there."""
    folders = {"corpus/": CORPUS.parent, "docs/": TOP}
    mark, path = ("@", text[1:]) if text.startswith("@") else ("", text)
    return next((f"{mark}{folder / path}" for start, folder in folders.items() if path.startswith(start)), text)


def parsed(words: Sequence[str]) -> RunArguments:
    """Return the arguments that the command would get."""
    values = app.commands["run"].make_context("run", list(words)).params
    return command_lines.parsed(command_lines.arguments_of(RunArguments, values))


def scenarios() -> dict[str, Scenario]:
    """Return all scenarios by name."""
    modules = (import_module(f"{__name__}.{one.name}") for one in iter_modules(__path__))
    return {one.name: one for module in modules for one in getattr(module, "SCENARIOS", ())}


def run_by(words: Sequence[str]) -> Scenario | None:
    """Return the scenario that the words of a command run, None if there is none."""
    return next((one for one in scenarios().values() if one.is_run_by(words)), None)
