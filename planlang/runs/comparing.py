"""Comparison of records of two runs."""

from __future__ import annotations

import math
import re
from typing import Any

SAME = 1e-9
"""Tolerance for numbers: the same run differs by 1e-14 between processors, different decisions by 1e-6 or more
(docs/reference/trace.md)."""
_DECIMAL = re.compile(r"-?\d+\.\d+(?:e-?\d+)?")


def agree(recorded: Any, found: Any) -> bool:
    """Check whether two values of records are equal, with a tolerance of 1e-9 for numbers, also for those in texts."""
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
