"""Output files of a run beside its trace, and the listeners and watchers that collect their contents."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from executive.pictures.pose_track import PoseTrack, Watcher
from executive.runs.final_state import Tilts, state_lines
from executive.runs.parameters import Bound, things_of
from executive.runs.prepared import RunFiles
from executive.runs.traces import lines_of, steps_of
from planlang.diagnostics import BadInput, Diagnostic
from planlang.failures import PlanFailure
from planlang.outputs import replace as write_complete
from planlang.runs.trace import Listener
from sim import PyBulletWorld
from sim.truth import Truth

if TYPE_CHECKING:
    from executive.belief import Belief
    from executive.modules.platform import Platform
    from executive.pictures.video import Video
    from executive.report.watching import Watching
    from executive.runs.pose_log import PoseLog
    from planlang.report import Context


class Written:
    """Output files of a run; ``listeners`` get its records, ``watchers`` see the true world."""

    def __init__(self, files: RunFiles, platform: Platform, tilts: Tilts, truth: Truth) -> None:
        """Report progress and measure tilts; :meth:`ask` adds the files."""
        options = files.options
        self._options, self._platform, self._truth = options, platform, truth
        self._inputs = files
        self._belief = platform.belief
        self._files: list[tuple[Path, Callable[[Path], object]]] = []
        self._poses: PoseLog | None = None
        self._shown = ExitStack()
        """Live displays of the run."""
        self._noted: list[Watcher] = []
        self._track = PoseTrack(self._noted)
        """Collects poses for all files that need them."""
        self._is_new = False
        """False while a repeated run catches up with its trace."""
        self._failure: PlanFailure | None = None
        self._ended = "", ""
        self._ending: Callable[..., tuple[str, ...]] | None = None
        """Captions of pictures and videos, made from the run's records."""
        self.watchers: list[Callable[[Truth], None]] = [tilts, *options.watchers]
        self.listeners: list[Listener] = [
            lines_of(self._progress, inner=options.inner_actions),
            *options.listeners,
        ]

    def _progress(self, step: int, line: str) -> None:
        if self._is_new:
            self._options.progress(f"{step / self._truth.rate:7.2f} s  {line}")

    def ask(
        self,
        title: str,
        bound: Mapping[str, Bound],
        header: Mapping[str, object],
        diagnostics: list[Diagnostic],
        context: Callable[[], Context],
    ) -> None:
        """Prepare each output file of the options; problems of writing them are appended to ``diagnostics``.

        ``context`` makes the context of a page.
        """
        options, truth = self._options, self._truth
        if options.picture is not None or options.video is not None:
            from executive.runs.ending import Told, ending_of  # most runs write no picture

            told = Told()
            self._ending = partial(ending_of, told)
            self.listeners.append(lambda record, node: told.add(record))
        if options.picture is not None:
            self._files.append((options.picture, partial(self._save_picture, bound, title)))
        if options.video is not None:
            from executive.pictures.video import Video  # Pillow is slow to import

            video = Video(truth, truth.rate, title, options.view)
            self.listeners.append(steps_of(video.steps.hear))
            self.watchers.append(lambda world: video.frame(world.steps))
            self._files.append((options.video, partial(self._save_video, bound, video)))
        if options.record is not None:
            from executive.pictures.recording import Recording  # needs an extra

            film = Recording(truth, self._belief, recipe=context().graph, title=title)
            self._platform.resolver.watchers.append(film.search)
            self.listeners += (film.hear, lines_of(film.event))
            self._noted.append(film.move)
            self._files.append((options.record, film.save))
        if options.report is not None or options.watch:
            watching, beside = self._watch(), context()
            if options.report is not None:
                self._files.append((options.report, lambda temporary: watching.save(temporary, beside)))
            if options.watch:
                self._show(watching, beside)
        if options.watch_tree:
            from executive.live.terminal import TerminalTree  # rich is slow to import

            self.listeners.append(
                self._shown.enter_context(TerminalTree(sys.stderr, inner=options.inner_actions)).heard
            )
        if options.poses is not None:
            from executive.runs.pose_log import PoseLog  # few runs log poses

            known = {**header, "seed": self._inputs.seed, "schedule": options.schedule, "rate": truth.rate}
            self._poses = PoseLog(truth.rate, options.poses, known)
            self._noted.append(self._poses)
        if options.update_map is not None:
            from executive.belief.map_updating import MapUpdate  # few runs write a map

            maps = {self._inputs.environment, *self._inputs.additions}
            update = MapUpdate(self._platform.belief, maps, diagnostics)
            self.listeners.append(update)
            self._files.append((options.update_map, update.save))
        if self._noted:
            self.watchers.insert(0, self._track)  # the others read its poses

    def _watch(self) -> Watching:
        """Collect the contents of a page."""
        from executive.report.watching import Watching  # most runs write no page

        options = self._options
        watching = Watching(self._platform, self._truth)
        if options.repeated is not None:  # the trace has all records
            watching.tell(line.record for line in options.repeated.lines)
        else:
            if self._inputs.recorded is not None:  # a run that is repeated writes no header
                watching.told.add(self._inputs.recorded.header)
            self.listeners.append(watching.listen)
        self._noted.append(watching.move)
        self.watchers.append(watching.look)
        return watching

    def _show(self, watching: Watching, context: Context) -> None:
        from executive.live.live_run import LiveRun  # a web server: slow to import, and few runs are watched

        live = LiveRun(watching, context, self._truth.rate, partial(print, file=sys.stderr, flush=True))
        self.listeners.append(live.heard)
        self.watchers.append(live.passed)
        self._shown.enter_context(live)

    def begin(self) -> None:
        """Start writing: the run has caught up with the trace that it repeats."""
        self._is_new = True
        if self._poses is not None:
            self._poses.begin()

    def _save_picture(self, bound: Mapping[str, Bound], title: str, path: Path) -> None:
        """Write a picture of the plan's bodies, and of those that its failure names, such as obstacles."""
        from executive.pictures.scene_picture import save_picture  # Pillow is slow to import

        named = () if self._failure is None else names_in(self._failure)
        always = [name for name in dict.fromkeys(named) if name in self._truth.names()]
        names = tuple(bodies_of(bound, self._belief, self._truth))
        save_picture(path, self._truth, names, self._options.view, always, title, self._caption(names))

    def _save_video(self, bound: Mapping[str, Bound], video: Video, path: Path) -> None:
        names = tuple(bodies_of(bound, self._belief, self._truth))
        video.save(path, names, self._caption(names), self._options.long_work)

    def _caption(self, names: Sequence[str]) -> tuple[str, ...]:
        assert self._ending is not None
        seconds = self._truth.steps / self._truth.rate
        return self._ending(*self._ended, seconds, state_lines(self._truth, names))

    def save(self, outcome: str, message: str, failure: PlanFailure | None = None) -> None:
        """Write the files after the run, each atomically; the log of poses is written already.

        ``outcome`` and ``message`` are those of the result, ``failure`` is that of the plan, if it failed.
        """
        self._failure, self._ended = failure, (outcome, message)
        if self._noted:
            self._track.note(self._truth)
        self._shown.close()
        if self._poses is not None:
            self._poses.close()
        problems: list[Diagnostic] = []
        for path, save in self._files if self._is_new else ():
            try:
                write_complete(path, save)
            except BadInput as problem:  # the others are written all the same
                problems += problem.diagnostics
        if problems:
            raise BadInput(problems)


def names_in(failure: PlanFailure) -> Iterator[str]:
    """Yield the strings in a failure and its causes, names of bodies among them."""
    for link in failure.chain():
        values = link.details().values() if isinstance(link, PlanFailure) else ()
        for value in values:
            yield from (value,) if isinstance(value, str) else value if isinstance(value, tuple | Mapping) else ()


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
