"""Exploring a room: what is seen is kept, views end, and what a step makes by itself need not be defined."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from executive.belief.explored_space import CELL, FREE, SURFACE, UNKNOWN, ExploredSpace
from planlang import perform
from planlang.compiler import compile_recipe
from planlang.designators import FixedPose, a_pose, a_posture, action
from planlang.diagnostics import BadInput
from planlang.failures import PerceptionFailure
from planlang.geometry import Array, Pose
from planlang.runs.codec import dump, load
from sim import Body
from tests.executive.conftest import MakeStage, Stage
from tests.support.examples import examples

ROOM = Body("room", Pose((0.0, 0.0, 1.3)), (3.5, 3.0, 2.6), "room", type="RoomInAConstruction")
SHELF = Body("shelf", Pose((1.3, 0.9, 0.4)), (0.4, 0.8, 0.8), type="Cabinet-PieceOfFurniture")
CUP = Body("cup", Pose((1.3, 0.9, 0.86)), (0.09, 0.09, 0.12), "cylinder", type="Cup", movable=True)
BOUNDS = (-1.75, -1.5, 1.75, 1.5)
NEXT = a_posture("next-best-pose")
EXPLORE = action("EnvironmentExploration", to_location=NEXT, outputs_created="finished")
CHECK = action("CheckingWhetherConditionObtains", object_acted_on="finished")


@pytest.fixture
def stage(make_stage: MakeStage) -> Stage:
    """A small room of which the robot knows the walls alone."""
    made = make_stage(ROOM, SHELF, CUP, bounds=BOUNDS)
    state = made.belief.snapshot()
    made.belief.restore({**state, "belief": {**state["belief"], "unknown": ["shelf", "cup"]}})
    made.platform.observe()
    return made


@pytest.mark.long
def test_an_exploration_ends_and_has_seen_the_room_with_what_is_in_it(stage: Stage) -> None:
    async def plan() -> None:
        await perform(EXPLORE)
        while not await perform(CHECK):
            await perform(action("Translation-LocationChange", to_location=NEXT))
            await perform(EXPLORE)

    stage.run(plan, steps=20_000)
    assert {"shelf", "cup"} <= set(stage.belief.names())
    space = stage.platform.scene.space
    assert space is not None
    assert (space.cells == UNKNOWN).mean() < 0.2


def test_with_its_modules_stopped_nothing_is_explored(stage: Stage) -> None:
    async def plan() -> None:
        await perform(action("StopExplorationModules"))
        await perform(EXPLORE)

    with pytest.raises(PerceptionFailure, match="stopped"):
        stage.run(plan)


def test_the_origin_is_the_pose_that_is_stated_or_off_the_map_where_exploring_began(stage: Stage) -> None:
    platform = stage.platform
    assert platform.base_at(a_pose(x=9.0, y=0.0)) == (9.0, 0.0, 0.0)
    stage.truth.set_configuration(stage.truth.configuration().__class__((0.5, 0.25, 0.0), {}))
    platform.observe()
    assert platform.exploration.origin == (0.5, 0.25, 0.0)
    assert platform.base_at(a_pose(x=0.0, y=0.0)) == (0.0, 0.0, 0.0)
    assert platform.base_at(a_pose(x=9.0, y=0.0)) == pytest.approx((9.5, 0.25, 0.0))


def test_the_camera_scans_surfaces_where_they_are(stage: Stage) -> None:
    camera = stage.platform.robot.camera
    assert camera is not None
    ends, hit = stage.truth.scan(camera.link)
    assert hit.any()
    walls = [np.abs(ends[hit][:, 0] - 1.75), np.abs(ends[hit][:, 2]), np.abs(np.abs(ends[hit][:, 1]) - 1.5)]
    on_something = np.min(walls, axis=0) < 0.01
    assert on_something.mean() > 0.6, "most of what is ahead are walls and floor"


points = st.tuples(st.floats(-1.7, 1.7), st.floats(-1.4, 1.4), st.floats(0.05, 1.9))


@settings(max_examples=examples(50), deadline=None)
@given(st.lists(points, min_size=1, max_size=20), points)
def test_cells_of_surfaces_stay_such_and_cells_before_them_become_free(ends: list[Array], eye: Array) -> None:
    space = ExploredSpace(BOUNDS)
    hits = np.array(ends)
    for end in hits:  # one picture after another
        space.integrate(np.array(eye), end[None], np.array([True]))
    cells, inside = space.index(hits)
    assert inside.all()
    assert (space.cells[tuple(cells.T)] == SURFACE).all()
    assert not (set(map(tuple, space.frontier(1).round(6))) & set(map(tuple, space.centres(cells).round(6))))


def test_what_pictures_failed_to_show_is_no_frontier_any_more() -> None:
    space = ExploredSpace(BOUNDS)
    space.free_disc((0.0, 0.0), 0.5)
    assert (space.cells == FREE).any()
    frontier = space.frontier(2)
    assert len(frontier)
    space.give_up(frontier)
    assert len(space.frontier(2)) == len(frontier)
    space.give_up(frontier)
    assert not len(space.frontier(2))
    assert np.abs(frontier[:, :2]).max() < 0.5 + 2 * CELL


def test_a_pose_is_a_value_that_traces_keep() -> None:
    pose = a_pose("origin", x=1.0, y=-2.0, yaw=0.5)
    assert load(json.loads(json.dumps(dump(pose)))) == pose
    assert isinstance(pose, FixedPose)
    with pytest.raises(ValueError, match="finite"):
        a_pose(x=float("nan"), y=0.0)


RECIPE = """Prefix: : <http://example.org/r.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://example.org/r.owl>
Class: Explore
    SubClassOf: knowrob:PurposefulAction, knowrob:subAction some Look, knowrob:subAction some Go,
        knowrob:orderingConstraints value lookThenGo
Individual: lookThenGo
    Types: knowrob:PartialOrdering-Strict
    Facts: knowrob:occursBeforeInOrdering Look, knowrob:occursAfterInOrdering Go
Class: Look
    SubClassOf: knowrob:{looking}, knowrob:toLocation value nextView
Class: Go
    SubClassOf: knowrob:Translation-LocationChange, knowrob:toLocation value nextView
"""


def test_what_an_action_of_the_class_makes_is_defined_by_the_step(tmp_path: Path) -> None:
    file = tmp_path / "r.omn"
    file.write_text(RECIPE.format(looking="EnvironmentExploration"))
    assert "nextView" in compile_recipe(file).source


def test_a_place_that_no_step_makes_is_refused_as_before(tmp_path: Path) -> None:
    file = tmp_path / "r.omn"
    file.write_text(RECIPE.format(looking="LookingForSomething"))
    with pytest.raises(BadInput) as refused:
        compile_recipe(file)
    assert "R033" in {one.code for one in refused.value.diagnostics}
