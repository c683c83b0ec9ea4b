"""Request bodies of limited size, stated in a header or not, without compression; and the forms that browsers send."""

from __future__ import annotations

from dataclasses import field
from http import HTTPStatus
from typing import Annotated, Any
from urllib.parse import parse_qsl

from fastapi import Depends, Request
from python_multipart import FormParser
from python_multipart.exceptions import FormParserError
from python_multipart.multipart import parse_options_header
from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from executive.serving.problems import Problem, problem_response
from executive.serving.serving import Body
from planlang.records import dataclass

LARGEST_BODY = 16_000_000
"""Largest body [bytes]."""


class BoundedBodies:
    """Middleware that refuses compressed bodies, which could expand without limit, and bodies that are too large."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Refuse a request by its headers, or else count the bytes of its body."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        stated = headers.get("content-length", "")
        if headers.get("content-encoding", "identity").strip().lower() != "identity":
            detail = "compressed bodies are not supported; send the body without Content-Encoding"
            await problem_response(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, detail)(scope, receive, send)
        elif stated.isdecimal() and int(stated[:20]) > LARGEST_BODY:
            await problem_response(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, _too_large())(scope, receive, send)
        else:
            await self._app(scope, _counting(receive), send)


def _counting(receive: Receive) -> Receive:
    size = 0

    async def counted() -> Message:
        nonlocal size
        message = await receive()
        size += len(message.get("body", b""))
        if size > LARGEST_BODY:
            raise HTTPException(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, _too_large())
        return message

    return counted


def _too_large() -> str:
    return f"a body may have at most {LARGEST_BODY // 1_000_000} MB"


MOST_FIELDS = 50
_LIMITS = {"MAX_MEMORY_FILE_SIZE": LARGEST_BODY + 1, "MAX_FIELD_SIZE": LARGEST_BODY}
_PLAIN, _WITH_FILES = "application/x-www-form-urlencoded", "multipart/form-data"


@dataclass(frozen=True, slots=True)
class Form:
    """Fields of a form; ``files`` are the contents of chosen files, without fields in which no file was chosen."""

    fields: dict[str, str] = field(default_factory=dict)
    files: dict[str, bytes] = field(default_factory=dict)

    def text(self, name: str) -> str:
        """Text of a field, stripped; empty if there is no such field."""
        return self.fields.get(name, "").strip()


def read_form(data: bytes, content_type: str) -> Form:
    """Parse a request body as a form. Raises Problem if it is malformed or has another content type."""
    kind, options = parse_options_header(content_type)
    try:
        if kind == _PLAIN.encode():
            return Form(dict(parse_qsl(data.decode("latin-1"), True, errors="replace", max_num_fields=MOST_FIELDS)))
        if kind == _WITH_FILES.encode():
            return _with_files(data, options.get(b"boundary"))
    except (FormParserError, ValueError) as problem:
        raise Problem(HTTPStatus.BAD_REQUEST, f"malformed form: {problem}") from None
    raise Problem(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, f"send the form as {_PLAIN} or {_WITH_FILES}")


def _with_files(data: bytes, boundary: bytes | None) -> Form:
    """Parse a multipart form. Raises FormParserError."""
    form = Form()

    def name_of(part: Any) -> str:
        if len(form.fields) + len(form.files) >= MOST_FIELDS:
            raise FormParserError(f"more than {MOST_FIELDS} fields")
        return str((part.field_name or b"").decode(errors="replace"))

    def on_field(part: Any) -> None:
        form.fields[name_of(part)] = (part.value or b"").decode(errors="replace")

    def on_file(part: Any) -> None:
        part.file_object.seek(0)
        if part.file_name:
            form.files[name_of(part)] = part.file_object.read()

    parser = FormParser(_WITH_FILES, on_field, on_file, boundary=boundary, config=_LIMITS)
    parser.write(data)
    parser.finalize()
    return form


def _form(request: Request, data: Body) -> Form:
    return read_form(data, request.headers.get("content-type", ""))


Filled = Annotated[Form, Depends(_form)]
"""The form in the request's body."""
