"""Documents in BSON, the binary JSON of MongoDB's dumps (bsonspec.org)."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from typing import Any

DEEPEST = 50
"""Greatest depth of nested documents."""
_FIXED = {0x01: "<d", 0x10: "<i", 0x11: "<Q", 0x12: "<q"}
"""Types of a fixed size: numbers."""
_TEXTS = (0x02, 0x0D, 0x0E)
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def is_bson(content: bytes) -> bool:
    """Check whether a file begins with a document in BSON."""
    if len(content) < 12:
        return False
    (length,) = struct.unpack_from("<i", content)
    return 12 <= length <= len(content) and content[length - 1] == 0 and content[4] in (*_FIXED, *_TEXTS, 3, 4, 7, 8, 9)


def documents(content: bytes) -> Iterator[dict[str, Any]]:
    """Yield the documents of a dump. Raises ValueError if it is damaged or has types that are not data."""
    position = 0
    while position < len(content):
        try:
            document, position = _document(content, position, 0)
        except (struct.error, IndexError, OverflowError, UnicodeDecodeError) as problem:
            raise ValueError(f"damaged BSON at byte {position}: {problem}") from None
        yield document


def _document(content: bytes, start: int, depth: int) -> tuple[dict[str, Any], int]:
    (length,) = struct.unpack_from("<i", content, start)
    end, position = start + length, start + 4
    if depth > DEEPEST or length < 5 or end > len(content):
        raise ValueError(f"damaged BSON at byte {start}")
    fields: dict[str, Any] = {}
    while position < end - 1:
        kind, name_end = content[position], content.index(0, position + 1, end)
        name = content[position + 1 : name_end].decode()
        fields[name], position = _value(content, kind, name_end + 1, depth)
    return fields, end


def _value(content: bytes, kind: int, start: int, depth: int) -> tuple[Any, int]:
    if kind in _FIXED:
        return struct.unpack_from(_FIXED[kind], content, start)[0], start + struct.calcsize(_FIXED[kind])
    if kind in _TEXTS:
        (length,) = struct.unpack_from("<i", content, start)
        if length < 1:
            raise ValueError(f"damaged BSON at byte {start}")
        return content[start + 4 : start + 3 + length].decode(), start + 4 + length
    match kind:
        case 0x03:
            return _document(content, start, depth + 1)
        case 0x04:
            items, end = _document(content, start, depth + 1)
            return list(items.values()), end
        case 0x05:
            (length,) = struct.unpack_from("<i", content, start)
            return content[start + 5 : start + 5 + max(0, length)].hex(), start + 5 + max(0, length)
        case 0x07:
            return content[start : start + 12].hex(), start + 12
        case 0x08:
            return bool(content[start]), start + 1
        case 0x09:
            (milliseconds,) = struct.unpack_from("<q", content, start)
            return (_EPOCH + timedelta(milliseconds=milliseconds)).isoformat(timespec="milliseconds"), start + 8
        case 0x06 | 0x0A | 0x7F | 0xFF:
            return None, start
    raise ValueError(f"a type of BSON that is not data, {kind:#04x}, at byte {start}")
