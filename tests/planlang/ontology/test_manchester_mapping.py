"""What horned-owl lacks or reads otherwise: the triples are those of the mapping of OWL 2 to RDF, here in Turtle.

Each comment says what horned-owl does with the text.
"""

from collections.abc import Callable, Iterable

import pyhornedowl
import pytest
import rdflib
from rdflib.compare import isomorphic

from planlang.ontology import Triple
from planlang.ontology.manchester import read_manchester
from planlang.ontology.turtle import read_turtle

HEAD = """Prefix: : <http://example.org/t#>
Prefix: xsd: <http://www.w3.org/2001/XMLSchema#>
Ontology: <http://example.org/t>
"""
TURTLE = """@prefix : <http://example.org/t#> .
@prefix owl: <http://www.w3.org/2002/07/owl#> .
@prefix rdf: <http://www.w3.org/1999/02/22-rdf-syntax-ns#> .
@prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .
@prefix xsd: <http://www.w3.org/2001/XMLSchema#> .
<http://example.org/t> a owl:Ontology .
"""
REFUSED = {  # by horned-owl, as no Manchester syntax
    "Class: A\n HasKey: p inverse q": ":A a owl:Class ; owl:hasKey ( :p [ owl:inverseOf :q ] ) .",
    "Class: A\n SubClassOf: B that p some C and not (q some C)": """:A a owl:Class ; rdfs:subClassOf [ a owl:Class ;
        owl:intersectionOf ( :B [ a owl:Restriction ; owl:onProperty :p ; owl:someValuesFrom :C ]
            [ a owl:Class ; owl:complementOf
              [ a owl:Restriction ; owl:onProperty :q ; owl:someValuesFrom :C ] ] ) ] .""",
    "ObjectProperty: p\n InverseOf: inverse q": ":p a owl:ObjectProperty ; owl:inverseOf [ owl:inverseOf :q ] .",
    'Individual: a\n Facts: d 1, Annotations: :n "x" d 2': """:a a owl:NamedIndividual ; :d 1, 2 .
        [ a owl:Axiom ; owl:annotatedSource :a ; owl:annotatedProperty :d ; owl:annotatedTarget 2 ; :n "x" ] .""",
}
READ_OTHERWISE = {
    # names of the ontology's own
    "Class: A\n SubClassOf: d some integer": """:A a owl:Class ;
        rdfs:subClassOf [ a owl:Restriction ; owl:onProperty :d ; owl:someValuesFrom xsd:integer ] .""",
    'Individual: a\n Facts: d "x"^^string': ':a a owl:NamedIndividual ; :d "x"^^xsd:string .',
    # a value "1.5f"
    "Individual: a\n Facts: d 1.5f": ':a a owl:NamedIndividual ; :d "1.5"^^xsd:float .',
    # an object property's cardinality
    "DataProperty: d\nClass: A\n SubClassOf: d max 2": """:d a owl:DatatypeProperty . :A a owl:Class ; rdfs:subClassOf
        [ a owl:Restriction ; owl:onProperty :d ; owl:maxCardinality "2"^^xsd:nonNegativeInteger ] .""",
    # the annotation of the first belongs to both
    'DataProperty: d\n Range: Annotations: :n "x" xsd:integer, xsd:string': """:d a owl:DatatypeProperty ;
        rdfs:range xsd:integer, xsd:string . [ a owl:Axiom ; owl:annotatedSource :d ;
        owl:annotatedProperty rdfs:range ; owl:annotatedTarget xsd:integer ; :n "x" ] .""",
}
OF_THE_MAPPING = {  # which horned-owl reads, or writes as several axioms of two
    "DisjointClasses: A, B, C": "[ a owl:AllDisjointClasses ; owl:members ( :A :B :C ) ] .",
    'DisjointProperties: Annotations: :n "x" p, inverse q, r': """[ a owl:AllDisjointProperties ;
        owl:members ( :p [ owl:inverseOf :q ] :r ) ; :n "x" ] .""",
    "DifferentIndividuals: a, b, _:c": "[ a owl:AllDifferent ; owl:members ( :a :b _:c ) ] .",
    "Individual: a\n Facts: p _:x": ":a a owl:NamedIndividual ; :p _:x .",
    "EquivalentClasses: A, B, C": ":A owl:equivalentClass :B . :B owl:equivalentClass :C .",
    "SameIndividual: a, b, c": ":a owl:sameAs :b . :b owl:sameAs :c .",
    'Class: A\n DisjointUnionOf: Annotations: :n "x" B, C': """:A a owl:Class ; owl:disjointUnionOf _:l .
        _:l rdf:first :B ; rdf:rest ( :C ) . [ a owl:Axiom ; owl:annotatedSource :A ;
        owl:annotatedProperty owl:disjointUnionOf ; owl:annotatedTarget _:l ; :n "x" ] .""",
    'Individual: a\n Facts: Annotations: :n "x" not p b': """:a a owl:NamedIndividual .
        [ a owl:NegativePropertyAssertion ; owl:sourceIndividual :a ; owl:assertionProperty :p ;
          owl:targetIndividual :b ; :n "x" ] .""",
    'Individual: _:x\n Annotations: Annotations: :n "in" :n "out"': """_:x :n "out" . [ a owl:Axiom ;
        owl:annotatedSource _:x ; owl:annotatedProperty :n ; owl:annotatedTarget "out" ; :n "in" ] .""",
    'Class: A\n SubClassOf: Annotations: Annotations: :n "in" :n "out" B': """:A a owl:Class ; rdfs:subClassOf :B .
        _:n a owl:Axiom ; owl:annotatedSource :A ; owl:annotatedProperty rdfs:subClassOf ; owl:annotatedTarget :B ;
        :n "out" . [ a owl:Annotation ; owl:annotatedSource _:n ; owl:annotatedProperty :n ;
        owl:annotatedTarget "out" ; :n "in" ] .""",
    "Datatype: T\n EquivalentTo: U or not V": """:T a rdfs:Datatype ; owl:equivalentClass [ a rdfs:Datatype ;
        owl:unionOf ( :U [ a rdfs:Datatype ; owl:datatypeComplementOf :V ] ) ] .""",
    "ObjectProperty: p\n SubPropertyChain: q o inverse r o some": """:p a owl:ObjectProperty ;
        owl:propertyChainAxiom ( :q [ owl:inverseOf :r ] :some ) .""",
    "DataProperty: d\nClass: A\n SubClassOf: d some (T or {1})": """:d a owl:DatatypeProperty . :A a owl:Class ;
        rdfs:subClassOf [ a owl:Restriction ; owl:onProperty :d ; owl:someValuesFrom
            [ a rdfs:Datatype ; owl:unionOf ( :T [ a rdfs:Datatype ; owl:oneOf ( 1 ) ] ) ] ] .""",
    "Class: 1a\n SubClassOf: 2-b": ":1a a owl:Class ; rdfs:subClassOf :2-b .",
    "Class: integer\n SubClassOf: p some integer": """:integer a owl:Class ;
        rdfs:subClassOf [ a owl:Restriction ; owl:onProperty :p ; owl:someValuesFrom :integer ] .""",
}


@pytest.mark.parametrize("text", [*REFUSED, *READ_OTHERWISE, *OF_THE_MAPPING])
def test_the_triples_are_those_of_the_mapping(text: str, as_rdflib: Callable[[Iterable[Triple]], rdflib.Graph]) -> None:
    expected = (REFUSED | READ_OTHERWISE | OF_THE_MAPPING)[text]
    found = read_manchester((HEAD + text).encode(), "t.omn", base="http://example.org/t").triples
    wanted = read_turtle((TURTLE + expected).encode(), "t.ttl", base="http://example.org/t").triples
    assert isomorphic(as_rdflib(found), as_rdflib(wanted))


@pytest.mark.parametrize("text", REFUSED)
def test_horned_owl_still_refuses_this(text: str) -> None:
    declared = "ObjectProperty: p\nObjectProperty: q\nDataProperty: d\nAnnotationProperty: n\nDatatype: T\n"
    with pytest.raises(ValueError, match="Failed to open ontology"):
        pyhornedowl.open_ontology_from_string(HEAD + declared + text, "omn")


def test_the_head_of_an_ontology_may_be_abbreviated_and_annotated_in_depth(
    as_rdflib: Callable[[Iterable[Triple]], rdflib.Graph],
) -> None:
    text = """Prefix: : <http://example.org/t#>
Ontology: :o :v
    Import: <http://example.org/i>
    Annotations: Annotations: :n "in" :n "out", :n _:x
"""
    expected = """@prefix : <http://example.org/t#> . @prefix owl: <http://www.w3.org/2002/07/owl#> .
:o a owl:Ontology ; owl:versionIRI :v ; owl:imports <http://example.org/i> ; :n "out", _:x .
[ a owl:Annotation ; owl:annotatedSource :o ; owl:annotatedProperty :n ; owl:annotatedTarget "out" ; :n "in" ] .
"""
    found = read_manchester(text.encode(), "t.omn", base="http://example.org/t").triples
    wanted = read_turtle(expected.encode(), "t.ttl", base="http://example.org/t").triples
    assert isomorphic(as_rdflib(found), as_rdflib(wanted))
