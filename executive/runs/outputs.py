"""Output files of a run beside its trace, and the live displays, each made of what listeners and watchers collect.

Imported if one is asked for: Pillow, rich, and what serves and draws pages are slow to import.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path

from executive.belief.map_updating import MapUpdate
from executive.live.live_run import LiveRun
from executive.live.terminal import TerminalTree
from executive.modules.platform import Platform
from executive.pictures.pose_track import PoseTrack, Watcher
from executive.pictures.scene_picture import save_picture
from executive.pictures.video import Video
from executive.report.watching import Watching
from executive.runs.ending import Told, ending_of
from executive.runs.options import Tilts, state_lines
from executive.runs.parameters import Bound
from executive.runs.pose_log import PoseLog
from executive.runs.prepared import RunFiles
from executive.runs.traces import lines_of
from executive.runs.written import Written, bodies_of, still_held
from planlang.diagnostics import BadInput, Diagnostic
from planlang.failures import PlanFailure
from planlang.outputs import replace as write_complete
from planlang.report import Context
from planlang.report.wording import Wording
from sim import PyBulletWorld


class Outputs(Written):
    """Output files and live displays that the options of a run ask for."""

    def __init__(self, files: RunFiles, platform: Platform, tilts: Tilts, truth: PyBulletWorld) -> None:
        """Collect nothing yet: :meth:`ask` adds the files."""
        super().__init__(files, tilts, truth)
        self._inputs, self._platform, self._belief = files, platform, platform.belief
        self._files: list[tuple[Path, Callable[[Path], object]]] = []
        self._shown = ExitStack()
        """Live displays of the run, and logs that are written while it runs."""
        self._noted: list[Watcher] = []
        self._track = PoseTrack(self._noted)
        """Collects poses for all files that need them."""
        self._failure: PlanFailure | None = None
        self._ended = "", "", 0.0
        self._poses: PoseLog | None = None
        self._ending: Callable[..., tuple[str, ...]] | None = None
        """Captions of pictures and videos, made from the run's records."""
        self._wording = Wording()
        """What their steps are called."""

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
            told = Told()
            self._wording = context().wording
            self._ending = partial(ending_of, told, self._wording)
            self.listeners.append(lambda record, node: told.add(record))
        if options.picture is not None:
            self._files.append((options.picture, partial(self._save_picture, bound, title)))
        if options.video is not None:
            video = Video(truth, truth.rate, title, told.tree, options.view, wording=self._wording)
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
            self.listeners.append(
                self._shown.enter_context(TerminalTree(sys.stderr, inner=options.inner_actions)).heard
            )
        if options.poses is not None:
            known = {**header, "seed": self._inputs.seed, "schedule": options.schedule, "rate": truth.rate}
            self._poses = PoseLog(truth.rate, options.poses, known)
            self._shown.callback(self._poses.close)
            self._noted.append(self._poses)
        if options.update_map is not None:
            maps = {self._inputs.environment, *self._inputs.additions}
            update = MapUpdate(self._platform.belief, maps, diagnostics)
            self.listeners.append(update)
            self._files.append((options.update_map, update.save))
        if self._noted:
            self.watchers.insert(0, self._track)  # the others read its poses

    def _watch(self) -> Watching:
        """Collect the contents of a page."""
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
        live = LiveRun(watching, context, self._truth.rate, partial(print, file=sys.stderr, flush=True))
        self.listeners.append(live.heard)
        self.watchers.append(live.passed)
        self._shown.enter_context(live)

    def begin(self) -> None:
        super().begin()
        if self._poses is not None:
            self._poses.begin()

    def save(self, outcome: str, message: str, failure: PlanFailure | None, seconds: float) -> None:
        super().save(outcome, message, failure, seconds)
        self._failure, self._ended = failure, (outcome, message, seconds)
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

    def _save_picture(self, bound: Mapping[str, Bound], title: str, path: Path) -> None:
        """Write a picture of the plan's bodies, and of those that its failure names, such as obstacles."""
        named = () if self._failure is None else names_in(self._failure)
        always = [name for name in dict.fromkeys(named) if name in self._truth.names()]
        names = tuple(bodies_of(bound, self._platform, self._truth))
        save_picture(path, self._truth, names, self._options.view, always, title, self._caption(names))

    def _save_video(self, bound: Mapping[str, Bound], video: Video, path: Path) -> None:
        names = tuple(bodies_of(bound, self._platform, self._truth))
        video.save(path, names, self._caption(names), self._options.long_work)

    def _caption(self, names: Sequence[str]) -> tuple[str, ...]:
        assert self._ending is not None
        held = still_held(self._platform, self._truth) if self._failure is not None else {}
        return self._ending(*self._ended, state_lines(self._truth, names, held))


def names_in(failure: PlanFailure) -> Iterator[str]:
    """Yield the strings in a failure and its causes, names of bodies among them."""
    for link in failure.chain():
        values = link.details().values() if isinstance(link, PlanFailure) else ()
        for value in values:
            yield from (value,) if isinstance(value, str) else value if isinstance(value, tuple | Mapping) else ()
