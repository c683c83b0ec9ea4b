"""State of a world as a value: what stands where, is in which hand, holds what. A change makes another state.

Truth, belief and hypotheses are states; engines are brought to the one that is asked about. :func:`apply` makes the
state after a change by an action, :func:`flow` and :func:`warm` what flow and heat make of one, and
``questions.py`` answers for each alike.
"""

from planlang.state.applying import apply, flow, warm
from planlang.state.matter import Matter, Portion
from planlang.state.questions import Queries, is_free
from planlang.state.world import Grip, Hold, Made, WorldState

__all__ = [
    "Grip",
    "Hold",
    "Made",
    "Matter",
    "Portion",
    "Queries",
    "WorldState",
    "apply",
    "flow",
    "is_free",
    "warm",
]
