"""Explains a failed run by the smallest change that was found after which a rerun reaches the goal."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from executive.maps.scene import scene_of
from executive.options.declaring import as_json, check_written, made, stated, values_of
from executive.options.engines import in_seconds
from executive.options.running import RunSettings, SituationSettings, WhyOptions
from executive.robots import Robot
from executive.runs.explanation import Explanation
from executive.runs.files import refuse
from executive.runs.options import RunOptions
from executive.runs.parameters import things_of
from executive.runs.plan_body import ActionBefore, Subject, steps_not_reached
from executive.runs.plan_run import Run, run_plan_file
from executive.runs.prepared import RunFiles, prepared
from executive.runs.remedies import call_of
from executive.runs.traces import call_to_resume, header_to_repeat, recorded_run
from executive.sweeps import Row, workers
from executive.sweeps.jobs import READS_RUN, RUNS
from executive.sweeps.records import Task
from executive.why.both_runs import write_both
from executive.why.candidates import Candidate, Situation, kinds_of
from executive.why.evidence import Evidence
from executive.why.reruns import Reruns
from executive.why.searching import search
from executive.why.wording import clause_of
from planlang.advice import ATTEMPTS, BEFORE, ROBOT
from planlang.diagnostics import BadInput, Span, error
from planlang.files import Bundled
from planlang.language.source import PlanSource
from planlang.outputs import MARK, write_text
from planlang.runs import RecordedRun
from planlang.words import COMMAND_LINE, Blank, Call, Text, calling, said

Told = Callable[[str], object]
UNREPEATABLE = (
    "the goal is reached without any change when the run is repeated: its process modules depend on more than its "
    "inputs and its seed, so that no change can be made out"
)
"""What is said of a run that does not fail again."""


def why(options: WhyOptions, *, told: Told = lambda line: None) -> Explanation:
    """Find the smallest change after which the run of a trace reaches its goal, and write it to a file.

    ``told`` gets a line for each rerun. Raises BadInput for a trace that is damaged, or of another version, plan, map
    or robot than those that are there.
    """
    applied = options.apply or options.trace.with_suffix(".apply.json")
    refuse(check_written(replace(options, apply=applied), WhyOptions, {"the trace": options.trace}))
    recorded = recorded_run(options.trace)
    run_options = RunOptions(**values_of(options, SituationSettings), recipe=options.file)
    return explained(
        recorded,
        run_options,
        applied=applied,
        budget=options.budget,
        report=options.report,
        told=told,
        on=options.on,
        processes=options.processes,
        cluster_wait=options.cluster_wait,
        resume=Text("ask again with ", _asked(options)),
    )


def _asked(options: WhyOptions) -> Call:
    """The call that asks once more."""
    values = {**dict(stated(options, WhyOptions)), "apply": options.apply, "report": options.report}  # files are shown
    values["cluster_wait"] = in_seconds(options.cluster_wait)
    return calling("why", options.trace, *filter(None, (options.file,)), **values)


def explained(
    recorded: RecordedRun,
    options: RunOptions,
    *,
    applied: Path | None = None,
    budget: int | None = None,
    report: Path | None = None,
    told: Told = lambda line: None,
    **engine: Any,
) -> Explanation:
    """Explain a recorded run, as :func:`why` does; the changes are written to ``applied``, both runs to ``report``.

    The ``engine`` of the reruns are entries of :class:`executive.sweeps.records.Task`: ``on``, ``processes``,
    ``cluster_wait``, ``resume``.
    """
    header_to_repeat(recorded)  # raises for a trace of an older schema
    unmet = _unmet(recorded, options) if recorded.outcome == "succeeded" else None
    if recorded.outcome == "succeeded" and unmet is None:
        return Explanation("", "this run reached its goal: nothing has to change")
    if recorded.outcome not in ("failed", "succeeded"):
        advice = Text(call_to_resume(recorded, options), " ends it")
        raise BadInput([error("X021", "this run has not ended", Span(recorded.name), advice)])
    evidence = Evidence.of([line.record for line in recorded.lines])
    files = prepared(replace(options.unseen(), repeated=recorded))
    with Run(files) as run:
        subject, robot = run.beginning()
        files = replace(files, options=replace(files.options, task=run.task))
        first = ActionBefore.read(files.options.before or (), subject.map, run.plan.name)
        late = steps_not_reached(first, [line.record for line in recorded.lines])
        found = (*(one for one in run.found if one.code == "X025"), *late)
    situation = _situation(subject, robot, files, evidence)
    files = _with_short_start(files)
    failure = unmet or evidence.sentence
    with workers(Task(job=RUNS, reads=READS_RUN, say=told, **engine)) as used:
        if files.options.modules and _is_reached_unchanged(Reruns(_options(files), used, base=files.changes, budget=1)):
            return Explanation(failure, UNREPEATABLE, diagnostics=found)
        reruns = Reruns(
            _options(files),
            used,
            base=files.changes,
            budget=budget or WhyOptions.budget,
            told=lambda one, row, number: told(_line(one, row, number, situation)),
        )
        result = search(situation, reruns)
    tried = kinds_of([one.candidate for one in result.tried])
    if result.found is None:
        nothing = "no change was found after which the goal is reached"
        return Explanation(failure, nothing, tried=tried, left=kinds_of(result.left), diagnostics=found)
    changes = (*files.changes, *result.found.changes)
    if applied is not None:
        lines = ",\n  ".join(json.dumps(one.as_json(), ensure_ascii=False) for one in changes)
        write_text(applied, f'{{"writer": "{MARK}", "changes": [\n  {lines}\n]}}\n')
    sentence = f"the goal is reached if {clause_of(result.found.changes, situation.scene)}"
    command = Text(_command(files, result.found, applied))
    if report is not None:
        mended = made(RunSettings, reruns.options_of(result.found))
        told_of_both = f"{failure}; {sentence}", said(command, COMMAND_LINE)
        write_both(report, recorded, files.options.unseen(), RunOptions.of(mended, changes=changes), told_of_both)
    return Explanation(
        failure,
        sentence,
        changes,
        result.found.cost,
        command,
        applied,
        tried,
        diagnostics=found,
    )


def _unmet(recorded: RecordedRun, options: RunOptions) -> str | None:
    """Say what is so in the world after a run that ended as done; None if its goals hold, or it has none."""
    if not (recorded.header.get("goals") or options.goal):
        return None
    result = run_plan_file(replace(options.unseen(), repeated=recorded))
    return None if result.reached else str(result.message)


def _is_reached_unchanged(reruns: Reruns) -> bool:
    """Check whether the run reaches its goal as it is: modules of users may depend on time, chance or other files."""
    return reruns.of([Candidate((), "unchanged", 0.0)]) is not None


def _situation(subject: Subject, robot: Robot, files: RunFiles, evidence: Evidence) -> Situation:
    scene = scene_of(subject.map)
    known = {thing.iri: thing.name for thing in subject.map.objects}
    needed = frozenset(
        known[what.iri] for value in subject.bound.values() for what in things_of(value) if what.iri in known
    )
    options = files.options
    in_use = frozenset(name for name in ("arm", "grasp", "schedule", "attempts") if getattr(options, name) is not None)
    if options.no_recoveries:
        in_use |= {ATTEMPTS}  # of which there are none
    arms = tuple(arm.name for arm in robot.arms if arm.gripper is not None)
    return Situation(scene, needed, robot.name, arms, tuple(Bundled.ROBOT.names()), evidence, in_use)


def _with_short_start(files: RunFiles) -> RunFiles:
    """State the start as a call on the command line does, so that its digits are those of the reruns."""
    start = files.options.start
    if start is None:
        return files
    x, y, yaw = (float(f"{number:g}") for number in start)
    return replace(files, options=replace(files.options, start=(x, y, yaw)))


def _options(files: RunFiles) -> dict[str, Any]:
    """The options of the reruns, as JSON."""
    file, recipe = files.file, files.options.recipe
    plan = file.text if isinstance(file, PlanSource) and file.is_in_memory else recipe
    plan = plan if isinstance(plan, str | os.PathLike) else file.path
    maps = [os.fspath(one) for one in (files.environment, *files.additions) if one is not None]
    options = replace(files.options.unseen(), apply=None, resume=None, seed=files.seed)
    given = as_json(options, RunSettings)
    files_of_world = () if files.world is None else files.world.files
    there = {"world": list(map(os.fspath, files_of_world))} if files_of_world else {}
    return {**given, "recipe": os.fspath(plan), "robot": os.fspath(files.robot or ""), "environment": maps, **there}


def _command(files: RunFiles, found: Candidate, applied: Path | None) -> Call:
    """The call that repeats the run: with an option if that is all, else with the file of the changes."""
    options: dict[str, Any] = {one.what: one.value for one in found.changes if one.thing is None}
    if BEFORE in options:
        acts = [str(one.value) for one in found.changes if one.thing is None and one.what == BEFORE]
        options[BEFORE] = [*(files.options.before or ()), *acts]
    away = {"start": None, "urdf": None} if ROBOT in options else {}
    if files.changes or any(one.thing is not None for one in found.changes):
        return call_of(files, apply=applied or Blank("FILE"), **away)
    return call_of(files, **away, **options)


def _line(one: Candidate, row: Row, number: int, situation: Situation) -> str:
    """Say how a rerun ended."""
    ending = "done" if row["outcome"] == "done" else str(row.get("message", row["outcome"])).partition("\n")[0][:100]
    return f"{number}: {clause_of(one.changes, situation.scene)}: {ending}"
