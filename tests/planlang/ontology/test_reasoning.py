"""Description logic on request: contradictions, explanations, bounds, and ontologies in owlready2."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from planlang.ontology import load
from planlang.ontology.reasoning import Reasoner, missing, reason, reasoner_input
from tests.support.examples import some
from tests.support.refusals import refusal

needs_reasoner = pytest.mark.skipif(missing() is not None, reason=str(missing()))

HEAD = """Prefix: : <http://example.org/towels#>
Prefix: k: <http://knowrob.org/kb/knowrob.owl#>
Prefix: unit: <http://qudt.org/vocab/unit#>

Ontology: <http://example.org/towels>

DataProperty: thickness
    Range: xsd:float

Class: Wet
    DisjointWith: Dry

Class: Dry

"""


def written(folder: Path, text: str) -> Path:
    path = folder / "towels.omn"
    path.write_text(HEAD + text, encoding="utf-8")
    return path


@pytest.mark.long
@needs_reasoner
@pytest.mark.parametrize("reasoner", some(Reasoner))
def test_contradictions_are_found_where_they_are_written_and_explained(tmp_path: Path, reasoner: Reasoner) -> None:
    text = "Class: Damp\n    SubClassOf: Wet, Dry\n\nIndividual: towel\n    Types: Wet, Dry\n"
    found = reason(load(written(tmp_path, text), builtin=False), reasoner)
    assert [(one.code, one.span.line if one.span else None) for one in found.diagnostics] == [
        ("O060", 15),
        ("O061", 18),
    ]
    unsatisfiable, inconsistent = found.diagnostics
    below, disjoint = "(towels.omn:16)", "Dry disjointWith Wet (towels.omn:11)"
    assert unsatisfiable.help == f"because Damp subClassOf Dry {below}; Damp subClassOf Wet {below}; {disjoint}"
    assert "`towel`" in inconsistent.message
    assert inconsistent.help is not None
    assert {"towel type Dry (towels.omn:19)", "towel type Wet (towels.omn:19)", disjoint} == set(
        inconsistent.help.removeprefix("because ").split("; ")
    )


@needs_reasoner
@pytest.mark.long
@pytest.mark.parametrize("reasoner", Reasoner)
def test_units_do_not_end_the_reasoner_and_what_they_say_is_not_invented(tmp_path: Path, reasoner: Reasoner) -> None:
    text = """Class: Thick
    EquivalentTo: Wet and (thickness value "2"^^unit:Centimeter)

Class: Short
    SubClassOf: Dry, thickness some unit:Meter

Individual: towel
    Types: Wet, Short2
    Facts: thickness "3"^^unit:Centimeter

Class: Short2
    SubClassOf: thickness value 0.5
"""
    found = reason(load(written(tmp_path, text), builtin=False), reasoner)
    assert {one.code for one in found.diagnostics} == {"O062"}
    assert "Centimeter, Meter" in found.diagnostics[0].message
    assert found.individuals == 1


@pytest.mark.long
@needs_reasoner
def test_what_a_reasoner_cannot_take_is_left_out_or_told(tmp_path: Path) -> None:
    text = """Datatype: Small
    EquivalentTo: unit:Meter[<= "1"^^unit:Meter]

Class: Short
    SubClassOf: thickness only {"1"^^unit:Meter, "2"^^unit:Meter}, thickness some Small

Individual: towel
    Types: Short
    Facts: thickness "thin"^^xsd:float, thickness "2020-01-01"^^xsd:date, not thickness "1"^^unit:Meter
"""
    found = reason(load(written(tmp_path, text), builtin=False))
    assert [one.code for one in found.diagnostics if one.code != "O062"] == []
    assert "'thin', Meter, Small, date" in found.diagnostics[0].message
    text = "ObjectProperty: on\n    Characteristics: Transitive\n\nClass: Pile\n    SubClassOf: on max 1 Pile\n"
    with refusal("O063", naming=("HermiT", "'<on>'")):
        reason(load(written(tmp_path, text), builtin=False))


def test_a_restriction_with_a_unit_becomes_a_class_of_which_nothing_is_known(tmp_path: Path) -> None:
    text = 'Class: Thick\n    EquivalentTo: Wet and (thickness value "2"^^unit:Centimeter)\n'
    given = reasoner_input(load(written(tmp_path, text), builtin=False))
    assert "UnreadRestriction1" in given.names
    assert "Centimeter" not in given.text()


def test_things_of_one_local_name_have_two_names(tmp_path: Path) -> None:
    text = "Class: <http://example.org/others#Wet>\n    SubClassOf: Wet\n"
    given = reasoner_input(load(written(tmp_path, text), builtin=False))
    towels = {iri for iri in given.names.values() if iri.endswith("#Wet")}
    assert towels == {"http://example.org/towels#Wet", "http://example.org/others#Wet"}


def test_without_java_it_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with refusal("O064"):
        reason(load(written(tmp_path, ""), builtin=False))


@needs_reasoner
def test_a_reasoner_that_takes_too_long_is_ended(tmp_path: Path) -> None:
    begun = time.monotonic()
    with refusal("O063", naming="reason_seconds"):
        reason(load(written(tmp_path, "")), seconds=0.2)
    assert time.monotonic() - begun < 20


def test_owlready_has_what_was_loaded_and_repaired(tmp_path: Path) -> None:
    pytest.importorskip("owlready2")
    text = 'Individual: towel\n    Types: Wet\n    Facts: thickness "2"^^unit:Centimeter\n'
    world = load(written(tmp_path, text)).to_owlready()
    towels = world.get_namespace("http://example.org/towels#")
    assert towels.towel in towels.Wet.instances()
    assert world["http://knowrob.org/kb/knowrob.owl#Bottle"].is_a
    rows = list(world.sparql("SELECT ?c { ?c rdfs:subClassOf* <http://knowrob.org/kb/knowrob.owl#Bottle> }"))
    assert len(rows) >= 2
