"""State of a world as a value: what stands where, what is in which hand. A change makes another state.

Truth, belief and hypotheses are states; engines are brought to the one that is asked about.
"""

from planlang.state.world import Grip, Hold, WorldState

__all__ = ["Grip", "Hold", "WorldState"]
