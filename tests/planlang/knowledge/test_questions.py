"""Questions as a user writes them: names without namespaces, and what is said about mistakes."""

from __future__ import annotations

import pytest

from planlang.diagnostics import BadInput, Diagnostic
from planlang.knowledge.names import Names, names_in
from planlang.knowledge.questions import LONGEST, read_question
from planlang.ontology.expression_text import text_of

NAMES = Names(names_in(["urn:a#Flask", "urn:a#Mug", "urn:b#Mug", "urn:a#holds", "urn:a#Refilling"]))


def refused(text: str) -> Diagnostic:
    with pytest.raises(BadInput) as refusal:
        read_question(text, NAMES)
    return refusal.value.diagnostics[0]


def test_names_need_no_namespace_where_only_one_thing_is_called_so() -> None:
    question = read_question("Refilling and holds some Flask", NAMES)
    first, second = question.parts
    assert (first.term, second.parts[0].term) == ("urn:a#Refilling", "urn:a#holds")
    assert text_of(question) == "Refilling and (holds some Flask)"


def test_a_name_of_several_things_is_refused_with_their_full_names() -> None:
    said = refused("holds some Mug")
    assert (said.code, said.message) == ("K002", "Mug has several meanings")
    assert said.help == "write one of <urn:a#Mug>, <urn:b#Mug>"
    assert read_question("holds some <urn:b#Mug>", NAMES).parts[1].term == "urn:b#Mug"


def test_thing_is_what_every_class_is_below_whatever_vocabularies_call_so() -> None:
    names = Names(names_in(["urn:a#Thing", "urn:b#Thing"]))
    assert read_question("Thing", names).term == "http://www.w3.org/2002/07/owl#Thing"
    assert read_question("<urn:b#Thing>", names).term == "urn:b#Thing"


def test_an_unknown_name_is_refused_with_similar_ones_where_it_stands() -> None:
    said = refused("Refilling and\n  holds some Flsk")
    assert (said.code, said.help) == ("K002", "did you mean Flask?")
    assert said.span is not None
    assert said.span.line == 2
    assert refused("holds some <urn:c#Mug>").message == "unknown name <urn:c#Mug>"


@pytest.mark.parametrize(
    "text",
    ["", "and", "Flask and", "Flask, Mug", "Flask Class: <urn:x> SubClassOf: Flask", "Flask\nIndividual: Mug",
     "(" * 5000 + "Flask" + ")" * 4999, "holds some", "Flask\x00", "B" * (LONGEST + 1)],
)  # fmt: skip
def test_what_is_no_single_expression_is_refused(text: str) -> None:
    assert refused(text).code[0] in "KO"


def test_everything_can_be_asked_for_also_where_something_else_is_called_thing() -> None:
    assert read_question("owl:Thing", Names(names_in(["urn:a#Thing"]))).term == "http://www.w3.org/2002/07/owl#Thing"


def test_a_word_of_the_vocabulary_means_what_is_known_under_it() -> None:
    names = Names(names_in(["http://www.roboearth.org/kb/roboearth.owl#RoboEarthObjRecSystem"]))
    assert read_question("RoboEarthObjRecSystem", names).term == names.of("RoboEarthObjRecSystem")[0]


@pytest.mark.parametrize("text", ["", "  \n", "refilling a flask", "Flask and ("])
def test_what_cannot_be_read_is_told_what_a_question_is_and_where_words_are_searched(text: str) -> None:
    said = refused(text)
    assert said.help is not None
    assert said.help.startswith("a question is a class expression, such as ")
    assert "file" not in said.message
