"""A planning world answers for any state, and is as before when it is asked about the first one again."""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import pytest

from planlang.changes import Output, Transformed
from planlang.geometry import Pose
from planlang.protocols import Configuration
from planlang.state import Hold, Matter, Portion, WorldState
from sim import PlanningWorld, WorldMirror, state_of
from tests.sim.conftest import AMIGO, GRASPING, ROOM

HAND = "grippoint_right"


@pytest.fixture
def world() -> Iterator[PlanningWorld]:
    """The furnished room."""
    world = PlanningWorld(ROOM, AMIGO)
    yield world
    world.close()


@pytest.fixture
def held(world: PlanningWorld) -> WorldState:
    """The bottle was grasped where it stands."""
    state = state_of(world, "amigo").with_robot("amigo", GRASPING)
    offset = world.link_pose(HAND, GRASPING).inverse() @ state.poses["bottle"]
    return state.gripped("bottle", Hold("right", HAND, offset))


def test_a_hypothesis_in_which_the_robot_is_elsewhere_does_not_make_a_held_thing_forget_what_it_touched(
    world: PlanningWorld, held: WorldState
) -> None:
    mirror = WorldMirror(world, "amigo")
    touched = mirror.at(held).touched_since_grasp("bottle")
    assert touched == {"cabinet"}
    known = replace(held, touched={"bottle": touched})
    mirror.at(known)
    away = known.with_robot("amigo", Configuration((0.0, 0.0, 0.0), GRASPING.joints))
    assert mirror.at(away).pose("bottle").distance(held.poses["bottle"]) > 1.0
    assert mirror.at(known).touched_since_grasp("bottle") == touched
    assert mirror.at(away).still_touched(away.robots["amigo"]) == {"bottle": frozenset()}


def test_what_happens_leads_to_another_state_and_not_to_the_one_before(world: PlanningWorld, held: WorldState) -> None:
    mirror, matter = WorldMirror(world, "amigo"), Matter().put("cup", Portion("Milk", 50.0))
    before = replace(held, held={}, matter=matter)
    change = Transformed((("cup", 50.0),), (), (Output("shards", "Shards", None),), None)
    after, flowed = mirror.after(before, partial(PlanningWorld.do, change=change))
    assert (flowed, list(after.matter.gone), "cup" in after.poses) == (0.0, ["cup"], False)
    assert {"shards"} == set(world.names()) - set(after.poses)
    assert (before.matter.total("cup"), "cup" in before.poses) == (50.0, True)
    known = replace(after, poses={**after.poses, "shards": world.pose("shards")})
    assert "shards" in mirror.at(known).names()
    again = mirror.at(before)
    assert ("shards" in again.names(), again.pose("cup"), again.changes.matter) == (False, before.poses["cup"], matter)
    assert again.pose("bottle") == Pose(before.poses["bottle"].position, before.poses["bottle"].orientation)
