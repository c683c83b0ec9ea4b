"""Words and brackets of a SPARQL question, without reading it: for what its engine does not refuse well."""

from __future__ import annotations

import re
from collections.abc import Iterator

DEEPEST = 200
"""Brackets inside each other, and signs such as ``!`` in a row; the engine's stack ends at some thousand."""

_TOKEN = re.compile(
    r"""(?P<passed>\#[^\n\r]*                                  # a comment
    |<[^<>"{}|^`\\\x00-\x20]*>                                 # an IRI
    |\"\"\"(?:[^"\\]|\\.|"(?!""))*\"\"\"|'''(?:[^'\\]|\\.|'(?!''))*'''
    |"(?:[^"\\\n\r]|\\.)*"|'(?:[^'\\\n\r]|\\.)*'               # texts
    |[?$]\w+|[\w.-]*:[\w.:%-]*|@[\w-]+)                        # variables, names with a prefix, languages
    |(?P<open>[({\[])|(?P<close>[)}\]])|(?P<sign>[!+^-])|(?P<word>\w+)|(?P<other>[^\s])""",
    re.VERBOSE | re.DOTALL,
)


def words(question: str) -> Iterator[str]:
    """Yield the words of a question in capitals that are no names, variables, IRIs, texts or comments."""
    return (found["word"].upper() for found in _TOKEN.finditer(question) if found["word"])


def is_too_deep(question: str) -> bool:
    """Return True for more brackets inside each other, or more signs in a row, than the engine can read."""
    depth = signs = 0
    for found in _TOKEN.finditer(question):
        signs = signs + 1 if found["sign"] else 0
        depth += bool(found["open"]) - bool(found["close"])
        if max(depth, signs) > DEEPEST:
            return True
    return False
