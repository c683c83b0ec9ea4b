"""Where another robot drives, the base looks for it, believes it where it was last seen, and keeps clear of it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from executive.modules.giving_way import Lookout
from executive.runs.options import Outcome
from executive.runs.plan_run import run_plan_file
from planlang import perform
from planlang.designators import action
from planlang.failures import NavigationGoalInCollision
from planlang.geometry import Pose
from sim import Body
from sim.movers import Mover
from tests.executive.conftest import BUNDLED, MakeStage, Stage
from tests.support.shared_rooms import PORTER, ROUTES, Encounters, shared_room

HERE = Pose((2.0, 0.0, 0.55))
THERE = Pose((2.0, 1.2, 0.55))
ROBOT = Body(PORTER, HERE, (0.5, 0.4, 1.1), type="Robot")
SLOW = Mover(PORTER, ((2.0, 0.0), (2.0, 0.01)), 1e-6)


@pytest.fixture
def shared(make_stage: MakeStage) -> Stage:
    """Another robot stands two metres ahead."""
    stage = make_stage(ROBOT)
    for world in (stage.truth, stage.planning):
        world.scene = replace(world.scene, movers=(SLOW,))
    return stage


def looks(stage: Stage) -> None:
    stage.run(Lookout(stage.platform).look)


def test_it_is_believed_where_it_was_last_seen(shared: Stage) -> None:
    shared.truth.set_pose(PORTER, Pose((2.2, 0.1, 0.55)))
    looks(shared)
    assert shared.belief.pose(PORTER).position == (2.2, 0.1, 0.55)
    shared.truth.set_pose(PORTER, Pose((-3.0, 0.0, 0.55)))  # behind the robot
    shared.truth.step()
    assert shared.belief.pose(PORTER).position == (2.2, 0.1, 0.55)


def test_it_is_nowhere_where_it_is_not_seen_any_more_until_it_is_seen_again(shared: Stage) -> None:
    shared.truth.set_pose(PORTER, Pose((-3.0, 0.0, 0.55)))
    looks(shared)
    assert PORTER not in shared.belief.names()
    assert PORTER not in shared.planning.names()
    shared.truth.set_pose(PORTER, HERE)
    shared.platform.sensing.see()
    assert shared.belief.pose(PORTER) == HERE


def test_the_way_is_planned_around_one_that_stands_elsewhere_than_believed(shared: Stage) -> None:
    shared.belief.bump(PORTER, THERE)
    touched = []

    async def drive() -> None:
        await perform(action("Translation-LocationChange", x=4.0, y=0.0, yaw=0.0))

    def step() -> None:
        touched.extend(shared.truth.contacts())

    shared.run(drive)
    step()
    assert not touched
    assert shared.truth.configuration().base == pytest.approx((4.0, 0.0, 0.0), abs=0.01)
    assert shared.belief.pose(PORTER) == HERE


def test_one_that_does_not_leave_the_goal_is_waited_for_and_then_named(shared: Stage) -> None:
    async def drive() -> None:
        await perform(action("Translation-LocationChange", x=2.0, y=0.0, yaw=0.0))

    with pytest.raises(NavigationGoalInCollision) as caught:
        shared.run(drive)
    assert caught.value.blocked_by == PORTER
    assert shared.truth.steps > 10 * shared.truth.rate


def test_without_another_robot_the_head_is_free_while_the_base_drives(ward: Stage, shared: Stage) -> None:
    needs = [
        next(one for one in stage.executive.modules if one.name == "navigation").resources(
            action("Translation-LocationChange", x=1.0, y=0.0, yaw=0.0)
        )
        for stage in (ward, shared)
    ]
    assert needs == [("base",), ("base", "head")]


@pytest.mark.long
def test_a_drink_is_served_where_another_robot_crosses_the_room(tmp_path: Path) -> None:
    encounters = Encounters()
    place = shared_room(tmp_path, ROUTES[0])
    ended = run_plan_file(replace(BUNDLED, environment=place, watchers=(encounters,)))
    assert ended.outcome is Outcome.DONE, ended.message
    assert encounters.contacts == 0
    assert encounters.driven > 5.0
    learnt = [one for one in ended.trace if one["event"] == "belief" and one.get("name") == PORTER]
    assert {one["change"] for one in learnt} & {"seen", "found"}
