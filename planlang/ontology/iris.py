"""References to things, made absolute."""

from __future__ import annotations

import re
from urllib.parse import urljoin

_SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*:")


def resolve(base: str, reference: str) -> str:
    """The IRI that a reference means in a document with this address; what has a scheme is left as it is."""
    if reference.startswith("#"):
        return base.partition("#")[0] + reference
    if not reference:
        return base.partition("#")[0]
    if _SCHEME.match(reference):
        return reference
    try:
        joined = urljoin(base, reference)
    except ValueError:
        return reference
    return joined + "#" if reference.endswith("#") and not joined.endswith("#") else joined  # urljoin drops it
