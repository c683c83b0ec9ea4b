"""Problem documents (RFC 9457), which include the compiler's diagnostics."""

from __future__ import annotations

from collections.abc import Iterable
from http import HTTPStatus
from typing import Any

from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect

from executive.serving.workers import Busy
from planlang.diagnostics import BadInput, Diagnostic, Span
from planlang.knowledge.entries import (
    Changed,
    EntryExists,
    Full,
    NoSuchEntry,
    NotTheAuthor,
    OwnEntry,
    Refused,
    Unreachable,
)
from planlang.words import COMMAND_LINE

MEDIA_TYPE = "application/problem+json"

_REFUSALS: dict[type[Refused], HTTPStatus] = {
    NoSuchEntry: HTTPStatus.NOT_FOUND,
    EntryExists: HTTPStatus.CONFLICT,
    NotTheAuthor: HTTPStatus.FORBIDDEN,
    OwnEntry: HTTPStatus.FORBIDDEN,
    Changed: HTTPStatus.PRECONDITION_FAILED,
}

_HEADERS = {
    HTTPStatus.UNAUTHORIZED: {"WWW-Authenticate": "Bearer"},
    HTTPStatus.SERVICE_UNAVAILABLE: {"Retry-After": "5"},
    HTTPStatus.TOO_MANY_REQUESTS: {"Retry-After": "5"},
}


_TEXT = {"type": ["string", "null"]}
_NUMBER = {"type": ["integer", "null"]}
_DIAGNOSTIC = {
    "type": "object",
    "required": ["severity", "code", "message"],
    "properties": {
        "severity": {"enum": ["error", "warning", "note"]},
        **{name: {"type": "string"} for name in ("code", "message")},
        **dict.fromkeys(("file", "help"), _TEXT),
        **dict.fromkeys(("line", "column"), _NUMBER),
    },
}
_PROBLEM = {
    "type": "object",
    "required": ["type", "title", "status", "detail", "diagnostics"],
    "properties": {
        **{name: {"type": "string"} for name in ("type", "title", "detail")},
        "status": {"type": "integer"},
        "diagnostics": {"type": "array", "items": _DIAGNOSTIC},
    },
}
RESPONSES: dict[int | str, dict[str, Any]] = {
    status: {"description": description, "content": {MEDIA_TYPE: {"schema": _PROBLEM}}}
    for status, description in {
        "4XX": "The request is refused for this reason",
        "422": "The request is malformed, or the checks found these errors in its content",
        "503": "The store is unavailable, or the request exceeds a limit",
    }.items()
}
"""Error responses common to all routes, for the OpenAPI document."""


class Problem(Exception):
    """A request is refused, with this status and reason."""

    def __init__(self, status: HTTPStatus, detail: str) -> None:
        super().__init__(detail)
        self.status, self.detail = status, detail


def diagnostic_json(diagnostic: Diagnostic) -> dict[str, Any]:
    """Diagnostic as JSON data, with file, line and column as separate values."""
    diagnostic = diagnostic.said(COMMAND_LINE)  # who asks a server has the command line, or a browser
    span = diagnostic.span or Span("", 0, 0)
    return {
        "severity": diagnostic.severity.value,
        "code": diagnostic.code,
        "message": diagnostic.message,
        "file": span.file or None,
        "line": span.line or None,
        "column": span.column or None,
        "help": diagnostic.help,
    }


def problem_response(status: HTTPStatus, detail: str, diagnostics: Iterable[Diagnostic] = ()) -> Response:
    """Build the problem document for a status and a reason."""
    listed = [diagnostic_json(one) for one in diagnostics]
    body = {"type": "about:blank", "title": status.phrase, "status": int(status), "detail": detail}
    return JSONResponse({**body, "diagnostics": listed}, int(status), _HEADERS.get(status), MEDIA_TYPE)


Refusal = Problem | Refused | Unreachable | Busy | BadInput
REFUSALS = (Problem, Refused, Unreachable, Busy, BadInput)
"""Exceptions with which requests are refused."""


def refusal(problem: Refusal) -> tuple[HTTPStatus, str, tuple[Diagnostic, ...]]:
    """Map an exception to status, reason and diagnostics."""
    if isinstance(problem, Problem):
        return problem.status, problem.detail, ()
    if isinstance(problem, Refused):
        return _REFUSALS.get(type(problem), HTTPStatus.CONFLICT), str(problem), ()
    if isinstance(problem, Full):
        return HTTPStatus.INSUFFICIENT_STORAGE, str(problem), ()
    if isinstance(problem, Unreachable):
        return HTTPStatus.SERVICE_UNAVAILABLE, str(problem), ()
    if isinstance(problem, Busy):
        return HTTPStatus.TOO_MANY_REQUESTS, str(problem), ()
    errors = sum(one.severity.value == "error" for one in problem.diagnostics)
    detail = f"the checks found {errors} error{'s' if errors != 1 else ''}"
    return HTTPStatus.UNPROCESSABLE_ENTITY, detail, problem.diagnostics


def add_handlers(app: FastAPI) -> None:
    """Let an application answer errors with problem documents."""

    @app.exception_handler(Problem)
    @app.exception_handler(Refused)
    @app.exception_handler(Unreachable)
    @app.exception_handler(Busy)
    @app.exception_handler(BadInput)
    def refused(_: Request, problem: Refusal) -> Response:
        response = problem_response(*refusal(problem))
        if isinstance(problem, Busy):
            response.headers["Retry-After"] = str(problem.seconds)
        return response

    @app.exception_handler(RequestValidationError)
    def malformed(_: Request, problem: RequestValidationError) -> Response:
        reasons = (f"{'.'.join(map(str, one['loc'][1:]))}: {one['msg']}" for one in problem.errors())
        return problem_response(HTTPStatus.UNPROCESSABLE_ENTITY, "; ".join(reasons))

    @app.exception_handler(HTTPException)
    def other(_: Request, problem: HTTPException) -> Response:
        response = problem_response(HTTPStatus(problem.status_code), str(problem.detail))
        response.headers.update(problem.headers or {})
        return response

    @app.exception_handler(ClientDisconnect)
    def gone(_: Request, __: ClientDisconnect) -> Response:
        return problem_response(HTTPStatus.REQUEST_TIMEOUT, "the connection was closed before the end of the body")

    @app.exception_handler(Exception)
    def failed(_: Request, __: Exception) -> Response:
        return problem_response(HTTPStatus.INTERNAL_SERVER_ERROR, "internal error; the server's log has the details")
