"""Values as JSON: :func:`encode` shortens them for readers of a trace; :func:`dump` and :func:`load` are lossless.

``dump`` writes only values that ``load`` restores with the same types; it refuses all others. JSON's own types are
written as they are. Tuples, numbers that are not finite, members of an Enum and the value types of
:mod:`planlang.advice`, :mod:`planlang.designators`, :mod:`planlang.motion_constraints`,
:mod:`planlang.geometry.matrices` and :mod:`planlang.protocols` become objects with a key that begins with ``$``. For
safety, reading creates objects of no other class and imports no other module: Enums and classes of constraints are
looked up among those that the program has already defined.
"""

from __future__ import annotations

import builtins
import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from contextlib import suppress
from dataclasses import fields, is_dataclass
from enum import Enum
from importlib import import_module
from numbers import Integral, Real
from typing import Any

from planlang.designators import (
    Action,
    Condition,
    Device,
    Filler,
    FixedPose,
    Location,
    Object,
    Person,
    Posture,
    Relation,
    Situation,
)
from planlang.failures import CompositeFailure
from planlang.misuse import PlanStructureError
from planlang.plan_failure import PlanFailure, Where, attach_cleanup, links_of

DEEPEST = 50
"""Maximum nesting of lossless values, well below Python's recursion limit."""
SCHEMA = 5
"""Version of the trace format. From 5 on, a state that was left is stored as what differs from that at the start."""
OLDEST = 4
"""Oldest version that is read; only a run of :data:`SCHEMA` can be repeated."""
PLAIN = frozenset({str, int, bool, type(None)})
"""Classes of values that are written to JSON as they are."""
LONGEST = 256
"""Maximum length of sequences in a trace; for longer ones, such as images, only the length is written."""
DEEPEST_SHOWN = 20
"""Maximum nesting of containers in a trace, as results of nested constructs repeat each other; deeper ones likewise."""
LONGEST_TEXT = 1000
"""Maximum characters of a failure's message or place in a trace, as every construct that it passes repeats them."""


class Lost(ValueError):
    """A value cannot be stored losslessly; the message names it and the reason."""


class Exact:
    """A JSON value that the trace writes without shortening."""

    __slots__ = ("json",)

    def __init__(self, json: Any) -> None:
        self.json = json


def dump(value: object, depth: int = 0) -> Any:
    """Convert a value to JSON from which :func:`load` restores an equal one; Lost if that is impossible."""
    kind = value.__class__
    if value is None or kind is bool or kind is int:
        return value
    if kind is str:
        return _text(value)
    if isinstance(value, float) and kind is float:
        return value if math.isfinite(value) else {"$float": str(value)}
    if depth > DEEPEST:
        raise Lost(f"more than {DEEPEST} lists or objects inside of each other")
    if kind is list:
        return [dump(item, depth + 1) for item in value]  # type: ignore[attr-defined]
    if kind is tuple:
        return {"$tuple": [dump(item, depth + 1) for item in value]}  # type: ignore[attr-defined]
    if isinstance(value, dict) and kind is dict:
        return {_key(key): dump(item, depth + 1) for key, item in value.items()}
    if isinstance(value, Enum):
        return {"$enum": f"{kind.__module__}.{kind.__qualname__}", "name": value.name}
    is_known = kind.__name__ in _VALUES or kind in _DESIGNATORS or isinstance(value, Filler)
    if is_known and kind.__module__ in _MODULES and is_dataclass(value):
        inside = {field.name: dump(getattr(value, field.name), depth + 1) for field in fields(value)}
        if isinstance(value, Object) and value.where is None:  # as in traces of before there was one
            del inside["where"]
        return {"$": kind.__name__, **inside}
    raise Lost(f"{kind.__module__}.{kind.__qualname__}")


def load(json: object) -> Any:
    """Restore a value written by :func:`dump`; ValueError for any other JSON."""
    if isinstance(json, list):
        return [load(item) for item in json]
    if not isinstance(json, dict):
        return json
    marks = [key for key in json if key.startswith("$")]
    if not marks:
        return {key: load(item) for key, item in json.items()}
    match json:
        case {"$float": "nan" | "inf" | "-inf" as text, **rest} if not rest:
            return float(text)
        case {"$tuple": list(items), **rest} if not rest:
            return tuple(load(item) for item in items)
        case {"$enum": str(path), "name": str(name), **rest} if not rest:
            return _member(path, name)
        case {"$": str(name), **inside}:
            return _make(name, inside)
    raise ValueError(f"unknown kind of value {marks[0]}")


def dump_failure(failure: BaseException) -> Any:
    """Convert a failure with its fields, place, members, attachments and causes to JSON; Lost if that is impossible.

    Of other exceptions, only class and message are stored.
    """
    return _dump_failure(failure, 0)


def load_failure(json: Any) -> BaseException:
    """Restore a failure written by :func:`dump_failure`; ValueError for any other JSON."""
    failure: BaseException
    match json:
        case {"type": str(name), "fields": dict(inside)}:
            plan_failure = failure = _failure(name, inside)
            _attach(plan_failure, json)
        case {"type": str(name), "message": str(message)}:
            failure = _other(name, message)
        case _:
            raise ValueError("not a failure: it needs type and fields, or type and message")
    cause = json.get("cause")
    failure.__cause__ = None if cause is None else load_failure(cause)
    failure.__suppress_context__ = True
    return failure


def links(failure: object) -> Iterator[Mapping[str, Any]]:
    """Yield a recorded failure and its causes, nearest first; nothing for None."""
    while isinstance(failure, Mapping):
        yield failure
        failure = failure.get("cause")


def failure_class(name: str) -> type[PlanFailure]:
    """Find a failure class by its full name; ValueError if the program has not defined it."""
    kinds: tuple[type[PlanFailure], ...] = (PlanFailure, *_subclasses(PlanFailure))
    for kind in kinds:
        if f"{kind.__module__}.{kind.__qualname__}" == name:
            return kind
    raise ValueError(f"unknown failure class {name}")


def _text(value: Any) -> str:
    try:
        value.encode()
    except UnicodeEncodeError:
        raise Lost("a text with half a character (a lone surrogate)") from None
    return str(value)


def _key(key: Any) -> str:
    if key.__class__ is not str:
        raise Lost(f"a mapping with the key {key!r}, which is no text")
    if key.startswith("$"):
        raise Lost(f"a mapping with the key {key!r}")
    return _text(key)


def _member(path: str, name: str) -> Enum:
    for kind in _subclasses(Enum):
        if f"{kind.__module__}.{kind.__qualname__}" == path and name in kind.__members__:
            member: Enum = kind[name]
            return member
    raise ValueError(f"unknown member {name} of {path}")


def _subclasses(kind: type[Any]) -> Iterator[type[Any]]:
    """Yield all subclasses, the newest first, as a plan that is imported again defines its classes again."""
    for below in reversed(kind.__subclasses__()):
        yield below
        yield from _subclasses(below)


def _floats(value: object, number: int) -> bool:
    return isinstance(value, tuple) and len(value) == number and all(type(item) in (int, float) for item in value)


_DESIGNATORS = (Object, Person, Device, Relation, Location, Posture, FixedPose, Action, Situation, Condition)
_MODULES = (
    "planlang.advice",
    "planlang.designators",
    "planlang.motion_constraints",
    "planlang.geometry.matrices",
    "planlang.protocols",
)


_VALUES: dict[str, tuple[str, Callable[[Any], bool]]] = {
    "Change": (
        "planlang.advice",
        lambda one: isinstance(one.what, str) and isinstance(one.thing, str | None),
    ),
    "Pose": ("planlang.geometry", lambda pose: _floats(pose.position, 3) and _floats(pose.orientation, 4)),
    "Configuration": (
        "planlang.protocols",
        lambda config: _floats(config.base, 3) and isinstance(config.joints, dict),
    ),
    "Solution": (
        "planlang.protocols",
        lambda found: _floats(found.base, 3) and isinstance(found.revision, int) and isinstance(found.detail, dict),
    ),
}
"""Value type -> its module, and a function that checks the types of its fields."""


def _make(name: str, inside: Mapping[str, Any]) -> Any:
    home, fits = _VALUES.get(name, (None, None))
    if home is not None:
        kind = getattr(import_module(home), name)  # these need NumPy, and most plans in virtual time do not
    else:
        fillers = (kind for kind in _subclasses(Filler) if kind.__module__ in _MODULES)
        kind = next((kind for kind in (*_DESIGNATORS, *fillers) if kind.__name__ == name), None)
    if kind is None:
        raise ValueError(f"unknown value type {name}")
    if kind is Relation and "reference" in inside:  # of traces that were written when there was one
        inside = {**inside, "references": {"$tuple": [inside["reference"]]}}
        del inside["reference"]
    if issubclass(kind, Object):
        inside = {"where": None, **inside}
    if set(inside) != {field.name for field in fields(kind)}:
        raise ValueError(f"wrong field names for {name}")
    try:
        value = kind(**{key: load(item) for key, item in inside.items()})
    except PlanStructureError:
        raise ValueError(f"a field of {name} has the wrong type") from None
    if fits is not None and not fits(value):  # other constructors check their fields
        raise ValueError(f"a field of {name} has the wrong type")
    return value


_ATTACHED = ("where", "siblings", "cleanup_failures", "afterwards")


def _dump_failure(failure: BaseException, depth: int) -> Any:
    if depth > DEEPEST:
        raise Lost(f"a failure with more than {DEEPEST} causes")
    if not isinstance(failure, PlanFailure):
        return {"type": type(failure).__name__, "message": _text(str(failure))}
    kind = type(failure)
    written: dict[str, Any] = {"type": f"{kind.__module__}.{kind.__qualname__}", "fields": {}}
    for field in fields(failure):
        value = getattr(failure, field.name)
        if field.name == "failures":
            written["members"] = [_dump_failure(member, depth + 1) for member in value]
        elif field.name not in _ATTACHED:
            try:
                written["fields"][field.name] = dump(value)
            except Lost as lost:
                raise Lost(f"the field {field.name} of {kind.__name__} ({lost})") from None
    if failure.where is not None:
        where = failure.where
        written["where"] = [where.path, where.file, where.line, where.revision]
    if failure.siblings:
        written["siblings"] = [[name, _dump_failure(other, depth + 1)] for name, other in failure.siblings]
    if failure.cleanup_failures:
        written["cleanup"] = [_dump_failure(other, depth + 1) for other in failure.cleanup_failures]
    chain = list(failure.chain())
    if len(chain) > 1:
        written["cause"] = _dump_failure(chain[1], depth + 1)
    return written


def _other(name: str, message: str) -> Exception:
    """Restore an exception that is not a plan failure: one of Python's own, or a new class of that name."""
    kind = getattr(builtins, name, None)
    base = kind if isinstance(kind, type) and issubclass(kind, Exception) else Exception
    if base is kind:
        with suppress(TypeError):
            simple: Exception = kind(message)
            if str(simple) == message:
                return simple
    body = {"__init__": lambda self: None, "__str__": lambda self: message}
    other: Exception = type(name, (base,), body)()
    return other


def _failure(name: str, inside: Mapping[str, Any]) -> PlanFailure:
    kind = failure_class(name)
    names = {field.name for field in fields(kind)} - {*_ATTACHED, "failures"}
    if not names >= set(inside):
        raise ValueError(f"wrong field names for {name}")
    failure = kind.__new__(kind)
    Exception.__init__(failure)
    failure.siblings, failure.cleanup_failures, failure.afterwards, failure.where = (), (), (), None
    for field in names:
        setattr(failure, field, load(inside[field]) if field in inside else None)
    return failure


def _attach(failure: PlanFailure, rest: Mapping[str, Any]) -> None:
    match rest.get("where"):
        case None:
            pass
        case [str(path), str(file), int(line), (int() | None) as revision]:
            failure.where = Where(path, file, line, revision)
        case _:
            raise ValueError("where of a failure has to be path, file, line and revision")
    if any(field.name == "failures" for field in fields(failure)):
        vars(failure)["failures"] = tuple(map(_plan_failure, _list_in(rest, "members")))
    attach_cleanup(failure, map(_plan_failure, _list_in(rest, "cleanup")))
    siblings = []
    for pair in _list_in(rest, "siblings"):
        match pair:
            case [str(name), other]:
                siblings.append((name, _plan_failure(other)))
            case _:
                raise ValueError("siblings of a failure have to be pairs of name and failure")
    failure.siblings = tuple(siblings)


def _list_in(rest: Mapping[str, Any], key: str) -> list[Any]:
    items = rest.get(key, [])
    if not isinstance(items, list):
        raise ValueError(f"{key} of a failure has to be a list")
    return items


def _plan_failure(json: object) -> PlanFailure:
    failure = load_failure(json)
    if not isinstance(failure, PlanFailure):
        raise ValueError(f"{type(failure).__name__} is not a plan failure")
    return failure


# -- for readers of a trace


def encode(value: object, depth: int = 0) -> Any:
    """Convert a value to JSON for readers: designators to text, sets sorted, other types to their qualified names."""
    kind = value.__class__
    if kind in PLAIN:
        return value
    if kind is list or kind is tuple:  # as below, but without checks of abstract classes, which cost ten times as much
        items: Sequence[Any] = value  # type: ignore[assignment]
        if depth >= DEEPEST_SHOWN or len(items) > LONGEST:
            return {"length": len(items)}
        return [encode(item, depth + 1) for item in items]
    if isinstance(value, str):
        return value
    if isinstance(value, Exact):
        return value.json
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, Integral):
        return int(value)
    if isinstance(value, Real):
        number = float(value)
        return number if math.isfinite(number) else str(number)
    if isinstance(value, BaseException):
        return _encode_failure(value)
    if isinstance(value, (Mapping, Set, Sequence)) and not isinstance(value, (bytes, bytearray, memoryview)):
        return _encode_container(value, depth) if depth < DEEPEST_SHOWN else {"length": len(value)}
    return _encode_object(value, depth)


def _encode_container(value: Mapping[Any, Any] | Set[Any] | Sequence[Any], depth: int) -> Any:
    deeper = depth + 1
    if isinstance(value, Mapping):
        return {key if isinstance(key, str) else str(encode(key)): encode(item, deeper) for key, item in value.items()}
    if isinstance(value, Set):
        return sorted((encode(item, deeper) for item in value), key=lambda item: json.dumps(item, sort_keys=True))
    return [encode(item, deeper) for item in value] if len(value) <= LONGEST else {"length": len(value)}


def _encode_object(value: object, depth: int) -> Any:
    module = type(value).__module__
    if module in ("planlang.designators", "planlang.motion_constraints"):
        return str(value)
    if module in ("planlang.geometry.matrices", "planlang.protocols") and is_dataclass(value):
        return {field.name: encode(getattr(value, field.name), depth + 1) for field in fields(value)}
    if module == "numpy":
        if getattr(value, "size", LONGEST + 1) <= LONGEST:
            return encode(value.tolist(), depth)  # type: ignore[attr-defined]
        return {"shape": list(value.shape)}  # type: ignore[attr-defined]
    if isinstance(value, type):
        return f"{value.__module__}.{value.__qualname__}"
    name = getattr(value, "__qualname__", None)
    if isinstance(name, str):
        return f"{getattr(value, '__module__', module)}.{name}"
    return f"{module}.{type(value).__qualname__}"


def _encode_failure(error: BaseException) -> dict[str, Any]:
    """Type, message, place, members and causes of an exception."""
    outer: dict[str, Any] | None = None
    for link in reversed(links_of(error)):
        record: dict[str, Any] = {"type": type(link).__name__, "message": _shortened(str(link))}
        if isinstance(link, PlanFailure):
            if link.where is not None:
                record["where"] = _shortened(str(link.where))
            if link.siblings:
                record["siblings"] = {name: _summary(other) for name, other in link.siblings}
            if link.cleanup_failures:
                record["cleanup"] = [_summary(other) for other in link.cleanup_failures]
        if isinstance(link, CompositeFailure):
            pairs = zip(link.names, link.failures, strict=True)
            record["members"] = {name: _summary(member) for name, member in pairs}
        if outer is not None:
            record["cause"] = outer
        outer = record
    assert outer is not None
    return outer


def _summary(failure: BaseException) -> str:
    return _shortened(f"{type(failure).__name__}: {failure}")


def _shortened(text: str) -> str:
    """Cut out the middle of a long text."""
    left_out = len(text) - LONGEST_TEXT
    return text if left_out <= 0 else f"{text[: LONGEST_TEXT // 2]} ... {left_out} ... {text[-LONGEST_TEXT // 2 :]}"
