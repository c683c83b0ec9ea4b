"""The codes of diagnostics and what they mean, as docs/reference/codes.md explains them."""

from __future__ import annotations

import re
from pathlib import Path

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "codes.md"
CODES: dict[str, str] = dict(
    re.findall(r"^\| `([A-Z]\d{3})` \| (.+?) \|$", PAGE.read_text(encoding="utf-8"), flags=re.MULTILINE)
)
