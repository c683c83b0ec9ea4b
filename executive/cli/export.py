"""``planlang export``: a run as a NEEM, a narrative with poses."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import Any

import click

from executive.cli.arguments import ExportArguments
from executive.cli.console import Answer
from executive.runs.files import refuse
from executive.runs.traces import damaged
from planlang.diagnostics import BadInput, Diagnostic, Span, warning
from planlang.experience import Experience, experience_of, narrative
from planlang.experience.poses import pose_lines, read_log, transforms_in
from planlang.files import read_file
from planlang.outputs import Named, check_outputs, make_folder, write_text
from planlang.runs.recorded_run import DamagedTrace, read_records
from planlang.words import Option

LARGEST = 200_000_000
"""Maximum size of a trace [bytes]."""
POSES = "poses.jsonl"
NAMESPACE = "http://planlang.org/experience/"


def command(arguments: ExportArguments) -> Answer:
    """Export a trace; raises BadInput."""
    began, folder, trace = _began(arguments.began), arguments.output, arguments.trace
    records, digest, diagnostics = _read(trace)
    try:
        experience = experience_of(records)
    except DamagedTrace as damage:
        raise BadInput([damaged(str(trace), damage)]) from None
    poses = list(transforms_in(records))
    if arguments.poses is not None:
        poses = sorted((*poses, *read_log(arguments.poses, records[0])), key=lambda one: one.step)
    outputs = {"the narrative": folder / "narrative.ttl", "the poses": folder / POSES}
    inputs: dict[Named, Path | None] = {"the trace": trace, Option("poses"): arguments.poses}
    make_folder(folder)
    refuse(check_outputs(outputs, inputs, force=arguments.force))
    write_text(outputs["the narrative"], narrative(experience, NAMESPACE + digest[:16], began, records=[POSES]))
    write_text(outputs["the poses"], "".join(pose_lines(poses, experience.rate, began, trace_sha256=digest)))
    first, second = map(str, outputs.values())
    text = f"{first}: {', '.join(_summary(experience))}\n{second}: {len(poses)} poses"
    return Answer(
        diagnostics=diagnostics, text=text, data={"files": [first, second], "poses": len(poses), **_data(experience)}
    )


def _read(trace: Path) -> tuple[list[Any], str, tuple[Diagnostic, ...]]:
    """Read a trace: its records, its SHA-256, and a warning if its last line is incomplete. Raises BadInput."""
    digest = hashlib.sha256(read_file(trace, "C001", largest=LARGEST)).hexdigest()
    try:
        records, torn = read_records(trace)
    except DamagedTrace as damage:
        raise BadInput([damaged(str(trace), damage)]) from None
    span = Span(str(trace), len(records) + 1)
    return records, digest, (warning("X026", "the last line is incomplete and left out", span),) if torn else ()


def _began(text: str | None) -> datetime | None:
    if text is None:
        return None
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        raise click.BadParameter(
            f"{text!r} is not a time; write for example --began 2026-11-23T14:00:00+01:00"
        ) from None
    if moment.tzinfo is None or not 1971 <= moment.year <= 9000:
        raise click.BadParameter(f"{text!r} needs a time zone, Z or for example +01:00, and a year from 1971 to 9000")
    return moment


def _summary(run: Experience) -> Iterator[str]:
    resolved = [one for activity in run.activities for one in activity.resolutions]
    yield f"{len(run.activities)} actions"
    yield f"{len({one.designator for one in resolved})} designators resolved {len(resolved)} times"
    for name, failures in (("failed", _failures(run)), ("recovered", _recovered(run))):
        if failures:
            words = (f"{kind} {number} times" if number > 1 else kind for kind, number in failures.items())
            yield f"{name}: {', '.join(words)}"
    if not run.is_whole:
        yield "the trace ends before the plan"


def _failures(run: Experience) -> Counter[str]:
    return Counter(one.type for one in dict.fromkeys(one for node in run.activities for one in node.failures()))


def _recovered(run: Experience) -> Counter[str]:
    return Counter(one.type for one in dict.fromkeys(failure for _, failure in run.recovered()))


def _data(run: Experience) -> dict[str, Any]:
    return {
        "plan": run.plan,
        "actions": len(run.activities),
        "resolutions": sum(len(one.resolutions) for one in run.activities),
        "failed": dict(_failures(run)),
        "recovered": dict(_recovered(run)),
        "is_whole": run.is_whole,
    }
