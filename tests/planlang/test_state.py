"""States of a world are values: a change makes another one, and shares what stays equal."""

from collections.abc import Mapping

import pytest

from planlang.changes import Change, Output, Poured, Simulated, Switched, Transformed, TurnedOver
from planlang.geometry import Pose
from planlang.protocols import Configuration
from planlang.state import Hold, Made, Matter, Portion, WorldState, apply, flow, warm
from planlang.state.matter import ON, Heating, Rules
from planlang.state.questions import type_of

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


class Flat:
    """A world without geometry: everything lies on the table, and nothing has a place of its own."""

    rules = Rules()
    kinds: Mapping[str, Made] = {
        "jug": Made("Jug", (0.1, 0.1, 0.2), CUP),
        "egg": Made("Egg", (0.05, 0.05, 0.05), CUP),
        "table": Made("Table", (1.0, 1.0, 0.7), CUP),
    }

    def thing(self, name: str) -> Made | None:
        return self.kinds.get(name)

    def pose(self, state: WorldState, name: str) -> Pose:
        return state.poses[name]

    def under(self, state: WorldState, name: str) -> str | None:
        return "table"

    def below(self, state: WorldState, point: tuple[float, float, float], but: str) -> tuple[str | None, float]:
        return "table", 0.7

    def rest(self, state: WorldState, name: str) -> Pose | None:
        return None

    def heated_by(self, state: WorldState, name: str) -> tuple[str, bool] | None:
        return ("table", False) if name == "egg" else None


START = WorldState({}, dict.fromkeys(Flat.kinds, CUP), matter=Matter().put("jug", Portion("Milk", 100.0, ("cow1",))))
CRACKED = Transformed((("egg", 0.0),), (), (Output("yolk", "Yolk", 20.0), Output("shell", "Shell", None)), None)


def test_a_change_makes_a_state_without_touching_the_one_before() -> None:
    after, flowed = apply(CRACKED, START, Flat())
    assert (flowed, list(after.made), after.matter.went_into("yolk")) == (0.0, ["yolk", "shell"], ("egg",))
    assert ("egg" in after.poses, "egg" in START.poses, START.made) == (False, True, {})
    assert (START.changes, after.changes) == (0, 1)
    assert apply(CRACKED, START, Flat())[0].made == after.made, "the same again"


def test_what_there_is_not_changes_nothing() -> None:
    gone, _ = apply(CRACKED, START, Flat())
    for change in (CRACKED, TurnedOver("egg"), Poured("egg", "jug", 5.0), Poured("jug", "egg", 5.0)):
        assert apply(change, gone, Flat()) == (gone, 0.0)


def test_what_is_poured_is_what_is_there() -> None:
    after, flowed = apply(Poured("jug", "table", 150.0), START, Flat())
    assert (flowed, after.matter.total("jug"), after.matter.total("Milk_on_table")) == (100.0, 0.0, 100.0)
    again, flowed, below = flow(START, "jug", 30.0, (0.0, 0.0, 1.0), Flat())
    assert (flowed, below, again.matter.total("Milk_on_table"), again.changes) == (30.0, "table", 30.0, 0)


def test_only_what_is_on_heats() -> None:
    assert warm(START, 5.0, Flat()) is START
    flat = Flat()
    flat.rules = Rules((Heating(("Egg",), "FriedEgg", ("Table",), 8.0),))
    state, _ = apply(Switched("table", ON), START, flat)
    once = warm(state, 5.0, flat)
    assert (once.matter.heated, type_of(once, "egg", flat)) == ({"egg": (5.0, 0.0)}, "Egg")
    assert type_of(warm(once, 5.0, flat), "egg", flat) == "FriedEgg"


PHYSICS = Simulated({"jug": 70.0, "cup": 5.0}, {"cake": 2}, {"stove": 1})


@pytest.mark.parametrize(
    ("change", "left"),
    [
        (Poured("jug", "table", 50.0), Poured("jug", "table", 10.0)),
        (Poured("jug", "table", 30.0), None),
        (Poured("bottle", "table", 30.0), Poured("bottle", "table", 30.0)),
        (TurnedOver("cake"), None),
        (TurnedOver("egg"), TurnedOver("egg")),
        (Switched("stove", ON), None),
        (Switched("lamp", ON), Switched("lamp", ON)),
        (CRACKED, CRACKED),
    ],
)
def test_a_declared_effect_adds_what_physics_has_not_done_since(change: Change, left: Change | None) -> None:
    assert PHYSICS.left_of(change, Simulated({"jug": 30.0, "cup": 5.0}, {"cake": 1})) == left
    assert PHYSICS.left_of(change, PHYSICS) == change
