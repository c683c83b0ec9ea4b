"""Whether two records of runs are equal."""

from __future__ import annotations

import math
import re
from typing import Any

SAME = 1e-9
"""Difference up to which numbers are equal: processors differ by 1e-14, decisions by 1e-6 or more
(docs/reference/trace.md)."""
_DECIMAL = re.compile(r"-?\d+\.\d+(?:e-?\d+)?")


def agree(recorded: Any, found: Any) -> bool:
    """Return whether two details of records are equal, numbers to 1e-9, also where they stand in texts."""
    match recorded, found:
        case float(), float():
            return math.isclose(recorded, found, rel_tol=SAME, abs_tol=SAME) or repr(recorded) == repr(found)
        case str(), str() if recorded != found:
            numbers = (map(float, _DECIMAL.findall(text)) for text in (recorded, found))
            return _DECIMAL.sub("#", recorded) == _DECIMAL.sub("#", found) and agree(*map(list, numbers))
        case dict(), dict():
            return recorded.keys() == found.keys() and all(agree(recorded[key], found[key]) for key in recorded)
        case list(), list():
            return len(recorded) == len(found) and all(map(agree, recorded, found))
    return bool(recorded == found)
