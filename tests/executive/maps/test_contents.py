"""Contents, vessels and running devices of maps."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from executive.maps import SemanticMap, scene_of
from planlang.diagnostics import Diagnostic
from planlang.state.matter import Portion

Write = Callable[..., str]
Read = Callable[..., SemanticMap]

CUP = ("cup1", "Cup", (0.08, 0.08, 0.1))


def inside(name: str, cls: str, container: str, *facts: str) -> str:
    """The frame of a content of a vessel."""
    stated = ", ".join(f"knowrob:{fact}" for fact in (f"in-ContGeneric {container}", *facts))
    return f"Individual: {name}\n    Types: knowrob:{cls}\n    Facts: {stated}\n"


def test_an_object_without_a_pose_inside_a_vessel_is_its_content(map_of: Read, thing: Write, seen: Write) -> None:
    found: list[Diagnostic] = []
    mix = inside("mix1", "PancakeMix", "cup1", "amount 200.0")
    scene = scene_of(map_of(thing(*CUP), seen("cup1", (1, 0, 0.05)), mix), found)
    assert [body.name for body in scene.bodies] == ["cup1"]
    assert scene.body("cup1").content == (Portion("PancakeMix", 200.0, ("mix1",)),)
    assert "M012" not in [one.code for one in found]


@pytest.mark.parametrize(("amount", "unit", "content"), [("0.25", "Liter", 250.0), ("1", "CupUS", 236.5882365)])
def test_an_amount_in_any_unit_of_volume_is_in_millilitres(
    map_of: Read, thing: Write, seen: Write, amount: str, unit: str, content: float
) -> None:
    milk = inside("milk1", "Milk", "cup1", f'amount "{amount}"^^<http://qudt.org/vocab/unit#{unit}>')
    scene = scene_of(map_of(thing(*CUP), seen("cup1", (1, 0, 0.05)), milk))
    assert scene.body("cup1").content == (Portion("Milk", content, ("milk1",)),)


def test_an_amount_in_a_unit_of_another_dimension_is_left_out(map_of: Read, thing: Write, seen: Write) -> None:
    found: list[Diagnostic] = []
    milk = inside("milk1", "Milk", "cup1", 'amount "5"^^<http://qudt.org/vocab/unit#Meter>')
    scene = scene_of(map_of(thing(*CUP), seen("cup1", (1, 0, 0.05)), milk), found)
    assert scene.body("cup1").content == (Portion("Milk", 100.0, ("milk1",)),)
    assert "M030" in [one.code for one in found]


@pytest.mark.parametrize(("cls", "amount"), [("EggYolk-Food", 20.0), ("CowsMilk-Product", 100.0)])
def test_an_amount_that_is_not_stated_is_that_of_the_class(
    map_of: Read, thing: Write, seen: Write, cls: str, amount: float
) -> None:
    scene = scene_of(map_of(thing(*CUP), seen("cup1", (1, 0, 0.05)), inside("it", cls, "cup1")))
    assert scene.body("cup1").content == (Portion(cls, amount, ("it",)),)


def test_vessels_hold_what_they_or_their_class_state_and_at_least_their_content(
    map_of: Read, thing: Write, seen: Write
) -> None:
    frames = [
        thing(*CUP, "capacity 90.0"),
        thing("mug1", "DrinkingMug", (0.08, 0.08, 0.1)),
        thing("bowl1", "Bowl-Mixing", (0.2, 0.2, 0.1)),
        thing("table1", "KitchenTable", (1, 1, 0.7)),
        inside("milk1", "Milk", "bowl1", "amount 5000.0"),
    ]
    names = ("cup1", "mug1", "bowl1", "table1")
    scene = scene_of(map_of(*frames, *(seen(name, (i, 0, 0.35)) for i, name in enumerate(names))))
    assert [scene.body(name).capacity for name in names] == [90.0, 300.0, 5000.0, 0.0]


def test_a_map_states_which_devices_are_on(map_of: Read, thing: Write, seen: Write) -> None:
    frames = [
        thing("maker1", "PancakeMaker", (0.3, 0.3, 0.1), "stateOfObject knowrob:DeviceStateOn"),
        thing("stove1", "StoveTop", (0.5, 0.5, 0.01), "stateOfObject knowrob:DeviceStateOff"),
    ]
    scene = scene_of(map_of(*frames, seen("maker1", (1, 0, 0.05)), seen("stove1", (2, 0, 0.05))))
    assert [body.is_on for body in scene.bodies] == [True, False]


def test_the_rules_of_heat_are_those_of_the_ontology(map_of: Read, thing: Write, seen: Write) -> None:
    rules = scene_of(map_of(thing(*CUP), seen("cup1", (1, 0, 0.05)))).rules
    pancake = rules.result("PancakeMix", "PancakeMaker")
    assert pancake is not None
    assert (pancake.output, pancake.seconds) == ("Pancake", 60.0)
    cake = rules.result("Dough", "Oven")
    assert cake is not None
    assert (cake.output, cake.seconds) == ("Cake", 1200.0)
    bread = rules.result("Dough", "HeatingDevice")
    assert bread is not None
    assert (bread.output, bread.seconds) == ("Baked", 60.0)
    assert rules.result("PancakeMix", "Table-PieceOfFurniture") is None
    assert rules.size("Dough") == (0.14, 0.14, 0.008)
    assert rules.flow_rate == 20.0


def test_a_spatula_has_a_blade(map_of: Read, thing: Write, seen: Write) -> None:
    scene = scene_of(map_of(thing("spatula1", "Spatula"), seen("spatula1", (1, 0, 0.1))))
    assert scene.body("spatula1").blade == 0.095


def test_a_stated_mass_is_that_of_the_object_without_its_contents(map_of: Read, thing: Write, seen: Write) -> None:
    water = (
        "Individual: water1\n    Types: knowrob:Water\n    Facts: knowrob:in-ContGeneric pot1, knowrob:amount 4000.0\n"
    )
    pot = thing("pot1", "StoveTopCookingPot", (0.3, 0.3, 0.2), "massOfObject 2.4")
    body = scene_of(map_of(pot, water, seen("pot1", (0, 0, 0.1)))).body("pot1")
    assert (body.mass, [one.amount for one in body.content]) == (2.4, [4000.0])
