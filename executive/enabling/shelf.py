"""Knowledge bases that a robot asks: a store on this machine, or a server's over HTTP."""

from __future__ import annotations

import hashlib
import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import Protocol

from executive.serving.catalogue import Catalogue
from executive.serving.vocabulary import read_vocabulary
from executive.serving.workers import Staff
from planlang.diagnostics import BadInput, Diagnostic, Span, error, warning
from planlang.knowledge.answers import Found, NoAnswer, NotAsAgreed, RefusedByChecks
from planlang.knowledge.client import Client
from planlang.knowledge.entries import Attachment, Entry, Full, Kind, Refused, Revision
from planlang.knowledge.index import CannotAnswer
from planlang.knowledge.refusals import client_of, diagnostics_of, kept_warning
from planlang.knowledge.sqlite_store import SqliteStore

MOST_FOUND = 10_000
"""Entries that a server is asked for by one question."""


class Shelf(Protocol):
    """A knowledge base, as a robot asks it. All calls raise BadInput if it cannot be asked."""

    url: str
    """Its address, or its file."""

    def search(
        self,
        expression: str | None = None,
        *,
        label: str | None = None,
        kind: Kind | None = None,
        place: Mapping[str, str] | None = None,
    ) -> Sequence[Found]:
        """Return the entries that fit, sorted by identifier; none for classes that the knowledge base does not know."""

    def revision(self, entry: Entry, number: int | None = None) -> Revision:
        """Return a revision of an entry, the last one unless told otherwise."""

    def content(self, entry: Entry, revision: int | None = None) -> bytes:
        """Return the content of a revision. Raises BadInput if it is not what the entry says."""

    def attachment(self, entry: Entry, attachment: Attachment) -> bytes:
        """Return a file of an entry. Raises BadInput if it is not what the entry says."""

    def diagnostics(self) -> Sequence[Diagnostic]:
        """Return what the user should know of the answers."""

    def close(self) -> None:
        """End the work with it."""


class LocalShelf:
    """A store in a file of this machine, looked at without a server."""

    def __init__(self, path: Path, folders: Sequence[Path] = ()) -> None:
        """Open the store; its entries import from ``folders``. Raises BadInput for what is no knowledge base."""
        self.url = str(path)
        self._store = _Store(path)
        self._catalogue = Catalogue(self._store, read_vocabulary(folders))
        if self._catalogue.is_behind:
            with closing(Staff(folders)) as staff:
                while self._catalogue.is_behind:
                    self._catalogue.renew(staff.behind)

    def search(
        self,
        expression: str | None = None,
        *,
        label: str | None = None,
        kind: Kind | None = None,
        place: Mapping[str, str] | None = None,
    ) -> Sequence[Found]:
        """Return the entries that fit, sorted by identifier; none for classes that nothing here knows."""
        catalogue = self._catalogue
        with suppress(BadInput, CannotAnswer):  # a class that nothing here knows
            asked = None if expression is None else catalogue.question(expression)
            uids = catalogue.find(asked, kind, label, place)
            return [Found(self._store.entry(uid), links=catalogue.links(uid)) for uid in uids]
        return ()

    def revision(self, entry: Entry, number: int | None = None) -> Revision:
        """Return a revision of an entry, the last one unless told otherwise."""
        return next((one for one in self._store.revisions(entry.uid) if one.number == number), entry.revision)

    def content(self, entry: Entry, revision: int | None = None) -> bytes:
        """Return the content of a revision. Raises BadInput if it is not what the entry says."""
        wanted = self.revision(entry, revision)
        return verified(self._store.content(entry.uid, wanted.number), wanted.sha256, entry.uid)

    def attachment(self, entry: Entry, attachment: Attachment) -> bytes:
        """Return a file of an entry. Raises BadInput if it is not what the entry says."""
        _, data = self._store.attachment(entry.uid, attachment.name)
        return verified(data, attachment.sha256, f"{entry.uid}/{attachment.name}")

    def diagnostics(self) -> Sequence[Diagnostic]:
        """Return a warning if there are entries that cannot be read any more, and so are not found by what they say."""
        if not (unread := sorted(self._catalogue.unread)):
            return ()
        named = ", ".join(unread[:3]) + (", ..." if len(unread) > 3 else "")
        return [warning("K046", f"{len(unread)} of {self.url} cannot be read any more: {named}", Span(self.url))]

    def close(self) -> None:
        """Close the file."""
        self._store.close()


class _Store(SqliteStore):
    """A store whose new descriptions stay in memory if the file takes none."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._described: dict[tuple[str, bytes], bytes] = {}
        """Entries and their descriptions in the file, with those that are used in their place."""

    def describe(self, uid: str, description: bytes, expected: str) -> None:
        """Keep another description of the same content. Raises NoSuchEntry, Changed."""
        try:
            super().describe(uid, description, expected)
        except (sqlite3.DatabaseError, Full):  # it is not to be written to, or the disk is full
            self._described[uid, super().description(uid)] = description

    def description(self, uid: str) -> bytes:
        """Return the description of an entry's last revision. Raises NoSuchEntry."""
        stored = super().description(uid)
        return self._described.get((uid, stored), stored)


class RemoteShelf:
    """A server, asked over HTTP; what was read before is read again from the user's cache while it does not answer."""

    def __init__(self, client: Client) -> None:
        self.url = client.url
        self._client = client
        self._is_cut = False

    def search(
        self,
        expression: str | None = None,
        *,
        label: str | None = None,
        kind: Kind | None = None,
        place: Mapping[str, str] | None = None,
    ) -> Sequence[Found]:
        """Return the entries that fit, sorted by identifier; none for classes that the server does not know."""
        question = {"expression": expression, "label": label, "kind": kind and kind.value, **(place or {})}
        with suppress(RefusedByChecks), self._asked():
            found = list(self._client.search(most=MOST_FOUND, **question))
            self._is_cut = self._is_cut or len(found) == MOST_FOUND
            return found
        return ()

    def revision(self, entry: Entry, number: int | None = None) -> Revision:
        """Return a revision of an entry, the last one unless told otherwise."""
        with self._asked():
            return self._client.revision(entry, number)

    def content(self, entry: Entry, revision: int | None = None) -> bytes:
        """Return the content of a revision. Raises BadInput if it is not what the entry says."""
        with self._asked():
            return self._client.content(entry, revision)

    def attachment(self, entry: Entry, attachment: Attachment) -> bytes:
        """Return a file of an entry. Raises BadInput if it is not what the entry says."""
        with self._asked():
            return self._client.attachment(entry, attachment)

    def diagnostics(self) -> Sequence[Diagnostic]:
        """Return a warning if the server does not answer, and one if it has more than it was asked for."""
        cut = f"{self.url} has more than {MOST_FOUND:,} entries for a need: only these were looked at"
        return (*kept_warning(self._client), *((warning("K045", cut),) if self._is_cut else ()))

    def close(self) -> None:
        """Close the connection."""
        self._client.close()

    @contextmanager
    def _asked(self) -> Iterator[None]:
        try:
            yield
        except RefusedByChecks:
            raise
        except (NoAnswer, NotAsAgreed, Refused) as problem:
            raise BadInput(diagnostics_of(self.url, problem)) from None


def verified(data: bytes, sha256: str, what: str) -> bytes:
    """Return data if they have a SHA-256; raises BadInput if not."""
    if hashlib.sha256(data).hexdigest() == sha256:
        return data
    raise BadInput([error("K040", f"{what} has not the content that its entry states", Span(what))])


def open_shelf(source: str, folders: Sequence[Path] = ()) -> Shelf:
    """Return the knowledge base of an address or a file. Raises BadInput if there is none."""
    if "://" in source:
        return RemoteShelf(client_of(source))
    path = Path(source)
    if not path.is_file():
        advice = "name a server, or the file of a store, as planlang serve --store makes one"
        raise BadInput([error("C001", f"there is no knowledge base {source}", help=advice)])
    return LocalShelf(path, folders)
