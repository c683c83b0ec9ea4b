"""``planlang merge``: several maps of one place become one."""

from __future__ import annotations

from typing import Any

import click

from executive.cli.authoring_arguments import MergeArguments
from executive.cli.console import Answer
from executive.maps.merging import merge
from executive.runs.files import environments, refuse
from planlang.diagnostics import Diagnostic
from planlang.outputs import check_outputs, write_text


def command(arguments: MergeArguments) -> Answer:
    """Merge maps; raises BadInput."""
    if len(arguments.maps) < 2:
        raise click.BadParameter("name at least two maps")
    problems: list[Diagnostic] = []
    paths = environments(arguments.maps, problems)
    inputs = {f"the map {path}": path for path in paths}
    problems += check_outputs({"--output": arguments.output}, inputs, force=arguments.force)
    refuse(problems)
    merged = merge(paths, arguments.folders, ignore_unread=arguments.ignore_unread)
    data: dict[str, Any] = {"things": merged.things, "placed": merged.placed}
    data["conflicts"] = [one.message for one in merged.diagnostics if one.code == "M022"]
    if arguments.output is None:
        return Answer(diagnostics=merged.diagnostics, text=merged.text, data=data | {"source": merged.text})
    write_text(arguments.output, merged.text)
    count = f"{len(data['conflicts'])} conflict{'' if len(data['conflicts']) == 1 else 's'}"
    text = f"{arguments.output}: {merged.things} things, {merged.placed} with a place, {count}"
    return Answer(diagnostics=merged.diagnostics, text=text, data=data | {"output": str(arguments.output)})
