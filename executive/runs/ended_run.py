"""A run that has ended, and is repeated for a page or a picture that it did not write."""

from __future__ import annotations

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
from planlang.temporary import temporary_folder


class EndedRun:
    """Repeats a run by its trace; its input files must not have changed."""

    def __init__(
        self, options: RunOptions, events: Sequence[Mapping[str, Any]], run: Callable[[RunOptions], RunResult]
    ) -> None:
        """``events``: records of the trace, unless ``options`` wrote it to a file; ``run`` executes a run."""
        self._options, self._events, self._run = options, events, run

    def records(self) -> Sequence[Mapping[str, Any]]:
        """Records of the trace. Raises BadInput if its file cannot be read."""
        return [line.record for line in self._recorded().lines]

    def _recorded(self) -> RecordedRun:
        options = self._options
        if options.trace is not None:
            return read_trace(options.trace)[0]
        if options.repeated is not None:  # a run that was repeated for a file writes no trace
            return options.repeated
        return RecordedRun.of(self._events)

    def write(self, what: str, path: Path, *, force: bool = False, view: str | None = None) -> Path:
        """Write the "report" or "picture" of the run. Raises BadInput if that is not possible."""
        problems = check_outputs({what: path}, {}, formats={"picture": PNG}, force=force)
        if problems:
            raise BadInput(problems)
        file: dict[str, Any] = {what: path}
        self._run(replace(self._options.unseen(), repeated=self._recorded(), resume=None, view=view, **file))
        return path

    @cached_property
    def _page(self) -> str:
        with temporary_folder() as folder:
            return self.write("report", folder / "run.html").read_text(encoding="utf-8")

    @property
    def page(self) -> str:
        """The page of the run, made once. Raises BadInput if the run cannot be repeated."""
        return self._page
