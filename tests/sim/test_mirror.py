"""A planning world answers for any state, and is as before when it is asked about the first one again."""

from collections.abc import Iterator
from dataclasses import replace

import pytest

from planlang.changes import Output, Transformed
from planlang.geometry import Pose
from planlang.protocols import Configuration
from planlang.state import Hold, Matter, Portion, WorldState, apply
from sim import PlanningWorld, WorldMirror
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
    state = world.world_state("amigo").with_robot("amigo", GRASPING)
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


def test_a_change_leads_to_another_state_and_leaves_the_one_before(world: PlanningWorld, held: WorldState) -> None:
    mirror, matter = WorldMirror(world, "amigo"), Matter().put("cup", Portion("Milk", 50.0))
    before = replace(held, held={}, matter=matter)
    change = Transformed((("cup", 50.0),), (), (Output("shards", "Shards", None),), None)
    after, flowed = apply(change, before, mirror.queries)
    assert (flowed, list(after.matter.gone), "cup" in after.poses) == (0.0, ["cup"], False)
    assert {"shards"} == after.made.keys() == after.poses.keys() - before.poses.keys()
    assert (before.matter.total("cup"), "cup" in before.poses) == (50.0, True)
    assert mirror.at(after).pose("shards") == after.poses["shards"]
    again = mirror.at(before)
    assert ("shards" in again.names(), again.pose("cup"), again.matter) == (False, before.poses["cup"], matter)
    assert again.pose("bottle") == Pose(before.poses["bottle"].position, before.poses["bottle"].orientation)


def test_two_hypotheses_may_make_different_things_of_one_name(world: PlanningWorld, held: WorldState) -> None:
    mirror, before = WorldMirror(world, "amigo"), replace(held, held={})

    def broken(name: str) -> WorldState:
        return apply(
            Transformed(((name, 0.0),), (), (Output("shards", "Shards", None),), None), before, mirror.queries
        )[0]

    cup, bottle = broken("cup"), broken("bottle")
    assert cup.made["shards"].size != bottle.made["shards"].size
    for state in (cup, bottle, cup):
        shown = mirror.at(state)
        assert shown.size("shards") == state.made["shards"].size
        assert shown.pose("shards") == state.poses["shards"]
        assert shown.support("shards") == mirror.queries.under(state, "shards")
