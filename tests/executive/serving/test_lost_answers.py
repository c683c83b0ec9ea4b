"""Answers of a real server that get lost on their way: what was asked twice was done once."""

from __future__ import annotations

from collections.abc import Iterator

import httpx
import pytest

from planlang.files import Bundled
from planlang.knowledge.answers import Declined
from planlang.knowledge.client import Client
from planlang.knowledge.entries import Kind, OwnEntry
from tests.support.servers import RunningServer, running_server

RECIPE = Bundled.RECIPE.find("serve_a_drink").read_bytes()


class Losing(httpx.HTTPTransport):
    """Loses the first answer to each request that changes something, after the server gave it."""

    def __init__(self) -> None:
        super().__init__()
        self.lost = set[tuple[str, str]]()

    def handle_request(self, request: httpx.Request) -> httpx.Response:
        answer = super().handle_request(request)
        known = request.method, request.url.path
        if request.method != "GET" and known not in self.lost:
            self.lost.add(known)
            answer.close()
            raise httpx.ReadError("the line is cut")
        return answer


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningServer]:
    with running_server(tmp_path_factory.mktemp("server") / "kb.sqlite") as running:
        yield running


def test_what_is_sent_again_is_done_once(server: RunningServer) -> None:
    transport = Losing()
    with Client(server.url, server.key("ada"), transport=transport, sleep=lambda _: None) as client:
        made = client.create(Kind.RECIPE, "ward", RECIPE).entry
        assert client.change(made, RECIPE + b"\n# better\n").entry.revision.number == 2
        entry = client.attach(made.uid, "note.txt", "text/plain", b"first")
        assert client.attachment(entry, entry.attachments[0]) == b"first"
        client.subscribe(made.uid)
        with pytest.raises(OwnEntry):
            client.rate(entry, 7)
        with Client(server.url, server.key("bob"), transport=transport, sleep=lambda _: None) as bob:
            rated = bob.rate(entry, 7)
        assert (rated.rating, rated.ratings) == (5.0, 1)
        assert [one.number for one in client.revisions(entry)] == [2, 1]
        assert client.content(entry, 1) == RECIPE
        assert [one.uid for one in client.entries(Kind.RECIPE)] == [made.uid]
        client.delete(entry)
        assert list(client.entries(Kind.RECIPE)) == []
        assert len(transport.lost) == 6
        created = [one.uid for one in client.news()[0] if one.change == "created"]
        assert created == [made.uid]


@pytest.mark.long
def test_questions_in_sparql_have_tables_and_graphs_as_answers(server: RunningServer) -> None:
    with Client(server.url, server.key("ada")) as client:
        client.create(Kind.RECIPE, "asked", RECIPE)
        about = "<http://www.w3.org/2000/01/rdf-schema#label>"
        table = client.sparql(f"SELECT ?label WHERE {{ GRAPH ?graph {{ ?thing {about} ?label }} }}")
        assert table["results"]["bindings"]
        assert about in client.sparql_graph(f"CONSTRUCT {{ ?s {about} ?o }} WHERE {{ GRAPH ?g {{ ?s {about} ?o }} }}")
        with pytest.raises(Declined):
            client.sparql("DROP ALL")
