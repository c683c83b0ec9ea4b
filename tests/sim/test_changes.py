"""Changes that actions, heat, tilting and blades make in the true world."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from planlang.changes import Output, Switched, Transformed, TurnedOver
from planlang.geometry import Pose
from planlang.state.matter import OFF, ON, Heating, Matter, Portion, Rules
from planlang.state.questions import amount_of, came_to_be, is_baked, type_of, types_of
from sim import Body, PyBulletWorld, Scene
from sim.engine import bullet
from sim.mirror import become
from sim.truth import ROBOT
from tests.sim.conftest import AMIGO

HAND = "grippoint_right"
SMALL = (0.04, 0.04, 0.03)
HEAT = Heating(("Dough",), "Pancake", ("PancakeMaker", "StoveTop"), 2.0)
RULES = Rules((HEAT,), size=lambda cls: SMALL if cls in ("Egg", "Shell") else None)
TABLE = Body("table", Pose((1.5, 0.0, 0.375)), (0.8, 2.0, 0.75), type="Table")
MAKER = Body("maker", Pose((1.5, 0.0, 0.80)), (0.3, 0.3, 0.1), type="PancakeMaker")
BOWL = Body("bowl", Pose((1.5, 0.6, 0.80)), (0.2, 0.2, 0.1), "cylinder", type="Bowl", movable=True, capacity=100.0)
MIX = Portion("Dough", 200.0, ("flour1", "milk1"))
BOTTLE = Body(
    "bottle", Pose((1.5, -0.6, 0.85)), (0.07, 0.07, 0.2), "cylinder", "", "Bottle", movable=True, content=(MIX,),
    capacity=200.0,
)  # fmt: skip
CAKE = Body("cake", Pose((1.5, 0.0, 0.854)), (0.14, 0.14, 0.008), "cylinder", type="Dough", movable=True)
SPATULA = Body("spatula", Pose((1.5, -0.3, 0.76)), (0.08, 0.01, 0.345), type="Spatula", movable=True, blade=0.095)
UPSIDE_DOWN = (1.0, 0.0, 0.0, 0.0)
MakeKitchen = Callable[..., PyBulletWorld]


@pytest.fixture
def kitchen(request: pytest.FixtureRequest) -> MakeKitchen:
    """Makes kitchens: a table with a pancake maker, a bowl, and what else is named."""

    def make(*bodies: Body) -> PyBulletWorld:
        world = PyBulletWorld(Scene((TABLE, MAKER, BOWL, *bodies), start=(-1.0, 0.0, 0.0), rules=RULES), AMIGO)
        request.addfinalizer(world.close)
        return world

    return make


def seconds(world: PyBulletWorld, count: float) -> None:
    for _ in range(round(count * world.rate)):
        world.step()


def in_hand(world: PyBulletWorld, name: str, pose: Pose) -> None:
    """Let the hand hold a thing so that it is at a pose."""
    if name not in world.attached():
        world.attach(HAND, name)
    world.set_pose(name, pose)


# Heat


def test_what_lies_on_a_device_that_is_on_is_heated_from_below_as_long_as_it_does(kitchen: MakeKitchen) -> None:
    world = kitchen(CAKE)
    seconds(world, 1.0)
    assert world.matter.heated == {}
    world.bring_about(Switched("maker", ON))
    seconds(world, 1.5)
    world.bring_about(Switched("maker", OFF))
    seconds(world, 1.0)
    assert world.matter.heated["cake"] == pytest.approx((1.5, 0.0))
    assert type_of(world.world_state(), "cake", world.queries) == "Dough"


def test_dough_becomes_a_pancake_and_is_baked_when_both_sides_are(kitchen: MakeKitchen) -> None:
    world = kitchen(CAKE)
    world.bring_about(Switched("maker", ON))
    seconds(world, 2.0)
    assert type_of(world.world_state(), "cake", world.queries) == "Pancake"
    assert types_of(world.world_state(), "cake", world.queries) == ("Pancake", "Dough")
    assert not is_baked(world.world_state(), "cake", world.queries)
    world.bring_about(TurnedOver("cake"))
    seconds(world, 2.0)
    assert is_baked(world.world_state(), "cake", world.queries)
    assert is_baked(world.world_state(), "cake", world.queries, 2.0)
    assert not is_baked(world.world_state(), "cake", world.queries, 2.5)


def test_while_nothing_moves_no_ray_is_cast_to_find_what_heats(
    kitchen: MakeKitchen, monkeypatch: pytest.MonkeyPatch
) -> None:
    world, cast = kitchen(CAKE), []
    world.bring_about(Switched("maker", ON))
    world.step()
    original = bullet.rayTestBatch
    monkeypatch.setattr(bullet, "rayTestBatch", lambda *a, **named: cast.append(a) or original(*a, **named))
    seconds(world, 1.0)
    assert not cast
    world.set_pose("cake", Pose((1.5, 0.9, 0.754)))
    world.step()
    assert cast
    assert world.queries.heated_by(world.world_state(), "cake") is None


def test_heat_goes_through_a_pan_but_not_through_the_air(kitchen: MakeKitchen) -> None:
    pan = Body("pan", Pose((1.5, 0.0, 0.86)), (0.28, 0.28, 0.02), "cylinder", type="Skillet", movable=True)
    world = kitchen(pan, CAKE)
    world.set_pose("cake", Pose((1.5, 0.0, 0.874)))
    world.bring_about(Switched("maker", ON))
    seconds(world, 0.5)
    assert world.matter.heated["cake"][0] == pytest.approx(0.5)
    world.set_pose("cake", Pose((1.5, 0.0, 0.9)))
    seconds(world, 0.5)
    assert world.matter.heated["cake"][0] == pytest.approx(0.5)


def test_what_is_inside_of_a_device_is_heated_on_all_sides(kitchen: MakeKitchen) -> None:
    oven = Body("oven", Pose((1.5, -1.5, 0.5)), (0.6, 0.6, 0.6), type="StoveTop", is_on=True)
    world = kitchen(oven, CAKE)
    world.set_pose("cake", Pose((1.5, -1.5, 0.5)))
    seconds(world, 2.0)
    assert is_baked(world.world_state(), "cake", world.queries)


# Pouring


@pytest.mark.parametrize("tilt", [0.0, 1.0, 1.55])
def test_nothing_flows_from_a_vessel_that_is_tilted_less_than_level(kitchen: MakeKitchen, tilt: float) -> None:
    world = kitchen(BOTTLE)
    in_hand(world, "bottle", Pose((1.5, 0.0, 1.2), (math.sin(tilt / 2), 0.0, 0.0, math.cos(tilt / 2))))
    seconds(world, 1.0)
    assert amount_of(world.world_state(), "bottle", "Dough", world.queries) == 200.0


def test_what_flows_lands_on_the_thing_below_and_is_one_body_there(kitchen: MakeKitchen) -> None:
    world = kitchen(BOTTLE)
    in_hand(world, "bottle", Pose((1.5, 0.0, 1.2), UPSIDE_DOWN))
    seconds(world, 2.5)
    assert amount_of(world.world_state(), "bottle", "Dough", world.queries) == pytest.approx(150.0)
    assert amount_of(world.world_state(), "maker", "Dough", world.queries) == pytest.approx(50.0)
    assert came_to_be(world.world_state(), "Dough", world.queries) == ("Dough_on_maker", "bottle")
    assert world.matter.went_into("Dough_on_maker") == ("flour1", "milk1")
    assert world.pose("Dough_on_maker").position == pytest.approx((1.5, 0.0, 0.854), abs=1e-6)


def test_what_is_held_goes_into_a_puddle_until_heat_has_made_it_firm(kitchen: MakeKitchen) -> None:
    world = kitchen(BOTTLE)
    in_hand(world, "bottle", Pose((1.5, 0.0, 1.2), UPSIDE_DOWN))
    seconds(world, 1.0)
    in_hand(world, "bottle", Pose((1.5, 0.0, 0.952)))
    assert "Dough_on_maker" in world.names()
    assert "Dough_on_maker" not in {one.body for one in world.contacts()}
    world.bring_about(Switched("maker", ON))
    seconds(world, 3.0)
    assert "Dough_on_maker" in {one.body for one in world.contacts()}


def test_a_vessel_below_takes_what_it_holds_and_the_rest_lies_beside(kitchen: MakeKitchen) -> None:
    world = kitchen(BOTTLE)
    in_hand(world, "bottle", Pose((1.5, 0.6, 1.2), UPSIDE_DOWN))
    seconds(world, 12.0)
    assert amount_of(world.world_state(), "bowl", "Dough", world.queries) == pytest.approx(100.0)
    assert amount_of(world.world_state(), "table", "Dough", world.queries) == pytest.approx(100.0)
    assert "bottle" not in world.matter.contents


@given(amounts=st.lists(st.floats(0.0, 90.0), max_size=6))
def test_taking_keeps_the_amount_and_the_shares_of_a_mixture(amounts: list[float]) -> None:
    full = matter = Matter().put("bowl", Portion("Milk", 150.0, ("milk1",))).put("bowl", Portion("Flour", 50.0))
    taken = list[Portion]()
    for amount in amounts:
        matter, portions = matter.take("bowl", amount)
        taken += portions
    assert full.total("bowl") == 200.0, "a value stays as it is"
    milk, flour = (sum(one.amount for one in taken if one.type == type) for type in ("Milk", "Flour"))
    assert milk == pytest.approx(3 * flour)
    assert matter.total("bowl") + milk + flour == pytest.approx(200.0)
    assert milk + flour == pytest.approx(min(200.0, sum(amounts)))


# Blades


def test_a_blade_that_rises_under_a_pancake_and_turns_over_turns_it(kitchen: MakeKitchen) -> None:
    world = kitchen(CAKE, SPATULA)
    # the longest axis, z of the box, points forward, the shortest, y, up
    level = Pose((1.375, 0.0, 0.852), (0.5, 0.5, 0.5, 0.5))
    in_hand(world, "spatula", level)
    seconds(world, 0.1)
    for height in range(1, 11):
        in_hand(world, "spatula", Pose((1.375, 0.0, 0.852 + 0.01 * height), level.orientation))
        world.step()
    assert world.pose("cake").position[2] == pytest.approx(0.954, abs=0.011)
    over = Pose((1.375, 0.0, 0.952)) @ Pose((0.0, 0.0, 0.0), UPSIDE_DOWN) @ Pose((0.0, 0.0, 0.0), level.orientation)
    in_hand(world, "spatula", over)
    seconds(world, 1.0)
    assert world.pose("cake").rotation[2, 2] == pytest.approx(-1.0)
    assert world.pose("cake").position[2] == pytest.approx(0.854)


def test_a_blade_that_rises_elsewhere_or_over_a_pancake_leaves_it(kitchen: MakeKitchen) -> None:
    world = kitchen(CAKE, SPATULA)
    for place in ((1.0, 0.0, 0.852), (1.375, 0.0, 0.9)):
        for height in range(5):
            in_hand(world, "spatula", Pose((*place[:2], place[2] + 0.01 * height), (0.5, 0.5, 0.5, 0.5)))
            world.step()
    assert world.pose("cake") == CAKE.pose


def test_what_a_blade_carried_is_left_as_the_blade_left_it(kitchen: MakeKitchen) -> None:
    world = kitchen(CAKE, SPATULA)
    began = world.simulated
    for height in range(5):
        in_hand(world, "spatula", Pose((1.375, 0.0, 0.852 + 0.01 * height), (0.5, 0.5, 0.5, 0.5)))
        world.step()
    assert not world.bring_about(TurnedOver("cake"), began)
    assert world.pose("cake").rotation[2, 2] == pytest.approx(1.0)
    assert world.bring_about(TurnedOver("cake"), world.simulated), "an action that begins now"
    assert world.pose("cake").rotation[2, 2] == pytest.approx(-1.0)


# What is created and destroyed


def cracked(world: PyBulletWorld) -> None:
    world.bring_about(Transformed((("bottle", 200.0),), (), (Output("Shell_1", "Shell", None),), None))


def test_what_is_destroyed_is_gone_and_what_is_created_rests_on_what_is_below(kitchen: MakeKitchen) -> None:
    world = kitchen(BOTTLE)
    cracked(world)
    assert "bottle" not in world.names()
    assert "Shell_1" in world.names()
    assert world.pose("Shell_1").position == pytest.approx((1.5, -0.6, 0.765))
    assert world.support("Shell_1") == "table"


def test_an_egg_cracked_in_the_hand_leaves_its_shell_below_the_hand(kitchen: MakeKitchen) -> None:
    world = kitchen(BOTTLE)
    in_hand(world, "bottle", Pose((1.5, 0.0, 1.2)))
    cracked(world)
    assert (dict(world.attached()), world.support("Shell_1")) == ({}, "maker")


def test_the_state_of_the_world_is_a_value_that_later_changes_leave_alone(kitchen: MakeKitchen) -> None:
    world = kitchen(BOTTLE)
    before = world.world_state()
    cracked(world)
    after = world.world_state()
    assert ("bottle" in before.poses, "Shell_1" in before.poses, list(before.made)) == (True, False, [])
    assert ("bottle" in after.poses, "Shell_1" in after.poses, list(after.made)) == (False, True, ["Shell_1"])
    assert after.changes == before.changes + 1


def test_a_thing_that_came_into_being_is_held_and_let_go_like_others(kitchen: MakeKitchen) -> None:
    world = kitchen()
    world.bring_about(Transformed((), (), (Output("Egg_1", "Egg", None),), "bowl"))
    in_hand(world, "Egg_1", Pose((1.5, 0.0, 1.2)))
    world.release("Egg_1")
    seconds(world, 1.0)
    assert world.support("Egg_1") == "maker"
    assert world.pose("Egg_1").position[2] == pytest.approx(0.865)


def test_a_world_that_begins_in_the_state_of_another_goes_on_as_that_one(kitchen: MakeKitchen) -> None:
    first, second = kitchen(BOTTLE, CAKE), kitchen(BOTTLE, CAKE)
    in_hand(first, "bottle", Pose((1.5, 0.3, 1.2), UPSIDE_DOWN))
    first.bring_about(Switched("maker", ON))
    seconds(first, 1.0)
    become(second, ROBOT, first.world_state())
    for world in (first, second):
        seconds(world, 1.5)
    one, other = first.world_state(), second.world_state()
    assert (one.matter, one.made, one.touched, one.changes) == (other.matter, other.made, other.touched, other.changes)
    assert one.held.keys() == other.held.keys() == {"bottle"}
    assert all(one.poses[name].distance(other.poses[name]) < 1e-9 for name in one.poses)
    assert "Dough_on_table" in one.made
    assert one.matter.heated["cake"] == pytest.approx((2.5, 0.0))
