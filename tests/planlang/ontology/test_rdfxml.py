"""RDF/XML: rdflib finds the same graphs, and real files hold what an independent script found in them."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from rdf_graphs import graph_of, read_by_rdflib, same

from planlang.ontology import Literal, Ontology, Term, load
from planlang.ontology.moved_names import canonical
from planlang.ontology.rdfxml import read_rdfxml
from planlang.ontology.terms import OWL, RDFS

BASE = "http://example.org/base.owl"
REPAIRED = {"acat-adt_example_pipetting@master.owl": 1, "exploration-recipe@hydro.owl": 1}
"""Files of the corpus that are no XML until repaired -> how many repairs they need."""


def corpus_files(corpus: Path) -> Iterator[Path]:
    for folder in ("recipes", "ontologies", "robots", "environments", "objects"):
        yield from sorted((corpus / folder).glob("*.owl*"))


@pytest.mark.long
@pytest.mark.filterwarnings("ignore")
def test_every_corpus_file_has_the_triples_that_rdflib_finds(corpus: Path) -> None:
    compared = 0
    for path in corpus_files(corpus):
        parsed = read_rdfxml(path.read_bytes(), path.name, base=BASE)
        if path.name in REPAIRED:
            assert len(parsed.diagnostics) == REPAIRED[path.name]
            continue
        assert same(graph_of(parsed.triples), read_by_rdflib(path.read_bytes(), "xml", BASE)), path.name
        compared += 1
    assert compared == 55


DOCUMENT = """<rdf:RDF xmlns="http://example.org/t#" xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#"
  xmlns:e="http://example.org/t#" {head}>{body}</rdf:RDF>"""


@pytest.mark.parametrize(
    "body",
    [
        '<e:A rdf:about="#a"/>',
        '<e:A rdf:about=""/>',
        '<e:A xmlns:xml="http://www.w3.org/XML/1998/namespace" rdf:about="#a"/>',
        '<e:A rdf:ID="a" e:p="text"/>',
        '<e:A rdf:about="a/b"/>',
        '<e:A rdf:about="http://other.org/x"/>',
        '<e:A rdf:about="urn:x:y"/>',
        '<e:A xml:base="http://other.org/y.owl" rdf:about="#a"><e:p rdf:resource="#b"/></e:A>',
        '<rdf:Description rdf:about="#a" rdf:type="http://example.org/t#A"/>',
        '<rdf:Description rdf:about="#a"><e:p>text &amp; more</e:p></rdf:Description>',
        '<rdf:Description rdf:about="#a"><e:p></e:p></rdf:Description>',
        '<rdf:Description rdf:about="#a"><e:p xml:lang="en">text</e:p></rdf:Description>',
        '<rdf:Description rdf:about="#a" xml:lang="de"><e:p>text</e:p><e:q xml:lang="">t</e:q></rdf:Description>',
        '<rdf:Description rdf:about="#a"><e:p rdf:datatype="http://www.w3.org/2001/XMLSchema#int">3</e:p>'
        "</rdf:Description>",
        '<rdf:Description rdf:nodeID="x"><e:p rdf:nodeID="x"/></rdf:Description>',
        '<rdf:Description rdf:nodeID="x"><e:p rdf:nodeID="y"/></rdf:Description><e:A rdf:nodeID="y"/>',
        '<rdf:Description rdf:about="#a"><e:p e:q="text"/></rdf:Description>',
        '<rdf:Description rdf:about="#a"><e:p rdf:resource="#b" e:q="text"/></rdf:Description>',
        '<rdf:Description rdf:about="#a"><e:p><e:B rdf:about="#b"><e:q>1</e:q></e:B></e:p></rdf:Description>',
        '<rdf:Description rdf:about="#a"><e:p rdf:ID="s" rdf:resource="#b"/></rdf:Description>',
        '<rdf:Description rdf:about="#a"><e:p rdf:parseType="Resource"><e:q>1</e:q><e:q>2</e:q></e:p>'
        "</rdf:Description>",
        '<rdf:Description rdf:about="#a"><e:p rdf:parseType="Collection"/></rdf:Description>',
        '<rdf:Description rdf:about="#a"><e:p rdf:parseType="Collection"><e:B rdf:about="#b"/><e:C><e:q>1</e:q></e:C>'
        "</e:p></rdf:Description>",
        '<rdf:Bag rdf:about="#a"><rdf:li>1</rdf:li><rdf:li rdf:resource="#b"/><rdf:_7>7</rdf:_7></rdf:Bag>',
        '<rdf:Description rdf:about="#a"><e:p><!-- nothing -->te<!-- between -->xt<![CDATA[<&]]></e:p>'
        "</rdf:Description>",
        '<rdf:Description rdf:about="#a"><e:p> <e:B/> </e:p></rdf:Description>',
    ],
)
@pytest.mark.parametrize("head", ["", 'xml:base="http://example.org/t"', 'xml:base="http://example.org/d/t#"'])
def test_each_form_of_rdf_xml_has_the_triples_that_rdflib_finds(head: str, body: str) -> None:
    text = DOCUMENT.format(head=head, body=body).encode()
    parsed = read_rdfxml(text, "t.owl", base=BASE)
    assert parsed.diagnostics == []
    assert same(graph_of(parsed.triples), read_by_rdflib(text, "xml", BASE))


def test_an_xml_literal_keeps_its_markup() -> None:
    body = (
        '<e:A rdf:about="#a"><e:p rdf:parseType="Literal">a <b xmlns="http://h.org/" c="1&lt;">b</b> &amp;</e:p></e:A>'
    )
    parsed = read_rdfxml(DOCUMENT.format(head="", body=body).encode(), "t.owl", base=BASE)
    value = parsed.triples[-1].object
    assert isinstance(value, Literal)
    assert value.value == 'a <b xmlns="http://h.org/" c="1&lt;">b</b> &amp;'
    assert value.datatype is not None
    assert value.datatype.endswith("#XMLLiteral")


def test_a_triple_stands_where_its_element_begins() -> None:
    text = DOCUMENT.format(
        head="", body='\n  <e:A rdf:about="#a">\n    <e:p>1</e:p>\n    <e:q\n      rdf:resource="#b"/></e:A>'
    )
    parsed = read_rdfxml(text.encode(), "t.owl", base=BASE)
    assert [(t.span.line, t.span.column) for t in parsed.triples] == [(3, 3), (4, 5), (5, 5)]


def test_columns_count_characters_not_bytes() -> None:
    body = '<rdf:Description rdf:about="#Möbel" e:p="ü"/><e:A rdf:about="#ä"/>'
    parsed = read_rdfxml(DOCUMENT.format(head="", body="\n" + body).encode(), "t.owl", base=BASE)
    assert [t.span.column for t in parsed.triples] == [1, body.index("<e:A") + 1]


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "iso-8859-1"])
def test_encodings_are_told_by_byte_order_mark_or_declaration(encoding: str) -> None:
    text = f'<?xml version="1.0" encoding="{encoding.removesuffix("-sig")}"?>' + DOCUMENT.format(
        head="", body='<e:A rdf:about="http://x.org/Möbel"/>'
    )
    parsed = read_rdfxml(text.encode(encoding), "t.owl", base=BASE)
    assert parsed.triples[0].subject == "http://x.org/Möbel"


def test_labels_of_nameless_nodes_are_the_same_in_every_run() -> None:
    text = DOCUMENT.format(head="", body="<e:A><e:p><e:B/></e:p></e:A>").encode()
    first = read_rdfxml(text, "t.owl", base=BASE).triples
    assert first == read_rdfxml(text, "t.owl", base=BASE).triples


MISTAKES = {"malformed XML comment removed x1": "O006", "duplicate XML attribute xmlns:acat removed x1": "O007"}
"""How the truth names a mistake -> the code that tells of it here."""

KINDS = {"some": "someValuesFrom", "value": "hasValue", "only": "allValuesFrom"}


def truths(corpus: Path) -> Iterator[tuple[str, dict[str, Any], Path]]:
    """Name, truth and file of everything that is an ontology."""
    for path in sorted((corpus / "truth").glob("*.owl*.json")):
        truth = json.loads(path.read_text())
        files = [corpus / truth["file"], corpus / "recipes" / truth["file"]]
        yield path.name, truth, next(file for file in files if file.is_file())


@pytest.fixture(scope="module")
def read(corpus: Path) -> dict[str, tuple[dict[str, Any], Ontology]]:
    """Name of a truth -> it, and its file alone."""
    return {name: (truth, load(file, builtin=False)) for name, truth, file in truths(corpus)}


Read = dict[str, tuple[dict[str, Any], Ontology]]


def test_all_truths_are_compared(read: Read) -> None:
    assert (len(read), sum("triples" in truth for truth, _ in read.values())) == (29, 27)


def test_every_file_has_the_number_of_triples_that_the_truth_states(read: Read) -> None:
    """Without what is stated twice, and without the types that restrictions were given on reading (O014)."""
    for name, (truth, ontology) in read.items():
        if "triples" in truth:
            found = {(t.subject, t.predicate, t.object) for t in main_triples(ontology)}
            added = [d.message.partition(" ")[0] for d in ontology.diagnostics if d.code == "O014"]
            number = sum(1 if words == "a" else int(words) for words in added)
            assert len(found) - number == truth["triples"], name


def main_triples(ontology: Ontology) -> list[Any]:
    file = str(ontology.documents[0].path)
    return [triple for triple in ontology.triples() if triple.span.file == file]


def test_every_repair_is_reported_and_no_other(read: Read) -> None:
    for name, (truth, ontology) in read.items():
        found = [d.code for d in ontology.diagnostics if d.code in ("O005", "O006", "O007", "O010", "O016")]
        assert found == [MISTAKES[words] for words in truth["repairs"]], name


def test_every_import_is_found(read: Read) -> None:
    for name, (truth, ontology) in read.items():
        if "imports" in truth:
            found = sorted({str(t.object) for t in main_triples(ontology) if t.predicate == OWL.imports})
            expected = sorted(canonical(address) for address in truth["imports"])
            assert filled(found) == filled(expected), name


def filled(addresses: list[str]) -> list[str]:
    """Addresses from behind the folder that a build would have filled in."""
    return [address.partition("/owl/")[2] or address for address in addresses]


def test_every_action_has_the_superclasses_labels_and_parameters_that_the_truth_states(read: Read) -> None:
    compared = 0
    for name, (truth, ontology) in read.items():
        for task in truth.get("tasks", ()):
            for iri, action in task["actions"].items():
                if "superclasses" not in action or not iri.startswith("http"):
                    continue
                if not ontology.defined(canonical(iri)):  # what the truth says of it stands in a nameless class
                    assert iri.endswith(("#GraspObjectWithRightGripper", "#GraspBottle"))
                    continue
                above = {canonical(cls) for cls in action["superclasses"] if cls.startswith("http")}
                assert above <= set(ontology.parents(canonical(iri))), (name, iri)
                labels = {v.value for v in ontology.values(canonical(iri), RDFS.label) if isinstance(v, Literal)}
                assert set(action["label"]) <= labels, (name, iri)
                found = {
                    (restriction.property, KINDS.get(restriction.kind), said(restriction.filler))
                    for restriction in ontology.restrictions(canonical(iri))
                }
                for parameter in action["params"]:
                    if "property_iri" in parameter and (value := stated(parameter["value"])) is not None:
                        key = (canonical(parameter["property_iri"]), parameter["kind"], value)
                        assert key in found, (name, iri, key)
                        compared += 1
    assert compared == 204


def said(term: Term) -> str:
    return term.value if isinstance(term, Literal) else str(term)


def stated(value: object) -> str | None:
    """Return what the truth has as the value of a parameter; None for what is no name and no literal."""
    if isinstance(value, dict):
        return value.get("literal") or (canonical(value["iri"]) if "iri" in value else None)
    return canonical(value) if isinstance(value, str) and value.startswith("http") else None


@pytest.mark.parametrize("name", ["ONT_knowrob@hydro.owl.json", "ONT_knowrob@2011-09_ias.owl.json"])
def test_the_actions_of_knowrob_have_the_sub_actions_and_orders_that_the_truth_states(read: Read, name: str) -> None:
    truth, ontology = read[name]
    assert len(truth["tasks"]) == 10
    for task in truth["tasks"]:
        own = ontology.restrictions(canonical(task["task"]))
        subs = [said(r.filler) for r in own if r.property.endswith("#subAction")]
        assert sorted(subs) == sorted(map(canonical, task["subactions"])), task["task"]
        orders = [r.filler for r in own if r.property.endswith("#orderingConstraints")]
        ends = {
            tuple(
                said(v) for p in ("occursBeforeInOrdering", "occursAfterInOrdering") for v in ontology.values(str(o), p)
            )
            for o in orders
        }
        assert ends == {tuple(map(canonical, pair)) for pair in task["constraints"]}, task["task"]
