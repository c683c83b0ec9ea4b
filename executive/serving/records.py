"""Entries and other things of a knowledge base as JSON."""

from __future__ import annotations

import base64
from dataclasses import asdict
from typing import Any

from planlang.knowledge.entries import Entry


def record(entry: Entry) -> dict[str, Any]:
    """Return an entry as JSON data, with the tag that a change of it has to name."""
    return {**asdict(entry), "etag": entry.etag}


def digest_header(sha256: str) -> str:
    """Return the value of Repr-Digest (RFC 9530) for a SHA-256 in hexadecimal digits."""
    return f"sha-256=:{base64.b64encode(bytes.fromhex(sha256)).decode()}:"
