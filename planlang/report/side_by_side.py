"""One page with the pages of two runs beside each other, on one clock."""

from __future__ import annotations

import html
import json
import re

from planlang.records import dataclass
from planlang.report.html import PAGE, escaped, filled, hash_of

_POLICY = re.compile(r'Content-Security-Policy" content="([^"]*)"')
_HASH = re.compile(r"'sha256-[^']+'")


@dataclass(frozen=True, slots=True)
class Side:
    """The page of a run, and what it is called."""

    name: str
    page: str


def side_by_side(title: str, command: str, first: Side, second: Side, time: float) -> str:
    """Write the page of two runs; ``time`` [s] is the moment that both show when it opens. Equal pages, equal texts.

    The pages are whole, each in a frame; a policy allows their scripts and that of this page only.
    """
    style, script = ((PAGE / name).read_text(encoding="utf-8") for name in ("both.css", "both.js"))
    scripts, styles = [hash_of(script)], [hash_of(style)]
    for one in (first, second):
        policy = _POLICY.search(one.page)
        rules = {} if policy is None else dict(rule.strip().partition(" ")[::2] for rule in policy[1].split(";"))
        scripts += [each for each in _HASH.findall(rules.get("script-src", "")) if each not in scripts]
        styles += [each for each in _HASH.findall(rules.get("style-src", "")) if each not in styles]
    parts = {
        "policy": f"default-src 'none'; script-src {' '.join(scripts)}; style-src {' '.join(styles)}; "
        "frame-src 'self'; base-uri 'none'; form-action 'none'",
        "style": style,
        "script": script,
        "title": html.escape(title),
        "command": html.escape(command),
        "before": html.escape(first.name),
        "after": html.escape(second.name),
        "first": html.escape(first.page),
        "second": html.escape(second.page),
        "time": escaped(json.dumps(time)),
    }
    return filled((PAGE / "both.html").read_text(encoding="utf-8"), parts)
