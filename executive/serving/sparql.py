"""SPARQL queries by the SPARQL 1.1 Protocol; each entry is a named graph ``urn:entry:UID``."""

from __future__ import annotations

from http import HTTPStatus
from typing import Annotated, Any
from urllib.parse import parse_qs

from fastapi import APIRouter, Query, Request, Response
from fastapi.responses import JSONResponse, PlainTextResponse

from executive.serving.mirror import Mirror
from executive.serving.problems import Problem
from executive.serving.serving import Body, Served
from planlang.knowledge.sparql import Exceeded, NoAnswer

router = APIRouter(prefix="/v1/sparql", tags=["sparql"])

LONGEST = 100_000
"""Longest query [characters]."""
MOST_FIELDS = 10
"""Most fields of a form; the protocol's fields for default and named graphs are ignored."""
_RESULTS = "application/sparql-results+json"
_QUERY = "application/sparql-query"
_FORM = "application/x-www-form-urlencoded"
_FIELDS = {"type": "object", "properties": {"query": {"type": "string"}}, "required": ["query"]}
_ASKED: dict[str, Any] = {
    "requestBody": {"required": True, "content": {_QUERY: {"schema": {"type": "string"}}, _FORM: {"schema": _FIELDS}}}
}


@router.get("", response_model=None)
def ask(served: Served, query: Annotated[str, Query(max_length=LONGEST)]) -> Response:
    """Answer a SPARQL 1.1 query: SELECT and ASK in SPARQL's JSON format, CONSTRUCT and DESCRIBE as N-Triples."""
    return _answer(served.mirror, query)


@router.post("", response_model=None, openapi_extra=_ASKED)
def ask_in_body(request: Request, served: Served, body: Body) -> Response:
    """Answer the query in the body, as application/sparql-query or as the field ``query`` of a form."""
    kind = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if kind not in (_QUERY, _FORM):
        raise Problem(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, f"send the query as {_QUERY}; updates are not possible")
    if len(body) > LONGEST:
        raise Problem(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, f"a query may have at most {LONGEST:,} characters")
    try:
        text = body.decode()
    except UnicodeDecodeError:
        raise Problem(HTTPStatus.BAD_REQUEST, "the query is not UTF-8 text") from None
    return _answer(served.mirror, text if kind == _QUERY else _query_of(text))


def _query_of(form: str) -> str:
    try:
        (question,) = parse_qs(form, errors="strict", max_num_fields=MOST_FIELDS).get("query", [])
    except ValueError:
        raise Problem(HTTPStatus.BAD_REQUEST, "send one field query=...; updates are not possible") from None
    return question


def _answer(mirror: Mirror, question: str) -> Response:
    try:
        result = mirror.ask(question)
    except NoAnswer as problem:
        raise Problem(
            HTTPStatus.BAD_REQUEST, f"this is not a valid SELECT, ASK, CONSTRUCT or DESCRIBE query: {problem}"
        ) from None
    except Exceeded as problem:
        raise Problem(HTTPStatus.SERVICE_UNAVAILABLE, str(problem)) from None
    if "triples" in result:
        text = "".join(f"{line}\n" for line in result["triples"])
        return PlainTextResponse(text, media_type="application/n-triples")
    return JSONResponse(result, media_type=_RESULTS)
