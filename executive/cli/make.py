"""``planlang robot make``: a robot file, derived from a URDF and an SRDF."""

from __future__ import annotations

import os
from pathlib import Path

from executive.cli.authoring_arguments import MakeArguments
from executive.cli.capabilities import capability_data, capability_lines, holds_data
from executive.cli.console import Answer, progress_of, text_answer, waiting
from executive.locations.capabilities import capabilities_of
from executive.options.declaring import check_written
from executive.robots import CARRYING, bind_draft
from executive.robots.arms import with_carrying
from executive.robots.draft import draft_of
from executive.runs.files import check_files, refuse
from planlang.diagnostics import Diagnostic
from planlang.shell import quoted
from planlang.words import Option


def command(arguments: MakeArguments) -> Answer:
    """Make a robot file; raises BadInput."""
    urdf, srdf, output = arguments.urdf, arguments.srdf, arguments.output
    problems: list[Diagnostic] = []
    check_files(problems, urdf=urdf, srdf=srdf)
    problems += check_written(arguments, MakeArguments, {"the URDF": urdf, Option("srdf"): srdf})
    refuse(problems)
    folder = Path() if output is None else output.parent
    with waiting(arguments, lambda: f"reading {urdf.name}"):
        draft = draft_of(urdf, srdf, named=os.path.relpath(urdf, folder))
        robot = bind_draft(draft, folder / f"{urdf.stem}.toml")
    carrying = with_carrying(robot, report=progress_of(arguments))
    if robot.arms and CARRYING not in robot.postures:
        table = draft.table("postures", CARRYING)
        for joint, value in carrying.postures[CARRYING].items():
            table.add(joint, value, "" if table.entries else "hands level, close to the body, without contact")
    can = capabilities_of(carrying, report=progress_of(arguments))
    arms = [{"name": arm.name, **holds_data(can, arm)} for arm in robot.arms]
    use = f"planlang robot inspect {quoted(output)} shows what the robot can do, and what it lacks"
    told, diagnostics = [robot.name, *capability_lines(can), use], (*draft.diagnostics(), *robot.diagnostics)
    return text_answer(draft.text(), output, "\n".join(told), diagnostics, arms=arms, **capability_data(can))
