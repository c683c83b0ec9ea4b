"""Changes that classes of actions make, as the vocabulary and files of users declare it."""

from collections.abc import Callable
from pathlib import Path

import pytest

from planlang.diagnostics import BadInput
from planlang.effects import Effects, effects_of, heat_effects, number_of_class
from planlang.ontology import Ontology, expand, load, shorten

HEADER = """
Prefix: : <http://example.org/tea.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://example.org/tea.owl>
"""
TEA = "http://example.org/tea.owl#"
Write = Callable[[str], Ontology]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def written(text: str) -> Ontology:
        path = tmp_path / "tea.omn"
        path.write_text(HEADER + text, encoding="utf-8")
        return load(path)

    return written


def short(classes: tuple[str, ...]) -> set[str]:
    return set(map(shorten, classes))


def test_cracking_destroys_the_egg_and_creates_shell_and_yolk(write: Write) -> None:
    effects = effects_of(write(""), expand("Cracking"))
    assert short(effects.destroyed) == {"Egg-Chickens"}
    assert short(effects.created) == {"Eggshell", "EggYolk-Food"}


def test_effects_hold_for_classes_below_and_not_above(write: Write) -> None:
    ontology = write("Class: PourTea\n    SubClassOf: knowrob:PouringSomethingOnto\n")
    assert effects_of(ontology, TEA + "PourTea") == Effects(flow_rate=20.0, amount=50.0)
    assert not effects_of(ontology, expand("Action"))
    assert short(effects_of(ontology, expand("TurningOnHeatingDevice")).states) == {"DeviceStateOn"}


def test_a_nearer_amount_and_a_narrower_output_replace_what_is_farther_and_wider(write: Write) -> None:
    ontology = write(
        "Class: Batter\n    SubClassOf: knowrob:Dough\n"
        "Class: MixBatter\n    SubClassOf: knowrob:Mixing\n"
        "Class: PourTea\n    SubClassOf: knowrob:Pouring\n"
        "Individual: one\n    Types: knowrob:ObjectChange\n"
        "    Facts: knowrob:byAction MixBatter, knowrob:outputsCreated Batter\n"
        "Individual: two\n    Types: knowrob:ObjectChange\n    Facts: knowrob:byAction PourTea, knowrob:amount 200\n"
    )
    mixing = effects_of(ontology, TEA + "MixBatter")
    assert mixing.created == (TEA + "Batter",)
    assert short(mixing.destroyed) == {"FoodOrDrinkOrIngredient"}
    assert effects_of(ontology, TEA + "PourTea") == Effects(flow_rate=20.0, amount=200.0)


def test_heat_makes_pancakes_of_dough_on_a_pancake_maker_after_a_minute(write: Write) -> None:
    pancakes = [effect for effect in heat_effects(write("")) if shorten(effect.output) == "Pancake"]
    assert [(short(one.inputs), short(one.devices), one.duration) for one in pancakes] == [
        ({"Dough", "MixForBakedGoods"}, {"PancakeMaker", "StoveTop"}, 60.0)
    ]


def test_the_nearest_class_with_a_number_states_it(write: Write) -> None:
    ontology = write("")
    assert number_of_class(ontology, [expand("DrinkingMug")], "capacity") == 300.0
    assert number_of_class(ontology, [expand("OmelettePan")], "capacity") == 0.0
    assert number_of_class(ontology, [expand("Table-PieceOfFurniture")], "capacity") is None


@pytest.mark.parametrize("value", ["-1.0", '"INF"^^<http://www.w3.org/2001/XMLSchema#double>', '"much"', "Much"])
def test_what_is_no_amount_is_refused_at_its_line(write: Write, value: str) -> None:
    frame = "Individual: one\n    Types: knowrob:ObjectChange\n    Facts: knowrob:byAction knowrob:Pouring,\n"
    ontology = write(f"{frame}        knowrob:amount {value}\n")
    with pytest.raises(BadInput) as refused:
        effects_of(ontology, expand("Pouring"))
    (problem,) = refused.value.diagnostics
    assert problem.span is not None
    assert problem.span.line == 8
    assert "amount" in problem.message
