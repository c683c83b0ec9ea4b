"""Functional syntax and OWL/XML have the triples of OWL 2's mapping, and their mistakes are named where they are."""

from __future__ import annotations

import time
from pathlib import Path

import pyhornedowl
import pytest
from rdf_graphs import graph_of, same

from planlang.compiler import compile_recipe
from planlang.diagnostics import BadInput, Diagnostic
from planlang.ontology import Literal, Triple, load
from planlang.ontology.convert import Target, write
from planlang.ontology.documents import read_syntax
from planlang.ontology.rdfxml import read_rdfxml
from planlang.ontology.terms import OWL, RDF, RDFS, XSD

T = "http://example.org/t#"
HEAD = """Prefix(:=<http://example.org/t#>)
Prefix(xsd:=<http://www.w3.org/2001/XMLSchema#>)
Prefix(rdfs:=<http://www.w3.org/2000/01/rdf-schema#>)
Prefix(owl:=<http://www.w3.org/2002/07/owl#>)
Ontology(<http://example.org/t> <http://example.org/t/2>
"""
EVERY_AXIOM = """Import(<http://example.org/words>)
Annotation(rdfs:comment "all of it"@en)
Declaration(Class(:A)) Declaration(Class(:B)) Declaration(Datatype(:T)) Declaration(NamedIndividual(:a))
Declaration(ObjectProperty(:p)) Declaration(ObjectProperty(:q)) Declaration(ObjectProperty(:r))
Declaration(DataProperty(:d)) Declaration(DataProperty(:e)) Declaration(AnnotationProperty(:n))
SubClassOf(Annotation(:n "why") :A ObjectSomeValuesFrom(:p :B))
SubClassOf(ObjectIntersectionOf(:A :B) ObjectUnionOf(:A ObjectComplementOf(:B)))
SubClassOf(:A ObjectAllValuesFrom(ObjectInverseOf(:p) ObjectOneOf(:a :b _:x)))
SubClassOf(:A ObjectHasValue(:p :a)) SubClassOf(:A ObjectHasSelf(:p))
SubClassOf(:A ObjectMinCardinality(1 :p :A)) SubClassOf(:A ObjectMaxCardinality(2 :p :B))
SubClassOf(:A ObjectExactCardinality(3 :p :B)) SubClassOf(:A DataHasValue(:d "1"^^xsd:integer))
SubClassOf(:A DataSomeValuesFrom(:d DatatypeRestriction(xsd:integer xsd:minInclusive "1"^^xsd:integer)))
SubClassOf(:A DataAllValuesFrom(:d DataUnionOf(xsd:string DataComplementOf(:T))))
SubClassOf(:A DataMaxCardinality(1 :d DataOneOf("x" "y"@de)))
SubClassOf(:A DataExactCardinality(1 :d :T))
EquivalentClasses(:A :B) DisjointClasses(:A :B) DisjointUnion(:A :B :C)
SubObjectPropertyOf(:p :q) SubObjectPropertyOf(ObjectPropertyChain(:p :q) :r)
EquivalentObjectProperties(:p :q) DisjointObjectProperties(:p :q) InverseObjectProperties(:p :q)
ObjectPropertyDomain(:p :A) ObjectPropertyRange(:p ObjectUnionOf(:A :B)) FunctionalObjectProperty(:p)
InverseFunctionalObjectProperty(:p) ReflexiveObjectProperty(:p) IrreflexiveObjectProperty(:p)
SymmetricObjectProperty(:p) AsymmetricObjectProperty(:p) TransitiveObjectProperty(:p)
SubDataPropertyOf(:d :e) EquivalentDataProperties(:d :e) DisjointDataProperties(:d :e) DataPropertyDomain(:d :A)
DataPropertyRange(:d DataIntersectionOf(xsd:string :T)) FunctionalDataProperty(:d)
DatatypeDefinition(:T DataOneOf("x" "y")) HasKey(:A (:p) (:d))
SameIndividual(:a :b) DifferentIndividuals(:a :b) DifferentIndividuals(:a :b :c)
ClassAssertion(ObjectSomeValuesFrom(:p :A) :a) ClassAssertion(:A _:x)
ObjectPropertyAssertion(:p :a _:x) ObjectPropertyAssertion(ObjectInverseOf(:p) :a :b)
NegativeObjectPropertyAssertion(:p :a :b) DataPropertyAssertion(:d :a "a \\"quote\\" and \\\\")
NegativeDataPropertyAssertion(:d :a "5"^^xsd:integer)
AnnotationAssertion(Annotation(:n "of a note") rdfs:label :A "A"@en-gb) AnnotationAssertion(:n :a <http://x.org/y>)
SubAnnotationPropertyOf(:n rdfs:label) AnnotationPropertyDomain(:n :A) AnnotationPropertyRange(:n xsd:string)
"""


def read(text: str, file: str = "t.ofn") -> list[Triple]:
    return list(read_syntax(text.encode(), file, base="http://example.org/base", label="b").triples)


def errors(text: str, file: str = "t.ofn") -> list[Diagnostic]:
    with pytest.raises(BadInput) as problem:
        read(text, file)
    return list(problem.value.diagnostics)


def places(found: list[Diagnostic]) -> list[tuple[str, int, int]]:
    return [(one.code, one.span.line, one.span.column) for one in found if one.span is not None]


def in_xml(body: str) -> str:
    return f"""<?xml version="1.0"?>
<Ontology xmlns="http://www.w3.org/2002/07/owl#" xml:base="http://example.org/t" ontologyIRI="http://example.org/t">
<Prefix name="" IRI="http://example.org/t#"/>
{body}
</Ontology>
"""


def test_every_axiom_of_functional_syntax_has_the_triples_that_horned_owl_makes_of_it() -> None:
    text = f"{HEAD}{EVERY_AXIOM})\n"
    written = pyhornedowl.open_ontology_from_string(text, "ofn").save_to_string("rdf")
    expected = read_rdfxml(written.encode(), "t.owl", base="http://example.org/base").triples
    assert same(graph_of(read(text)), graph_of(expected))


def test_owl_xml_has_the_triples_of_functional_syntax() -> None:
    text = f"{HEAD}{EVERY_AXIOM})\n"
    written = pyhornedowl.open_ontology_from_string(text, "ofn").save_to_string("owx")
    assert written.lstrip().startswith("<?xml")
    assert same(graph_of(read(written, "t.owx")), graph_of(read(text)))


@pytest.mark.parametrize(
    ("axiom", "predicate", "count"),
    [
        ("SubClassOf(:A ObjectMinCardinality(1 :p))", OWL.minCardinality, 1),
        ("SubClassOf(:A DataExactCardinality(1 :d))", OWL.cardinality, 1),
        ("DisjointClasses(:A :B :C)", RDF.first, 3),
        ("DisjointClasses(:A :B :C)", OWL.disjointWith, 0),
        ("DisjointObjectProperties(:p :q :r)", OWL.members, 1),
        ("EquivalentClasses(:A :B :C)", OWL.equivalentClass, 2),
    ],
)
def test_what_horned_owl_writes_otherwise_is_as_in_the_recommendation(axiom: str, predicate: str, count: int) -> None:
    assert [one.predicate for one in read(f"{HEAD}{axiom})")].count(predicate) == count


def test_a_restriction_of_several_properties_names_them_as_a_list() -> None:
    triples = read(f"{HEAD}SubClassOf(:A DataSomeValuesFrom(:d :e :T)))")
    (listed,) = [one for one in triples if one.predicate == OWL.onProperties]
    assert [one.object for one in triples if one.predicate == RDF.first] == [T + "d", T + "e"]
    assert [one.object for one in triples if one.predicate == OWL.someValuesFrom] == [T + "T"]
    assert not [one for one in triples if one.predicate == OWL.onProperty and one.subject == listed.subject]


@pytest.mark.parametrize(
    ("written", "value"),
    [
        ('"soup@de"^^<http://www.w3.org/1999/02/22-rdf-syntax-ns#PlainLiteral>', Literal("soup", None, "de")),
        ('"a@b@"^^<http://www.w3.org/1999/02/22-rdf-syntax-ns#PlainLiteral>', Literal("a@b")),
        ('"two\nlines # no comment"', Literal("two\nlines # no comment")),
        ('"1" ^^ xsd:integer', Literal("1", XSD.integer)),
    ],
)
def test_literals_are_read_in_every_form(written: str, value: Literal) -> None:
    triples = read(f"{HEAD}AnnotationAssertion(rdfs:comment :A {written}))")
    assert [one.object for one in triples if one.predicate == RDFS.comment] == [value]


def test_words_may_be_apart_from_their_parenthesis_and_comments_anywhere() -> None:
    assert read(f"{HEAD}# cups\nSubClassOf (:A # or mugs\n :B) )")[-1].object == T + "B"


def test_a_triple_has_the_position_of_the_word_that_states_it() -> None:
    (triple,) = [one for one in read(f"{HEAD}\n  SubClassOf(:A :B)\n)") if one.predicate == RDFS.subClassOf]
    assert (triple.span.line, triple.span.column) == (7, 17)


@pytest.mark.parametrize(
    ("axioms", "line", "column", "said", "advice"),
    [
        ("SubclassOf(:A :B)", 6, 1, "unknown word SubclassOf", "did you mean SubClassOf?"),
        ("SubClassOf(:A)", 6, 1, "SubClassOf has 1 part", "write SubClassOf(a class a class)"),
        ("SubClassOf(:A :B :C)", 6, 1, "SubClassOf has 3 parts", "write SubClassOf(a class a class)"),
        ('SubClassOf(:A "B")', 6, 15, "part 2 of SubClassOf has to be a class", "write SubClassOf"),
        ("ClassAssertion(:A ObjectInverseOf(:p))", 6, 19, "part 2", "an individual"),
        ("SubClassOf(:A DataUnionOf(xsd:string :T))", 6, 15, "part 2", "a class"),
        ("SubClassOf(:A ObjectMinCardinality(:p 1))", 6, 36, "part 1", "a whole number"),
        ("Declaration(:A)", 6, 1, "a declaration states one of Class", "write Declaration(Class(a name))"),
        ("SubClassOf(:A cup:B)", 6, 15, "unknown prefix cup:", "declare it: Prefix(cup:=<http://...#>)"),
        ("ObjectUnionOf(:A :B)", 6, 1, "this is no axiom", "SubClassOf"),
        ("SubClassOf(:A :B\nSubClassOf(:A :C)\n", 7, 1, "SubClassOf is inside of SubClassOf", "end SubClassOf before"),
        ('SubClassOf(:A "B\n', 6, 15, "a string is not closed", "expected"),
        ("SubClassOf(:A :B))\nSubClassOf(:A :C)", 7, 1, "behind the end of the ontology", "remove a )"),
        ("SubClassOf(:A :B))\n%", 7, 1, "unexpected % behind the end of the ontology", "remove a )"),
        ("SubClassOf(:A B)", 6, 15, "unexpected B", "a name prefix:name"),
    ],
)
def test_a_mistake_is_named_where_it_is_with_advice(
    axioms: str, line: int, column: int, said: str, advice: str
) -> None:
    found = errors(f"{HEAD}{axioms}\n)")[0]
    assert found.span is not None
    assert (found.span.line, found.span.column) == (line, column)
    assert said in found.message
    assert advice in (found.help or "")


def test_all_mistakes_of_a_file_are_reported_in_one_run() -> None:
    body = "SubClassOf(:A)\nSubClassOf(:A B)\nSubClassOf(:A x:B)\nSubClassOf(:A x:C)\nSubClass(:A :B)\n"
    assert places(errors(f"{HEAD}{body})")) == [("O020", 6, 1), ("O020", 7, 15), ("O021", 8, 15), ("O020", 10, 1)]


def test_a_truncated_file_and_one_without_its_beginning_say_so() -> None:
    (found,) = errors(f"{HEAD}SubClassOf(:A :B)\n")
    assert "ends before Ontology( is closed" in found.message
    (found,) = errors("Prefix(:=<http://example.org/t#>)\nSubClassOf(:A :B)\n")
    assert found.message == "the file has no Ontology("


@pytest.mark.parametrize(
    ("body", "line", "said"),
    [
        ('<SubClassOf><Class IRI="#A"/></SubClassOf>', 4, "SubClassOf has 1 part"),
        ('<SubclassOf><Class IRI="#A"/></SubclassOf>', 4, "unknown word SubclassOf"),
        ("<SubClassOf>\n<Class/><Class IRI='#A'/></SubClassOf>", 5, "Class has 0 parts"),
        ("<Declaration>\nhere<Class IRI='#A'/></Declaration>", 4, "text between elements: 'here'"),
        ('<SubClassOf><Class IRI="#A"/><Class abbreviatedIRI="x:B"/></SubClassOf>', 4, "unknown prefix x:"),
        ('<SubClassOf><Class IRI="#A"/>', 4, "not closed"),
        ('<SubClassOf>\n<Prefix name="x" IRI="y"/></SubClassOf>', 5, "a Prefix is inside of SubClassOf"),
    ],
)
def test_a_mistake_in_owl_xml_is_named_where_it_is(body: str, line: int, said: str) -> None:
    found = errors(in_xml(body), "t.owx")[0]
    assert found.span is not None
    assert said in found.message
    assert found.span.line == line


def test_owl_xml_of_another_namespace_is_refused_by_name() -> None:
    (found,) = errors('<Ontology xmlns="http://www.w3.org/2006/12/owl11-xml#"/>', "t.owx")
    assert (found.code, "owl11-xml" in found.message) == ("O001", True)


def test_an_entity_bomb_in_owl_xml_is_refused() -> None:
    bomb = "".join(f'<!ENTITY e{n} "{f"&e{n - 1};" * 20 if n else "x" * 100}">' for n in range(8))
    text = in_xml("<Import>&e7;</Import>").replace("<Ontology", f"<!DOCTYPE Ontology [{bomb}]>\n<Ontology", 1)
    assert [one.code for one in errors(text, "t.owx")] == ["O008"]


def test_an_rdf_file_with_an_ontology_as_its_root_is_rdf() -> None:
    text = f'<owl:Ontology xmlns:owl="{OWL}" xmlns:rdf="{RDF}" rdf:about="http://example.org/t"/>'
    assert [one.object for one in read(text, "t.owl")] == [OWL.Ontology]


@pytest.mark.parametrize("syntax", ["ofn", "owx"])
def test_a_large_file_is_read_in_a_second_and_an_error_at_its_end_too(syntax: str) -> None:
    lines = [f"SubClassOf(:Cup{n} ObjectSomeValuesFrom(:standsOn :Table{n}))\n" for n in range(4_000)]
    if syntax == "owx":
        lines = [
            f'<SubClassOf><Class IRI="#Cup{n}"/><ObjectSomeValuesFrom><ObjectProperty IRI="#on"/><Class IRI="#T{n}"/>'
            "</ObjectSomeValuesFrom></SubClassOf>\n"
            for n in range(2_500)
        ]
    body = "".join(lines)
    text = in_xml(body) if syntax == "owx" else f"{HEAD}{body})"
    begin = time.process_time()
    assert len(read(text)) > 10_000
    with pytest.raises(BadInput):
        read(text[: text.rstrip().rfind("\n")] + "\n(")
    assert time.process_time() - begin < 10  # ten times what it takes


def test_a_recipe_in_functional_syntax_compiles(tmp_path: Path) -> None:
    path = tmp_path / "fetch_soup.ofn"
    path.write_text(
        """Prefix(:=<http://example.org/fetch_soup.owl#>)
Prefix(knowrob:=<http://knowrob.org/kb/knowrob.owl#>)
Ontology(<http://example.org/fetch_soup.owl>
Import(<http://knowrob.org/kb/knowrob.owl>)
ClassAssertion(knowrob:Cup :cup1)
SubClassOf(:FetchSoup knowrob:PurposefulAction)
SubClassOf(:FetchSoup ObjectSomeValuesFrom(knowrob:subAction :CarryIt))
SubClassOf(:CarryIt knowrob:PickingUpAnObject)
SubClassOf(:CarryIt ObjectHasValue(knowrob:objectActedOn :cup1))
)
"""
    )
    assert "async def fetch_soup" in compile_recipe(path).source


@pytest.mark.parametrize(
    "atom",
    ["ClassAtom(:A Variable(<urn:x>))", "SameAsAtom(Variable(<urn:x>) :a)", "DifferentFromAtom(Variable(<urn:x>) :a)"],
)
def test_a_rule_is_named_and_left_out(atom: str) -> None:
    text = f"{HEAD}DLSafeRule(Body({atom}) Head(ClassAtom(:B Variable(<urn:x>))))\n)"
    parsed = read_syntax(text.encode(), "t.ofn", base="http://example.org/base", label="b")
    assert [one.code for one in parsed.diagnostics] == ["O023"]
    assert len(parsed.triples) == 2


@pytest.mark.parametrize("axiom", ["DisjointClasses(:A)", "SameIndividual(:a)", "EquivalentDataProperties(:d)"])
def test_an_axiom_of_several_things_that_has_one_is_left_out_with_a_warning(axiom: str) -> None:
    parsed = read_syntax(f"{HEAD}{axiom})".encode(), "t.ofn", base="http://example.org/base", label="b")
    assert [one.code for one in parsed.diagnostics] == ["O010"]
    assert len(parsed.triples) == 2


def test_a_folder_of_several_syntaxes_is_one_ontology(tmp_path: Path) -> None:
    (tmp_path / "words.ofn").write_text("Ontology(<http://example.org/words> SubClassOf(<#Mug> <#Cup>))")
    (tmp_path / "more.owx").write_text(in_xml("<Import>http://example.org/words</Import>"))
    (tmp_path / "main.omn").write_text("Ontology: <http://example.org/main>\n    Import: <http://example.org/t>\n")
    ontology = load(tmp_path / "main.omn", builtin=False)
    assert not ontology.diagnostics
    assert ontology.is_a("http://example.org/words#Mug", "http://example.org/words#Cup")


@pytest.mark.parametrize(("target", "name"), [(Target.FUNCTIONAL, "ofn"), (Target.OWLXML, "owx")])
def test_every_axiom_survives_being_written_and_horned_owl_reads_it_alike(target: Target, name: str) -> None:
    triples = read(f"{HEAD}{EVERY_AXIOM})\n")
    text, lost = write(triples, target, {"": T})
    assert not lost
    assert same(graph_of(read(text)), graph_of(triples))
    expected = pyhornedowl.open_ontology_from_string(f"{HEAD}{EVERY_AXIOM})\n", "ofn").get_axioms()
    found = pyhornedowl.open_ontology_from_string(text, name).get_axioms()
    assert len(found) >= len(expected) - 1  # keys of properties and of data are one axiom


def test_owlxml_keeps_what_characters_xml_can_have_and_says_what_it_cannot() -> None:
    triples = read(f'{HEAD}AnnotationAssertion(rdfs:comment :a "a\r\n<b> & \\"c\\"  ")\n)')
    text, lost = write(triples, Target.OWLXML, {"": T})
    assert not lost
    assert same(graph_of(read(text)), graph_of(triples))
    illegal = read(f'{HEAD}AnnotationAssertion(rdfs:comment :a "a\x01b")\nDeclaration(Class(:C))\n)')
    text, lost = write(illegal, Target.OWLXML, {"": T})
    assert [one.subject for one in lost] == [f"{T}a"]
    assert read(text)
