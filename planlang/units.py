"""Units of QUDT: their names, and conversion of numbers to and from SI units.

``ontologies/units.toml`` defines the units; other names are composed of them: PoundForcePerSquareInch. Units of the
same dimension can be converted, even if QUDT assigns them to different kinds of quantity. Angles and information are
dimensions of their own, measured in radians and nats.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from functools import cache, lru_cache

from planlang.designators import local_name
from planlang.diagnostics import BadInput, error
from planlang.files import bundled
from planlang.ontology.terms import RDF, XSD, Literal
from planlang.records import dataclass
from planlang.words import Option, Text

Dimension = tuple[tuple[str, int], ...]
"""Powers of base quantities (the letters of units.toml: L length, M mass, T time, ...), sorted, none of them 0."""

_SYMBOLS = {
    **{"L": "m", "M": "kg", "T": "s", "I": "A", "K": "K", "N": "mol", "J": "cd", "A": "rad"},
    **{"B": "nat", "D": "USD"},
}
_POWER = re.compile(r"([A-Z])(-?\d*)")
_BEFORE = {"Square": 2, "Cubic": 3, "Quartic": 4}
_BEHIND = {"Squared": 2, "Cubed": 3}
_LONGEST = 100
"""Longest name that is parsed [characters]."""


class IncompatibleUnits(ValueError):
    """A number has a unit of the wrong dimension."""


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit: ``value * factor + offset`` is in the SI unit of the dimension."""

    dimension: Dimension
    factor: Fraction = Fraction(1)
    offset: Fraction = Fraction(0)

    def to(self, other: Unit, value: float) -> float:
        """Convert a value to another unit of the same dimension; only the result is rounded: 35 cm are 0.35 m.

        Raises OverflowError for a result beyond the range of float.
        """
        return float((Fraction(str(value)) * self.factor + self.offset - other.offset) / other.factor)


@lru_cache(maxsize=1024)  # bounded, as names come from untrusted files
def unit(name: str) -> Unit | None:
    """Look up a unit, such as Centimeter, SquareMeter or MeterPerSecondSquared; None if the name is unknown."""
    if len(name) > _LONGEST:
        return None
    return _table().scales.get(name) or _composed(name)


def convert(value: float, source: str, target: str) -> float:
    """Convert a value between two units given by name.

    Raises IncompatibleUnits for different dimensions, ValueError for an unknown unit or a result beyond float.
    """
    old, new = known_unit(source), known_unit(target)
    try:
        return _fitting(old, source, new).to(new, value)
    except OverflowError:
        raise ValueError(f"{value} {source} is too large for a number of {target}") from None


def known_unit(name: str) -> Unit:
    """Look up a unit; raises ValueError if the name is unknown."""
    known = unit(name)
    if known is None:
        raise ValueError(f"{name} is an unknown unit; use one of QUDT, such as Meter, SecondTime or MeterPerSecond")
    return known


def unit_of(literal: Literal) -> str | None:
    """Return the local name of a literal's unit; None for plain text and datatypes of XML Schema."""
    datatype = literal.datatype
    if datatype is None or datatype == RDF.langString or datatype.startswith(XSD) or "22-rdf-syntax-ns#" in datatype:
        return None
    return local_name(datatype)


def stated_number(literal: Literal, wanted: str | None = None) -> float:
    """Read the number of a literal, converted to the ``wanted`` unit, by default the SI unit of its dimension.

    A number without a unit or with an unknown one is returned unchanged.
    Raises IncompatibleUnits for a unit of another dimension, ValueError unless it is a finite number.
    """
    number, converted = literal.number(), conversion(literal, wanted)
    return number if converted is None else converted(number)


def conversion(literal: Literal, wanted: str | None = None) -> Callable[[float], float] | None:
    """Return the conversion that :func:`stated_number` applies to a literal; None if there is nothing to convert."""
    name = unit_of(literal)
    old = None if name is None else unit(name)
    if name is None or old is None or name == wanted:
        return None
    new = Unit(old.dimension) if wanted is None else known_unit(wanted)
    fitting = _fitting(old, name, new)

    def converted(number: float) -> float:
        try:
            return fitting.to(new, number)
        except OverflowError:
            raise ValueError(f"not a finite number: {literal.value!r}") from None

    return converted


def unit_of_property(name: str) -> str | None:
    """Return the unit of a property's number or numbers, by local name; None if it is unknown."""
    return _table().properties.get(name) or _table().vectors.get(name)


def dimension_of(property_name: str) -> Dimension | None:
    """Return the dimension of a property with a single number, by local name; None if it is unknown."""
    name = _table().properties.get(property_name)
    return None if name is None else known_unit(name).dimension


def si_unit(dimension: Dimension) -> str:
    """Format the SI unit of a dimension, e.g. ``m s-1``."""
    return " ".join(f"{_SYMBOLS[base]}{power if power != 1 else ''}" for base, power in dimension) or "1"


def _fitting(old: Unit, name: str, new: Unit) -> Unit:
    """Return ``old`` if it can be converted to ``new``; raises IncompatibleUnits otherwise."""
    if old.dimension != new.dimension:
        raise IncompatibleUnits(f"{name} is measured in {si_unit(old.dimension)}, not in {si_unit(new.dimension)}")
    return old


def chosen_units(names: Sequence[str]) -> dict[Dimension, str]:
    """Map each dimension to the unit that the user chose for output.

    Raises BadInput for an unknown unit, and for two units of one dimension.
    """
    chosen: dict[Dimension, str] = {}
    problems = []
    for name in names:
        known = unit(name)
        if known is None:
            advice = "use a unit of QUDT, such as Centimeter, DegreeAngle or KilometerPerHour"
            problems.append(error("C019", Text(Option("units", name), " is an unknown unit"), help=advice))
        elif chosen.setdefault(known.dimension, name) != name:
            asked = Option("units", name), " and ", Option("units", chosen[known.dimension])
            message = Text(*asked, f" are both measured in {si_unit(known.dimension)}")
            problems.append(error("C019", message, help="ask for one of them"))
    if problems:
        raise BadInput(problems)
    return chosen


def in_chosen_unit(literal: Literal, chosen: Mapping[Dimension, str]) -> Literal:
    """Convert a literal to the chosen unit of its dimension; others are returned unchanged."""
    name = unit_of(literal)
    known = None if name is None else unit(name)
    target = None if known is None else chosen.get(known.dimension)
    if name is None or target is None or literal.datatype is None:
        return literal
    try:
        return Literal(str(stated_number(literal, target)), literal.datatype.removesuffix(name) + target)
    except ValueError:
        return literal


@dataclass(frozen=True, slots=True)
class _Table:
    """Content of units.toml."""

    bases: Mapping[str, Unit]
    units: Mapping[str, tuple[Fraction, str]]
    scales: Mapping[str, Unit]
    prefixes: Mapping[str, Fraction]
    properties: Mapping[str, str]
    vectors: Mapping[str, str]


@cache
def _table() -> _Table:
    data = tomllib.loads((bundled("ontologies") / "units.toml").read_text(encoding="utf-8"), parse_float=Fraction)
    bases = {
        name: Unit(_sorted({base: int(power or 1) for base, power in _POWER.findall(text)}))
        for name, text in data["bases"].items()
    }
    scales = data["scales"].items()
    return _Table(
        bases,
        {name: (Fraction(factor), of) for name, (factor, of) in data["units"].items()},
        {name: Unit(bases[of].dimension, Fraction(factor), Fraction(offset)) for name, (factor, offset, of) in scales},
        {name: Fraction(factor) for name, factor in data["prefixes"].items()},
        data["properties"],
        data["vectors"],
    )


@lru_cache(maxsize=1024)
def _single(name: str) -> Unit | None:
    """Look up a simple unit, without its offset; None if there is none."""
    table = _table()
    if name in table.bases:
        return table.bases[name]
    if name in table.units:
        factor, of = table.units[name]
        known = _composed(of)
        return None if known is None else Unit(known.dimension, factor * known.factor)
    if name in table.scales:
        return Unit(table.scales[name].dimension, table.scales[name].factor)
    if name in table.prefixes:
        return Unit((), table.prefixes[name])
    return _prefixed(name)


def _prefixed(name: str) -> Unit | None:
    """Look up a unit with a prefix: KiloPascal, Kilowatt."""
    table = _table()
    for prefix, factor in table.prefixes.items():
        rest = name.removeprefix(prefix)
        rest = rest[:1].upper() + rest[1:]
        if name.startswith(prefix) and (rest in table.units or rest in table.bases):
            of = _single(rest)
            return None if of is None else Unit(of.dimension, factor * of.factor)
    return None


def _composed(name: str) -> Unit | None:
    """Look up a simple or composed unit; units after a Per divide."""
    if (single := _single(name)) is not None:
        return single
    above, *below = re.split(r"Per(?=[A-Z])", name)
    parts = [*([_powers(above, 1)] if above else []), *(_powers(part, -1) for part in below)]
    known = [(of, power) for part in parts for of, power in part if of is not None]
    return _product(known) if known and all(parts) and len(known) == sum(map(len, parts)) else None


def _product(powers: Iterable[tuple[Unit, int]]) -> Unit:
    dimension: dict[str, int] = {}
    factor = Fraction(1)
    for of, power in powers:
        factor *= of.factor**power
        for base, exponent in of.dimension:
            dimension[base] = dimension.get(base, 0) + exponent * power
    return Unit(_sorted(dimension), factor)


def _powers(name: str, sign: int) -> list[tuple[Unit | None, int]]:
    """Split a product of units, written without separators, into units and their powers.

    The longest known name is taken each time; an unknown one makes the whole unknown (None).
    """
    found: list[tuple[Unit | None, int]] = []
    power = 1
    while name:
        word = next((word for word in (*_BEHIND, *_BEFORE) if name.startswith(word)), None)
        if word in _BEFORE and power == 1:
            power = _BEFORE[word]
        elif word in _BEHIND and found:
            of, before = found[-1]
            found[-1] = of, before * _BEHIND[word]
        else:
            word, of = _longest(name)
            found.append((of, sign * power))
            power = 1
        name = name[len(word or name) :]
    return found if power == 1 else [(None, 0)]


def _longest(name: str) -> tuple[str, Unit | None]:
    """Find the longest known unit at the start of a text; return the whole text and None if there is none."""
    ends = [match.start() for match in re.finditer(r"(?<=.)[A-Z]", name)]
    for end in (len(name), *reversed(ends)):
        if (known := _single(name[:end])) is not None:
            return name[:end], known
    return name, None


def _sorted(powers: Mapping[str, int]) -> Dimension:
    return tuple(sorted((base, power) for base, power in powers.items() if power))
