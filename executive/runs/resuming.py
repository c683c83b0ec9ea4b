"""Traces that a run is resumed from: reading them, what has to agree, bringing world and belief back."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from executive.cli.headers import Told
from executive.runs.plan_files import bindable_parameters
from executive.runs.robot_executive import RobotExecutive
from planlang.designators import Object
from planlang.diagnostics import BadInput, Diagnostic, Span, error, note, warning
from planlang.language.plans import Plan
from planlang.runs import DamagedTrace, Past, RecordedRun, differences, restore
from planlang.runs.codec import load

AGREE = (
    "plan", "iri", "plan_sha256", "parameters", "seed", "schedule", "rate", "start", "robot", "robot_sha256",
    "urdf_sha256", "map", "map_sha256",
)  # fmt: skip
"""What the header of a trace and the run that resumes or replays it must have in common."""
CALLED = {
    "plan_sha256": "the plan (its sha256)",
    "robot_sha256": "the robot's self-model (its sha256)",
    "urdf_sha256": "the robot's geometry (its sha256)",
    "map_sha256": "the map (the sha256 of its files)",
    "rate": "the steps per second",
    "start": "the robot's start",
}


def read_trace(path: Path) -> tuple[RecordedRun, Told]:
    """The records in a file and what its header says; raises BadInput, with the line, if it is none or damaged."""
    try:
        recorded = RecordedRun.read(path)
    except OSError as problem:
        raise BadInput([error("C001", f"{path} cannot be read: {problem.strerror or problem}")]) from None
    except DamagedTrace as damage:
        raise BadInput([_damaged(path, damage)]) from None
    if recorded.header.get("resumable") is not True or "plan_sha256" not in recorded.header:
        advice = "planlang run PLAN --trace run.jsonl writes one"
        message = "this trace was not written by planlang run: its header does not say of which plan it is"
        raise BadInput([error("X020", message, Span(str(path)), advice)])
    return recorded, Told.of(recorded)


def told_parameters(recorded: RecordedRun, defaults: Mapping[str, Object]) -> dict[str, Object]:
    """The parameters of the plan as the trace tells them; raises BadInput when they are not this plan's."""
    try:
        found = load(recorded.header["parameters"])
        if found.keys() != defaults.keys() or not all(isinstance(what, Object) for what in found.values()):
            raise ValueError(f"the plan has the parameters {', '.join(defaults) or 'none'}")
        return dict(found)
    except (KeyError, ValueError, TypeError, AttributeError, RecursionError) as problem:
        message = f"the parameters of the plan cannot be read: {problem}"
        raise BadInput([error("X020", message, Span(recorded.name))]) from None


def parameters_of(recorded: RecordedRun, plan: Plan[Any, Any]) -> dict[str, Object]:
    """What the plan is called with, as the trace tells."""
    return told_parameters(recorded, bindable_parameters(plan))


def sha256(path: Path) -> str:
    """Digest of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def told(record: object) -> dict[str, str]:
    """What a record says, as text."""
    if not isinstance(record, Mapping):
        return {}
    return {str(key): value if isinstance(value, str) else str(value) for key, value in record.items()}


def past_of(recorded: RecordedRun) -> tuple[Past, list[Diagnostic]]:
    """What a resumed run takes over, and notes on what it does not; raises BadInput when nothing is left to do."""
    span = Span(recorded.name)
    if recorded.outcome == "succeeded":
        raise BadInput([error("X021", "this run has ended: there is nothing to resume", span)])
    try:
        past = Past(recorded)
    except DamagedTrace as damage:
        raise BadInput([_damaged(Path(recorded.name), damage)]) from None
    found: list[Diagnostic] = []
    if recorded.torn:
        found.append(note("X026", "the last line is torn; it is ignored", Span(recorded.name, len(recorded.lines) + 1)))
    if past.lost is not None:
        message = f"the run goes on before a step that had completed, {past.lost}"
        found.append(warning("X024", message, span))
    return past, found


def refuse_other(recorded: RecordedRun, header: Mapping[str, Any]) -> list[Diagnostic]:
    """Raise BadInput, telling each difference, when a trace is that of another run; warnings of other versions."""
    now = {key: header[key] for key in AGREE if key in header}
    span, problems = Span(recorded.name), []
    for key, (before, after) in differences(recorded.header, now).items():
        called = CALLED.get(key, f"the {key}")
        problems.append(error("X022", f"{called} differs: {_short(before)} in the trace, {_short(after)} now", span))
    if problems:
        raise BadInput(problems)
    versions = recorded.header.get("versions")
    before = versions if isinstance(versions, dict) else {}
    other = differences(before, dict(header["versions"]))
    told = ", ".join(f"{package} {one} is now {two}" for package, (one, two) in other.items())
    return [warning("X025", f"other versions may go on otherwise: {told}", span)] if other else []


def bring_back(executive: RobotExecutive, past: Past, *, world_as_left: bool) -> None:
    """Restore world and belief; raises BadInput when the trace or the world cannot, and the user does not vouch."""
    span = Span(past.recorded.name, past.last.line if past.last is not None else 1)
    executive.world_as_left = world_as_left
    try:
        if restore(executive, past) or world_as_left:
            return
    except ValueError as problem:
        raise BadInput([error("X020", f"the recorded state does not fit: {problem}", span)]) from None
    advice = "--world-as-left says that world and robot stand as the trace left them"
    raise BadInput([error("X023", "the trace does not tell the state of the world", span, advice)])


def _damaged(path: Path, damage: DamagedTrace) -> Diagnostic:
    return error("X020", f"not a trace, or damaged: {damage}", Span(str(path), damage.line))


def _short(value: object) -> str:
    text = str(value)
    return text if len(text) <= 80 else f"{text[:40]}...{text[-20:]}"
