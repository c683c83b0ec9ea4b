"""Volumes: texts with a unit."""

from __future__ import annotations

import math
import re
from decimal import Decimal

UNITS: dict[str, str] = {"ml": "1", "cl": "10", "dl": "100", "l": "1000", "cm3": "1"}
"""Millilitres per unit, as decimal fractions."""
_ABBREVIATED = ", ".join(UNITS)
for _word in ("litre", "liter"):
    for _prefix, _factor in (("milli", "1"), ("centi", "10"), ("deci", "100"), ("", "1000")):
        UNITS |= {f"{_prefix}{_word}": _factor, f"{_prefix}{_word}s": _factor}

_VOLUME = re.compile(r"\s*((?:\d+(?:\.\d*)?|\.\d+)(?:e[+-]?\d{1,3})?)\s*([A-Za-z]+3?)\s*", re.ASCII)


def millilitres(text: str) -> float:
    """Convert a text with a unit, such as "120 ml", to millilitres; raises ValueError, which lists the units."""
    match = _VOLUME.fullmatch(text)
    unit = None if match is None else UNITS.get(match[2], UNITS.get(match[2].lower()))
    if match is None or unit is None:
        raise ValueError(f'{text!r} is not an amount; write "120 ml" with one of {_ABBREVIATED}')
    value = float(Decimal(match[1]) * Decimal(unit))
    if not math.isfinite(value):
        raise ValueError(f"an amount must be finite, got {text!r}")
    return value
