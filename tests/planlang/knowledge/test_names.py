"""Names that may be asked for, and names like a misspelt one."""

from __future__ import annotations

import time

import pytest

from planlang.diagnostics import BadInput
from planlang.files import bundled
from planlang.knowledge.names import Names, names_in
from planlang.knowledge.questions import MOST_UNKNOWN, read_question
from planlang.ontology import load

LONG = ",".join(f"unknown{number}" for number in range(800))


@pytest.fixture(scope="module")
def names() -> Names:
    """KnowRob's names, and 20,000 that entries define."""
    found = load(bundled("ontologies") / "knowrob.omn")
    own = (f"urn:entry{number}#ServeADrink{number}" for number in range(20_000))
    vocabulary = names_in(term for term in found.store.terms if isinstance(term, str) and found.is_class(term))
    return Names(vocabulary, names_in(own))


@pytest.mark.parametrize(
    ("typo", "meant"),
    [
        ("DrinkingBotle", "DrinkingBottle"),
        ("drinkingbottle", "DrinkingBottle"),
        ("ServingFoodOrDrnk", "ServingFoodOrDrink"),
        ("Spatula_", "Spatula"),
        ("Cpu", "Cup"),
        ("ServeADrink1234x", "ServeADrink1234"),
    ],
)
def test_the_names_most_like_a_misspelt_one_are_found_among_many(names: Names, typo: str, meant: str) -> None:
    assert names.similar(typo)[0] == meant


def test_a_question_of_unknown_names_costs_little_however_many_names_there_are(names: Names) -> None:
    names.similar("first")  # which makes the index
    began = time.thread_time()
    for text in ("{" + LONG + "}", "x" * 9000, " or ".join(["ServeADrinkxyz"] * 600)):
        with pytest.raises(BadInput) as refused:
            read_question(text, names)
        assert len(refused.value.diagnostics) <= MOST_UNKNOWN + 1
        assert all(len(one.message) < 200 for one in refused.value.diagnostics)
    assert time.thread_time() - began < 1.0, "without an index and bounds it took 15 s"


def test_a_name_that_is_added_is_known_and_found_from_then_on() -> None:
    names = Names({"Cup": ["urn:a#Cup"]})
    assert names.similar("Mugg") == []
    for iri in ("urn:b#Mug", "urn:c#Mug", "urn:c#Mug", "urn:c#Cup"):
        names.add(iri)
    assert (names.of("Mug"), names.of("Cup")) == (("urn:b#Mug", "urn:c#Mug"), ("urn:a#Cup",))
    assert (names.similar("Mugg"), names.like("mu", 3)) == (["Mug"], ("Mug",))
