"""What later steps do: reach through a door or drawer, close it, or take another thing while the first is in a hand."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from executive.belief.planning_scene import PlanningScene
from executive.locations.demands import goals_of, use_at
from planlang.action_classes import levels_above
from planlang.designators import Action, Location, Object, a_location
from planlang.language.performing import actions_around
from planlang.language.remaining import remaining_actions
from planlang.relations.demands import ReachKind
from sim.joints import Articulation, JointKind

CLOSING = "ClosingAContainerArtifact"


def reached_through(joint: Articulation, scene: PlanningScene) -> Location | None:
    """Find where the base stands for the next step that reaches through a leaf, once that is open; None without one.

    The steps are those in progress and those that remain of the plan.
    """
    doors = beside(joint, scene)
    supposed = scene
    for one in doors:
        supposed = supposed.supposing(supposed.belief.with_leaf(one.leaf, 0.0))  # so that nothing is bound for good
    leaves = {one.leaf for one in doors}
    for each in _steps():
        what = each.get("object_acted_on")
        name = supposed.bodies.known(what) if isinstance(what, Object) else None
        if name is None or not isinstance(what, Object):
            continue
        if supposed.bodies.is_held(name):
            for goal in goals_of(name, [each], supposed):
                put = use_at(goal, name, supposed, supposed.base()[:2])
                is_inside = put is not None and put.kind is ReachKind.PLACE and put.inside
                if put is not None and is_inside and put.body in (*joint.bodies, joint.holder):
                    return a_location(in_reach_of=goal)
        elif supposed.bodies.is_graspable(name) and supposed.bodies.closed_before(name) in leaves:
            return a_location(in_reach_of=what)
    return None


def closed_later(joint: Articulation, scene: PlanningScene, ancestors: Callable[[str], Sequence[str]]) -> bool:
    """Check whether a step that remains closes a leaf, or all leaves of its furniture.

    ``ancestors`` maps an action class to itself and its superclasses.
    """
    bodies = scene.supposing(scene.belief.state).bodies  # so that nothing is bound for good
    for each in remaining_actions():
        what = each.get("object_acted_on")
        is_closing = isinstance(what, Object) and any(CLOSING in one for one in levels_above(each.type, ancestors))
        if is_closing and isinstance(what, Object) and bodies.known(what) in (joint.leaf, joint.holder):
            return True
    return False


def beside(joint: Articulation, scene: PlanningScene) -> tuple[Articulation, ...]:
    """List a leaf, and the other doors of its furniture: of two side by side, either may narrow the way in."""
    if joint.kind is JointKind.PRISMATIC or joint.holder is None:
        return (joint,)
    others = (one for one in scene.belief.joints.values() if one.holder == joint.holder and one.leaf != joint.leaf)
    return (joint, *(one for one in others if one.kind is JointKind.HINGED and not one.is_knob))


def fetched_beside(name: str, scene: PlanningScene) -> Object | None:
    """Find the thing that the next step about another one takes while ``name`` is in a hand; None without one.

    A step that brings ``name`` somewhere empties the hand before.
    """
    bodies = scene.supposing(scene.belief.state).bodies  # so that nothing is bound for good
    for each in remaining_actions():
        what = each.get("object_acted_on")
        other = bodies.known(what) if isinstance(what, Object) and what.iri is not None else None
        if other is None or not isinstance(what, Object):
            continue
        if other != name and bodies.is_graspable(other):
            return None if bodies.is_held(other) else what
        if other == name and any(each.get(role) is not None for role in ("to_location", "recipient")):
            return None
    return None


def _steps() -> Iterator[Action]:
    yield from actions_around()
    yield from remaining_actions()
