"""Advice of failures as data: what to change in the map, or in the call, so that what failed has a way.

A change in JSON is ``{"thing": "cup1", "property": "translation", "value": [1.35, 0.1, 0.79]}``, for an option
``{"option": "start", "value": [1.0, 0.0, 3.14]}`` or ``{"option": "arm", "value": "left"}``.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from typing import Any

from planlang.records import dataclass

TRANSLATION, POSITION, ABSENT = "translation", "jointPosition", "absent"
"""Properties of things that a change may state."""
START, ROBOT, SCHEDULE, ARM, GRASP, ATTEMPTS, BEFORE = (
    "start", "robot", "schedule", "arm", "grasp", "attempts", "before"
)  # fmt: skip
"""Options of a run that a change may state."""
LENGTHS = {TRANSLATION: 3, START: 3}
"""Property or option -> how many numbers its value has."""
WORDS, COUNTS = (ROBOT, ARM, GRASP, BEFORE), (SCHEDULE, ATTEMPTS)
"""Options whose value is a text, and those whose value is a whole number."""
Value = float | bool | str | tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Change:
    """One property of a thing of the map, or one option of the call, has another value.

    ``what`` is ``translation`` (x, y, z of the centre in the frame of the map, whatever the pose is stated relative to
    [m]), ``jointPosition`` as maps state it [m, rad], or ``absent`` (True: the map lacks the thing). Without a
    ``thing`` it is an option of the run: ``start`` (x, y [m], yaw [rad]), ``robot``, ``schedule``, ``arm``, ``grasp``,
    ``attempts``, or an action ``before`` the plan or a step; it may be stated several times.
    """

    what: str
    value: Value
    thing: str | None = None

    def as_json(self) -> dict[str, Any]:
        """Return it for JSON."""
        value = list(self.value) if isinstance(self.value, tuple) else self.value
        if self.thing is None:
            return {"option": self.what, "value": value}
        return {"thing": self.thing, "property": self.what, "value": value}

    @staticmethod
    def of(json: object) -> Change:
        """Read it from JSON. Raises ValueError for anything else."""
        match json:
            case {"thing": str(thing), "property": "translation" | "jointPosition" | "absent" as what, "value": value}:
                return Change(what, _value(what, value), thing)
            case {"option": str(name), "value": value} if name in (START, *WORDS, *COUNTS):
                return Change(name, _value(name, value))
        raise ValueError(f"{json!r} is no change of a map or an option")


def _value(what: str, value: object) -> Value:
    if what == ABSENT and value is True:
        return True
    if what in WORDS and isinstance(value, str) and value:
        return value
    if what in COUNTS and type(value) is int and value >= 0:
        return value
    if isinstance(value, list) and len(value) == LENGTHS.get(what) and all(map(_is_number, value)):
        return tuple(map(float, value))
    if what == POSITION and _is_number(value):
        return float(value)  # type: ignore[arg-type]
    raise ValueError(f"{value!r} is no value of {what}")


def _is_number(value: object) -> bool:
    return type(value) in (int, float) and abs(value) <= sys.float_info.max  # type: ignore[arg-type]


@dataclass(frozen=True, slots=True)
class Advice:
    """Changes that together give what failed a way, and the sentence that says so."""

    sentence: str
    changes: tuple[Change, ...]

    def __str__(self) -> str:
        return self.sentence


def changes_in(json: object) -> tuple[Change, ...]:
    """Return the changes in JSON: a list of them, or the innermost ``changes`` that the result of a run has.

    Raises ValueError if there are none.
    """
    found = json if isinstance(json, list) else next(_stated(json), [])
    if not found:
        raise ValueError("it states no changes")
    return tuple(map(Change.of, found))


def _stated(json: object) -> Iterator[list[object]]:
    if isinstance(json, Mapping):
        if isinstance(json.get("changes"), list) and json["changes"]:
            yield json["changes"]
        for inner in json.values():
            yield from _stated(inner)
