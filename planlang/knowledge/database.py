"""SQLite with the exceptions of a store, and rows whose values are checked: a file may be damaged anywhere."""

from __future__ import annotations

import sqlite3
from collections.abc import Sequence
from enum import Enum
from typing import Any, Self

from planlang.knowledge.entries import Full, Unusable

_NO_ROOM = (sqlite3.SQLITE_FULL, sqlite3.SQLITE_IOERR_WRITE)
RESTORE = "restore it from a backup; sqlite3 FILE .recover saves what can still be read of it"
_ADVICE = {
    sqlite3.SQLITE_BUSY: "another program has locked it: end that, or wait",
    sqlite3.SQLITE_LOCKED: "another program has locked it: end that, or wait",
    sqlite3.SQLITE_READONLY: "make it and its folder writable, also NAME-wal and NAME-shm beside it",
    sqlite3.SQLITE_CANTOPEN: "make it and its folder readable and writable, also NAME-wal and NAME-shm beside it",
    sqlite3.SQLITE_PERM: "make it and its folder readable and writable",
    sqlite3.SQLITE_IOERR: "look for errors of the disk, and for limits of the size of files (ulimit -f)",
}
"""Error codes of SQLite -> what to do; with all others the file is damaged."""


def exception_of(problem: Exception) -> Unusable | Full:
    """The exception of the store for one of SQLite."""
    code = getattr(problem, "sqlite_errorcode", None) or sqlite3.SQLITE_CORRUPT
    if code in _NO_ROOM:
        return Full(f"the store is full: {problem}")
    return Unusable(f"the knowledge base cannot be used: {problem}", _ADVICE.get(code & 0xFF, RESTORE))


def damaged(what: str) -> Unusable:
    return Unusable(f"the knowledge base is damaged: {what}", RESTORE)


class _Cursor(sqlite3.Cursor):
    """Cursor that raises exceptions of the store: a damaged file is noticed only where its pages are read."""

    def execute(self, *arguments: Any) -> Self:
        try:
            return super().execute(*arguments)
        except sqlite3.Error as problem:
            raise exception_of(problem) from None

    def fetchone(self) -> Any:
        return next(self, None)

    def fetchall(self) -> list[Any]:
        return list(self)

    def __next__(self) -> Any:
        try:
            return super().__next__()
        except sqlite3.Error as problem:
            raise exception_of(problem) from None


class Connection(sqlite3.Connection):
    def execute(self, *arguments: Any) -> Any:
        return self.cursor(_Cursor).execute(*arguments)


def typed(row: Sequence[Any], *kinds: type) -> tuple[Any, ...]:
    """Convert the values of a row to their kinds. Raises Unusable for a value of another type."""
    try:
        values = tuple(kind(one) if issubclass(kind, Enum) else one for one, kind in zip(row, kinds, strict=True))
    except ValueError as problem:
        raise damaged(str(problem)) from None
    for one, kind in zip(values, kinds, strict=True):
        if not isinstance(one, kind):
            raise damaged(f"{str(one)[:40]!r} is stored in place of a value of type {kind.__name__}")
    return values
