"""A damaged, locked or foreign file of a store is a user's problem, with advice, whatever is wrong with it."""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from planlang.knowledge.backup import back_up
from planlang.knowledge.entries import Content, File, Kind, Syntax, Unreachable
from planlang.knowledge.sqlite_store import SqliteStore
from tests.support.cli_runs import invoke
from tests.support.refusals import refusal

NOW = "2026-01-01T00:00:00Z"
SERVING = Content(
    Kind.RECIPE, "http://knowrob.org/kb/knowrob.owl#ServeADrink", "n1", "serve a drink", Syntax.MANCHESTER, b"one"
)


def a_store(path: Path) -> Path:
    """A store of 20 entries with files, ratings and news, all in the file itself."""
    with closing(SqliteStore(path)) as store:
        for number in range(20):
            content = replace(SERVING, name=f"n{number}", data=bytes(3000) + str(number).encode())
            uid = store.create(content, "ada", NOW).uid
            store.attach(uid, File("a.py", "text/x-python", b"x" * number), "ada", NOW)
            store.rate(uid, "bob", 5, NOW)
    return path


def _sql(*statements: str) -> Callable[[Path], None]:
    def damage(path: Path) -> None:
        with closing(sqlite3.connect(path)) as database:
            for one in statements:
                database.execute(one)
            database.commit()

    return damage


def _bytes(change: Callable[[bytes], bytes]) -> Callable[[Path], None]:
    return lambda path: path.write_bytes(change(path.read_bytes())) and None


DAMAGE: dict[str, Callable[[Path], object]] = {
    "truncated": _bytes(lambda content: content[: len(content) // 2]),
    "its first page only": _bytes(lambda content: content[:4096]),
    "garbage in the middle": _bytes(lambda content: content[:8192] + b"\xa5" * 30_000 + content[38_192:]),
    "garbage at the end": _bytes(lambda content: content[:-20_000] + b"\x00" * 20_000),
    "no database": _bytes(lambda content: b"notes" * 1000),
    "garbage after the magic": _bytes(lambda content: content[:16] + b"\xff" * 4000),
    "empty": _bytes(lambda content: b""),
    "a version to come": _sql("PRAGMA user_version = 99"),
    "another database": lambda path: (path.unlink(), _sql("CREATE TABLE a (b)")(path)),
    "a missing table": _sql("PRAGMA foreign_keys = OFF", "DROP TABLE news"),
    "a missing column": _sql("ALTER TABLE news RENAME COLUMN made TO other"),
    "an unknown kind": _sql("UPDATE entries SET kind = 'poem'"),
    "an unknown syntax": _sql("UPDATE entries SET syntax = 'x'"),
    "a number for a label": _sql("UPDATE entries SET label = x'00ff'"),
    "a text for a revision": _sql("UPDATE OR REPLACE revisions SET made = 3.5, author = x'01'"),
    "a text for a rating": _sql("UPDATE ratings SET rating = 'good'"),
    "a text for a size": _sql("UPDATE attachments SET size = 'large'"),
    "a number for a description": _sql("UPDATE entries SET description = 7"),
    "a content that was altered": _sql("UPDATE blobs SET data = 'other'"),
    "a folder": lambda path: (path.unlink(), path.mkdir()),
    "a link to nothing": lambda path: (path.unlink(), path.symlink_to("nothing")),
}
SERVED = {
    "empty",
    "a content that was altered",
    *(name for name in DAMAGE if name.startswith(("a text", "a number", "an unknown"))),
}
"""What making a key does not come across."""


@pytest.mark.parametrize("damage", DAMAGE)
def test_a_damaged_store_ends_no_command_otherwise_than_with_advice(damage: str, tmp_path: Path) -> None:
    path = a_store(tmp_path / "kb.sqlite")
    DAMAGE[damage](path)
    commands = {
        "enable": ("enable", "serve_a_drink", "--robot", "amigo", "--from", path, "--store", tmp_path / "mine"),
        "backup": ("backup", path, tmp_path / "copy.sqlite"),
        "serve": ("serve", "--store", path, "--new-key", "ada"),
    }
    for name, words in commands.items():
        done = invoke(*words)
        assert done.exit_code in (0, 2, 3), (name, done.output)
        assert "internal error" not in done.output, (name, done.output)
        if name == "backup" or (name == "serve" and damage not in SERVED and not damage.startswith("garbage")):
            assert done.exit_code == 2, (name, done.output)
            assert "K001" in done.stderr or "C00" in done.stderr, (name, done.output)
            assert "help:" in done.stderr, (name, done.output)
    assert not (tmp_path / "copy.sqlite").exists()
    assert not (tmp_path / "nothing").exists()


def test_an_empty_file_is_no_store_to_read_from_and_stays_empty(tmp_path: Path) -> None:
    path = tmp_path / "kb.sqlite"
    path.touch()
    done = invoke("enable", "serve_a_drink", "--robot", "amigo", "--from", path)
    assert (done.exit_code, "error K001" in done.stderr) == (2, True), done.output
    assert path.read_bytes() == b""


def test_a_store_that_is_damaged_while_it_is_open_is_unreachable_and_no_other_exception(tmp_path: Path) -> None:
    with closing(SqliteStore(a_store(tmp_path / "kb.sqlite"))) as store:
        _sql("UPDATE entries SET kind = 'poem' WHERE uid = 'serveadrink.n3'")(tmp_path / "kb.sqlite")
        assert store.entry("serveadrink.n4").kind is Kind.RECIPE
        for call in (
            lambda: store.entry("serveadrink.n3"),
            lambda: list(store.entries()),
            lambda: list(store.descriptions()),
        ):
            with pytest.raises(Unreachable, match="damaged: 'poem'"):
                call()


def test_a_backup_of_a_store_in_use_has_all_that_was_acknowledged(tmp_path: Path) -> None:
    path, copy = tmp_path / "kb.sqlite", tmp_path / "copy.sqlite"
    with closing(SqliteStore(path)) as store:
        uids = [store.create(replace(SERVING, name=f"n{one}"), "ada", NOW).uid for one in range(17)]
        key = store.new_key("ada", NOW)
        assert back_up(path, copy)[0] == 17
        store.create(replace(SERVING, name="later"), "ada", NOW)
    with closing(SqliteStore(copy)) as restored:
        assert [entry.uid for entry in restored.entries()] == sorted(uids)
        assert restored.content(uids[0]) == b"one"
        assert restored.author_of(key) == "ada"
    assert not list(tmp_path.glob(".*"))


def test_a_backup_replaces_a_file_only_by_force_and_never_the_store_or_one_in_use(tmp_path: Path) -> None:
    path, copy = a_store(tmp_path / "kb.sqlite"), tmp_path / "copy.sqlite"
    assert invoke("backup", path, copy).exit_code == 0
    again = invoke("backup", path, copy)
    assert (again.exit_code, "C005" in again.stderr) == (2, True)
    assert invoke("backup", path, copy, "--force").exit_code == 0
    assert "would overwrite" in invoke("backup", path, path, "--force").stderr
    with closing(SqliteStore(copy)) as store:
        store.new_key("ada", NOW)
        assert "is a store in use" in invoke("backup", path, copy, "--force").stderr
    assert (tmp_path / "copy.sqlite").stat().st_mode & 0o777 == path.stat().st_mode & 0o777


def test_a_backup_through_a_link_is_refused_and_of_an_endpoint_explained(tmp_path: Path) -> None:
    path = a_store(tmp_path / "kb.sqlite")
    (tmp_path / "link").symlink_to("elsewhere")
    assert "C005" in invoke("backup", path, tmp_path / "link").stderr
    assert not (tmp_path / "elsewhere").exists()
    told = invoke("backup", "sparql+http://localhost:1/query", tmp_path / "copy")
    assert (told.exit_code, "dump the endpoint" in told.stderr) == (2, True)


def test_a_store_that_another_program_has_locked_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("planlang.knowledge.sqlite_store._PATIENCE", 0.01)
    path = tmp_path / "kb.sqlite"
    with closing(sqlite3.connect(path)) as other:
        other.execute("CREATE TABLE a (b)")
        other.execute("BEGIN EXCLUSIVE")
        with refusal("K001", naming="locked"):
            SqliteStore(path)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_store_that_cannot_be_written_is_told_with_what_to_do(tmp_path: Path) -> None:
    path = a_store(tmp_path / "kb.sqlite")
    path.chmod(0o400)
    told = invoke("serve", "--store", path, "--new-key", "ada")
    assert (told.exit_code, "writable" in told.stderr) == (2, True), told.output
