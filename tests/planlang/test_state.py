"""States of a world are values: a change makes another one, and shares what stays equal."""

from planlang.geometry import Pose
from planlang.protocols import Configuration
from planlang.state import Hold, Matter, Portion, WorldState

CUP, PLATE = Pose((1.0, 0.0, 0.8)), Pose((1.5, 0.0, 0.8))
HERE, THERE = Configuration((0.0, 0.0, 0.0), {}), Configuration((1.0, 0.0, 0.0), {"lift": 0.2})


def test_a_state_with_a_change_shares_the_rest_with_the_one_before() -> None:
    state = WorldState({"amigo": HERE, "pr2": HERE}, {"cup": CUP, "plate": PLATE})
    changed = state.placed({"cup": PLATE, "plate": None}).with_robot("pr2", THERE)
    assert (changed.poses, state.poses) == ({"cup": PLATE}, {"cup": CUP, "plate": PLATE})
    assert (changed.robots, state.robots) == ({"amigo": HERE, "pr2": THERE}, {"amigo": HERE, "pr2": HERE})
    assert changed.matter is state.matter
    assert changed.joints is state.joints


def test_several_hands_hold_a_thing_that_was_where_the_first_took_it() -> None:
    state = WorldState({"amigo": HERE}, {"cup": CUP}, away=frozenset({"cup"}))
    right, left = Hold("right", "palm_r", CUP), Hold("left", "palm_l", PLATE)
    both = state.gripped("cup", right).placed({"cup": PLATE}).gripped("cup", left)
    assert (both.held["cup"].hands, both.held["cup"].before, both.away) == ((right, left), CUP, frozenset())
    assert both.gripped("cup", left).held["cup"].hands == (left,)
    assert not state.held


def test_what_things_hold_is_a_value() -> None:
    empty = Matter()
    full = empty.put("jug", Portion("Milk", 100.0, ("cow1",))).put("jug", Portion("Milk", 50.0, ("cow2",)))
    left, taken = full.take("jug", 60.0)
    assert (empty.total("jug"), full.total("jug"), left.total("jug")) == (0.0, 150.0, 90.0)
    assert taken == [Portion("Milk", 60.0, ("cow1", "cow2"))]
    none, _ = left.take("jug", 1000.0)
    assert none == empty
    sour = left.turned_into("jug", "Milk", "SourMilk")
    assert list(sour.contents["jug"]) == ["SourMilk"]
    assert Matter.of(sour.snapshot(), ["jug"]) == sour


def test_what_is_destroyed_holds_nothing_and_has_no_state() -> None:
    matter = Matter().put("pan", Portion("Dough", 20.0)).switched("pan", "Mixed").created("cake", ["pan"])
    gone = matter.destroyed("pan")
    assert (gone.total("pan"), gone.states, list(gone.gone)) == (0.0, {}, ["pan"])
    assert gone.origins == {"cake": ("pan",)}
