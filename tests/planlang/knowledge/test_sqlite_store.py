"""The store in one file: what was accepted stays, what was refused changes nothing, and a crash loses neither."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from planlang.diagnostics import BadInput
from planlang.knowledge.entries import Change, Content, Kind, Syntax
from planlang.knowledge.sqlite_store import SqliteStore
from planlang.knowledge.stores import Changed, EntryExists, NoSuchEntry, NotTheAuthor, Refused, Request

NOW = "2026-01-01T00:00:00Z"
SERVING = Content(
    Kind.RECIPE, "http://knowrob.org/kb/knowrob.owl#ServeADrink", "Ward 7", "serve a drink", Syntax.MANCHESTER, b"one"
)


@pytest.fixture
def store(tmp_path: Path) -> Iterator[SqliteStore]:
    opened = SqliteStore(tmp_path / "kb.sqlite")
    yield opened
    opened.close()


def test_an_entry_is_found_under_its_class_and_the_authors_name_for_it(store: SqliteStore) -> None:
    entry = store.create(SERVING, "ada", NOW)
    assert entry.uid == "serveadrink.ward7"
    assert store.entry(entry.uid) == entry == next(store.entries(Kind.RECIPE))
    assert store.content(entry.uid) == b"one"
    assert list(store.entries(Kind.ROBOT)) == []


def test_an_identifier_is_given_once(store: SqliteStore) -> None:
    store.create(SERVING, "ada", NOW)
    with pytest.raises(EntryExists):
        store.create(SERVING, "bob", NOW)


@pytest.mark.parametrize("name", ["", "../x", "a/b", "x" * 101, "ü", "a.b"])
def test_a_name_that_makes_no_identifier_is_refused(store: SqliteStore, name: str) -> None:
    with pytest.raises(ValueError, match="no name of an entry"):
        store.create(replace(SERVING, name=name), "ada", NOW)


def test_only_who_knows_the_last_revision_changes_it(store: SqliteStore) -> None:
    first = store.create(SERVING, "ada", NOW)
    second = store.change(first.uid, replace(SERVING, data=b"two"), "ada", first.etag, NOW)
    with pytest.raises(Changed):
        store.change(first.uid, replace(SERVING, data=b"three"), "ada", first.etag, NOW)
    with pytest.raises(NotTheAuthor):
        store.delete(first.uid, "bob", second.etag, NOW)
    assert store.content(first.uid) == b"two"
    assert store.content(first.uid, 1) == b"one"
    assert [one.number for one in store.revisions(first.uid)] == [2, 1]


def test_ten_earlier_revisions_are_kept_and_contents_of_older_ones_forgotten(store: SqliteStore) -> None:
    entry = store.create(SERVING, "ada", NOW)
    for number in range(15):
        entry = store.change(entry.uid, replace(SERVING, data=bytes([number])), "ada", entry.etag, NOW)
    assert [one.number for one in store.revisions(entry.uid)] == list(range(16, 5, -1))
    with pytest.raises(NoSuchEntry):
        store.content(entry.uid, 5)


def test_a_tag_never_means_two_contents_also_not_after_deletion(store: SqliteStore) -> None:
    first = store.create(SERVING, "ada", NOW)
    store.delete(first.uid, "ada", first.etag, NOW)
    with pytest.raises(NoSuchEntry):
        store.content(first.uid)
    assert store.create(SERVING, "ada", NOW).etag != first.etag


def test_files_belong_to_their_entry_and_go_with_it(store: SqliteStore) -> None:
    entry = store.create(SERVING, "ada", NOW)
    store.attach(entry.uid, "model.pcd", "application/octet-stream", b"one", "ada", NOW)
    store.attach(entry.uid, "model.pcd", "application/octet-stream", b"one", "ada", NOW)
    attachment, data = store.attachment(entry.uid, "model.pcd")
    assert (attachment.size, data) == (3, b"one")
    assert store.entry(entry.uid).attachments == (attachment,)
    store.detach(entry.uid, "model.pcd", "ada", NOW)
    assert store.content(entry.uid) == b"one"
    with pytest.raises(NoSuchEntry):
        store.attachment(entry.uid, "model.pcd")
    with pytest.raises(NotTheAuthor):
        store.attach(entry.uid, "x", "text/plain", b"", "bob", NOW)


def test_an_author_has_one_rating_and_the_mean_is_shown(store: SqliteStore) -> None:
    entry = store.create(SERVING, "ada", NOW)
    for author, rating in (("bob", 3), ("eve", 8), ("bob", 10)):
        store.rate(entry.uid, author, rating, NOW)
    rated = store.entry(entry.uid)
    assert (rated.rating, rated.ratings, rated.etag) == (9.0, 2, entry.etag)
    for wrong in (-1, 11):
        with pytest.raises(ValueError, match="from 0 to 10"):
            store.rate(entry.uid, "bob", wrong, NOW)


def test_keys_tell_authors_and_are_not_in_the_file(store: SqliteStore, tmp_path: Path) -> None:
    key, other = store.new_key("ada", NOW), store.new_key("ada", NOW)
    assert store.author_of(key) == store.author_of(other) == "ada"
    assert store.author_of(key[:-1]) is None
    store.close()
    assert all(key.encode() not in path.read_bytes() for path in tmp_path.iterdir())


def test_a_feed_tells_what_happened_to_what_an_author_subscribed_to(store: SqliteStore) -> None:
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
    assert store.subscriptions("bob") == (mine.uid,)
    store.unsubscribe("bob", mine.uid)
    assert store.news(author="bob") == ()


def test_a_request_is_known_again_with_the_entry_that_it_made(store: SqliteStore) -> None:
    entry = store.create(SERVING, "ada", NOW, Request("key", "digest"))
    assert store.requested("ada", "key") == ("digest", entry.uid)
    assert store.requested("bob", "key") is None


def test_a_file_of_another_kind_is_refused_and_stays_as_it_is(tmp_path: Path) -> None:
    path = tmp_path / "notes.txt"
    path.write_text("no database" * 100)
    with pytest.raises(BadInput) as refused:
        SqliteStore(path)
    assert refused.value.diagnostics[0].code == "K001"
    assert path.read_text() == "no database" * 100


_WRITER = """
import sys
from dataclasses import replace
from pathlib import Path
from planlang.knowledge.entries import Content, Kind, Syntax
from planlang.knowledge.sqlite_store import SqliteStore
store = SqliteStore(Path(sys.argv[1]))
for number in range(int(sys.argv[2]), 10**9):
    content = Content(Kind.RECIPE, "x#Step", f"n{number}", "", Syntax.TURTLE, str(number).encode() * 1000)
    print(store.create(content, "ada", "now").uid, flush=True)
"""


def test_after_kill_minus_nine_everything_accepted_is_there(tmp_path: Path) -> None:
    path, accepted = tmp_path / "kb.sqlite", list[str]()
    for killed in range(5):
        arguments = [sys.executable, "-c", _WRITER, str(path), str(killed * 1_000_000)]
        with subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True) as writer:
            assert writer.stdout is not None
            for _ in range(3 + killed):
                accepted.append(writer.stdout.readline().strip())
            os.kill(writer.pid, signal.SIGKILL)
            accepted += writer.stdout.read().split("\n")[:-1]
    store = SqliteStore(path)
    assert {entry.uid for entry in store.entries()} >= set(accepted)
    for entry in store.entries():
        assert store.content(entry.uid) == entry.uid.removeprefix("step.n").encode() * 1000
    store.close()


class _Model(RuleBasedStateMachine):
    """Any calls, beside a dictionary of what must be there."""

    names = st.sampled_from(["a", "b", "c"])
    authors = st.sampled_from(["ada", "bob"])

    def __init__(self) -> None:
        super().__init__()
        self.store = SqliteStore(Path(":memory:"))
        self.kept: dict[str, tuple[str, list[bytes]]] = {}

    def teardown(self) -> None:
        self.store.close()

    @rule(name=names, author=authors, data=st.binary(max_size=4))
    def create(self, name: str, author: str, data: bytes) -> None:
        content = replace(SERVING, name=name, data=data)
        uid = f"serveadrink.{name}"
        if uid in self.kept:
            with pytest.raises(EntryExists):
                self.store.create(content, author, NOW)
        else:
            self.store.create(content, author, NOW)
            self.kept[uid] = (author, [data])

    @precondition(lambda self: self.kept)
    @rule(data=st.data(), author=authors, content=st.binary(max_size=4), is_current=st.booleans())
    def change(self, data: st.DataObject, author: str, content: bytes, *, is_current: bool) -> None:
        uid = data.draw(st.sampled_from(sorted(self.kept)))
        tag = self.store.entry(uid).etag if is_current else '"0"'
        owner, contents = self.kept[uid]
        try:
            self.store.change(uid, replace(SERVING, data=content), author, tag, NOW)
            contents.append(content)
            assert owner == author
            assert is_current
        except Refused:
            assert owner != author or not is_current

    @precondition(lambda self: self.kept)
    @rule(data=st.data(), author=authors)
    def delete(self, data: st.DataObject, author: str) -> None:
        uid = data.draw(st.sampled_from(sorted(self.kept)))
        if self.kept[uid][0] != author:
            with pytest.raises(NotTheAuthor):
                self.store.delete(uid, author, self.store.entry(uid).etag, NOW)
        else:
            self.store.delete(uid, author, self.store.entry(uid).etag, NOW)
            del self.kept[uid]

    @invariant()
    def what_is_kept_is_what_was_accepted(self) -> None:
        assert [entry.uid for entry in self.store.entries()] == sorted(self.kept)
        for uid, (author, contents) in self.kept.items():
            assert self.store.entry(uid).author == author
            assert self.store.content(uid) == contents[-1]
            for revision, content in zip(self.store.revisions(uid), reversed(contents), strict=False):
                assert self.store.content(uid, revision.number) == content


TestAnyCalls = _Model.TestCase
