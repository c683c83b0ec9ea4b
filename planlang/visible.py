"""Text of strangers as it may be printed or written: what would change the text around it is replaced by its escape.

Escape sequences of terminals, overrides of the direction of text, and characters without width make a line show
something else than it says; line separators begin lines that editors, and Python, number differently.
"""

from __future__ import annotations

import re
import unicodedata

_ESCAPE = re.compile(r"\\u([0-9a-f]{4})|\\U([0-9a-f]{8})")


def visible(text: str, breaks: str = "\n\t") -> str:
    r"""Replace characters that are not displayed by escapes such as ``\u202e``, which Python, TOML and Turtle know.

    These are all but letters, marks, numbers, punctuation, symbols, spaces, and the characters in ``breaks``. The
    result is a fixed point, so that text may pass here twice.
    """
    if text.isprintable():
        return text
    return "\n".join(map(_line, text.split("\n"))) if "\n" in breaks and "\n" in text else _line(text, breaks)


def meant(text: str) -> str:
    """Return the text of which :func:`visible` made this one, if that had no backslash."""
    return _ESCAPE.sub(lambda found: chr(int(found[1] or found[2], 16)), text)


def _line(text: str, breaks: str = "\t") -> str:
    return text if text.isprintable() else "".join(one if one in breaks else _escaped(one) for one in text)


def _escaped(one: str) -> str:
    code, is_shown = ord(one), one.isprintable() or unicodedata.category(one) == "Zs"
    return one if is_shown else f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"


def for_dot(text: str) -> str:
    """Escape text for a quoted string of Graphviz, which interprets escapes and HTML entities in labels."""
    return text.replace("&", "&amp;").replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")


_PLAIN = frozenset(" _-.,:/=+()")
"""Characters without a meaning in a label of Mermaid."""


def for_mermaid(text: str) -> str:
    """Quote text for a label of Mermaid; characters of its syntax or of HTML become character codes."""
    return "".join(
        char if char.isalnum() or char in _PLAIN else "<br/>" if char == "\n" else f"#{ord(char)};" for char in text
    )
