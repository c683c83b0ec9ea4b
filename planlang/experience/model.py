"""Experience of a run: activities with their participants, times and outcomes, and how designators were resolved."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import field
from enum import StrEnum
from typing import Any

from planlang.records import dataclass


class State(StrEnum):
    """Outcome of an activity; the values are those of a trace, RUNNING if the trace does not contain its end."""

    SUCCEEDED = "succeeded"
    FAILED = "failed"
    EVAPORATED = "evaporated"
    RUNNING = "running"


class ResolvedTo(StrEnum):
    """Kind of the solution of a designator."""

    BASE_POSE = "base pose"
    MODULE = "process module"
    PLAN = "plan"
    THING = "thing"


class About(StrEnum):
    """Kind of a designator."""

    ACTION = "action"
    LOCATION = "location"
    GOAL = "goal"
    OBJECT = "object"


@dataclass(frozen=True, slots=True)
class Failure:
    """A failure with its cause. ``others`` are (relation, branch, text) of failures that came with it."""

    type: str
    message: str
    where: str | None = None
    cause: Failure | None = None
    others: tuple[tuple[str, str, str], ...] = ()

    def chain(self) -> Iterator[Failure]:
        """Yield the failure, its cause, the cause of that, and so on."""
        link: Failure | None = self
        while link is not None:
            yield link
            link = link.cause


@dataclass(frozen=True, slots=True)
class Designator:
    """A designator that a plan used, with its text as in the trace."""

    about: About
    text: str


@dataclass(frozen=True, slots=True)
class Role:
    """A property of an action, in KnowRob's spelling (``objectActedOn``), and the text of its filler."""

    property: str
    filler: str


@dataclass(frozen=True, slots=True)
class Thing:
    """An object, person or device that a designator names; ``type`` and ``iri`` are those of the designator."""

    name: str
    kind: str
    type: str
    iri: str | None = None


@dataclass(frozen=True, slots=True)
class Resolution:
    """A solution of a designator, and when it was found [world steps].

    ``value`` names the module, plan or thing; for a pose of the base it is empty and ``base`` is (x, y, heading)
    [m, m, rad] in the map. ``details`` are further values from the trace. ``failure`` is why the solution did not work.
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
    """An event in an activity: an attempt, the decision of a recovery, a transition."""

    step: int
    event: str
    details: Mapping[str, Any] = field(default_factory=dict)
    failure: Failure | None = None


@dataclass(frozen=True, slots=True)
class Activity:
    """A node of the task tree. ``begin`` and ``end`` are plan time [world steps], None if it did not begin or end.

    ``number`` and ``parent`` are those of the trace, ``parameters`` and ``result`` those of its start and its end.
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
        """Yield the failures of attempts in order of time, then that of the activity itself."""
        yield from (one.failure for one in self.occurrences if one.failure is not None)
        if self.failure is not None:
            yield self.failure


@dataclass(frozen=True, slots=True)
class Experience:
    """A run. ``rate`` is world steps per second of plan time; ``robot`` and ``environment`` are those of its header.

    ``is_whole`` if the trace contains the end of the plan. Activities are sorted by number, things by name.
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
        """Yield each failure that a surrounding activity survived, with the innermost activity that succeeded
        nevertheless.

        A failure that passes through several activities is yielded once for each.
        """
        numbered = {one.number: one for one in self.activities}
        survivors: dict[int, Activity | None] = {}  # filled in one pass, because parents come before children
        for one in self.activities:
            above = None if one.parent is None else survivors[one.parent]
            survivor = survivors[one.number] = numbered[one.number] if one.state is State.SUCCEEDED else above
            for failure in dict.fromkeys(one.failures()):
                if survivor is not None:
                    yield survivor, failure
