"""The HTML file: template, style and scripts of ``page/`` with the data of a model.

Untrusted text is embedded as JSON in an element that no browser executes, with ``<`` escaped, and the scripts insert it
as text. The content security policy forbids all requests, and all scripts except two that it lists by hash: the page's
own, and three.js, which is compressed in the file.
"""

from __future__ import annotations

import base64
import gzip
import hashlib
import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

PAGE = Path(__file__).parent / "page"
SCRIPTS = (
    *("theme", "model", "clock", "list", "tree", "details", "failures", "notes", "story"),
    *("search", "lanes", "tracks", "scene", "aim", "legend", "map", "graph", "keys", "live", "main"),
)
"""Files of the page's script in order of dependence."""
SERVED = "; connect-src 'self'"
"""Addition to the content security policy for a page of a running plan, which polls its server for updates."""
THREE = PAGE / "three.js.gz"


def page(model: Mapping[str, Any], blobs: Mapping[str, bytes] | None = None) -> str:
    """Write the page of a model; ``blobs`` are binary data compressed with zlib, by the names that the model uses.

    It contains three.js only if the model has a scene. Equal models give equal texts.
    """
    template, style, script = _sources()
    hashes, data = [hash_of(script)], ""
    if model.get("scene"):
        packed, three = _three()
        hashes.append(three)
        data += _blob("three", packed)
    for name, blob in (blobs or {}).items():
        data += _blob(name, blob)
    policy = (
        f"default-src 'none'; script-src {' '.join(hashes)}; style-src {hash_of(style)}; base-uri 'none'; "
        f"form-action 'none'{SERVED if model.get('live') else ''}"
    )
    parts = {
        "policy": policy,
        "style": style,
        "model": escaped(json.dumps(model, ensure_ascii=False, separators=(",", ":"))),
        "data": data,
        "script": script,
    }
    return filled(template, parts)


def filled(template: str, parts: Mapping[str, str]) -> str:
    """Put parts into a template, each in place of its name in double braces; they may have braces themselves."""
    before, *rest = template.split("{{")
    texts = [before]
    for part in rest:
        name, _, text = part.partition("}}")
        texts += [parts[name], text]
    return "".join(texts)


def escaped(text: str) -> str:
    """Escape JSON so that its texts cannot end an element, and encode it as UTF-8."""
    for sign, code in (("<", "\\u003c"), ("\u2028", "\\u2028"), ("\u2029", "\\u2029")):
        text = text.replace(sign, code)
    return text.encode("utf-8", "backslashreplace").decode("utf-8")


def _blob(name: str, data: bytes) -> str:
    text = base64.b64encode(data).decode("ascii")
    return f'<script type="application/octet-stream" id="blob-{name}">{text}</script>\n'


def hash_of(text: str) -> str:
    """Source of a script or style in a content security policy."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode('ascii')}'"


@cache
def _sources() -> tuple[str, str, str]:
    """Template, style and script of a page."""
    names = ("index.html", "palette.css", "style.css", *(f"{name}.js" for name in SCRIPTS))
    template, palette, style, *scripts = [(PAGE / name).read_text(encoding="utf-8") for name in names]
    return template, palette + style, "\n".join(['"use strict";', "(() => {", *scripts, "})();", ""])


@cache
def _three() -> tuple[bytes, str]:
    """Compressed three.js, and the hash of the uncompressed script."""
    packed = THREE.read_bytes()
    return packed, hash_of(gzip.decompress(packed).decode("utf-8"))
