"""Text that strangers wrote, made safe to show: one line, no control characters, bounded, escaped for each format."""

from __future__ import annotations

import re
import unicodedata
from html import escape
from textwrap import wrap

LONGEST_LINE = 56
"""Characters of a line inside a box; what is longer is broken."""

MOST_LINES = 3
"""Lines that a text is broken into; what is longer is cut, and complete in the tooltip."""

INDENT = "\N{NO-BREAK SPACE}" * 4
"""Before the lines that continue one."""

LONGEST_TEXT = 2000
"""Characters of a tooltip."""

_SPACE = re.compile(r"\s+")
_HIDDEN = frozenset({"Cc", "Cf", "Cs", "Co", "Cn"})
"""Categories of what is not shown as itself: controls, marks that turn the writing direction, surrogates, ..."""

_PLAIN = frozenset(" _-.,/=+")


def shown(text: str, longest: int = LONGEST_TEXT) -> str:
    """The text on one line; characters that are not shown as themselves become ``\N{REPLACEMENT CHARACTER}``."""
    line = _SPACE.sub(" ", text).strip()
    line = "".join("\N{REPLACEMENT CHARACTER}" if unicodedata.category(c) in _HIDDEN else c for c in line)
    return line if len(line) <= longest else line[: longest - 1].rstrip() + "…"


def broken(text: str) -> list[str]:
    """The lines of a text inside a box, those after the first one indented; a bracket begins a line if one has to."""
    if len(text) <= LONGEST_LINE:
        return [text]
    head, bracket, tail = text.partition(" (")
    lines = [head, bracket.strip() + tail] if bracket else [text]
    parts = [part for line in lines for part in wrap(line, LONGEST_LINE - len(INDENT), break_on_hyphens=False)]
    if len(parts) > MOST_LINES:
        parts = [*parts[: MOST_LINES - 1], f"{parts[MOST_LINES - 1]} …"]
    return [*parts[:1], *(INDENT + part for part in parts[1:])]


def for_xml(text: str) -> str:
    """The text as content or attribute of an XML or HTML element."""
    return escape(text, quote=True)


def for_dot(text: str) -> str:
    """The text inside of a quoted string of Graphviz, which reads escapes and HTML entities in labels."""
    return text.replace("&", "&amp;").replace("\\", "\\\\").replace('"', '\\"')


def for_mermaid(text: str) -> str:
    """The text inside of a quoted label of Mermaid: what might be syntax or HTML is written by its number."""
    return "".join(c if c.isalnum() or c in _PLAIN else f"#{ord(c)};" for c in text)


_WIDTHS = (
    ("ijl|'!.,:;", 0.26),
    ("ft()[]/\\ \N{NO-BREAK SPACE}rI-", 0.34),
    ("mwMW@%", 0.88),
    ("ABCDEFGHJKLNOPQRSTUVXYZ&#", 0.70),
    ("…", 1.0),
)
_WIDTH_OF = {character: width for characters, width in _WIDTHS for character in characters}


def width(text: str, size: float) -> float:
    """About how wide a line of a sans-serif font of this size is, rather too much than too little [same unit]."""
    total = 0.0
    for character in text:
        if unicodedata.east_asian_width(character) in "WF":
            total += 1.05
        else:
            total += _WIDTH_OF.get(character, 0.57)
    return total * size
