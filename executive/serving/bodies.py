"""Limits of request bodies: their size, whether stated in a header or not, and no compression."""

from __future__ import annotations

from http import HTTPStatus

from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from executive.serving.problems import problem_response

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
