"""Resuming and replaying runs of the command: any kill is survived, and what does not fit is refused."""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from examples import examples
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from executive.cli.app import app
from executive.modules.bundled import bundled_registry
from executive.runs.assembly import RobotExecutive
from planlang import SimulationHost, StepLimit, Trace, at_location, perform, plan, run
from planlang.designators import a_location, a_person, a_posture, action
from planlang.files import Bundled
from planlang.runs import Past, RecordedRun, restore
from sim.truth import held_by
from tests.executive.conftest import PLACE, THE_BOTTLE, WARD, MakeStage, Served, Stage
from tests.support.examples import some

PLAN = '''"""Take the bottle, then bring it, in steps of their own."""

from functools import partial

from planlang import Object, a_location, a_person, a_posture, action, an_object, at_location, perform, plan, seq, sleep

BOTTLE = an_object("DrinkingBottle", "http://planlang.org/kb/hospital_room.owl#bottle1")
PATIENT = a_person("Patient", "http://planlang.org/kb/hospital_room.owl#patient1")


async def grasp() -> None:
    await perform(action("Reaching", to_location=a_location(in_front_of=BOTTLE)))
    await perform(action("OpeningAGripper"))
    await perform(action("Reaching", to_location=a_location(in_center_of=BOTTLE)))


async def close() -> object:
    await perform(action("ClosingAGripper"))
    return {odd}


async def give() -> None:
    await perform(action("Reaching", to_location=a_location(in_reach_of=PATIENT)))
    await perform(action("HandingOverAnObject", object_acted_on=BOTTLE, recipient=PATIENT))


@plan
async def serve(*, bottle: Object = BOTTLE) -> None:
    await perform(action("Reaching", to_location=a_posture("carrying")), name="Tuck")
    await at_location(a_location(in_reach_of=BOTTLE), grasp)
    await seq(close, partial(sleep, 1.0))
    await perform(action("Reaching", to_location=a_location(in_front_of=BOTTLE)), name="Lift")
    await at_location(a_location(in_reach_of=PATIENT), give)
'''
OPTIONS = ("--robot", "amigo", "--environment", "hospital_room")


def answer(*arguments: object) -> dict[str, Any]:
    """Return what the command answers, as JSON."""
    result = CliRunner().invoke(app, [*map(str, arguments), "--json"])
    assert "Traceback" not in result.output, result.output
    found: dict[str, Any] = json.loads(result.stdout)
    assert found["exit_code"] == result.exit_code
    return found


def codes(found: dict[str, Any]) -> list[str]:
    """The codes of the diagnostics."""
    return [one["code"] for one in found["diagnostics"]]


def lines(path: Path) -> list[str]:
    """The records of a trace, without those that say where it was resumed."""
    return [line for line in path.read_text().splitlines() if '"event": "resumed"' not in line]


@pytest.fixture(scope="module")
def whole(served: Served) -> Path:
    """The trace of a bundled run that was not interrupted."""
    return served.trace


def killed_with_poses(logged: Path, to: Path, records: int) -> Path:
    """Return the trace that a run leaves that was killed after so many records, beside its log of poses."""
    part = killed(logged / "run.jsonl", to / "run.jsonl", records)
    last = json.loads(lines(part)[-1])["step"] + 7
    head, *poses = (logged / "poses.jsonl").read_text().splitlines(keepends=True)
    written = "".join([head, *(line for line in poses if json.loads(line)["step"] <= last)])
    (to / "poses.jsonl").write_text(written + '{"header": {"se')
    return part


def exported(trace: Path, to: Path) -> list[str]:
    """What ``export`` writes of a trace and the log of poses beside it, without the digest of the trace."""
    poses = trace.with_name("poses.jsonl")
    assert answer("export", trace, "--to", "neem", "-o", to, "--poses", poses)["exit_code"] == 0
    digest = hashlib.sha256(trace.read_bytes()).hexdigest()
    files = (to / "narrative.ttl", to / "poses.jsonl")
    return [file.read_text().replace(digest, "").replace(digest[:16], "") for file in files]


@pytest.mark.parametrize(
    "later", [pytest.param(one, marks=pytest.mark.long) for one in (-40, 0, 1, 20, 40, 61, 62, 63)]
)
def test_a_resumed_run_tells_tilts_poses_and_experience_of_all_of_it(
    later: int, served: Served, tmp_path: Path
) -> None:
    """It is killed so many records later than the bottle was grasped, which the first step has done."""
    folder, tilts = served.folder, served.result.tilts.degrees()
    part = killed_with_poses(folder, tmp_path, completions(served.trace)[0] + later)
    ended = answer("run", "--resume", part, "--poses", tmp_path / "poses.jsonl")
    assert codes(ended) == []
    assert not list(tmp_path.glob(".*")), "nothing is left over"
    assert (ended["final_state"], ended["largest_tilts"]) == (list(served.result.final_state), tilts)
    assert tilts, "something was carried"
    assert (tmp_path / "poses.jsonl").read_bytes() == (folder / "poses.jsonl").read_bytes()
    assert exported(part, tmp_path / "part") == exported(served.trace, tmp_path / "whole")


@pytest.mark.long
@pytest.mark.pr2
def test_a_run_of_the_pr2_is_resumed_byte_for_byte(tmp_path: Path) -> None:
    """In a process in which less inverse kinematics was solved before; some motions are computed in threads."""
    options = ("--robot", "pr2", "--environment", "soup_kitchen")
    assert answer("run", "stir_soup", *options, "--trace", tmp_path / "whole.jsonl")["exit_code"] == 0
    part = killed(tmp_path / "whole.jsonl", tmp_path / "run.jsonl", completions(tmp_path / "whole.jsonl")[0])
    command = [sys.executable, "-m", "executive", "run", "stir_soup", *options, "--resume", str(part)]
    subprocess.run(command, check=True, capture_output=True)
    assert lines(part) == lines(tmp_path / "whole.jsonl")


@pytest.fixture(scope="module")
def stepwise(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A plan of five steps and the trace of its run."""
    folder = tmp_path_factory.mktemp("stepwise")
    (folder / "serve.py").write_text(PLAN.format(odd=17))
    ended = answer("run", folder / "serve.py", *OPTIONS, "--trace", folder / "run.jsonl")
    assert ended["exit_code"] == 0, ended
    return folder / "serve.py", folder / "run.jsonl"


def completions(path: Path) -> list[int]:
    """The lines with which steps completed, counted from 1."""
    return [number for number, line in enumerate(lines(path), 1) if json.loads(line)["event"] == "completed"]


def killed(trace: Path, to: Path, records: int, *, torn: str = "") -> Path:
    """Return what a run leaves that was killed after so many records."""
    to.write_text("\n".join(lines(trace)[:records]) + "\n" + torn)
    return to


@pytest.mark.long
@pytest.mark.parametrize("every", [3, pytest.param(1, marks=pytest.mark.long)])
def test_a_run_killed_after_each_step_ends_as_if_it_had_not_been_killed(
    every: int, stepwise: tuple[Path, Path], tmp_path: Path
) -> None:
    """The first step, one in the middle and the last; ``make test-long`` takes each."""
    plan, trace = stepwise
    assert len(completions(trace)) == 7
    for number in completions(trace)[::every]:
        part = killed(trace, tmp_path / f"{number}.jsonl", number)
        ended = answer("run", plan, "--resume", part)
        assert (ended["exit_code"], ended["final_state"]) == (0, ["bottle1: held by patient1"]), ended
        assert lines(part) == lines(trace)
        assert answer("replay", part, plan)["equal"]


@pytest.mark.long
def test_a_bundled_run_needs_nothing_but_its_trace(whole: Path, tmp_path: Path) -> None:
    part = killed(whole, tmp_path / "run.jsonl", completions(whole)[0] + 7, torn='{"step": 99, "ev')
    before = part.read_bytes()
    ended = answer("run", "--resume", part)
    assert (ended["exit_code"], ended["final_state"]) == (0, ["bottle1: held by patient1"])
    assert codes(ended).count("X026") == 1
    assert lines(part) == lines(whole)
    assert (tmp_path / "run.jsonl.old").read_bytes() == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run.jsonl", "run.jsonl.old"]
    assert codes(answer("run", "--resume", part)) == ["X021"]


@pytest.mark.long
def test_no_older_trace_is_lost_when_a_run_is_resumed_twice(whole: Path, tmp_path: Path) -> None:
    first = killed(whole, tmp_path / "run.jsonl", completions(whole)[0] + 2).read_bytes()
    answer("run", "--resume", tmp_path / "run.jsonl")
    second = killed(tmp_path / "run.jsonl", tmp_path / "run.jsonl", completions(whole)[0] + 9).read_bytes()
    answer("run", "--resume", tmp_path / "run.jsonl")
    assert (tmp_path / "run.jsonl.old").read_bytes() == first
    assert (tmp_path / "run.jsonl.old2").read_bytes() == second
    assert lines(tmp_path / "run.jsonl") == lines(whole)


@pytest.mark.long
def test_a_trace_named_otherwise_leaves_the_one_that_is_resumed_alone(whole: Path, tmp_path: Path) -> None:
    part = killed(whole, tmp_path / "run.jsonl", completions(whole)[0])
    before = part.read_bytes()
    assert answer("run", "--resume", part, "--trace", tmp_path / "on.jsonl")["exit_code"] == 0
    assert part.read_bytes() == before
    assert lines(tmp_path / "on.jsonl") == lines(whole)


@pytest.mark.long
def test_a_run_killed_before_any_step_has_completed_begins_anew(whole: Path, tmp_path: Path) -> None:
    part = killed(whole, tmp_path / "run.jsonl", 9)
    assert answer("run", "--resume", part)["exit_code"] == 0
    assert lines(part) == lines(whole)


@pytest.mark.parametrize(
    ("options", "named"),
    some(
        [
            (("--seed", "4"), ("seed", "3", "4")),
            (("--schedule", "1"), ("schedule", "None", "1")),
            (("--start", "0.5,0,0"), ("start", "[0.0, 0.0, 0.0]", "[0.5, 0.0, 0.0]")),
        ],
        every=3,
    ),
)
def test_what_must_agree_is_told_when_it_differs(
    options: tuple[str, ...], named: tuple[str, ...], whole: Path, tmp_path: Path
) -> None:
    part = killed(whole, tmp_path / "run.jsonl", completions(whole)[0])
    ended = answer("run", "--resume", part, *options)
    assert ended["exit_code"] == 2
    (message,) = (one["message"] for one in ended["diagnostics"] if one["code"] == "X022")
    assert all(word in message for word in named), message
    assert part.read_bytes() == killed(whole, tmp_path / "same.jsonl", completions(whole)[0]).read_bytes()


@pytest.mark.long
def test_another_plan_is_refused_and_other_versions_are_warned_of(stepwise: tuple[Path, Path], tmp_path: Path) -> None:
    plan, trace = stepwise
    part = killed(trace, tmp_path / "run.jsonl", completions(trace)[0])
    changed = tmp_path / "serve.py"
    changed.write_text(plan.read_text().replace('name="Lift"', 'name="Raise"'))
    refused = answer("run", changed, "--resume", part)
    assert (refused["exit_code"], codes(refused)) == (2, ["X022"])
    first, rest = part.read_text().split("\n", 1)
    part.write_text(first.replace('"pybullet": "', '"pybullet": "0.') + "\n" + rest)
    ended = answer("run", plan, "--resume", part)
    assert (ended["exit_code"], codes(ended)) == (0, ["X025"])


def test_a_plan_of_ones_own_has_to_be_named(stepwise: tuple[Path, Path], tmp_path: Path) -> None:
    part = killed(stepwise[1], tmp_path / "run.jsonl", completions(stepwise[1])[0])
    for command in (("run", "--resume", part), ("replay", part)):
        refused = answer(*command)
        assert (refused["exit_code"], codes(refused)) == (2, ["X020"])
        assert "name its file" in refused["diagnostics"][0]["message"]
        assert "planlang run FILE --resume" in refused["diagnostics"][0]["help"]


@pytest.mark.long
def test_a_result_that_does_not_survive_stops_no_resumption_unless_it_came_from_outside(tmp_path: Path) -> None:
    plan = tmp_path / "serve.py"
    plan.write_text(PLAN.format(odd="object()"))
    told = CliRunner().invoke(app, ["run", str(plan), *OPTIONS, "--trace", str(tmp_path / "run.jsonl")])
    assert told.exit_code == 0, told.output
    part = killed(tmp_path / "run.jsonl", tmp_path / "part.jsonl", completions(tmp_path / "run.jsonl")[-1])
    ended = answer("run", plan, "--resume", part)
    assert (ended["exit_code"], codes(ended)) == (0, [])
    assert lines(part) == lines(tmp_path / "run.jsonl")
    plan.write_text(
        plan.read_text()
        .replace("return object()", "return await in_thread(object)")
        .replace("from planlang import Object", "from planlang import in_thread, Object")
    )
    assert answer("run", plan, *OPTIONS, "--trace", tmp_path / "run.jsonl")["exit_code"] == 0
    part = killed(tmp_path / "run.jsonl", tmp_path / "part.jsonl", completions(tmp_path / "run.jsonl")[-1])
    refused = answer("run", plan, "--resume", part)
    assert (refused["exit_code"], codes(refused)) == (2, ["X024"])
    assert "builtins.object" in refused["diagnostics"][0]["message"]


@pytest.mark.parametrize(
    ("old", "new", "event"),
    some([('"position": [-2.86', '"position": [-2.85', "belief"), ('"seed": 3', '"seed": 4', None)], every=2),
    ids=["one number", "the seed"],
)
def test_a_trace_that_was_altered_is_refused_at_the_first_record_that_differs(
    old: str, new: str, event: str | None, whole: Path, tmp_path: Path
) -> None:
    part = killed(whole, tmp_path / "run.jsonl", completions(whole)[0])
    part.write_text(part.read_text().replace(old, new, 1))
    before = part.read_bytes()
    refused = answer("run", "--resume", part, "--poses", tmp_path / "poses.jsonl", "--picture", tmp_path / "end.png")
    assert (refused["exit_code"], codes(refused)) == (2, ["X027"])
    assert "recorded" in refused["diagnostics"][0]["message"]
    if event is not None:
        line = refused["diagnostics"][0]["span"]["line"]
        assert json.loads(lines(part)[line - 1])["event"] == event
    assert part.read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["run.jsonl"], "nothing was written"


@pytest.mark.long
def test_a_run_that_has_failed_is_not_resumed(tmp_path: Path) -> None:
    plan = tmp_path / "serve.py"
    plan.write_text(
        PLAN.format(odd=17)
        .replace("partial(sleep, 1.0)", "fail")
        .replace("async def give", "async def fail() -> None:\n    raise PlanFailure('no')\n\n\nasync def give")
        .replace("from planlang import Object", "from planlang import PlanFailure, Object")
    )
    assert answer("run", plan, *OPTIONS, "--trace", tmp_path / "run.jsonl")["exit_code"] == 1
    refused = answer("run", plan, "--resume", tmp_path / "run.jsonl")
    assert (refused["exit_code"], codes(refused)) == (2, ["X021"])
    assert "--seed" in refused["diagnostics"][0]["help"]


def test_a_world_that_is_as_it_was_left_hands_over_what_the_robot_holds(ward: Stage, make_stage: MakeStage) -> None:
    """The robot's process was killed when it had the bottle; world and robot stand as they did."""
    patient = a_person("Patient", PLACE + "patient")

    @plan
    async def serve() -> None:
        await at_location(a_location(in_reach_of=THE_BOTTLE), grasp)
        await perform(action("Reaching", to_location=a_posture("carrying")))
        await at_location(a_location(in_reach_of=patient), give)

    async def grasp() -> None:
        await perform(action("Reaching", to_location=a_location(in_front_of=THE_BOTTLE)))
        await perform(action("OpeningAGripper"))
        await perform(action("Reaching", to_location=a_location(in_center_of=THE_BOTTLE)))
        await perform(action("ClosingAGripper"))

    async def give() -> None:
        await perform(action("Reaching", to_location=a_location(in_reach_of=patient)))
        await perform(action("HandingOverAnObject", object_acted_on=THE_BOTTLE, recipient=patient))

    trace = Trace()
    with pytest.raises(StepLimit):
        run(
            serve, host=SimulationHost(ward.truth), executive=ward.executive, trace=trace, max_steps=800, resumable=True
        )
    assert held_by(ward.truth, "bottle") == "robot"
    again = make_stage(*WARD)  # knows nothing of it yet
    platform = replace(again.platform, handle=ward.platform.handle)
    executive = RobotExecutive(platform, bundled_registry().resolve([]), ward.truth)
    past = Past(RecordedRun.of(trace.events))
    restore(executive, past)
    run(serve, host=SimulationHost(ward.truth), executive=executive, trace=Trace(), resume=past)
    assert held_by(ward.truth, "bottle") == "patient"


@pytest.mark.long
def test_a_plan_that_does_not_do_again_what_it_did_is_told_with_the_line(tmp_path: Path) -> None:
    plan = tmp_path / "serve.py"
    text = PLAN.format(odd=17).replace("partial(sleep, 1.0)", "partial(sleep, 1.0), name=(BASE / 'name').read_text()")
    plan.write_text(
        text.replace("from functools", "from pathlib import Path\nfrom functools", 1).replace(
            "BOTTLE =", f"BASE = Path({str(tmp_path)!r})\nBOTTLE =", 1
        )
    )
    (tmp_path / "name").write_text("one")
    assert answer("run", plan, *OPTIONS, "--trace", tmp_path / "run.jsonl")["exit_code"] == 0
    part = killed(tmp_path / "run.jsonl", tmp_path / "part.jsonl", completions(tmp_path / "run.jsonl")[4])
    (tmp_path / "name").write_text("two")
    refused = answer("run", plan, "--resume", part)
    assert (refused["exit_code"], codes(refused)) == (2, ["X027"])
    (line,) = (one["span"]["line"] for one in refused["diagnostics"])
    assert '"name": "one"' in lines(part)[line - 1]
    replayed = answer("replay", tmp_path / "run.jsonl", plan)
    assert (replayed["exit_code"], replayed["line"]) == (1, line)
    told = CliRunner().invoke(app, ["replay", str(tmp_path / "run.jsonl"), str(plan)])
    assert told.exit_code == 1
    assert f"line {line} is not repeated" in told.output
    shown = [line for line in told.output.splitlines() if line.startswith("  * ")]
    assert [("serve/one" in line, "serve/two" in line) for line in shown] == [(True, True)]


def test_a_run_is_replayed_without_robot_or_world(whole: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("a replay needs no world")

    monkeypatch.setattr("sim.PyBulletWorld.__init__", refuse)
    told = CliRunner().invoke(app, ["replay", str(whole)])
    assert (told.exit_code, told.output) == (0, f"{whole}: equal to the end: {len(lines(whole))} lines\n")


@pytest.mark.parametrize("name", Bundled.RECIPE.names())
def test_the_bundled_recipe_of_a_trace_is_found_by_the_plan(name: str, whole: Path, tmp_path: Path) -> None:
    """The plan has the name of its task, whatever that of the file."""
    compiled = answer("compile", name, "-o", tmp_path / "plan.py")
    iri = f"http://planlang.org/kb/{name}.owl#{compiled['task']}"
    header = {**json.loads(lines(whole)[0]), "iri": iri, "plan": compiled["functions"][-1]}
    (tmp_path / "run.jsonl").write_text(json.dumps(header) + "\n")
    said = [one["message"] for one in answer("replay", tmp_path / "run.jsonl")["diagnostics"]]
    assert not any("is not bundled" in one for one in said)
    resumed = [one["message"] for one in answer("run", "--resume", tmp_path / "run.jsonl")["diagnostics"]]
    assert not any("is not bundled" in one for one in resumed)


ODD: st.SearchStrategy[Any] = st.sampled_from(
    [None, True, -1, 10**30, 1.5, "x", "", [], {}, [[]], {"$": "Pose"}, {"$enum": "os.x", "name": "y"}]
)


@given(data=st.data())
@settings(max_examples=examples(60), suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_damaged_trace_never_ends_in_a_traceback(data: st.DataObject, whole: Path, tmp_path: Path) -> None:
    records = lines(whole)[: completions(whole)[0] + 3]
    number = data.draw(st.integers(0, len(records) - 1))
    way = data.draw(st.sampled_from(["value", "cut", "twice", "gone", "bytes"]))
    text = records[number]
    if way == "value":
        record = json.loads(text)
        place: Any = record
        key = data.draw(st.sampled_from(sorted(record)))
        while isinstance(place[key], dict) and place[key] and data.draw(st.booleans()):
            place = place[key]
            key = data.draw(st.sampled_from(sorted(place)))
        place[key] = data.draw(ODD)
        records[number] = json.dumps(record)
    elif way == "cut":
        records[number] = text[: data.draw(st.integers(0, len(text)))]
    elif way == "twice":
        records.insert(number, text)
    elif way == "gone":
        del records[number]
    damaged = tmp_path / "damaged.jsonl"
    content = ("\n".join(records) + "\n").encode()
    damaged.write_bytes(content if way != "bytes" else content[:-5] + bytes([0xFF, 0, 10]))
    replayed = answer("replay", damaged)
    assert replayed["exit_code"] in (0, 1, 2)
    if number < completions(whole)[0] and way == "value":
        ended = answer("run", "--resume", damaged, "--trace", tmp_path / "on.jsonl", "--start", "9,9,0")
        assert ended["exit_code"] == 2
