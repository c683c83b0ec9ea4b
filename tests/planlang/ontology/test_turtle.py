"""Turtle and N-Triples: the triples that rdflib finds, positions, and mistakes."""

from pathlib import Path

import pytest
import rdflib
from examples import examples
from hypothesis import given, settings
from hypothesis import strategies as st
from rdf_graphs import graph_of, read_by_rdflib, same

from planlang.diagnostics import BadInput, Diagnostic, Span
from planlang.ontology import Literal, Triple, load
from planlang.ontology.convert import Target, write
from planlang.ontology.rdfxml import read_rdfxml
from planlang.ontology.terms import RDF, XSD
from planlang.ontology.turtle import read_turtle

BASE = "http://example.org/folder/base.ttl"
HEAD = "@prefix : <http://example.org/t#> .\n@prefix xsd: <http://www.w3.org/2001/XMLSchema#> .\n"
T = "http://example.org/t#"


def read(text: str, head: str = HEAD) -> list[Triple]:
    return read_turtle((head + text).encode(), "t.ttl", base=BASE).triples


def problems(text: str, head: str = HEAD) -> tuple[Diagnostic, ...]:
    try:
        read_turtle((head + text).encode(errors="surrogatepass"), "t.ttl", base=BASE)
    except BadInput as problem:
        return problem.diagnostics
    return ()


EVERYTHING = (
    r"""
PREFIX e: <http://example.org/e/>
prefix x.y-1: <relative#>
@prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#>. # a comment behind a statement
:a a :B ; :p :c , :d ;; :q e:f ; .
e:a.b :p e:, e:1a, e:a:b, e:a%20b, e:\~tilde, e:m\,n, x.y-1:z, :Möbel, :a-b, :_c .
:n :p 1 , -2 , 3.5 , -0.50 , 1e3 , 1.E-2, -.5e+7 , true , false .
:s :p "a", 'b', "", '', "\"quoted\" \\ \t\n", 'it\'s', "tag"@EN-gb, 'typed'^^xsd:token, "u\u00e9\U0001F600" .
:s :p '''it's ''long''
too'''@de , "\"" , ''''a''b'''@en .
[] :p [] .
[ :p :a ; :q ( ) , ( 1 "two" ( :three ) [ :p ( :a ) ] ) ] .
[ :p :a ] :q :b .
( :a :b ) :p _:x, _:x.y , _:1 .
_:x :q _:x .
<#this> <p> <../up>, <//host/path>, <>, <http://other.org/#\u00e9> .
@prefix a: <http://example.org/a#> .
:a a:a :b; a a:a .
@base <http://example.net/other/> .
<here> a<there>.
BASE <deeper/>
<here> :p :a.
:s :q """
    + '"""long "text" of\ntwo lines""" , """" quoted""", """\\"""" .'
)


def test_everything_that_turtle_has_is_read_as_rdflib_reads_it() -> None:
    expected = read_by_rdflib(HEAD + EVERYTHING, "turtle", BASE)
    assert len(expected) > 70
    assert same(graph_of(read(EVERYTHING)), expected)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("serialization", ["turtle", "nt"])
def test_real_files_written_by_rdflib_are_read_as_it_reads_them(corpus: Path, serialization: str) -> None:
    compared = 0
    for path in sorted((corpus / "recipes").glob("*.owl*")):
        triples = read_rdfxml(path.read_bytes(), path.name, base=BASE).triples
        if len(graph_of(triples)) < 320:  # rdflib takes seconds to write and read larger ones
            lines, _ = write(triples, Target.NTRIPLES, {})
            text = rdflib.Graph().parse(data=lines, format="nt").serialize(format=serialization)
            assert same(graph_of(read(text, head="")), read_by_rdflib(text, "turtle", BASE)), path.name
            compared += 1
    assert compared == 9


iris = st.tuples(
    st.sampled_from([T, "http://example.org/e/", "urn:x:"]), st.from_regex(r"[aZé漢][aZ19_é漢-]{0,5}", fullmatch=True)
).map(lambda parts: rdflib.URIRef("".join(parts)))  # of other names rdflib makes what is no Turtle
nameless = st.sampled_from("abcde").map(rdflib.BNode)
texts = st.text(st.characters(codec="utf-8", exclude_characters="\x00"), max_size=12)
literals = st.one_of(
    texts.map(rdflib.Literal),
    st.tuples(texts, st.sampled_from(["en", "de-at"])).map(lambda pair: rdflib.Literal(pair[0], pair[1])),
    st.tuples(texts, iris).map(lambda pair: rdflib.Literal(pair[0], datatype=pair[1])),
    st.integers().map(rdflib.Literal),
    st.decimals(allow_nan=False, allow_infinity=False, places=3).map(rdflib.Literal),
    st.booleans().map(rdflib.Literal),
)
graphs = st.lists(st.tuples(st.one_of(iris, nameless), iris, st.one_of(iris, nameless, literals)), max_size=8)


@given(graphs, st.sampled_from(["turtle", "nt", "longturtle"]))
@settings(max_examples=examples(120))
def test_what_rdflib_writes_is_read_as_it_reads_it(
    triples: list[tuple[rdflib.term.Node, ...]], serialization: str
) -> None:
    graph = rdflib.Graph()
    for triple in triples:
        graph.add(triple)  # type: ignore[arg-type]
    text = graph.serialize(format=serialization)
    if text.strip():
        assert same(graph_of(read(text, head="")), read_by_rdflib(text, "turtle", BASE))


def test_a_triple_stands_in_the_line_where_it_ends_and_one_with_a_nested_node_where_that_says_something() -> None:
    triples = read(
        ":a a :B ;\n   :p :c ,\n      [ :q\n 5 ;\n :r :c\n ] .\n"
        ':b :p """text\nof two lines""" ; :q :d ;\n :r ( :e\n :f ) .\n'
    )
    assert [(t.predicate.rpartition("#")[2], t.span.line - 2) for t in triples] == [
        ("type", 1),
        ("p", 2),
        ("q", 4),
        ("r", 5),
        ("p", 4),
        ("p", 7),
        ("q", 7),
        ("first", 9),
        ("r", 9),
        ("first", 10),
        ("rest", 10),
        ("rest", 10),
    ]


def test_values_keep_the_form_in_which_they_are_written() -> None:
    assert [t.object for t in read(':a :p 05 , +.5 , 1.50 , 1E0 , true , "x"@EN , "x"^^xsd:token .')] == [
        Literal("05", XSD.integer),
        Literal("+.5", XSD.decimal),
        Literal("1.50", XSD.decimal),
        Literal("1E0", XSD.double),
        Literal("true", XSD.boolean),
        Literal("x", None, "en"),
        Literal("x", XSD.token),
    ]


@pytest.mark.parametrize(
    ("reference", "iri"),
    [
        ("?query", "http://example.org/folder/base.ttl?query"),
        ("#", "http://example.org/folder/base.ttl#"),
        ("other#", "http://example.org/folder/other#"),
        ("", "http://example.org/folder/base.ttl"),
        ("package://x/y.owl", "package://x/y.owl"),
    ],
)
def test_references_are_made_absolute_by_the_rules_of_iris(reference: str, iri: str) -> None:
    assert [t.object for t in read(f":a :p <{reference}> .")] == [iri]


def test_an_empty_list_is_nil() -> None:
    assert [t.object for t in read(":a :p ( ) .")] == [RDF.nil]


@pytest.mark.parametrize(
    ("text", "line", "column", "expected"),
    [
        (":a :p .", 3, 7, "an <IRI>"),
        (":a :p :b", 3, 9, "'.'"),
        (":a :p ( :b .", 3, 12, "] or )"),
        (':a :p "open .\n:b :p :c .', 3, 7, "close it"),
        (':a :p "two\nlines" .', 3, 7, '"""'),
        (":a 5 :b .", 3, 4, "'a'"),
        ("@prefx x: <y> .", 3, 1, "did you mean @prefix?"),
        (':a :p "\\q" .', 3, 8, "backslash"),
        (":a :p <http://x.org/a b> .", 3, 7, "%20"),
        (":a :p <http://x.org/a .\n:b :p <c> .", 3, 7, ">"),
        (":a :p :b\n\n# the end\n", 3, 9, "'.'"),
        (":a :p <http://x.org/\\u0000> .", 3, 1, "u0000"),
        (":a :p << :b :p :c >> .", 3, 7, "a blank node"),
        (":a :p <<( :b :p :c )>> .", 3, 7, "a blank node"),
        (":a :p :b {| :q :c |} .", 3, 1, "a blank node"),
        (':a :p "\\ud800" .', 3, 8, "backslash"),
    ],
)
def test_a_syntax_error_says_where_it_is_and_what_was_expected(
    text: str, line: int, column: int, expected: str
) -> None:
    problem = problems(text)[0]
    assert problem.span is not None
    assert (problem.code, problem.span.line, problem.span.column) == ("O020", line, column)
    assert problem.help is not None
    assert expected in problem.help


def test_all_errors_are_reported_in_one_run() -> None:
    found = problems(":a :p .\n:b :p :c .\nunknown:x :p :c .\n:c :p :d , .\n:d :p :e .\n")
    assert [(d.code, d.span.line) for d in found if d.span] == [("O020", 3), ("O021", 5), ("O020", 6)]


def test_what_follows_an_error_is_read_and_reported_once_a_line() -> None:
    found = problems(':a :p "open .\n:b :p <a b> .\n:c 5 :d .\nx:y :p :z .\nx:z :p "\\q" .\n:f :p "\\q" .\n')
    assert [(d.code, d.span.line) for d in found if d.span] == [
        ("O020", 3),
        ("O020", 4),
        ("O020", 5),
        ("O021", 6),
        ("O020", 7),
        ("O020", 8),
    ]


def test_escapes_may_put_any_character_into_an_iri() -> None:
    assert [t.object for t in read(r":a :p <http://x.org/a\u0020b@c> .")] == ["http://x.org/a b@c"]


def test_a_text_of_a_megabyte_in_many_lines_is_read_in_time_and_a_longer_one_refused() -> None:
    line = "a line of a text that has very many of them\n"
    assert len(read(f':a :p """{line * 20_000}""" .')) == 1
    assert [d.code for d in problems(f':a :p """{line * 30_000}""" .')] == ["O008"]
    assert [d.code for d in problems(f":a :p <http://x.org/{'x' * 2_000_000}> .")] == ["O008"]


def test_a_word_of_megabytes_is_refused_before_the_parser_sees_it() -> None:
    for before, word in (("", ":"), ("", "_:"), ("", "5"), ('"t"', "@e")):
        (found,) = problems(f":a :p :b .\n:a :p {before}{word}{'1' * 2_000_000} .")
        assert (found.code, found.span) == ("O008", Span("t.ttl", 4, 7 + len(before)))
    names = ", ".join(f":b{number}" for number in range(100_000))
    assert len(read(f":a :p {names} .")) == 100_000, "a line may be longer"


def test_an_undeclared_prefix_that_everybody_knows_is_a_warning() -> None:
    parsed = read_turtle((HEAD + ":a owl:sameAs :b . :c owl:sameAs :d .").encode(), "t.ttl", base=BASE)
    assert [t.predicate for t in parsed.triples] == ["http://www.w3.org/2002/07/owl#sameAs"] * 2
    assert [d.code for d in parsed.diagnostics] == ["O021"]


@pytest.mark.parametrize(
    "text",
    [
        HEAD + ":a a :B .",
        "# a comment\n\nPREFIX : <http://example.org/t#>\n:a a :B .",
        "@base <http://example.org/t> .\n<#a> a <#B> .",
        f"<{T}a> <{RDF.type}> <{T}B> .\n",
        f"<{T}a>\n  a <{T}B> .",
        f"_:x <{T}p> <{T}c> .\n<{T}a> a <{T}B> .",
        f"[ <{T}p> <{T}c> ] .\n<{T}a> a <{T}B> .",
        f"\ufeff<{T}a> a <{T}B> .",
    ],
)
def test_turtle_is_told_by_its_content(tmp_path: Path, text: str) -> None:
    path = tmp_path / "t.owl"
    path.write_text(text, encoding="utf-8")
    assert load(path, builtin=False).individuals(T + "B") == (T + "a",)


def test_a_file_in_turtle_may_be_imported(tmp_path: Path) -> None:
    (tmp_path / "parts.ttl").write_text(HEAD + ":a a :B .")
    main = tmp_path / "main.omn"
    main.write_text("Prefix: : <http://example.org/m#>\nOntology: <http://example.org/m>\n    Import: <parts.owl>\n")
    ontology = load(main, builtin=False)
    assert ontology.diagnostics == ()
    assert ontology.individuals(T + "B") == (T + "a",)


@given(st.text(max_size=100))
@settings(max_examples=examples(150))
def test_any_text_is_read_or_refused_with_positions(text: str) -> None:
    assert all(d.span is not None and d.span.line > 0 and d.span.column > 0 for d in problems(text))


TOKENS = [
    *(
        "@prefix",
        "@base",
        "PREFIX",
        "BASE",
        "x:",
        ":a",
        ":p",
        "<http://x>",
        "<",
        ">",
        "_:b",
        "a",
        "true",
        "5",
        "5.",
        ".",
    ),
    *("[", "]", "(", ")", ";", ",", '"t"', '"""', "'", "\\", "@en", "^^", "xsd:int", "\n", "# no\n", "\u00b7"),
]


@given(st.lists(st.sampled_from(TOKENS), max_size=25))
@settings(max_examples=examples(200))
def test_any_words_of_the_language_are_read_or_refused_with_positions(tokens: list[str]) -> None:
    assert all(d.span is not None and d.span.line > 0 for d in problems(" ".join(tokens)))


@pytest.mark.parametrize("opening", ["(", "[ :p ", "( [ :p "])
def test_nameless_things_are_nested_only_so_deep(opening: str) -> None:
    assert [d.code for d in problems(":a :p " + opening * 500_000)] == ["O008"]
