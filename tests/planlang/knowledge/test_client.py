"""The client of a knowledge base: what it sends again, what it believes, what it keeps; the server is a function."""

from __future__ import annotations

import base64
import hashlib
import json
import unicodedata
from pathlib import Path
from typing import Any

import httpx
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planlang.knowledge.answers import (
    Declined,
    KeyNeeded,
    NoAnswer,
    NotAsAgreed,
    RefusedByChecks,
    TooMany,
    check_digest,
    printed,
    read_entry,
    read_found,
    refusal,
)
from planlang.knowledge.client import Client
from planlang.knowledge.connection import LARGEST, checked_url, kept_answers
from planlang.knowledge.entries import Changed, Entry, EntryExists, Kind, NoSuchEntry, NotTheAuthor

URL = "http://knowledge.test"
DATA = b"Ontology: <http://example.org/tea.owl>\n"


def sha256(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def record(data: bytes = DATA, number: int = 1, **others: Any) -> dict[str, Any]:
    """Return the record of an entry with a content."""
    made = {"author": "ada", "made": "2026-01-01T00:00:00Z"}
    return {
        "uid": "servingtea.ward",
        "kind": "recipes",
        "about": "http://example.org/tea.owl#ServingTea",
        "label": "serve tea",
        "author": "ada",
        "syntax": "text/owl-manchester",
        "created": "2026-01-01T00:00:00Z",
        "revision": {"number": number, "sha256": sha256(data), **made},
        "attachments": [],
        "rating": None,
        "ratings": 0,
        **others,
    }


def entry(**others: Any) -> Entry:
    return read_entry(record(**others))


class Server:
    """Answers requests in their order; the last answer is given again and again."""

    def __init__(self, *answers: httpx.Response | Exception) -> None:
        self.answers, self.requests, self.pauses = list(answers), list[httpx.Request](), list[float]()

    def __call__(self, request: httpx.Request) -> httpx.Response:
        self.requests.append(request)
        answer = self.answers.pop(0) if len(self.answers) > 1 else self.answers[0]
        if isinstance(answer, Exception):
            raise answer
        # a response is read once
        return httpx.Response(answer.status_code, headers=answer.headers, stream=httpx.ByteStream(answer.content))

    def client(self, *, cached: bool = False) -> Client:
        transport, cache = httpx.MockTransport(self), kept_answers() if cached else None
        return Client(URL, "k3y", cache, transport=transport, sleep=self.pauses.append)


def problem(status: int, detail: str = "no", **others: Any) -> httpx.Response:
    headers = {"Content-Type": "application/problem+json"}
    return httpx.Response(status, json={"status": status, "detail": detail, **others}, headers=headers)


GONE = httpx.ConnectError("connection refused")
TAKEN = httpx.Response(201, json={"entry": record(), "diagnostics": []})


@pytest.fixture(autouse=True)
def cache_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path


# sending again


@pytest.mark.parametrize("trouble", [GONE, httpx.ReadTimeout("slow"), *map(httpx.Response, (429, 502, 503, 504))])
def test_a_question_is_asked_again_later_and_later(trouble: httpx.Response | Exception) -> None:
    server = Server(trouble, trouble, trouble, httpx.Response(200, json=record()))
    assert server.client().entry("servingtea.ward").label == "serve tea"
    first, second, third = server.pauses
    assert 0.25 <= first <= 0.5 <= second <= 1.0 <= third <= 2.0


def test_a_creation_is_sent_again_with_the_same_key() -> None:
    server = Server(GONE, problem(503), TAKEN)
    assert server.client().create(Kind.RECIPE, "ward", DATA, "ServingTea").entry.uid == "servingtea.ward"
    assert [one.content for one in server.requests] == [DATA] * 3
    (key,) = {one.headers["Idempotency-Key"] for one in server.requests}
    assert len(key) == 32
    again = Server(TAKEN)
    again.client().create(Kind.RECIPE, "ward", DATA)
    assert again.requests[0].headers["Idempotency-Key"] != key, "another creation has another key"


def test_a_query_in_sparql_is_not_sent_again() -> None:
    server = Server(problem(503, "2 s are over"))
    with pytest.raises(Declined, match="2 s are over"):
        server.client().sparql("SELECT * {?s ?p ?o}")
    assert len(server.requests) == 1


@pytest.mark.parametrize("status", [400, 404, 422, 500, 501])
def test_a_refusal_is_not_asked_for_twice(status: int) -> None:
    server = Server(problem(status))
    with pytest.raises((Declined, NoSuchEntry)):
        server.client().entry("servingtea.ward", Kind.RECIPE)
    assert len(server.requests) == 1


@pytest.mark.parametrize(
    "headers",
    [
        {"Retry-After": "7"},
        {"Retry-After": "Mon, 23 Nov 2026 12:00:07 GMT", "Date": "Mon, 23 Nov 2026 12:00:00 GMT"},
    ],
)
def test_the_server_says_when_to_come_back(headers: dict[str, str]) -> None:
    server = Server(httpx.Response(429, headers=headers), httpx.Response(200, json=record()))
    server.client().entry("servingtea.ward")
    assert server.pauses == [7.0]


def test_nobody_waits_for_hours() -> None:
    server = Server(httpx.Response(429, headers={"Retry-After": "7200"}))
    with pytest.raises(TooMany) as refused:
        server.client().entry("servingtea.ward")
    assert (server.pauses, refused.value.__notes__) == ([], ["the server asks to try again in 7200 s"])


def test_a_change_whose_answer_was_lost_was_made_once() -> None:
    changed = b"Ontology: <http://example.org/coffee.owl>\n"
    now = httpx.Response(200, json=record(changed, 2))
    server = Server(httpx.ReadError("reset"), problem(412), now)
    assert server.client().change(entry(), changed).entry.revision.number == 2
    assert server.requests[0].headers["If-Match"] == entry().etag
    with pytest.raises(Changed):  # somebody else changed it
        Server(problem(412), httpx.Response(200, json=record(b"other", 2))).client().change(entry(), changed)


# what is believed


@pytest.mark.parametrize(
    ("answer", "reason"),
    [
        (httpx.Response(200, content=b"x" * (LARGEST + 1)), "more than 16 MB"),
        (httpx.Response(200, content=b"{}", headers={"Content-Encoding": "unknown"}), "compressed"),
        (httpx.Response(200, content=b"<html>"), "not JSON"),
        (httpx.Response(200, content=b"[" * 100_000), "not JSON"),
        (httpx.Response(200, json=[]), "not a JSON object"),
        (httpx.Response(200, json=record(uid="../../etc/passwd")), "invalid name"),
        (httpx.Response(200, json=record(uid="servingtea.other")), "returned servingtea.other"),
        (httpx.Response(302, headers={"Location": "http://elsewhere.test"}), "redirects"),
    ],
)
def test_an_answer_that_is_none_is_refused(answer: httpx.Response, reason: str) -> None:
    with pytest.raises(NotAsAgreed, match=reason):
        Server(answer).client().entry("servingtea.ward", Kind.RECIPE)


def test_an_answer_that_takes_for_ever_is_given_up_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("planlang.knowledge.connection.LONGEST_ANSWER", -1.0)
    server = Server(httpx.Response(200, json=record()))
    with pytest.raises(NoAnswer, match="does not answer within"):
        server.client().entry("servingtea.ward", Kind.RECIPE)
    assert len(server.requests) == 1


@pytest.mark.parametrize("name", ["../plan.py", "/etc/passwd", ".bashrc", "a/b", "", "a\0b", "n" * 101, "a\nb"])
def test_files_of_an_entry_have_names_and_no_paths(name: str) -> None:
    file = {"name": name, "media_type": "text/plain", "sha256": sha256(b""), "size": 0}
    with pytest.raises(NotAsAgreed):
        read_entry(record(attachments=[file]))


ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
)


@given(st.dictionaries(st.sampled_from([*record(), "can", "missing"]), ANYTHING))
def test_a_record_is_read_or_refused(changes: dict[str, Any]) -> None:
    try:
        found = read_found({**record(), **changes}).entry
    except NotAsAgreed:
        return
    assert isinstance(found.label, str)
    assert isinstance(found.rating, float | None)
    assert isinstance(found.ratings, int)


@given(st.integers(100, 599), st.binary(max_size=50) | ANYTHING.map(lambda one: json.dumps({"detail": one}).encode()))
def test_any_refusal_is_one_of_the_typed_errors(status: int, body: bytes) -> None:
    typed = (Declined, NotAsAgreed, NoSuchEntry, EntryExists, NotTheAuthor, Changed)
    assert isinstance(refusal(status, body), typed)


def test_a_refusal_has_its_type_and_the_diagnostics_of_the_checks() -> None:
    wrong = {
        "severity": "error",
        "code": "R012",
        "message": "cycle\x1b[2J",
        "file": "ward.omn",
        "line": 21,
        "column": 13,
    }
    with pytest.raises(RefusedByChecks) as refused:
        Server(problem(422, "1 error", diagnostics=[wrong, "", {}, {"code": 3}])).client().create(
            Kind.RECIPE, "w", DATA
        )
    (found,) = refused.value.diagnostics
    assert str(found) == "ward.omn:21:13: error R012 cycle\\u001b[2J"
    for status, kind in ((401, KeyNeeded), (403, NotTheAuthor), (404, NoSuchEntry), (409, EntryExists)):
        with pytest.raises(kind, match="no"):
            Server(problem(status)).client().create(Kind.RECIPE, "ward", DATA)


def test_a_content_is_what_record_and_header_say() -> None:
    digest = f"sha-256=:{base64.b64encode(hashlib.sha256(DATA).digest()).decode()}:"
    right = httpx.Response(200, content=DATA, headers={"Repr-Digest": digest})
    assert Server(right).client().content(entry()) == DATA
    for answer in (
        httpx.Response(200, content=DATA + b" ", headers={"Repr-Digest": digest}),
        httpx.Response(200, content=DATA + b" "),
        httpx.Response(200, content=DATA, headers={"Repr-Digest": "sha-256=:AAAA:"}),
        httpx.Response(200, content=DATA, headers={"Repr-Digest": "sha-256=:=:"}),
    ):
        with pytest.raises(NotAsAgreed, match="damaged in transfer"):
            Server(answer).client().content(entry())
    check_digest(DATA, "sha-512=:AAAA:", None, "a digest that we do not know is not looked at")


def test_a_server_that_goes_round_in_circles_is_left() -> None:
    page = httpx.Response(200, json={"entries": [record()], "next": "servingtea.ward"})
    with pytest.raises(NotAsAgreed, match="repeat"):
        list(Server(page).client().entries(Kind.RECIPE))


def test_pages_are_read_as_they_are_needed() -> None:
    pages = [httpx.Response(200, json={"entries": [record()], "next": name}) for name in ("a", "b", None)]
    server = Server(*pages)
    assert len(list(server.client().search(label="tea", robot="self-model", most=2))) == 2
    assert [json.loads(one.content)["after"] for one in server.requests] == ["", "a"]
    assert len(list(Server(*pages).client().search(label="tea"))) == 3


@given(st.text())
def test_a_printed_text_leaves_the_terminal_as_it_is(text: str) -> None:
    for one in (*printed(text), *printed(text, "\n").replace("\n", "")):
        assert one.isprintable() or unicodedata.category(one) == "Zs", "spaces of any width are shown"


def test_no_cookies_are_kept() -> None:
    server = Server(httpx.Response(200, json=record(), headers={"Set-Cookie": "who=ada"}))
    client = server.client()
    for _ in range(2):
        client.entry("servingtea.ward")
    assert "Cookie" not in server.requests[1].headers


@pytest.mark.parametrize(
    "url",
    [
        "",
        "knowledge.test",
        "ftp://a",
        "http://",
        "http://ada:pw@a",
        "http://a/?key=1",
        "http://a:x",
        "http://[",
        "http://a b",
        "http://a..b",
        "http://xn--a",
    ],
)
def test_what_is_no_address_is_refused(url: str) -> None:
    with pytest.raises(ValueError, match=r"."):
        Client(url)
    assert checked_url("https://a:1/kb/") == "https://a:1/kb"


def test_the_key_is_sent_and_shown_nowhere() -> None:
    server = Server(problem(401, "this key is nobody's"))
    with pytest.raises(KeyNeeded) as refused:
        server.client().rate(entry(), 8)
    assert server.requests[0].headers["Authorization"] == "Bearer k3y"
    assert "k3y" not in repr(refused.value)


# what is kept


@pytest.fixture
def known() -> Server:
    """A server that was asked for an entry and its content before it went."""
    with Server(httpx.Response(200, json=record(), headers={"ETag": '"1"'})).client(cached=True) as client:
        assert client.entry("servingtea.ward").label == "serve tea"
    with Server(httpx.Response(200, content=DATA)).client(cached=True) as client:
        assert client.content(entry()) == DATA
        assert client.offline is None
    return Server(GONE)


def test_what_was_read_stays_readable_and_is_said_to_be_old(known: Server) -> None:
    client = known.client(cached=True)
    assert client.content(client.entry("servingtea.ward")) == DATA
    assert client.offline == f"{URL} does not answer: connection refused"
    assert len(known.pauses) == 3, "once it is known that there is no server, nobody waits for it again"
    with pytest.raises(NoAnswer):
        client.entry("servingtea.other")
    with pytest.raises(NoAnswer):
        known.client().entry("servingtea.ward")


def test_a_server_that_is_there_decides(known: Server) -> None:
    unchanged = Server(httpx.Response(304))
    assert unchanged.client(cached=True).entry("servingtea.ward").label == "serve tea"
    assert unchanged.requests[0].headers["If-None-Match"] == '"1"'
    with pytest.raises(NoSuchEntry):
        Server(problem(404)).client(cached=True).entry("servingtea.ward")


def test_damaged_files_of_the_cache_are_not_read(known: Server, cache_folder: Path) -> None:
    for path in (cache_folder / "planlang" / "knowledge").iterdir():
        path.write_bytes(path.read_bytes().replace(b"tea", b"pee"))
    with pytest.raises(NoAnswer):
        known.client(cached=True).entry("servingtea.ward")


def test_no_answer_is_kept_for_another_server(known: Server) -> None:
    with pytest.raises(NoAnswer):
        Client(
            "http://other.test", cache=kept_answers(), transport=httpx.MockTransport(known), sleep=lambda _: None
        ).entry("servingtea.ward")
