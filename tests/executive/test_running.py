"""The whole way inside one process: what run_plan_file answers, leaves behind, and refuses."""

from __future__ import annotations

import json
import math
import os
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from executive.maps import read_map, scene_of
from executive.pictures.scene_picture import picture
from executive.runs.ending import ending_of
from executive.runs.options import Outcome, RunOptions, RunResult
from executive.runs.outputs import names_in
from executive.runs.plan_run import run_plan_file
from executive.runs.traces import line_of, lines_of
from planlang import Trace, VirtualHost, a_constraint, a_feature, par, perform, run, sleep
from planlang.designators import action, an_object
from planlang.diagnostics import BadInput
from planlang.failures import NavigationGoalNotReached, ObjectUnreachable
from planlang.files import Bundled, bundled
from planlang.ontology import load
from planlang.report import Told
from planlang.report.wording import Wording
from planlang.testing import Script, ScriptedExecutive
from planlang.words import COMMAND_LINE, said
from sim import PyBulletWorld
from tests.executive.conftest import BUNDLED, Served
from tests.support.examples import some
from tests.support.refusals import refusal

CHECKOUT = Path(__file__).resolve().parents[2]
RECIPE = bundled("recipes") / "serve_a_drink.omn"
ROOM = bundled("ontologies") / "environments" / "hospital_room.omn"
AMIGO = bundled("ontologies") / "robots" / "amigo.omn"
MAP = ROOM.read_text(encoding="utf-8")
ROOM_IRI = "http://planlang.org/kb/hospital_room.owl#"

Serve = Callable[..., RunResult]


def records_of(trace: Path) -> list[dict[str, Any]]:
    """The lines of a trace; each must be a JSON object with a step and an event."""
    records = [json.loads(line) for line in trace.read_text(encoding="utf-8").splitlines()]
    assert trace.read_bytes().endswith(b"\n"), "the last line is whole"
    assert all(isinstance(record["step"], int) and isinstance(record["event"], str) for record in records)
    return records


def assert_complete(records: list[dict[str, Any]]) -> None:
    """A header first, steps in order, everything that started has ended."""
    assert records[0]["event"] == "header"
    assert all(before["step"] <= after["step"] for before, after in pairwise(records))
    started = Counter(record["node"] for record in records if record["event"] == "started")
    ended = Counter(record["node"] for record in records if record["event"] == "ended")
    assert started == ended, f"left open: {sorted(started - ended)}"


def changed_map(folder: Path, *changes: tuple[str, str]) -> Path:
    """The bundled room with parts of its text replaced, each of which must be there."""
    text = MAP
    for old, new in changes:
        assert old in text, f"{old!r} is not in the bundled room"
        text = text.replace(old, new)
    path = folder / "map.omn"
    path.write_text(text, encoding="utf-8")
    return path


def test_the_bundled_recipe_ends_with_the_bottle_in_the_patients_hand(served: Served) -> None:
    result = served.result
    assert (result.outcome, result.message, result.failures) == (Outcome.DONE, "done", ())
    assert result.final_state == ("bottle1: held by patient1",)
    assert 10 < result.duration < 120


def test_the_trace_is_complete_and_its_header_says_what_was_run(served: Served) -> None:
    records = records_of(served.trace)
    assert_complete(records)
    header = records[0]
    assert (header["plan"], header["robot"], header["seed"], header["rate"]) == ("serve_a_drink", "amigo", 3, 30)
    assert {"planlang", "pybullet", "casadi", "ruckig", "numpy"} <= set(header["versions"])


def test_the_trace_tells_what_was_learnt_and_held(served: Served) -> None:
    changes = [r["change"] for r in records_of(served.trace) if r["event"] == "belief"]
    assert [change for change in changes if change in ("grasped", "released")] == ["grasped", "released"]
    assert "seen" in changes, "with seed 3 the bottle is elsewhere than in the map"


def test_progress_tells_people_what_is_done_in_order(served: Served) -> None:
    text = "\n".join(served.progress)
    order = ["ReachForBottle", "CloseGripper", "bottle1 grasped", "HandOverBottle", "bottle1 handed to patient1"]
    places = [text.index(word) for word in order]
    assert places == sorted(places)
    assert all(re.match(r" *\d+\.\d\d s  ", line) for line in served.progress)


def test_the_picture_of_the_end_is_left(served: Served) -> None:
    with Image.open(served.folder / "scene.png") as image:
        assert (image.format, image.width, image.height > 640) == ("PNG", 960, True), "what was done stands below it"
    left = sorted(path.name for path in served.folder.iterdir())
    assert left == ["poses.jsonl", "run.jsonl", "scene.png"]


@pytest.mark.long
def test_one_seed_gives_one_trace_in_a_process_that_orders_hashes_differently(served: Served, tmp_path: Path) -> None:
    """This process has a random seed of hashes."""
    trace = tmp_path / "run.jsonl"
    environment = {**os.environ, "PYTHONPATH": str(CHECKOUT), "PYTHONHASHSEED": "99"}
    command = [sys.executable, "-m", "executive", "run", "serve_a_drink", "--seed", "3", "--trace", str(trace)]
    subprocess.run(command, env=environment, capture_output=True, check=True)
    assert trace.read_bytes() == served.trace.read_bytes()


# Real input


def of_corpus(corpus: Path, environment: str) -> RunOptions:
    """The real recipe with the real robot in a real map."""
    return RunOptions(
        recipe=corpus / "recipes" / "serve_drink@knowrob_hydro_2014-11.owl",
        robot=corpus / "robots" / "amigo@hydro.owl",
        environment=corpus / "environments" / environment,
    )


def test_a_kitchen_without_a_bottle_says_so_and_lists_what_there_is(corpus: Path) -> None:
    with refusal("X031", naming="bottle1 (DrinkingBottle)"):
        run_plan_file(of_corpus(corpus, "ias_semantic_map@hydro.owl"))


@pytest.mark.parametrize(
    "name",
    some(
        [
            "map_hospital_room@re_stack.owl.in",
            "ias_hospital_room@re_stack.owl.in",
            "ias_hospital_room_with_objects@re_stack.owl.in",
            "ias_semantic_map@hydro.owl",
        ],
        every=4,
    ),
)
def test_every_real_room_is_drawn(name: str, corpus: Path) -> None:
    world = PyBulletWorld(scene_of(read_map(load(corpus / "environments" / name))))
    pixels = picture(world, view="overview", size=(120, 90))
    world.close()
    assert pixels.shape == (90, 120, 3)
    assert pixels.std() > 5, "the picture shows something"


# What the user says


def test_parameters_are_set_by_iri_as_well() -> None:
    with pytest.raises(BadInput) as caught:
        run_plan_file(replace(BUNDLED, set={"bottle": "bed1", "patient": ROOM_IRI + "patient1"}))
    assert [diagnostic.code for diagnostic in caught.value.diagnostics] == ["X006"], "of the bottle alone"


def test_all_wrong_bindings_are_told_at_once_with_what_would_be_right() -> None:
    bindings = {"glass": "bottle1", "bottle": "bed1", "patient": "patient7"}
    with pytest.raises(BadInput) as caught:
        run_plan_file(replace(BUNDLED, set=bindings))
    found = {diagnostic.code: diagnostic for diagnostic in caught.value.diagnostics}
    assert set(found) == {"X004", "X005", "X006"}
    assert "bottle, patient" in (found["X004"].help or "")
    assert "patient1" in (found["X005"].help or "")
    assert "Bed-PieceOfFurniture" in found["X006"].message


@pytest.mark.parametrize(
    ("start", "said"),
    some(
        [
            ((-2.6, -0.8, 0.0), "collide with bottle1, cabinet1"),
            ((1.95, 0.6, 0.0), "collide with bed1, patient1"),
            ((40.0, 0.0, 0.0), "off the map"),
            ((-3.0, 0.0, 0.0), "off the map"),
            ((2.9, -2.0, 0.0), "collide with room1"),
        ],
        every=2,
    ),
)
def test_a_start_where_the_robot_cannot_stand_is_refused_with_the_reason(
    start: tuple[float, float, float], said: str
) -> None:
    with pytest.raises(BadInput) as caught:
        run_plan_file(replace(BUNDLED, start=start))
    (diagnostic,) = caught.value.diagnostics
    assert diagnostic.code == "X007"
    assert said in diagnostic.message
    if "off the map" in said:
        assert "x in -3..3, y in -2.5..2.5" in (diagnostic.help or "")
    else:
        told = re.search(r"start=\((.+), (.+), 0\) is the nearest free place", diagnostic.help or "")
        assert told is not None, diagnostic.help
        assert math.dist(tuple(map(float, told.groups())), start[:2]) < 1.5


def test_a_room_without_free_floor_has_no_place_to_start(tmp_path: Path) -> None:
    path = changed_map(tmp_path, ("knowrob:depthOfObject 0.45,", "knowrob:depthOfObject 12.0,"))
    path.write_text(
        path.read_text(encoding="utf-8").replace("knowrob:widthOfObject 0.45,", "knowrob:widthOfObject 12.0,"),
        encoding="utf-8",
    )
    with pytest.raises(BadInput) as caught:
        run_plan_file(replace(BUNDLED, environment=path))
    assert [diagnostic.code for diagnostic in caught.value.diagnostics] == ["X003"]
    assert "start=X,Y,YAW" in (caught.value.diagnostics[0].help or "")


# Maps that do not fit


def test_a_map_without_a_bottle_is_refused_with_what_there_is(tmp_path: Path) -> None:
    frames = MAP.split("\n\n")
    path = tmp_path / "map.omn"
    path.write_text("\n\n".join(f for f in frames if "bottle1" not in f.split("\n")[0]), encoding="utf-8")
    with refusal("X031", naming=("bottle1", "patient1")):
        run_plan_file(replace(BUNDLED, environment=path))


@pytest.mark.parametrize(
    ("environment", "changes", "advice"),
    [
        (None, (("knowrob:Patient", "knowrob:Person"), ("patient1", "guest7")), "--set patient=guest7"),
        ("day_room", (), "--environment hospital_room (or visiting_hours)"),
    ],
    ids=["a person of another class", "a bundled room without persons"],
)
def test_what_would_do_is_a_command(
    tmp_path: Path, environment: str | None, changes: tuple[tuple[str, str], ...], advice: str
) -> None:
    path = changed_map(tmp_path, *changes) if environment is None else Bundled.ENVIRONMENT.find(environment)
    with pytest.raises(BadInput) as caught:
        run_plan_file(replace(BUNDLED, environment=path))
    (problem,) = caught.value.diagnostics
    where = f"--environment {path} " if environment is None else ""
    command = f"planlang run serve_a_drink --robot amigo {where}{advice}"
    assert (problem.code, said(problem.help or "", COMMAND_LINE)) == ("X031", command)


@pytest.mark.long
def test_a_bottle_outside_the_room_cannot_be_reached(tmp_path: Path) -> None:
    path = changed_map(tmp_path, ("knowrob:m03 -2.72", "knowrob:m03 -8.0"))
    result = run_plan_file(replace(BUNDLED, environment=path, picture=tmp_path / "failed.png"))
    assert (result.outcome, result.failures) == (Outcome.FAILED, ("ObjectUnreachable", "LocationUnresolvable"))
    assert "bottle1" in result.message
    pixels = np.asarray(Image.open(tmp_path / "failed.png").convert("RGB")).astype(int)
    fingers = (pixels[:, :, 0] > 150) & (pixels[:, :, 2] < 90) & (pixels[:, :, 1] > 80)
    assert fingers.sum() > 10, "the robot is in the picture"


def test_the_ending_of_a_run_has_the_reason_of_the_page_or_the_steps_and_the_state(served: Served) -> None:
    lines = served.trace.read_text(encoding="utf-8").splitlines()
    told = Told.of(map(json.loads, lines))
    first, steps, state = ending_of(
        told, Wording(), "done", "done", 31.5, ["bottle1: held by patient1", "door1: closed"]
    )
    assert (first, state) == ("done after 31.50 s", "bottle1: held by patient1; door1: closed")
    assert steps.endswith("hand over bottle")
    cut_off = Told.of(map(json.loads, lines[: next(k for k, line in enumerate(lines) if '"grasped"' in line)]))
    assert ending_of(cut_off, Wording(), "interrupted", "interrupted at X(), 9 s", 9.0, [])[1] == (
        "at this step: close gripper (with gripper)"
    )
    assert ending_of(told, Wording(), "failed", "RunError: no\n  more", 1.0, []) == (
        "failed after 1.00 s",
        "RunError: no",
    )
    told.tree.roots[0].failure = {
        "type": "ObjectUnreachable",
        "message": "the object cannot be reached",
        "cause": {"type": "MissingCapability", "message": "the robot has no camera", "cause": None},
    }
    assert ending_of(told, Wording(), "failed", "", 1.0, [])[1] == "the robot has no camera"


def test_a_picture_of_a_failure_is_about_what_was_in_the_way() -> None:
    failure = ObjectUnreachable(what="bottle1")
    failure.__cause__ = NavigationGoalNotReached(blocked_by="chair1", target=(0.0, 0.0, 0.0))
    assert {"bottle1", "chair1"} <= set(names_in(failure))


@pytest.mark.long
def test_a_bottle_on_top_of_a_tower_cannot_be_reached(tmp_path: Path) -> None:
    path = changed_map(tmp_path, ("knowrob:m23 0.9,", "knowrob:m23 2.3,"))
    result = run_plan_file(replace(BUNDLED, environment=path))
    assert (result.outcome, result.failures[0]) == (Outcome.FAILED, "ObjectUnreachable")


# Ending early


class _After:
    """Raises KeyboardInterrupt at the n-th call."""

    def __init__(self, number: int) -> None:
        self.left = number

    def __call__(self, *ignored: object) -> None:
        self.left -= 1
        if self.left == 0:
            raise KeyboardInterrupt


@pytest.mark.parametrize("step", some([1, 425]))
def test_an_interrupt_in_any_step_of_the_world_ends_the_run_with_a_complete_trace(
    step: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    interrupt, move = _After(step), PyBulletWorld.step

    def stepping(world: PyBulletWorld) -> None:
        interrupt()
        move(world)

    monkeypatch.setattr(PyBulletWorld, "step", stepping)
    result = run_plan_file(replace(BUNDLED, trace=tmp_path / "run.jsonl", picture=tmp_path / "scene.png"))
    assert (result.outcome, result.message) == (Outcome.INTERRUPTED, "interrupted")
    assert result.final_state[0].startswith("bottle1: ")
    records = records_of(tmp_path / "run.jsonl")
    assert_complete(records)
    assert (tmp_path / "scene.png").is_file()


@pytest.mark.long
@pytest.mark.parametrize("line", [1, 9])
def test_an_interrupt_while_progress_is_told_ends_the_run_with_a_complete_trace(line: int, tmp_path: Path) -> None:
    result = run_plan_file(replace(BUNDLED, trace=tmp_path / "run.jsonl", progress=_After(line)))
    assert (result.outcome, result.message) == (Outcome.INTERRUPTED, "interrupted")
    assert_complete(records_of(tmp_path / "run.jsonl"))


def test_a_reader_of_progress_who_hangs_up_ends_the_run_with_a_complete_trace(tmp_path: Path) -> None:
    def hang_up(line: str) -> None:
        raise BrokenPipeError

    with pytest.raises(BrokenPipeError):
        run_plan_file(replace(BUNDLED, trace=tmp_path / "run.jsonl", progress=hang_up))
    assert_complete(records_of(tmp_path / "run.jsonl"))


def test_between_two_lines_of_progress_the_run_says_at_which_action_it_works() -> None:
    lines: list[str] = []
    said_at_work: list[str] = []
    entered: list[int] = []

    @contextmanager
    def waiting(what: Callable[[], str], most: float | None = None) -> Iterator[None]:
        entered.append(len(lines))
        yield
        said_at_work.append(what())

    result = run_plan_file(replace(BUNDLED, progress=lines.append, waiting=waiting))
    assert result.outcome is Outcome.DONE
    assert entered == list(range(len(lines) + 1)), "anew after each line"
    assert len(said_at_work) == len(entered), "and it ends with the run"
    grasp = next(number for number, line in enumerate(lines) if "GraspBottle(" in line)
    assert said_at_work[grasp + 1].startswith("still at GraspBottle("), said_at_work


def test_a_robot_without_grippers_is_told_what_it_lacks_before_anything_moves(tmp_path: Path) -> None:
    urdf, robot = tmp_path / "handless.urdf", tmp_path / "handless.omn"
    shape = (AMIGO.parent / "amigo.urdf").read_text(encoding="utf-8")
    urdf.write_text(re.sub(r'(<joint name="finger[^"]*" type=")revolute"', r'\1fixed"', shape), encoding="utf-8")
    frames = AMIGO.read_text(encoding="utf-8").split("\n\n")
    robot.write_text("\n\n".join(f for f in frames if not re.match(r"Individual: \w+_gripper\b", f)), encoding="utf-8")
    result = run_plan_file(replace(BUNDLED, robot=robot, urdf=urdf, trace=tmp_path / "run.jsonl"))
    assert (result.outcome, result.failures) == (Outcome.LACKS_CAPABILITY, ("MissingCapability",))
    assert "GripperMotionCapability" in result.message
    assert not (tmp_path / "run.jsonl").exists()


def test_listeners_are_told_each_record_in_order_as_it_is_written() -> None:
    told: list[object] = []
    trace = Trace()
    trace.listeners = (lambda record, node: told.append(record), lambda record, node: told.append(record["event"]))
    trace.write(7, "belief", change="seen", name="bottle1")
    assert told == [{"step": 7, "event": "belief", "change": "seen", "name": "bottle1"}, "belief"]


def test_what_a_listener_hears_of_a_run_is_what_its_trace_keeps() -> None:
    told: list[object] = []
    trace = Trace()
    trace.listeners = (lambda record, node: told.append(record),)
    run(partial(par, partial(sleep, 1), partial(sleep, 2)), host=VirtualHost(), trace=trace)
    assert told == trace.events


def test_a_run_ends_with_what_a_listener_raises_and_the_others_are_told_on() -> None:
    told: list[str] = []

    def fail(record: Mapping[str, object], node: object) -> None:
        if record["event"] == "started":
            raise BrokenPipeError

    trace = Trace()
    trace.listeners = (fail, lambda record, node: told.append(record["event"]))
    with pytest.raises(BrokenPipeError):
        run(partial(sleep, 1), host=VirtualHost(), trace=trace)
    assert told == ["header", "started", "drained", "ended"]


@pytest.mark.parametrize(
    ("record", "line"),
    [
        ({"event": "started", "kind": "perform", "name": "Reaching", "action": "Reaching()"}, "Reaching()"),
        ({"event": "started", "kind": "task", "name": "serve"}, None),
        ({"event": "started", "kind": "plan", "name": "serve_a_drink"}, "serve_a_drink"),
        (
            {"event": "ended", "kind": "perform", "failure": {"type": "ObjectNotFound", "message": "no bottle1"}},
            "failed: ObjectNotFound: no bottle1",
        ),
        ({"event": "ended", "kind": "perform", "status": "succeeded"}, None),
        ({"event": "started", "kind": "perform", "action": "X(by_it=True, to=a)"}, "X(by it, to=a)"),
        ({"event": "started", "kind": "perform", "action": "X(x=1.1999999999999996, y=-0.0)"}, "X(x=1.2, y=0.0)"),
        ({"event": "recovery", "decision": "retry"}, "the step that failed is tried again"),
        (
            {"event": "recovery", "decision": "used up"},
            "the step is not tried again: it has failed as often as its recovery allows",
        ),
        ({"event": "belief", "change": "seen", "name": "bottle1"}, "  belief: bottle1 seen"),
        ({"event": "belief", "change": "leads", "name": "drawer1"}, "  belief: drawer1 held by its handle"),
        ({"event": "belief", "change": "led", "name": "drawer1", "value": 0.4}, None),
        ({"event": "belief", "change": "led", "name": "drawer1", "value": 0.0}, "  belief: drawer1 closed"),
        ({"event": "belief", "change": "let go", "name": "drawer1"}, "  belief: drawer1 released"),
        ({"event": "belief", "change": "switched", "name": "table1", "state": "Clean"}, "  belief: table1 Clean"),
        ({"event": "belief", "change": "switched", "name": "maker1", "state": "DeviceStateOn"}, "  belief: maker1 on"),
    ],
)
def test_people_are_told_what_begins_fails_and_is_learnt(record: dict[str, object], line: str | None) -> None:
    assert line_of(record) == line


def test_each_line_comes_with_its_step_of_the_world() -> None:
    said: list[tuple[int, str]] = []
    tell = lines_of(lambda step, line: said.append((step, line)))
    tell({"step": 45, "event": "started", "kind": "perform", "action": "X(object_acted_on=bottle1)"}, None)
    tell({"step": 46, "event": "acquired"}, None)
    assert said == [(45, "X(object_acted_on=bottle1)")]


def test_what_is_so_already_is_not_said_again() -> None:
    said: list[str] = []
    tell = lines_of(lambda step, line: said.append(line))
    failed = {"event": "ended", "kind": "perform", "failure": {"type": "GraspMissed", "message": "no"}}
    up = {"event": "recovery", "decision": "propagate"}
    for record in (failed, up, failed, up):  # one failure passes two recoveries
        tell({"step": 5, **record}, None)
    for step, value in enumerate((0.1, 0.2, 0.0, 0.3), 6):
        tell({"step": step, "event": "belief", "change": "led", "name": "door1", "value": value}, None)
    tell({"step": 10, **up}, None)
    doors = [f"  belief: door1 {how}" for how in ("being opened", "closed", "being opened")]
    assert said == ["failed: GraspMissed: no", "the recovery gives up", *doors, "the recovery gives up"]


@pytest.mark.parametrize("inner", [False, True])
def test_what_a_module_performs_itself_is_told_only_to_who_asks(inner: bool) -> None:
    said: list[str] = []
    look, reach = action("LookingForSomething"), action("Reaching")
    executive = ScriptedExecutive(Script().on("Reaching", does=lambda belief, asked: perform(look)))
    trace = Trace()
    trace.listeners = (lines_of(lambda step, line: said.append(line), inner=inner),)
    run(partial(perform, reach), host=VirtualHost(), executive=executive, trace=trace)
    assert said == ["Reaching()", *["LookingForSomething()"] * inner]


def test_of_a_motion_under_constraints_people_are_told_these_by_name() -> None:
    cup = an_object("Cup")
    level = a_constraint("HEIGHT", a_feature(of=cup), a_feature(of=an_object("Bowl-Eating")), upper=0.2, name="Level")
    told = "PouringMotion(constrained_by=(Level), object_acted_on=Cup)"
    assert str(action("PouringMotion", constrained_by=(level,), object_acted_on=cup)) == told
