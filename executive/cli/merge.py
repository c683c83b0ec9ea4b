"""``planlang merge``: several maps of one place become one."""

from __future__ import annotations

from typing import Any

import click

from executive.cli.authoring_arguments import MergeArguments
from executive.cli.console import Answer, text_answer
from executive.maps.merging import merge
from executive.options.declaring import check_written
from executive.runs.files import environments, refuse
from planlang.diagnostics import Diagnostic


def command(arguments: MergeArguments) -> Answer:
    """Merge maps; raises BadInput."""
    if len(arguments.maps) < 2:
        raise click.BadParameter("name at least two maps")
    problems: list[Diagnostic] = []
    paths = environments(arguments.maps, problems)
    problems += check_written(arguments, MergeArguments, {f"the map {path}": path for path in paths})
    refuse(problems)
    merged = merge(paths, arguments.folders, ignore_unread=arguments.ignore_unread)
    conflicts = [one.message for one in merged.diagnostics if one.code == "M022"]
    count = f"{len(conflicts)} conflict{'' if len(conflicts) == 1 else 's'}"
    told = f"{merged.things} things, {merged.placed} with a place, {count}"
    data: dict[str, Any] = {"things": merged.things, "placed": merged.placed, "conflicts": conflicts}
    return text_answer(merged.text, arguments.output, told, merged.diagnostics, **data)
