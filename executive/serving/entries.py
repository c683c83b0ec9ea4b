"""Routes of entries: recipes, objects, environments, robots and experiences, their contents and revisions."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Callable
from dataclasses import asdict
from http import HTTPStatus
from pathlib import Path
from typing import Annotated, Any
from urllib.parse import quote

from fastapi import APIRouter, Header, Query, Request, Response
from fastapi.responses import JSONResponse
from pydantic import BaseModel, Field

from executive.serving.problems import Problem, diagnostic_json
from executive.serving.serving import Author, Body, Served, Serving, now
from executive.serving.uploads import Upload, read_upload
from executive.serving.vocabulary import Vocabulary
from executive.serving.workers import Workers
from planlang.knowledge.entries import HIGHEST_RATING, LOWEST_RATING, Changed, Entry, Kind, NoSuchEntry, Syntax
from planlang.knowledge.entries import Request as KeyedRequest
from planlang.ontology.convert import Target, convert_content

router = APIRouter(prefix="/v1", tags=["entries"])

MOST_LISTED = 100
"""Entries in one response."""

Limit = Annotated[int, Query(ge=1, le=MOST_LISTED)]
IfMatch = Annotated[str | None, Header()]
_ONTOLOGY: dict[str, Any] = {syntax.value: {} for syntax in Syntax}
UPLOADED: dict[str, Any] = {"requestBody": {"required": True, "content": _ONTOLOGY}}


@router.get("/{kind}")
def list_entries(kind: Kind, served: Served, after: str = "", limit: Limit = MOST_LISTED) -> dict[str, Any]:
    """List the entries of a kind after an identifier; ``next`` is the identifier to continue after."""
    return listing(served, served.catalogue.uids(kind, after, limit + 1), limit, record)


def listing(
    served: Serving, uids: tuple[str, ...], limit: int, shown: Callable[[Entry], dict[str, Any]]
) -> dict[str, Any]:
    """Build one page of a list of entries; ``next`` is its last identifier if there are more."""
    records = []
    for uid in uids[:limit]:
        try:
            records.append(shown(served.store.entry(uid)))
        except NoSuchEntry:  # deleted in the meantime
            continue
    return {"entries": records, "next": uids[limit - 1] if len(uids) > limit else None}


@router.post("/{kind}", status_code=HTTPStatus.CREATED, openapi_extra=UPLOADED)
def create(
    kind: Kind,
    name: Annotated[str, Query(max_length=100)],
    author: Author,
    served: Served,
    data: Body,
    about: Annotated[str | None, Query(max_length=1000)] = None,
    idempotency_key: Annotated[str | None, Header(max_length=200)] = None,
) -> Response:
    """Check an ontology and store it as a new entry of the author.

    Repeating a request with the same Idempotency-Key returns the entry that the first request created.
    """
    digest = hashlib.sha256(repr((kind.value, name, about)).encode() + data).hexdigest()
    request = None if idempotency_key is None else KeyedRequest(idempotency_key, digest)
    upload: Upload | None = None
    entry = _created_before(served, author, request)
    if entry is None:
        upload = served.staff.checking.call(read_upload, kind, name, data, about)
        with served.writing:
            created = _created_before(served, author, request)  # by a concurrent request, since the check above
            entry = created or served.store.create(upload.content, author, now(), request)
    response = accepted(entry, upload, HTTPStatus.CREATED)
    response.headers["Location"] = f"/v1/{entry.kind.value}/{quote(entry.uid)}"
    return response


def _created_before(served: Serving, author: str, request: KeyedRequest | None) -> Entry | None:
    earlier = None if request is None else served.store.requested(author, request.key)
    if request is None or earlier is None:
        return None
    digest, uid = earlier
    if digest != request.digest:
        raise Problem(HTTPStatus.UNPROCESSABLE_ENTITY, "this Idempotency-Key was used for a different request")
    return served.store.entry(uid)


def accepted(entry: Entry, upload: Upload | None, status: HTTPStatus = HTTPStatus.OK) -> Response:
    """Build the response to an accepted upload."""
    diagnostics = [diagnostic_json(one) for one in upload.diagnostics] if upload else []
    body = {"entry": record(entry), "diagnostics": diagnostics}
    tag = entry.record_etag if status is HTTPStatus.CREATED else entry.etag  # of Location's record, or of the content
    return JSONResponse(body, int(status), {"ETag": tag})


def entry_of_kind(served: Serving, kind: Kind, uid: str) -> Entry:
    """Look up an entry of a kind. Raises NoSuchEntry."""
    entry = served.store.entry(uid)
    if entry.kind is not kind:
        raise NoSuchEntry(f"{uid} is not among the {kind.value}")
    return entry


@router.get("/{kind}/{uid}")
def read(kind: Kind, uid: str, served: Served, if_none_match: Annotated[str | None, Header()] = None) -> Response:
    """Read the record of an entry, without its content."""
    entry = entry_of_kind(served, kind, uid)
    headers = {"ETag": entry.record_etag}
    if _matches(if_none_match, entry.record_etag):
        return Response(status_code=HTTPStatus.NOT_MODIFIED, headers=headers)
    return JSONResponse(record(entry), headers=headers)


def _matches(header: str | None, etag: str) -> bool:
    """Check whether a list of entity tags contains a tag, or ``*``."""
    tags = _tags(header)
    return etag in tags or "*" in tags


def _tags(header: str | None) -> list[str]:
    return [tag.strip().removeprefix("W/") for tag in (header or "").split(",")]


@router.get("/{kind}/{uid}/content")
def content(
    kind: Kind,
    uid: str,
    request: Request,
    served: Served,
    revision: Annotated[int | None, Query(ge=1, lt=2**53)] = None,
) -> Response:
    """Download the ontology of a revision, by default the latest, in the syntax that Accept prefers."""
    entry = entry_of_kind(served, kind, uid)
    data = served.store.content(uid, revision)
    sha256 = hashlib.sha256(data).hexdigest()
    etag = f'"{revision or entry.revision.number}-{sha256[:16]}"'
    if _matches(request.headers.get("if-none-match"), etag):
        return Response(status_code=HTTPStatus.NOT_MODIFIED, headers={"ETag": etag})
    data, syntax = converted(data, uid, request.headers.get("accept"), entry.syntax, served.staff.reading)
    digest = hashlib.sha256(data).hexdigest()
    tag = etag if syntax is entry.syntax else f"W/{etag}"
    headers = {"ETag": tag, "Repr-Digest": digest_header(digest), "Vary": "Accept", **DOWNLOADED}
    return Response(data, media_type=syntax.value, headers=headers)


DOWNLOADED = {
    "X-Content-Type-Options": "nosniff",
    "Content-Security-Policy": "sandbox",
    "Content-Disposition": "attachment",
}
"""Headers of uploaded files, with which no browser renders them as a page."""


def expected(if_match: str | None, entry: Entry) -> str:
    """Tag of the content that a change expects. Raises Problem without If-Match, and Changed for another revision.

    The tag of the record is accepted, too: it contains the revision, and a new rating is no conflict.
    """
    if if_match is None:
        raise Problem(HTTPStatus.PRECONDITION_REQUIRED, "send the ETag of the revision that you change in If-Match")
    tags = _tags(if_match)
    revisions = {'"{}"'.format("-".join(tag.strip('"').split("-")[:2])) for tag in tags}
    if (entry.etag not in revisions and "*" not in tags) or if_match.strip().startswith("W/"):
        raise Changed(f"{entry.uid} is now {entry.etag}")
    return entry.etag


@router.put("/{kind}/{uid}/content", openapi_extra=UPLOADED)
def change(kind: Kind, uid: str, author: Author, served: Served, data: Body, if_match: IfMatch = None) -> Response:
    """Check an ontology and store it as the next revision of an entry of the author."""
    entry = entry_of_kind(served, kind, uid)
    own(entry, author)
    tag = expected(if_match, entry)
    upload = served.staff.checking.call(read_upload, kind, uid.partition(".")[2], data, entry.about)
    with served.writing:
        return accepted(served.store.change(uid, upload.content, author, tag, now()), upload)


def own(entry: Entry, author: str) -> None:
    """Check that an author owns an entry. Raises Problem otherwise."""
    if entry.author != author:
        raise Problem(HTTPStatus.FORBIDDEN, f"{entry.uid} is not yours")


@router.delete("/{kind}/{uid}", status_code=HTTPStatus.NO_CONTENT)
def delete(kind: Kind, uid: str, author: Author, served: Served, if_match: IfMatch = None) -> None:
    """Delete an entry of the author with all its revisions and files."""
    entry = entry_of_kind(served, kind, uid)
    own(entry, author)
    tag = expected(if_match, entry)
    with served.writing:
        served.store.delete(uid, author, tag, now())


@router.get("/{kind}/{uid}/revisions")
def revisions(kind: Kind, uid: str, served: Served) -> dict[str, Any]:
    """List the revisions of an entry, latest first."""
    entry_of_kind(served, kind, uid)
    return {"revisions": served.store.revisions(uid)}


class Rating(BaseModel):
    """A rating of an entry."""

    rating: Annotated[int, Field(ge=LOWEST_RATING, le=HIGHEST_RATING, strict=True)]


@router.put("/{kind}/{uid}/rating")
def rate(kind: Kind, uid: str, rating: Rating, author: Author, served: Served) -> dict[str, Any]:
    """Rate an entry; replaces the author's earlier rating."""
    entry_of_kind(served, kind, uid)
    with served.writing:
        return record(served.store.rate(uid, author, rating.rating, now()))


def record(entry: Entry) -> dict[str, Any]:
    """Record of an entry as JSON data, with the tag for If-Match."""
    return {**asdict(entry), "etag": entry.etag}


def digest_header(sha256: str) -> str:
    """Value of Repr-Digest (RFC 9530) for a SHA-256 in hexadecimal digits."""
    return f"sha-256=:{base64.b64encode(bytes.fromhex(sha256)).decode()}:"


def converted(data: bytes, uid: str, accept: str | None, syntax: Syntax, workers: Workers) -> tuple[bytes, Syntax]:
    """Convert a content to the syntax that an Accept header prefers, its own first; returns the syntax, too.

    Raises Problem if none of the available syntaxes is accepted.
    """
    for media_type in _media_types(accept):
        for target in (syntax, *Syntax):
            family = target.value.partition("/")[0]
            if media_type in ("*/*", f"{family}/*", target.value):
                if target is syntax:
                    return data, syntax
                return workers.call(convert, data, uid, target), target
    names = ", ".join(one.value for one in Syntax)
    raise Problem(HTTPStatus.NOT_ACCEPTABLE, f"Accept has to allow for one of {names}")


def convert(data: bytes, uid: str, syntax: Syntax, _: Vocabulary) -> bytes:
    """Convert a content to another syntax. Raises BadInput."""
    return convert_content(data, Path(uid), Target[syntax.name]).text.encode()


def _media_types(accept: str | None) -> list[str]:
    """Media types of an Accept header in descending order of quality."""
    weighted = []
    for part in (accept or "*/*").lower().split(","):
        media_type, *parameters = (one.strip() for one in part.split(";"))
        text = next((one[2:] for one in parameters if one.startswith("q=")), "1")
        try:
            quality = float(text)
        except ValueError:
            quality = 0.0
        if quality > 0:
            weighted.append((-quality, media_type))
    return [media_type for _, media_type in sorted(weighted, key=lambda one: one[0])]
