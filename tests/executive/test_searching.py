"""Looking for things in several places: which comes first, what ends the search, and what is recognised at all."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from executive.belief import Belief
from executive.locations.likely_places import LOOKING
from executive.maps import read_map
from planlang import perform
from planlang.designators import Object, a_posture, action, an_object
from planlang.failures import ObjectNotFound, ObjectNowhereToBeFound, PerceptionFailure
from planlang.files import bundled
from planlang.geometry import Pose
from planlang.ontology import load
from sim import Body
from tests.executive.conftest import PLACE, MakeStage, Stage
from tests.support.cli_runs import answer

TABLE = Body("table", Pose((2.5, 0.0, 0.37)), (0.8, 1.2, 0.74), type="Table-PieceOfFurniture")
COUNTER = Body("counter", Pose((-2.5, 0.0, 0.45)), (0.6, 1.2, 0.9), type="CounterTop")
DESK = Body("desk", Pose((0.0, -4.0, 0.37)), (0.8, 0.8, 0.74), type="Desk-PieceOfFurniture")
BOTTLE = Body("bottle", Pose((0.0, -3.9, 0.84)), (0.065, 0.065, 0.2), "cylinder", type="DrinkingBottle", movable=True)
A_BOTTLE = an_object("DrinkingBottle")
LOOK = action("LookingForSomething", object_acted_on=A_BOTTLE)


@pytest.fixture
def stage(make_stage: MakeStage) -> Stage:
    """A room with three places for a bottle, of which the robot does not know that it is on the desk."""
    made = make_stage(TABLE, COUNTER, DESK, BOTTLE)
    forget(made.belief, "bottle")
    made.platform.observe()
    return made


def forget(belief: Belief, name: str) -> None:
    """Let the robot not know where a thing is."""
    state = belief.snapshot()
    belief.restore({**state, "belief": {**state["belief"], "unknown": [name]}})


def test_of_the_places_that_are_left_that_with_the_highest_likelihood_over_travel_time_is_the_next(
    stage: Stage,
) -> None:
    searches = stage.platform.searches
    likelihoods, order = {"table": 0.4, "counter": 0.3, "desk": 0.4}, []
    search = searches.begin("next", A_BOTTLE)
    while len(order) < 3:
        place = searches.next(search)
        order.append(place.name)
        assert place.likelihood == likelihoods.pop(place.name)
        assert place.worth == pytest.approx(place.likelihood / (place.seconds + LOOKING))
        for other, likelihood in likelihoods.items():
            block = stage.platform.scene.bodies.block(other)
            least = max(0.0, float(block.distance(_here(stage))[0]) - 2.5) / stage.platform.robot.base.speed
            assert place.worth >= 0.05 * likelihood / (least + LOOKING)
    assert sorted(order) == ["counter", "desk", "table"]
    with pytest.raises(ObjectNowhereToBeFound, match=", ".join(order)):
        searches.next(search)


def _here(stage: Stage) -> Any:
    return np.array([stage.platform.base()[:2]])


def test_what_is_looked_for_is_found_where_it_is_without_its_place_being_known(stage: Stage) -> None:
    pose = stage.run(lambda: perform(LOOK))
    assert pose.distance(stage.truth.pose("bottle")) < 1e-6
    assert stage.belief.pose("bottle") == pose


def test_only_places_within_the_one_that_is_named_are_looked_at(stage: Stage) -> None:
    within = action("LookingForSomething", object_acted_on=A_BOTTLE, location_searched=thing("table"))
    with pytest.raises(ObjectNowhereToBeFound, match=r"looked at: table$"):
        stage.run(lambda: perform(within))


def thing(name: str) -> Object:
    """The designator of a thing of the room."""
    return an_object("Table-PieceOfFurniture", PLACE + name)


@pytest.mark.long
def test_of_something_that_is_at_no_place_the_search_says_where_it_looked(make_stage: MakeStage) -> None:
    stage = make_stage(TABLE, COUNTER)
    with pytest.raises(ObjectNowhereToBeFound, match="table"):
        stage.run(lambda: perform(LOOK))


def test_a_robot_without_camera_does_not_explore_for_what_it_cannot_see(make_blind: MakeStage) -> None:
    stage = make_blind(BOTTLE)
    forget(stage.belief, "bottle")
    with pytest.raises(ObjectNowhereToBeFound):
        stage.run(lambda: perform(LOOK), steps=10)
    with pytest.raises(PerceptionFailure, match="camera"):
        stage.run(lambda: perform(action("EnvironmentExploration")))


def test_a_next_view_from_where_the_robot_stands_is_given_up(
    make_stage: MakeStage, monkeypatch: pytest.MonkeyPatch
) -> None:
    stage = make_stage(replace(BOTTLE, pose=Pose((-4.0, 0.0, 0.1))))
    forget(stage.belief, "bottle")
    exploration, here, missed = stage.platform.exploration, stage.platform.base(), list[Any]()
    goals = iter([here] * 3)
    monkeypatch.setattr(exploration, "gazes", lambda: iter(()))
    monkeypatch.setattr(exploration, "plan", lambda: setattr(exploration, "goal", None if missed else next(goals)))
    monkeypatch.setattr(exploration, "missed", lambda: missed.append(exploration.goal))
    with pytest.raises(ObjectNowhereToBeFound):
        stage.run(lambda: perform(LOOK))
    assert missed == [here]


def test_a_check_looks_from_here_alone_and_answers(make_stage: MakeStage) -> None:
    stage = make_stage(DESK, BOTTLE, start=(0.0, 0.0, np.pi / 2))
    forget(stage.belief, "bottle")
    check = action("CheckingWhetherConditionObtains", object_acted_on=A_BOTTLE)
    assert stage.run(lambda: perform(check)) is False
    assert stage.platform.base() == (0.0, 0.0, np.pi / 2)


@pytest.mark.long
def test_a_name_that_a_step_made_means_another_place_at_each_use(stage: Stage) -> None:
    place = a_posture("nextBestPose")
    infer = action("InferLikelyObjectLocations", object_acted_on=A_BOTTLE, outputs_created=place)
    go = action("Translation-LocationChange", to_location=place)

    async def plan() -> None:
        assert await perform(infer) == place
        for _ in range(4):
            await perform(go)
            bases.append(stage.platform.base())

    bases: list[Any] = []
    with pytest.raises(ObjectNowhereToBeFound):
        stage.run(plan)
    assert len(bases) == 3


@pytest.mark.long
def test_with_vision_stopped_nothing_is_seen_until_it_runs_again(stage: Stage) -> None:
    async def plan() -> None:
        await perform(action("StopVisionModules"))
        with pytest.raises(PerceptionFailure, match="stopped"):
            await perform(LOOK)
        await perform(action("StartVisionModules"))
        await perform(LOOK)

    stage.run(plan)


@pytest.mark.long
def test_without_a_model_of_its_class_a_thing_is_not_recognised(stage: Stage) -> None:
    memory = stage.belief.memory
    stage.belief.memory = replace(memory, recognition=replace(memory.recognition, classes=()))
    looking = action("Perceiving", object_acted_on=A_BOTTLE)

    async def plan() -> None:
        with pytest.raises(ObjectNowhereToBeFound):
            await perform(action("LookingForSomething", object_acted_on=A_BOTTLE, location_searched=thing("desk")))
        await perform(action("LoadTypicalObjectModels", models_for_place=an_object("HospitalRoom")))
        await perform(LOOK)

    with pytest.raises(ObjectNotFound):
        stage.run(lambda: perform(looking))
    stage.run(plan)


@pytest.mark.long
def test_a_plan_whose_bottle_may_be_anywhere_looks_for_it_first() -> None:
    found = answer("run", "serve_a_drink", "--unknown", "bottle1")
    assert (found["exit_code"], found["final_state"]) == (0, ["bottle1: held by patient1"]), found


def test_an_unknown_thing_that_the_map_does_not_have_is_refused() -> None:
    found = answer("run", "serve_a_drink", "--unknown", "bottel1")
    assert (found["exit_code"], found["diagnostics"][0]["code"]) == (2, "X005")


@pytest.mark.long
def test_the_map_that_is_uploaded_is_read_again_and_never_replaces_a_file_of_others(
    corpus: Path, tmp_path: Path
) -> None:
    recipe, file = corpus / "recipes" / "object-search-recipe@hydro.owl", tmp_path / "map.omn"
    words = ("run", recipe, "--robot", "amigo", "--environment", "day_room", "--unknown", "Bottle", "--upload", file)
    trace = tmp_path / "run.jsonl"
    assert answer(*words, "--trace", trace)["exit_code"] == 0
    uploaded = {one.name: one for one in read_map(load(file)).objects}
    told = {one.name: one for one in read_map(load(bundled("ontologies") / "environments" / "day_room.omn")).objects}
    assert uploaded.keys() - {"map"} == told.keys() - {"day_room"}
    for name, one in uploaded.items():
        if one.pose is not None:
            assert one.pose.distance(told[name].pose or Pose()) < 1e-6
            assert one.size == told[name].size
    assert answer("replay", trace, recipe)["equal"]
    file.write_text("my own notes")
    assert answer(*words)["diagnostics"][-1]["code"] == "C005"
