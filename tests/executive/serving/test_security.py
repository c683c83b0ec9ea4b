"""Refusals of the server: changes without the author's key, and bodies and names that are meant to harm."""

from __future__ import annotations

import gzip
from collections.abc import Iterator
from itertools import pairwise
from urllib.parse import quote

import pytest
from fastapi import FastAPI
from fastapi.testclient import TestClient

from executive.serving import forms
from planlang.files import Bundled

RECIPE = Bundled.RECIPE.find("serve_a_drink").read_bytes()
ENTRY = "/v1/recipes/serveadrink.ward"
FILE = "/v1/binaries/serveadrink.ward/map.png"
WRONG = {"Authorization": "Bearer " + "x" * 43}

READING = (
    ("GET", "/v1/health"),
    ("GET", "/v1/recipes"),
    ("GET", ENTRY),
    ("GET", f"{ENTRY}/content"),
    ("GET", f"{ENTRY}/revisions"),
    ("GET", FILE),
    ("GET", "/v1/news"),
    ("GET", "/v1/search"),
    ("POST", "/v1/search"),
    ("GET", "/v1/sparql?query=ASK{}"),
    ("POST", "/v1/sparql"),
    ("GET", "/openapi.json"),
)
OWN = (("GET", "/v1/subscriptions"), ("GET", "/v1/news?mine=true"), ("PUT", f"{ENTRY}/rating"))
SUBSCRIBING = (("PUT", "/v1/subscriptions/serveadrink.ward"), ("DELETE", "/v1/subscriptions/serveadrink.ward"))
AUTHORS = (("PUT", f"{ENTRY}/content"), ("DELETE", ENTRY), ("PUT", FILE), ("DELETE", FILE))
CREATING = ("POST", "/v1/recipes?name=other")


def ask(asker: TestClient, method: str, path: str, headers: dict[str, str] | None = None) -> int:
    body: dict[str, object] = {"content": RECIPE}
    if path.endswith(("rating", "search")):
        body = {"json": {"rating": 7} if path.endswith("rating") else {}}
    if path.endswith("sparql"):
        body, headers = {"content": "ASK {}"}, {"Content-Type": "application/sparql-query"} | (headers or {})
    if method in ("GET", "DELETE"):
        body = {}
    return asker.request(method, path, headers=headers, **body).status_code  # type: ignore[arg-type]


@pytest.fixture(autouse=True)
def entry(client: TestClient) -> None:
    assert ask(client, "POST", "/v1/recipes?name=ward") == 201
    assert ask(client, "PUT", FILE) == 200


def routes(app: FastAPI) -> Iterator[tuple[str, str]]:
    for path, methods in app.openapi()["paths"].items():
        for method in methods:
            yield method.upper(), path


def test_each_route_is_among_those_that_are_tried(app: FastAPI) -> None:
    asked = {(method, path.partition("?")[0]) for method, path in (*READING, *OWN, *SUBSCRIBING, *AUTHORS, CREATING)}
    concrete = {"{kind}": "recipes", "{uid}": "serveadrink.ward", "{name}": "map.png"}
    for method, path in routes(app):
        for part, value in concrete.items():
            path = path.replace(part, value)
        assert (method, path) in asked


def test_everybody_reads(stranger: TestClient) -> None:
    assert {one: ask(stranger, *one) for one in READING} == dict.fromkeys(READING, 200)


def test_nobody_changes_anything_without_a_key(stranger: TestClient) -> None:
    changing = (*OWN, *SUBSCRIBING, *AUTHORS, CREATING)
    for headers in (None, WRONG, {"Authorization": "Basic YWRhOng="}):
        assert {one: ask(stranger, *one, headers) for one in changing} == dict.fromkeys(changing, 401)


def test_a_wrong_key_reads_as_a_stranger_or_is_told_that_it_is_wrong(stranger: TestClient) -> None:
    assert {ask(stranger, *one, WRONG) for one in READING[:-1]} <= {200, 401}


@pytest.mark.parametrize(("method", "path"), AUTHORS)
def test_only_the_author_changes_an_entry(client: TestClient, other: TestClient, method: str, path: str) -> None:
    tag = {"If-Match": client.get(ENTRY).headers["ETag"]}
    assert ask(other, method, path, tag) == 403
    assert ask(client, method, path, tag) in (200, 204)


def test_a_key_opens_nothing_but_by_its_whole(store, stranger: TestClient) -> None:  # type: ignore[no-untyped-def]
    key = store.new_key("carol", "2026-01-01T00:00:00Z")
    for wrong in (key[:-1], key + "x", key.swapcase(), "", " " + key + " x"):
        assert ask(stranger, *CREATING, {"Authorization": f"Bearer {wrong}"}) == 401
    with open(store._path, "rb") as file:
        assert key.encode() not in file.read()


def test_a_name_is_no_path(client: TestClient) -> None:
    for name in ("../../etc/passwd", "..", "a/b", "a%2fb", "a\x00b", ".hidden", "x" * 101):
        assert client.post("/v1/recipes", params={"name": name}, content=RECIPE).status_code == 422, name
        for path in ("/v1/binaries/serveadrink.ward/{}", "/v1/recipes/{}"):
            for written in (quote(name), quote(name, safe="")):
                assert client.put(path.format(written), content=b"x").status_code in (404, 405, 422), written
                assert client.get(path.format(written)).status_code in (404, 422), written


@pytest.mark.parametrize(
    "target", ["file:///etc/passwd", "../../../../etc/passwd", "/etc/hosts", "http://localhost:1/x.owl"]
)
def test_an_import_outside_of_the_given_folders_is_neither_read_nor_looked_for(client: TestClient, target: str) -> None:
    told = []
    for path in (target, f"{target}-that-is-not-there"):
        data = RECIPE.replace(b"Import: <http://knowrob.org/kb/knowrob.owl>", f"Import: <{path}>".encode())
        assert data != RECIPE
        made = client.post("/v1/recipes", params={"name": f"import{len(told)}"}, content=data)
        told.append([(one["code"], one["severity"]) for one in made.json()["diagnostics"]])
    assert told[0] == told[1]


BOMB = b"""<?xml version="1.0"?><!DOCTYPE r [<!ENTITY a "aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa">
%s]><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#"><rdf:Description rdf:about="%s"/></rdf:RDF>"""


def bombs() -> Iterator[bytes]:
    names = "abcdefghijklm"
    nested = "".join(f'<!ENTITY {b} "{f"&{a};" * 10}">' for a, b in pairwise(names))
    yield BOMB % (nested.encode(), b"&m;")
    yield BOMB % (b'<!ENTITY x SYSTEM "file:///etc/passwd">', b"&x;")
    yield BOMB.replace(b"%s", b'<!ENTITY % p SYSTEM "http://localhost:1/x"> %p;', 1)
    yield b"Prefix: : <http://x#>\nOntology: <http://x>\nClass: A SubClassOf: " + b"(" * 100_000
    yield b"@prefix : <http://x#> . :a :b " + b"[ :b " * 100_000
    yield b"<a>" * 100_000
    yield b"\xff\xfe" + b"\x00\xd8" * 1000
    yield b"\x00" * 1000
    yield b""


@pytest.mark.parametrize("bomb", list(bombs()), ids=lambda bomb: str(bomb[-20:]))
def test_what_is_meant_to_harm_is_refused_with_a_reason(client: TestClient, bomb: bytes) -> None:
    refused = client.post("/v1/recipes", params={"name": "bomb"}, content=bomb)
    assert refused.status_code == 422
    assert refused.headers["Content-Type"] == "application/problem+json"
    assert all(one["code"] and one["message"] for one in refused.json()["diagnostics"])
    assert "root:" not in refused.text


def test_compressed_bodies_are_not_read(client: TestClient) -> None:
    body, headers = gzip.compress(RECIPE), {"Content-Encoding": "gzip"}
    for method, path in (CREATING, ("PUT", FILE)):
        assert client.request(method, path, content=body, headers=headers).status_code == 415
    assert client.post("/v1/search", content=gzip.compress(b"{}"), headers=headers).status_code == 415


def test_a_body_has_a_limit_stated_or_not(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(forms, "LARGEST_BODY", 100_000)
    parts = (b"x" * 10_000 for _ in range(1000))
    assert client.put(FILE, content=b"x" * 100_001).status_code == 413
    assert client.put(FILE, content=parts).status_code == 413
    assert client.post("/v1/search", json={"label": "x" * 100_001}).status_code == 413
    assert client.put(FILE, content=b"x" * 100_000).status_code == 200


def test_what_strangers_hand_in_is_never_a_page(client: TestClient) -> None:
    client.put(FILE, content=b"<script>alert(1)</script>", headers={"Content-Type": "text/html"})
    for path in (FILE, f"{ENTRY}/content"):
        headers = client.get(path).headers
        assert headers["Content-Disposition"] == "attachment"
        assert headers["X-Content-Type-Options"] == "nosniff"
        assert headers["Content-Security-Policy"] == "sandbox"
