"""The grammar in which faults are stated: ``PART.NAME:KIND=VALUE@WHEN``, several of them separated by spaces.

``gripper:misses@1`` is the first closing of any gripper between whose fingers a thing is, ``gripper.left:misses@2-3``
the second and third of the left one, ``camera:blind@3s-8s`` each look from 3 to 8 s of plan time,
``person:refuses@always`` each offer, ``person:refuses@10s-`` each from 10 s on, ``person:refuses@10s`` the first from
then on.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable

from planlang.faults.kinds import KINDS, Kind, kind_of, parts
from planlang.records import dataclass
from planlang.spelling import guess

ALWAYS = "always"
MOST_FAULTS = 1000
"""Largest number of faults in a run."""
_FAULT = re.compile(
    r"(?P<part>[a-z]+)(?:\.(?P<of>[^:=@\s]+))?:(?P<kind>[a-z_]+)(?:=(?P<value>[^@\s]+))?(?:@(?P<when>\S+))?"
)
_COUNT = re.compile(r"(\d{1,6})(?:(-)(\d{1,6})?)?")
_TIME = re.compile(r"(\d{1,6}(?:\.\d{1,3})?)s(?:(-)(?:(\d{1,6}(?:\.\d{1,3})?)s)?)?")
EXAMPLE = "gripper:misses@1"


class WrongFault(ValueError):
    """A text that states no fault, or one of no kind that there is."""


@dataclass(frozen=True, slots=True)
class When:
    """Which opportunities of a fault it happens at: counted from 1, or by plan time [s]; the ends belong to it."""

    first: int = 1
    last: int | None = 1
    """None: there is no last one."""
    since: float | None = None
    """If stated, the plan time counts and not the number."""
    until: float | None = None

    @staticmethod
    def of(text: str) -> When:
        """Read ``2``, ``2-4``, ``2-``, ``3s``, ``3s-8s``, ``3s-`` or ``always``. Raises WrongFault."""
        if text == ALWAYS:
            return When(1, None)
        if (found := _COUNT.fullmatch(text)) is not None:
            first, dash, last = found.groups()
            when = When(int(first), int(last) if last else None if dash else int(first))
        elif (found := _TIME.fullmatch(text)) is not None:
            since, dash, until = found.groups()
            once = None if dash else 1
            when = When(1, once, float(since), float(until) if until else None)
        else:
            raise WrongFault(f"@{text}: write a number (@2, @2-4, @2-), a plan time (@3s, @3s-8s, @3s-) or @always")
        ends = (when.first, when.last) if when.since is None else (when.since, when.until)
        if when.first == 0 or (ends[1] is not None and ends[0] is not None and ends[1] < ends[0]):
            raise WrongFault(f"@{text} never comes: opportunities are counted from 1, and what ends does so later")
        return when

    def __str__(self) -> str:
        if self.since is not None:
            end = "" if self.last == 1 else "-" if self.until is None else f"-{self.until:g}s"
            return f"{self.since:g}s{end}"
        if self.last is None:
            return ALWAYS if self.first == 1 else f"{self.first}-"
        return f"{self.first}" if self.first == self.last else f"{self.first}-{self.last}"

    def is_now(self, number: int, time: float) -> bool:
        """Check whether an opportunity counts, by its number among those that could, and its plan time [s]."""
        if self.since is not None and (time < self.since or time > (math.inf if self.until is None else self.until)):
            return False
        return self.first <= number <= (math.inf if self.last is None else self.last)


@dataclass(frozen=True, slots=True)
class NamedFault:
    """A fault that somebody has stated."""

    kind: Kind
    of: str | None = None
    """Name of the arm, person, door, device or thing that it happens to; None: of any."""
    value: str | None = None
    when: When = When()

    @staticmethod
    def read(text: str) -> NamedFault:
        """Read one fault. Raises WrongFault."""
        found = _FAULT.fullmatch(text)
        if found is None:
            raise WrongFault(f"{text!r} is no fault; write PART:KIND@WHEN, for example {EXAMPLE}")
        part, name, value = found["part"], found["kind"], found["value"]
        kind = kind_of(part, name)
        if kind is None:
            raise WrongFault(_unknown(part, name))
        if value is not None and kind.value is None:
            raise WrongFault(f"{text!r}: {kind} has no value")
        _check_value(kind, value)
        return NamedFault(kind, found["of"], value, When() if found["when"] is None else When.of(found["when"]))

    def __str__(self) -> str:
        of = "" if self.of is None else f".{self.of}"
        value = "" if self.value is None else f"={self.value}"
        return f"{self.kind.part}{of}:{self.kind.name}{value}@{self.when}"


def read_faults(texts: Iterable[str]) -> tuple[NamedFault, ...]:
    """Read texts of one or several faults each, separated by spaces. Raises WrongFault."""
    found = tuple(NamedFault.read(word) for text in texts for word in text.split())
    if len(found) > MOST_FAULTS:
        raise WrongFault(f"{len(found)} faults are more than {MOST_FAULTS}")
    return found


NUMBERS = {"SHARE": (0.0, 1.0), "METRES": (0.0, 1.0), "WIDTH": (-0.05, 0.05), "SECONDS": (0.0, 3600.0)}
"""Values that are numbers -> the least and the largest."""


def _check_value(kind: Kind, value: str | None) -> None:
    if value is None or kind.value not in NUMBERS:
        return
    least, most = NUMBERS[kind.value]
    try:
        is_valid = least <= float(value) <= most
    except ValueError:
        is_valid = False
    if not is_valid:
        raise WrongFault(f"{kind}={value}: {kind.value} is a number from {least:g} to {most:g}")


def _unknown(part: str, name: str) -> str:
    names = [one.name for one in KINDS if one.part == part]
    if not names:
        return f"no fault is of {part!r}; {guess(part, parts())}faults are of {', '.join(parts())}"
    return f"{part} has no fault {name!r}; {guess(name, names)}its faults: {', '.join(names)}"
