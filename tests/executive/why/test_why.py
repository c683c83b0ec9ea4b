"""``planlang why``: the smallest change after which a failed run reaches its goal, found by whole reruns.

The plan of these tests does nothing but check its room, so that exactly one change mends it, and a run is short.
"""

from __future__ import annotations

import html
import json
import re
import shlex
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from cli_runs import invoke

import planlang
from executive.runs.traces import recorded_run
from executive.why.evidence import Evidence
from planlang.advice import Change
from tests.support.table_room import ROOM

PLAN = """
from planlang import action, an_object, perform, plan

CAN = an_object("DrinkingCan", "http://example.org/room.owl#can1")


@plan
async def check_the_room():
    await perform(action("CheckingTheRoom", object_acted_on=CAN))
"""
MODULE = """
from planlang import process_module
from planlang.failures import ObjectUnreachable


@process_module
class Checking:
    name = "checking"
    actions = ("CheckingTheRoom",)
    failures = (ObjectUnreachable,)

    def __init__(self, platform):
        self.belief = platform.belief

    def resources(self, action):
        return ()

    async def execute(self, action):
        belief = self.belief
        if not (CONDITION):
            raise ObjectUnreachable("can1 cannot be reached beside door1", what="can1")
"""


@pytest.fixture
def room(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "room.omn").write_text(ROOM, encoding="utf-8")
    (tmp_path / "check.py").write_text(PLAN, encoding="utf-8")
    return tmp_path


WORDS = ("check.py", "--robot", "amigo", "--environment", "room.omn", "--modules", "check_module.py")


def failed_unless(condition: str) -> None:
    """Run the plan in a room that does not meet a condition."""
    Path("check_module.py").write_text(MODULE.replace("CONDITION", condition), encoding="utf-8")
    assert invoke("run", *WORDS, "--trace", "run.jsonl").exit_code == 1


def why(*words: str) -> dict[str, Any]:
    """Return the answer of the command, as JSON."""
    found = invoke("why", "run.jsonl", *WORDS, "--json", *words)
    answer: dict[str, Any] = json.loads(found.stdout)
    return answer | {"code": found.exit_code}


def test_a_thing_that_has_to_stand_further_away_is_found_and_the_command_reaches_the_goal(
    room: Path,
) -> None:
    failed_unless('belief.pose("can1").position[1] <= -0.09')
    answer = why("--processes", "1")
    assert answer["sentence"] == "the goal is reached if can1 is moved 0.10 m, to x = 1.85, y = -0.10, z = 0.81"
    assert answer["changes"] == [{"thing": "can1", "property": "translation", "value": [1.85, -0.1, 0.805]}]
    assert answer["cost"] == 4.0
    assert json.loads((room / "run.apply.json").read_text())["changes"] == answer["changes"]
    again = invoke(*shlex.split(answer["command"])[1:])
    assert again.exit_code == 0, again.output


def test_the_other_arm_is_found_and_stated_as_an_option_of_the_command(room: Path) -> None:
    failed_unless('"right" in belief.memory.given_up')
    answer = why("--processes", "1")
    assert answer["sentence"] == "the goal is reached if the robot grasps with its left arm first"
    assert "--arm left" in answer["command"]
    assert "--apply" not in answer["command"]
    assert invoke(*shlex.split(answer["command"])[1:]).exit_code == 0


def test_an_open_door_is_found_whatever_the_number_of_processes(room: Path) -> None:
    failed_unless('belief.joint("door1") > 1.0')
    answers = [why("--processes", number) for number in ("1", "2")]
    assert answers[0] == answers[1]
    assert answers[0]["sentence"] == "the goal is reached if door1 is open by 90 degrees from the start"
    applied = invoke("run", *WORDS, "--apply", "run.apply.json")
    assert applied.exit_code == 0, applied.output


@pytest.mark.long
@pytest.mark.parametrize("is_elsewhere", [False, True], ids=["dask", "tcp"])
def test_reruns_on_a_cluster_find_the_same_and_print_the_same(room: Path, is_elsewhere: bool) -> None:
    distributed = pytest.importorskip("distributed", reason="the extra [cluster] is not installed")
    failed_unless('belief.pose("can1").position[1] <= -0.09')
    here = why("--processes", "2")
    with ExitStack() as stack:
        engine = "dask"
        if is_elsewhere:
            kept = {"processes": False, "protocol": "tcp://", "dashboard_address": "127.0.0.1:0", "memory_limit": 0}
            made = stack.enter_context(distributed.LocalCluster(n_workers=1, threads_per_worker=2, **kept))
            engine = made.scheduler_address
        found = why("--on", engine, "--processes", "2")
        if is_elsewhere:
            from executive.sweeps import cluster_worker

            assert not cluster_worker._sweeps, "nothing is left on the worker"
    assert found == here
    assert found["found"]


STANDING = """
from planlang import action, an_object, at_location, perform, plan
from planlang.designators import a_location

CAN = an_object("DrinkingCan", "http://example.org/room.owl#can1")
TABLE = an_object("KitchenTable", "http://example.org/room.owl#table1")


@plan
async def check_the_room():
    async def nothing():
        pass

    await at_location(a_location(in_reach_of=TABLE), nothing)
    await perform(action("CheckingTheRoom", object_acted_on=CAN))
"""


@pytest.mark.long
def test_what_only_two_changes_mend_is_found_with_both(room: Path) -> None:
    alone = ROOM.partition("Individual: box1")[0].replace("0 0.805", "1.5 0.5").replace("2 0 0.37", "0.95 0 0.37")
    (room / "room.omn").write_text(alone, encoding="utf-8")
    (room / "check.py").write_text(STANDING, encoding="utf-8")
    failed_unless('belief.memory.grasp == "top" and "right" in belief.memory.given_up')
    answer = why("--budget", "60")
    both = "the robot grasps with its left arm first, and the robot grasps things from above first"
    assert (answer["code"], answer["sentence"]) == (0, f"the goal is reached if {both}")
    assert answer["cost"] == 2.0


def test_where_nothing_helps_it_is_said_what_was_tried_and_what_was_not(room: Path) -> None:
    failed_unless("False")
    found = invoke("why", "run.jsonl", *WORDS, "--budget", "6", "--quiet")
    assert found.exit_code == 1
    assert "no change was found after which the goal is reached" in found.stdout
    assert "6 reruns: 2 arms, 1 further attempt, 1 door opened or closed first, 2 places of things" in found.stdout
    assert "not tried: " in found.stdout
    assert not (room / "run.apply.json").exists()


TAKING = """
from planlang import action, an_object, at_location, perform, plan
from planlang.designators import a_location

CAN = an_object("DrinkingCan", "http://example.org/room.owl#can1")
BEFORE, AROUND = a_location(in_front_of=CAN), a_location(in_center_of=CAN)


@plan
async def check_the_room():
    async def take():
        await perform(action("Reaching", to_location=BEFORE))
        await perform(action("OpeningAGripper"))
        await perform(action("Reaching", to_location=AROUND))
        await perform(action("ClosingAGripper", object_acted_on=CAN))
        await perform(action("Reaching", to_location=BEFORE))

    await at_location(a_location(in_reach_of=CAN), take, reaching=(BEFORE, AROUND))
    await perform(action("CheckingTheRoom"), "check")
"""


def test_what_a_hand_holds_in_vain_is_put_down_before_the_step_that_failed(room: Path) -> None:
    (room / "check.py").write_text(TAKING, encoding="utf-8")
    module = MODULE.replace("can1 cannot be reached beside door1", "door1 cannot be reached").replace("can1", "door1")
    Path("check_module.py").write_text(module.replace("CONDITION", "not belief.held"), encoding="utf-8")
    choices = ("--arm", "right", "--grasp", "side")
    assert invoke("run", *WORDS, *choices, "--trace", "run.jsonl").exit_code == 1
    answer = why(*choices, "--processes", "1")
    step = "check_the_room/budget/check_the_room/check"
    assert answer["sentence"] == f"the goal is reached if the robot puts can1 down before {step}"
    assert (answer["cost"], answer["reruns"], answer["tried"]) == (2.0, 1, {"put down": 1})
    again = invoke(*shlex.split(answer["command"])[1:], "--trace", "again.jsonl")
    assert again.exit_code == 0, again.output
    assert invoke("replay", "again.jsonl", "check.py", "--modules", "check_module.py").exit_code == 0


def test_a_step_that_is_none_of_the_plan_is_refused(room: Path) -> None:
    Path("check_module.py").write_text(MODULE.replace("CONDITION", "True"), encoding="utf-8")
    found = invoke("run", *WORDS, "--before", "SettingAsideAnObject can1@check")
    assert found.exit_code == 2
    assert "X005" in found.output
    assert "check_the_room/budget/check_the_room" in found.output


def test_a_step_to_which_the_run_does_not_come_is_warned_of_in_the_run_and_in_its_explanation(room: Path) -> None:
    failed_unless("False")
    before = ("--before", "SettingAsideAnObject can1@check_the_room/budget/check_the_room/CheckingTheRom")
    ran = invoke("run", *WORDS, *before, "--trace", "run.jsonl")
    assert ran.exit_code == 1
    warned = "X035 --before: the run did not come to the step check_the_room/budget/check_the_room/CheckingTheRom"
    assert warned in ran.output
    assert "such as check_the_room/budget/check_the_room/CheckingTheRoom" in ran.output
    assert [one["code"] for one in why(*before, "--budget", "1")["diagnostics"]] == ["X035"]


def test_the_file_of_changes_is_written_again_but_over_no_other_file(room: Path) -> None:
    failed_unless('"right" in belief.memory.given_up')
    assert [why("--apply", "change.json", "--budget", "2")["code"] for _ in range(2)] == [0, 0]
    mine = '[{"option": "arm", "value": "left"}]'
    (room / "run.apply.json").write_text(mine, encoding="utf-8")
    refused = why("--budget", "2")
    assert (refused["code"], refused["diagnostics"][0]["help"]) == (2, "--force overwrites it")
    assert (room / "run.apply.json").read_text() == mine
    assert why("--budget", "2", "--force")["code"] == 0


def test_a_run_that_reached_its_goal_needs_no_change(room: Path) -> None:
    Path("check_module.py").write_text(MODULE.replace("CONDITION", "True"), encoding="utf-8")
    assert invoke("run", *WORDS, "--trace", "run.jsonl").exit_code == 0
    answer = why()
    assert (answer["code"], answer["sentence"]) == (0, "this run reached its goal: nothing has to change")


def test_a_run_that_does_not_fail_again_is_not_explained_by_a_change(room: Path) -> None:
    failed_unless('__import__("pathlib").Path("there").exists()')
    (room / "there").touch()
    answer = why("--processes", "1")
    assert (answer["code"], answer["found"], answer["reruns"]) == (1, False, 0)
    assert answer["sentence"].startswith("the goal is reached without any change when the run is repeated")


def test_a_map_that_is_not_that_of_the_trace_is_refused(room: Path) -> None:
    failed_unless("False")
    (room / "room.omn").write_text(ROOM.replace("1.85 0 0.805", "1.8 0 0.805"), encoding="utf-8")
    answer = why()
    assert answer["code"] == 2
    (differs,) = (one for one in answer["diagnostics"] if one["code"] == "X022")
    assert "--environment FILE" in differs["help"]


def test_a_run_that_has_not_ended_is_to_be_resumed_with_the_files_that_it_had(room: Path) -> None:
    failed_unless("False")
    lines = (room / "run.jsonl").read_text(encoding="utf-8").splitlines(keepends=True)
    (room / "run.jsonl").write_text("".join(lines[:-3]), encoding="utf-8")
    (advice,) = (one["help"] for one in why()["diagnostics"] if one["code"] == "X021")
    call = "planlang run check.py --robot amigo --environment room.omn --modules check_module.py --resume run.jsonl"
    assert sorted(advice.removesuffix(" ends it").split()) == sorted(call.split())
    (advice,) = (one["help"] for one in json.loads(invoke("why", "run.jsonl", "--json").stdout)["diagnostics"])
    call = "planlang run FILE --environment FILE --modules FILE --resume run.jsonl"
    assert sorted(advice.removesuffix(" ends it").split()) == sorted(call.split())


@pytest.mark.parametrize(("text", "code"), [("no trace", "X020"), ("", "X020")])
def test_a_damaged_trace_is_refused_with_its_line(room: Path, text: str, code: str) -> None:
    (room / "run.jsonl").write_text(text, encoding="utf-8")
    Path("check_module.py").write_text(MODULE, encoding="utf-8")
    answer = why()
    assert (answer["code"], answer["diagnostics"][0]["code"]) == (2, code)


def test_a_trace_whose_plan_is_not_named_is_refused_with_advice(room: Path) -> None:
    failed_unless("False")
    found = invoke("why", "run.jsonl")
    assert found.exit_code == 2
    assert "X020 the plan check_the_room of the trace is not bundled: name its file" in found.output


def test_the_result_of_a_run_in_python_says_why_without_a_file(room: Path) -> None:
    Path("check_module.py").write_text(
        MODULE.replace("CONDITION", '"right" in belief.memory.given_up'), encoding="utf-8"
    )
    run = planlang.simulate("check.py", robot="amigo", environment="room.omn", modules=["check_module.py"])
    found = run.why(budget=4, processes=1)
    assert found.sentence == "the goal is reached if the robot grasps with its left arm first"
    assert (found.changes, found.reruns, found.applied) == ((Change("arm", "left"),), 2, None)
    assert not list(room.glob("*.json"))


def test_the_page_of_both_runs_has_both_and_allows_only_their_scripts(room: Path) -> None:
    failed_unless('"right" in belief.memory.given_up')
    assert why("--report", "both.html", "--budget", "4")["code"] == 0
    page = (room / "both.html").read_text(encoding="utf-8")
    assert page.count("<iframe") == 2
    assert [name in page for name in ("without the change", "with the change")] == [True, True]
    inner = [html.unescape(text) for text in re.findall(r'srcdoc="([^"]*)"', page)]
    outer, *allowed = [set(re.findall(r"'sha256-[^']+'", html.unescape(text[:8000]))) for text in (page, *inner)]
    assert all(hashes and hashes <= outer for hashes in allowed)
    assert '"status":"failed"' in inner[0]
    assert '"status":"succeeded"' in inner[1]


def test_a_door_that_cannot_be_opened_before_the_plan_is_no_progress(room: Path) -> None:
    failed_unless("False")
    before = invoke("run", *WORDS, "--before", "OpeningAContainerArtifact door1", "--trace", "before.jsonl")
    assert before.exit_code == 1
    first, second = (
        Evidence.of([line.record for line in recorded_run(room / name).lines]) for name in ("run.jsonl", "before.jsonl")
    )
    assert (first.steps, second.steps) == (0, -1)
    assert not second.is_past(first)
