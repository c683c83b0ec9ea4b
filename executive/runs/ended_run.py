"""A run that has ended, and is repeated for what it was not asked for: its page, a picture."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

from executive.runs.options import RunOptions, RunResult
from executive.runs.traces import read_trace
from planlang.diagnostics import BadInput
from planlang.outputs import PNG, check_outputs
from planlang.runs import RecordedRun

_ALONE: dict[str, Any] = {
    **dict.fromkeys(("trace", "picture", "video", "view", "record", "report", "poses", "upload", "update_map")),
    **dict.fromkeys(("watch", "watch_tree", "gui", "world_as_left"), False),
    **dict.fromkeys(("watchers", "listeners"), ()),
    "repeats": True,
    "progress": lambda line: None,
    "announce": lambda found: None,
}
"""Options of a run that is repeated to look on: nobody else does, and it writes nothing else."""


class EndedRun:
    """Repeats a run by its trace. The files that it was made from have to be as they were."""

    def __init__(
        self, options: RunOptions, events: Sequence[Mapping[str, Any]], run: Callable[[RunOptions], RunResult]
    ) -> None:
        """``events`` are the records of the trace unless it is in the file of the options; ``run`` executes a run."""
        self._options, self._events, self._run = options, events, run

    def records(self) -> Sequence[Mapping[str, Any]]:
        """Return the records of the trace. Raises BadInput if its file cannot be read."""
        return [line.record for line in self._recorded().lines]

    def _recorded(self) -> RecordedRun:
        options = self._options
        if options.trace is not None:
            return read_trace(options.trace)[0]
        if options.resume is not None:  # a run that is only looked on at
            return options.resume
        return RecordedRun.of(self._events)

    def write(self, what: str, path: Path, *, force: bool = False, view: str | None = None) -> Path:
        """Write a file of the run, its "report" or "picture". Raises BadInput if that cannot be done."""
        problems = check_outputs({what: path}, {}, formats={"picture": PNG}, force=force)
        if problems:
            raise BadInput(problems)
        self._run(replace(self._options, **_ALONE | {"resume": self._recorded(), "view": view, what: path}))
        return path

    @cached_property
    def _page(self) -> str:
        with tempfile.TemporaryDirectory(prefix="planlang-") as folder:
            return self.write("report", Path(folder) / "run.html").read_text(encoding="utf-8")

    @property
    def page(self) -> str:
        """The page of the run, made once. Raises BadInput if the run cannot be repeated."""
        return self._page
