"""Routes of files that belong to entries: pictures of maps, meshes, recognition models."""

from __future__ import annotations

import re
from http import HTTPStatus
from typing import Annotated, Any

from fastapi import APIRouter, Header, Path, Request, Response

from executive.serving.entries import DOWNLOADED, digest_header, own, record
from executive.serving.problems import Problem
from executive.serving.serving import Author, Body, Served, now
from planlang.knowledge.entries import File

router = APIRouter(prefix="/v1/binaries", tags=["binaries"])

_MEDIA_TYPE = re.compile(r"[\w.+-]{1,60}/[\w.+-]{1,60}", re.ASCII)
Name = Annotated[str, Path(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,99}$")]
"""A file name without directories."""
_FILE: dict[str, Any] = {"requestBody": {"required": True, "content": {"application/octet-stream": {}}}}


@router.get("/{uid}/{name}")
def download(uid: str, name: Name, served: Served, if_none_match: Annotated[str | None, Header()] = None) -> Response:
    """Download a file of an entry."""
    attachment, data = served.store.attachment(uid, name)
    etag = f'"{attachment.sha256[:16]}"'
    if if_none_match == etag:
        return Response(status_code=HTTPStatus.NOT_MODIFIED, headers={"ETag": etag})
    headers = {"ETag": etag, "Repr-Digest": digest_header(attachment.sha256), **DOWNLOADED}
    return Response(data, media_type=attachment.media_type, headers=headers)


@router.put("/{uid}/{name}", openapi_extra=_FILE)
def attach(uid: str, name: Name, author: Author, served: Served, data: Body, request: Request) -> dict[str, Any]:
    """Attach a file to an entry of the author, replacing one of the same name."""
    own(served.store.entry(uid), author)
    media_type = request.headers.get("content-type", "application/octet-stream").partition(";")[0].strip()
    if not _MEDIA_TYPE.fullmatch(media_type):
        raise Problem(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, f"{media_type[:100]!r} is not a media type")
    with served.writing:
        served.store.attach(uid, File(name, media_type, data), author, now())
        return record(served.store.entry(uid))


@router.delete("/{uid}/{name}", status_code=HTTPStatus.NO_CONTENT)
def detach(uid: str, name: Name, author: Author, served: Served) -> None:
    """Delete a file of an entry of the author."""
    own(served.store.entry(uid), author)
    with served.writing:
        served.store.detach(uid, name, author, now())
