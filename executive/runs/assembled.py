"""A run that is assembled and does not begin: it reads all its files, which then can be sent elsewhere."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Any

from executive.options.declaring import made
from executive.options.running import RunSettings
from executive.runs.options import RunOptions
from executive.runs.plan_run import run_plan_file


class _Assembled(Exception):
    """All files were read."""


def read_files(world: Mapping[str, Any]) -> None:
    """Read the files of a world of a sweep as its run does, and do not begin it. Raises BadInput.

    ``options`` of the world are those of the run, as JSON.
    """

    def stop(executive: object) -> None:
        raise _Assembled

    options = RunOptions.of(made(RunSettings, world["options"]))
    with suppress(_Assembled):
        run_plan_file(replace(options, around=stop))
