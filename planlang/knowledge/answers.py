"""Responses of a knowledge-base server as typed values, parsed as untrusted input."""

from __future__ import annotations

import base64
import binascii
import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from enum import Enum
from functools import cache
from types import NoneType, UnionType
from typing import Any, get_args, get_origin, get_type_hints

from planlang.diagnostics import Diagnostic, Severity, Span
from planlang.knowledge.entries import Changed, Entry, EntryExists, News, NoSuchEntry, NotTheAuthor, Refused, is_uid
from planlang.records import dataclass
from planlang.visible import visible

Links = tuple[tuple[str, str], ...]
"""Pairs of a property and a class (IRIs)."""

LONGEST_TEXT = 10_000
"""Texts in a response are cut to this length [characters]."""
_FILE_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,99}")
_SHA256 = re.compile(r"[0-9a-f]{64}")
_DIGEST = re.compile(r"(?:^|[\s,])sha-256=:([A-Za-z0-9+/=]+):")


class NoAnswer(Exception):
    """The server cannot be reached or does not respond in time."""


class ProxyFails(NoAnswer):
    """The proxy on the way to the server does not respond, or refuses."""


class NotAsAgreed(Exception):
    """Not a knowledge-base response, or its digest does not match."""


class Declined(Refused):
    """The server refused a request; with its status, reason and diagnostics."""

    def __init__(self, status: int, detail: str, diagnostics: tuple[Diagnostic, ...] = ()) -> None:
        super().__init__(detail)
        self.status, self.diagnostics = status, diagnostics


class KeyNeeded(Declined):
    """The request needs a key, or its key is not valid."""


class TooMany(Declined):
    """The server accepts no more requests at the moment."""


class RefusedByChecks(Declined):
    """The upload or the query is invalid; the diagnostics say where."""


@dataclass(frozen=True, slots=True)
class Lack:
    """A component or capability that an entry needs and a robot lacks or may lack."""

    name: str
    reason: str = ""


@dataclass(frozen=True, slots=True)
class Found:
    """A search result; for a robot also whether it ``can`` use the entry (yes, no, unknown) and what is missing."""

    entry: Entry
    can: str | None = None
    missing: tuple[Lack, ...] = ()
    links: Links = ()
    """Links of the entry's subject, including those that its classes require."""


@dataclass(frozen=True, slots=True)
class Taken:
    """An accepted upload, with notes and warnings."""

    entry: Entry
    diagnostics: tuple[Diagnostic, ...] = ()


def as_json(body: bytes) -> Mapping[str, Any]:
    """Parse a body as a JSON object. Raises NotAsAgreed."""
    try:
        found = json.loads(body)
    except (ValueError, RecursionError):
        raise NotAsAgreed("not a knowledge-base response: it is not JSON") from None
    if not isinstance(found, dict):
        raise NotAsAgreed("not a knowledge-base response: it is not a JSON object")
    return found


def read_entry(data: object) -> Entry:
    """Parse an entry. Raises NotAsAgreed."""
    entry: Entry = read_as(Entry, data)
    names = [one.name for one in entry.attachments]
    digests = [entry.revision.sha256, *(one.sha256 for one in entry.attachments)]
    if not is_uid(entry.uid) or not all(map(_FILE_NAME.fullmatch, names)) or len(set(names)) < len(names):
        raise NotAsAgreed("an entry or one of its files has an invalid name")
    if not all(map(_SHA256.fullmatch, digests)):
        raise NotAsAgreed(f"{entry.uid} has an invalid digest")
    return entry


def read_found(data: object) -> Found:
    """Parse a search result. Raises NotAsAgreed."""
    record = data if isinstance(data, dict) else {}
    missing = read_as(tuple[Lack, ...], record.get("missing", []))
    pairs = read_as(tuple[tuple[str, ...], ...], record.get("links", []))
    if any(len(one) != 2 for one in pairs):
        raise NotAsAgreed("a link of an entry is not a pair of property and class")
    links = tuple((prop, target) for prop, target in pairs)
    return Found(read_entry(data), read_as(str | None, record.get("can")), missing, links)


def read_taken(data: Mapping[str, Any]) -> Taken:
    """Parse the response to an upload. Raises NotAsAgreed."""
    return Taken(read_entry(data.get("entry")), read_diagnostics(data))


def read_news(data: Mapping[str, Any]) -> tuple[tuple[News, ...], int]:
    """Parse lines of the feed, and the number after which the next request continues. Raises NotAsAgreed."""
    return read_as(tuple[News, ...], data.get("news")), read_as(int, data.get("next"))


def read_as(kind: Any, data: object) -> Any:
    """Convert JSON data to a type: dataclass, enum, tuple, optional, str or number. Raises NotAsAgreed."""
    if is_dataclass(kind):
        if not isinstance(data, dict):
            raise NotAsAgreed(f"{_shown(data)} is not of the type {kind.__name__}")  # type: ignore[union-attr]
        stated = ((name, hint) for name, hint, is_optional in _fields(kind) if name in data or not is_optional)  # type: ignore[arg-type]
        return kind(**{name: read_as(hint, data.get(name)) for name, hint in stated})  # type: ignore[operator]
    if get_origin(kind) is tuple:
        if not isinstance(data, list):
            raise NotAsAgreed(f"{_shown(data)} is not a list")
        return tuple(read_as(get_args(kind)[0], one) for one in data)
    if get_origin(kind) is UnionType:
        (other,) = (one for one in get_args(kind) if one is not NoneType)
        return None if data is None else read_as(other, data)
    if issubclass(kind, Enum):
        if data not in [one.value for one in kind]:
            raise NotAsAgreed(f"{_shown(data)} is not a valid {kind.__name__.lower()}")
        return kind(data)
    if kind is float and type(data) is int:
        return float(data)
    if type(data) is not kind:
        raise NotAsAgreed(f"{_shown(data)} is not of the type {kind.__name__}")
    return printed(data) if isinstance(data, str) else data


@cache
def _fields(kind: type[Any]) -> tuple[tuple[str, Any, bool], ...]:
    """List the fields of a dataclass: name, type, and whether there is a default."""
    hints = get_type_hints(kind)
    return tuple((one.name, hints[one.name], one.default is not MISSING) for one in fields(kind))


def _shown(data: object) -> str:
    return ascii(data)[:60] if not isinstance(data, dict | list) else type(data).__name__


def printed(text: str, breaks: str = "") -> str:
    """Make untrusted text safe for a terminal: bounded length, escapes for what is not displayed (:func:`visible`)."""
    return visible(text[:LONGEST_TEXT], breaks)


def read_diagnostics(data: Mapping[str, Any]) -> tuple[Diagnostic, ...]:
    """Parse the diagnostics of a response or problem document; invalid ones are skipped."""
    listed = data.get("diagnostics")
    found = (_diagnostic(one) for one in listed) if isinstance(listed, list) else ()
    return tuple(one for one in found if one is not None)


def _diagnostic(data: object) -> Diagnostic | None:
    if not isinstance(data, dict):
        return None
    code, message, file, help = (data.get(name) for name in ("code", "message", "file", "help"))
    line, column = (one if isinstance(one, int) else 1 for one in (data.get("line"), data.get("column")))
    try:
        severity = Severity(data.get("severity"))
    except ValueError:
        return None
    if not isinstance(code, str) or not isinstance(message, str):
        return None
    span = Span(printed(file), line, column) if isinstance(file, str) else None
    advice = printed(help, "\n") if isinstance(help, str) else None
    return Diagnostic(severity, printed(code), printed(message, "\n"), span, advice)


_REFUSALS: dict[int, type[Refused]] = {403: NotTheAuthor, 404: NoSuchEntry, 409: EntryExists, 412: Changed}
_DECLINED: dict[int, type[Declined]] = {401: KeyNeeded, 422: RefusedByChecks, 429: TooMany}


def refusal(status: int, body: bytes) -> Exception:
    """Convert an error response to an exception, with the reason from its problem document."""
    if 300 <= status < 400:
        return NotAsAgreed(f"the server redirects (status {status}); use the new address")
    try:
        problem = as_json(body)
    except NotAsAgreed:
        problem = {}
    stated = problem.get("detail") or problem.get("title")
    detail = printed(stated, "\n") if isinstance(stated, str) else f"status {status}"
    if status in _REFUSALS and problem:
        return _REFUSALS[status](detail)
    return _DECLINED.get(status, Declined)(status, detail, read_diagnostics(problem))


def check_digest(data: bytes, header: str | None, expected: str | None, name: str) -> None:
    """Compare the SHA-256 of data with a Repr-Digest header (RFC 9530) and a hex digest; raises NotAsAgreed."""
    digest = hashlib.sha256(data).digest()
    stated = _DIGEST.search(header or "")
    try:
        as_stated = stated is None or base64.b64decode(stated[1], validate=True) == digest
    except binascii.Error:
        as_stated = False
    if not as_stated or expected not in (None, digest.hex()):
        raise NotAsAgreed(f"{name} was damaged in transfer: its SHA-256 differs from the one that the server states")
