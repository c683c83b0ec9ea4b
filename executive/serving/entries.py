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
from planlang.knowledge.entries import Request as Handed
from planlang.ontology.convert import Target, convert_content

router = APIRouter(prefix="/v1", tags=["entries"])

MOST_LISTED = 100
"""Entries of one answer."""

Limit = Annotated[int, Query(ge=1, le=MOST_LISTED)]
IfMatch = Annotated[str | None, Header()]
_ONTOLOGY: dict[str, Any] = {"application/rdf+xml": {}, "text/turtle": {}, "text/owl-manchester": {}}
UPLOADED: dict[str, Any] = {"requestBody": {"required": True, "content": _ONTOLOGY}}


@router.get("/{kind}")
def list_entries(kind: Kind, served: Served, after: str = "", limit: Limit = MOST_LISTED) -> dict[str, Any]:
    """Return the entries of a kind behind an identifier, and the identifier to go on behind."""
    return listing(served, served.catalogue.uids(kind, after, limit + 1), limit, record)


def listing(
    served: Serving, uids: tuple[str, ...], limit: int, shown: Callable[[Entry], dict[str, Any]]
) -> dict[str, Any]:
    """Return the records of the first entries of some; ``next`` is the last of them if there are more."""
    found = []
    for uid in uids[:limit]:
        try:
            found.append(shown(served.store.entry(uid)))
        except NoSuchEntry:  # deleted in the meantime
            continue
    return {"entries": found, "next": uids[limit - 1] if len(uids) > limit else None}


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
    """Check an ontology and keep it as a new entry of the author's.

    A request that is sent again with the same Idempotency-Key gives the entry that it made before.
    """
    digest = hashlib.sha256(repr((kind.value, name, about)).encode() + data).hexdigest()
    handed = None if idempotency_key is None else Handed(idempotency_key, digest)
    upload: Upload | None = None
    entry = _made_before(served, author, handed)
    if entry is None:
        upload = served.staff.checking.call(read_upload, kind, name, data, about)
        with served.writing:
            entry = _made_before(served, author, handed) or served.store.create(upload.content, author, now(), handed)
    answer = taken(entry, upload, HTTPStatus.CREATED)
    answer.headers["Location"] = f"/v1/{entry.kind.value}/{quote(entry.uid)}"
    return answer


def _made_before(served: Serving, author: str, handed: Handed | None) -> Entry | None:
    known = None if handed is None else served.store.requested(author, handed.key)
    if handed is None or known is None:
        return None
    digest, uid = known
    if digest != handed.digest:
        raise Problem(HTTPStatus.UNPROCESSABLE_ENTITY, "another request was sent with this Idempotency-Key")
    return served.store.entry(uid)


def taken(entry: Entry, upload: Upload | None, status: HTTPStatus = HTTPStatus.OK) -> Response:
    """Return what is answered to an upload that was taken."""
    diagnostics = [diagnostic_json(one) for one in upload.diagnostics] if upload else []
    body = {"entry": record(entry), "diagnostics": diagnostics}
    tag = entry.record_etag if status is HTTPStatus.CREATED else entry.etag  # of what Location names, or of the content
    return JSONResponse(body, int(status), {"ETag": tag})


def known(served: Serving, kind: Kind, uid: str) -> Entry:
    """Return an entry of a kind. Raises NoSuchEntry."""
    entry = served.store.entry(uid)
    if entry.kind is not kind:
        raise NoSuchEntry(f"{uid} is not among the {kind.value}")
    return entry


@router.get("/{kind}/{uid}")
def read(kind: Kind, uid: str, served: Served, if_none_match: Annotated[str | None, Header()] = None) -> Response:
    """Return what is known of an entry, without its content."""
    entry = known(served, kind, uid)
    headers = {"ETag": entry.record_etag}
    if _names(if_none_match, entry.record_etag):
        return Response(status_code=HTTPStatus.NOT_MODIFIED, headers=headers)
    return JSONResponse(record(entry), headers=headers)


def _names(header: str | None, etag: str) -> bool:
    """Return True if a list of tags has a tag, or all."""
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
    """Return the ontology of a revision, the last one unless told otherwise, in the syntax that Accept prefers."""
    entry = known(served, kind, uid)
    data = served.store.content(uid, revision)
    sha256 = hashlib.sha256(data).hexdigest()
    etag = f'"{revision or entry.revision.number}-{sha256[:16]}"'
    if _names(request.headers.get("if-none-match"), etag):
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
"""Headers of what strangers handed in: no browser shows it as a page."""


def expected(if_match: str | None, entry: Entry) -> str:
    """Return the tag of the content that a change names. Raises Problem without one, and Changed for another's.

    The tag of a record will do: it names the revision, too, and a rating by somebody else is no reason to refuse.
    """
    if if_match is None:
        raise Problem(HTTPStatus.PRECONDITION_REQUIRED, "a change names the revision that it changes: If-Match")
    tags = _tags(if_match)
    revisions = {'"{}"'.format("-".join(tag.strip('"').split("-")[:2])) for tag in tags}
    if (entry.etag not in revisions and "*" not in tags) or if_match.strip().startswith("W/"):
        raise Changed(f"{entry.uid} is now {entry.etag}")
    return entry.etag


@router.put("/{kind}/{uid}/content", openapi_extra=UPLOADED)
def change(kind: Kind, uid: str, author: Author, served: Served, data: Body, if_match: IfMatch = None) -> Response:
    """Check an ontology and keep it as the next revision of an entry of the author's."""
    entry = known(served, kind, uid)
    own(entry, author)
    tag = expected(if_match, entry)
    upload = served.staff.checking.call(read_upload, kind, uid.partition(".")[2], data, entry.about)
    with served.writing:
        return taken(served.store.change(uid, upload.content, author, tag, now()), upload)


def own(entry: Entry, author: str) -> None:
    """Raise Problem for an entry that is not the author's."""
    if entry.author != author:
        raise Problem(HTTPStatus.FORBIDDEN, f"{entry.uid} is not yours")


@router.delete("/{kind}/{uid}", status_code=HTTPStatus.NO_CONTENT)
def delete(kind: Kind, uid: str, author: Author, served: Served, if_match: IfMatch = None) -> None:
    """Delete an entry of the author's with all its revisions and files."""
    entry = known(served, kind, uid)
    own(entry, author)
    tag = expected(if_match, entry)
    with served.writing:
        served.store.delete(uid, author, tag, now())


@router.get("/{kind}/{uid}/revisions")
def revisions(kind: Kind, uid: str, served: Served) -> dict[str, Any]:
    """Return the revisions that are kept, last first."""
    known(served, kind, uid)
    return {"revisions": served.store.revisions(uid)}


class Rating(BaseModel):
    """A judgement of how good an entry is."""

    rating: Annotated[int, Field(ge=LOWEST_RATING, le=HIGHEST_RATING, strict=True)]


@router.put("/{kind}/{uid}/rating")
def rate(kind: Kind, uid: str, rating: Rating, author: Author, served: Served) -> dict[str, Any]:
    """Rate an entry, in the place of the author's earlier rating."""
    known(served, kind, uid)
    with served.writing:
        return record(served.store.rate(uid, author, rating.rating, now()))


def record(entry: Entry) -> dict[str, Any]:
    """Return an entry as JSON data, with the tag that a change of it has to name."""
    return {**asdict(entry), "etag": entry.etag}


def digest_header(sha256: str) -> str:
    """Return the value of Repr-Digest (RFC 9530) for a SHA-256 in hexadecimal digits."""
    return f"sha-256=:{base64.b64encode(bytes.fromhex(sha256)).decode()}:"


_TARGETS = {
    Syntax.RDFXML: Target.RDFXML,
    Syntax.TURTLE: Target.TURTLE,
    Syntax.MANCHESTER: Target.MANCHESTER,
}


def converted(data: bytes, uid: str, accept: str | None, syntax: Syntax, workers: Workers) -> tuple[bytes, Syntax]:
    """Return a content in the syntax that an Accept header prefers, its own before others, and which that is.

    Raises Problem if none that is written is accepted.
    """
    for wanted in _accepted(accept):
        for target in (syntax, *Syntax):
            family = target.value.partition("/")[0]
            if wanted in ("*/*", f"{family}/*", target.value):
                if target is syntax:
                    return data, syntax
                return workers.call(written, data, uid, target), target
    names = ", ".join(one.value for one in Syntax)
    raise Problem(HTTPStatus.NOT_ACCEPTABLE, f"an ontology is written as one of {names}")


def written(data: bytes, uid: str, syntax: Syntax, _: Vocabulary) -> bytes:
    """Return a content in another syntax. Raises BadInput."""
    return convert_content(data, Path(uid), _TARGETS[syntax]).text.encode()


def _accepted(accept: str | None) -> list[str]:
    """Return the media types that a header accepts, those of the highest quality first."""
    found = []
    for part in (accept or "*/*").lower().split(","):
        kind, *parameters = (one.strip() for one in part.split(";"))
        stated = next((one[2:] for one in parameters if one.startswith("q=")), "1")
        try:
            quality = float(stated)
        except ValueError:
            quality = 0.0
        if quality > 0:
            found.append((-quality, kind))
    return [kind for _, kind in sorted(found, key=lambda one: one[0])]
