"""Locations: from relations such as "in reach of the patient" to base poses and hand poses.

General layout, in the order of a query: ``resolver`` takes a location; ``demands`` binds it to the planning scene, as
``areas`` of the floor, things to see and reaches. ``grasp_candidates`` and ``deliveries`` are tip poses for a reach,
``hand_predicates`` chooses them and tells whether a hand is somewhere, and where things can be; ``reachability`` maps
what arms reach, ``reachability_maps`` makes such maps, ``base_candidates`` turns them into base poses, ``search`` goes
through them within its budgets, ``floor_search`` through those that need no reach, ``hand_solutions`` finds joint
values, and ``validation`` checks each pose exactly. Of all base poses, those of process modules among them,
``base_poses`` knows which have room and a way. ``rejections`` count why there is nothing.
The believed world is asked through ``executive.belief.planning_scene``.
"""

from executive.locations.demands import Reach, ReachKind
from executive.locations.hand_solutions import HandSolution
from executive.locations.rejections import Rejections
from executive.locations.resolver import Resolver

__all__ = ["HandSolution", "Reach", "ReachKind", "Rejections", "Resolver"]
