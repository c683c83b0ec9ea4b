"""Store on any SPARQL 1.1 endpoint, with contents in any object storage; several servers can share it.

The catalogue is one graph. A change is a single update request, which an endpoint applies completely or not at all. Its
precondition is in its WHERE clause, and it writes a line of news with a unique token, so that a query afterwards shows
whether the precondition held. Contents are stored by SHA-256 (``obstore``: S3, GCS, Azure, a folder). They are written
before the catalogue refers to them, and never deleted, since another server may be serving one.
"""

from __future__ import annotations

import hashlib
import json
import secrets
from collections.abc import Iterator, Mapping
from typing import Any
from urllib.parse import quote

import httpx
import obstore
from obstore.exceptions import BaseError
from obstore.store import ObjectStore, from_url

from planlang.closure import grouped
from planlang.knowledge.entries import (
    REVISIONS_KEPT,
    SCHEME,
    Attachment,
    Change,
    Changed,
    Content,
    Described,
    Entry,
    EntryExists,
    File,
    Kind,
    News,
    NoSuchEntry,
    Request,
    Revision,
    Syntax,
    Unreachable,
    check_rating,
    own,
    rating_of,
    uid_of,
)
from planlang.knowledge.network import http_client, proxy_of
from planlang.records import dataclass

_GRAPH = "urn:planlang:catalogue"
_SECONDS = 30.0
_PREFIX = f"PREFIX p: <urn:planlang:> PREFIX xsd: <http://www.w3.org/2001/XMLSchema#> BASE <{_GRAPH}/>\n"
_ENTRY = """?entry p:uid ?uid; p:kind ?kind; p:about ?about; p:label ?label; p:author ?author; p:syntax ?syntax;
    p:created ?created; p:revision ?number; p:sha256 ?sha256; p:changedBy ?by; p:changed ?changed."""
_FIELDS = "?uid ?kind ?about ?label ?author ?syntax ?created ?number ?sha256 ?by ?changed"

Row = dict[str, str]


@dataclass(frozen=True, slots=True)
class _Update:
    """Triples that a change deletes and inserts if a pattern matches."""

    where: str
    insert: str = ""
    delete: str = ""


def _storage(address: str) -> ObjectStore:
    try:
        return from_url(address)
    except (BaseError, ValueError) as problem:
        reason = str(problem).partition("\n")[0]
        raise ValueError(f"cannot store contents at {address}: {reason}") from None


class SparqlStore:
    """A :class:`~planlang.knowledge.entries.Store` on an endpoint and an object storage; thread-safe.

    Every method raises Unreachable if one of them does not respond.
    """

    def __init__(self, url: str, contents: str | ObjectStore, *, key: str | None = None) -> None:
        """Use the endpoint with ``query`` and ``update`` below ``url``, and ``contents``, an address of obstore.

        ``key`` is a Bearer token for the endpoint. Raises ValueError for an invalid address.
        """
        headers = {} if key is None else {"Authorization": f"Bearer {key}"}
        base = url.removeprefix(SCHEME).rstrip("/") + "/"
        proxy = proxy_of(base)
        self._http = http_client(base, proxy, base_url=base, headers=headers, timeout=_SECONDS)
        self._contents = _storage(contents) if isinstance(contents, str) else contents

    # the endpoint and the storage

    def _ask(self, pattern: str, fields: str = "*", rest: str = "") -> list[Row]:
        query = f"{_PREFIX}SELECT {fields} WHERE {{ GRAPH <{_GRAPH}> {{ {pattern} }} }} {rest}"
        headers = {"Content-Type": "application/sparql-query", "Accept": "application/sparql-results+json"}
        found: dict[str, Any] = self._post("query", query, headers).json()
        return [{name: term["value"] for name, term in row.items()} for row in found["results"]["bindings"]]

    def _post(self, path: str, text: str, headers: dict[str, str]) -> httpx.Response:
        try:
            return self._http.post(path, content=text.encode(), headers=headers).raise_for_status()
        except httpx.HTTPError as problem:
            raise Unreachable(f"the SPARQL endpoint does not respond: {problem}") from problem

    def _change(self, update: _Update, change: Change, uid: str, kind: Kind, author: str, now: str) -> bool:
        """Send an update and its line of news in one request; return whether the precondition held."""
        token = secrets.token_hex(16)
        line = f"""<counter> p:value ?next. ?news p:line ?next; p:change {_text(change)}; p:newsOf {_text(uid)};
            p:kind {_text(kind)}; p:author {_text(author)}; p:made {_text(now)}; p:token {_text(token)}."""
        counting = f"""OPTIONAL {{ <counter> p:value ?last }} BIND(COALESCE(?last, 0) + 1 AS ?next)
            BIND(IRI(CONCAT("{_GRAPH}/news/", STR(?next))) AS ?news)"""
        self._update(
            f"DELETE {{ <counter> p:value ?last. {update.delete} }} INSERT {{ {line} {update.insert} }} "
            f"WHERE {{ {update.where} {counting} }}"
        )
        return bool(self._ask(f"?news p:token {_text(token)}"))

    def _update(self, operation: str) -> None:
        self._post("update", f"{_PREFIX}WITH <{_GRAPH}> {operation}", {"Content-Type": "application/sparql-update"})

    def _keep(self, data: bytes) -> str:
        sha256 = hashlib.sha256(data).hexdigest()
        try:
            obstore.put(self._contents, sha256, data)
        except OSError as problem:
            raise Unreachable(f"the object storage does not respond: {problem}") from problem
        return sha256

    def _kept_content(self, sha256: str) -> bytes:
        try:
            return bytes(obstore.get(self._contents, sha256).bytes())
        except OSError as problem:
            raise Unreachable(f"the object storage cannot read a content: {problem}") from problem

    # entries

    def entries(self, kind: Kind | None = None) -> Iterator[Entry]:
        """Yield all entries, or those of a kind, sorted by identifier."""
        wanted = "" if kind is None else f"?entry p:kind {_text(kind)}."
        files = self._ask(_FILE, rest="ORDER BY ?uid ?name")
        attachments = grouped((row["uid"], _attachment(row)) for row in files)
        ratings = grouped((row["uid"], row) for row in self._ask("?r p:rates ?uid; p:rating ?rating"))
        for row in self._ask(wanted + _ENTRY, _FIELDS, "ORDER BY ?uid"):
            yield _entry(row, attachments.get(row["uid"], []), ratings.get(row["uid"], []))

    def entry(self, uid: str) -> Entry:
        """Return an entry. Raises NoSuchEntry."""
        rows = self._ask(f"{_ENTRY} FILTER(?uid = {_text(uid)})", _FIELDS)
        if not rows:
            raise NoSuchEntry(f"there is no entry {uid}")
        attachments = [
            _attachment(row) for row in self._ask(f"{_FILE} FILTER(?uid = {_text(uid)})", rest="ORDER BY ?name")
        ]
        return _entry(rows[0], attachments, self._ask(f"?r p:rates {_text(uid)}; p:rating ?rating"))

    def content(self, uid: str, revision: int | None = None) -> bytes:
        """Return the content of the latest revision, or of another one still stored. Raises NoSuchEntry."""
        for one in self.revisions(uid):
            if revision is None or one.number == revision:
                return self._kept_content(one.sha256)
        raise NoSuchEntry(f"there is no revision {revision} of {uid}")

    def revisions(self, uid: str) -> tuple[Revision, ...]:
        """Return the stored revisions, latest first. Raises NoSuchEntry."""
        pattern = f"?r p:revisionOf {_text(uid)}; p:number ?number; p:sha256 ?sha256; p:author ?author; p:made ?made."
        rows = self._ask(pattern, rest="ORDER BY DESC(?number)")
        if not rows:
            raise NoSuchEntry(f"there is no entry {uid}")
        return tuple(Revision(int(row["number"]), row["sha256"], row["author"], row["made"]) for row in rows)

    def descriptions(self) -> Iterator[Described]:
        """Yield the fields and descriptions of all entries, sorted by identifier."""
        stated = "?entry p:uid ?uid; p:kind ?kind; p:about ?about; p:label ?label; p:description ?sha256"
        for row in self._ask(stated, rest="ORDER BY ?uid"):
            kept = self._kept_content(row["sha256"])
            yield Described(row["uid"], Kind(row["kind"]), row["about"], row["label"], kept)

    def description(self, uid: str) -> bytes:
        """Return the description of the latest revision. Raises NoSuchEntry."""
        rows = self._ask(f"?entry p:uid {_text(uid)}; p:description ?sha256")
        if not rows:
            raise NoSuchEntry(f"there is no entry {uid}")
        return self._kept_content(rows[0]["sha256"])

    def describe(self, uid: str, description: bytes, expected: str) -> None:
        """Replace the description of unchanged content, without a line in the feed. Raises NoSuchEntry, Changed."""
        own(self.entry(uid), None, expected)
        sha256 = self._keep(description)
        node = _node("entry", uid)
        self._update(
            f"DELETE {{ {node} p:description ?old }} INSERT {{ {node} p:description {_text(sha256)} }} "
            f"WHERE {{ {node} p:description ?old; {_holding(expected)} }}"
        )

    def create(self, content: Content, author: str, now: str, request: Request | None = None) -> Entry:
        """Store a new entry and its request. Raises EntryExists; ValueError for an invalid name."""
        uid = uid_of(content.about, content.name)
        node, revision = _node("entry", uid), _node("entry", uid, "{}")
        remembered = ""
        if request is not None:
            asked = _node("request", author, request.key)
            remembered = f"{asked} p:digest {_text(request.digest)}; p:made {_text(uid)}."
        update = _Update(
            # continue the numbers of a deleted entry, so that no ETag ever means two contents
            f"""FILTER NOT EXISTS {{ {node} p:uid ?there }} OPTIONAL {{ {node} p:last ?before }}
                BIND(COALESCE(?before, 0) + 1 AS ?number) {_numbered(revision)}""",
            f"""{node} p:uid {_text(uid)}; p:kind {_text(content.kind)}; p:author {_text(author)};
                p:created {_text(now)}. {remembered} {self._stated(node, uid, content, author, now)}""",
            f"{node} p:last ?before.",
        )
        if not self._change(update, Change.CREATED, uid, content.kind, author, now):
            raise EntryExists(f"there is an entry {uid} already")
        return self.entry(uid)

    def change(self, uid: str, content: Content, author: str, expected: str, now: str) -> Entry:
        """Store a new revision if the ETag is ``expected``. Raises NoSuchEntry, NotTheAuthor, Changed."""
        entry = own(self.entry(uid), author, expected)
        node = _node("entry", uid)
        oldest = entry.revision.number + 1 - REVISIONS_KEPT
        update = _Update(
            f"""{node} {_holding(expected)}; p:last ?before; p:about ?about; p:label ?label; p:syntax ?syntax;
                p:revision ?revision; p:changedBy ?by; p:changed ?changed; p:description ?description.
                BIND(?before + 1 AS ?number) {_numbered(_node("entry", uid, "{}"))}
                OPTIONAL {{ ?old p:revisionOf {_text(uid)}; p:number ?age; ?property ?value
                    FILTER(?age < {oldest}) }}""",
            self._stated(node, uid, content, author, now),
            f"""?old ?property ?value. {node} p:last ?before; p:about ?about; p:label ?label; p:syntax ?syntax;
                p:revision ?revision; p:sha256 ?sha256; p:changedBy ?by; p:changed ?changed;
                p:description ?description.""",
        )
        if not self._change(update, Change.CHANGED, uid, entry.kind, author, now):
            own(self.entry(uid), author, expected)
            raise Changed(f"{uid} is not {expected} any more")
        return self.entry(uid)

    def _stated(self, node: str, uid: str, content: Content, author: str, now: str) -> str:
        """Store a content, and return its triples as the revision ``?number``."""
        sha256, description = self._keep(content.data), self._keep(content.description)
        return f"""{node} p:about {_text(content.about)}; p:label {_text(content.label)};
            p:syntax {_text(content.syntax)}; p:revision ?number; p:last ?number; p:sha256 {_text(sha256)};
            p:changedBy {_text(author)}; p:changed {_text(now)}; p:description {_text(description)}.
            ?made p:revisionOf {_text(uid)}; p:number ?number; p:sha256 {_text(sha256)}; p:author {_text(author)};
            p:made {_text(now)}."""

    def delete(self, uid: str, author: str, expected: str, now: str) -> None:
        """Delete an entry and everything that belongs to it. Raises NoSuchEntry, NotTheAuthor, Changed."""
        entry = own(self.entry(uid), author, expected)
        node = _node("entry", uid)
        update = _Update(
            f"""{node} {_holding(expected)}.
                {{ {node} ?property ?value BIND({node} AS ?part) FILTER(?property != p:last) }}
                UNION {{ ?part p:revisionOf|p:fileOf|p:rates {_text(uid)}; ?property ?value }}""",
            delete="?part ?property ?value.",
        )
        if not self._change(update, Change.DELETED, uid, entry.kind, author, now):
            own(self.entry(uid), author, expected)
            raise Changed(f"{uid} is not {expected} any more")

    # attachments

    def attach(self, uid: str, file: File, author: str, now: str) -> Attachment:
        """Store a file of an entry, replacing one of that name. Raises NoSuchEntry, NotTheAuthor."""
        entry = own(self.entry(uid), author)
        attachment = Attachment(file.name, file.media_type, self._keep(file.data), len(file.data))
        node = _node("file", uid, file.name)
        update = _Update(
            f"{_node('entry', uid)} p:author {_text(author)}. OPTIONAL {{ {node} ?property ?value }}",
            f"""{node} p:fileOf {_text(uid)}; p:name {_text(file.name)}; p:mediaType {_text(file.media_type)};
                p:sha256 {_text(attachment.sha256)}; p:size {attachment.size}.""",
            f"{node} ?property ?value.",
        )
        if not self._change(update, Change.ATTACHED, uid, entry.kind, author, now):
            raise NoSuchEntry(f"there is no entry {uid}")
        return attachment

    def detach(self, uid: str, name: str, author: str, now: str) -> None:
        """Delete a file of an entry. Raises NoSuchEntry, NotTheAuthor."""
        entry = own(self.entry(uid), author)
        node = _node("file", uid, name)
        update = _Update(f"{node} ?property ?value.", delete=f"{node} ?property ?value.")
        if not self._change(update, Change.DETACHED, uid, entry.kind, author, now):
            raise NoSuchEntry(f"{uid} has no file {name}")

    def attachment(self, uid: str, name: str) -> tuple[Attachment, bytes]:
        """Return a file of an entry. Raises NoSuchEntry."""
        rows = self._ask(f"{_FILE} FILTER(?uid = {_text(uid)} && ?name = {_text(name)})")
        if not rows:
            raise NoSuchEntry(f"{uid} has no file {name}")
        found = _attachment(rows[0])
        return found, self._kept_content(found.sha256)

    # authors, ratings, news

    def rate(self, uid: str, author: str, rating: int, now: str) -> Entry:
        """Store an author's rating, 0 to 10, replacing an earlier one.

        Raises NoSuchEntry, OwnEntry, ValueError.
        """
        entry = self.entry(uid)
        check_rating(entry, author, rating)
        node = _node("rating", uid, author)
        update = _Update(
            f"{_node('entry', uid)} p:uid {_text(uid)}. OPTIONAL {{ {node} p:rating ?before }}",
            f"{node} p:rates {_text(uid)}; p:rating {rating}.",
            f"{node} p:rating ?before.",
        )
        self._change(update, Change.RATED, uid, entry.kind, author, now)
        return self.entry(uid)

    def ratings(self) -> Mapping[str, float]:
        """Map the identifiers of rated entries to their ratings."""
        return {one.uid: one.rating for one in self.entries() if one.rating is not None}

    def new_key(self, author: str, now: str) -> str:
        """Create a key for an author (256 random bits); only its SHA-256 is stored. Earlier keys stay valid."""
        key = secrets.token_urlsafe(32)
        node = _node("key", hashlib.sha256(key.encode()).hexdigest())
        self._update(f"INSERT {{ {node} p:keyOf {_text(author)}; p:made {_text(now)} }} WHERE {{}}")
        return key

    def drop_keys(self, author: str) -> int:
        """Revoke all keys of an author; return their number."""
        pattern = f"?key p:keyOf {_text(author)}"
        count = len(self._ask(pattern))
        self._update(f"DELETE {{ ?key ?property ?value }} WHERE {{ {pattern}; ?property ?value }}")
        return count

    def author_of(self, key: str) -> str | None:
        """Return the author of a key; None if the key is not valid."""
        node = _node("key", hashlib.sha256(key.encode()).hexdigest())
        return next((row["author"] for row in self._ask(f"{node} p:keyOf ?author")), None)

    def requested(self, author: str, key: str) -> tuple[str, str] | None:
        """Return the digest of the request with this key and the entry that it created; None for a new key."""
        rows = self._ask(f"{_node('request', author, key)} p:digest ?digest; p:made ?uid")
        return (rows[0]["digest"], rows[0]["uid"]) if rows else None

    def subscribe(self, author: str, uid: str, now: str) -> None:
        """Add the news of an entry to an author's feed. Raises NoSuchEntry."""
        self.entry(uid)
        node = _node("subscription", author, uid)
        self._update(
            f"INSERT {{ {node} p:subscriber {_text(author)}; p:to {_text(uid)}; p:made {_text(now)} }} WHERE {{}}"
        )

    def unsubscribe(self, author: str, uid: str) -> None:
        """Remove a subscription, if there is one."""
        node = _node("subscription", author, uid)
        self._update(f"DELETE {{ {node} ?property ?value }} WHERE {{ {node} ?property ?value }}")

    def subscriptions(self, author: str) -> tuple[str, ...]:
        """Return the subscribed identifiers, sorted."""
        return tuple(
            row["uid"] for row in self._ask(f"?s p:subscriber {_text(author)}; p:to ?uid", rest="ORDER BY ?uid")
        )

    def news(
        self, after: int = 0, *, author: str | None = None, limit: int = 100, newest_first: bool = False
    ) -> tuple[News, ...]:
        """Return lines of the feed after number ``after``, oldest first; for an ``author`` only subscribed entries."""
        mine = "" if author is None else f"FILTER EXISTS {{ ?s p:subscriber {_text(author)}; p:to ?uid }}"
        pattern = f"""?news p:line ?number; p:change ?change; p:newsOf ?uid; p:kind ?kind; p:author ?author;
            p:made ?made FILTER(?number > {int(after)}) {mine}"""
        order = f"ORDER BY {'DESC' if newest_first else 'ASC'}(?number) LIMIT {int(limit)}"
        rows = self._ask(pattern, "?number ?change ?uid ?kind ?author ?made", order)
        return tuple(
            News(int(row["number"]), Change(row["change"]), row["uid"], Kind(row["kind"]), row["author"], row["made"])
            for row in rows
        )

    def last_news(self) -> int:
        """Return the number of the last line of the feed; 0 if it is empty."""
        return max((int(row["value"]) for row in self._ask("<counter> p:value ?value")), default=0)

    def close(self) -> None:
        """Close the connections."""
        self._http.close()


_FILE = "?file p:fileOf ?uid; p:name ?name; p:mediaType ?type; p:sha256 ?sha256; p:size ?size."


def _entry(row: Row, attachments: list[Attachment], rated: list[Row]) -> Entry:
    own = _node("rating", row["uid"], row["author"]).strip("<>")  # earlier versions may have stored one
    ratings = [int(one["rating"]) for one in rated if one["r"] != own]
    revision = Revision(int(row["number"]), row["sha256"], row["by"], row["changed"])
    return Entry(
        uid=row["uid"],
        kind=Kind(row["kind"]),
        about=row["about"],
        label=row["label"],
        author=row["author"],
        syntax=Syntax(row["syntax"]),
        created=row["created"],
        revision=revision,
        attachments=tuple(attachments),
        rating=rating_of(ratings),
        ratings=len(ratings),
    )


def _attachment(row: Row) -> Attachment:
    return Attachment(row["name"], row["type"], row["sha256"], int(row["size"]))


def _holding(expected: str) -> str:
    """Pattern that matches an entry only with the expected ETag; a revision number never changes its content."""
    number = expected.strip('"').partition("-")[0]
    if not number.isdecimal():
        raise Changed(f"{expected} is not the ETag of an entry")
    return f"p:revision {int(number)}; p:sha256 ?sha256"


def _numbered(pattern: str) -> str:
    """Expression that binds ``?made`` to the node of the revision ``?number``."""
    before, _, after = pattern.strip("<>").partition(quote("{}", safe=""))
    return f'BIND(IRI(CONCAT("{before}", STR(?number), "{after}")) AS ?made)'


def _node(*parts: str) -> str:
    """IRI of a node, made of ``parts`` below the graph's IRI."""
    return f"<{_GRAPH}/{'/'.join(quote(part, safe='') for part in parts)}>"


def _text(value: str) -> str:
    """Format a text as a SPARQL literal, which has the same escapes as JSON."""
    return json.dumps(value, ensure_ascii=False)
