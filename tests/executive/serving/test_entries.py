"""Entries over HTTP: what is handed in is checked, kept with its revisions, and changed by its author alone."""

from __future__ import annotations

import base64
import hashlib
from http import HTTPStatus
from pathlib import Path

import pytest
from fastapi import FastAPI
from fastapi.testclient import TestClient

from executive.serving.app import application
from executive.serving.workers import Staff
from planlang.files import Bundled
from planlang.knowledge.entries import rating_of
from planlang.knowledge.sqlite_store import SqliteStore
from planlang.ontology import load

RECIPE = Bundled.RECIPE.find("serve_a_drink").read_bytes()
CHANGED = RECIPE.replace(b'"serve a drink"', b'"serve two drinks"')
ENTRY = "/v1/recipes/serveadrink.ward"


def create(client: TestClient, name: str = "ward", data: bytes = RECIPE, **headers: str) -> str:
    made = client.post("/v1/recipes", params={"name": name}, content=data, headers=headers)
    assert made.status_code == HTTPStatus.CREATED, made.text
    return str(made.headers["ETag"])


def test_a_recipe_is_kept_as_it_was_handed_in(client: TestClient, stranger: TestClient) -> None:
    made = client.post("/v1/recipes", params={"name": "Ward"}, content=RECIPE)
    assert (made.status_code, made.headers["Location"]) == (HTTPStatus.CREATED, ENTRY)
    entry = made.json()["entry"]
    assert (entry["label"], entry["author"], entry["syntax"]) == ("serve a drink", "ada", "text/owl-manchester")
    assert stranger.get(ENTRY).json() == entry
    content = stranger.get(f"{ENTRY}/content")
    assert content.content == RECIPE
    digest = base64.b64encode(hashlib.sha256(RECIPE).digest()).decode()
    assert content.headers["Repr-Digest"] == f"sha-256=:{digest}:"
    assert stranger.get("/v1/recipes").json() == {"entries": [entry], "next": None}
    assert stranger.get("/v1/robots").json() == {"entries": [], "next": None}


def test_a_records_tag_changes_with_files_and_ratings_and_names_its_revision(
    client: TestClient, other: TestClient
) -> None:
    tags = [create(client)]
    assert client.get(ENTRY, headers={"If-None-Match": tags[0]}).status_code == HTTPStatus.NOT_MODIFIED
    for ask in (
        lambda: client.put("/v1/binaries/serveadrink.ward/a.model", content=b"1"),
        lambda: client.put("/v1/binaries/serveadrink.ward/a.model", content=b"2"),
        lambda: other.put(f"{ENTRY}/rating", json={"rating": 7}),
        lambda: client.delete("/v1/binaries/serveadrink.ward/a.model"),
    ):
        assert ask().is_success
        answer = client.get(ENTRY, headers={"If-None-Match": tags[-1]})
        assert answer.status_code == HTTPStatus.OK
        tags.append(answer.headers["ETag"])
    assert len(set(tags)) == len(tags)
    changed = client.put(f"{ENTRY}/content", content=CHANGED, headers={"If-Match": tags[0]})
    assert changed.status_code == HTTPStatus.OK, "a file is no other revision"
    for tag in (tags[-1], '"1-"', '""'):
        refused = client.put(f"{ENTRY}/content", content=RECIPE, headers={"If-Match": tag})
        assert refused.status_code == HTTPStatus.PRECONDITION_FAILED


def test_an_entry_of_another_kind_is_not_there(client: TestClient) -> None:
    create(client)
    for path in ("/v1/robots/serveadrink.ward", "/v1/robots/serveadrink.ward/content", "/v1/recipes/none.none"):
        problem = client.get(path)
        assert (problem.status_code, problem.headers["Content-Type"]) == (404, "application/problem+json")
        assert problem.json()["title"] == "Not Found"


def test_lists_go_on_behind_the_last_identifier(client: TestClient) -> None:
    names = [f"n{number}" for number in range(5)]
    for name in names:
        create(client, name)
    found, after = [], ""
    while after is not None:
        page = client.get("/v1/recipes", params={"limit": 2, "after": after}).json()
        found += [one["uid"] for one in page["entries"]]
        after = page["next"]
    assert found == [f"serveadrink.{name}" for name in names]


def test_what_the_compiler_refuses_is_not_kept_and_the_reasons_have_places(client: TestClient) -> None:
    wrong = RECIPE.replace(b"subAction some GraspBottle", b"subAction some GraspBotle")
    refused = client.post("/v1/recipes", params={"name": "ward"}, content=wrong)
    assert refused.status_code == HTTPStatus.UNPROCESSABLE_ENTITY
    (error, *_) = [one for one in refused.json()["diagnostics"] if one["severity"] == "error"]
    assert error["file"] == "ward.omn"
    assert b"GraspBotle" in wrong.splitlines()[error["line"] - 1]
    assert client.get("/v1/recipes").json()["entries"] == []


FUNCTIONAL = b"""Prefix(:=<urn:o#>) Prefix(k:=<http://knowrob.org/kb/knowrob.owl#>)
Ontology(<urn:o> Declaration(Class(:Mug)) SubClassOf(:Mug k:Cup))
"""
OWLXML = b"""<Ontology xmlns="http://www.w3.org/2002/07/owl#" ontologyIRI="urn:o">
  <SubClassOf><Class IRI="urn:o#Mug"/><Class IRI="http://knowrob.org/kb/knowrob.owl#Cup"/></SubClassOf></Ontology>
"""


@pytest.mark.parametrize(("data", "media_type"), [(FUNCTIONAL, "text/owl-functional"), (OWLXML, "application/owl+xml")])
def test_functional_syntax_and_owlxml_are_kept_found_and_given_in_other_syntaxes(
    client: TestClient, data: bytes, media_type: str
) -> None:
    made = client.post("/v1/objects", params={"name": "mug"}, content=data)
    assert (made.status_code, made.json()["entry"]["syntax"]) == (HTTPStatus.CREATED, media_type), made.text
    content = client.get(f"{made.headers['Location']}/content")
    assert (content.content, content.headers["Content-Type"].partition(";")[0]) == (data, media_type)
    words = {
        "text/turtle": "rdfs:subClassOf",
        "text/owl-functional": "SubClassOf(",
        "application/owl+xml": "<SubClassOf>",
    }
    for accepted, word in words.items():
        assert word in client.get(f"{made.headers['Location']}/content", headers={"Accept": accepted}).text
    found = client.get("/v1/search", params={"expression": "Cup"}).json()
    assert [one["label"] for one in found["entries"]] == ["Mug"]


def test_what_an_author_is_advised_is_what_an_author_can_do(client: TestClient) -> None:
    importing = b"Ontology: <urn:o> Import: <package://elsewhere/owl/mugs.owl>\nClass: <urn:o#Mug>"
    importing += b" SubClassOf: <http://knowrob.org/kb/knowrob.owl#Cup>"
    taken = client.post("/v1/objects?name=mug", content=importing)
    assert (taken.status_code, taken.json()["diagnostics"][0]["code"]) == (201, "O030"), taken.text
    assert "beside this file" not in taken.json()["diagnostics"][0]["help"]
    (refused,) = client.post("/v1/robots?name=cart", content=b'<robot name="cart"/>').json()["diagnostics"]
    assert refused["code"] == "K014"
    assert "upload its self-model" in refused["help"]


def test_a_name_of_other_signs_is_refused_with_those_that_may_be_used(client: TestClient) -> None:
    (refused,) = client.post("/v1/recipes?name=a%2Fb", content=RECIPE).json()["diagnostics"]
    assert refused["message"].startswith("'a/b' cannot be part of an identifier")
    assert refused["file"] is None


@pytest.mark.parametrize("name", ["K\u00fchlschrank", "Ku\u0308hlschrank", "K%C3%BChlschrank"])
def test_classes_have_names_in_any_script_however_these_are_written(client: TestClient, name: str) -> None:
    text = f"Ontology: <urn:o> Class: <urn:o#{name}> SubClassOf: <http://knowrob.org/kb/knowrob.owl#Refrigerator>"
    made = client.post("/v1/objects?name=\u53a8\u623f", content=text.encode())
    assert made.status_code == HTTPStatus.CREATED, made.text
    assert made.headers["Location"] == "/v1/objects/k%C3%BChlschrank.%E5%8E%A8%E6%88%BF"
    entry = client.get(made.headers["Location"]).json()
    assert (entry["uid"], entry["about"]) == ("k\u00fchlschrank.\u53a8\u623f", f"urn:o#{name}")
    found = client.get("/v1/search", params={"expression": f"Refrigerator and <urn:o#{name}>"}).json()
    assert [one["uid"] for one in found["entries"]] == [entry["uid"]]
    graph = client.get("/v1/sparql", params={"query": f"ASK {{ GRAPH <urn:entry:{entry['uid']}> {{ ?a ?b ?c }} }}"})
    assert graph.json()["boolean"] is True
    assert client.get(f"/objects/{entry['uid']}").status_code == HTTPStatus.OK


@pytest.mark.long
def test_what_is_wrong_in_the_servers_own_files_is_told_without_their_folder(
    tmp_path: Path, store: SqliteStore
) -> None:
    folder = tmp_path / "private"
    folder.mkdir()
    (folder / "broken.omn").write_text("Ontology: <http://example.org/broken.owl>\nClas: x\n")
    app = application(store, Staff([folder]))
    client = TestClient(app, headers={"Authorization": f"Bearer {store.new_key('eve', '2026-01-01T00:00:00Z')}"})
    importing = b"Ontology: <urn:o> Import: <package://ours/broken.omn>\nClass: <urn:o#Mug>"
    importing += b" SubClassOf: <http://knowrob.org/kb/knowrob.owl#Cup>"
    answer = client.post("/v1/objects?name=mug", content=importing)
    app.state.serving.close()
    assert "broken.omn" in answer.text
    assert str(tmp_path) not in answer.text


def test_an_identifier_is_given_once(client: TestClient, other: TestClient) -> None:
    create(client)
    assert other.post("/v1/recipes", params={"name": "ward"}, content=RECIPE).status_code == HTTPStatus.CONFLICT


def test_a_request_that_is_sent_again_makes_no_second_entry(client: TestClient) -> None:
    key = {"Idempotency-Key": "one"}
    first = client.post("/v1/recipes", params={"name": "ward"}, content=RECIPE, headers=key)
    again = client.post("/v1/recipes", params={"name": "ward"}, content=RECIPE, headers=key)
    assert (again.status_code, again.json()["entry"]) == (HTTPStatus.CREATED, first.json()["entry"])
    different = client.post("/v1/recipes", params={"name": "ward2"}, content=RECIPE, headers=key)
    assert different.status_code == HTTPStatus.UNPROCESSABLE_ENTITY


def test_a_change_names_the_revision_that_it_changes(client: TestClient) -> None:
    first = create(client)
    path = f"{ENTRY}/content"
    assert client.put(path, content=CHANGED).status_code == HTTPStatus.PRECONDITION_REQUIRED
    second = client.put(path, content=CHANGED, headers={"If-Match": first})
    assert second.status_code == HTTPStatus.OK
    assert second.json()["entry"]["label"] == "serve two drinks"
    late = client.put(path, content=RECIPE, headers={"If-Match": first})
    assert late.status_code == HTTPStatus.PRECONDITION_FAILED
    assert [one["number"] for one in client.get(f"{ENTRY}/revisions").json()["revisions"]] == [2, 1]
    assert client.get(path, params={"revision": 1}).content == RECIPE
    assert client.get(path, params={"revision": 3}).status_code == HTTPStatus.NOT_FOUND
    assert client.delete(ENTRY, headers={"If-Match": first}).status_code == HTTPStatus.PRECONDITION_FAILED
    assert client.delete(ENTRY, headers={"If-Match": second.headers["ETag"]}).status_code == HTTPStatus.NO_CONTENT
    assert client.get(ENTRY).status_code == HTTPStatus.NOT_FOUND


def test_a_change_stays_about_what_the_entry_is_about(client: TestClient) -> None:
    tag = create(client)
    renamed = RECIPE.replace(b"ServeADrink", b"ServeSomething")
    refused = client.put(f"{ENTRY}/content", content=renamed, headers={"If-Match": tag})
    assert refused.status_code == HTTPStatus.UNPROCESSABLE_ENTITY


def test_what_is_known_already_is_not_sent_again(client: TestClient) -> None:
    create(client)
    for path in (ENTRY, f"{ENTRY}/content"):
        tag = client.get(path).headers["ETag"]
        known = client.get(path, headers={"If-None-Match": f'"x", {tag}'})
        assert (known.status_code, known.content) == (HTTPStatus.NOT_MODIFIED, b"")
        assert client.get(path, headers={"If-None-Match": '"x"'}).status_code == HTTPStatus.OK


@pytest.mark.parametrize("media_type", ["text/turtle", "application/rdf+xml", "text/html;q=0.9, text/turtle;q=0.1"])
def test_a_content_is_given_in_the_syntax_that_is_asked_for(
    client: TestClient, tmp_path: Path, media_type: str
) -> None:
    create(client)
    answer = client.get(f"{ENTRY}/content", headers={"Accept": media_type})
    assert answer.headers["Content-Type"].partition(";")[0] in media_type
    (tmp_path / "given").write_bytes(answer.content)
    given = load(tmp_path / "given", builtin=False)
    kept = load(Bundled.RECIPE.find("serve_a_drink"), builtin=False)
    assert set(given.class_names()) == set(kept.class_names())
    assert client.get(f"{ENTRY}/content", headers={"Accept": "image/png"}).status_code == HTTPStatus.NOT_ACCEPTABLE


def test_others_rate_an_entry_and_its_author_does_not(
    client: TestClient, other: TestClient, app: FastAPI, store: SqliteStore
) -> None:
    create(client)
    assert client.put(f"{ENTRY}/rating", json={"rating": 10}).status_code == HTTPStatus.FORBIDDEN
    eve = {"Authorization": f"Bearer {store.new_key('eve', '2026-01-01T00:00:00Z')}"}
    assert other.put(f"{ENTRY}/rating", json={"rating": 8}, headers=eve).is_success
    other.put(f"{ENTRY}/rating", json={"rating": 1})
    rated = other.put(f"{ENTRY}/rating", json={"rating": 9}).json()
    assert (rated["rating"], rated["ratings"]) == (rating_of([8, 9]), 2)
    for wrong in (11, -1, 2.5, "7", None):
        assert other.put(f"{ENTRY}/rating", json={"rating": wrong}).status_code == HTTPStatus.UNPROCESSABLE_ENTITY


def test_files_belong_to_an_entry(client: TestClient, stranger: TestClient) -> None:
    create(client)
    path = "/v1/binaries/serveadrink.ward/map.png"
    kept = client.put(path, content=b"picture", headers={"Content-Type": "image/png"}).json()
    (file,) = kept["attachments"]
    assert (file["name"], file["media_type"], file["size"]) == ("map.png", "image/png", 7)
    answer = stranger.get(path)
    assert (answer.content, answer.headers["Content-Type"]) == (b"picture", "image/png")
    assert stranger.get(path, headers={"If-None-Match": answer.headers["ETag"]}).status_code == HTTPStatus.NOT_MODIFIED
    assert client.delete(path).status_code == HTTPStatus.NO_CONTENT
    assert stranger.get(path).status_code == HTTPStatus.NOT_FOUND


def test_news_tell_what_happened_to_what_an_author_subscribed_to(client: TestClient, other: TestClient) -> None:
    create(client)
    create(client, "other")
    assert other.put("/v1/subscriptions/serveadrink.ward").status_code == HTTPStatus.NO_CONTENT
    assert other.put("/v1/subscriptions/none.none").status_code == HTTPStatus.NOT_FOUND
    assert other.get("/v1/subscriptions").json() == {"subscriptions": ["serveadrink.ward"]}
    other.put(f"{ENTRY}/rating", json={"rating": 4})
    everything = client.get("/v1/news").json()
    assert [one["change"] for one in everything["news"]] == ["created", "created", "rated"]
    assert client.get("/v1/news", params={"after": everything["next"]}).json()["news"] == []
    mine = other.get("/v1/news", params={"mine": True}).json()["news"]
    assert [one["uid"] for one in mine] == ["serveadrink.ward"] * 2
    assert other.delete("/v1/subscriptions/serveadrink.ward").status_code == HTTPStatus.NO_CONTENT
    assert other.get("/v1/news", params={"mine": True}).json()["news"] == []
