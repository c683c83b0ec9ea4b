"""Backups of knowledge bases: a whole copy of a store's file, made while it is served."""

from __future__ import annotations

import hashlib
import os
import sqlite3
from contextlib import closing
from pathlib import Path

from planlang.diagnostics import BadInput, Diagnostic, error
from planlang.knowledge.database import Connection, damaged, typed
from planlang.knowledge.entries import Unusable
from planlang.knowledge.sqlite_store import SqliteStore
from planlang.outputs import named, replace
from planlang.words import Blank, Text, calling


def back_up(store: Path, target: Path) -> tuple[int, int]:
    """Copy a store with the changes that are still in its log; return the number of entries and the size [bytes].

    The copy shows the store at one moment, also while servers write to it, which they need not wait for. It is a store
    itself. It takes the place of ``target`` once its structure and the digests of its contents have been checked.
    Raises BadInput if there is no store, if it is damaged, or if the copy cannot be written.
    """
    if not os.path.isfile(store):
        advice = Text(
            "name the file of ",
            calling("serve", store=Blank("FILE")),
            "; the guide knowledge.md says how to back up other stores",
        )
        raise BadInput([error("K001", f"there is no knowledge base {named(store)}", help=advice)])
    entries = 0

    def write(unfinished: Path) -> None:
        nonlocal entries
        with closing(SqliteStore(store, creates=False)) as opened:
            opened.copy_to(unfinished)
        with closing(SqliteStore(unfinished, creates=False)) as copy:
            entries = min(len(list(copy.entries())), len(list(copy.descriptions())))  # all rows are checked
        _check(unfinished)
        unfinished.chmod(os.stat(store).st_mode & 0o777)  # it has the same secrets

    try:
        replace(target, write)
    except Unusable as problem:
        raise BadInput([problem.diagnostic(named(store))]) from None
    return entries, os.stat(target).st_size


def in_use(target: Path) -> list[Diagnostic]:
    """Error for a target that is a store in use: its log would be applied to the copy, and destroy it."""
    log = Path(f"{target}-wal")
    if not os.path.lexists(log):
        return []
    return [
        error("C005", f"{named(target)} is a store in use: its log {log.name} is beside it", help="name another file")
    ]


def _check(copy: Path) -> None:
    """Check the structure of a copy and the digests of its contents. Raises Unusable."""
    with closing(sqlite3.connect(copy, factory=Connection)) as database:
        (verdict,) = database.execute("PRAGMA integrity_check(1)").fetchone()
        if verdict != "ok":
            raise damaged(str(verdict).splitlines()[-1])
        for row in database.execute("SELECT sha256, data FROM blobs"):
            digest, data = typed(row, str, bytes)
            if hashlib.sha256(data).hexdigest() != digest:
                raise damaged(f"the content {digest[:16]} was altered")
