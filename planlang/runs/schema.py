"""The types of what records of a trace contain, checked once where a trace is read.

A trace may be damaged, written by hand or come from a stranger. Readers rely on this check for what they use without
looking: who adds such a use adds a line here. Values of results, parameters and beliefs may have any type.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any

from planlang.kernel.tree import Status

DEEPEST = 200
"""Maximum nesting of a record, and of the causes of a failure: readers follow both by recursion."""
LARGEST = 1e300
"""Bound of numbers: the whole numbers of JSON have none, and overflow where they become times."""
LATEST = 2**53
"""Last step of a trace: to this one, times are exact."""
_STATUSES = tuple(one.value for one in Status)
_LOSSLESS = frozenset({"answer", "completed", "performed"})
"""Events whose failures are stored losslessly, see :func:`planlang.runs.codec.dump_failure`."""

Check = Callable[[Any], str | None]
"""What a value has to be if it is not; None if it is."""


def _is(what: str, test: Callable[[Any], bool]) -> Check:
    return lambda value: None if test(value) else what


def _is_number(value: Any) -> bool:
    return type(value) in (int, float) and -LARGEST < value < LARGEST


TEXT = _is("a text", lambda value: isinstance(value, str))
NUMBER = _is("a number", _is_number)
_COUNT = _is("a whole number, 0 or more", lambda value: type(value) is int and value >= 0)
FLAG = _is("true or false", lambda value: isinstance(value, bool))
_OBJECT = _is("an object", lambda value: isinstance(value, dict))
TEXTS = _is("a list of texts", lambda value: isinstance(value, list) and all(isinstance(one, str) for one in value))
_POSE = _is("a list of 3 numbers", lambda value: isinstance(value, list) and [*map(_is_number, value)] == [True] * 3)
_RATE = _is("a number above 0", lambda value: _is_number(value) and value > 0)
_STATUS = _is(f"one of {', '.join(_STATUSES)}", lambda value: value in _STATUSES)
_NODE = _is("a number above 0", lambda value: type(value) is int and value > 0)


_LOSSLESS_FAILURE = _is(
    "an object with type and fields, or type and message",
    lambda value: (
        isinstance(value, dict)
        and isinstance(value.get("type"), str)
        and (isinstance(value.get("fields"), dict) or isinstance(value.get("message"), str))
    ),
)


def _failure(value: Any) -> str | None:
    """Check a failure for readers: type, message, place, others by name, and causes likewise."""
    for _ in range(DEEPEST):
        if not isinstance(value, dict):
            return "an object with type and message"
        for key in ("type", "message"):
            if not isinstance(value.get(key), str):
                return f"an object whose {key} is a text"
        if not isinstance(value.get("where", ""), str):
            return "an object whose where is a text"
        for key in ("siblings", "members", "cleanup"):
            others = value.get(key, [])
            texts = others.values() if isinstance(others, dict) else others
            if not isinstance(others, dict | list) or not all(isinstance(one, str) for one in texts):
                return f"an object whose {key} are texts"
        value = value.get("cause")
        if value is None:
            return None
    return f"an object with no more than {DEEPEST} causes"


_ALWAYS: Mapping[str, Check] = {"node": _NODE, "name": TEXT, "kind": TEXT}
_REQUIRED: Mapping[str, tuple[str, ...]] = {
    "header": ("rate",),
    "started": ("node",),
    "ended": ("node", "status"),
}
_OF: Mapping[str, Mapping[str, Check]] = {
    "header": {"rate": _RATE, "plan": TEXT, "robot": TEXT, "map": TEXT, "versions": _OBJECT, "start": _POSE},
    "started": {"action": TEXT, "classes": TEXTS},
    "ended": {"status": _STATUS},
    "solution": {"base": _POSE, "attempt": _COUNT},
    "acquired": {"resources": TEXTS},
    "released": {"resources": TEXTS},
    "request": {"module": TEXT, "action": TEXT},
    "recovery": {"decision": TEXT},
    "belief": {"change": TEXT},
    "means": {"what": TEXT, "name": TEXT, "within": TEXT},
    "fault": {"fault": TEXT, "opportunity": _COUNT},
    "resumed": {"again": TEXTS},
}
"""Event -> what its entries have to be, if they are there."""
_OTHERS: Mapping[str, Check] = {**_ALWAYS, "failure": _failure}
_CHECKS: Mapping[str, Mapping[str, Check]] = {
    **{event: {**_OTHERS, **checks} for event, checks in _OF.items()},
    **{event: {**_ALWAYS, "failure": _LOSSLESS_FAILURE} for event in _LOSSLESS},
}


def is_deep(value: Any) -> bool:
    """Check whether lists and objects are nested more than :data:`DEEPEST` deep."""
    inside = [value]
    for _ in range(DEEPEST + 1):
        inside = [
            one
            for each in inside
            if isinstance(each, dict | list)
            for one in (each.values() if isinstance(each, dict) else each)
        ]
    return bool(inside)


def _shown(value: Any) -> str:
    if isinstance(value, dict | list):  # it may be too deep to be shown
        return "another object" if isinstance(value, dict) else "another list"
    return json.dumps(value)[:40]


def wrong_entry(record: Mapping[str, Any], checks: Mapping[str, Check]) -> str | None:
    """Describe the first entry of a JSON object that is there and fails its check; None if there is none."""
    for key, check in checks.items():
        if key in record and (wanted := check(record[key])) is not None:
            return f"{key} has to be {wanted}, not {_shown(record[key])}"
    return None


def mistake(record: Mapping[str, Any]) -> str | None:
    """Describe the first entry of a record that is missing or has another type; None if there is none."""
    event = record["event"]
    for key in _REQUIRED.get(event, ()):
        if key not in record:
            return f"{event} has no {key}"
    return wrong_entry(record, _CHECKS.get(event, _OTHERS))
