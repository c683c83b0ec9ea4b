"""A client of a knowledge base: the calls of a server over HTTP, with typed answers.

General layout: ``connection`` sends requests again, bounds answers and keeps what was read; ``answers`` reads them.
::

    with Client("http://localhost:8080", cache=kept_answers()) as client:
        for found in client.search(expression="ServingFoodOrDrink and subAction some Reaching"):
            recipe = client.content(found.entry)
"""

from __future__ import annotations

import hashlib
import json
import secrets
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from itertools import islice
from types import TracebackType
from typing import Any
from urllib.parse import quote

import httpx

from planlang.cache import Cache
from planlang.knowledge.answers import (
    Found,
    NoAnswer,
    NotAsAgreed,
    Taken,
    as_json,
    check_digest,
    read_as,
    read_entry,
    read_found,
    read_news,
    read_taken,
)
from planlang.knowledge.connection import Connection
from planlang.knowledge.entries import Attachment, Changed, Entry, Kind, News, NoSuchEntry, Revision

PAGE = 100
"""Entries that are asked for at a time."""


class Client:
    """The calls of one server. ``key`` is needed to change something; with a ``cache``, what was read stays readable.

    All calls raise: :class:`~planlang.knowledge.answers.NoAnswer` if the server does not answer,
    :class:`~planlang.knowledge.answers.NotAsAgreed` for an answer that is none or is damaged, and where the server
    refuses, what its store raises (NoSuchEntry, EntryExists, NotTheAuthor, Changed) or
    :class:`~planlang.knowledge.answers.Declined` with diagnostics.
    """

    def __init__(
        self,
        url: str,
        key: str | None = None,
        cache: Cache | None = None,
        *,
        transport: httpx.BaseTransport | None = None,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """Prepare for a server at an address; ``transport`` and ``sleep`` replace the network and the clock.

        Raises ValueError for what is no address.
        """
        self._connection = Connection(url, key, cache, transport, sleep)

    def __enter__(self) -> Client:
        return self

    def __exit__(self, _: type[BaseException] | None, __: BaseException | None, ___: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Close the connection."""
        self._connection.close()

    @property
    def url(self) -> str:
        """The server's address."""
        return self._connection.url

    @property
    def offline(self) -> str | None:
        """The reason why answers are those of the cache; None while the server answers."""
        return None if self._connection.offline is None else str(self._connection.offline)

    # reading

    def entries(self, kind: Kind) -> Iterator[Entry]:
        """Yield all entries of a kind, by identifier."""
        for record in self._pages(f"/v1/{kind.value}", {}):
            yield read_entry(record)

    def entry(self, uid: str, kind: Kind | None = None) -> Entry:
        """Return an entry; without its kind, each kind is looked through. Raises NoSuchEntry."""
        unanswered: NoAnswer | None = None
        for one in Kind if kind is None else (kind,):
            try:
                entry = read_entry(self._json(_path(one.value, uid)))
            except NoSuchEntry:
                continue
            except NoAnswer as problem:  # the cache may have it among another kind
                unanswered = problem
                continue
            if (entry.uid, entry.kind) != (uid, one):
                raise NotAsAgreed(f"{uid} was asked for, and {entry.uid} is the answer")
            return entry
        raise unanswered or NoSuchEntry(f"there is no {'entry' if kind is None else kind.word} {uid}")

    def content(self, entry: Entry, revision: int | None = None) -> bytes:
        """Return the content of an entry as its author handed it in, of this or another revision that is kept."""
        wanted = self.revision(entry, revision)
        name = f"{entry.uid}, revision {wanted.number},"
        reply = self._connection.get(_path(entry.kind.value, entry.uid, "content"), {"revision": str(wanted.number)})
        check_digest(reply.body, reply.headers.get("repr-digest"), wanted.sha256, name)
        return reply.body

    def revision(self, entry: Entry, number: int | None = None) -> Revision:
        """Return a revision of an entry that is kept, without a number the last. Raises NoSuchEntry."""
        if number in (None, entry.revision.number):
            return entry.revision
        kept = {one.number: one for one in self.revisions(entry)}
        if number not in kept:
            raise NoSuchEntry(f"revision {number} of {entry.uid} is not kept; kept are {', '.join(map(str, kept))}")
        return kept[number]

    def revisions(self, entry: Entry) -> tuple[Revision, ...]:
        """Return the revisions that are kept, last first."""
        listed = self._json(_path(entry.kind.value, entry.uid, "revisions")).get("revisions")
        return tuple(read_as(tuple[Revision, ...], listed))

    def attachment(self, entry: Entry, attachment: Attachment) -> bytes:
        """Return a file of an entry."""
        reply = self._connection.get(_path("binaries", entry.uid, attachment.name))
        check_digest(reply.body, reply.headers.get("repr-digest"), attachment.sha256, attachment.name)
        return reply.body

    def search(self, *, robot: str | None = None, most: int | None = None, **question: str | None) -> Iterator[Found]:
        """Yield the entries that fit a question, by identifier or, with ``sort="rating"``, the best rated first.

        At most ``most`` of them.

        ``question``: expression, label, kind, room, floor, building, street, city, sort, as the server names them;
        ``robot``: the text of a self-model, for which each answer says whether the robot can use it.
        """
        asked = {name: value for name, value in question.items() if value is not None}
        for record in islice(self._pages("/v1/search", asked, robot, min(PAGE, most or PAGE)), most):
            yield read_found(record)

    def sparql(self, query: str) -> Mapping[str, Any]:
        """Return the answer to SELECT or ASK, as SPARQL 1.1 writes it in JSON. Raises Declined for what is neither."""
        return as_json(self._sparql(query))

    def sparql_graph(self, query: str) -> str:
        """Return the answer to CONSTRUCT or DESCRIBE, as N-Triples."""
        return self._sparql(query).decode(errors="replace")

    def _sparql(self, query: str) -> bytes:
        headers = {"Content-Type": "application/sparql-query"}
        return self._connection.send("POST", "/v1/sparql", headers=headers, content=query.encode(), attempts=1).body

    # changing

    def create(self, kind: Kind, name: str, data: bytes, about: str | None = None) -> Taken:
        """Hand in an ontology as a new entry, under the author's name for it. Raises EntryExists, RefusedByChecks."""
        params = {"name": name} | ({"about": about} if about is not None else {})
        headers = {"Idempotency-Key": secrets.token_hex(16), "Content-Type": _OCTETS}
        reply = self._connection.send("POST", f"/v1/{kind.value}", params=params, headers=headers, content=data)
        return read_taken(as_json(reply.body))

    def change(self, entry: Entry, data: bytes) -> Taken:
        """Hand in the next revision of what an entry is now. Raises Changed if it is another, and RefusedByChecks."""
        path = _path(entry.kind.value, entry.uid, "content")
        headers = {"If-Match": entry.etag, "Content-Type": _OCTETS}
        try:
            reply = self._connection.send("PUT", path, headers=headers, content=data)
        except Changed:  # maybe by this very request, the answer to which was lost
            now = self.entry(entry.uid, entry.kind)
            made = now.revision.number == entry.revision.number + 1 and now.revision.author == entry.author
            if made and now.revision.sha256 == hashlib.sha256(data).hexdigest():
                return Taken(now)
            raise
        return read_taken(as_json(reply.body))

    def delete(self, entry: Entry) -> None:
        """Delete an entry with all that belongs to it; one that is gone already is as it should be. Raises Changed."""
        with suppress(NoSuchEntry):
            self._connection.send("DELETE", _path(entry.kind.value, entry.uid), headers={"If-Match": entry.etag})

    def attach(self, uid: str, name: str, media_type: str, data: bytes) -> Entry:
        """Keep a file with an entry, in the place of one of that name."""
        return self._put(_path("binaries", uid, name), data, media_type)

    def detach(self, uid: str, name: str) -> None:
        """Delete a file of an entry."""
        self._connection.send("DELETE", _path("binaries", uid, name))

    def rate(self, entry: Entry, rating: int) -> Entry:
        """Rate an entry, 0 to 10, in the place of an earlier rating."""
        data = json.dumps({"rating": rating}).encode()
        return self._put(_path(entry.kind.value, entry.uid, "rating"), data, "application/json")

    # news

    def subscribe(self, uid: str) -> None:
        """Let news of an entry appear in the author's feed."""
        self._connection.send("PUT", _path("subscriptions", uid))

    def unsubscribe(self, uid: str) -> None:
        """Take a subscription back."""
        self._connection.send("DELETE", _path("subscriptions", uid))

    def subscriptions(self) -> tuple[str, ...]:
        """Return the identifiers that the author subscribed to."""
        return tuple(read_as(tuple[str, ...], self._json("/v1/subscriptions", is_kept=False).get("subscriptions")))

    def news(self, after: int = 0, *, mine: bool = False) -> tuple[tuple[News, ...], int]:
        """Return what happened behind a line of the feed, oldest first, and the number to go on behind.

        ``mine``: to what the author subscribed to. There may be more than one answer holds.
        """
        params = {"after": str(after), "mine": "true" if mine else "false"}
        return read_news(self._json("/v1/news", params, is_kept=False))

    def _json(self, path: str, params: Mapping[str, str] | None = None, *, is_kept: bool = True) -> Mapping[str, Any]:
        return as_json(self._connection.get(path, params, is_kept=is_kept).body)

    def _put(self, path: str, data: bytes, media_type: str) -> Entry:
        reply = self._connection.send("PUT", path, headers={"Content-Type": media_type}, content=data)
        return read_entry(as_json(reply.body))

    def _pages(
        self, path: str, asked: Mapping[str, str], robot: str | None = None, limit: int = PAGE
    ) -> Iterator[object]:
        """Yield the records of all pages; a server that does not get on is left."""
        after, seen = "", {""}
        while True:
            page = self._page(path, {**asked, "limit": str(limit), "after": after}, robot)
            records, following = page.get("entries"), read_as(str | None, page.get("next"))
            if not isinstance(records, list):
                raise NotAsAgreed("the answer lists no entries: this is no knowledge base")
            yield from records
            if following is None:
                return
            if following in seen:
                raise NotAsAgreed("the server goes round in circles")
            after = following
            seen.add(after)

    def _page(self, path: str, asked: Mapping[str, str], robot: str | None) -> Mapping[str, Any]:
        if robot is None:
            return self._json(path, asked)
        body = json.dumps({**asked, "limit": int(asked["limit"]), "robot": robot}).encode()
        headers = {"Content-Type": "application/json"}
        return as_json(self._connection.send("POST", path, headers=headers, content=body).body)


_OCTETS = "application/octet-stream"
"""The media type of an ontology that is sent: its syntax is read from its text."""


def _path(*words: str) -> str:
    return "/".join(("/v1", *(quote(word, safe="") for word in words)))
