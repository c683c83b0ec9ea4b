"""The HTML page of a comparison, or of one sweep: tables, figures, and the worlds behind them with their commands.

All texts are escaped; the content security policy allows the page's own script and style only, and no requests.
"""

from __future__ import annotations

import html
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol
from urllib.parse import quote

from executive.sweeps.figures import Rows, figures, style_of
from executive.sweeps.records import is_reached
from executive.sweeps.table import cause_of
from planlang.report.html import PAGE, filled, hash_of
from planlang.visible import visible

Pages = Mapping[tuple[str, Any], Path]
"""Variant and seed -> page of that world."""
MOST_LISTED = 1000
"""Maximum number of worlds in a list."""


class Compared(Protocol):
    """What the page needs of a comparison: its texts, its rows, and its pairs as data."""

    @property
    def by_variant(self) -> Rows:
        """Rows of each variant."""

    def as_json(self) -> dict[str, Any]:
        """The comparison as JSON."""

    def _repr_html_(self) -> str: ...


def page(title: str, comparison: Compared, pages: Pages | None = None, beside: Path | None = None) -> str:
    """Write the page; equal comparisons give equal texts.

    ``pages`` of worlds are linked as files, relative to the folder ``beside``.
    """
    linked = _Links(pages or {}, beside or Path())
    rows, pairs = comparison.by_variant, comparison.as_json()["pairs"]
    tables = _wide(visible(comparison._repr_html_()))
    sections = [
        ("Results", f"{tables}<details><summary>In words</summary>{_pre(comparison)}</details>"),
        *((None, _figure(name, sheet.svg())) for name, sheet in figures(rows)),
        *((f"{one['second']} against {one['first']}: worlds that differ", _differing(one, linked)) for one in pairs),
        ("Worlds whose goal was not reached", _missed(rows, linked)),
    ]
    palette, own, theme, script = (
        (PAGE / name).read_text(encoding="utf-8") for name in ("palette.css", "compared.css", "theme.js", "compared.js")
    )
    style, script = f"{palette}{own}{style_of('figure')}\n", f'"use strict";\n{theme}{script}'
    policy = f"default-src 'none'; script-src {hash_of(script)}; style-src {hash_of(style)}; base-uri 'none'"
    content = "\n".join(
        f"<section>{'' if head is None else f'<h2>{_text(head)}</h2>'}{text}</section>"
        for head, text in sections
        if text
    )
    parts = {
        "policy": f"{policy}; form-action 'none'",
        "title": _text(title),
        "style": style,
        "content": content,
        "script": script,
    }
    return filled((PAGE / "compared.html").read_text(encoding="utf-8"), parts)


class _Links:
    """Links to the pages of worlds."""

    def __init__(self, pages: Pages, beside: Path) -> None:
        self._pages, self._beside = pages, beside

    def cell(self, variant: str, seed: Any) -> str:
        """A link to the page of a world; empty if it has none."""
        path = self._pages.get((variant, seed))
        if path is None:
            return ""
        target = quote(os.path.relpath(path, self._beside).replace(os.sep, "/"))
        return f'<a href="./{target}" aria-label="page of world {_text(seed)} of {_text(variant)}">page</a>'


def _figure(title: str, svg: str) -> str:
    return f'<div class="figure" role="img" aria-label="{_text(title)}">{svg}</div>'


def _differing(pair: Mapping[str, Any], linked: _Links) -> str:
    """Table of the worlds that only one of two variants reached."""
    names = pair["first"], pair["second"]
    found = [
        (
            _text(one["world"]),
            _text(one["reached_by"]),
            f"<code>{_text(one['repeat_first'])}</code><code>{_text(one['repeat_second'])}</code>",
            " ".join(filter(None, (linked.cell(name, one["world"]) for name in names))),
        )
        for one in pair["differing"]
    ]
    return _table(("world", "reached only by", "commands", "page"), found)


def _missed(rows: Rows, linked: _Links) -> str:
    """Table of the worlds whose goal was not reached."""
    head = ("world", "variant", "cause", "command", "page")
    found = [
        (
            _text(seed := row.get("seed", row["world"])),
            _text(name),
            _text(": ".join(filter(None, cause_of(row)))),
            f"<code>{_text(row.get('repeat', ''))}</code>",
            linked.cell(name, seed),
        )
        for name, own in rows.items()
        for row in own
        if not is_reached(row)
    ]
    return _table(head, found)


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table of HTML cells; empty without rows."""
    return _wide("".join(_table_parts(head, rows))) if rows else ""


def _table_parts(head: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[str]:
    yield f"<table><thead><tr>{''.join(f'<th>{one}</th>' for one in head)}</tr></thead><tbody>"
    for row in rows[:MOST_LISTED]:
        yield f"<tr>{''.join(f'<td>{one}</td>' for one in row)}</tr>"
    yield "</tbody></table>"
    if len(rows) > MOST_LISTED:
        yield f"<p>and {len(rows) - MOST_LISTED} more</p>"


def _wide(tables: str) -> str:
    """Tables that scroll sideways on a narrow screen, also by the keyboard."""
    return f'<div class="wide" tabindex="0">{tables}</div>'


def _pre(comparison: Compared) -> str:
    return f'<pre tabindex="0">{_text(comparison)}</pre>'


def _text(value: object) -> str:
    """A text as HTML, with what is not displayed as escapes."""
    return html.escape(visible(str(value)))
