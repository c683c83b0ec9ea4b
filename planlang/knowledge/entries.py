"""Data model of a knowledge base: entries with revisions and files, ratings, news; and the interface of stores.

Callers pass the time and the author to a store, so that the same calls lead to the same state. A store checks only its
own integrity; the content of entries was checked before.
"""

from __future__ import annotations

import hashlib
import json
import unicodedata
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict
from enum import StrEnum
from statistics import median
from typing import Protocol
from urllib.parse import unquote

from planlang.designators import local_part
from planlang.diagnostics import Diagnostic, Span, error
from planlang.records import dataclass

LOWEST_RATING, HIGHEST_RATING = 0, 10
UNRATED = (LOWEST_RATING + HIGHEST_RATING) / 2
"""Rank of an entry without ratings."""

REVISIONS_KEPT = 10
"""Default number of earlier revisions that a store keeps."""

LONGEST_PART = 100
"""Limit for each of the two parts of an identifier [characters]."""


class Kind(StrEnum):
    """Kinds of entries; the value is the collection in URLs."""

    RECIPE = "recipes"
    OBJECT = "objects"
    ENVIRONMENT = "environments"
    ROBOT = "robots"
    EXPERIENCE = "experiences"

    @property
    def word(self) -> str:
        """Singular, for messages."""
        return self.value.removesuffix("s")


class Syntax(StrEnum):
    """Media types of content; the names are those of the syntaxes that can be read and written."""

    RDFXML = "application/rdf+xml"
    TURTLE = "text/turtle"
    MANCHESTER = "text/owl-manchester"
    FUNCTIONAL = "text/owl-functional"
    OWLXML = "application/owl+xml"

    @property
    def suffix(self) -> str:
        """Suffix of a file in it."""
        return _SUFFIXES[self]


_SUFFIXES = {
    Syntax.RDFXML: ".owl",
    Syntax.TURTLE: ".ttl",
    Syntax.MANCHESTER: ".omn",
    Syntax.FUNCTIONAL: ".ofn",
    Syntax.OWLXML: ".owx",
}


@dataclass(frozen=True, slots=True)
class Attachment:
    """A file of an entry: the picture of an occupancy map, a mesh, a recognition model."""

    name: str
    media_type: str
    sha256: str
    size: int
    """Bytes."""


@dataclass(frozen=True, slots=True)
class File:
    """A file as uploaded."""

    name: str
    media_type: str
    data: bytes


@dataclass(frozen=True, slots=True)
class Revision:
    """A version of an entry's content. ``number`` counts from 1; ``made`` is UTC in ISO 8601."""

    number: int
    sha256: str
    author: str
    made: str


@dataclass(frozen=True, slots=True)
class Entry:
    """An entry, without its content.

    ``uid`` is derived from the entry's class and the author's name for it (:func:`uid_of`) and never changes. ``about``
    is the IRI of the class (recipe, object model) or individual (map, robot) that the entry describes. ``rating``
    combines ``ratings`` ratings by others (:func:`rating_of`); None without any. ``created`` and the revision's
    ``made`` are UTC in ISO 8601.
    """

    uid: str
    kind: Kind
    about: str
    label: str
    author: str
    syntax: Syntax
    created: str
    revision: Revision
    attachments: tuple[Attachment, ...] = ()
    rating: float | None = None
    ratings: int = 0

    @property
    def etag(self) -> str:
        """ETag of the content, required for changes; files and ratings do not affect it."""
        return f'"{self.revision.number}-{self.revision.sha256[:16]}"'

    @property
    def record_etag(self) -> str:
        """ETag of the whole record including files and ratings; it begins with that of the content."""
        stated = json.dumps(asdict(self), sort_keys=True).encode()
        return f'{self.etag[:-1]}-{hashlib.sha256(stated).hexdigest()[:16]}"'


@dataclass(frozen=True, slots=True)
class Content:
    """Uploaded content of an entry, after the checks.

    ``name`` is the author's name for it, the second part of the identifier; unused when an entry is changed.
    ``description`` makes it searchable; packed (:mod:`planlang.knowledge.descriptions`).
    """

    kind: Kind
    about: str
    name: str
    label: str
    syntax: Syntax
    data: bytes
    description: bytes = b""


def rating_of(ratings: Iterable[int]) -> float | None:
    """Combine the ratings of an entry: the median of them and of two neutral ones; None without any.

    A few ratings cannot move the median far (Garcin, Faltings, Jurca and Joswig, Rating aggregation in collaborative
    filtering systems, RecSys 2009). The two neutral ratings act as a prior, as in a Bayesian mean: many good ratings
    rank higher than a single perfect one, and one bad rating does not sink an entry.
    """
    given = list(ratings)
    return float(median([*given, UNRATED, UNRATED])) if given else None


class Change(StrEnum):
    """Kinds of changes to an entry."""

    CREATED = "created"
    CHANGED = "changed"
    DELETED = "deleted"
    RATED = "rated"
    ATTACHED = "attached"
    DETACHED = "detached"


@dataclass(frozen=True, slots=True)
class News:
    """A line of the feed. ``number`` increases from line to line; ``made`` is UTC in ISO 8601."""

    number: int
    change: Change
    uid: str
    kind: Kind
    author: str
    made: str


def uid_of(about: str, name: str) -> str:
    """Form the identifier of an entry: the local name of the described class, a dot, the author's name for the entry.

    Both are in lower case without spaces, as in RoboEarth's database. An IRI and its percent-encoded URI (RFC 3987)
    give the same identifier. Raises ValueError, with the reason, for anything but letters, digits, ``_`` and ``-``.
    """
    parts = ["".join(_normal(part).split()).lower() for part in (local_part(about), name)]
    for part in parts:
        if not _is_part(part):
            raise ValueError(
                f"{part[:40]!r} cannot be part of an identifier: use 1 to {LONGEST_PART} letters, digits, _ and -"
            )
    return ".".join(parts)


def _normal(name: str) -> str:
    try:
        return unicodedata.normalize("NFC", unquote(name, errors="strict"))
    except UnicodeDecodeError:
        return name


def _is_part(text: str) -> bool:
    return 1 <= len(text) <= LONGEST_PART and text[0].isalnum() and all(map(_is_letter, text))


def _is_letter(one: str) -> bool:
    """Check for a letter, digit or mark allowed in an IRI: ucschar of RFC 3987 excludes one block of them."""
    is_any = one.isalnum() or one in "_-" or unicodedata.category(one) in ("Mn", "Mc")
    return is_any and not 0xE0000 <= ord(one) < 0xE1000


def is_uid(text: str) -> bool:
    """Check whether a text is a valid identifier."""
    parts = text.split(".")
    return len(parts) == 2 and all(map(_is_part, parts))


SCHEME = "sparql+"
"""Prefix for the address of a store at a SPARQL endpoint, before http or https."""


class Refused(Exception):
    """A store refused a request; the text says why."""


class NoSuchEntry(Refused):
    """No entry, revision or attachment has that name."""


class EntryExists(Refused):
    """An entry with that identifier exists already."""


class NotTheAuthor(Refused):
    """Only the author of an entry may change or delete it."""


class OwnEntry(Refused):
    """Authors may not rate their own entries."""


class Changed(Refused):
    """The entry has changed meanwhile: the request names the ETag of another revision."""


class Unreachable(Exception):
    """A service behind the store does not respond; the text says which. The call may succeed later."""


class Full(Unreachable):
    """No space is left; the store is unchanged."""


class Unusable(Unreachable):
    """The file of a store is damaged, locked, or cannot be written; ``advice`` says what to do."""

    def __init__(self, message: str, advice: str) -> None:
        super().__init__(message)
        self.advice = advice

    def diagnostic(self, file: str) -> Diagnostic:
        """Make the error that the file cannot be used."""
        return error("K001", str(self), Span(file), self.advice)


def check_rating(entry: Entry, author: str, rating: int) -> None:
    """Raise ValueError for an invalid rating, and OwnEntry if the author rates an own entry."""
    if not LOWEST_RATING <= rating <= HIGHEST_RATING:
        raise ValueError(f"a rating is a whole number from {LOWEST_RATING} to {HIGHEST_RATING}, not {rating}")
    if entry.author == author:
        raise OwnEntry(f"{entry.uid} is your own entry; only others can rate it")


def own(entry: Entry, author: str | None, expected: str | None = None) -> Entry:
    """Return the entry if ``author`` (None: anybody) may change it and its ETag is ``expected``.

    Raises NotTheAuthor, Changed.
    """
    if author is not None and entry.author != author:
        raise NotTheAuthor(f"{entry.uid} belongs to {entry.author}")
    if expected is not None and entry.etag != expected:
        raise Changed(f"{entry.uid} is now {entry.etag}, not {expected}")
    return entry


@dataclass(frozen=True, slots=True)
class Request:
    """A request that may arrive twice: its Idempotency-Key and its digest."""

    key: str
    digest: str


@dataclass(frozen=True, slots=True)
class Described:
    """Fields of an entry for the search, with its packed description."""

    uid: str
    kind: Kind
    about: str
    label: str
    description: bytes


class Store(Protocol):
    """Entries, their contents and attachments, authors' keys, ratings, subscriptions and news.

    Every change is a transaction: after a crash it is stored completely or not at all. ``now`` is UTC in ISO 8601.
    """

    def entries(self, kind: Kind | None = None) -> Iterator[Entry]:
        """Yield all entries, or those of a kind, sorted by identifier."""

    def entry(self, uid: str) -> Entry:
        """Return an entry. Raises NoSuchEntry."""

    def content(self, uid: str, revision: int | None = None) -> bytes:
        """Return the content of the latest revision, or of another one still stored. Raises NoSuchEntry."""

    def revisions(self, uid: str) -> tuple[Revision, ...]:
        """Return the stored revisions, latest first. Raises NoSuchEntry."""

    def descriptions(self) -> Iterator[Described]:
        """Yield the fields and descriptions of all entries, sorted by identifier."""

    def description(self, uid: str) -> bytes:
        """Return the description of the latest revision. Raises NoSuchEntry."""

    def describe(self, uid: str, description: bytes, expected: str) -> None:
        """Replace the description of unchanged content, without a line in the feed. Raises NoSuchEntry, Changed."""

    def create(self, content: Content, author: str, now: str, request: Request | None = None) -> Entry:
        """Store a new entry and its request. Raises EntryExists; ValueError for an invalid name."""

    def change(self, uid: str, content: Content, author: str, expected: str, now: str) -> Entry:
        """Store a new revision if the ETag is ``expected``. Raises NoSuchEntry, NotTheAuthor, Changed."""

    def delete(self, uid: str, author: str, expected: str, now: str) -> None:
        """Delete an entry and everything that belongs to it. Raises NoSuchEntry, NotTheAuthor, Changed."""

    def attach(self, uid: str, file: File, author: str, now: str) -> Attachment:
        """Store a file of an entry, replacing one of that name. Raises NoSuchEntry, NotTheAuthor."""

    def detach(self, uid: str, name: str, author: str, now: str) -> None:
        """Delete a file of an entry. Raises NoSuchEntry, NotTheAuthor."""

    def attachment(self, uid: str, name: str) -> tuple[Attachment, bytes]:
        """Return a file of an entry. Raises NoSuchEntry."""

    def rate(self, uid: str, author: str, rating: int, now: str) -> Entry:
        """Store an author's rating, 0 to 10, replacing an earlier one.

        Raises NoSuchEntry, OwnEntry, ValueError.
        """

    def ratings(self) -> Mapping[str, float]:
        """Map the identifiers of rated entries to their ratings."""

    def new_key(self, author: str, now: str) -> str:
        """Create a key for an author (256 random bits); only its SHA-256 is stored. Earlier keys stay valid."""

    def drop_keys(self, author: str) -> int:
        """Revoke all keys of an author; return their number."""

    def author_of(self, key: str) -> str | None:
        """Return the author of a key; None if the key is not valid."""

    def subscribe(self, author: str, uid: str, now: str) -> None:
        """Add the news of an entry to an author's feed. Raises NoSuchEntry."""

    def unsubscribe(self, author: str, uid: str) -> None:
        """Remove a subscription, if there is one."""

    def subscriptions(self, author: str) -> tuple[str, ...]:
        """Return the subscribed identifiers, sorted."""

    def news(
        self, after: int = 0, *, author: str | None = None, limit: int = 100, newest_first: bool = False
    ) -> tuple[News, ...]:
        """Return lines of the feed after number ``after``, oldest first; for an ``author`` only subscribed entries.

        ``newest_first``: the latest lines, in reverse order.
        """

    def last_news(self) -> int:
        """Return the number of the last line of the feed; 0 if it is empty."""

    def requested(self, author: str, key: str) -> tuple[str, str] | None:
        """Return the digest of the request with this key and the entry that it created; None for a new key."""

    def close(self) -> None:
        """Close the store."""
