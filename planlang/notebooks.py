"""How results show themselves in a notebook: sources with colours, pages in a frame, diagnostics and rows as tables."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

from planlang.diagnostics import Diagnostic, Severity

_COLOURS = {Severity.ERROR: "#c62828", Severity.WARNING: "#b26a00", Severity.NOTE: "#00796b"}
HEIGHT = 720
"""Height of a page in its frame [pixels]."""


def highlighted(source: str) -> str:
    """Return Python source as HTML with colours, which need no style sheet."""
    from pygments import highlight  # plans that run in no notebook do not need it
    from pygments.formatters import HtmlFormatter
    from pygments.lexers import PythonLexer

    # a grey behind the text would be unreadable in a dark notebook, whose own text is light
    formatter = HtmlFormatter(noclasses=True, style="default", cssstyles="background: #f8f8f8; color: #1b1b1b")
    return str(highlight(source, PythonLexer(), formatter))


def framed(page: str, title: str) -> str:
    """Return a whole HTML page in a frame of its own; its scripts run, and reach nothing of the notebook."""
    attributes = f'title="{escape(title)}" width="100%" height="{HEIGHT}" style="border: 0" sandbox="allow-scripts"'
    return f'<iframe {attributes} srcdoc="{escape(page)}"></iframe>'


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return rows as an HTML table; everything in it is text."""
    cells = "".join(f"<th>{escape(one)}</th>" for one in head)
    body = "".join(f"<tr>{''.join(f'<td>{escape(str(one))}</td>' for one in row)}</tr>" for row in rows)
    return f"<table><thead><tr>{cells}</tr></thead><tbody>{body}</tbody></table>"


def listed(diagnostics: Iterable[Diagnostic]) -> str:
    """Return diagnostics as an HTML list, in their order, with colours by severity."""
    items = "".join(_item(one) for one in diagnostics)
    return f'<ul style="list-style: none; padding-left: 0">{items}</ul>' if items else ""


def _item(one: Diagnostic) -> str:
    label = f'<b style="color: {_COLOURS[one.severity]}">{one.severity.value} {one.code}</b>'
    where = f"<code>{escape(str(one.span))}</code>: " if one.span else ""
    advice = f"<br><i>help: {escape(one.help)}</i>" if one.help else ""
    return f"<li>{where}{label} {escape(one.message)}{advice}</li>"
