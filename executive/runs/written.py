"""What follows a run: listeners and watchers, the files that they write beside its trace, and its progress."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from executive.pictures.pose_track import PoseTrack, Watcher
from executive.runs.final_state import Tilts
from executive.runs.parameters import Bound, things_of
from executive.runs.prepared import RunFiles
from executive.runs.traces import lines_of
from planlang.diagnostics import BadInput, Diagnostic
from planlang.failures import PlanFailure
from planlang.outputs import replace as write_complete
from planlang.runs.trace import Listener
from sim import PyBulletWorld
from sim.truth import Truth

if TYPE_CHECKING:
    from executive.belief import Belief


class Written:
    """Output files of a run: none here; ``listeners`` get its records, ``watchers`` see the true world."""

    def __init__(self, files: RunFiles, tilts: Tilts, truth: Truth) -> None:
        """Report progress and measure tilts; :mod:`executive.runs.outputs` adds the files."""
        options = files.options
        self._options, self._truth = options, truth
        self._files: list[tuple[Path, Callable[[Path], object]]] = []
        self._shown = ExitStack()
        """Live displays of the run, and logs that are written while it runs."""
        self._noted: list[Watcher] = []
        self._track = PoseTrack(self._noted)
        """Collects poses for all files that need them."""
        self._is_new = False
        """False while a repeated run catches up with its trace."""
        self._failure: PlanFailure | None = None
        self._ended = "", ""
        self.watchers: list[Callable[[Truth], None]] = [tilts, *options.watchers]
        self.listeners: list[Listener] = [
            lines_of(self._progress, inner=options.inner_actions),
            *options.listeners,
        ]

    def _progress(self, step: int, line: str) -> None:
        if self._is_new:
            self._options.progress(f"{step / self._truth.rate:7.2f} s  {line}")

    def begin(self) -> None:
        """Start writing: the run has caught up with the trace that it repeats."""
        self._is_new = True

    def save(self, outcome: str, message: str, failure: PlanFailure | None = None) -> None:
        """Write the files after the run, each atomically; the log of poses is written already.

        ``outcome`` and ``message`` are those of the result, ``failure`` is that of the plan, if it failed.
        """
        self._failure, self._ended = failure, (outcome, message)
        if self._noted:
            self._track.note(self._truth)
        self._shown.close()
        problems: list[Diagnostic] = []
        for path, save in self._files if self._is_new else ():
            try:
                write_complete(path, save)
            except BadInput as problem:  # the others are written all the same
                problems += problem.diagnostics
        if problems:
            raise BadInput(problems)


class WatchedWorld:
    """World whose watchers are called before the first step and after each one."""

    def __init__(self, world: PyBulletWorld, watchers: Sequence[Callable[[Truth], None]]) -> None:
        self.world, self.watchers, self.rate = world, watchers, world.rate
        self._show()

    def step(self) -> None:
        self.world.step()
        self._show()

    def _show(self) -> None:
        for watcher in self.watchers:
            watcher(self.world)


def bodies_of(bound: Mapping[str, Bound], belief: Belief, truth: Truth) -> Iterator[str]:
    """Yield the bodies of the plan's parameters that exist."""
    for what in (one for value in bound.values() for one in things_of(value)):
        try:
            name = belief.bind(what, truth.configuration().base)
        except PlanFailure:
            continue
        if name in truth.names():
            yield name
