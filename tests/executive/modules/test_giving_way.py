"""Where another robot drives, the base looks for it, believes it where it was last seen, and keeps clear of it."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from dataclasses import replace
from pathlib import Path

import pytest

from executive.modules.giving_way import Lookout
from executive.runs.options import Outcome
from executive.runs.plan_run import run_plan_file
from planlang import Trace, at_location, explain, par, perform, sleep
from planlang.designators import FixedPose, a_location, action, an_object
from planlang.failures import (
    LocationUnresolvable,
    NavigationGoalInCollision,
    NavigationPoseUnreachable,
    ObjectUnreachable,
)
from planlang.geometry import Pose
from sim import Body
from sim.movers import Mover
from tests.executive.conftest import BUNDLED, PLACE, MakeStage, Stage
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


WALLS = tuple(
    Body(name, Pose((2.0, side * 1.0, 0.9)), (0.4, 1.0, 1.8), type="Cupboard") for name, side in (("a", 1), ("b", -1))
)
ROOM = (-1.5, -1.5, 5.0, 1.5)
TABLE = Body("table", Pose((4.5, 0.9, 0.36)), (0.6, 0.6, 0.72), type="KitchenTable")
BOTTLE = Body("bottle", Pose((4.4, 0.9, 0.82)), (0.065, 0.065, 0.2), "cylinder", type="DrinkingBottle", movable=True)
STAYS = Mover(PORTER, ((2.0, 0.0), (3.0, 0.0)), 0.2)


@pytest.fixture
def doorway(make_stage: MakeStage) -> Stage:
    """Another robot stands in the only doorway of the room, and the bottle is behind."""
    stage = make_stage(*WALLS, TABLE, BOTTLE, ROBOT, bounds=ROOM)
    for world in (stage.truth, stage.planning):
        world.scene = replace(world.scene, movers=(STAYS,))
    return stage


async def reach() -> None:
    """Go to where the bottle is in reach."""

    async def here() -> None:
        return None

    await at_location(a_location(in_reach_of=an_object("DrinkingBottle", PLACE + "bottle")), here)


async def drive() -> None:
    await perform(action("Translation-LocationChange", x=4.0, y=0.0, yaw=0.0))


@pytest.mark.parametrize("plan", [reach, drive])
def test_one_that_leaves_the_only_way_is_waited_for(doorway: Stage, plan: Callable[[], Awaitable[None]]) -> None:
    trace = Trace()

    async def leave() -> None:
        await sleep(6.0)
        doorway.truth.set_pose(PORTER, Pose((3.2, -0.9, 0.55)))

    async def both() -> None:
        await par(plan, leave)

    doorway.run(both, trace=trace)
    assert doorway.truth.configuration().base[0] > 2.5
    assert any(one.get("name") == "Waiting" for one in trace.events) == (plan is reach)


def test_one_that_stands_in_the_only_place_is_named_rather_than_what_is_around_it(make_stage: MakeStage) -> None:
    sides = tuple(Body(name, Pose((2.2, side * 0.95, 0.9)), (1.5, 0.8, 1.8)) for name, side in (("a", 1), ("b", -1)))
    end = replace(TABLE, pose=Pose((2.7, 0.0, 0.36)), size=(0.5, 0.9, 0.72)), replace(BOTTLE, pose=Pose((2.6, 0, 0.82)))
    taken = replace(ROBOT, pose=Pose((1.95, 0.0, 0.7)), size=(0.7, 0.7, 1.4))
    stage = make_stage(*sides, *end, taken, bounds=(-1.5, -1.5, 3.0, 1.5))
    for world in (stage.truth, stage.planning):
        world.scene = replace(world.scene, movers=(STAYS,))
    with pytest.raises(LocationUnresolvable, match=f"{PORTER}, which drives by itself, is in the way where it is now"):
        next(stage.resolver.bases(a_location(in_reach_of=an_object("DrinkingBottle", PLACE + "bottle"))))


def test_a_place_that_refers_to_one_that_drives_is_not_asked_for_without_it(doorway: Stage) -> None:
    porter, bottle = (
        an_object(kind, PLACE + name) for kind, name in ((ROBOT.type, PORTER), ("DrinkingBottle", "bottle"))
    )
    location = a_location(in_reach_of=porter) & a_location(in_reach_of=bottle)
    assert doorway.resolver.waits_for(location) == ()


def test_a_wait_with_a_place_lasts_as_stated_where_nothing_else_drives(ward: Stage) -> None:
    begun = ward.truth.steps

    async def wait() -> None:
        await perform(action("Waiting", duration=5.0, to_location=FixedPose(x=1.0, y=0.0, yaw=0.0)))

    ward.run(wait)
    assert ward.truth.steps - begun >= 5 * ward.truth.rate


@pytest.mark.parametrize("plan", [reach, drive])
def test_one_that_stays_in_the_only_way_is_waited_for_and_then_named(
    doorway: Stage, plan: Callable[[], Awaitable[None]]
) -> None:
    with pytest.raises((ObjectUnreachable, NavigationPoseUnreachable)) as caught:
        doorway.run(plan)
    said = f"without {PORTER} this would work" if plan is reach else f"blocked by {PORTER}"
    assert said in explain(caught.value)
    there_and_back = 2 * STAYS.length / STAYS.speed
    assert doorway.truth.steps > (there_and_back - 1) * doorway.truth.rate


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
