"""Render pages from templates that escape uploaded text, with headers that let no foreign script run."""

from __future__ import annotations

from collections.abc import Callable, Coroutine, Sequence
from hashlib import sha256
from http import HTTPStatus
from pathlib import Path
from typing import Any

from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.responses import HTMLResponse
from fastapi.routing import APIRoute
from jinja2 import Environment, FileSystemLoader, StrictUndefined

from executive.serving.problems import REFUSALS, Refusal, problem_response, refusal
from planlang.designators import local_name
from planlang.diagnostics import Diagnostic
from planlang.knowledge.entries import Kind

_HERE = Path(__file__).parent
HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; "
    "connect-src 'self'; form-action 'self'; base-uri 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-cache",
}
"""Headers of every page: scripts and styles only from this server, no requests elsewhere, no frames on other sites."""

_MEDIA_TYPES = {".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}
FILES = {
    path.name: (path.read_bytes(), _MEDIA_TYPES[path.suffix])
    for path in sorted((_HERE / "static").iterdir())
    if path.suffix in _MEDIA_TYPES
}
"""Content and media type of the files that pages use, by name."""
_VERSION = sha256(b"".join(content for content, _ in FILES.values())).hexdigest()[:12]

_templates = Environment(
    loader=FileSystemLoader(_HERE / "templates"),
    autoescape=True,
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
)
_templates.globals |= {"kinds": tuple(Kind), "version": _VERSION}
_templates.filters |= {
    "local_name": local_name,
    "when": lambda time: time.replace("T", " ").removesuffix("Z") + " UTC",
    "bytes": lambda size: f"{size:,} bytes" if size < 10_000 else f"{size / 1000:,.0f} kB",
}


def page(name: str, status: HTTPStatus = HTTPStatus.OK, **shown: Any) -> Response:
    """Render a template."""
    return HTMLResponse(_templates.get_template(f"{name}.html").render(shown), int(status), HEADERS)


class PageRoute(APIRoute):
    """A route whose errors are rendered as pages, too."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Wrap the handler, so that errors become pages."""
        handle = super().get_route_handler()

        async def handled(request: Request) -> Response:
            try:
                return await handle(request)
            except REFUSALS as problem:
                return _refused(*refusal(problem))
            except RequestValidationError as problem:
                return _refused(HTTPStatus.UNPROCESSABLE_ENTITY, "; ".join(one["msg"] for one in problem.errors()))

        return handled


def status_of(problem: Refusal | None) -> HTTPStatus:
    """Status of a form that is shown again: 401 and 403 are kept, everything else is 200."""
    status = HTTPStatus.OK if problem is None else refusal(problem)[0]
    return status if status in (HTTPStatus.UNAUTHORIZED, HTTPStatus.FORBIDDEN) else HTTPStatus.OK


def add_pages(app: FastAPI) -> None:
    """Let an application answer unknown paths with a page, except for those of the API."""

    @app.exception_handler(HTTPStatus.NOT_FOUND)
    def not_found(request: Request, problem: Exception) -> Response:
        if request.url.path.startswith("/v1/"):
            return problem_response(HTTPStatus.NOT_FOUND, getattr(problem, "detail", HTTPStatus.NOT_FOUND.phrase))
        return _refused(HTTPStatus.NOT_FOUND, "there is no page at this address")


def _refused(status: HTTPStatus, reason: str, diagnostics: Sequence[Diagnostic] = ()) -> Response:
    return page("problem", status, title=status.phrase, reason=reason, diagnostics=diagnostics)
