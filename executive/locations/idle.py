"""Arms and grasps that a location names though nothing in it is reached, or taken hold of, with them."""

from __future__ import annotations

from dataclasses import replace

from executive.belief.planning_scene import PlanningScene
from executive.locations.relations import Viewer, hand_demand
from planlang.designators import Location, Object

CHOSEN = ("grasp", "above", "offer")
"""What a hand does that can be done with several grasps: what it holds already, it holds as it does."""


def without_idle(location: Location, scene: PlanningScene, viewer: Viewer) -> Location:
    """The same places for the base, told without idle arms and grasps; raises LocationMeaningless as demands do."""
    whole = False, False
    relations = []
    for relation in location.relations:
        if relation.name == "in_reach_of":
            match relation.reference:
                case Location() as hand:
                    kind = hand_demand(hand, scene, viewer).kind
                    uses = hand.device is None, hand.grasp is None and kind == "grasp"
                    if kind not in CHOSEN:
                        relation = replace(relation, reference=replace(hand, grasp=None))
                case Object() as what:
                    uses = True, not scene.bodies.is_person(scene.bodies.bind(what))
            whole = whole[0] or uses[0], whole[1] or uses[1]
        relations.append(relation)
    device, grasp = location.device if whole[0] else None, location.grasp if whole[1] else None
    return replace(location, relations=tuple(relations), device=device, grasp=grasp)
