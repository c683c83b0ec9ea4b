"""Experience of a run: who did what with what, when, how it ended, and what descriptions were resolved to."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import field
from enum import StrEnum
from typing import Any

from planlang.records import dataclass


class State(StrEnum):
    """The end of an activity; the values are those of a trace, RUNNING for one whose end the trace does not tell."""

    SUCCEEDED = "succeeded"
    FAILED = "failed"
    EVAPORATED = "evaporated"
    RUNNING = "running"


class ResolvedTo(StrEnum):
    """The kind of thing that a designator was resolved to."""

    BASE_POSE = "base pose"
    MODULE = "process module"
    PLAN = "plan"
    THING = "thing"


class About(StrEnum):
    """The kind of thing that a designator describes."""

    ACTION = "action"
    LOCATION = "location"
    GOAL = "goal"
    OBJECT = "object"


@dataclass(frozen=True, slots=True)
class Failure:
    """A failure with the one that it was raised from. ``others`` are (relation, branch, text) of those beside it."""

    type: str
    message: str
    where: str | None = None
    cause: Failure | None = None
    others: tuple[tuple[str, str, str], ...] = ()

    def chain(self) -> Iterator[Failure]:
        """Yield the failure, then what it was raised from, and so on."""
        link: Failure | None = self
        while link is not None:
            yield link
            link = link.cause


@dataclass(frozen=True, slots=True)
class Designator:
    """A description that a plan used: its text as the trace writes it."""

    about: About
    text: str


@dataclass(frozen=True, slots=True)
class Role:
    """A property of an action, in KnowRob's spelling (``objectActedOn``), and the text of what fills it."""

    property: str
    filler: str


@dataclass(frozen=True, slots=True)
class Thing:
    """An object, person or device that a designator names; ``type`` and ``iri`` as the designator has them."""

    name: str
    kind: str
    type: str
    iri: str | None = None


@dataclass(frozen=True, slots=True)
class Resolution:
    """The solution of a designator, and when it was found [world steps].

    ``value`` names the module, plan or thing; of a pose of the base it is empty and ``base`` is (x, y, heading)
    [m, m, rad] in the map. ``details`` is what else the trace tells of it. ``failure`` is why it did not serve.
    """

    step: int
    designator: Designator
    to: ResolvedTo
    value: str = ""
    base: tuple[float, ...] | None = None
    details: Mapping[str, Any] = field(default_factory=dict)
    failure: Failure | None = None


@dataclass(frozen=True, slots=True)
class Occurrence:
    """Something that happened in an activity: an attempt, the decision of a recovery, a transition."""

    step: int
    event: str
    details: Mapping[str, Any] = field(default_factory=dict)
    failure: Failure | None = None


@dataclass(frozen=True, slots=True)
class Activity:
    """A node of the task tree. ``begin`` and ``end`` are plan time [world steps], None where it did not come to that.

    ``number`` and ``parent`` are those of the trace; ``parameters`` and ``result`` what it tells of start and end.
    ``participants`` are names of things.
    """

    number: int
    parent: int | None
    kind: str
    name: str
    state: State = State.RUNNING
    begin: int | None = None
    end: int | None = None
    parameters: Mapping[str, Any] = field(default_factory=dict)
    result: Any = None
    failure: Failure | None = None
    designator: Designator | None = None
    roles: tuple[Role, ...] = ()
    participants: tuple[str, ...] = ()
    resolutions: tuple[Resolution, ...] = ()
    occurrences: tuple[Occurrence, ...] = ()

    def failures(self) -> Iterator[Failure]:
        """Yield the failures of attempts in the order in which they came, then that of the activity itself."""
        yield from (one.failure for one in self.occurrences if one.failure is not None)
        if self.failure is not None:
            yield self.failure


@dataclass(frozen=True, slots=True)
class Experience:
    """A run. ``rate`` is world steps per second of plan time; ``robot`` and ``environment`` as its header names them.

    ``is_whole``: the trace tells how the plan ended. Activities are in the order of their numbers, things in that of
    their names.
    """

    plan: str
    rate: float
    iri: str | None = None
    seed: int | None = None
    schedule: int | None = None
    robot: str | None = None
    environment: str | None = None
    is_whole: bool = True
    activities: tuple[Activity, ...] = ()
    things: tuple[Thing, ...] = ()

    def recovered(self) -> Iterator[tuple[Activity, Failure]]:
        """Yield the failures that something around them survived: the innermost activity that succeeded nevertheless.

        A failure that passes through several activities on its way is yielded once for each.
        """
        numbered = {one.number: one for one in self.activities}
        survivors: dict[int, Activity | None] = {}  # parents come before children
        for one in self.activities:
            above = None if one.parent is None else survivors[one.parent]
            survivor = survivors[one.number] = numbered[one.number] if one.state is State.SUCCEEDED else above
            for failure in dict.fromkeys(one.failures()):
                if survivor is not None:
                    yield survivor, failure
