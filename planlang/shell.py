"""Words of command lines that messages show, quoted so that they can be copied into a shell."""

from __future__ import annotations

import shlex
from collections.abc import Iterable
from pathlib import Path


def quoted(word: object) -> str:
    """Quote a word for a POSIX shell; control characters, which a terminal would interpret, as ``$'\\n'``.

    A path that begins with a dash, which would be read as an option, is written from ``./``.
    """
    text = str(word)
    if isinstance(word, Path) and text.startswith("-"):
        text = f"./{text}"
    if text.isprintable():
        return shlex.quote(text)
    escaped = "".join(_escaped(letter) for letter in text)
    return f"$'{escaped}'"


def joined(words: Iterable[object]) -> str:
    """Join words to a command line, each quoted."""
    return " ".join(map(quoted, words))


def _escaped(letter: str) -> str:
    if letter in "\\'":
        return f"\\{letter}"
    if letter.isprintable():
        return letter
    return f"\\x{ord(letter):02x}" if ord(letter) < 0x80 else f"\\U{ord(letter):08x}"
