"""Parsed files of the bundled vocabulary, kept in the user's cache folder.

An entry is named by a digest of the file's content and of the reader's source, so it never needs to be invalidated. It
begins with a digest of itself; whatever does not match is ignored and written anew. Without a writable folder nothing
is kept.
"""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

from planlang.diagnostics import Span
from planlang.ontology.terms import BNode, Literal, Term, Triple

LARGEST_ENTRY = 50_000_000
"""Bytes; a larger file in the cache folder is none of ours."""


MOST_ENTRIES = 100
"""Entries that are kept."""


def folder() -> Path | None:
    """Where entries are kept, whether it exists or not; None if the user has no home."""
    root = os.environ.get("XDG_CACHE_HOME")
    if root and Path(root).is_absolute():
        return Path(root) / "planlang" / "ontology"
    try:
        return Path.home() / ".cache" / "planlang" / "ontology"
    except RuntimeError:
        return None


def fetch(content: bytes, file: str) -> list[Triple] | None:
    """The triples of a file with this content, their positions in ``file``; None if they are not kept."""
    entry = _entry(content)
    if entry is None:
        return None
    try:
        if entry.stat().st_size > LARGEST_ENTRY:
            return None
        digest, _, payload = entry.read_bytes().partition(b"\n")
        if hashlib.sha256(payload).hexdigest().encode() != digest:
            return None
        return _unpack(json.loads(payload), file)
    except (OSError, ValueError, KeyError, IndexError, TypeError, RecursionError):
        return None


def keep(content: bytes, triples: list[Triple]) -> None:
    """Keep the triples for the next run; another process that does the same at the same time does no harm."""
    entry = _entry(content)
    if entry is None:
        return
    payload = json.dumps(_pack(triples), ensure_ascii=False, separators=(",", ":")).encode()
    temporary: str | None = None
    try:
        entry.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(prefix=entry.stem, dir=entry.parent)
        with os.fdopen(handle, "wb") as file:
            file.write(hashlib.sha256(payload).hexdigest().encode() + b"\n" + payload)
        os.replace(temporary, entry)
        _forget_oldest(entry.parent)
    except OSError:
        if temporary is not None:
            Path(temporary).unlink(missing_ok=True)


def _forget_oldest(place: Path) -> None:
    """Keep the cache small: what earlier versions of files and of the reader left is dropped first."""
    entries = sorted(place.glob("*.json"), key=lambda path: path.stat().st_mtime)
    for path in entries[:-MOST_ENTRIES]:
        path.unlink(missing_ok=True)


def _entry(content: bytes) -> Path | None:
    place = folder()
    if place is None:
        return None
    return place / f"{hashlib.sha256(_reader() + content).hexdigest()}.json"


@cache
def _reader() -> bytes:
    """Digest of the source of everything that shapes the triples."""
    here = Path(__file__).parent
    digest = hashlib.sha256()
    for path in sorted([*here.glob("*.py"), *here.glob("*.lark")]):
        digest.update(path.read_bytes())
    return digest.digest()


def _pack(triples: list[Triple]) -> dict[str, Any]:
    """Terms once each, and five numbers for every triple."""
    numbers: dict[Term, int] = {}
    terms: list[Any] = []
    rows: list[int] = []

    def number(term: Term) -> int:
        if term not in numbers:
            numbers[term] = len(terms)
            match term:
                case BNode(label):
                    terms.append([label])
                case Literal(value, datatype, language):
                    terms.append([value, datatype, language])
                case _:
                    terms.append(term)
        return numbers[term]

    for triple in triples:
        rows += (number(triple.subject), number(triple.predicate), number(triple.object))
        rows += (triple.span.line, triple.span.column)
    return {"terms": terms, "rows": rows}


def _unpack(packed: dict[str, Any], file: str) -> list[Triple]:
    terms: list[Any] = [
        term if isinstance(term, str) else BNode(*term) if len(term) == 1 else Literal(*term)
        for term in packed["terms"]
    ]
    rows = iter(packed["rows"])
    spans: dict[tuple[int, int], Span] = {}
    triples = []
    for subject, predicate, value, line, column in zip(rows, rows, rows, rows, rows, strict=True):
        span = spans.get((line, column))
        if span is None:
            span = spans[line, column] = Span(file, line, column)
        triples.append(Triple(terms[subject], terms[predicate], terms[value], span))
    return triples
