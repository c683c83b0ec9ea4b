"""Manchester syntax: triples, positions, names, and agreement with py-horned-owl."""

import re
from pathlib import Path
from xml.sax.saxutils import escape, quoteattr

import pyhornedowl
import pytest
from examples import examples
from hypothesis import given, settings
from hypothesis import strategies as st

from planlang.diagnostics import BadInput
from planlang.ontology import BNode, Literal, Triple, load
from planlang.ontology.manchester import read_manchester
from planlang.ontology.terms import OWL, RDF, RDFS, XSD
from tests.support.refusals import refusal

HEAD = """Prefix: : <http://example.org/t#>
Prefix: xsd: <http://www.w3.org/2001/XMLSchema#>
Prefix: rdfs: <http://www.w3.org/2000/01/rdf-schema#>
Ontology: <http://example.org/t>
"""
T = "http://example.org/t#"


def read(text: str, head: str = HEAD) -> list[Triple]:
    return read_manchester((head + text).encode(), "t.omn", base="http://example.org/base").triples


def about(triples: list[Triple], name: str) -> list[tuple[str, object]]:
    return [(t.predicate.rpartition("#")[2], t.object) for t in triples if t.subject == T + name]


def as_rdfxml(triples: list[Triple]) -> str:
    """RDF/XML with one element per triple, in their order: py-horned-owl's reader minds the order."""
    lines = [f'<rdf:RDF xmlns:rdf="{RDF}">']
    for triple in triples:
        about = "nodeID" if isinstance(triple.subject, BNode) else "about"
        subject = getattr(triple.subject, "label", triple.subject)
        namespace, name = re.fullmatch(r"(.*[#/])([^#/]+)", triple.predicate).groups()  # type: ignore[union-attr]
        lines.append(f"<rdf:Description rdf:{about}={quoteattr(str(subject))}><p:{name} xmlns:p={quoteattr(namespace)}")
        match triple.object:
            case BNode(label):
                lines.append(f' rdf:nodeID="{label}"/>')
            case Literal(value, datatype, language):
                kind = f' rdf:datatype="{datatype}"' if datatype else f' xml:lang="{language}"' if language else ""
                lines.append(f"{kind}>{escape(value)}</p:{name}>")
            case iri:
                lines.append(f" rdf:resource={quoteattr(iri)}/>")
        lines.append("</rdf:Description>\n")
    return "".join([*lines, "</rdf:RDF>"])


def axioms(text: str, serialization: str) -> set[str]:
    return {str(a.component) for a in pyhornedowl.open_ontology_from_string(text, serialization).get_axioms()}


EVERYTHING = """
ObjectProperty: p
    Characteristics: Functional, Transitive
    InverseOf: q
    Domain: A or B
ObjectProperty: q
    SubPropertyOf: p
    EquivalentTo: r
    DisjointWith: s
ObjectProperty: r
    SubPropertyChain: p o q
ObjectProperty: s
DataProperty: d
    Range: xsd:integer[>= 5, < 10]
    Characteristics: Functional
DataProperty: e
    Range: {1, 2, "three"}
AnnotationProperty: note
    SubPropertyOf: rdfs:comment
Datatype: Size
    EquivalentTo: xsd:decimal[>= 0.5]
Class: A
    Annotations: rdfs:label "x"@en, note "3"^^xsd:integer, note B
    SubClassOf: p some (B and not C or D), p only {a, b}, p min 3, p max 2 B, p exactly 1 (B or C), d value 5,
        d some xsd:string, p Self, inverse p some B, inverse (p) value a, d min 2 xsd:integer, d only not xsd:string
    EquivalentTo: B and (p value a)
    DisjointWith: C
    DisjointUnionOf: B, C
Class: B
Class: C
    SubClassOf: Annotations: note "why" D
Class: D
Individual: a
    Types: A, p some B
    Facts: p b, not p a, d 5, d "x\\"\\\\y", d 1.5, not d true, d -3
    SameAs: c
    DifferentFrom: b
Individual: b
Individual: c
EquivalentClasses: B, p some C
EquivalentProperties: p, s
SameIndividual: b, c
DifferentIndividuals: a, b, c
"""


def test_every_construct_has_the_axioms_that_horned_owl_finds() -> None:
    found = axioms(as_rdfxml(read(EVERYTHING)), "rdf")
    expected = axioms(HEAD + EVERYTHING, "omn")
    assert found - expected == set()
    assert expected - found == set()


def test_words_of_the_language_are_names_where_they_cannot_be_words() -> None:
    triples = read(
        "Class: some SubClassOf: value, max some min, only value value, o exactly 2, and\n"
        "Individual: value Types: some, max Facts: value some, some value, o 3\n"
    )
    values = [t.object for t in triples if t.subject == T + "value" and t.predicate == T + "value"]
    assert values == [T + "some"]
    assert (T + "value") in [t.object for t in triples if t.predicate == OWL.hasValue]
    assert (T + "min") in [t.object for t in triples if t.predicate == OWL.someValuesFrom]


@pytest.mark.parametrize("name", ["Bed-PieceOfFurniture", "a.b", "x1", "_hidden", "Möbel", "in-ContGeneric"])
def test_names_need_no_quotes(name: str) -> None:
    assert read(f"Class: {name}\n")[-1].subject == T + name


@pytest.mark.parametrize(
    ("written", "iri"), [(":1a", T + "1a"), ("<http://x.org/a b>".replace(" ", ""), "http://x.org/ab")]
)
def test_other_names_have_a_prefix_or_are_whole_iris(written: str, iri: str) -> None:
    assert read(f"Individual: {written}\n")[-1].subject == iri


def test_each_triple_stands_at_the_word_that_says_it() -> None:
    text = "Class: A\n    SubClassOf: B,\n        p some C\n"
    spans = {t.predicate.rpartition("#")[2]: (t.span.line - 4, t.span.column) for t in read(text)[1:]}
    assert spans == {
        "type": (3, 9),
        "subClassOf": (3, 9),
        "onProperty": (3, 9),
        "someValuesFrom": (3, 16),
    }


def test_numbers_have_the_datatype_that_they_look_like() -> None:
    triples = read('Individual: a Facts: p 5, p -1.5, p 2.5f, p true, p "x", p "x"@EN, p "x"^^xsd:token\n')
    assert [value for name, value in about(triples, "a") if name == "p"] == [
        Literal("5", XSD.integer),
        Literal("-1.5", XSD.decimal),
        Literal("2.5", XSD.float),
        Literal("true", XSD.boolean),
        Literal("x"),
        Literal("x", None, "en"),
        Literal("x", XSD.token),
    ]


def test_escapes_in_texts_are_undone() -> None:
    (value,) = [
        v for name, v in about(read(r'Class: A Annotations: rdfs:comment "a \"b\" \\n"'), "A") if name == "comment"
    ]
    assert value == Literal('a "b" \\n')


def test_more_than_two_disjoint_classes_are_one_list() -> None:
    triples = read("DisjointClasses: A, B, C\n")
    assert (OWL.AllDisjointClasses) in [t.object for t in triples]
    assert [t.object for t in triples if t.predicate.endswith("#first")] == [T + "A", T + "B", T + "C"]


def test_a_key_is_a_list_of_properties() -> None:
    triples = read("Class: A HasKey: p value\n")
    assert [t.object for t in triples if t.predicate.endswith("#first")] == [T + "p", T + "value"]


def test_an_annotated_axiom_is_repeated_with_its_annotation() -> None:
    triples = read('Class: A SubClassOf: Annotations: rdfs:comment "why" B\n')
    axiom = next(t.subject for t in triples if t.object == OWL.Axiom)
    said = {t.predicate: t.object for t in triples if t.subject == axiom}
    assert said[OWL.annotatedSource] == T + "A"
    assert said[OWL.annotatedTarget] == T + "B"
    assert said[RDFS.comment] == Literal("why")


def test_the_example_of_the_paper_is_read_without_prefixes() -> None:
    text = """Class: PuttingSomethingSomewhere
    SubClassOf: Movement-TranslationEvent, TransportationEvent,
        subAction some PickingUpAnObject, orderingConstraints value SubEventOrdering1
Individual: SubEventOrdering1
    Types: PartialOrdering-Strict
    Facts: occursBeforeInOrdering PickingUpAnObject, occursAfterInOrdering CarryingWhileLocomoting
"""
    triples = read(text, head="")
    knowrob = "http://knowrob.org/kb/knowrob.owl#"
    assert triples[0].subject == knowrob + "PuttingSomethingSomewhere"
    assert ("http://example.org/base#SubEventOrdering1") in [t.subject for t in triples]
    assert (knowrob + "occursBeforeInOrdering") in [t.predicate for t in triples]


@pytest.mark.parametrize(
    ("text", "line", "column", "expected"),
    [
        ("Class: A SubClassOf: p some\n", 5, 28, "a name"),
        ("Class: A SubClassOf: p some ,\n", 5, 29, "a name"),
        ("Class: A SubClassOf: (B and C\n", 5, 30, "')'"),
        ("Class: A SubClassOf: p min some B\n", 5, 28, "a number"),
        ("Individual: a Facts: p\n", 5, 23, "a name"),
        ("ObjectProperty: p Characteristics: Fictional\n", 5, 36, "Functional"),
        ("Klass: A\n", 5, 1, "did you mean Class:?"),
    ],
)
def test_a_syntax_error_says_where_it_is_and_what_was_expected(
    text: str, line: int, column: int, expected: str
) -> None:
    with pytest.raises(BadInput) as caught:
        read(text)
    (problem,) = caught.value.diagnostics
    assert problem.span is not None
    assert (problem.code, problem.span.line, problem.span.column) == ("O020", line, column)
    assert problem.help is not None
    assert expected in problem.help


@pytest.mark.parametrize(
    ("text", "line", "column", "message"),
    [
        ("Class: A\n  SubClassOf:\n    B\n    p some C\n", 8, 5, "a comma is missing before p"),
        ("Class: A\n  SubClassOf:\n    p some B # b\n    p some C,\n    D\n", 8, 5, "a comma is missing before p"),
        ("Individual: a\n  Facts: p b q c\n", 6, 14, "a comma is missing before q"),
        ("Class: A SubClassOf: p B\n", 5, 24, "a comma, or a word such as some, is missing before B"),
        ("Class: A SubClassOf: B )\n", 5, 24, "unexpected )"),
        ('Class: A\n  Annotations: p "one\n  SubClassOf: B\nClass: B\n  Annotations: p "two"\n', 6, 18, "not closed"),
        ('Class: A\n  Annotations: p "one, p "two"\n', 6, 18, "not closed"),
        ('Class: A\n  Annotations: p "one\n  SubClassOf: B\n', 6, 18, "not closed"),
        ('Class: A\n  Annotations: p "Class: in words\n" q r\n', 7, 3, "unexpected q"),
    ],
)
def test_a_missing_comma_and_a_text_that_is_not_closed_are_reported_where_they_are(
    text: str, line: int, column: int, message: str
) -> None:
    with pytest.raises(BadInput) as caught:
        read(text)
    first = caught.value.diagnostics[0]
    assert first.span is not None
    assert (first.span.line, first.span.column) == (line, column)
    assert message in first.message


def test_cardinalities_are_whole_numbers() -> None:
    with refusal("O020", naming="1.5"):
        read("Class: A SubClassOf: p min 1.5\n")


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_line_ends_and_encodings_do_not_matter(encoding: str, end: str) -> None:
    content = (HEAD + "Class: Möbel\n    SubClassOf: B\n").replace("\n", end).encode(encoding)
    triples = read_manchester(content, "t.omn", base="http://example.org/base").triples
    assert [(t.span.line, t.span.column) for t in triples[1:]] == [(5, 8), (6, 17)]


def test_everything_may_stand_on_one_line() -> None:
    text = (
        "Prefix: a: <http://x.org/a#> Prefix: b: <http://x.org/b#> Ontology: <http://x.org/o> "
        "Class: a:A SubClassOf: b:d some (b:T or b:U) DataProperty: b:d "
        'Annotations: a:n "Prefix: c: <http://x.org/c#> Class: integer"'
    )
    triples = read(text, head="")
    assert triples[0].subject == "http://x.org/o"
    assert [t.object for t in triples if t.predicate == OWL.onProperty] == ["http://x.org/b#d"]
    assert (RDFS.Datatype) in [t.object for t in triples]
    assert OWL.Class not in [t.object for t in triples if isinstance(t.subject, BNode)]


def test_prefixes_in_comments_are_none() -> None:
    with refusal("O021", naming="a:A"):
        read("# Prefix: a: <http://x.org/a#>\nClass: a:A\n")


def test_comments_may_stand_anywhere_and_are_no_part_of_iris_or_texts() -> None:
    text = '# first\nClass: A # second\n    # third\n    Annotations: rdfs:comment "# no comment" # fourth\n# fifth'
    assert about(read(text), "A")[1] == ("comment", Literal("# no comment"))


def test_no_facet_of_a_datatype_is_an_unknown_term(tmp_path: Path) -> None:
    facets = 'length 3, minLength 1, maxLength 5, pattern "[a-z]", langRange "en", > 1, >= 1, < 9, <= 9'
    path = tmp_path / "facets.omn"
    path.write_text(f"{HEAD}Datatype: d\n    EquivalentTo: xsd:string[{facets}]\n", encoding="utf-8")
    assert load(path, builtin=False).diagnostics == ()


NAMES = st.sampled_from(
    [":a", "b", "owl:Thing", "x:some", "not", "some", "5a", "Facts", ":Types", "integer", "<http://x/i>"]
)
ITEMS = st.lists(
    st.tuples(NAMES, st.sampled_from([" some ", " only ", "\n value ", " min 1 ", " "]), NAMES)
    .map("".join)
    .map(lambda text: text if len(text.split()) > 2 else text.split()[0])
    | NAMES,
    max_size=3,
)
FACTS = st.lists(st.tuples(NAMES, NAMES).map(" ".join), max_size=3)
SIMPLE = "Prefix: : <http://x/#>\nPrefix: x: <http://y/#>\nPrefix: owl: <http://www.w3.org/2002/07/owl#>\n"


def meant(text: str) -> object:
    """Return the triples of a text, its nameless nodes numbered as they occur, or the codes and lines of its errors."""
    nodes: dict[object, int] = {}
    try:
        return [
            (
                *(nodes.setdefault(t, len(nodes)) if isinstance(t, BNode) else t for t in (one.subject, one.object)),
                one.predicate,
                one.span,
            )
            for one in read(text, SIMPLE)
        ]
    except BadInput as problem:
        return [(one.code, one.span and one.span.line) for one in problem.diagnostics]


@given(st.lists(st.tuples(st.booleans(), NAMES, ITEMS, FACTS)))
@settings(max_examples=examples(150), deadline=None)
def test_what_is_read_as_one_word_means_what_the_grammar_says(
    frames: list[tuple[bool, str, list[str], list[str]]],
) -> None:
    """A comment behind an item keeps it from being read so."""
    text = ""
    for is_class, name, items, facts in frames:
        text += f"{'Class' if is_class else 'Individual'}: {name}@"
        text += f" {'SubClassOf' if is_class else 'Types'}: {'@, '.join(items)}@" if items else ""
        text += f" Facts: {'@, '.join(facts)}@" if facts and not is_class else ""
    assert meant(text.replace("@", "\n")) == meant(text.replace("@", " #\n"))


def test_runs_of_simple_items_have_the_positions_of_their_words() -> None:
    text = "Class: :A\n  SubClassOf: :B,\n    :p some :C,  :q value\n  :d\nIndividual: :i Facts: :p :j,\n :q :k\n"
    assert [(t.span.line - 3, t.span.column) for t in read(text, SIMPLE)] == [
        (1, 8), (2, 15), (3, 5), (3, 5), (3, 5), (3, 13), (3, 18), (3, 18), (3, 18), (4, 3), (5, 13), (5, 23), (6, 2),
    ]  # fmt: skip
