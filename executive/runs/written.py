"""Files that a run writes beside its trace, and those that look on for that while it goes on."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from executive.pictures.drawn import drawn_in
from executive.runs.final_state import Tilts
from executive.runs.options import RunOptions
from executive.runs.parameters import Bound, things_of
from executive.runs.traces import lines_of
from planlang import PlanFailure
from planlang.diagnostics import Diagnostic
from planlang.outputs import replace as write_complete
from planlang.runs.trace import Listener
from sim import PyBulletWorld

if TYPE_CHECKING:
    from executive.belief import Belief
    from executive.modules.platform import Platform
    from executive.runs.pose_log import PoseLog
    from planlang.report import Context


class Written:
    """Files that the options of a run ask for; ``listeners`` hear its events, ``watchers`` see the true world."""

    def __init__(self, options: RunOptions, platform: Platform, tilts: Tilts, truth: PyBulletWorld) -> None:
        """Tell the progress and measure tilts; nothing is written yet."""
        self._options, self._platform, self._truth = options, platform, truth
        self._belief = platform.belief
        self._files: list[tuple[Path, Callable[[Path], object]]] = []
        self._poses: PoseLog | None = None
        self._is_new = False
        """True once what happens was not written before."""
        self.watchers: list[Callable[[PyBulletWorld], None]] = [tilts, *options.watchers]
        self.listeners: list[Listener] = [lines_of(self._progress, inner=options.inner_actions)]

    def _progress(self, step: int, line: str) -> None:
        if self._is_new:
            self._options.progress(f"{step / self._truth.rate:7.2f} s  {line}")

    def ask(
        self,
        title: str,
        bound: Mapping[str, Bound],
        header: Mapping[str, object],
        found: list[Diagnostic],
        context: Callable[[], Context],
    ) -> None:
        """Ask for each file of the options; what their making finds is appended to ``found``.

        ``context`` gives what a page shows beside trace and world.
        """
        options, truth = self._options, self._truth
        if options.picture is not None:
            meant = partial(bodies_of, bound, self._belief, truth)  # at the end
            self._files.append((options.picture, lambda path: truth.save_picture(path, of=tuple(meant()))))
        if options.record is not None:
            from executive.pictures.recording import Recording  # needs an extra

            film = Recording(truth.rate, drawn_in(truth), title=title)
            self.listeners.append(lines_of(film.event))
            self.watchers.append(lambda world: film.frame(world.steps))
            self._files.append((options.record, film.save))
        if options.report is not None:
            self._report(options.report, context)
        if options.poses is not None:
            from executive.runs.pose_log import PoseLog

            known = {**header, "seed": options.seed, "schedule": options.schedule, "rate": truth.rate}
            self._poses = PoseLog(truth, options.poses, known)
            self.watchers.append(self._poses)
        if options.update_map is not None:
            from executive.belief.map_updating import MapUpdate

            update = MapUpdate(self._belief, {options.environment, *options.additions}, found)
            self.listeners.append(update)
            self._files.append((options.update_map, update.save))

    def _report(self, path: Path, context: Callable[[], Context]) -> None:
        from executive.report.watching import Told, Watching  # most runs write no page

        options = self._options
        watching = Watching(self._platform, self._truth)
        if options.repeats and options.resume is not None:  # all that is told is in the trace
            watching.told = Told.of(line.record for line in options.resume.lines)
        else:
            if options.resume is not None:  # a run that is repeated writes no header
                watching.told.add(options.resume.header)
            self.listeners.append(watching.listen)
        self.watchers.append(watching.look)
        self._files.append((path, lambda temporary: watching.save(temporary, context())))

    def begin(self) -> None:
        """Hear that what comes was not written before, by the run that this one repeats."""
        self._is_new = True
        if self._poses is not None:
            self._poses.begin()

    def save(self) -> None:
        """Write the files, each whole or not at all; the log of poses is written already."""
        if self._poses is not None:
            self._poses.close()
        for path, save in self._files if self._is_new else ():
            write_complete(path, save)


class WatchedWorld:
    """A world that others look at before the first step and after every one."""

    def __init__(self, world: PyBulletWorld, watchers: Sequence[Callable[[PyBulletWorld], None]]) -> None:
        self.world, self.watchers, self.rate = world, watchers, world.rate
        self._show()

    def step(self) -> None:
        self.world.step()
        self._show()

    def _show(self) -> None:
        for watcher in self.watchers:
            watcher(self.world)


def bodies_of(bound: Mapping[str, Bound], belief: Belief, truth: PyBulletWorld) -> Iterator[str]:
    """Yield the bodies that the plan's parameters mean, as far as there are any."""
    for what in (one for value in bound.values() for one in things_of(value)):
        try:
            name = belief.bind(what, truth.configuration().base)
        except PlanFailure:
            continue
        if name in truth.names():
            yield name
