"""Ontologies that are written are read as they were, in every syntax, whatever order and labels the triples have."""

import json
import random
from functools import cache
from pathlib import Path

import pytest
from click.testing import CliRunner
from examples import examples
from hypothesis import given, settings
from hypothesis import strategies as st
from rdf_graphs import Graph, graph_of, read_by_rdflib, same

from executive.cli.app import app
from planlang.diagnostics import Span
from planlang.files import bundled
from planlang.ontology import BNode, Literal, Term, Triple
from planlang.ontology.canonical import differences, labelled
from planlang.ontology.convert import Target, convert, write
from planlang.ontology.documents import Syntax, read_syntax, syntax_of
from planlang.ontology.manchester import read_manchester
from planlang.ontology.terms import RDF, XSD
from planlang.ontology.triples import Parsed
from tests.support.examples import some

OURS = sorted([*bundled("ontologies").rglob("*.omn"), *bundled("recipes").rglob("*.omn")])
RDF_TARGETS = [Target.TURTLE, Target.NTRIPLES, Target.RDFXML]
FORMAT = {Target.TURTLE: "turtle", Target.NTRIPLES: "nt", Target.RDFXML: "xml"}
BASE = "http://example.org/base"
T = "http://example.org/t#"


def read(text: str) -> list[Triple]:
    return read_syntax(text.encode(), "t", base=BASE, label="b").triples if text.strip() else []


def shuffled(triples: list[Triple], seed: int) -> list[Triple]:
    """The same graph in another order and with other labels."""
    draw = random.Random(seed)
    numbers: dict[BNode, BNode] = {}

    def other(term: Term) -> Term:
        return numbers.setdefault(term, BNode(f"x{draw.random()}")) if isinstance(term, BNode) else term

    changed = [Triple(other(t.subject), t.predicate, other(t.object), t.span) for t in triples]  # type: ignore[arg-type]
    draw.shuffle(changed)
    return changed


@cache
def ours(path: Path) -> Parsed:
    return read_manchester(path.read_bytes(), path.name, base=BASE)


@cache
def written(path: Path, target: Target) -> tuple[str, list[Triple]]:
    """The text of one of our ontologies, and what is lost."""
    return write(ours(path).triples, target, ours(path).prefixes)


@cache
def graph_of_ours(path: Path) -> Graph:
    return graph_of(ours(path).triples)


@pytest.mark.parametrize("path", some(OURS), ids=lambda path: path.name)
def test_our_ontologies_survive_manchester_syntax(path: Path) -> None:
    text, lost = written(path, Target.MANCHESTER)
    again = read_manchester(text.encode(), path.name, base=BASE)
    assert lost == []
    assert same(graph_of(again.triples), graph_of_ours(path))
    assert write(again.triples, Target.MANCHESTER, again.prefixes)[0] == text


@pytest.mark.long
@pytest.mark.parametrize("target", some(RDF_TARGETS))
def test_our_ontologies_survive_every_syntax_of_rdf_and_come_back_to_the_same_text(target: Target) -> None:
    for path in OURS:
        text, lost = written(path, target)
        assert lost == []
        assert same(read_by_rdflib(text, FORMAT[target], BASE), graph_of_ours(path)), path.name
        again = read(text)
        before, _ = written(path, Target.MANCHESTER)
        assert write(again, Target.MANCHESTER, ours(path).prefixes)[0] == before, path.name


@pytest.mark.parametrize("target", some(Target, every=2))
def test_neither_order_nor_labels_of_triples_change_a_byte(target: Target) -> None:
    for path in OURS:
        text, _ = written(path, target)
        assert write(shuffled(ours(path).triples, 1), target, ours(path).prefixes)[0] == text, path.name


@pytest.mark.long
@pytest.mark.parametrize("target", some(RDF_TARGETS))
def test_real_files_survive_every_syntax_of_rdf(corpus: Path, target: Target) -> None:
    paths = [
        path for folder in ("recipes", "environments", "objects") for path in sorted((corpus / folder).glob("*.owl*"))
    ]
    for path in paths:
        converted = convert(path, target)
        assert differences(converted.triples, read(converted.text)) == ([], []), path.name
        assert not {"O050", "O051", "O052"} & {found.code for found in converted.diagnostics}


def test_what_manchester_syntax_does_to_real_recipes_is_told(corpus: Path) -> None:
    """Declarations are added, and intersections of one class become that class; more is lost of two files only."""
    losing = {}
    for path in sorted((corpus / "recipes").iterdir()):
        converted = convert(path, Target.MANCHESTER)
        codes = {found.code for found in converted.diagnostics}
        gone, new = differences(converted.triples, read(converted.text))
        assert bool(gone or new) == bool(codes & {"O050", "O051", "O052"}), path.name
        if "O050" in codes:
            losing[path.name] = codes
    assert set(losing) == {"object-search-recipe@hydro.owl", "pancake@kinetic.owl"}


names = st.sampled_from(["a", "b-c", "some", "1x", "é", "x%20y", "o", "p.q"]).map(lambda name: T + name)
nodes = st.sampled_from("uvwxyz").map(BNode)
literals = st.builds(
    Literal,
    st.text(st.characters(codec="utf-8", exclude_categories=["Cc", "Cs"]), max_size=5) | st.just('a"\\\n\t'),
    st.sampled_from([None, XSD.string, XSD.integer, T + "type"]),
)
graphs = st.lists(st.tuples(names | nodes, names, names | nodes | literals), max_size=12).map(
    lambda found: [Triple(s, p, o, Span("t")) for s, p, o in found]
)


@given(graphs, st.sampled_from(RDF_TARGETS))
@settings(max_examples=examples(150))
def test_any_graph_survives_every_syntax_of_rdf(graph: list[Triple], target: Target) -> None:
    text, lost = write(graph, target, {"t": T})
    kept = [triple for triple in labelled(graph) if triple not in lost]
    assert same(graph_of(read(text)), graph_of(kept))
    assert target is Target.RDFXML or not lost


@given(graphs, st.integers(0, 9))
@settings(max_examples=examples(100))
def test_any_graph_is_written_alike_from_whatever_order(graph: list[Triple], seed: int) -> None:
    assert write(shuffled(graph, seed), Target.NTRIPLES, {}) == write(graph, Target.NTRIPLES, {})


@pytest.mark.parametrize("target", [Target.TURTLE, Target.NTRIPLES])
def test_an_iri_with_characters_that_none_may_have_is_escaped(target: Target) -> None:
    triples = [Triple(T + "a b", T + "<p>", T + "\\", Span("t"))]
    assert differences(triples, read(write(triples, target, {})[0])) == ([], [])


def test_lists_of_any_length_are_written_as_lists() -> None:
    triples = read("<#a> <#p> ( " + "<#b> " * 300 + ") .")
    for target in (Target.TURTLE, Target.RDFXML):
        text, _ = write(triples, target, {})
        assert "first" not in text
        assert differences(triples, read(text)) == ([], [])


def test_a_list_that_bites_its_tail_is_written_cell_by_cell() -> None:
    triples = read(f"<#a> <#p> _:x . _:x <{RDF}first> 1 ; <{RDF}rest> _:y . _:y <{RDF}first> 2 ; <{RDF}rest> _:x .")
    for target in RDF_TARGETS:
        assert differences(triples, read(write(triples, target, {})[0])) == ([], [])


def test_the_command_converts_and_tells_what_changes(tmp_path: Path) -> None:
    source = tmp_path / "a.ttl"
    source.write_text("@prefix : <http://example.org/t#> .\n:a a :A .\n")
    output = tmp_path / "a.omn"
    result = CliRunner().invoke(app, ["convert", str(source), "--to", "manchester", "-o", str(output), "--json"])
    assert result.exit_code == 0
    assert [found["code"] for found in json.loads(result.stdout)["diagnostics"]] == ["O051"]
    assert output.read_text() == "Prefix: : <http://example.org/t#>\n\nIndividual: a\n    Types: A\n"


@pytest.mark.parametrize("target", Target)
def test_a_text_is_told_to_be_of_the_syntax_that_it_is_written_in(target: Target) -> None:
    others = {
        Target.MANCHESTER: Syntax.MANCHESTER,
        Target.RDFXML: Syntax.RDFXML,
        Target.FUNCTIONAL: Syntax.FUNCTIONAL,
        Target.OWLXML: Syntax.OWLXML,
    }
    expected = others.get(target, Syntax.TURTLE)
    converted = convert(bundled("recipes") / "serve_a_drink.omn", target)
    assert [one.code for one in converted.diagnostics] == ["O053"]  # its comments
    assert syntax_of(converted.text, "t") is expected


SUFFIXES = {Target.MANCHESTER: ".omn", Target.TURTLE: ".ttl", Target.NTRIPLES: ".nt", Target.RDFXML: ".owl"}


def there_and_back(path: Path, target: Target, folder: Path, source: Target = Target.MANCHESTER) -> str:
    """A file converted to a syntax and back."""
    there = folder / f"there{SUFFIXES[target]}"
    there.write_text(convert(path, target).text)
    return convert(there, source).text


def in_order(path: Path) -> list[tuple[str, list[str]]]:
    """The named subjects of a file in their order, each with the names and texts that are said of it, in order."""
    found: dict[str, list[str]] = {}
    for triple in sorted(read_syntax(path.read_bytes(), path.name, base=BASE, label="b").triples, key=lambda t: t.span):
        if isinstance(triple.subject, str):
            found.setdefault(triple.subject, [])
            if not isinstance(triple.object, BNode) and triple.predicate != RDF.type:
                found[triple.subject].append(f"{triple.predicate} {triple.object}")
    return list(found.items())


@pytest.mark.parametrize("target", [Target.TURTLE, Target.RDFXML])
@pytest.mark.parametrize("path", some(OURS, every=9), ids=lambda path: path.name)
def test_converted_there_and_back_a_file_keeps_order_prefixes_and_what_it_says_of_itself(
    path: Path, target: Target, tmp_path: Path
) -> None:
    again = tmp_path / "again.omn"
    again.write_text(there_and_back(path, target, tmp_path))
    before, after = in_order(path), in_order(again)
    assert [subject for subject, _ in after] == [subject for subject, _ in before]
    assert [sorted(said) for _, said in after] == [sorted(said) for _, said in before]
    prefixes = ours(path).prefixes
    kept = read_manchester(again.read_bytes(), again.name, base=BASE).prefixes
    assert prefixes.items() <= kept.items()
    assert there_and_back(again, target, tmp_path) == again.read_text()


def test_label_comment_and_unused_prefixes_of_an_ontology_survive_each_syntax(tmp_path: Path) -> None:
    source = tmp_path / "source.omn"
    source.write_text("""Prefix: : <http://example.org/t#>
Prefix: rdfs: <http://www.w3.org/2000/01/rdf-schema#>
Prefix: unused: <http://example.org/unused#>

Ontology: <http://example.org/t>
    Annotations: rdfs:label "zebras", rdfs:comment "and others"

Individual: z
    Types: Zebra, Animal

Class: Zebra
    Annotations: rdfs:comment "striped", rdfs:label "zebra"
    SubClassOf: Horse, Animal

Class: Horse

Class: Animal
""")
    for target in (Target.MANCHESTER, Target.TURTLE, Target.RDFXML):
        assert there_and_back(source, target, tmp_path) == source.read_text(), target
    without = there_and_back(source, Target.NTRIPLES, tmp_path)
    assert without == source.read_text().replace("Prefix: unused: <http://example.org/unused#>\n", "")


def test_comments_and_prefixes_that_a_syntax_cannot_hold_are_listed(tmp_path: Path) -> None:
    source = tmp_path / "source.ttl"
    source.write_text('# one\n@prefix : <http://example.org/t#> .\n:a :b "# none" . # two\n')
    (note,) = [one for one in convert(source, Target.NTRIPLES).diagnostics if one.code == "O053"]
    assert (note.message, note.span and note.span.line) == ("2 comments and a prefix are not kept", 1)


def test_real_files_keep_their_order_in_turtle(corpus: Path, tmp_path: Path) -> None:
    path = corpus / "recipes" / "serve_drink@re_stack.owl"
    again = tmp_path / "again.owl"
    again.write_text(there_and_back(path, Target.TURTLE, tmp_path, Target.RDFXML))
    before, after = in_order(path), in_order(again)
    assert [subject for subject, _ in after] == [subject for subject, _ in before]
