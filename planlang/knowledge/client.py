"""Client of a knowledge-base server over HTTP, with typed results.

``connection`` repeats requests, bounds responses and caches them; ``answers`` parses them. ::

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
from planlang.knowledge.entries import (
    Attachment,
    Changed,
    Entry,
    Kind,
    News,
    NoSuchEntry,
    NotTheAuthor,
    OwnEntry,
    Revision,
)

PAGE = 100
"""Entries per request."""


class Client:
    """The requests of a server. Changes need a ``key``; with a ``cache``, results stay readable offline.

    All calls raise :class:`~planlang.knowledge.answers.NoAnswer` if the server does not respond,
    :class:`~planlang.knowledge.answers.NotAsAgreed` for a damaged or foreign response and, if the server refuses, the
    exception of its store (NoSuchEntry, EntryExists, NotTheAuthor, Changed) or
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
        """Set up a connection to ``url``; tests replace network and clock by ``transport`` and ``sleep``.

        Raises ValueError for an invalid address.
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
        """Why results come from the cache; None while the server responds."""
        return None if self._connection.offline is None else str(self._connection.offline)

    # reading

    def entries(self, kind: Kind) -> Iterator[Entry]:
        """Yield all entries of a kind, sorted by identifier."""
        for record in self._pages(f"/v1/{kind.value}", {}):
            yield read_entry(record)

    def entry(self, uid: str, kind: Kind | None = None) -> Entry:
        """Fetch an entry; without ``kind`` all kinds are tried. Raises NoSuchEntry."""
        unanswered: NoAnswer | None = None
        for one in Kind if kind is None else (kind,):
            try:
                entry = read_entry(self._json(_path(one.value, uid)))
            except NoSuchEntry:
                continue
            except NoAnswer as problem:  # it may be cached under another kind
                unanswered = problem
                continue
            if (entry.uid, entry.kind) != (uid, one):
                raise NotAsAgreed(f"the server returned {entry.uid} instead of {uid}")
            return entry
        raise unanswered or NoSuchEntry(f"there is no {'entry' if kind is None else kind.word} {uid}")

    def content(self, entry: Entry, revision: int | None = None) -> bytes:
        """Fetch the content of an entry as uploaded, of the latest or another stored revision."""
        wanted = self.revision(entry, revision)
        name = f"{entry.uid}, revision {wanted.number},"
        reply = self._connection.get(_path(entry.kind.value, entry.uid, "content"), {"revision": str(wanted.number)})
        check_digest(reply.body, reply.headers.get("repr-digest"), wanted.sha256, name)
        return reply.body

    def revision(self, entry: Entry, number: int | None = None) -> Revision:
        """Fetch the record of a stored revision, by default the latest. Raises NoSuchEntry."""
        if number in (None, entry.revision.number):
            return entry.revision
        kept = {one.number: one for one in self.revisions(entry)}
        if number not in kept:
            raise NoSuchEntry(f"revision {number} of {entry.uid} is not stored; stored are {', '.join(map(str, kept))}")
        return kept[number]

    def revisions(self, entry: Entry) -> tuple[Revision, ...]:
        """Fetch the records of stored revisions, latest first."""
        listed = self._json(_path(entry.kind.value, entry.uid, "revisions")).get("revisions")
        return tuple(read_as(tuple[Revision, ...], listed))

    def attachment(self, entry: Entry, attachment: Attachment) -> bytes:
        """Fetch a file of an entry."""
        reply = self._connection.get(_path("binaries", entry.uid, attachment.name))
        check_digest(reply.body, reply.headers.get("repr-digest"), attachment.sha256, attachment.name)
        return reply.body

    def search(self, *, robot: str | None = None, most: int | None = None, **question: str | None) -> Iterator[Found]:
        """Yield at most ``most`` matching entries, by identifier or, with ``sort="rating"``, best rated first.

        ``question``: the server's parameters expression, label, kind, room, floor, building, street, city, sort.
        ``robot``: the text of a self-model; each result then says whether that robot can use the entry.
        """
        asked = {name: value for name, value in question.items() if value is not None}
        for record in islice(self._pages("/v1/search", asked, robot, min(PAGE, most or PAGE)), most):
            yield read_found(record)

    def sparql(self, query: str) -> Mapping[str, Any]:
        """Run SELECT or ASK and return the result in SPARQL 1.1 JSON. Raises Declined for other queries."""
        return as_json(self._sparql(query))

    def sparql_graph(self, query: str) -> str:
        """Run CONSTRUCT or DESCRIBE and return N-Triples."""
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
        """Upload the next revision of an entry. Raises Changed if it was changed meanwhile, and RefusedByChecks."""
        path = _path(entry.kind.value, entry.uid, "content")
        headers = {"If-Match": entry.etag, "Content-Type": _OCTETS}
        try:
            reply = self._connection.send("PUT", path, headers=headers, content=data)
        except Changed:  # perhaps by this request, whose response was lost
            now = self.entry(entry.uid, entry.kind)
            made = now.revision.number == entry.revision.number + 1 and now.revision.author == entry.author
            if made and now.revision.sha256 == hashlib.sha256(data).hexdigest():
                return Taken(now)
            raise
        return read_taken(as_json(reply.body))

    def delete(self, entry: Entry) -> None:
        """Delete an entry and everything that belongs to it, if it still exists. Raises Changed."""
        with suppress(NoSuchEntry):
            self._connection.send("DELETE", _path(entry.kind.value, entry.uid), headers={"If-Match": entry.etag})

    def attach(self, uid: str, name: str, media_type: str, data: bytes) -> Entry:
        """Upload a file of an entry, replacing one of that name."""
        return self._put(_path("binaries", uid, name), data, media_type)

    def detach(self, uid: str, name: str) -> None:
        """Delete a file of an entry."""
        self._connection.send("DELETE", _path("binaries", uid, name))

    def rate(self, entry: Entry, rating: int) -> Entry:
        """Rate an entry, 0 to 10, replacing an earlier rating. Raises OwnEntry if the key is that of its author."""
        data = json.dumps({"rating": rating}).encode()
        try:
            return self._put(_path(entry.kind.value, entry.uid, "rating"), data, "application/json")
        except NotTheAuthor as problem:  # both are status 403
            raise OwnEntry(str(problem)) from None

    # news

    def subscribe(self, uid: str) -> None:
        """Add the news of an entry to the author's feed."""
        self._connection.send("PUT", _path("subscriptions", uid))

    def unsubscribe(self, uid: str) -> None:
        """Remove a subscription."""
        self._connection.send("DELETE", _path("subscriptions", uid))

    def subscriptions(self) -> tuple[str, ...]:
        """Fetch the subscribed identifiers."""
        reply = self._connection.send("GET", "/v1/subscriptions")
        return tuple(read_as(tuple[str, ...], as_json(reply.body).get("subscriptions")))

    def news(self, after: int = 0, *, mine: bool = False) -> tuple[tuple[News, ...], int]:
        """Fetch lines of the feed after number ``after``, oldest first, and the number for the next call.

        ``mine``: only entries that the author subscribed to. One response may not hold all lines.
        """
        params = {"after": str(after), "mine": "true" if mine else "false"}
        return read_news(as_json(self._connection.send("GET", "/v1/news", params=params).body))

    def _json(self, path: str, params: Mapping[str, str] | None = None) -> Mapping[str, Any]:
        return as_json(self._connection.get(path, params).body)

    def _put(self, path: str, data: bytes, media_type: str) -> Entry:
        reply = self._connection.send("PUT", path, headers={"Content-Type": media_type}, content=data)
        return read_entry(as_json(reply.body))

    def _pages(
        self, path: str, asked: Mapping[str, str], robot: str | None = None, limit: int = PAGE
    ) -> Iterator[object]:
        """Yield the records of all pages; stop at a server whose pages repeat."""
        after, seen = "", {""}
        while True:
            page = self._page(path, {**asked, "limit": str(limit), "after": after}, robot)
            records, following = page.get("entries"), read_as(str | None, page.get("next"))
            if not isinstance(records, list):
                raise NotAsAgreed("not a knowledge-base response: it lists no entries")
            yield from records
            if following is None:
                return
            if following in seen:
                raise NotAsAgreed("the pages of the server's list repeat")
            after = following
            seen.add(after)

    def _page(self, path: str, asked: Mapping[str, str], robot: str | None) -> Mapping[str, Any]:
        if robot is None:
            return self._json(path, asked)
        body = json.dumps({**asked, "limit": int(asked["limit"]), "robot": robot}).encode()
        headers = {"Content-Type": "application/json"}
        return as_json(self._connection.send("POST", path, headers=headers, content=body).body)


_OCTETS = "application/octet-stream"
"""Media type of uploaded ontologies; the server detects the syntax."""


def _path(*words: str) -> str:
    return "/".join(("/v1", *(quote(word, safe="") for word in words)))
