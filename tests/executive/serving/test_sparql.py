"""SPARQL over HTTP: what is stored is asked for, and nothing else."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from pathlib import Path
from typing import TypeVar

import pytest
from fastapi.testclient import TestClient

from executive.processes.workers import Source
from executive.serving.app import application
from executive.serving.mirror import MOST_QUESTIONS, Mirror
from executive.serving.workers import LIMITS, PREPARE, Busy, Failed, Staff, Workers
from planlang.files import Bundled
from planlang.knowledge.entries import Kind
from planlang.knowledge.sparql import Exceeded, Limits
from planlang.knowledge.sqlite_store import SqliteStore
from tests.support.knowledge_bases import put

T = TypeVar("T")
NOW = "2026-01-01T00:00:00Z"
RECIPE = Bundled.RECIPE.find("serve_a_drink").read_bytes()
RESULTS = "application/sparql-results+json"
COUNT = "SELECT (COUNT(*) AS ?n) { GRAPH <urn:entry:serveadrink.ward> { ?a ?b ?c } }"


@pytest.fixture
def client(tmp_path: Path, staff: Staff) -> Iterator[TestClient]:
    with closing(SqliteStore(tmp_path / "kb.sqlite")) as store:
        app = application(store, staff)
        with closing(app.state.serving.mirror):
            yield TestClient(app, headers={"Authorization": f"Bearer {store.new_key('ada', NOW)}"})


def asked(client: TestClient, query: str) -> int:
    answer = client.get("/v1/sparql", params={"query": query})
    assert answer.status_code == 200, answer.text
    assert answer.headers["content-type"] == RESULTS
    return int(answer.json()["results"]["bindings"][0]["n"]["value"])


def test_the_triples_of_entries_are_asked_for_and_follow_their_changes(client: TestClient) -> None:
    assert asked(client, COUNT) == 0
    made = client.post("/v1/recipes", params={"name": "ward"}, content=RECIPE)
    assert asked(client, COUNT) > 100
    client.delete(made.headers["Location"], headers={"If-Match": made.headers["ETag"]})
    assert asked(client, COUNT) == 0


def test_a_question_in_the_body_and_triples_as_an_answer(client: TestClient) -> None:
    client.post("/v1/recipes", params={"name": "ward"}, content=RECIPE)
    headers = {"Content-Type": "application/sparql-query"}
    answer = client.post("/v1/sparql", content="CONSTRUCT WHERE { ?a a ?b }", headers=headers)
    assert answer.headers["content-type"].startswith("application/n-triples")
    assert answer.text.endswith(" .\n")


def test_a_form_asks_as_clients_of_the_protocol_do_by_default(client: TestClient) -> None:
    client.post("/v1/recipes", params={"name": "ward"}, content=RECIPE)
    question = "ASK { GRAPH <urn:entry:serveadrink.ward> { ?a ?b ?c } }"
    assert client.post("/v1/sparql", data={"query": question}).json()["boolean"] is True
    for form in ({"update": "CLEAR ALL"}, {"query": [question, question]}, {}):
        refused = client.post("/v1/sparql", data=form, headers={"Content-Type": "application/x-www-form-urlencoded"})
        assert refused.status_code == 400, refused.text


def test_who_asks_while_contents_are_still_read_is_told_so_and_nobody_else_waits(tmp_path: Path, staff: Staff) -> None:
    go_on = threading.Event()

    class SlowStore(SqliteStore):
        def content(self, uid: str, revision: int | None = None) -> bytes:
            go_on.wait()
            return super().content(uid, revision)

    with closing(SlowStore(tmp_path / "kb.sqlite")) as store:
        put(store, Kind.RECIPE, "ward", RECIPE)
        with closing(Mirror(store, staff.behind, Limits(seconds=0.2))) as mirror:
            mirror.start()
            with pytest.raises(Exceeded, match="still loading contents, 0 entries so far"):
                mirror.ask(COUNT)
            go_on.set()
            while True:
                with suppress(Exceeded):
                    found = mirror.ask(COUNT)
                    break
    assert int(found["results"]["bindings"][0]["n"]["value"]) > 100


def test_so_many_questions_wait_and_the_next_is_told_to_come_back(tmp_path: Path, staff: Staff) -> None:
    go_on, refused, answers = threading.Event(), threading.Event(), list[str]()

    class SlowStore(SqliteStore):
        def content(self, uid: str, revision: int | None = None) -> bytes:
            go_on.wait()
            return super().content(uid, revision)

    with closing(SlowStore(tmp_path / "kb.sqlite")) as store, closing(Mirror(store, staff.behind)) as mirror:
        put(store, Kind.RECIPE, "ward", RECIPE)

        def ask() -> None:
            try:
                mirror.ask(COUNT)
                answers.append("answered")
            except Busy as busy:
                answers.append(str(busy))
                refused.set()

        threads = [threading.Thread(target=ask) for _ in range(MOST_QUESTIONS + 1)]
        for one in threads:
            one.start()
        assert refused.wait(10)
        go_on.set()
        for one in threads:
            one.join()
    assert answers[0] == "too much is being asked at the moment; try again later"
    assert answers[1:] == ["answered"] * MOST_QUESTIONS


def test_a_server_of_too_many_questions_says_when_to_come_back(
    tmp_path: Path, staff: Staff, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("executive.serving.mirror.MOST_QUESTIONS", 0)
    with closing(SqliteStore(tmp_path / "kb.sqlite")) as store:
        refused = TestClient(application(store, staff)).get("/v1/sparql", params={"query": COUNT})
    assert (refused.status_code, refused.headers["Retry-After"]) == (429, "1")


def test_a_content_at_which_a_reader_fails_costs_nobody_else_an_answer(tmp_path: Path) -> None:
    class Mistaken(Workers):
        def call(self, function: Callable[..., T], *arguments: object) -> T:
            raise Failed("ZeroDivisionError")

    workers = Mistaken(Source(PREPARE), 1, LIMITS)
    with closing(SqliteStore(tmp_path / "kb.sqlite")) as store, closing(Mirror(store, workers)) as mirror:
        put(store, Kind.RECIPE, "before", RECIPE)
        assert mirror.ask("ASK { ?a ?b ?c }")["boolean"] is False
        put(store, Kind.RECIPE, "ward", RECIPE)
        assert mirror.ask("ASK { ?a ?b ?c }")["boolean"] is False


def test_an_engine_that_was_ended_knows_everything_again(client: TestClient, staff: Staff, tmp_path: Path) -> None:
    client.post("/v1/recipes", params={"name": "ward"}, content=RECIPE)
    with closing(SqliteStore(tmp_path / "kb.sqlite")) as store, closing(Mirror(store, staff.behind)) as mirror:
        before = mirror.ask(COUNT)
        mirror.end()
        assert mirror.ask(COUNT) == before


@pytest.mark.parametrize(
    ("content", "kind", "status"),
    [
        ("DELETE WHERE { ?a ?b ?c }", "application/sparql-query", 400),
        ("DELETE WHERE { ?a ?b ?c }", "application/sparql-update", 415),
        ("SELECT", "application/sparql-query", 400),
        ("#" * 100_001, "application/sparql-query", 413),
    ],
)
def test_updates_and_nonsense_are_refused(client: TestClient, content: str, kind: str, status: int) -> None:
    answer = client.post("/v1/sparql", content=content, headers={"Content-Type": kind})
    assert answer.status_code == status
    assert answer.headers["content-type"] == "application/problem+json"


def test_no_other_server_is_asked(client: TestClient) -> None:
    with socket.socket() as listening:
        listening.bind(("127.0.0.1", 0))
        listening.listen()
        listening.settimeout(0.2)
        address = f"http://127.0.0.1:{listening.getsockname()[1]}/"
        for silent in ("", "SILENT "):
            client.get("/v1/sparql", params={"query": f"SELECT * {{ SERVICE {silent}<{address}> {{ ?a ?b ?c }} }}"})
        with pytest.raises(TimeoutError):
            listening.accept()
