"""Memory that the phases of constrained motions share: where things were when their recipe began, what held before.

A recipe is told by the place of the plan function in the tree of the run, which a resumed run has again.
"""

from __future__ import annotations

from dataclasses import field

from planlang.geometry import Array, Pose
from planlang.language.plans import innermost_plan
from planlang.motion_constraints import MotionConstraint
from planlang.records import dataclass

MOST = 16
"""Recipes that are remembered; the one that went on longest ago is forgotten first."""


@dataclass(slots=True)
class Pour:
    """Something that is being poured out of a vessel; amounts in ml."""

    by: str
    """Class of the action that turned the vessel over."""
    asked: float
    into: str | None = None
    """The vessel that it should get into; None if it is poured onto something."""
    flowed: float = 0.0
    """Amount that has left the vessel, and has got into the other one if there is one."""
    until: float = 0.0
    """Plan time until which ``flowed`` is counted [s]."""


@dataclass(slots=True)
class Phase:
    """The state of one recipe between its phases."""

    things: dict[str, Pose] = field(default_factory=dict)
    """Thing -> its believed pose in the map when a motion was first about it."""
    tools: dict[str, str] = field(default_factory=dict)
    """Description of a tool -> the thing that it meant first: a cup that is empty still is the cup."""
    before: tuple[MotionConstraint, ...] = ()
    """The active constraints of the phase before, as the recipe states them."""
    taken: dict[str, Pose] = field(default_factory=dict)
    """What hands held when the phase before ended -> its pose in the map when it was grasped."""
    way: Array | None = None
    """The joint values (m, n) through which the phase before moved."""
    pours: dict[str, Pour] = field(default_factory=dict)
    """Vessel -> what is being poured out of it, or was when a motion failed."""


class Phases:
    """The recipes of one run whose motions are constrained."""

    def __init__(self) -> None:
        self._known: dict[str, Phase] = {}

    def current(self) -> Phase:
        """Return the state of the recipe that runs."""
        path = innermost_plan()
        found = self._known.pop(path, None) or Phase()
        self._known[path] = found
        while len(self._known) > MOST:
            del self._known[next(iter(self._known))]
        return found
