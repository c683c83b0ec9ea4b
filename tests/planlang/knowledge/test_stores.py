"""Every store: what was accepted stays, what was refused changes nothing."""

from __future__ import annotations

import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import httpx
import pytest

from planlang.knowledge.entries import (
    Change,
    Changed,
    Content,
    EntryExists,
    File,
    Kind,
    NoSuchEntry,
    NotTheAuthor,
    OwnEntry,
    Request,
    Store,
    Syntax,
    Unreachable,
    rating_of,
)
from planlang.knowledge.sqlite_store import SqliteStore

NOW = "2026-01-01T00:00:00Z"
SERVING = Content(
    Kind.RECIPE, "http://knowrob.org/kb/knowrob.owl#ServeADrink", "Ward 7", "serve a drink", Syntax.MANCHESTER, b"one"
)


@pytest.fixture(scope="module")
def endpoint() -> Iterator[str]:
    """Yield the address of a SPARQL server of its own, in memory."""
    pytest.importorskip("obstore", reason="obstore is not installed")
    program = Path(sys.executable).with_name("oxigraph")
    if not program.exists():
        pytest.skip("the SPARQL server oxigraph is not installed")
    address = _free_address()
    with subprocess.Popen([program, "serve", "--bind", address], stderr=subprocess.DEVNULL) as server:
        _wait_for(address)
        yield f"sparql+http://{address}"
        server.kill()


def _free_address() -> str:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return f"127.0.0.1:{free.getsockname()[1]}"


def _wait_for(address: str) -> None:
    host, _, port = address.partition(":")
    for _ in range(300):
        try:
            socket.create_connection((host, int(port)), timeout=1).close()
            return
        except OSError:
            time.sleep(0.05)
    pytest.fail("the server does not start")


@pytest.fixture(scope="module")
def bucket() -> Iterator[str]:
    """Yield the address of a server of object storage that speaks S3, with one bucket."""
    program = Path(sys.executable).with_name("moto_server")
    if not program.exists():
        pytest.skip("the server moto is not installed")
    address = _free_address()
    arguments = [program, "--port", address.partition(":")[2]]
    with subprocess.Popen(arguments, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as server:
        _wait_for(address)
        httpx.put(f"http://{address}/shared").raise_for_status()
        yield f"http://{address}"
        server.kill()


def test_contents_are_kept_in_s3(endpoint: str, bucket: str, monkeypatch: pytest.MonkeyPatch) -> None:
    from planlang.knowledge.sparql_store import SparqlStore

    settings = {"ENDPOINT_URL": bucket, "ALLOW_HTTP": "true", "REGION": "us-east-1", "ACCESS_KEY_ID": "a",
                "SECRET_ACCESS_KEY": "b"}  # fmt: skip
    for name, value in settings.items():
        monkeypatch.setenv(f"AWS_{name}", value)
    with (
        closing(SparqlStore(endpoint, "s3://shared/kb")) as one,
        closing(SparqlStore(endpoint, "s3://shared/kb")) as two,
    ):
        entry = one.create(replace(SERVING, name="in s3"), "ada", NOW)
        one.attach(entry.uid, File("model.pcd", "application/octet-stream", b"points"), "ada", NOW)
        assert two.content(entry.uid) == b"one"
        assert two.attachment(entry.uid, "model.pcd")[1] == b"points"


@pytest.fixture(params=["sqlite", "sparql"])
def store(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Store]:
    opened: Store
    if request.param == "sqlite":
        opened = SqliteStore(tmp_path / "kb.sqlite")
    else:
        from planlang.knowledge.sparql_store import SparqlStore

        server = request.getfixturevalue("endpoint")
        opened = SparqlStore(server, tmp_path.as_uri())
        update = {"content": "DROP ALL", "headers": {"Content-Type": "application/sparql-update"}}
        httpx.post(f"{server.removeprefix('sparql+')}/update", **update).raise_for_status()
    yield opened
    opened.close()


def test_an_entry_is_found_under_its_class_and_the_authors_name_for_it(store: Store) -> None:
    entry = store.create(SERVING, "ada", NOW)
    assert entry.uid == "serveadrink.ward7"
    assert store.entry(entry.uid) == entry == next(store.entries(Kind.RECIPE))
    assert store.content(entry.uid) == b"one"
    assert list(store.entries(Kind.ROBOT)) == []


def test_an_identifier_is_given_once(store: Store) -> None:
    store.create(SERVING, "ada", NOW)
    with pytest.raises(EntryExists):
        store.create(SERVING, "bob", NOW)


@pytest.mark.parametrize("name", ["", "../x", "a/b", "x" * 101, "☃", "a.b", "a%2Fb", "a%FF"])
def test_a_name_that_makes_no_identifier_is_refused(store: Store, name: str) -> None:
    with pytest.raises(ValueError, match="cannot be part of an identifier"):
        store.create(replace(SERVING, name=name), "ada", NOW)


def test_only_who_knows_the_last_revision_changes_it(store: Store) -> None:
    first = store.create(SERVING, "ada", NOW)
    second = store.change(first.uid, replace(SERVING, data=b"two"), "ada", first.etag, NOW)
    with pytest.raises(Changed):
        store.change(first.uid, replace(SERVING, data=b"three"), "ada", first.etag, NOW)
    with pytest.raises(NotTheAuthor):
        store.delete(first.uid, "bob", second.etag, NOW)
    assert store.content(first.uid) == b"two"
    assert store.content(first.uid, 1) == b"one"
    assert [one.number for one in store.revisions(first.uid)] == [2, 1]


def test_ten_earlier_revisions_are_kept_and_contents_of_older_ones_forgotten(store: Store) -> None:
    entry = store.create(SERVING, "ada", NOW)
    for number in range(15):
        entry = store.change(entry.uid, replace(SERVING, data=bytes([number])), "ada", entry.etag, NOW)
    assert [one.number for one in store.revisions(entry.uid)] == list(range(16, 5, -1))
    with pytest.raises(NoSuchEntry):
        store.content(entry.uid, 5)


def test_a_tag_never_means_two_contents_also_not_after_deletion(store: Store) -> None:
    first = store.create(SERVING, "ada", NOW)
    store.delete(first.uid, "ada", first.etag, NOW)
    with pytest.raises(NoSuchEntry):
        store.content(first.uid)
    assert store.create(SERVING, "ada", NOW).etag != first.etag


def test_files_belong_to_their_entry_and_go_with_it(store: Store) -> None:
    entry = store.create(SERVING, "ada", NOW)
    store.attach(entry.uid, File("model.pcd", "application/octet-stream", b"one"), "ada", NOW)
    store.attach(entry.uid, File("model.pcd", "application/octet-stream", b"one"), "ada", NOW)
    attachment, data = store.attachment(entry.uid, "model.pcd")
    assert (attachment.size, data) == (3, b"one")
    assert store.entry(entry.uid).attachments == (attachment,)
    store.detach(entry.uid, "model.pcd", "ada", NOW)
    assert store.content(entry.uid) == b"one"
    with pytest.raises(NoSuchEntry):
        store.attachment(entry.uid, "model.pcd")
    with pytest.raises(NotTheAuthor):
        store.attach(entry.uid, File("x", "text/plain", b""), "bob", NOW)


def test_an_author_has_one_rating_and_none_of_an_own_entry(store: Store) -> None:
    entry = store.create(SERVING, "ada", NOW)
    for author, rating in (("bob", 3), ("eve", 8), ("bob", 10)):
        store.rate(entry.uid, author, rating, NOW)
    rated = store.entry(entry.uid)
    assert (rated.rating, rated.ratings, rated.etag) == (rating_of([8, 10]), 2, entry.etag)
    assert list(store.entries()) == [rated]
    for wrong in (-1, 11):
        with pytest.raises(ValueError, match="from 0 to 10"):
            store.rate(entry.uid, "bob", wrong, NOW)
    with pytest.raises(OwnEntry):
        store.rate(entry.uid, "ada", 10, NOW)
    assert store.entry(entry.uid) == rated


@pytest.mark.parametrize(
    ("ratings", "rating"), [([], None), ([0], 5), ([10], 5), ([9, 9, 9, 9, 0], 9), ([8, 8, 8], 8), ([0, 0, 0], 0)]
)
def test_a_single_rating_neither_sinks_an_entry_nor_lifts_it_above_well_rated_ones(
    ratings: list[int], rating: float | None
) -> None:
    assert rating_of(ratings) == rating


def test_keys_that_were_dropped_are_nobodys_and_those_of_others_stay(store: Store) -> None:
    keys, other = [store.new_key("ada", NOW) for _ in range(2)], store.new_key("bob", NOW)
    assert (store.drop_keys("ada"), store.drop_keys("ada")) == (2, 0)
    assert [store.author_of(key) for key in (*keys, other)] == [None, None, "bob"]
    assert store.author_of(store.new_key("ada", NOW)) == "ada"


def test_keys_tell_authors(store: Store) -> None:
    key, other = store.new_key("ada", NOW), store.new_key("ada", NOW)
    assert store.author_of(key) == store.author_of(other) == "ada"
    assert store.author_of(key[:-1]) is None


def test_a_feed_tells_what_happened_to_what_an_author_subscribed_to(store: Store) -> None:
    mine = store.create(SERVING, "ada", NOW)
    other = store.create(replace(SERVING, name="other"), "ada", NOW)
    store.subscribe("bob", mine.uid, NOW)
    store.rate(other.uid, "eve", 1, NOW)
    store.delete(mine.uid, "ada", mine.etag, NOW)
    assert [(one.change, one.uid) for one in store.news(author="bob")] == [
        (Change.CREATED, mine.uid),
        (Change.DELETED, mine.uid),
    ]
    assert [one.number for one in store.news(2)] == [3, 4]
    assert [one.number for one in store.news(2, newest_first=True)] == [4, 3]
    assert [one.number for one in store.news(limit=1, newest_first=True)] == [4]
    assert store.news(author="bob", newest_first=True) == store.news(author="bob")[::-1]
    assert store.subscriptions("bob") == (mine.uid,)
    store.unsubscribe("bob", mine.uid)
    assert store.news(author="bob") == ()


def test_a_request_is_known_again_with_the_entry_that_it_made(store: Store) -> None:
    entry = store.create(SERVING, "ada", NOW, Request("key", "digest"))
    assert store.requested("ada", "key") == ("digest", entry.uid)
    assert store.requested("bob", "key") is None


def test_servers_side_by_side_never_both_change_a_revision(endpoint: str, tmp_path: Path) -> None:
    from planlang.knowledge.sparql_store import SparqlStore

    files = tmp_path.as_uri()
    with closing(SparqlStore(endpoint, files)) as one, closing(SparqlStore(endpoint, files)) as two:
        entry = one.create(replace(SERVING, name="shared"), "ada", NOW)
        changed = one.change(entry.uid, replace(SERVING, data=b"of one"), "ada", entry.etag, NOW)
        with pytest.raises(Changed):
            two.change(entry.uid, replace(SERVING, data=b"of two"), "ada", entry.etag, NOW)
        assert two.entry(entry.uid) == changed
        assert two.content(entry.uid) == b"of one"


def test_an_endpoint_that_does_not_answer_is_told() -> None:
    pytest.importorskip("obstore", reason="obstore is not installed")
    from planlang.knowledge.sparql_store import SparqlStore

    with closing(SparqlStore("sparql+http://127.0.0.1:9", "memory:///")) as store, pytest.raises(Unreachable):
        store.last_news()
