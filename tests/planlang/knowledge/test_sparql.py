"""Questions in SPARQL: answered from the entries alone, within limits, whatever is asked."""

from __future__ import annotations

import socket
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pyoxigraph as ox
import pytest

from planlang.knowledge.entries import is_uid
from planlang.knowledge.sparql import Endpoint, Exceeded, Limits, NoAnswer

RECIPES = [(f"recipe.{number}", b'<urn:r%d> <urn:label> "r%d" .\n' % (number, number)) for number in range(300)]
EVERYTHING = "SELECT * { ?a ?b ?c }"


@pytest.fixture(scope="module")
def endpoint() -> Iterator[Endpoint]:
    made = Endpoint(Limits(seconds=1, memory=300_000_000, rows=400))
    made.start()
    assert all(made.put(uid, triples) for uid, triples in RECIPES)
    yield made
    made.close()


def test_entries_are_graphs_and_together_the_default_graph(endpoint: Endpoint) -> None:
    answer = endpoint.ask('SELECT ?g { GRAPH ?g { ?x <urn:label> "r7" } ?x <urn:label> ?l }')
    assert answer["results"]["bindings"] == [{"g": {"type": "uri", "value": "urn:entry:recipe.7"}}]
    assert endpoint.ask("ASK { <urn:r7> ?p 'r7' }")["boolean"] is True
    assert endpoint.ask("CONSTRUCT WHERE { <urn:r7> ?p ?o }")["triples"] == ['<urn:r7> <urn:label> "r7" .']


@pytest.mark.parametrize(
    ("question", "count"),
    [
        ("SELECT * FROM <urn:entry:recipe.7> { ?a ?b ?c }", 1),
        ("select * from <urn:entry:recipe.7> from <urn:entry:recipe.8> { ?a ?b ?c }", 2),
        ("SELECT * FROM NAMED <urn:entry:recipe.7> { GRAPH ?g { ?a ?b ?c } }", 1),
        ("SELECT * FROM NAMED <urn:entry:recipe.7> { ?a ?b ?c }", 0),
        ('SELECT * { ?from ?b ?c FILTER(?c != " FROM <urn:x> ") } # FROM <urn:entry:recipe.7>', 300),
        ("PREFIX from: <urn:> SELECT * { ?a from:label ?c }", 300),
    ],
)
def test_a_question_that_names_its_graphs_is_about_these_alone(endpoint: Endpoint, question: str, count: int) -> None:
    assert len(endpoint.ask(question)["results"]["bindings"]) == count


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("FILTER(" + "(" * 20_000 + "1" + ")" * 20_000 + ")", "more than 200 nested brackets"),
        ("{" * 20_000 + "}" * 20_000, "more than 200 nested brackets"),
        ("FILTER(" + "!" * 20_000 + "true)", "more than 200 nested brackets, or signs in a row"),
        ("FILTER(" + "||".join(["true"] * 20_000) + ")", "nested too deeply"),
        ("SERVICE <http://127.0.0.1/> { ?a ?b ?c }", "SERVICE is not supported"),
    ],
)
def test_what_the_engine_cannot_read_is_refused_with_its_reason(endpoint: Endpoint, text: str, reason: str) -> None:
    with pytest.raises(NoAnswer, match=reason):
        endpoint.ask(f"ASK {{ {text} }}")
    assert endpoint.ask("ASK { FILTER(" + "(" * 150 + "1" + ")" * 150 + ") }")["boolean"] is True
    assert endpoint.ask('ASK { ?service ?p ?o FILTER(?o != "SERVICE") }')["boolean"] is True


def test_what_is_put_and_dropped_is_answered_so(endpoint: Endpoint) -> None:
    endpoint.put("new", b'<urn:new> <urn:label> "new"@en .\n')
    question = "SELECT ?l { <urn:new> ?p ?l }"
    expected = {"type": "literal", "value": "new", "xml:lang": "en"}
    assert endpoint.ask(question)["results"]["bindings"] == [{"l": expected}]
    endpoint.drop("new")
    assert endpoint.ask(question)["results"]["bindings"] == []


@pytest.mark.parametrize("change", ["DELETE WHERE { ?a ?b ?c }", "DROP ALL", "LOAD <file:///etc/passwd>", "SELECT"])
def test_changes_and_nonsense_are_refused(endpoint: Endpoint, change: str) -> None:
    with pytest.raises(NoAnswer):
        endpoint.ask(change)
    assert len(endpoint.ask(EVERYTHING)["results"]["bindings"]) == 300


@pytest.mark.parametrize("silent", ["", "SILENT "])
def test_no_other_server_is_asked(endpoint: Endpoint, silent: str) -> None:
    with socket.socket() as listening:
        listening.bind(("127.0.0.1", 0))
        listening.listen()
        listening.settimeout(0.2)
        address = f"http://127.0.0.1:{listening.getsockname()[1]}/"
        try:
            endpoint.ask(f"SELECT * {{ SERVICE {silent}<{address}> {{ ?a ?b ?c }} }}")
        except NoAnswer:
            assert not silent
        with pytest.raises(TimeoutError):
            listening.accept()


def test_a_cross_product_is_cut_at_its_limit_and_the_next_question_is_answered(endpoint: Endpoint) -> None:
    began = time.monotonic()
    with pytest.raises(Exceeded, match="1 s"):
        endpoint.ask("SELECT (COUNT(*) AS ?n) { ?a ?b ?c . ?d ?e ?f . ?g ?h ?i . ?j ?k ?l }")
    assert time.monotonic() - began < 5
    assert endpoint.ask("ASK { <urn:r7> ?p ?o }")["boolean"] is True


def test_an_answer_of_too_many_rows_is_refused(endpoint: Endpoint) -> None:
    with pytest.raises(Exceeded, match="more than 400 rows"):
        endpoint.ask("SELECT * { ?a ?b ?c . ?d ?e ?f }")


def test_an_answer_of_too_many_bytes_is_refused_however_short_the_question(endpoint: Endpoint) -> None:
    doubled = " ".join(f"BIND(CONCAT(?x{n}, ?x{n}) AS ?x{n + 1})" for n in range(24))
    with pytest.raises(Exceeded, match="more than 16 MB"):
        endpoint.ask(f'SELECT ?x24 {{ BIND("a" AS ?x0) {doubled} }}')
    assert endpoint.ask("ASK { <urn:r7> ?p ?o }")["boolean"] is True


def test_a_name_that_no_graph_can_have_is_refused_and_the_next_question_is_answered(endpoint: Endpoint) -> None:
    assert not endpoint.put("model.a\U000e0100", b'<urn:new> <urn:label> "new" .\n')
    endpoint.drop("model.a\U000e0100")
    assert endpoint.ask("ASK { <urn:r7> ?p ?o }")["boolean"] is True


@pytest.mark.long
def test_every_identifier_names_a_graph() -> None:
    letters = [one for one in map(chr, range(sys.maxunicode + 1)) if is_uid(f"a{one}.b")]
    assert len(letters) > 100_000
    assert all(ox.NamedNode(f"urn:entry:{one}").value for one in letters)


@pytest.mark.long
def test_a_question_that_needs_too_much_memory_is_ended(endpoint: Endpoint) -> None:
    many = "SELECT * { ?a ?b ?c . ?d ?e ?f . ?g ?h ?i } ORDER BY ?c ?f ?i LIMIT 1"
    with pytest.raises(Exceeded):
        endpoint.ask(many)
    assert endpoint.ask("ASK { <urn:r7> ?p ?o }")["boolean"] is True


@pytest.mark.long
def test_files_of_the_folder_in_which_it_is_started_are_not_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "pyoxigraph.py").write_text("open('was_run', 'w')")
    monkeypatch.chdir(tmp_path)
    made = Endpoint(Limits(seconds=5))
    made.start()
    assert made.put("new", b'<urn:new> <urn:label> "new" .\n')
    made.close()
    assert not (tmp_path / "was_run").exists()
