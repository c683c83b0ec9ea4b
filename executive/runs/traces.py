"""Traces of runs: shown to people, and read back to resume or replay a run."""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from executive.options.declaring import stated
from executive.options.headers import in_header, settings_from_header
from executive.options.running import SituationSettings
from executive.runs.parameters import Bound
from planlang.advice import Change
from planlang.designators import Location, Object, local_name
from planlang.diagnostics import BadInput, Diagnostic, Span, error, note, warning
from planlang.files import Bundled
from planlang.kernel.tree import Node
from planlang.language.performing import is_inner
from planlang.outputs import named
from planlang.records import dataclass
from planlang.runs import DamagedTrace, Different, Past, RecordedRun, Repetition, differences
from planlang.runs.codec import SCHEMA, load
from planlang.runs.recorded_run import SPANS, OlderTrace
from planlang.runs.repeating import OUTSIDE
from planlang.runs.run_tree import DECISIONS, Changes, rounded, with_names
from planlang.runs.trace import Listener
from planlang.words import Blank, Call, Option, Text, calling


def lines_of(say: Callable[[int, str], None], *, inner: bool = False) -> Listener:
    """Make a listener that calls ``say`` with the world step and a line, for records of interest to people.

    With ``inner`` also for actions that process modules perform inside others. A failure that passes several actions
    and recoveries at once has a line only once, as has what is believed of a thing until that changes. Things that the
    plan describes by their class have names as soon as the trace tells which ones are meant.
    """
    told: tuple[int, set[str]] = (-1, set())
    believed: dict[object, str] = {}
    changes, meant = Changes(), dict[str, dict[str, str]]()

    def listen(record: Mapping[str, Any], node: Node | None) -> None:
        nonlocal told
        if record["event"] == "means":
            meant.setdefault(record["within"], {})[record["what"]] = record["name"]
            return
        is_span = record["event"] in SPANS and record["kind"] == "perform"
        if is_span and not inner and node is not None and is_inner(node):
            return
        line = line_of(record, changes)
        if line is None:
            return
        if meant and node is not None:
            around = (names for path, names in meant.items() if f"{node.path}/".startswith(f"{path}/" if path else ""))
            line = with_names(line, {what: name for names in around for what, name in names.items()})
        step = record["step"]
        told = told if told[0] == step else (step, set())
        is_passed_on = record["event"] == "ended" or record.get("decision") in ("propagate", "failed")
        is_known = record["event"] == "belief" and believed.get(record["name"]) == line
        if is_known or (is_passed_on and line in told[1]):
            return
        told[1].add(line)
        if record["event"] == "belief":
            believed[record["name"]] = line
        say(step, line)

    return listen


_TRUE = re.compile(r"\b([a-z_]+)=True\b")
"""A property of an action that is simply true, which is told by its name alone."""


def action_line(action: str) -> str:
    """Write an action for people: with numbers to six decimals, and what is simply true by its name alone."""
    return _TRUE.sub(lambda one: one[1].replace("_", " "), rounded(action))


def line_of(record: Mapping[str, Any], changes: Changes | None = None) -> str | None:
    """Line about a record, for people; None if it does not interest them. ``changes`` knows the earlier ones."""
    match record:
        case {"event": "started", "kind": "perform", "action": action}:
            return action_line(str(action))
        case {"event": "ended", "kind": "perform", "failure": {"type": kind, "message": message}}:
            return f"failed: {kind}: {message}"
        case {"event": "started", "kind": "plan", "name": name}:
            return str(name)
        case {"event": "recovery", "decision": decision} if decision in DECISIONS:
            return DECISIONS[decision]
        case {"event": "answer", "asked": asked, "lost": lost} if str(asked).startswith(OUTSIDE):
            return f"cannot be resumed from here on: a result from outside cannot be stored as JSON: {lost}"
        case {"event": "resumed"}:
            return "resumed"
        case {"event": "stays open", "name": name, "because": reason}:
            return f"{name} stays open: {reason}"
        case {"event": "stays away", "because": reason}:
            return f"the robot does not get back to where the plan had brought it: {reason}"
        case {"event": "fault", "fault": fault}:
            return f"  fault: {fault}"
        case {"event": "belief", "change": _, "name": _}:
            text = (changes or Changes()).text(record)
            return None if text is None else f"  belief: {text}"
    return None


AGREE = {
    "plan": "the plan",
    "iri": "the iri",
    "plan_sha256": "the plan (its sha256)",
    "parameters": "the parameters",
    "seed": "the seed",
    "schedule": "the schedule",
    "rate": "the number of steps per second",
    "start": "the robot's start",
    "robot": "the robot",
    "robot_sha256": "the robot's self-model (its sha256)",
    "urdf_sha256": "the robot's geometry (its sha256)",
    "map": "the map",
    "map_sha256": "the map (the sha256 of its files)",
}
"""Keys that must agree in a trace and the run that resumes it, beside settings -> their names in messages."""


CONTENT = "_sha256"
"""Ending of the keys for the content of files."""
FILES = {
    "map": ("the map", "environment"),
    "map_sha256": ("the map", "environment"),
    "robot": ("the robot", "robot"),
    "robot_sha256": ("the robot", "robot"),
    "urdf_sha256": ("the robot's geometry", "urdf"),
    "world": ("the world", "world"),
}
"""Keys for files -> what is in them, and the option that names them."""


KNOWLEDGE = "http://planlang.org/kb"
"""Where the IRIs of bundled recipes begin."""


@dataclass(frozen=True, slots=True)
class TraceHeader:
    """Header of a trace. Recipe, robot, environment and world are set only if they are bundled."""

    recipe: str | None = None
    name: str | None = None
    task: str | None = None
    robot: str | None = None
    environment: str | None = None
    start: tuple[float, float, float] | None = None
    seed: int = 0
    schedule: int | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)
    """Settings for the resumed run, by name."""
    changes: tuple[Change, ...] = ()
    """What was changed in the map, as a failed run had advised."""
    world: str | None = None

    @staticmethod
    def of(recorded: RecordedRun) -> TraceHeader:
        """Read a header. Raises BadInput for a damaged one."""
        header = recorded.header
        match header:
            case {"plan": str(plan), "seed": int(seed), "schedule": (int() | None) as schedule, "start": [x, y, yaw]}:
                start = (_number(x), _number(y), _number(yaw))
            case _:
                start = (math.nan, 0.0, 0.0)
        if not all(map(math.isfinite, start)) or seed < 0:
            raise BadInput([error("X020", "the header is damaged: plan, seed or start", Span(recorded.name))])
        try:
            changes = tuple(map(Change.of, header.get("applied") or ()))
        except (ValueError, TypeError) as problem:
            message = f"the header is damaged: the changes of the map: {problem}"
            raise BadInput([error("X020", message, Span(recorded.name))]) from None
        iri, robot, environment = (_text(header.get(key)) for key in ("iri", "robot", "map"))
        world = header.get("world")
        there = _bundled_map(world.get("map")) if isinstance(world, dict) and "changes" not in world else None
        return TraceHeader(
            bundled_recipe(header),
            plan,
            iri or plan,
            robot if robot in Bundled.ROBOT.names() else None,
            _bundled_map(environment),
            start,
            seed,
            schedule,
            settings_from_header(header),
            changes,
            there,
        )

    def plan(self, trace: str) -> str:
        """The bundled recipe. Raises BadInput for any other plan, whose file the user has to name."""
        if self.recipe is None:
            file, path = Blank("FILE"), Path(trace)
            advice = Text(calling("run", file, resume=path), ", or ", calling("replay", path, file))
            message = f"the plan {self.name} of the trace is not bundled: name its file"
            raise BadInput([error("X020", message, Span(trace), advice)])
        return self.recipe


def _bundled_map(iri: object) -> str | None:
    """Name of the bundled environment with an IRI; None if there is none."""
    stem = local_name(_text(iri) or "").partition(".")[0]
    return stem if stem in Bundled.ENVIRONMENT.names() else None


def bundled_recipe(header: Mapping[str, Any]) -> str | None:
    """Name of the bundled recipe in whose file the task of a trace is; None if there is none.

    The plan has the name of the task, which may differ from that of the file.
    """
    base, _, file = (_text(header.get("iri")) or "").partition("#")[0].rpartition("/")
    names = Bundled.RECIPE.names()
    if base == KNOWLEDGE and file.removesuffix(".owl") in names:
        return file.removesuffix(".owl")
    plan = _text(header.get("plan"))
    return plan if plan in names else None


def recorded_run(path: Path) -> RecordedRun:
    """Read a trace. Raises BadInput, with the line, for a damaged file or one that is no trace."""
    try:
        return RecordedRun.read(path)
    except DamagedTrace as damage:
        raise BadInput([damaged(named(path), damage)]) from None
    except OSError as problem:  # also a pipe: a trace is read more than once
        raise BadInput([error("C001", f"{named(path)} cannot be read: {problem.strerror}")]) from None


def read_trace(path: Path) -> tuple[RecordedRun, TraceHeader]:
    """Read the trace of a run and its header, to repeat the run. Raises BadInput as both functions for these do."""
    recorded = recorded_run(path)
    return recorded, header_to_repeat(recorded)


def header_to_repeat(recorded: RecordedRun) -> TraceHeader:
    """The header of a run that can be repeated. Raises BadInput for any other.

    Also for a trace of an older schema, with the versions of planlang that wrote and that read it.
    """
    try:
        recorded.check_repeatable()
    except OlderTrace as older:
        raise BadInput([_written_before(recorded, older)]) from None
    if recorded.header.get("resumable") is not True or "plan_sha256" not in recorded.header:
        advice = Text(calling("run", Blank("PLAN"), trace="run.jsonl"), " writes one")
        message = "this is not the trace of a run in a world: its header names no plan"
        raise BadInput([error("X020", message, Span(recorded.name), advice)])
    return TraceHeader.of(recorded)


def recorded_parameters(recorded: RecordedRun, names: Collection[str]) -> dict[str, Bound]:
    """Parameters of the recorded run. Raises BadInput if they are not this plan's."""
    try:
        parameters = load(recorded.header["parameters"])
        if parameters.keys() != set(names) or not all(
            isinstance(what, (Object, Location, float)) for what in parameters.values()
        ):
            raise ValueError(f"the plan has the parameters {', '.join(names) or 'none'}")
        return dict(parameters)
    except (KeyError, ValueError, TypeError, AttributeError, RecursionError) as problem:
        message = f"the parameters of the plan cannot be read: {problem}"
        raise BadInput([error("X020", message, Span(recorded.name))]) from None


def earlier_of(
    recorded: RecordedRun | None, *, world_as_left: bool, looks_on: bool = False
) -> tuple[Past | Repetition | None, list[Diagnostic]]:
    """Prepare a run to resume, with notes: a simulated run is repeated, else its completed steps are skipped.

    A run that is repeated for observation may have ended. Raises BadInput if there is nothing to resume, or the run
    cannot be resumed in this way.
    """
    if recorded is None:
        return None, []
    span, notes = Span(recorded.name), list[Diagnostic]()
    if recorded.outcome == "succeeded" and not looks_on:
        raise BadInput([error("X021", "this run has ended: there is nothing to resume", span)])
    if recorded.torn:
        message = "the last line is incomplete; it is ignored"
        notes.append(note("X026", message, Span(recorded.name, len(recorded.lines) + 1)))
    try:
        if not world_as_left:
            repetition = _repeatable(Repetition(recorded), span, looks_on=looks_on)
            for line in repetition.in_flight:
                message = (
                    f"{line.record.get('function', line.path)} was interrupted outside of the run, and is repeated"
                )
                notes.append(note("X030", message, Span(recorded.name, line.number)))
            return repetition, notes
        past = Past(recorded)
    except DamagedTrace as damage:
        raise BadInput([damaged(recorded.name, damage)]) from None
    if past.lost is not None:
        message = f"the run resumes before a completed step, {past.lost}"
        notes.append(warning("X024", message, span))
    return past, notes


def _repeatable(repetition: Repetition, span: Span, *, looks_on: bool) -> Repetition:
    """Check that a run can be repeated. Raises BadInput if it cannot, or has failed."""
    recorded = repetition.recorded
    if recorded.outcome == "failed" and not looks_on:
        message = "this run has failed, and would fail again: there is nothing to resume"
        advice = Text(calling("run", Blank("PLAN"), seed=1), " runs it in another world")
        raise BadInput([error("X021", message, span, advice)])
    if (line := repetition.skipped) is not None:
        message = "the run was continued here without its earlier steps, and cannot be repeated from its start"
        advice = Text("add ", Option("world_as_left", True), " if world and robot are still as the trace left them")
        raise BadInput([error("X023", message, Span(recorded.name, line.number), advice)])
    if (line := repetition.lost) is not None:
        message = f"a result from outside was not stored, and its call must not be repeated: {line.record['lost']}"
        help = "let calls in threads and modules that work once return JSON values (docs/guides/resuming.md)"
        raise BadInput([error("X024", message, Span(recorded.name, line.number), help)])
    return repetition


def different(recorded: RecordedRun, difference: Different, header: Mapping[str, Any]) -> Diagnostic:
    """Error for a run that differs from its recording, with the versions of both if they differ."""
    other = _other_versions(recorded, header)
    advice = f"with other versions a run may differ: {other}" if other else None
    return error("X027", str(difference), Span(recorded.name, difference.line or 1), advice)


def check_same_run(recorded: RecordedRun, header: Mapping[str, Any]) -> list[Diagnostic]:
    """Raise BadInput with the differences if a trace is of another run; return warnings about versions."""
    settings = {one.key: Option(name) for name, one in in_header().items()}
    now = {key: header[key] for key in AGREE if key in header} | {key: header.get(key) for key in settings}
    span, problems = Span(recorded.name), []
    differ = differences(recorded.header, now)
    for key, (before, after) in differ.items():
        name = AGREE.get(key) or settings[key]
        message = Text(name, f" differs: {_short(before)} in the trace, {_short(after)} now")
        problems.append(error("X022", message, span, _named_again(key, differ, recorded)))
    if problems:
        raise BadInput(problems)
    other = _other_versions(recorded, header)
    return [warning("X025", f"the run may differ with other versions: {other}", span)] if other else []


def _named_again(key: str, differ: Collection[str], recorded: RecordedRun) -> Text | None:
    """Advice to name what the run had instead of what differs now; None for what has no file of its own."""
    if key not in FILES or (key.endswith(CONTENT) and key.removesuffix(CONTENT) in differ):  # said of the name already
        return None
    what, option = FILES[key]
    if key.endswith(CONTENT):
        return Text(f"name {what} with the content that it had in the run: ", Option(option, Blank("FILE")))
    return Text(f"name {what} of the run: ", Option(option, getattr(TraceHeader.of(recorded), option) or Blank("FILE")))


def call_to_resume(recorded: RecordedRun, options: object) -> Call:
    """The call that resumes the run of a trace, with the files that ``options`` name; others of its own stay blank."""
    header, own = TraceHeader.of(recorded), dict(stated(options, SituationSettings))
    digests, world = recorded.header.get("map_sha256"), recorded.header.get("world")
    found = {
        "robot": (Bundled.ROBOT, header.robot, [recorded.header.get("robot_sha256")]),
        "environment": (Bundled.ENVIRONMENT, header.environment, digests if isinstance(digests, list) else []),
    }
    if isinstance(world, dict):
        found["world"] = Bundled.ENVIRONMENT, header.world, list(world.get("sha256", ()))
    for option, (kind, name, there) in found.items():
        file = None if name is None else kind.find(name)
        if file is None or sha256(file) not in there:
            own.setdefault(option, Blank("FILE"))
    if recorded.header.get("modules"):
        own.setdefault("modules", Blank("FILE"))
    recipe = getattr(options, "recipe", None)
    if recipe is None and header.recipe is None:
        recipe = Blank("FILE")
    return calling("run", *([] if recipe is None else [recipe]), resume=Path(recorded.name), **own)


def _other_versions(recorded: RecordedRun, header: Mapping[str, Any]) -> str:
    versions = recorded.header.get("versions")
    before = versions if isinstance(versions, dict) else {}
    other = differences(before, dict(header["versions"]))
    return ", ".join(f"{package} {one} is now {two}" for package, (one, two) in other.items())


def sha256(path: Path) -> str:
    """SHA-256 of a file, in hexadecimal."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def damaged(name: str, damage: DamagedTrace) -> Diagnostic:
    """Error for a file that is not a trace, or damaged."""
    return error("X020", f"not a trace, or damaged: {damage}", Span(name, damage.line))


def _written_before(recorded: RecordedRun, older: OlderTrace) -> Diagnostic:
    """Error for a trace that an older planlang wrote, in which the run cannot be resumed or replayed."""
    stated, now = recorded.header.get("versions"), versions()["planlang"]
    before = str(stated["planlang"]) if isinstance(stated, dict) and "planlang" in stated else "an older version"
    message = (
        f"planlang {before} wrote this trace with schema {older.schema}; planlang {now} repeats only schema {SCHEMA}"
    )
    advice = (
        "it can be shown, reported and exported; to repeat it, use the planlang that wrote it, or run the plan again"
    )
    return error("X033", message, Span(recorded.name, 1), advice)


def _short(value: object) -> str:
    text = str(value)
    return text if len(text) <= 80 else f"{text[:40]}...{text[-20:]}"


def _text(value: Any) -> str | None:
    return value if isinstance(value, str) else None


def _number(value: Any) -> float:
    return float(value) if type(value) in (int, float) else math.nan


def versions() -> dict[str, str]:
    """Return the versions of planlang and of the packages that decide on numbers, for the header of a trace."""
    found = {}
    for package in ("planlang", "pybullet", "casadi", "ruckig", "numpy"):
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "unknown"
    return found
