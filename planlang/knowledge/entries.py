"""The content of a knowledge base: entries with their revisions, files that belong to them, ratings and news.

Stores keep them. They do not know the time nor who is asking: both are given to them, so that the same calls give the
same store. They check nothing but what would damage themselves: what an entry says has been checked before.
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

from planlang.designators import local_name
from planlang.records import dataclass

LOWEST_RATING, HIGHEST_RATING = 0, 10
UNRATED = (LOWEST_RATING + HIGHEST_RATING) / 2
"""The rating by which an entry without any is ranked."""

REVISIONS_KEPT = 10
"""Earlier revisions of an entry that are kept unless a store is told otherwise."""

LONGEST_PART = 100
"""Characters of each of the two parts of an identifier."""


class Kind(StrEnum):
    """A kind of entry; the value is its collection in addresses."""

    RECIPE = "recipes"
    OBJECT = "objects"
    ENVIRONMENT = "environments"
    ROBOT = "robots"
    EXPERIENCE = "experiences"

    @property
    def word(self) -> str:
        """The word for one of this kind in messages."""
        return self.value.removesuffix("s")


class Syntax(StrEnum):
    """The media type of an entry's content."""

    RDFXML = "application/rdf+xml"
    TURTLE = "text/turtle"
    MANCHESTER = "text/owl-manchester"


@dataclass(frozen=True, slots=True)
class Attachment:
    """A file that belongs to an entry: a picture of an occupancy map, a mesh, a recognition model."""

    name: str
    media_type: str
    sha256: str
    size: int
    """Bytes."""


@dataclass(frozen=True, slots=True)
class File:
    """A file as an author hands it in."""

    name: str
    media_type: str
    data: bytes


@dataclass(frozen=True, slots=True)
class Revision:
    """One content of an entry. ``number`` counts from 1; ``made`` is UTC in ISO 8601."""

    number: int
    sha256: str
    author: str
    made: str


@dataclass(frozen=True, slots=True)
class Entry:
    """A thing kept under one identifier, without its content.

    ``uid`` follows the entry's class and the author's own name for it (:func:`uid_of`) and never changes. ``about`` is
    the IRI of the class (recipe, object model) or individual (map, robot) that the entry describes. ``rating`` is
    :func:`rating_of` its ``ratings`` ratings by others, None without any. ``created`` and the revision's ``made`` are
    UTC in ISO 8601.
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
        """The tag of the content, which a change has to name: files and ratings are not part of it."""
        return f'"{self.revision.number}-{self.revision.sha256[:16]}"'

    @property
    def record_etag(self) -> str:
        """The tag of the whole record, files and ratings included. It begins with that of the content."""
        stated = json.dumps(asdict(self), sort_keys=True).encode()
        return f'{self.etag[:-1]}-{hashlib.sha256(stated).hexdigest()[:16]}"'


@dataclass(frozen=True, slots=True)
class Content:
    """The upload of an author for an entry, after the checks.

    ``name`` is the author's own name for it, the second part of the identifier; unused when an entry is changed.
    ``description`` is what it is found by, packed (:mod:`planlang.knowledge.descriptions`).
    """

    kind: Kind
    about: str
    name: str
    label: str
    syntax: Syntax
    data: bytes
    description: bytes = b""


def rating_of(ratings: Iterable[int]) -> float | None:
    """Return the rating of an entry: the median of its ratings and of two more in the middle of the scale.

    The median is what few ratings cannot move far (Garcin, Faltings, Jurca and Joswig, Rating aggregation in
    collaborative filtering systems, RecSys 2009); the two more, as in a Bayesian mean, let an entry with many good
    ratings come before one with a single best one, and keep one low rating from sinking an entry. None without any.
    """
    given = list(ratings)
    return float(median([*given, UNRATED, UNRATED])) if given else None


class Change(StrEnum):
    """A change of an entry."""

    CREATED = "created"
    CHANGED = "changed"
    DELETED = "deleted"
    RATED = "rated"
    ATTACHED = "attached"
    DETACHED = "detached"


@dataclass(frozen=True, slots=True)
class News:
    """One line of the feed. ``number`` grows with every line; ``made`` is UTC in ISO 8601."""

    number: int
    change: Change
    uid: str
    kind: Kind
    author: str
    made: str


def uid_of(about: str, name: str) -> str:
    """Return the identifier of an entry: the described class's local name, a point, the author's name for it.

    Both in lower case without blanks, as RoboEarth's database formed them. An IRI and the URI that it is written as
    where only ASCII may stand (RFC 3987: UTF-8, percent-encoded) give the same identifier. Raises ValueError, with the
    reason, for anything but letters, digits, ``_`` and ``-``.
    """
    parts = ["".join(_normal(part).split()).lower() for part in (local_name(about), name)]
    for part in parts:
        if not _is_part(part):
            raise ValueError(f"{part[:40]!r} is no part of an identifier: 1 to {LONGEST_PART} letters, digits, _ and -")
    return ".".join(parts)


def _normal(name: str) -> str:
    try:
        return unicodedata.normalize("NFC", unquote(name, errors="strict"))
    except UnicodeDecodeError:
        return name


def _is_part(text: str) -> bool:
    return 1 <= len(text) <= LONGEST_PART and text[0].isalnum() and all(map(_is_letter, text))


def _is_letter(one: str) -> bool:
    """Return True for a letter, digit or mark that an IRI may have: RFC 3987's ucschar leaves out one block of them."""
    is_any = one.isalnum() or one in "_-" or unicodedata.category(one) in ("Mn", "Mc")
    return is_any and not 0xE0000 <= ord(one) < 0xE1000


def is_uid(text: str) -> bool:
    """Return True for what can be an identifier."""
    parts = text.split(".")
    return len(parts) == 2 and all(map(_is_part, parts))


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


def own(entry: Entry, author: str | None, expected: str | None = None) -> Entry:
    """Return an entry that ``author`` (None: anybody) may change, if its tag is ``expected``.

    Raises NotTheAuthor, Changed.
    """
    if author is not None and entry.author != author:
        raise NotTheAuthor(f"{entry.uid} is {entry.author}'s")
    if expected is not None and entry.etag != expected:
        raise Changed(f"{entry.uid} is now {entry.etag}, not {expected}")
    return entry


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
