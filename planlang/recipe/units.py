"""Numbers with units: literals whose datatype is a unit of QUDT, converted to SI units (``ontologies/units.toml``)."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

from planlang.designators import local_name
from planlang.ontology import Literal
from planlang.ontology.terms import RDF, XSD
from planlang.resources import bundled

Dimension = tuple[tuple[str, int], ...]
"""Powers of base quantities (L length, M mass, T time, K temperature, A angle), sorted, none of them 0."""

_BASES = {"L": "m", "M": "kg", "T": "s", "K": "K", "A": "rad"}
_POWER = re.compile(r"([A-Z])(-?\d*)")


@dataclass(frozen=True, slots=True)
class Unit:
    """``value * factor + offset`` is the value in the SI unit of the dimension."""

    dimension: Dimension
    factor: float = 1.0
    offset: float = 0.0

    def to_si(self, value: float) -> float:
        """Convert a value in this unit to the SI unit of its dimension."""
        return value * self.factor + self.offset


def unit_of(literal: Literal) -> str | None:
    """Return the local name of the unit that types a literal; None for plain text and the datatypes of XML Schema."""
    datatype = literal.datatype
    if datatype is None or datatype == RDF.langString or datatype.startswith(XSD) or "22-rdf-syntax-ns#" in datatype:
        return None
    return local_name(datatype)


@cache
def unit(name: str) -> Unit | None:
    """Return the unit of a name, such as Centimeter, SquareMeter or MeterPerSecondSquared; None if unknown."""
    units = _table()[0]
    if name in units:
        return units[name]
    above, *below = name.split("Per")
    parts = [(_product(above), 1) if above else (Unit(()), 1), *((_product(part), -1) for part in below)]
    dimension: dict[str, int] = {}
    factor = 1.0
    for part, sign in parts:
        if part is None:
            return None
        factor *= part.factor**sign
        for base, power in part.dimension:
            dimension[base] = dimension.get(base, 0) + sign * power
    return Unit(_sorted(dimension), factor)


def dimension_of(property_name: str) -> Dimension | None:
    """Return the dimension of a property (local name); None if it is unknown."""
    return _table()[1].get(property_name)


def si_unit(dimension: Dimension) -> str:
    """Return the SI unit of a dimension in words, e.g. ``m s-1``."""
    return " ".join(f"{_BASES[base]}{power if power != 1 else ''}" for base, power in dimension) or "1"


def _product(name: str) -> Unit | None:
    """Return a unit, its square or its cube."""
    for prefix, suffix, power in (("Square", "Squared", 2), ("Cubic", "Cubed", 3)):
        if name.startswith(prefix) or name.endswith(suffix):
            base = _table()[0].get(name.removeprefix(prefix).removesuffix(suffix))
            if base is None:
                return None
            return Unit(tuple((letter, exponent * power) for letter, exponent in base.dimension), base.factor**power)
    return _table()[0].get(name)


def _sorted(powers: Mapping[str, int]) -> Dimension:
    return tuple(sorted((base, power) for base, power in powers.items() if power))


def _read(text: str) -> Dimension:
    return _sorted({base: int(power or 1) for base, power in _POWER.findall(text)})


@cache
def _table() -> tuple[dict[str, Unit], dict[str, Dimension]]:
    data = tomllib.loads((bundled("ontologies") / "units.toml").read_text(encoding="utf-8"))
    units = {
        name: Unit(_read(entry["dimension"]), entry.get("factor", 1.0), entry.get("offset", 0.0))
        for name, entry in data["units"].items()
    }
    return units, {name: _read(text) for name, text in data["properties"].items()}
