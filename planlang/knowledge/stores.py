"""The protocol of stores of a knowledge base, and their refusals.

Stores do not know the time nor who is asking: both are told, so that the same calls give the same store. They check
nothing but what would damage themselves: what an entry says has been checked before.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Protocol

from planlang.knowledge.entries import (
    HIGHEST_RATING,
    LOWEST_RATING,
    Attachment,
    Content,
    Entry,
    File,
    Kind,
    News,
    Revision,
)
from planlang.records import dataclass

SCHEME = "sparql+"
"""The beginning of the address of a store over a SPARQL endpoint, before http or https."""


class Refused(Exception):
    """A store does not do what was asked; the text says why."""


class NoSuchEntry(Refused):
    """There is no entry, revision or attachment of that name."""


class EntryExists(Refused):
    """An entry of that identifier exists already."""


class NotTheAuthor(Refused):
    """Only the author of an entry changes or deletes it."""


class OwnEntry(Refused):
    """Nobody rates an entry of their own."""


class Changed(Refused):
    """The entry is not any more what the asker believes: the tag given is another revision's."""


class Unreachable(Exception):
    """Something that a store stands on does not answer; the text says what. The same call may succeed later."""


class Full(Unreachable):
    """There is no room left for what was to be kept; the store is as it was before."""


def check_rating(entry: Entry, author: str, rating: int) -> None:
    """Raise ValueError for a rating that is none, and OwnEntry for one of the author's own entry."""
    if not LOWEST_RATING <= rating <= HIGHEST_RATING:
        raise ValueError(f"a rating is a whole number from {LOWEST_RATING} to {HIGHEST_RATING}, not {rating}")
    if entry.author == author:
        raise OwnEntry(f"{entry.uid} is your own: others rate it")


@dataclass(frozen=True, slots=True)
class Request:
    """A request that may reach a server twice: the asker's key for it (Idempotency-Key), and its digest."""

    key: str
    digest: str


@dataclass(frozen=True, slots=True)
class Described:
    """The fields of an entry, and its description as it was given, by which it is found."""

    uid: str
    kind: Kind
    about: str
    label: str
    description: bytes


class Store(Protocol):
    """Entries, their contents and attachments, authors' keys, ratings, subscriptions and news.

    Every change is one transaction: after a crash it is there whole or not at all. ``now`` is UTC in ISO 8601.
    """

    def entries(self, kind: Kind | None = None) -> Iterator[Entry]:
        """Yield all entries, or those of a kind, by identifier."""

    def entry(self, uid: str) -> Entry:
        """Return an entry. Raises NoSuchEntry."""

    def content(self, uid: str, revision: int | None = None) -> bytes:
        """Return the content of an entry's last revision, or of another that is kept. Raises NoSuchEntry."""

    def revisions(self, uid: str) -> tuple[Revision, ...]:
        """Return the revisions that are kept, last first. Raises NoSuchEntry."""

    def descriptions(self) -> Iterator[Described]:
        """Yield the fields and descriptions of all entries, by identifier."""

    def description(self, uid: str) -> bytes:
        """Return the description of an entry's last revision. Raises NoSuchEntry."""

    def describe(self, uid: str, description: bytes, expected: str) -> None:
        """Keep another description of the same content, which is no news. Raises NoSuchEntry, Changed."""

    def create(self, content: Content, author: str, now: str, request: Request | None = None) -> Entry:
        """Keep a new entry, and with it by which request. Raises EntryExists; ValueError for a name without letters."""

    def change(self, uid: str, content: Content, author: str, expected: str, now: str) -> Entry:
        """Give an entry a new revision if its tag is ``expected``. Raises NoSuchEntry, NotTheAuthor, Changed."""

    def delete(self, uid: str, author: str, expected: str, now: str) -> None:
        """Delete an entry with all that belongs to it. Raises NoSuchEntry, NotTheAuthor, Changed."""

    def attach(self, uid: str, file: File, author: str, now: str) -> Attachment:
        """Keep a file with an entry, in the place of one of that name. Raises NoSuchEntry, NotTheAuthor."""

    def detach(self, uid: str, name: str, author: str, now: str) -> None:
        """Delete a file of an entry. Raises NoSuchEntry, NotTheAuthor."""

    def attachment(self, uid: str, name: str) -> tuple[Attachment, bytes]:
        """Return a file of an entry. Raises NoSuchEntry."""

    def rate(self, uid: str, author: str, rating: int, now: str) -> Entry:
        """Keep an author's rating, 0 to 10, in the place of an earlier one.

        Raises NoSuchEntry, OwnEntry, ValueError.
        """

    def ratings(self) -> Mapping[str, float]:
        """Return the rating of each entry that has one, by identifier."""

    def new_key(self, author: str, now: str) -> str:
        """Return a new key of an author (256 random bits); only its SHA-256 is kept. Earlier keys stay valid."""

    def drop_keys(self, author: str) -> int:
        """Let no key of an author be valid any more; return how many there were."""

    def author_of(self, key: str) -> str | None:
        """Return whose key this is, None for nobody's."""

    def subscribe(self, author: str, uid: str, now: str) -> None:
        """Let news of an entry appear in an author's feed. Raises NoSuchEntry."""

    def unsubscribe(self, author: str, uid: str) -> None:
        """Take a subscription back; nothing happens if there is none."""

    def subscriptions(self, author: str) -> tuple[str, ...]:
        """Return the identifiers that an author subscribed to, sorted."""

    def news(
        self, after: int = 0, *, author: str | None = None, limit: int = 100, newest_first: bool = False
    ) -> tuple[News, ...]:
        """Return what happened after a line of the feed, oldest first; with ``author`` of subscriptions alone.

        ``newest_first``: the last lines, from the last one on.
        """

    def last_news(self) -> int:
        """Return the number of the last line of the feed, 0 for an empty one."""

    def requested(self, author: str, key: str) -> tuple[str, str] | None:
        """Return the digest of the request with which an entry was made, and its identifier; None for a new key."""

    def close(self) -> None:
        """End the work with the store."""
