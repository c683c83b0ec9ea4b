"""A run that is assembled and does not begin: it reads all its files, which then can be sent elsewhere."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

from executive.runs.options import RunOptions
from executive.runs.plan_run import run_plan_file


class _Assembled(Exception):
    """All files were read."""


def read_files_of(options: RunOptions) -> None:
    """Read the files of a run as it does, and do not begin it. Raises BadInput."""

    def stop(executive: object) -> None:
        raise _Assembled

    with suppress(_Assembled):
        run_plan_file(replace(options, around=stop))
