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

from planlang.ontology.terms import BNode, Literal, Term
from planlang.ontology.triples import Triples

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


def fetch(content: bytes, file: str) -> Triples | None:
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


def keep(content: bytes, triples: Triples) -> None:
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


_COLUMNS = ("subjects", "predicates", "objects", "lines", "columns")


def _pack(triples: Triples) -> dict[str, Any]:
    """Terms and columns as JSON has them."""
    return {
        "label": triples.label,
        "terms": [_packed(term) for term in triples.terms],
        **{name: getattr(triples, name).tolist() for name in _COLUMNS},
    }


def _packed(term: Term | None) -> Any:
    match term:
        case BNode(label):
            return [label]
        case Literal(value, datatype, language):
            return [value, datatype, language]
        case _:
            return term


def _unpack(packed: dict[str, Any], file: str) -> Triples:
    triples = Triples(file, packed["label"])
    triples.terms = [
        term if term is None or isinstance(term, str) else BNode(*term) if len(term) == 1 else Literal(*term)
        for term in packed["terms"]
    ]
    triples.numbers = {term: number for number, term in enumerate(triples.terms) if term is not None}
    for name in _COLUMNS:
        getattr(triples, name).extend(packed[name])
    return triples
