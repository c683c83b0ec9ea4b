"""State shared by the phases of a constrained motion: initial poses of objects, and constraints of the phase before.

A recipe is identified by the path of its plan function in the task tree, which is the same in a resumed run.
"""

from __future__ import annotations

from dataclasses import field

from planlang.designators import Action
from planlang.geometry import Array, Pose
from planlang.kept import Latest
from planlang.language.plans import innermost_plan
from planlang.motion_constraints import MotionConstraint
from planlang.records import dataclass

MOST = 16
"""Recipes to remember; the least recently used is forgotten first."""


@dataclass(slots=True)
class Pour:
    """Liquid being poured out of a vessel; amounts in ml."""

    by: Action
    """Action that turned the vessel over."""
    asked: float
    """Amount to pour."""
    into: str | None = None
    """Vessel that receives it, or surface; None if that is not known."""
    before: float = 0.0
    """Amount out of the vessel that had arrived there before."""
    over: tuple[MotionConstraint, ...] = ()
    """Active constraints of the phase before that action."""


@dataclass(slots=True)
class Phase:
    """State of one recipe between its phases."""

    things: dict[str, Pose] = field(default_factory=dict)
    """Object -> its believed pose in the map when a motion first used it."""
    tools: dict[str, str] = field(default_factory=dict)
    """Description of a tool -> the object it was first bound to: "the full cup" stays bound once it is empty."""
    before: tuple[MotionConstraint, ...] = ()
    """Active constraints of the previous phase, as the recipe states them."""
    taken: dict[str, Pose] = field(default_factory=dict)
    """Object held at the end of the previous phase -> its pose in the map when it was grasped."""
    path: Array | None = None
    """Joint path (m, n) of the previous phase."""
    pours: dict[str, Pour] = field(default_factory=dict)
    """Vessel -> the pour in progress, or interrupted when a motion failed."""


class Phases:
    """States of the recipes with constrained motions in one run."""

    def __init__(self) -> None:
        self._known: Latest[str, Phase] = Latest(MOST)

    def current(self) -> Phase:
        """Look up the state of the running recipe; a new one on its first motion."""
        path = innermost_plan()
        phase = self._known.get(path) or Phase()
        self._known.renew(path, phase)
        return phase
