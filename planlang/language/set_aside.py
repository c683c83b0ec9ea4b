"""Things that a recovery has put down on the way, for want of a free hand: a later step may need one in the hand.

A step that takes a thing itself finds it where it was put. One that delivers it from the hand fails with ObjectLost
before it begins, so that the recovery of what a hand loses goes back to the step that grasps it.
"""

from __future__ import annotations

from planlang.action_classes import levels_above
from planlang.designators import Action, Condition, Object
from planlang.failures import ObjectLost
from planlang.kernel.core import here
from planlang.language.executive import Executive

FROM_THE_HAND = frozenset({"DeliveringAnObject", "PuttingDownAnObject", "LoweringAnObject", "HandingOverAnObject"})
"""Classes of actions that begin with their object in a hand."""


class _Count:
    """How often a thing was set aside in a run."""

    def __init__(self) -> None:
        self.times = 0


def note_set_aside() -> None:
    """Note that a recovery has put a thing down that a later step may need in the hand."""
    here()[0].service(_Count).times += 1


def times_set_aside() -> int:
    """Return how often that was noted in this run."""
    return here()[0].service(_Count).times


def left_behind(action: Action, executive: Executive) -> ObjectLost | None:
    """Make the failure of an action whose object should be in a hand, and is in none since things were set aside."""
    what = action.get("object_acted_on")
    if not times_set_aside() or not isinstance(what, Object):
        return None
    if all(FROM_THE_HAND.isdisjoint(level) for level in levels_above(action.type, executive.ancestors)):
        return None
    return lost_from_hand(what, executive)


def lost_from_hand(what: Object, executive: Executive) -> ObjectLost | None:
    """Make the failure of a thing that a recovery may have set aside, if it is in no hand."""
    if executive.holds(Condition("holding", (what,))):
        return None
    return ObjectLost(f"{what.name} was set aside on the way, and is in no hand", what=what.name)
