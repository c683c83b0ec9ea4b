"""Locations: from relations such as "in reach of the patient" to base poses and hand poses.

In the order of a query: ``resolver`` takes a location; ``demands`` binds it to the planning scene, as ``areas`` of the
floor, things to see and reaches. ``grasp_candidates`` and ``deliveries`` generate tip poses for a reach;
``hand_predicates`` selects them, and checks hands and things against locations. ``reachability`` maps the workspace of
arms, ``reachability_maps`` builds these maps, ``inverse_maps`` prepares them for ``base_candidates``, which inverts
them to base poses, ``search`` goes through these within its budgets, ``floor_search`` through those that need no reach.
``hand_solutions`` solves for joint values, and ``validation`` checks each pose exactly. ``looks`` puts looks at unsure
things before it, ``explanations`` and ``changes`` say what would help. ``base_poses`` knows which base poses have room
and a path; from ``standing`` come those at which the process modules stand elsewhere. ``rejections`` counts why there
are none. The believed world is queried through ``executive.belief.planning_scene``.
"""

from executive.locations.hand_solutions import HandSolution
from executive.locations.rejections import Rejections
from executive.locations.resolver import Resolver
from planlang.relations.demands import Reach, ReachKind

__all__ = ["HandSolution", "Reach", "ReachKind", "Rejections", "Resolver"]
