"""State of a world as a value: what stands where, is in which hand, holds what. A change makes another state.

Truth, belief and hypotheses are states; engines are brought to the one that is asked about.
"""

from planlang.state.matter import Matter, Portion
from planlang.state.world import Grip, Hold, WorldState

__all__ = ["Grip", "Hold", "Matter", "Portion", "WorldState"]
