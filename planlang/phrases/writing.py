"""Formatter from locations to phrases."""

from __future__ import annotations

from decimal import Decimal

from planlang.designators import Device, Location, Object, Relation
from planlang.phrases.lexicon import DEVICES, GRASP_FORMS, KINDS, Lexicon
from planlang.relations import RELATIONS

_DEVICE_WORDS = {device: words for words, device in DEVICES.items()}
_REACHING = ("in_reach_of", "in_center_of")


def write_location(location: Location, lexicon: Lexicon | None = None) -> str:
    """Format a location as a phrase that :func:`planlang.phrases.read_location` parses back with the same lexicon.

    Nouns that the lexicon does not have are written in brackets. Raises ValueError for a posture, and for a name with
    spaces or brackets.
    """
    return _location(location, lexicon or Lexicon())


def write_relation(relation: Relation, lexicon: Lexicon | None = None) -> str:
    """Format one relation; raises ValueError like :func:`write_location`."""
    return _clause(relation, lexicon or Lexicon())


def write_thing(what: Object, lexicon: Lexicon | None = None) -> str:
    """Format a thing, a person or an arm; raises ValueError like :func:`write_location`."""
    return _device(what) if isinstance(what, Device) else _noun(what, lexicon or Lexicon())


def _location(location: Location, lexicon: Lexicon) -> str:
    if not location.relations:
        raise ValueError(f"{location} has no relations, so no phrase describes it")
    clauses = [_clause(relation, lexicon) for relation in location.relations]
    manner = ""
    if location.device is not None:
        manner += f" with {_device(location.device)}"
    if location.grasp is not None:
        manner += f" {GRASP_FORMS[location.grasp][0]}"
    if manner:
        said = [i for i, r in enumerate(location.relations) if r.name in _REACHING and not r.negated]
        index = said[0] if said else len(clauses) - 1
        clauses[index] += manner
    return " and ".join(clauses)


def _clause(relation: Relation, lexicon: Lexicon) -> str:
    each = [_reference(one, lexicon) for one in relation.references]
    return f"{'not ' if relation.negated else ''}{_said(relation)} {' and '.join(each)}"


def _said(relation: Relation) -> str:
    form = RELATIONS[relation.name].forms[0]
    match relation:
        case Relation(within=None, beyond=None):
            return form
        case Relation("near", within=float(most), beyond=None):
            return f"within {_length(most)} of"
        case Relation("far_from", within=None, beyond=float(least)):
            return f"beyond {_length(least)} of"
        case Relation(within=float(most), beyond=None):
            return f"at most {_length(most)} {form}"
        case Relation(within=None, beyond=float(least)):
            return f"at least {_length(least)} {form}"
        case Relation(within=float(most), beyond=float(least)):
            return f"{_length(least)} to {_length(most)} {form}"
    raise ValueError(f"the bounds of {relation} are not lengths in metres")


def _length(metres: float) -> str:
    """Format in centimetres below one metre; parsing gives exactly the same number."""
    value = Decimal(repr(metres))
    value, unit = (value * 100, "cm") if value < 1 else (value, "m")
    text = f"{value:f}" if abs(value.adjusted()) < 12 or not value else f"{value.normalize():e}".replace("+", "")
    text = text.rstrip("0").rstrip(".") if "." in text and "e" not in text else text
    return f"{text} {unit}"


def _reference(what: Object | Location, lexicon: Lexicon) -> str:
    if isinstance(what, Object):
        return _noun(what, lexicon)
    if len(what.relations) == 1 and what.device is None and what.grasp is None:
        return f"a place {_clause(what.relations[0], lexicon)}"
    return f"a place ({_location(what, lexicon)})"


def _noun(what: Object, lexicon: Lexicon) -> str:
    words = lexicon.wording(what)
    if words is not None:
        return words if what.iri is not None else f"the {words}"
    words = lexicon.wording(type(what)(what.type))
    if words is None or what.iri is None:
        kind = next(word for word, kind in KINDS.items() if kind is type(what))
        words = f"{kind} {_exact(what.type)}"
    return f"the {words}" + (f" called {_exact(what.iri)}" if what.iri is not None else "")


def _device(device: Device) -> str:
    words = _DEVICE_WORDS.get(Device(device.type)) or f"device {_exact(device.type)}"
    return f"the {words}" + (f" called {_exact(device.iri)}" if device.iri is not None else "")


def _exact(name: str) -> str:
    if not name or any(character.isspace() or character in "<>" for character in name):
        raise ValueError(f"{name!r} cannot be written as a name: it is empty, or has spaces or brackets")
    return f"<{name}>"
