"""Where entries are looked for: a store on this machine, or a server's over HTTP."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from executive.serving.catalogue import Catalogue, fitting
from executive.serving.uploads import unpacked
from executive.serving.vocabulary import read_vocabulary
from planlang.diagnostics import BadInput, Span, error
from planlang.knowledge.descriptions import Description
from planlang.knowledge.entries import Attachment, Entry, Kind
from planlang.knowledge.index import CannotAnswer
from planlang.knowledge.sqlite_store import SqliteStore

Links = tuple[tuple[str, str], ...]
"""What an entry's subject is linked to: (property, class), IRIs; also what its classes require."""


@dataclass(frozen=True, slots=True)
class Found:
    """An entry that was found, with the links of its subject."""

    entry: Entry
    links: Links = ()


class Shelf(Protocol):
    """A knowledge base, as a robot asks it."""

    name: str
    """What messages call it."""

    def search(
        self,
        expression: str | None = None,
        *,
        label: str | None = None,
        kind: Kind | None = None,
        place: Mapping[str, str] | None = None,
    ) -> Sequence[Found]:
        """Return the entries that fit, sorted by identifier; none for classes that the knowledge base does not know."""

    def content(self, entry: Entry) -> bytes:
        """Return the content of an entry's last revision. Raises BadInput if it is not what the entry says."""

    def attachment(self, entry: Entry, attachment: Attachment) -> bytes:
        """Return a file of an entry. Raises BadInput if it is not what the entry says."""


class LocalShelf:
    """A store in a file of this machine, looked at without a server."""

    def __init__(self, path: Path, folders: Sequence[Path] = ()) -> None:
        """``folders``: those of ontologies that its entries import. Raises BadInput for what is no knowledge base."""
        self.name = str(path)
        self._store = SqliteStore(path)
        self._vocabulary = read_vocabulary(folders)
        self._catalogue = Catalogue(self._store, self._vocabulary)

    def search(
        self,
        expression: str | None = None,
        *,
        label: str | None = None,
        kind: Kind | None = None,
        place: Mapping[str, str] | None = None,
    ) -> Sequence[Found]:
        """Return the entries that fit, sorted by identifier; none for classes that nothing here knows."""
        with suppress(BadInput, CannotAnswer):  # a class that nothing here knows
            asked = None if expression is None else self._catalogue.question(expression)
            uids = self._catalogue.find(asked, fitting(kind, label, place or {}))
            return [Found(self._store.entry(uid), self._links(uid)) for uid in uids]
        return ()

    def _links(self, uid: str) -> Links:
        description, _ = unpacked(self._store.description(uid), self._vocabulary)
        return () if description is None else tuple(_links(description))

    def content(self, entry: Entry) -> bytes:
        """Return the content of an entry's last revision. Raises BadInput if it is not what the entry says."""
        return verified(self._store.content(entry.uid, entry.revision.number), entry.revision.sha256, entry.uid)

    def attachment(self, entry: Entry, attachment: Attachment) -> bytes:
        """Return a file of an entry. Raises BadInput if it is not what the entry says."""
        _, data = self._store.attachment(entry.uid, attachment.name)
        return verified(data, attachment.sha256, f"{entry.uid}/{attachment.name}")


def _links(description: Description) -> Iterator[tuple[str, str]]:
    for prop, target in description.nodes[0].links if description.nodes else ():
        labels = (target,) if isinstance(target, str) else description.nodes[target].labels
        yield from ((prop, label) for label in labels if not label.startswith("{"))


def verified(data: bytes, sha256: str, what: str) -> bytes:
    """Return data if they have a SHA-256; raises BadInput if not."""
    if hashlib.sha256(data).hexdigest() == sha256:
        return data
    raise BadInput([error("K040", f"{what} has not the content that its entry states", Span(what))])


def open_shelf(source: str, folders: Sequence[Path] = ()) -> Shelf:
    """Return the knowledge base of an address or a file. Raises BadInput if there is none."""
    path = Path(source)
    if not path.is_file():
        advice = "name the file of a store, as planlang serve --store makes one"
        raise BadInput([error("C001", f"there is no knowledge base {source}", help=advice)])
    return LocalShelf(path, folders)
