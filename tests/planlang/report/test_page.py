"""What a page is told of a run, and that nothing of it is more than text."""

from __future__ import annotations

import base64
import hashlib
import json
import re
import time
from collections.abc import Iterator
from functools import partial
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest

from planlang import Recovery, at_location, par, perform, plan, sleep
from planlang.compiler.compile import compile_recipe
from planlang.designators import a_location, action, an_object
from planlang.diagnostics import note
from planlang.failures import (
    GraspMissed,
    HandoverNotTaken,
    ManipulationPoseUnreachable,
    MissingCapability,
    ObjectNotFound,
)
from planlang.files import Bundled
from planlang.language.source import PlanSource
from planlang.ontology import load
from planlang.ontology.convert import Target, convert
from planlang.report import Context, Told, model_of, page
from planlang.report.sources import plan_source, recipe_source
from planlang.report.tree import shown, text_of
from planlang.report.wording import Wording, words
from planlang.runs.run_tree import TaskNode
from planlang.testing import ScheduleDependence, Script, compiled, explore, run_plan
from planlang.visible import visible

HOSTILE = "</script><script>alert(1)</script>\u2028\ud800"


@plan
async def fetch() -> None:
    async def look() -> int:
        await sleep(1)
        return 7

    async def grasp() -> None:
        await perform(action("ClosingAGripper"), recoveries=[Recovery(GraspMissed, retries=2)])

    await par(look, grasp)


def fetched(times: int) -> dict[str, Any]:
    """Return the model of a run whose gripper misses so often."""
    run = run_plan(fetch, script=Script().on("ClosingAGripper", fails=GraspMissed, times=times, after=1.5))
    return model_of(Told.of(run.events))


def named(model: dict[str, Any], name: str) -> list[dict[str, Any]]:
    return [node for node in model["nodes"] if node["name"].partition("#")[0] == name]


def test_nodes_have_their_parents_spans_and_ends() -> None:
    model = fetched(1)
    look, (first, second) = named(model, "look")[0], named(model, "ClosingAGripper")
    assert (look["status"], look["start"], look["end"]) == ("succeeded", 0.0, 1.0)
    assert (first["status"], second["status"]) == ("failed", "succeeded")
    assert (first["end"], second["start"], model["end"]) == (1.5, 1.5, 2.5)
    numbers = {node["id"] for node in model["nodes"]}
    assert all(node["parent"] is None or node["parent"] in numbers for node in model["nodes"])


def test_a_failure_that_passes_through_many_nodes_is_told_once() -> None:
    model = fetched(3)
    assert model["outcome"] == {"status": "failed", "text": "failed", "failure": model["nodes"][0]["failure"]}
    assert len(model["failures"]) == 3, "each attempt has a place of its own"
    fatal, *recovered = model["cards"]
    assert (fatal["recovered"], [card["recovered"] for card in recovered]) == (False, [True, True])
    assert [text for _, _, text in fatal["tried"] if text.startswith("attempt")] == ["attempt 2", "attempt 3"]
    assert model["failures"][fatal["failure"]]["headline"] == "the gripper closed on nothing"


def test_a_card_lists_actions_and_attempts_before_its_failure_in_the_order_of_the_trace() -> None:
    model = fetched(3)
    fatal, first, _ = model["cards"]
    grasps = named(model, "ClosingAGripper")
    assert first["tried"][0] == [0.0, grasps[0]["id"], "closing a gripper: failed after 1.5 s"]
    missed = "closing a gripper: failed after 1.5 s: the gripper closed on nothing"
    assert [(time, node, text) for time, node, text in fatal["tried"] if text.startswith("closing")] == [
        (0.0, grasps[0]["id"], missed),
        (1.5, grasps[1]["id"], missed),
        (3.0, grasps[2]["id"], "closing a gripper: failed after 1.5 s"),
    ]
    times = [time for time, *_ in fatal["tried"]]
    assert times == sorted(times)


def test_a_long_list_of_what_was_tried_has_the_latest_and_the_number_of_the_others() -> None:
    async def grasp_often() -> None:
        for _ in range(50):
            await perform(action("OpeningAGripper"))
        await perform(action("ClosingAGripper"))

    run = run_plan(grasp_often, script=Script().on("ClosingAGripper", fails=GraspMissed))
    (card,) = model_of(Told.of(run.events))["cards"]
    assert len(card["tried"]) == 41
    assert card["tried"][0][2].startswith("11 earlier")
    assert card["tried"][-1][2].startswith("closing a gripper: failed")


def test_actions_have_the_words_of_the_recipe_else_of_the_vocabulary_with_what_they_are_about() -> None:
    node = TaskNode("Perceiving", "perform", None, parameters={"action": "Perceiving(object_acted_on=cup1)"})
    assert Wording().of(node) == "perceiving (cup1)"
    vocabulary = {"Perceiving": "looking at something"}
    assert Wording(vocabulary=vocabulary).of(node) == "looking at something (cup1)"
    assert Wording({"Perceiving": "check the cup"}, vocabulary).of(node) == "check the cup"


def test_a_property_that_is_simply_true_is_told_by_its_name() -> None:
    asked = "SettingAsideAnObject(for_another_grip=True, object_acted_on=cup1)"
    node = TaskNode("SettingAsideAnObject", "perform", None, parameters={"action": asked})
    assert text_of(node) == "for another grip, object acted on cup1"
    assert (
        Wording(vocabulary={"SettingAsideAnObject": "putting down"}).of(node) == "putting down (for another grip, cup1)"
    )


def test_no_class_of_a_failure_is_told_as_a_property_of_an_action() -> None:
    asked = "EmptyingTheHands(after_failure=('ObjectUndeliverable', 'PlanFailure'))"
    node = TaskNode("EmptyingTheHands", "perform", None, parameters={"action": asked})
    assert (Wording().of(node), text_of(node)) == ("emptying the hands", "")


def test_relations_of_an_action_are_told_in_words() -> None:
    asked = "Reaching(object_acted_on=tall_cup1, to_location=in_front_of(tall_cup1) with gripper)"
    node = TaskNode("Reaching", "perform", None, parameters={"action": asked})
    assert Wording().of(node) == "reaching (tall_cup1, in front of tall_cup1)"
    assert text_of(node) == "object acted on tall_cup1, in front of tall_cup1"
    asked = "PuttingDown(object_acted_on=cup1, to_location=in_(cupboard1))"
    node = TaskNode("PuttingDown", "perform", None, parameters={"action": asked})
    assert Wording().of(node) == "putting down (cup1, in cupboard1)"
    asked = "HandOver(constrained_by=(Upright, Level), device_used=left, object_acted_on=cup1, recipient=child1)"
    node = TaskNode("HandOver", "perform", None, parameters={"action": asked})
    assert Wording().of(node) == "hand over (cup1, to child1, with left)"
    for arm in ("right_arm", "RightArm"):
        asked = f"Reaching(device_used={arm}, to_location=in_center_of(cup1))"
        node = TaskNode("Reaching", "perform", None, parameters={"action": asked})
        assert Wording().of(node) == "reaching (in the center of cup1, with right arm)"
    asked = "Drive(x=1.1999999999999996, y=-0.0, number=3)"
    assert text_of(TaskNode("Drive", "perform", None, parameters={"action": asked})) == "x 1.2, y 0.0, number 3"
    asked = "Closing(object_acted_on=door1, to_location=pose (2.9555, -0.721, 0; -0))"
    node = TaskNode("Closing", "perform", None, parameters={"action": asked})
    assert Wording().of(node) == "closing (door1, to x 2.96 y -0.72 yaw 0.00)"


def test_the_headline_of_a_failure_has_relations_in_words() -> None:
    async def offer() -> None:
        raise ManipulationPoseUnreachable(what="in_reach_of(anna)", arm="right")

    model = model_of(Told.of(run_plan(offer).events))
    assert model["failures"][0]["headline"] == "the arm cannot reach the pose: in reach of anna, right arm"


def test_steps_that_fail_together_tell_the_reason_once() -> None:
    run = run_plan(compiled("fetch_from_cabinet"), script=Script().on("Reaching", fails=ManipulationPoseUnreachable))
    told = [text for _, _, text, kind in model_of(Told.of(run.events))["story"] if kind == "cause"]
    assert sum("cannot reach the pose" in text for text in told) == 1, told
    assert told[-1].endswith(" fails for the same reason.")


def test_a_story_tells_once_that_both_hands_have_taken_a_thing() -> None:
    told = Told.of(run_plan(fetch).events)
    for arm in ("left", "right"):
        told.add({"step": 1, "event": "belief", "revision": 1, "change": "grasped", "name": "tray1", "arm": arm})
    said = [text for _, _, text, kind in model_of(told)["story"] if kind == "belief"]
    assert said == ["The robot holds tray1."]


def test_a_step_without_a_label_is_told_by_that_of_the_plan_that_performs_it() -> None:
    node = TaskNode("Step1", "perform", None, parameters={"action": "Step1(object_acted_on=(cup1, cup2))"})
    node.children.append(TaskNode("transport", "plan", node, parameters={"iri": "http://example.org/k#Transport"}))
    labels = {"Transport": "transport a thing"}
    assert Wording(labels).of(node) == "transport a thing (cup1, cup2)"
    assert Wording({**labels, "Step1": "bring the cups"}).of(node) == "bring the cups"


def test_a_step_without_a_label_that_no_plan_performs_is_told_by_that_of_the_class_above_it() -> None:
    asked = {"action": "Step2(object_acted_on=drawer1)", "classes": ["http://example.org/k#Closing"]}
    node = TaskNode("Step2", "perform", None, parameters=asked)
    assert Wording(vocabulary={"Closing": "closing a drawer"}).of(node) == "closing a drawer (drawer1)"
    assert Wording(vocabulary={"Opening": "opening a drawer"}).of(node) == "step2 (drawer1)"


def test_a_story_tells_in_sentences_what_recoveries_decide() -> None:
    told = [text for _, _, text, _ in fetched(3)["story"]]
    assert "The step is not tried again: it has failed as often as its recovery allows." in told
    assert not [text for text in told if "used up" in text or "decides" in text]


def test_failures_that_end_a_run_together_share_the_card_of_the_innermost_cause() -> None:
    async def search() -> None:
        raise ObjectNotFound(what="cup1")

    async def fetch_in_vain() -> None:
        try:
            await par(search)
        except ObjectNotFound as failure:
            raise GraspMissed(what="cup1") from failure

    model = model_of(Told.of(run_plan(fetch_in_vain).events))
    (card,) = model["cards"]
    assert not card["recovered"]
    assert model["failures"][card["failure"]]["headline"] == "object not found: cup1"


def test_a_story_goes_by_the_trace_and_ends_with_the_plan() -> None:
    story = fetched(3)["story"]
    assert [time for time, *_ in story] == sorted(time for time, *_ in story)
    assert story[-1][3] == "closing"
    failed = [(time, text) for time, _, text, kind in story if kind == "cause"]
    assert failed[0] == (1.5, "Closing a gripper fails: the gripper closed on nothing.")


def test_notes_of_a_run_and_the_remedy_for_a_missing_part_are_in_the_page() -> None:
    async def look() -> None:
        raise MissingCapability("no camera", missing=("Camera",))

    said = note("X013", "no camera", help="trust the map")
    reasons = {"no camera": {"missing": ("Camera",)}}
    told = Told.of(run_plan(look).events)
    told.reasons.update(reasons)
    model = model_of(told, Context(notes=[said], remedies={"Camera": "trust the map"}))
    assert model["notes"] == [{"severity": "note", "code": "X013", "message": "no camera", "help": "trust the map"}]
    assert model["failures"][0]["headline"] == "trust the map"


def test_a_story_says_why_before_what_was_done_about_it() -> None:
    told = [text for _, _, text, _ in fetched(1)["story"]]
    why = told.index("Closing a gripper fails: the gripper closed on nothing.")
    assert told[0] == "The plan begins: fetch."
    assert told[why + 1] == "The step that failed is tried again."
    assert told[-1] == "The plan is done after 2.5 s."


def test_lanes_show_what_holds_a_resource_and_how_often() -> None:
    run = run_plan(compiled("serve_a_drink"))
    lanes = {lane["name"]: lane["spans"] for lane in model_of(Told.of(run.events))["lanes"]}
    base = lanes["base"]
    assert [depth for _, _, _, depth in base[:2]] == [0, 1], "a drive at a location holds the base within that"
    assert all(end is None or start <= end for spans in lanes.values() for start, end, _, _ in spans)


@plan
async def grasp_with_both() -> None:
    await par(*(partial(perform, action("ClosingAGripper"), name=name) for name in ("Left", "Right")))


def test_a_step_that_waits_says_for_what_and_who_holds_it() -> None:
    run = run_plan(grasp_with_both)
    model = model_of(Told.of(run.events))
    left, right = named(model, "gripper")
    assert left["wait"] is None
    assert (right["start"], right["wait"][0]) == (0.0, 1.0)
    assert "(held by Left)" in right["wait"][1]


def test_a_step_that_still_waits_names_what_is_held() -> None:
    run = run_plan(grasp_with_both)
    begun = [one for one in run.events if one.get("step", 0) == 0]
    _, right = named(model_of(Told.of(begun)), "gripper")
    assert (right["status"], right["wait"][0]) == ("running", None)
    assert "(held by Left)" in right["wait"][1]


def test_a_step_has_its_lines_in_plan_and_words_of_names() -> None:
    text = 'A = "x#"\n\n\nasync def serve():\n    await perform(action(A + "GraspBottle", what=1))\n'
    assert plan_source(PlanSource(text, "p.py")).lines == {"serve": 4, "GraspBottle": 5}
    assert plan_source(PlanSource("no python (", "p.py")).lines == {}
    declared = 'GRASP = action_class("x#Grasp", below="Reaching")\nawait_it = action(GRASP)\n'
    assert plan_source(PlanSource(declared, "p.py")).lines == {"Grasp": 2}
    assert words("MoveBaseToGraspPose#2") == "move base to grasp pose"
    assert words("OpenTVSet") == "open TV set"


VISIT = """
async def visit():
    await at_location(a_location(visible_from=CUP), sleep_there)
    await at_location(a_location(in_reach_of=CUP), sleep_there)
"""


@plan
async def visit() -> None:
    for relation in ("in_reach_of", "on"):
        await at_location(a_location(**{relation: an_object("Cup")}), partial(sleep, 1))


def test_a_place_has_the_line_that_names_its_relation_and_none_where_no_line_does() -> None:
    model = model_of(Told.of(run_plan(visit).events), Context(plan_source(PlanSource(VISIT, "p.py"))))
    places = {node["text"].partition("(")[0]: node.get("lines") for node in named(model, "at_location")}
    assert places == {"in_reach_of": [[0, 4, 4]], "on": None}


@pytest.mark.parametrize(
    ("target", "ends"),
    [
        (
            Target.MANCHESTER,
            ("Class: ApproachBottle", "SubClassOf: knowrob:Reaching, knowrob:toLocation value approachPose"),
        ),
        (Target.RDFXML, ("<owl:Class", "</owl:Class>")),
        (Target.TURTLE, (":ApproachBottle a owl:Class ;", "] .")),
    ],
)
def test_a_step_has_the_lines_of_its_whole_definition(tmp_path: Path, target: Target, ends: tuple[str, str]) -> None:
    text = convert(Bundled.RECIPE.find("serve_a_drink"), target).text
    file = tmp_path / "recipe"
    file.write_text(text, encoding="utf-8")
    source = recipe_source(compile_recipe(file).recipes, load(file), "recipe", text)
    rows, extent = text.splitlines(), source.extent("ApproachBottle")
    assert extent is not None
    first, last = (rows[line - 1].strip() for line in extent)
    assert (first.startswith(ends[0]), last) == (True, ends[1])


@pytest.mark.parametrize(
    ("text", "plain"),
    [
        ("[Errno 2] No such file: '/home/ada/plans/p.py'", "[Errno 2] No such file: 'p.py'"),
        (r"C:\Users\ada\p.py is gone", "p.py is gone"),
        ("a/b in http://planlang.org/kb/x.owl#Y at 1/2", "a/b in http://planlang.org/kb/x.owl#Y at 1/2"),
    ],
)
def test_texts_name_no_folder_of_this_machine(text: str, plain: str) -> None:
    assert shown(text) == plain


class Parsed(HTMLParser):
    """Elements of a page, with the texts of scripts, as a browser finds them."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[str] = []
        self.is_open = False
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.is_open = True
        self.tags.append((tag, dict(attrs)))
        self.texts.append("")

    def handle_data(self, data: str) -> None:
        if self.texts and self.is_open:
            self.texts[-1] += data

    def handle_endtag(self, tag: str) -> None:
        self.is_open = False

    def of(self, tag: str) -> Iterator[tuple[dict[str, str | None], str]]:
        yield from (
            (attributes, text) for (name, attributes), text in zip(self.tags, self.texts, strict=True) if name == tag
        )


def test_names_with_markup_stay_text() -> None:
    async def body() -> None:
        raise HandoverNotTaken(what=HOSTILE)

    run = run_plan(body)
    text = page(model_of(Told.of(run.events), Context(facts={HOSTILE: HOSTILE}, missing=(HOSTILE,))))
    assert "<script>alert" not in text
    scripts = list(Parsed(text).of("script"))
    model = json.loads(next(inside for attributes, inside in scripts if attributes.get("id") == "model"))
    assert model["missing"] == [visible(HOSTILE)]
    text.encode("utf-8")


def test_only_the_scripts_of_the_page_are_allowed_and_no_request() -> None:
    text = page(fetched(0))
    parsed = Parsed(text)
    policy = next(str(one["content"]) for one, _ in parsed.of("meta") if one.get("http-equiv"))
    assert policy.startswith("default-src 'none'; script-src 'sha256-")
    assert "unsafe" not in policy
    (run,) = [inside for attributes, inside in parsed.of("script") if not attributes]
    digest = base64.b64encode(hashlib.sha256(run.encode()).digest()).decode()
    assert f"'sha256-{digest}'" in policy
    assert not {"src", "href", "style", "onclick"} & {name for _, attributes in parsed.tags for name in attributes}
    assert re.findall(r"https?://[^\s\"'`)]+", run) == ["http://www.w3.org/2000/svg"]


def test_equal_runs_have_equal_pages() -> None:
    assert page(fetched(2)) == page(fetched(2))


def test_ten_thousand_nodes_are_told_within_a_second() -> None:
    async def step() -> None:
        await sleep(0.01)

    async def many() -> None:
        for _ in range(5000):
            await par(step)

    run = run_plan(many)
    begun = time.process_time()
    model = model_of(Told.of(run.events))
    assert len(model["nodes"]) > 10_000
    assert time.process_time() - begun < 3, "a second on an idle machine"


def test_a_run_of_explore_leaves_a_page_with_its_schedule(tmp_path: Path) -> None:
    async def main() -> list[str]:
        seen: list[str] = []

        async def left() -> None:
            await sleep(1)
            seen.append("left")

        async def right() -> None:
            await sleep(1)
            seen.append("right")

        await par(left, right)
        return seen

    with pytest.raises(ScheduleDependence) as caught:
        explore(main)
    caught.value.other.report(tmp_path / "run.html")
    scripts = Parsed((tmp_path / "run.html").read_text(encoding="utf-8")).of("script")
    model = json.loads(next(inside for attributes, inside in scripts if attributes.get("id") == "model"))
    assert model["facts"]["schedule"] == "(1,)"
    assert [one["name"] for one in model["sources"]] == ["test_page.py"]
    assert model["missing"] == ["The run was scripted: it had no world that could be shown."]
