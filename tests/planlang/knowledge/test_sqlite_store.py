"""The store in one file: a crash loses nothing, and any calls leave what a dictionary would hold."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
import threading
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from planlang.diagnostics import BadInput
from planlang.knowledge.entries import Content, EntryExists, Full, Kind, NotTheAuthor, Refused, Syntax
from planlang.knowledge.sqlite_store import SqliteStore

NOW = "2026-01-01T00:00:00Z"
SERVING = Content(
    Kind.RECIPE, "http://knowrob.org/kb/knowrob.owl#ServeADrink", "Ward 7", "serve a drink", Syntax.MANCHESTER, b"one"
)


def test_keys_are_not_in_the_file(tmp_path: Path) -> None:
    store = SqliteStore(tmp_path / "kb.sqlite")
    key = store.new_key("ada", NOW)
    store.close()
    assert all(key.encode() not in path.read_bytes() for path in tmp_path.iterdir())


def test_a_file_of_another_kind_is_refused_and_stays_as_it_is(tmp_path: Path) -> None:
    path = tmp_path / "notes.txt"
    path.write_text("no database" * 100)
    with pytest.raises(BadInput) as refused:
        SqliteStore(path)
    assert refused.value.diagnostics[0].code == "K001"
    assert path.read_text() == "no database" * 100


def test_a_folder_is_no_knowledge_base_and_a_missing_one_is_named(tmp_path: Path) -> None:
    for path, message in (
        (tmp_path, f"{tmp_path} is a folder"),
        (tmp_path / "a/b", f"there is no folder {tmp_path}/a"),
    ):
        with pytest.raises(BadInput) as refused:
            SqliteStore(path)
        assert refused.value.diagnostics[0].message == message


@pytest.mark.skipif(not Path("/proc/self/fd").is_dir(), reason="open files are listed in /proc")
def test_threads_that_have_ended_keep_no_file_open(tmp_path: Path) -> None:
    store = SqliteStore(tmp_path / "kb.sqlite")
    before, together = len(os.listdir("/proc/self/fd")), threading.Barrier(20)
    for _ in range(5):
        threads = [threading.Thread(target=lambda: (together.wait(), store.last_news())) for _ in range(20)]
        for one in threads:
            one.start()
        for one in threads:
            one.join()
    assert len(os.listdir("/proc/self/fd")) <= before + 3 * 20  # one burst's: the file, its log and its index
    store.close()


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


@pytest.mark.long
@pytest.mark.parametrize("times", [5, pytest.param(100, marks=pytest.mark.long)])
def test_after_kill_minus_nine_everything_accepted_is_there(tmp_path: Path, times: int) -> None:
    path, accepted = tmp_path / "kb.sqlite", list[str]()
    for killed in range(times):
        arguments = [sys.executable, "-c", _WRITER, str(path), str(killed * 1_000_000)]
        with subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True) as writer:
            assert writer.stdout is not None
            for _ in range(3 + killed % 7):
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


def test_a_full_disk_is_said_and_the_store_stays_as_it_was(tmp_path: Path) -> None:
    """In a process that may write no more than half a megabyte into a file, as on a disk with so much room."""
    pid = os.fork()
    if pid == 0:
        status = 1
        try:
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            resource.setrlimit(resource.RLIMIT_FSIZE, (500_000, 500_000))
            _fill(tmp_path / "kb.sqlite")
            status = 0
        finally:
            os._exit(status)
    assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == 0
    store = SqliteStore(tmp_path / "kb.sqlite")
    assert [store.content(one.uid) for one in store.entries()] == [b"first"]
    store.close()


def _fill(path: Path) -> None:
    store = SqliteStore(path)
    entry = store.create(replace(SERVING, data=b"first"), "ada", NOW)
    for data in (bytes(1_000_000), bytes(2_000_000)):
        with pytest.raises(Full, match="the store is full"):
            store.change(entry.uid, replace(SERVING, data=data), "ada", entry.etag, NOW)
    assert store.entry(entry.uid) == entry
    store.close()
