"""Store in a single SQLite file, for a knowledge base on one machine.

A write-ahead log lets readers proceed during a write; every change is a transaction that is on disk before the call
returns. Equal contents are stored once, by SHA-256.
"""

from __future__ import annotations

import hashlib
import os
import secrets
import sqlite3
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

from planlang.closure import grouped
from planlang.diagnostics import BadInput, Diagnostic, error
from planlang.knowledge.database import Connection, damaged, exception_of, typed
from planlang.knowledge.entries import (
    REVISIONS_KEPT,
    Attachment,
    Change,
    Content,
    Described,
    Entry,
    EntryExists,
    File,
    Kind,
    News,
    NoSuchEntry,
    Request,
    Revision,
    Syntax,
    Unusable,
    check_rating,
    own,
    rating_of,
    uid_of,
)
from planlang.outputs import named

VERSION = 2
"""Version of the schema; files with another version are refused."""

_PATIENCE = 10.0
"""Time that a writer waits for the transaction of another process [s]."""

_TABLES = """
CREATE TABLE blobs (sha256 TEXT PRIMARY KEY, data BLOB NOT NULL) WITHOUT ROWID;
CREATE TABLE entries (uid TEXT PRIMARY KEY, kind TEXT NOT NULL, about TEXT NOT NULL, label TEXT NOT NULL,
    author TEXT NOT NULL, syntax TEXT NOT NULL, created TEXT NOT NULL, description BLOB NOT NULL);
CREATE TABLE revisions (uid TEXT NOT NULL REFERENCES entries ON DELETE CASCADE, number INTEGER NOT NULL,
    sha256 TEXT NOT NULL REFERENCES blobs, author TEXT NOT NULL, made TEXT NOT NULL,
    PRIMARY KEY (uid, number)) WITHOUT ROWID;
CREATE TABLE attachments (uid TEXT NOT NULL REFERENCES entries ON DELETE CASCADE, name TEXT NOT NULL,
    media_type TEXT NOT NULL, sha256 TEXT NOT NULL REFERENCES blobs, size INTEGER NOT NULL,
    PRIMARY KEY (uid, name)) WITHOUT ROWID;
CREATE TABLE ratings (uid TEXT NOT NULL REFERENCES entries ON DELETE CASCADE, author TEXT NOT NULL,
    rating INTEGER NOT NULL, made TEXT NOT NULL, PRIMARY KEY (uid, author)) WITHOUT ROWID;
CREATE TABLE keys (sha256 TEXT PRIMARY KEY, author TEXT NOT NULL, made TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE subscriptions (author TEXT NOT NULL, uid TEXT NOT NULL, made TEXT NOT NULL,
    PRIMARY KEY (author, uid)) WITHOUT ROWID;
CREATE TABLE news (number INTEGER PRIMARY KEY AUTOINCREMENT, change TEXT NOT NULL, uid TEXT NOT NULL,
    kind TEXT NOT NULL, author TEXT NOT NULL, made TEXT NOT NULL);
CREATE TABLE requests (author TEXT NOT NULL, key TEXT NOT NULL, digest TEXT NOT NULL, uid TEXT NOT NULL,
    PRIMARY KEY (author, key)) WITHOUT ROWID;
CREATE INDEX revisions_of_blobs ON revisions (sha256);
CREATE INDEX attachments_of_blobs ON attachments (sha256);
CREATE INDEX news_of_entries ON news (uid, number);
"""

_UNUSED = """CREATE TRIGGER unused_after_{table} AFTER DELETE ON {table} BEGIN
    DELETE FROM blobs WHERE sha256 = OLD.sha256
    AND NOT EXISTS (SELECT 1 FROM revisions WHERE sha256 = OLD.sha256)
    AND NOT EXISTS (SELECT 1 FROM attachments WHERE sha256 = OLD.sha256); END"""
"""Trigger that deletes a content together with the last reference to it."""

_LAST = """SELECT e.uid, e.kind, e.about, e.label, e.author, e.syntax, e.created, r.number, r.sha256, r.author, r.made
    FROM entries e JOIN revisions r ON r.uid = e.uid
    AND r.number = (SELECT max(number) FROM revisions WHERE uid = e.uid)"""

_RATED = "SELECT r.uid, r.rating FROM ratings r JOIN entries e ON e.uid = r.uid AND e.author != r.author"
"""Ratings, without those by the entry's author, which earlier versions may have stored."""


def _columns(database: sqlite3.Connection) -> set[tuple[str, str]]:
    """Tables of a database with their columns."""
    listed = "SELECT m.name, c.name FROM sqlite_master m, pragma_table_info(m.name) c WHERE m.type = 'table'"
    return set(database.execute(listed))


class SqliteStore:
    """A :class:`~planlang.knowledge.entries.Store` in one file, shared safely by threads and processes.

    Raises BadInput with K001 unless the file is a knowledge base.
    """

    def __init__(self, path: Path, *, creates: bool = True) -> None:
        """Open the file, or create it if ``creates``."""
        self._path, self._creates = path, creates
        self._local = threading.local()
        self._connections: dict[threading.Thread, sqlite3.Connection] = {}
        self._opening = threading.Lock()
        self._writing = threading.Lock()
        try:
            self._prepare()
        except Unusable as problem:
            self.close()
            raise BadInput([self._refusal(problem)]) from None

    def _refusal(self, problem: Unusable) -> Diagnostic:
        """Error for a file that cannot be opened as a store."""
        path = self._path
        if os.path.isdir(path):
            return error("K001", f"{path} is a folder", help="name a file in it; it is created if needed")
        if not os.path.isdir(path.parent):
            return error("K001", f"there is no folder {named(path.parent)}", help="create it first")
        return problem.diagnostic(named(path))

    def _prepare(self) -> None:
        if os.path.islink(self._path) and not os.path.exists(self._path):
            raise Unusable("it is a symbolic link that leads nowhere", "name the file itself")
        if not self._creates and not os.path.getsize(self._path):
            raise Unusable("not a knowledge base: it is empty", "name the file of a store")
        database = self._database
        database.execute("PRAGMA journal_mode = WAL")
        with self._transaction():
            (version,) = database.execute("PRAGMA user_version").fetchone()
            if version == 0 and self._creates and not database.execute("SELECT 1 FROM sqlite_master").fetchone():
                forgetting = (_UNUSED.format(table=table) for table in ("revisions", "attachments"))
                for statement in (*_TABLES.split(";"), *forgetting):
                    database.execute(statement)
                database.execute(f"PRAGMA user_version = {VERSION}")
            elif version != VERSION:
                advice = "name the file of a store, or one that is not there yet"
                if 0 < version < VERSION or version > VERSION:
                    advice = "open it with the version of planlang that wrote it, and push its entries to a new store"
                raise Unusable(f"not a knowledge base: its schema version is {version}, not {VERSION}", advice)
            else:
                self._check_tables(database)

    @staticmethod
    def _check_tables(database: sqlite3.Connection) -> None:
        with closing(sqlite3.connect(":memory:")) as new:
            new.executescript(_TABLES)
            missing = sorted(_columns(new) - _columns(database))
        if missing:
            raise damaged(f"the table {missing[0][0]} has no column {missing[0][1]}, or is missing")

    @property
    def _database(self) -> sqlite3.Connection:
        """Connection of this thread; opening one closes those of threads that have ended."""
        found: sqlite3.Connection | None = getattr(self._local, "database", None)
        if found is None:
            try:
                found = sqlite3.connect(
                    self._path, timeout=_PATIENCE, isolation_level=None, check_same_thread=False, factory=Connection
                )
            except (sqlite3.Error, ValueError) as problem:  # ValueError: a null character in the name
                raise exception_of(problem) from None
            self._local.database = found
            with self._opening:  # register it before its first use: close() must know it even after a failure
                for thread in [one for one in self._connections if not one.is_alive()]:
                    self._connections.pop(thread).close()
                self._connections[threading.current_thread()] = found
            found.execute("PRAGMA synchronous = FULL")
            found.execute("PRAGMA foreign_keys = ON")
        return found

    @contextmanager
    def _transaction(self) -> Iterator[sqlite3.Connection]:
        database = self._database
        with self._writing:
            database.execute("BEGIN IMMEDIATE")
            try:
                yield database
                database.execute("COMMIT")
            except BaseException:
                if database.in_transaction:  # SQLite ends it itself when the disk is full
                    database.execute("ROLLBACK")
                raise

    # entries

    def entries(self, kind: Kind | None = None) -> Iterator[Entry]:
        """Yield all entries, or those of a kind, sorted by identifier."""
        database = self._database
        files = database.execute("SELECT uid, name, media_type, sha256, size FROM attachments ORDER BY 1, 2")
        attachments = grouped((uid, Attachment(*typed(row, str, str, str, int))) for uid, *row in files)
        ratings = self._all_ratings()
        wanted = "" if kind is None else " WHERE e.kind = ?"
        for row in database.execute(
            f"{_LAST}{wanted} ORDER BY e.uid", () if kind is None else (kind.value,)
        ).fetchall():
            yield _entry(row, tuple(attachments.get(row[0], ())), ratings.get(row[0], []))

    def entry(self, uid: str) -> Entry:
        """Return an entry. Raises NoSuchEntry."""
        database = self._database
        row = database.execute(f"{_LAST} WHERE e.uid = ?", (uid,)).fetchone()
        if row is None:
            raise NoSuchEntry(f"there is no entry {uid}")
        listed = "SELECT name, media_type, sha256, size FROM attachments WHERE uid = ? ORDER BY name"
        attachments = tuple(Attachment(*typed(one, str, str, str, int)) for one in database.execute(listed, (uid,)))
        ratings = [typed(row, str, int)[1] for row in database.execute(f"{_RATED} WHERE e.uid = ?", (uid,))]
        return _entry(row, attachments, ratings)

    def content(self, uid: str, revision: int | None = None) -> bytes:
        """Return the content of the latest revision, or of another one still stored. Raises NoSuchEntry."""
        number = self.entry(uid).revision.number if revision is None else revision
        stored = "SELECT data FROM revisions JOIN blobs USING (sha256) WHERE uid = ? AND number = ?"
        row = self._database.execute(stored, (uid, number)).fetchone()
        if row is None:
            raise NoSuchEntry(f"there is no revision {number} of {uid}")
        return bytes(typed(row, bytes)[0])

    def revisions(self, uid: str) -> tuple[Revision, ...]:
        """Return the stored revisions, latest first. Raises NoSuchEntry."""
        self.entry(uid)
        stored = "SELECT number, sha256, author, made FROM revisions WHERE uid = ? ORDER BY number DESC"
        return tuple(Revision(*typed(row, int, str, str, str)) for row in self._database.execute(stored, (uid,)))

    def descriptions(self) -> Iterator[Described]:
        """Yield the fields and descriptions of all entries, sorted by identifier."""
        stored = "SELECT uid, kind, about, label, description FROM entries ORDER BY uid"
        for uid, kind, *others in self._database.execute(stored).fetchall():
            yield Described(*typed((uid, kind), str, Kind), *typed(others, str, str, bytes))

    def description(self, uid: str) -> bytes:
        """Return the description of the latest revision. Raises NoSuchEntry."""
        row = self._database.execute("SELECT description FROM entries WHERE uid = ?", (uid,)).fetchone()
        if row is None:
            raise NoSuchEntry(f"there is no entry {uid}")
        return bytes(typed(row, bytes)[0])

    def describe(self, uid: str, description: bytes, expected: str) -> None:
        """Replace the description of unchanged content, without a line in the feed. Raises NoSuchEntry, Changed."""
        with self._transaction() as database:
            own(self.entry(uid), None, expected)
            database.execute("UPDATE entries SET description = ? WHERE uid = ?", (description, uid))

    def create(self, content: Content, author: str, now: str, request: Request | None = None) -> Entry:
        """Store a new entry and its request. Raises EntryExists; ValueError for an invalid name."""
        uid = uid_of(content.about, content.name)
        with self._transaction() as database:
            if database.execute("SELECT 1 FROM entries WHERE uid = ?", (uid,)).fetchone():
                raise EntryExists(f"there is an entry {uid} already")
            described = (uid, content.kind, content.about, content.label, author, content.syntax, now)
            database.execute("INSERT INTO entries VALUES (?, ?, ?, ?, ?, ?, ?, ?)", (*described, content.description))
            # continue the numbers of a deleted entry, so that no ETag ever means two contents
            before = "SELECT count(*) FROM news WHERE uid = ? AND change IN ('created', 'changed')"
            (number,) = database.execute(before, (uid,)).fetchone()
            self._add_revision(database, uid, number + 1, content.data, author, now)
            if request is not None:
                if self.requested(author, request.key) is not None:
                    raise EntryExists("this Idempotency-Key was used for another request")
                kept = (author, request.key, request.digest, uid)
                database.execute("INSERT INTO requests VALUES (?, ?, ?, ?)", kept)
            _tell(database, Change.CREATED, uid, content.kind, author, now)
        return self.entry(uid)

    def change(self, uid: str, content: Content, author: str, expected: str, now: str) -> Entry:
        """Store a new revision if the ETag is ``expected``. Raises NoSuchEntry, NotTheAuthor, Changed."""
        with self._transaction() as database:
            entry = own(self.entry(uid), author, expected)
            described = (content.about, content.label, content.syntax, content.description, uid)
            columns = "about = ?, label = ?, syntax = ?, description = ?"
            database.execute(f"UPDATE entries SET {columns} WHERE uid = ?", described)
            number = entry.revision.number + 1
            self._add_revision(database, uid, number, content.data, author, now)
            database.execute("DELETE FROM revisions WHERE uid = ? AND number < ?", (uid, number - REVISIONS_KEPT))
            _tell(database, Change.CHANGED, uid, entry.kind, author, now)
        return self.entry(uid)

    def delete(self, uid: str, author: str, expected: str, now: str) -> None:
        """Delete an entry and everything that belongs to it. Raises NoSuchEntry, NotTheAuthor, Changed."""
        with self._transaction() as database:
            entry = own(self.entry(uid), author, expected)
            database.execute("DELETE FROM entries WHERE uid = ?", (uid,))
            _tell(database, Change.DELETED, uid, entry.kind, author, now)

    @staticmethod
    def _add_revision(database: sqlite3.Connection, uid: str, number: int, data: bytes, author: str, now: str) -> None:
        revision = (uid, number, _keep_blob(database, data), author, now)
        database.execute("INSERT INTO revisions VALUES (?, ?, ?, ?, ?)", revision)

    # attachments

    def attach(self, uid: str, file: File, author: str, now: str) -> Attachment:
        """Store a file of an entry, replacing one of that name. Raises NoSuchEntry, NotTheAuthor."""
        with self._transaction() as database:
            entry = own(self.entry(uid), author)
            database.execute("DELETE FROM attachments WHERE uid = ? AND name = ?", (uid, file.name))
            attachment = Attachment(file.name, file.media_type, _keep_blob(database, file.data), len(file.data))
            row = (uid, file.name, file.media_type, attachment.sha256, attachment.size)
            database.execute("INSERT INTO attachments VALUES (?, ?, ?, ?, ?)", row)
            _tell(database, Change.ATTACHED, uid, entry.kind, author, now)
        return attachment

    def detach(self, uid: str, name: str, author: str, now: str) -> None:
        """Delete a file of an entry. Raises NoSuchEntry, NotTheAuthor."""
        with self._transaction() as database:
            entry = own(self.entry(uid), author)
            if not database.execute("DELETE FROM attachments WHERE uid = ? AND name = ?", (uid, name)).rowcount:
                raise NoSuchEntry(f"{uid} has no file {name}")
            _tell(database, Change.DETACHED, uid, entry.kind, author, now)

    def attachment(self, uid: str, name: str) -> tuple[Attachment, bytes]:
        """Return a file of an entry. Raises NoSuchEntry."""
        stored = """SELECT name, media_type, sha256, size, data FROM attachments JOIN blobs USING (sha256)
            WHERE uid = ? AND name = ?"""
        row = self._database.execute(stored, (uid, name)).fetchone()
        if row is None:
            raise NoSuchEntry(f"{uid} has no file {name}")
        *fields, data = typed(row, str, str, str, int, bytes)
        return Attachment(*fields), data

    # ratings

    def rate(self, uid: str, author: str, rating: int, now: str) -> Entry:
        """Store an author's rating, 0 to 10, replacing an earlier one.

        Raises NoSuchEntry, OwnEntry, ValueError.
        """
        with self._transaction() as database:
            entry = self.entry(uid)
            check_rating(entry, author, rating)
            database.execute("INSERT OR REPLACE INTO ratings VALUES (?, ?, ?, ?)", (uid, author, rating, now))
            _tell(database, Change.RATED, uid, entry.kind, author, now)
        return self.entry(uid)

    def ratings(self) -> Mapping[str, float]:
        """Map the identifiers of rated entries to their ratings."""
        found = ((uid, rating_of(ratings)) for uid, ratings in self._all_ratings().items())
        return {uid: rating for uid, rating in found if rating is not None}

    def _all_ratings(self) -> dict[str, list[int]]:
        return grouped(typed(row, str, int) for row in self._database.execute(_RATED))

    # authors

    def new_key(self, author: str, now: str) -> str:
        """Create a key for an author (256 random bits); only its SHA-256 is stored. Earlier keys stay valid."""
        key = secrets.token_urlsafe(32)
        with self._transaction() as database:
            database.execute("INSERT INTO keys VALUES (?, ?, ?)", (_digest(key.encode()), author, now))
        return key

    def drop_keys(self, author: str) -> int:
        """Revoke all keys of an author; return their number."""
        with self._transaction() as database:
            return database.execute("DELETE FROM keys WHERE author = ?", (author,)).rowcount

    def author_of(self, key: str) -> str | None:
        """Return the author of a key; None if the key is not valid."""
        row = self._database.execute("SELECT author FROM keys WHERE sha256 = ?", (_digest(key.encode()),)).fetchone()
        return None if row is None else str(row[0])

    def requested(self, author: str, key: str) -> tuple[str, str] | None:
        """Return the digest of the request with this key and the entry that it created; None for a new key."""
        stored = "SELECT digest, uid FROM requests WHERE author = ? AND key = ?"
        row = self._database.execute(stored, (author, key)).fetchone()
        return None if row is None else (str(row[0]), str(row[1]))

    # news

    def subscribe(self, author: str, uid: str, now: str) -> None:
        """Add the news of an entry to an author's feed. Raises NoSuchEntry."""
        with self._transaction() as database:
            self.entry(uid)
            database.execute("INSERT OR IGNORE INTO subscriptions VALUES (?, ?, ?)", (author, uid, now))

    def unsubscribe(self, author: str, uid: str) -> None:
        """Remove a subscription, if there is one."""
        with self._transaction() as database:
            database.execute("DELETE FROM subscriptions WHERE author = ? AND uid = ?", (author, uid))

    def subscriptions(self, author: str) -> tuple[str, ...]:
        """Return the subscribed identifiers, sorted."""
        stored = "SELECT uid FROM subscriptions WHERE author = ? ORDER BY uid"
        return tuple(row[0] for row in self._database.execute(stored, (author,)))

    def news(
        self, after: int = 0, *, author: str | None = None, limit: int = 100, newest_first: bool = False
    ) -> tuple[News, ...]:
        """Return lines of the feed after number ``after``, oldest first; for an ``author`` only subscribed entries."""
        mine = "" if author is None else " AND uid IN (SELECT uid FROM subscriptions WHERE author = :author)"
        order = "DESC" if newest_first else "ASC"
        stored = f"""SELECT number, change, uid, kind, author, made FROM news
            WHERE number > :after{mine} ORDER BY number {order} LIMIT :limit"""
        rows = self._database.execute(stored, {"after": after, "author": author, "limit": limit})
        return tuple(News(*typed(row, int, Change, str, Kind, str, str)) for row in rows)

    def last_news(self) -> int:
        """Return the number of the last line of the feed; 0 if it is empty."""
        (number,) = self._database.execute("SELECT max(number) FROM news").fetchone()
        return number or 0

    def copy_to(self, path: Path) -> None:
        """Copy the store as it is at this moment to a new file. Raises Unusable, Full."""
        try:
            with closing(sqlite3.connect(path)) as copy:
                self._database.backup(copy)
        except sqlite3.Error as problem:
            raise exception_of(problem) from None

    def close(self) -> None:
        """Close the file."""
        with self._opening:
            for connection in self._connections.values():
                connection.close()


def _entry(row: Sequence[Any], attachments: tuple[Attachment, ...], ratings: list[int]) -> Entry:
    *entry, number, sha256, author, made = row
    last = Revision(*typed((number, sha256, author, made), int, str, str, str))
    rating, count = rating_of(ratings), len(ratings)
    fields = typed(entry, str, Kind, str, str, str, Syntax, str)
    return Entry(*fields, last, attachments, rating, count)  # type: ignore[call-arg]  # it counts the fields as one


def _tell(database: sqlite3.Connection, change: Change, uid: str, kind: Kind, author: str, now: str) -> None:
    row = (change, uid, kind, author, now)
    database.execute("INSERT INTO news (change, uid, kind, author, made) VALUES (?, ?, ?, ?, ?)", row)


def _keep_blob(database: sqlite3.Connection, data: bytes) -> str:
    sha256 = _digest(data)
    database.execute("INSERT OR IGNORE INTO blobs VALUES (?, ?)", (sha256, data))
    return sha256


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()
