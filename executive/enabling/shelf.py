"""Knowledge bases as a robot queries them: a store in a local file, or a server over HTTP."""

from __future__ import annotations

import hashlib
import os
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
from planlang.knowledge.entries import Attachment, Entry, Kind, Refused, Revision, Unreachable
from planlang.knowledge.index import CannotAnswer
from planlang.knowledge.refusals import client_of, diagnostics_of, kept_warning
from planlang.knowledge.sqlite_store import SqliteStore
from planlang.outputs import named
from planlang.words import Blank, Text, calling

MOST_FOUND = 10_000
"""Limit of entries requested by one query."""


class Shelf(Protocol):
    """A knowledge base to read from. All calls raise BadInput if it does not answer."""

    url: str
    """Address of the server, or path of the file."""

    def search(
        self,
        expression: str | None = None,
        *,
        label: str | None = None,
        kind: Kind | None = None,
        place: Mapping[str, str] | None = None,
    ) -> Sequence[Found]:
        """Find the matching entries, sorted by identifier; none if the knowledge base does not know a class."""

    def revision(self, entry: Entry, number: int | None = None) -> Revision:
        """Look up a revision of an entry, by default the latest."""

    def content(self, entry: Entry, revision: int | None = None) -> bytes:
        """Read the content of a revision. Raises BadInput if its checksum differs from the entry's."""

    def attachment(self, entry: Entry, attachment: Attachment) -> bytes:
        """Read an attached file of an entry. Raises BadInput if its checksum differs from the entry's."""

    def diagnostics(self) -> Sequence[Diagnostic]:
        """Warnings for the user about the results so far."""

    def close(self) -> None:
        """Close the connection or file."""


class LocalShelf:
    """A store in a local file, read without a server."""

    def __init__(self, path: Path, folders: Sequence[Path] = ()) -> None:
        """Open the store; imports of its entries are looked up in ``folders``. Raises BadInput if it is no store."""
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
        """Find the matching entries, sorted by identifier; none if the store does not know a class."""
        catalogue = self._catalogue
        with suppress(BadInput, CannotAnswer):  # an unknown class, for which the need of a task suggests similar names
            query = None if expression is None else catalogue.question(expression)
            uids = catalogue.find(query, kind, label, place)
            return [Found(self._store.entry(uid), links=catalogue.links(uid)) for uid in uids]
        return ()

    def revision(self, entry: Entry, number: int | None = None) -> Revision:
        """Look up a revision of an entry, by default the latest."""
        return next((one for one in self._store.revisions(entry.uid) if one.number == number), entry.revision)

    def content(self, entry: Entry, revision: int | None = None) -> bytes:
        """Read the content of a revision. Raises BadInput if its checksum differs from the entry's."""
        wanted = self.revision(entry, revision)
        return verified(self._store.content(entry.uid, wanted.number), wanted.sha256, entry.uid)

    def attachment(self, entry: Entry, attachment: Attachment) -> bytes:
        """Read an attached file of an entry. Raises BadInput if its checksum differs from the entry's."""
        _, data = self._store.attachment(entry.uid, attachment.name)
        return verified(data, attachment.sha256, f"{entry.uid}/{attachment.name}")

    def diagnostics(self) -> Sequence[Diagnostic]:
        """Warn of entries that can no longer be parsed, so that searches by meaning miss them."""
        if not (unread := sorted(self._catalogue.unread)):
            return ()
        named = ", ".join(unread[:3]) + (", ..." if len(unread) > 3 else "")
        message = f"entries of {self.url} can no longer be read ({len(unread)}): {named}"
        return [warning("K046", message, Span(self.url))]

    def close(self) -> None:
        """Close the file."""
        self._store.close()


class _Store(SqliteStore):
    """A store that keeps renewed descriptions in memory if its file cannot be written."""

    def __init__(self, path: Path) -> None:
        super().__init__(path, creates=False)
        self._described: dict[tuple[str, bytes], bytes] = {}
        """Renewed descriptions by the entry's identifier and its description in the file."""

    def describe(self, uid: str, description: bytes, expected: str) -> None:
        """Replace the description of an entry's content. Raises NoSuchEntry, Changed."""
        try:
            super().describe(uid, description, expected)
        except Unreachable:  # the file is read-only, or the disk is full
            self._described[uid, super().description(uid)] = description

    def description(self, uid: str) -> bytes:
        """Read the description of an entry's latest revision. Raises NoSuchEntry."""
        stored = super().description(uid)
        return self._described.get((uid, stored), stored)


class RemoteShelf:
    """A server, queried over HTTP; while it does not answer, the user's cache answers repeated queries."""

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
        """Find the matching entries, sorted by identifier; none if the server does not know a class."""
        query = {"expression": expression, "label": label, "kind": kind and kind.value, **(place or {})}
        with suppress(RefusedByChecks), self._as_bad_input():
            found = list(self._client.search(most=MOST_FOUND, **query))
            self._is_cut = self._is_cut or len(found) == MOST_FOUND
            return found
        return ()

    def revision(self, entry: Entry, number: int | None = None) -> Revision:
        """Look up a revision of an entry, by default the latest."""
        with self._as_bad_input():
            return self._client.revision(entry, number)

    def content(self, entry: Entry, revision: int | None = None) -> bytes:
        """Read the content of a revision. Raises BadInput if its checksum differs from the entry's."""
        with self._as_bad_input():
            return self._client.content(entry, revision)

    def attachment(self, entry: Entry, attachment: Attachment) -> bytes:
        """Read an attached file of an entry. Raises BadInput if its checksum differs from the entry's."""
        with self._as_bad_input():
            return self._client.attachment(entry, attachment)

    def diagnostics(self) -> Sequence[Diagnostic]:
        """Warn if the server did not answer, and if it has more results than the limit."""
        message = f"{self.url} has more than {MOST_FOUND:,} entries for a need; the rest was not examined"
        return (*kept_warning(self._client), *((warning("K045", message),) if self._is_cut else ()))

    def close(self) -> None:
        """Close the connection."""
        self._client.close()

    @contextmanager
    def _as_bad_input(self) -> Iterator[None]:
        """Raise errors of the client as BadInput, except for refusals, which a search takes as no result."""
        try:
            yield
        except RefusedByChecks:
            raise
        except (NoAnswer, NotAsAgreed, Refused) as problem:
            raise BadInput(diagnostics_of(self.url, problem)) from None


def verified(data: bytes, sha256: str, what: str) -> bytes:
    """Pass on data after a check of their SHA-256. Raises BadInput if it differs; ``what`` names the data."""
    if hashlib.sha256(data).hexdigest() == sha256:
        return data
    raise BadInput([error("K040", f"the content of {what} differs from the checksum of its entry", Span(what))])


def open_shelf(source: str, folders: Sequence[Path] = ()) -> Shelf:
    """Open the knowledge base at a URL or in a file. Raises BadInput if there is none."""
    if "://" in source:
        return RemoteShelf(client_of(source))
    path = Path(source)
    if not os.path.isfile(path):
        advice = Text(
            "give the URL of a server, or the file of a store (made by ", calling("serve", store=Blank("FILE")), ")"
        )
        raise BadInput([error("C001", f"knowledge base {named(path)} does not exist", help=advice)])
    return LocalShelf(path, folders)
