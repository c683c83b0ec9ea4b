"""Lengths: numbers of metres, and texts with a unit."""

from __future__ import annotations

import math
import re
from decimal import Decimal

from planlang.misuse import WrongValue, amount, contrast, written

UNITS: dict[str, str] = {"mm": "0.001", "cm": "0.01", "dm": "0.1", "m": "1", "in": "0.0254", "ft": "0.3048"}
"""Metres per unit, as decimal fractions: with floats 35 cm and 0.35 m would be different numbers."""
_PREFIXES = {"milli": "0.001", "centi": "0.01", "deci": "0.1", "": "1"}
for _end, _inch, _foot in (("", "inch", "foot"), ("s", "inches", "feet")):
    UNITS |= {f"{prefix}{word}{_end}": value for word in ("metre", "meter") for prefix, value in _PREFIXES.items()}
    UNITS |= {_inch: UNITS["in"], _foot: UNITS["ft"]}

_LENGTH = re.compile(r"\s*([+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:e[+-]?\d{1,3})?)\s*([A-Za-z]+)\s*", re.ASCII)


def metres(length: float | str) -> float:
    """Convert a length to metres, from a number of metres or a text with a unit: 0.3, "30 cm", "1 ft".

    Raises ValueError, which lists the units, for anything else and for negative or infinite lengths.
    """
    if isinstance(length, str):
        match = _LENGTH.fullmatch(length)
        if match is None or match[2] not in UNITS:
            raise ValueError(f'{length!r} is not a length; write "30 cm" with one of {", ".join(UNITS)}')
        value = float(Decimal(match[1]) * Decimal(UNITS[match[2]]))
    elif isinstance(length, bool) or not isinstance(length, int | float):
        raise ValueError(f'a length is a number of metres or a text such as "30 cm", not {length!r}')
    else:
        value = float(length)
    if not (math.isfinite(value) and value >= 0):
        raise ValueError(f"a length must be finite and not negative, got {length!r}")
    return value


def bound_of(parameter: str, length: float | str | None) -> float | None:
    """Convert a bound of a location, a number [m] or a text; raises WrongValue with the right code."""
    try:
        known = None if isinstance(length, str) else amount(length)
        if length is None or known is not None:
            return known
        return metres(length)
    except ValueError as problem:
        wrong, right = (f"a_location(near=table, {parameter}={code})" for code in (written(length), '"30 cm"'))
        raise WrongValue(contrast(str(problem), wrong, right)) from None
