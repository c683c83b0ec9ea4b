"""Whether the base has a way to where a thing is brought, asked before the thing is taken.

Only what is sure is reported: with empty hands, with all doors open, and without what the robot may set aside or wait
for, the base gets nowhere near the goal. A failure after the thing was fetched would say the same much later.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from functools import partial

import numpy as np

from executive.belief.doorways import narrow_doorway
from executive.belief.planning_scene import PlanningScene
from executive.locations.changes import Changes, with_supports
from executive.locations.demands import bodies_in, goals_of, use_at
from executive.locations.rejections import Rejections
from planlang.advice import Change
from planlang.designators import Action, Location, a_location
from planlang.failures import LocationUnresolvable, ObjectUndeliverable


def check_goals(location: Location, actions: Iterable[Action], scene: PlanningScene) -> None:
    """Raise ObjectUndeliverable if the base has no way to where enclosing actions bring a thing that a location is of.

    Its cause names the doorway that is too narrow, or the body without which there is a way. Things that are held
    already, and robots that do not drive, are not checked.
    """
    if scene.robot.base.fixed:
        return
    actions, bodies = tuple(actions), scene.supposing(scene.belief.state).bodies  # so that nothing is bound for good
    for thing in dict.fromkeys(map(bodies.known, location.things())):
        if thing is None or bodies.is_held(thing):
            continue
        for goal in goals_of(thing, actions, scene):
            use = use_at(goal, thing, scene, scene.base()[:2])
            if use is not None and not _is_reached(use.body, scene) and not _is_reached(use.body, _at_best(scene)):
                needed = with_supports({use.body, *bodies_in(actions, scene, goal)}, scene.bodies)
                raise ObjectUndeliverable(what=thing) from _explained(use.body, scene, needed)


def _is_reached(body: str, scene: PlanningScene) -> bool:
    """Check whether the base gets so near to a body that an arm may reach something there."""
    within = max((arm.reach + float(np.hypot(*arm.shoulder_low[:2])) for arm in scene.arms.all), default=0.0)
    return scene.collisions.comes_near(scene.bodies.block(body), within)


def _at_best(scene: PlanningScene) -> PlanningScene:
    """Suppose that nothing is in the way that the robot could change, or that could leave by itself."""
    belief, bodies = scene.belief, scene.bodies
    loose = (name for name in bodies.names() if bodies.is_graspable(name))
    leaves = (name for joint in belief.joints.values() for name in joint.bodies)
    gone = dict.fromkeys((*loose, *belief.held, *leaves, *scene.movers()))
    return scene.supposing(replace(belief.state.placed(gone), held={}))


def _explained(goal: str, scene: PlanningScene, needed: set[str]) -> LocationUnresolvable:
    """Build the cause: which doorway is too narrow, or without which body the base gets there."""
    best, block = _at_best(scene), scene.bodies.block(goal)
    said, changes = f"the base cannot drive to where it could reach {goal}", tuple[Change, ...]()
    if (narrow := narrow_doorway(best, block.centre[:2])) is not None:
        said = f"{said}: {narrow}"
    else:
        fixed = {*needed, *filter(best.bodies.is_room, best.bodies.names())}
        closing = best.collisions.closes_way(block.centre[:2], block.half_x + block.half_y + 1.0, fixed)
        found = Changes(goal, best, Rejections(), partial(_is_reached, goal), needed=needed)
        if (advice := found.without_one_of(closing, fixed)) is not None:
            said, changes = f"{said}; {advice.sentence}", advice.changes
    wanted = a_location(in_reach_of=scene.bodies.designator(goal))
    return LocationUnresolvable(designator=str(wanted), figures=said, changes=changes)
