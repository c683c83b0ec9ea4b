"""An axiom with a comment means the axiom: what repeats it, in any syntax, states nothing of its own."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from planlang.compiler import compile_recipe
from planlang.diagnostics import BadInput

HEAD = """\
@prefix : <http://example.org/tidy#> .
@prefix k: <http://knowrob.org/kb/knowrob.owl#> .
@prefix owl: <http://www.w3.org/2002/07/owl#> .
@prefix rdf: <http://www.w3.org/1999/02/22-rdf-syntax-ns#> .
@prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .
<http://example.org/tidy> a owl:Ontology .
"""
TIDY = """
:Tidy a owl:Class ; rdfs:subClassOf k:PurposefulAction,
    [ a owl:Restriction ; owl:onProperty k:subAction ; owl:someValuesFrom :Take ],
    [ a owl:Restriction ; owl:onProperty k:subAction ; owl:someValuesFrom :Put ],
    [ a owl:Restriction ; owl:onProperty k:orderingConstraints ; owl:hasValue :TakeFirst ] .
"""
REST = """
:Take a owl:Class ; rdfs:subClassOf k:PickingUpAnObject,
    [ a owl:Restriction ; owl:onProperty k:objectActedOn ; owl:hasValue :cup1 ] .
:Put a owl:Class ; owl:equivalentClass [ a owl:Class ; owl:intersectionOf ( k:PuttingDownAnObject
    [ a owl:Restriction ; owl:onProperty k:objectActedOn ; owl:hasValue :cup1 ]
    [ a owl:Restriction ; owl:onProperty k:toLocation ; owl:hasValue :onTheTable ] ) ] .
:TakeFirst a k:PartialOrdering-Strict ; k:occursBeforeInOrdering :Take ; k:occursAfterInOrdering :Put .
:cup1 a k:Cup .
:table1 a k:Table-PieceOfFurniture .
:onTheTable a k:Point3D ; k:on-Physical :table1 .
"""
PLAIN = HEAD + TIDY + REST
OF_STEP = """ owl:annotatedSource :Tidy ; owl:annotatedProperty rdfs:subClassOf ; owl:annotatedTarget
    [ a owl:Restriction ; owl:onProperty k:subAction ; owl:someValuesFrom :Take ] ; rdfs:comment "agreed" ] ."""

ANNOTATED = {
    "a restriction above a class": f"[ a owl:Axiom ; {OF_STEP}",
    "a node that is typed as nothing else but used as an annotation": f"[ a owl:Annotation ; {OF_STEP}",
    "an annotation of the annotation": f"_:a a owl:Axiom ; {OF_STEP.removesuffix(' ] .')} ."
    """[ a owl:Annotation ; owl:annotatedSource _:a ; owl:annotatedProperty rdfs:comment ;
        owl:annotatedTarget "agreed" ; rdfs:seeAlso <http://example.org/minutes> ] .""",
    "two annotations of one axiom": f"[ a owl:Axiom ; {OF_STEP} [ a owl:Axiom ; {OF_STEP}",
    "an equivalent class": """[ a owl:Axiom ; owl:annotatedSource :Put ; owl:annotatedProperty owl:equivalentClass ;
        owl:annotatedTarget [ a owl:Class ; owl:intersectionOf ( k:PuttingDownAnObject
            [ a owl:Restriction ; owl:onProperty k:objectActedOn ; owl:hasValue :cup1 ]
            [ a owl:Restriction ; owl:onProperty k:toLocation ; owl:hasValue :onTheTable ] ) ] ;
        rdfs:comment "why" ] .""",
    "a class assertion": """[ a owl:Axiom ; owl:annotatedSource :cup1 ; owl:annotatedProperty rdf:type ;
        owl:annotatedTarget k:Cup ; rdfs:comment "the red one" ] .""",
    "a fact": """[ a owl:Axiom ; owl:annotatedSource :TakeFirst ; owl:annotatedProperty k:occursBeforeInOrdering ;
        owl:annotatedTarget :Take ; rdfs:comment "why" ] .""",
    "a named superclass": """[ a owl:Axiom ; owl:annotatedSource :Take ; owl:annotatedProperty rdfs:subClassOf ;
        owl:annotatedTarget k:PickingUpAnObject ; rdfs:comment "why" ] .""",
    "disjoint classes": """[ a owl:AllDisjointClasses ; owl:members ( :Take :Put ) ; rdfs:comment "never one" ] .""",
    "a reified statement": """[ a rdf:Statement ; rdf:subject :Tidy ; rdf:predicate rdfs:subClassOf ; rdf:object
        [ a owl:Restriction ; owl:onProperty k:subAction ; owl:someValuesFrom :Put ] ; rdfs:comment "not said" ] .""",
    "a named statement": """:said a rdf:Statement ; rdf:subject :TakeFirst ;
        rdf:predicate k:occursAfterInOrdering ; rdf:object :Take .""",
    "a negative assertion": """[ a owl:NegativePropertyAssertion ; owl:sourceIndividual :TakeFirst ;
        owl:assertionProperty k:occursBeforeInOrdering ; owl:targetIndividual :Put ] .""",
}


def plan_of(folder: Path, text: str, suffix: str = ".ttl") -> tuple[str, list[str]]:
    """Source of the plan without its header and its line numbers, and the codes of errors, warnings and notes."""
    path = folder / f"tidy{suffix}"
    path.write_text(text, encoding="utf-8")
    try:
        done = compile_recipe(path)
    except BadInput as problem:
        return "", [str(one) for one in problem.diagnostics]
    plan = done.source[done.source.index("RECIPE =") :] if done.source else ""
    assert "async def tidy" in plan, done.diagnostics
    return re.sub(r"#L?\d+|:\d+", "", plan), sorted(one.code for one in done.diagnostics)


@pytest.mark.parametrize("annotation", ANNOTATED.values(), ids=ANNOTATED)
def test_an_annotation_changes_no_plan(tmp_path: Path, annotation: str) -> None:
    plain, codes = plan_of(tmp_path, PLAIN)
    assert plan_of(tmp_path, PLAIN + annotation) == (plain, sorted([*codes, *["O045"] * ("Negative" in annotation)]))


def test_an_annotation_changes_no_plan_in_n_triples_where_it_shares_the_restriction(tmp_path: Path) -> None:
    plain, codes = plan_of(tmp_path, PLAIN)
    step = "[ a owl:Restriction ; owl:onProperty k:subAction ; owl:someValuesFrom :Take ]"
    shared = """_:r a owl:Restriction ; owl:onProperty k:subAction ; owl:someValuesFrom :Take .
    [ a owl:Axiom ; owl:annotatedSource :Tidy ; owl:annotatedProperty rdfs:subClassOf ; owl:annotatedTarget _:r ;
      rdfs:comment "agreed" ] ."""
    text = HEAD + TIDY.replace(step, "_:r") + shared + REST
    assert plan_of(tmp_path, text) == (plain, codes)


def test_an_axiom_that_only_its_annotation_states_is_stated(tmp_path: Path) -> None:
    plain, codes = plan_of(tmp_path, PLAIN)
    step = "    [ a owl:Restriction ; owl:onProperty k:subAction ; owl:someValuesFrom :Take ],\n"
    assert step in TIDY
    text = f"{HEAD}[ a owl:Axiom ; {OF_STEP}{TIDY.replace(step, '')}{REST}"
    assert plan_of(tmp_path, text) == (plain, sorted([*codes, "O044"]))


MANCHESTER = """\
Prefix: : <http://example.org/tidy#>
Prefix: rdfs: <http://www.w3.org/2000/01/rdf-schema#>
Prefix: k: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://example.org/tidy>
Class: Tidy
    SubClassOf: k:PurposefulAction, {note} k:subAction some Take, k:subAction some Put,
        k:orderingConstraints value TakeFirst
Class: Take
    SubClassOf: {note} k:PickingUpAnObject, k:objectActedOn value cup1
Class: Put
    EquivalentTo: {note} k:PuttingDownAnObject and (k:objectActedOn value cup1) and (k:toLocation value onTheTable)
Individual: TakeFirst
    Types: k:PartialOrdering-Strict
    Facts: {note} k:occursBeforeInOrdering Take, k:occursAfterInOrdering Put
Individual: cup1
    Types: {note} k:Cup
Individual: table1
    Types: k:Table-PieceOfFurniture
Individual: onTheTable
    Types: k:Point3D
    Facts: k:on-Physical table1
"""


def test_annotations_in_manchester_syntax_change_no_plan(tmp_path: Path) -> None:
    plain = plan_of(tmp_path, MANCHESTER.format(note=""), ".omn")
    note = 'Annotations: Annotations: rdfs:label "nested" rdfs:comment "agreed"'
    assert plan_of(tmp_path, MANCHESTER.format(note=note), ".omn") == plain
