"""The web page as HTML: what it shows without any script, what its forms do, and what labels of strangers cannot."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import suppress
from html import escape, unescape
from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from executive.serving import watching
from executive.serving.app import application
from executive.serving.forms import read_form
from executive.serving.problems import Problem
from executive.serving.workers import Staff
from planlang.files import Bundled
from planlang.knowledge.entries import Content, Kind, Syntax
from planlang.knowledge.sqlite_store import SqliteStore

NOW = "2026-01-01T00:00:00Z"
RECIPE = Bundled.RECIPE.find("serve_a_drink").read_text()
AMIGO = Bundled.ROBOT.find("amigo").with_suffix(".omn").read_text()
BROKEN = RECIPE.replace(
    "        knowrob:toLocation value graspingPlace", "        knowrob:toLocation valu graspingPlace", 1
)
SCRIPT = "<script>alert(1)</script>\"'><img src=x onerror=alert(1)>"
BARE_ROBOT = """Prefix: : <http://example.org/bare.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://example.org/bare.owl>
Individual: bare
    Types: knowrob:Robot
"""


@pytest.fixture
def store(tmp_path: Path) -> Iterator[SqliteStore]:
    opened = SqliteStore(tmp_path / "kb.sqlite")
    yield opened
    opened.close()


@pytest.fixture
def key(store: SqliteStore) -> str:
    return store.new_key("ada", NOW)


@pytest.fixture
def client(store: SqliteStore, staff: Staff) -> TestClient:
    return TestClient(application(store, staff))


def upload(client: TestClient, key: str, text: str = RECIPE, **fields: str) -> str:
    return client.post("/upload", data={"kind": "recipes", "name": "ward", "text": text, "key": key} | fields).text


def test_a_recipe_is_uploaded_found_and_read(client: TestClient, key: str) -> None:
    assert "Accepted." in upload(client, key)
    upload(client, key, AMIGO, kind="robots", name="tue")
    assert 'href="/recipes/serveadrink.ward"' in client.get("/").text
    assert 'href="/recipes/serveadrink.ward"' in client.get("/recipes").text
    question = {"expression": "ServingFoodOrDrink and subAction some Reaching", "robot": "amigo1.tue"}
    found = client.get("/search", params=question).text
    assert "1 result" in found
    assert "can do it" in found
    entry = client.get("/recipes/serveadrink.ward").text
    assert "<svg" in entry
    assert "GripperMotionCapability" in entry
    assert "ManipulationEntity" in entry
    assert "amigo1.tue" in entry


def test_what_is_wrong_with_a_recipe_stands_at_its_line(client: TestClient, key: str) -> None:
    page = upload(client, key, BROKEN)
    assert "Rejected:" in page
    number = BROKEN.split("\n").index("        knowrob:toLocation valu graspingPlace") + 1
    at_line = page.partition(f'<span class="number">{number}</span>')[2].partition('<div class="line')[0]
    assert 'class="diagnostic error"' in at_line
    assert f'<a href="#line-{number}">line {number}</a>: ' in page  # errors are named before the lines and their notes
    assert escape(BROKEN.split("\n")[2]) in page  # to be mended and sent again
    assert client.get("/recipes").text.count("serveadrink.ward") == 0


def test_an_error_is_shown_however_many_notes_stand_before_it(client: TestClient, key: str) -> None:
    head, imported, rest = RECIPE.partition("    Import:")
    others = "".join(f"    Import: <package://elsewhere/owl/mugs{one}.owl>\n" for one in range(150))
    page = upload(client, key, head + others + imported + rest.replace("Action some ", "Action some No", 1))
    assert "more are not shown" in page
    assert 'class="diagnostic error"' in page


def test_a_file_is_taken_as_its_bytes_are(client: TestClient, key: str, store: SqliteStore) -> None:
    data = RECIPE.replace("\n", "\r\n").encode("utf-16")
    fields = {"kind": "recipes", "name": "ward", "key": key, "text": ""}
    page = client.post("/upload", data=fields, files={"file": ("drink.omn", data)}).text
    assert "Accepted." in page
    assert store.content("serveadrink.ward") == data


def test_a_check_keeps_nothing(client: TestClient, key: str, store: SqliteStore) -> None:
    assert "The checks have passed." in upload(client, key, only="check")
    assert not list(store.entries())


def test_a_revision_is_taken_only_behind_the_one_that_was_read(client: TestClient, key: str) -> None:
    upload(client, key)
    form = client.get("/upload", params={"uid": "serveadrink.ward"}).text
    (etag,) = re.findall(r'name="etag" value="([^"]*)"', form)
    fields = {"uid": "serveadrink.ward", "etag": etag.replace("&#34;", '"')}
    assert "revision 2" in upload(client, key, RECIPE + "# better\n", **fields)
    assert "Rejected:" in upload(client, key, RECIPE + "# late\n", **fields)
    assert "# better" not in client.get("/recipes/serveadrink.ward", params={"revision": 1}).text
    assert "# better" in client.get("/recipes/serveadrink.ward").text


def test_only_an_author_s_own_entry_is_revised(client: TestClient, key: str, store: SqliteStore) -> None:
    upload(client, key)
    tag = store.entry("serveadrink.ward").etag
    page = upload(client, store.new_key("eve", NOW), RECIPE + "# eve\n", uid="serveadrink.ward", etag=tag)
    assert "is not yours" in page


@pytest.mark.parametrize("given", ["", "nobody"])
def test_without_a_key_nothing_is_taken_or_rated(client: TestClient, key: str, given: str, store: SqliteStore) -> None:
    upload(client, key)
    assert "Rejected:" in upload(client, given, name="other")
    page = client.post("/recipes/serveadrink.ward/rating", data={"rating": "7", "key": given}).text
    assert "Refused:" in page
    assert [entry.ratings for entry in store.entries()] == [0]


def test_a_rating_is_kept_and_shown(client: TestClient, key: str, store: SqliteStore) -> None:
    upload(client, key)
    rating = {"rating": "7", "key": store.new_key("eve", NOW)}
    page = client.post("/recipes/serveadrink.ward/rating", data=rating)
    assert str(page.url).endswith("/recipes/serveadrink.ward#rating")
    assert "5.0<small> of 10, 1 rating</small>" in page.text
    assert "Refused:" in client.post("/recipes/serveadrink.ward/rating", data=rating | {"rating": "11"}).text


def test_who_may_not_do_something_is_told_so_by_the_status_too(client: TestClient, key: str) -> None:
    upload(client, key)
    for sent, status in (("", 401), ("nobody", 401), (key, 403)):
        page = client.post("/recipes/serveadrink.ward/rating", data={"rating": "7", "key": sent})
        assert (page.status_code, "Refused:" in page.text) == (status, True)
    assert client.post("/news", data={"key": "nobody"}).status_code == 401
    assert client.post("/upload", data={"key": "nobody", "name": "x", "text": RECIPE}).status_code == 401


def test_an_author_watches_an_entry_and_is_told_what_happened_to_it(
    client: TestClient, key: str, store: SqliteStore
) -> None:
    upload(client, key)
    watching = {"uid": "serveadrink.ward", "key": key}
    assert "Entries that <bdi>ada</bdi> watches" in client.post("/news", data={**watching, "do": "watch"}).text
    eve = store.new_key("eve", NOW)
    client.post("/recipes/serveadrink.ward/rating", data={"rating": "7", "key": eve})
    told = client.post("/news", data={"key": key}).text
    assert re.search(r"serveadrink\.ward</a> rated by <bdi>eve</bdi>", told)
    assert told.index(" rated by ") < told.index(" uploaded by ")
    assert " rated by " not in client.post("/news", data={**watching, "do": "stop"}).text


def test_what_is_watched_is_stopped_in_its_line_and_what_is_gone_has_no_link(
    client: TestClient, key: str, store: SqliteStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    upload(client, key)
    made = store.entry("serveadrink.ward")
    content = Content(Kind.OBJECT, "urn:o#Cup", "one", "cup", Syntax.TURTLE, b"")
    store.create(content, "ada", made.created)
    for uid in ("serveadrink.ward", "cup.one"):
        client.post("/news", data={"uid": uid, "key": key})
    monkeypatch.setattr(watching, "MOST_WATCHED", 1)
    assert "the first 1 of 2" in client.post("/news", data={"key": key}).text
    store.delete(made.uid, "ada", made.etag, made.created)
    told = client.post("/news", data={"key": key}).text
    assert 'href="/objects/cup.one"' in told
    assert 'href="/recipes/serveadrink.ward"' not in told
    lines = [f"<code>serveadrink.ward</code> {done} by" for done in ("deleted", "uploaded")]
    assert -1 < told.find(lines[0]) < told.find(lines[1])
    told = client.post("/news", data={"stop": "cup.one", "key": key}).text
    assert "cup.one" not in told
    assert store.subscriptions("ada") == ("serveadrink.ward",)


def test_nobody_watches_without_a_key_or_what_is_not_there(client: TestClient, key: str) -> None:
    assert "this needs your key" in client.post("/news", data={"uid": "serveadrink.ward"}).text
    assert "there is no entry none.such" in client.post("/news", data={"uid": "none.such", "key": key}).text


def test_a_self_model_that_is_sent_along_is_told_what_it_lacks_and_not_kept(
    client: TestClient, key: str, store: SqliteStore
) -> None:
    upload(client, key)
    page = client.post("/recipes/serveadrink.ward/robots", files={"model": ("bare.omn", BARE_ROBOT)}).text
    assert "your self-model" in page
    assert "cannot do it" in page
    assert "bare has none" in page
    assert [entry.uid for entry in store.entries()] == ["serveadrink.ward"]
    unread = client.post("/recipes/serveadrink.ward/robots", files={"model": ("bare.omn", "no ontology")}).text
    assert "Refused:" in unread


def test_scripts_in_labels_names_and_questions_are_text(client: TestClient, key: str) -> None:
    hostile = RECIPE.replace('rdfs:label "serve a drink"', f'rdfs:label "{SCRIPT}"'.replace(">\"'>", ">\\\"'>"), 1)
    assert hostile != RECIPE
    assert "Accepted." in upload(client, key, hostile)
    asked = [client.get(path) for path in ("/", "/recipes", "/recipes/serveadrink.ward", "/search?label=script")]
    asked += [client.get("/search", params={"expression": SCRIPT, "label": SCRIPT, "room": SCRIPT, "kind": SCRIPT})]
    asked += [client.post("/upload", data={"name": SCRIPT, "about": SCRIPT, "text": SCRIPT, "key": key})]
    for answer in asked:
        assert SCRIPT not in answer.text
        assert "<script>" not in answer.text
        assert "<img" not in answer.text
        assert "&lt;script&gt;" in answer.text


def test_no_page_lets_scripts_run_that_are_not_ours(client: TestClient) -> None:
    for path in ("/", "/recipes", "/search", "/upload", "/recipes/none.none", "/static/page.js"):
        rules = client.get(path).headers["content-security-policy"].split("; ")
        assert "default-src 'none'" in rules
        assert "script-src 'self'" in rules
        assert "unsafe" not in " ".join(rules)


def test_what_is_not_there_is_a_page_that_says_so(client: TestClient) -> None:
    for path in ("/recipes/none.none", "/upload?uid=none.none", "/static/../app.py", "/search?robot=none"):
        assert "there is no" in client.get(path).text or path.startswith("/static"), path
    assert client.get("/recipes/none.none").status_code == 404
    assert "there is no page" in client.get("/nowhere").text
    assert client.get("/v1/nowhere/at/all").headers["content-type"] == "application/problem+json"
    assert client.get("/static/%2e%2e%2fapp.py").status_code == 404


@pytest.mark.parametrize(
    ("body", "content_type", "status"),
    [
        (b"{}", "application/json", 415),
        (b"x", "multipart/form-data", 400),
        (b"--b\r\nno header\r\n\r\n", "multipart/form-data; boundary=b", 400),
        (b"&".join(b"a%d=1" % number for number in range(100)), "application/x-www-form-urlencoded", 400),
        (b"kind=spells", "application/x-www-form-urlencoded", 422),
    ],
)
def test_what_is_no_form_is_refused(client: TestClient, body: bytes, content_type: str, status: int) -> None:
    answer = client.post("/upload", content=body, headers={"Content-Type": content_type})
    assert answer.status_code == status, answer.text


def test_names_are_completed_from_their_beginning_first(client: TestClient) -> None:
    names = client.get("/names", params={"start": "servingf"}).json()["names"]
    assert names[0] == "ServingFoodOrDrink"
    assert client.get("/names", params={"start": "FoodOrDr"}).json()["names"][0] == "FoodOrDrink"


def test_a_step_that_nothing_performs_is_named_where_a_robot_perhaps_can_do_it(client: TestClient, key: str) -> None:
    steps = "Class: Dream\n    SubClassOf: knowrob:Event\nClass: "
    unperformed = RECIPE.replace(
        "subAction some GraspBottle", "subAction some GraspBottle, knowrob:subAction some Dream"
    )
    assert "Accepted." in upload(client, key, unperformed.replace("Class: ", steps, 1))
    page = client.post("/recipes/serveadrink.ward/robots", files={"model": ("amigo.omn", AMIGO)}).text
    assert "may be able to do it" in page
    assert "Dream" in page.partition("lacks or may lack")[2].partition("</summary>")[0]


def test_what_is_found_is_compared_with_a_self_model_that_is_sent_along(client: TestClient, key: str) -> None:
    upload(client, key)
    model = {"model": ("bare.omn", BARE_ROBOT)}
    assert "cannot do it" in client.post("/search", data={"label": "drink"}, files=model).text
    assert "this is neither" in client.post("/search", data={"label": "drink"}, files={"model": ("x", "x")}).text


def test_a_robot_of_the_store_is_asked_for_by_its_identifier(client: TestClient, key: str) -> None:
    upload(client, key)
    upload(client, key, BARE_ROBOT, kind="robots", name="own")
    assert "cannot do it" in client.get("/recipes/serveadrink.ward", params={"robot": "bare.own"}).text
    assert client.get("/recipes/serveadrink.ward", params={"robot": "serveadrink.ward"}).status_code == 404
    found = client.get("/search", params={"robot": "bare.own"}).text
    assert "cannot do it" in found
    assert 'href="/robots/bare.own"' not in found


def test_what_a_page_says_that_an_entry_is_found_by_finds_it(client: TestClient, key: str) -> None:
    upload(client, key)
    upload(client, key, AMIGO, kind="robots", name="tue")
    renamed = RECIPE.replace("serve_a_drink.owl", "serve_a_drink_again.owl")  # the same names mean several things now
    upload(client, key, renamed, name="again")
    for address in ("/recipes/serveadrink.ward", "/recipes/serveadrink.again", "/robots/amigo1.tue"):
        links = re.findall(r'href="(/search\?expression=[^"]*)"', client.get(address).text)
        assert len(links) >= 4
        for link in links:
            assert f'href="{address}"' in client.get(unescape(link)).text, link


def test_the_address_of_a_form_leads_to_its_entry(client: TestClient, key: str) -> None:
    upload(client, key)
    assert client.get("/recipes/serveadrink.ward/rating").url.path == "/recipes/serveadrink.ward"


FORM = (
    b'--b\r\nContent-Disposition: form-data; name="kind"\r\n\r\nrecipes\r\n'
    b'--b\r\nContent-Disposition: form-data; name="file"; filename="x.omn"\r\n'
    b"Content-Type: text/plain\r\nContent-Transfer-Encoding: base64\r\n\r\nYWJj\r\n--b--\r\n"
)


@given(st.integers(0, len(FORM)), st.integers(0, 20), st.binary(max_size=20), st.booleans())
def test_a_damaged_form_is_read_or_refused(start: int, length: int, written: bytes, is_plain: bool) -> None:
    data = FORM[:start] + written + FORM[start + length :]
    with suppress(Problem):
        read_form(data, "application/x-www-form-urlencoded" if is_plain else "multipart/form-data; boundary=b")


@given(st.sampled_from(("expression", "label", "kind", "robot", "room", "limit", "after")), st.text(max_size=40))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_question_has_an_answer(client: TestClient, field: str, text: str) -> None:
    assert client.get("/search", params={"label": "a", field: text}).status_code == 200
    assert client.post("/search", data={"label": "a", field: text}).status_code == 200


IMPOSSIBLE = """Prefix: : <http://example.org/damp.owl#>
Prefix: owl: <http://www.w3.org/2002/07/owl#>
Ontology: <http://example.org/damp.owl>
Class: DampTowel
    SubClassOf: :Dry, :Wet
Class: Wet
Class: Dry
"""


def test_an_entry_that_nothing_can_be_says_why(tmp_path: Path, store: SqliteStore, key: str) -> None:
    words = "Ontology: <http://example.org/words.owl>\nClass: <{0}Dry>\n    DisjointWith: <{0}Wet>\nClass: <{0}Wet>\n"
    (tmp_path / "words.omn").write_text(words.format("http://example.org/damp.owl#"))
    staff = Staff([tmp_path])
    client = TestClient(application(store, staff))
    upload(client, key, IMPOSSIBLE, kind="objects", about="DampTowel")
    page = client.get("/objects/damptowel.ward").text
    assert "Unsatisfiable" in page
    assert "Dry and Wet exclude each other in this server&#39;s ontologies" in page
    assert ">Nothing<" not in page
    client.app.state.serving.close()  # type: ignore[attr-defined]
