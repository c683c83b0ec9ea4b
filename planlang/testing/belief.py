"""A small belief for scripted runs: what is held, where things are, what is true."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from planlang.designators import Action, Condition, Location, Object, Posture, local_name

Base = tuple[float, float, float]
"""Where the base is: x, y [m], yaw [rad]."""


@dataclass(eq=False)
class Belief:
    """What the scripted robot believes, which in a script is also what is so.

    Things are called by the local name of their individual, or of their class. Steps of a script read and change
    it; a change of what is held, where things are or what is true makes a new revision.
    """

    holding: list[str] = field(default_factory=list)
    """Names of what the robot holds."""
    at: dict[str, Any] = field(default_factory=dict)
    """Where things are, in whatever terms the test uses: ``belief.at["bottle1"] = "table"``."""
    facts: dict[str, bool] = field(default_factory=dict)
    """Other conditions by their text, e.g. ``"open(fridge1)"``."""
    places: dict[str, Sequence[Base]] = field(default_factory=dict)
    """Places for the base by the name of a location, or of the thing that it is about; without, three are made up."""
    base: Base = (0.0, 0.0, 0.0)
    around: str | None = None
    """What the open hand is around, ready to close."""

    def __post_init__(self) -> None:
        self._revision = 0
        self._seen = self._state()
        self.made_up: dict[str, list[Base]] = {}
        """Places that were made up, by location."""

    def restore(
        self,
        *,
        holding: list[str],
        at: dict[str, Any],
        facts: dict[str, bool],
        base: Base,
        around: str | None,
        revision: int,
        made_up: dict[str, list[Base]],
    ) -> None:
        """Believe what was believed before."""
        self.holding[:] = holding
        self.at, self.facts, self.base, self.around, self.made_up = at, facts, base, around, made_up
        self._seen, self._revision = self._state(), revision

    @property
    def revision(self) -> int:
        """Counts changes."""
        state = self._state()
        if state != self._seen:
            self._seen = state
            self._revision += 1
        return self._revision

    def holds(self, condition: Condition) -> bool:
        """``holding(x)`` is looked up in what is held, anything else among the facts."""
        if condition.predicate == "holding":
            return all(getattr(what, "name", what) in self.holding for what in condition.arguments)
        return self.facts.get(str(condition), False)

    def drop(self, what: str | None = None) -> None:
        """Let something go, or everything."""
        self.holding[:] = [] if what is None else [held for held in self.holding if held != what]

    def places_of(self, location: Location) -> Sequence[Base]:
        """Places for the base that satisfy a location, best first."""
        for name in (location.name, *(_names(location)), str(location)):
            if name is not None and name in self.places:
                return self.places[name]
        known = self.made_up
        if str(location) not in known:
            x = 10.0 * (len(known) + 1)
            known[str(location)] = [(x, 0.0, 0.0), (x + 1, 0.0, 0.0), (x + 2, 0.0, 0.0)]
        return known[str(location)]

    def done(self, action: Action) -> None:
        """What an action brings about when it succeeds, by its class."""
        match local_name(action.type):
            case "Translation-LocationChange":
                x, y, yaw = (action.get(key) for key in ("x", "y", "yaw"))
                if isinstance(x, float) and isinstance(y, float) and isinstance(yaw, float):
                    self.base = (x, y, yaw)
            case "Reaching":
                self.around = _inside_hand(action.get("to_location"))
            case "ClosingAGripper":
                what = _name(action.get("object_acted_on")) or self.around
                if what is not None and what not in self.holding:
                    self.holding.append(what)
            case "GraspingSomething" | "PickingUpAnObject":
                what = _name(action.get("object_acted_on"))
                if what is not None and what not in self.holding:
                    self.holding.append(what)
            case "OpeningAGripper" | "PuttingDownAnObject":
                self.drop(_name(action.get("object_acted_on")))
            case "HandingOverAnObject":
                what, taker = _name(action.get("object_acted_on")), _name(action.get("recipient"))
                if what is not None and taker is not None:
                    self.at[what] = taker
                self.drop(what)

    def _state(self) -> tuple[object, ...]:
        return tuple(self.holding), repr(self.at), repr(self.facts)


def _name(filler: object) -> str | None:
    return filler.name if isinstance(filler, Object) else None


def _inside_hand(location: object) -> str | None:
    """What the hand is around when it has reached a location: what that is in the centre of."""
    if isinstance(location, Object) or not isinstance(location, Location) or isinstance(location, Posture):
        return _name(location)
    for relation in location.relations:
        if relation.name == "in_center_of":
            return relation.reference.name
    return None


def _names(location: Location) -> Iterator[str]:
    """Names of what a location is about, nearest first."""
    for relation in location.relations:
        if relation.reference.name is not None:
            yield relation.reference.name
        if isinstance(relation.reference, Location):
            yield from _names(relation.reference)
