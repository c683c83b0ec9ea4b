"""Locations: from relations such as "in reach of the patient" to places for the base and poses of the hand.

General layout: ``relations`` is the table of what each relation means for base, hand and object, ``bounds`` its
distances; ``meaningless`` is what means nothing, ``idle`` what nothing uses. ``areas``, ``doors`` and ``sight`` say
where that is on the floor, ``ways`` and ``hand_ways`` what a hand does, ``hand_terms`` whether it is somewhere,
``resting`` where objects can be. ``reachability`` maps what arms reach, ``candidates`` inverts the maps over the free
``field``, ``between`` moves what has no room there, ``solving`` finds joint values and rules out collisions by
``executive.motion.collision``, ``reach`` judges one base. ``reaching`` and ``standing``, at last ``anywhere``, search
for places of the base, ``judging`` looks at each exactly; ``resolver`` puts it all together. ``rejections`` is what
they tell when nothing is found. The believed world is asked through ``executive.belief.planning_scene``.
"""

from executive.locations.reach import Reach, ReachSolution
from executive.locations.rejections import Rejections
from executive.locations.relations import TABLE
from executive.locations.resolver import Resolver

__all__ = ["TABLE", "Reach", "ReachSolution", "Rejections", "Resolver"]
