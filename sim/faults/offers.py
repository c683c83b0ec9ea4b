"""Faults of persons to whom something is offered, and of devices that are switched."""

from __future__ import annotations

from planlang.faults.drawing import Drawn
from planlang.faults.kinds import Opportunity
from planlang.records import dataclass
from sim.faults.injection import Event, Injection

_LATE = (5.0, 12.0)
"""Time after which a person begins to reach for what is offered [s]."""
_REFUSES = (16.0, 25.0)
"""Time for which a person does not want it: longer than most wait [s]."""
_AWAY = (10.0, 20.0)
"""Time for which a person is away [s]."""
_HOLDS = 0.3
"""Time for which a person holds what it lets fall [s]."""


@dataclass(slots=True)
class _Offer:
    """An offer of a thing to a person."""

    fault: Drawn | None
    since: float
    """Plan time at which it began [s]."""
    last: int
    """Step of the world in which it was last on."""


class Offers:
    """What goes wrong with offers to persons."""

    def __init__(self, injection: Injection) -> None:
        self._injection, self._truth = injection, injection.truth
        self._offers: dict[tuple[str, str], _Offer] = {}

    def heeds(self, person: str, thing: str) -> bool:
        """Check whether a person heeds what is held out to it; asked in each step of an offer."""
        offer = self._offers.get((person, thing))
        if offer is None or offer.last < self._truth.steps - 1:
            fault = self._injection.begins(Opportunity.OFFER, (person, thing), lambda kind, of, value: True)
            offer = self._offers[person, thing] = _Offer(fault, self._injection.now, self._truth.steps)
            if fault is not None:
                self._begin(person, thing, fault)
        offer.last = self._truth.steps
        if offer.fault is None:
            return True
        match offer.fault.kind.name:
            case "hesitates":
                return self._injection.now >= offer.since + offer.fault.between(*_LATE)
            case "refuses":
                return self._injection.now >= offer.since + offer.fault.between(*_REFUSES)
            case "lets_go":
                return True
        return False

    def _begin(self, person: str, thing: str, fault: Drawn) -> None:
        if fault.kind.name == "lets_go":
            self._injection.later(self._drops(person, thing, fault))
            return
        self._injection.happens(fault)
        if fault.kind.name in ("leaves", "is_gone"):
            back = self._injection.now + fault.between(*_AWAY) if fault.kind.name == "leaves" else None
            self._injection.later(self._leaves(person, back))

    def _leaves(self, person: str, back: float | None) -> Event:
        def event() -> bool:  # after the step, in which persons are advanced one by one
            if person in self._truth.names():
                if back is None or self._injection.now < back:
                    self._truth.remove(person)
                return back is None
            if back is not None and self._injection.now >= back:
                self._truth.restore(person)
                return True
            return False

        return event

    def _drops(self, person: str, thing: str, fault: Drawn) -> Event:
        since: float | None = None

        def event() -> bool:
            nonlocal since
            if self._truth.taken(thing) != person or thing in self._truth.attached():
                return since is not None
            since = self._injection.now if since is None else since
            if self._injection.now < since + _HOLDS:
                return False
            self._truth.set_pose(thing, self._truth.pose(thing))
            self._truth.gravity.begin(thing)
            self._injection.happens(fault)
            return True

        return event


class Devices:
    """What goes wrong with switching devices."""

    def __init__(self, injection: Injection) -> None:
        self._injection = injection
        self._dead: set[str] = set()

    def switches(self, device: str, state: str) -> bool:
        """Check whether a device switches to a state when its button is pushed or its knob is turned."""
        if device in self._dead:
            return False
        fault = self._injection.begins(Opportunity.SWITCHING, (device,), lambda kind, of, value: True)
        if fault is None:
            return True
        self._injection.happens(fault)
        if fault.kind.name == "is_dead":
            self._dead.add(device)
        return False
