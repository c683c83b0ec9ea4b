"""HTML for results in a notebook: highlighted source, pages in frames, lists of diagnostics, tables."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

from planlang.diagnostics import Diagnostic, Severity

_COLOURS = {Severity.ERROR: "#c62828", Severity.WARNING: "#b26a00", Severity.NOTE: "#00796b"}
HEIGHT = 720
"""Height of a page in its frame [pixels]."""


def highlighted(source: str) -> str:
    """Highlight Python source as HTML with inline colours."""
    from pygments import formatters, highlight, lexers  # needed in notebooks only, and each run imports this file

    # set text and background together: the light text of a dark notebook would be unreadable on this grey
    formatter = formatters.HtmlFormatter(
        noclasses=True, style="default", cssstyles="background: #f8f8f8; color: #1b1b1b"
    )
    return str(highlight(source, lexers.PythonLexer(), formatter))


def framed(page: str, title: str) -> str:
    """Embed an HTML page in a sandboxed frame: its scripts run without access to the notebook."""
    attributes = f'title="{escape(title)}" width="100%" height="{HEIGHT}" style="border: 0" sandbox="allow-scripts"'
    return f'<iframe {attributes} srcdoc="{escape(page)}"></iframe>'


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Format rows as an HTML table, with every cell escaped; a column may have no head."""
    cells = "".join(f"<th>{escape(one)}</th>" if one else "<td></td>" for one in head)
    body = "".join(f"<tr>{''.join(f'<td>{escape(str(one))}</td>' for one in row)}</tr>" for row in rows)
    return f"<table><thead><tr>{cells}</tr></thead><tbody>{body}</tbody></table>"


def listed(diagnostics: Iterable[Diagnostic]) -> str:
    """Format diagnostics as an HTML list, coloured by severity."""
    items = "".join(_item(one) for one in diagnostics)
    return f'<ul style="list-style: none; padding-left: 0">{items}</ul>' if items else ""


def _item(one: Diagnostic) -> str:
    label = f'<b style="color: {_COLOURS[one.severity]}">{one.severity.value} {one.code}</b>'
    where = f"<code>{escape(str(one.span))}</code>: " if one.span else ""
    advice = f"<br><i>help: {escape(one.help)}</i>" if one.help else ""
    return f"<li>{where}{label} {escape(one.message)}{advice}</li>"
