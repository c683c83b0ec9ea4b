"""Predicates of hands and things at locations: candidates that meet conjuncts about a hand, and poses of things."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from enum import IntEnum
from functools import partial

import numpy as np
from numpy.typing import NDArray

from executive.belief.planning_scene import PlanningScene
from executive.locations.deliveries import BARELY_RAISED, Spots, held_above, offering, placing
from executive.locations.demands import ThingDemand, hand_terms, put_demand
from executive.locations.dropping import drop_heights
from executive.locations.grasp_candidates import (
    APPROACH,
    CLASSES,
    FOREARM,
    HEADINGS,
    LIFT,
    LIFTS,
    GraspCandidates,
    beside,
    classified,
    grasping,
    lifted,
    retreating,
    taken_out,
)
from executive.locations.grasps_from_above import (
    BETWEEN_FINGERS,
    DEEPEST,
    FROM_ABOVE,
    by_its_rim,
    from_above,
    grips,
    is_dish,
    is_flat,
    is_low,
)
from executive.locations.headroom import NO_WAY_OUT, ONWARDS, headroom, way_out
from executive.locations.placement import HAIR, UPRIGHT, Placement, attitudes
from executive.locations.reachability import GraspClass
from executive.locations.rejections import Rejections
from executive.motion import clearance_at
from executive.robots.arms import ArmModel, Held, called
from executive.robots.openings import REMEDY
from planlang.designators import Location
from planlang.geometry import Array, Pose
from planlang.geometry.areas import Block
from planlang.geometry.matrices import inverse, product, rigid, rotated
from planlang.relations import RELATIONS
from planlang.relations.demands import AtGrip, BeforeGrip, Conjunct, InZone, Over, Reach, ReachKind, Rest

AT_CENTRE = 0.01
"""Largest distance of a grip point from the centre, or from the vertical through it [m]."""
OTHER_GRIP = math.radians(30.0)
"""Smallest difference in steepness from a grip that could not be used [rad]."""
FINGERS = 0.05
"""Greatest length of fingers beyond the grip point [m]."""
AT_POSE = 0.02
"""Largest distance of the hand from its pre-grasp pose [m]."""
OVER = 0.02
"""Height above a thing within which another body blocks grip points on it [m]."""
LEVEL = 0.2
"""Largest tilt of a level hand, or of an upright thing in it [rad]."""

Mask = NDArray[np.bool_]


def hand_holds(location: Location, arm: ArmModel, scene: PlanningScene, viewer: tuple[float, float]) -> bool:
    """Check whether an arm's hand is at a location now; raises LocationMeaningless for a meaningless one."""
    terms = hand_terms(location, scene, viewer)
    tip = scene.arms.tip(arm)
    points, rotations = tip[None, :3, 3], tip[None, :3, :3]
    if location.grasp is not None and CLASSES[classified(tip[:3, :3], arm.frame)[0]] is not GraspClass(location.grasp):
        return False
    return all(bool(satisfied(term, points, rotations, arm, scene)[0]) for term in terms)


def satisfied(term: Conjunct, points: Array, rotations: Array, arm: ArmModel, scene: PlanningScene) -> Mask:
    """Check for which tip poses, points (n, 3) and rotations (n, 3, 3) in the map, a conjunct holds, (n,)."""
    return np.asarray(_holds(term, points, rotations, arm, scene) != term.negated)


def _holds(term: Conjunct, points: Array, rotations: Array, arm: ArmModel, scene: PlanningScene) -> Mask:
    held, demand = scene.arms.held(arm.name), RELATIONS[term.name].hand(term, scene.bodies)
    middles = points if held is None else points + held.offsets(rotations)
    match demand:
        case InZone(person):
            zone = scene.bodies.zone(person)
            return np.array([zone.contains(point) for point in middles], bool)
        case AtGrip(body):
            tips = _between_fingers(points, rotations, body, arm, scene)
            return _is_at(tips, scene.bodies.block(body)) | _is_at_handle(tips, body, scene)
        case BeforeGrip(body):
            block = scene.bodies.block(body)
            tips = _between_fingers(points, rotations, body, arm, scene)
            ahead = tips + APPROACH * rotated(rotations, np.asarray(arm.frame.approach)) - block.centre
            raised = max(LIFTS) if scene.bodies.is_held(body) else 0.0
            near = _beside(ahead + block.centre, block) <= AT_POSE
            highest, lowest = max(raised, block.high - block.centre[2]), (block.low - block.centre[2]) / 2
            middle = near & (ahead[:, 2] >= lowest - AT_POSE) & (ahead[:, 2] <= highest + AT_POSE)
            return np.asarray(middle | _is_at_handle(ahead + block.centre, body, scene, raised))
        case Over(body, (low, high)):
            block = scene.bodies.block(body)
            over = points[:, 2] + arm.lowest(rotations, held) - block.high
            inside = block.distance(middles[:, :2]) <= 0
            return np.asarray(
                (over >= low - HAIR) & (over <= high + HAIR) & inside & _level(rotations, arm, held, _kept(held, scene))
            )
        case Rest(body, inside):
            if held is None or held.name == body:
                return np.zeros(len(points), bool)
            placement = Placement(held.name, ThingDemand(*((None, body) if inside else (body, None))), scene)
            turned = rigid(product(rotations, held.pose.matrix()[:3, :3]), middles)
            return np.array([placement.holds(Pose.from_matrix(pose)) for pose in turned], bool)
        case None:
            raise AssertionError(f"{term.name} means nothing for a hand")
    return np.asarray(demand.score(middles[:, :2]) > 0)


def _between_fingers(points: Array, rotations: Array, body: str, arm: ArmModel, scene: PlanningScene) -> Array:
    """Compute where empty fingers would grip a body at tips (n, 3): beside the tip for fingers that swing."""
    if not len(arm.openings.jaw) or scene.arms.held(arm.name) is not None:
        return points
    return points + rotated(rotations, arm.openings.middles(np.array([narrowest(scene.bodies.block(body))]))[0])


def _is_at_handle(points: Array, body: str, scene: PlanningScene, raised: float = 0.0) -> Mask:
    """Check which grip points (n, 3) are at one of a body's handles, or up to ``raised`` [m] above."""
    _, *handles = scene.bodies.grips(body)
    distances = [[one.away(point) for one in handles] for point in points]
    return np.array([min(row, default=math.inf) <= FINGERS + raised for row in distances], bool)


def _is_at(points: Array, block: Block) -> Mask:
    """Check which grip points (n, 3) are where a block is gripped: in the middle, or above or below it.

    Up to its top, down to half its lower part; above a low block as far as fingers reach down.
    """
    height = points[:, 2] - block.centre[2]
    highest = block.high - block.centre[2] + (FINGERS if is_low(block) or block.wall > 0 else 0.0)
    lowest = (block.low - block.centre[2]) / 2
    return np.asarray(np.hypot(_beside(points, block), height - np.clip(height, lowest, highest)) <= AT_CENTRE)


def _beside(points: Array, block: Block) -> Array:
    """Horizontal distances of points (n, 3) from the nearest grip point of a block (n,) [m]."""
    offsets = (
        points[:, None, :2] - (grips(block) if is_low(block) or block.wall > 0 else block.centre[None])[None, :, :2]
    )
    return np.asarray(np.linalg.norm(offsets, axis=2).min(axis=1))


def _kept(held: Held | None, scene: PlanningScene) -> tuple[Pose, ...]:
    """List the attitudes in which a held thing is put down: upright, and as it lay."""
    return (UPRIGHT,) if held is None else attitudes(scene.bodies.pose(held.name))


def _level(rotations: Array, arm: ArmModel, held: Held | None, kept: Sequence[Pose]) -> Mask:
    """Check whether the hand is level, or the held thing in one of the attitudes ``kept``."""
    if held is not None:
        ups = [rotated(held.pose.matrix()[:3, :3], one.matrix()[2, :3]) for one in kept]
        return np.asarray(np.max([rotated(rotations, up)[:, 2] for up in ups], axis=0) >= math.cos(LEVEL))
    axes = [rotated(rotations, np.asarray(axis)) for axis in (arm.frame.approach, arm.frame.closing)]
    return np.asarray(np.max([np.abs(axis[:, 2]) for axis in axes], axis=0) <= math.sin(LEVEL))


class Stage(IntEnum):
    """Share of a hand's candidates to consider; each stage includes the ones before."""

    NATURAL = 0
    ALL = 1
    CLOSEST = 2
    """Twice as many headings: between closely spaced things a few degrees matter."""


NATURAL = (GraspClass.SIDE,)
"""Grasp classes that are tried first."""
MOST_SPOTS = (24, 48, 96)
"""Number of places on a surface to put something, at each stage."""
GOOD = (0.7, 0.35, 0.0)
"""Smallest score of a place, as a share of the best, at each stage: poor ones come last."""
SPREAD = (0.3, 0.08)
"""Distances of these places from each other, if possible [m]: the best ones alone are close together.

Half of them are far apart, since the middle of a large surface may be out of reach."""


def candidates_of(
    reach: Reach, arm: ArmModel, scene: PlanningScene, rejections: Rejections, stage: Stage
) -> list[GraspCandidates]:
    """Generate candidates for a reach with an arm, one table per opening of the hand; count why there are none."""
    tables = [table for table in _generated(reach, arm, scene, rejections, stage) if len(table)]
    kept = [
        _not_refused(_among(table, reach, arm, scene, rejections), reach, arm, scene, rejections) for table in tables
    ]
    return [part for table in kept for part in table.by_opening(arm.openings)]


def _among(
    candidates: GraspCandidates, reach: Reach, arm: ArmModel, scene: PlanningScene, rejections: Rejections
) -> GraspCandidates:
    """Select the candidates for which the reach's other conjuncts hold."""
    step = candidates.key if not reach.before else 0 if reach.kind is ReachKind.GRASP else -1
    # for PLACE the spots already satisfy the other conjuncts
    for term in (term for term in reach.also if reach.kind is not ReachKind.PLACE or not RELATIONS[term.name].of_thing):
        kept = satisfied(term, candidates.points + candidates.offsets[:, step], candidates.rotations, arm, scene)
        if not kept.all():
            rejections.add(replace(term, negated=not term.negated).words, int((~kept).sum()))
        candidates = candidates.chosen(kept)
    return candidates


def _not_refused(
    candidates: GraspCandidates, reach: Reach, arm: ArmModel, scene: PlanningScene, rejections: Rejections
) -> GraspCandidates:
    """Drop grasps of a thing that resemble those with which it could not be used."""
    refused = scene.belief.memory.refused.get(reach.body, ()) if reach.kind is ReachKind.GRASP else ()
    if not refused or not len(candidates):
        return candidates
    thing = scene.bodies.pose(reach.body).matrix()
    offsets = product(inverse(rigid(candidates.rotations, candidates.points)), thing)
    approach, kept = np.array(arm.frame.approach), np.ones(len(candidates), bool)
    lean = np.arccos(np.clip(offsets[:, :3, 2] @ approach, -1.0, 1.0))
    for grip in refused:
        # side and roll of the hand depend on the base pose; only its steepness makes another grip
        other = math.acos(float(np.clip(grip.matrix()[:3, 2] @ approach, -1.0, 1.0)))
        kept &= np.abs(lean - other) > OTHER_GRIP
    rejections.add("a grip that could not be used", int((~kept).sum()))
    return candidates.chosen(kept)


def _generated(
    reach: Reach, arm: ArmModel, scene: PlanningScene, rejections: Rejections, stage: Stage
) -> list[GraspCandidates]:
    held, fine = scene.arms.held(arm.name), stage > Stage.NATURAL
    match reach.kind:
        case ReachKind.GRASP:
            return _grasps(reach, arm, scene, rejections, stage)
        case ReachKind.RETREAT:
            way = way_out(reach.body, scene)
            if way is None:
                rejections.add(NO_WAY_OUT)
                return []
            room = _room_above(reach.body, scene)
            return [retreating(reach.body, scene.arms.grasped_at(reach.body), arm.frame, way, room)]
        case ReachKind.ABOVE:
            block, lowest = scene.bodies.block(reach.body), partial(arm.lowest, held=held)
            kept = _kept(held, scene)
            candidates = held_above(
                reach.body, block, arm.frame, held, lowest, reach.heights, inset=arm.hand_radius, fine=fine, kept=kept
            )
            return [_of_class(candidates, reach, rejections)]
        case ReachKind.OFFER:
            return [_of_class(delivering(reach, arm, held, scene, rejections, stage), reach, rejections)]
    if held is None:
        rejections.add("the hand holds nothing to put down")
        return []
    if held.name == reach.body:
        rejections.add("nothing can rest on itself")
        return []
    return [delivering(reach, arm, held, scene, rejections, stage)]


def delivering(
    reach: Reach,
    arm: ArmModel,
    held: Held | None,
    scene: PlanningScene,
    rejections: Rejections,
    stage: Stage,
    spots: Sequence[Spots] | None = None,
) -> GraspCandidates:
    """Generate candidates to offer a thing to a person, or to put it down, as an arm holds it or would hold it.

    ``spots`` are those of :func:`spots_of`, if known.
    """
    fine = stage > Stage.NATURAL
    if reach.kind is ReachKind.OFFER:
        zone = scene.bodies.zone(reach.body)
        return offering(reach.body, zone, arm.frame, held, fine=fine, low=stage is Stage.CLOSEST)
    assert held is not None, "an empty hand puts nothing down"
    each = spots_of(reach, held.name, scene, rejections, stage) if spots is None else spots
    tables = [placing(reach.body, one, arm.frame, held, fine=fine) for one in each]
    if stage is Stage.CLOSEST:
        lower = [placing(reach.body, one.barely_raised(), arm.frame, held, fine=fine) for one in each]
        tables += [replace(table, weights=BARELY_RAISED * table.weights) for table in lower]
    return GraspCandidates.joined(tables)


def spots_of(reach: Reach, name: str, scene: PlanningScene, rejections: Rejections, stage: Stage) -> tuple[Spots, ...]:
    """Find where a thing may be put down, in each attitude some of the best: independent of how it is held.

    They do not depend on the base pose either; whether it reaches them is tested next. It is dropped only where it is
    not put down in a natural way.
    """
    demand, oblique = put_demand(reach, name, scene), stage is Stage.CLOSEST
    boxes, _ = scene.collisions.boxes_but((name,))
    found = []
    heights = (None, *(drop_heights(reach, name, scene) if stage > Stage.NATURAL else ()))
    for attitude, above_rim in ((one, height) for one in attitudes(scene.bodies.pose(name)) for height in heights):
        placement = Placement(name, demand, scene, near=False, oblique=oblique, attitude=attitude, above_rim=above_rim)
        places, scores = placement.spots(rejections)
        good = int((scores >= GOOD[stage] * scores.max(initial=0.0)).sum())
        chosen = _spread(places[:good], MOST_SPOTS[stage])
        block = placement.block(attitude)
        rooms = headroom(block, places[chosen], boxes)
        dropped = above_rim is not None
        found.append(Spots(attitude, places[chosen], scores[chosen], rooms, block.round, dropped))
    return tuple(found)


def _spread(spots: Array, most: int) -> list[int]:
    """Select the best of spots (n, 4), best first: some far apart from each other, some closer, then any."""
    chosen: list[int] = []
    for number, spread in enumerate(SPREAD, 1):
        free = np.ones(len(spots), bool)
        for index in chosen:
            free &= np.hypot(*(spots - spots[index])[:, :2].T) >= spread
        while free.any() and len(chosen) < most * number // len(SPREAD):
            chosen.append(int(free.argmax()))
            free &= np.hypot(*(spots - spots[chosen[-1]])[:, :2].T) >= spread
    rest = np.setdiff1d(np.arange(len(spots)), chosen)
    return sorted([*chosen, *rest[: most - len(chosen)].tolist()])


def _grasps(
    reach: Reach, arm: ArmModel, scene: PlanningScene, rejections: Rejections, stage: Stage
) -> list[GraspCandidates]:
    block, *handles = scene.bodies.grips(reach.body)
    tables = _around(block, reach, arm, scene, rejections, stage)
    for handle in handles:
        # there is room for the fingertips below a handle
        for one in (handle, replace(handle, low=handle.low - DEEPEST)) if is_flat(handle) else (handle,):
            handle_tables = _around(one, reach, arm, scene, rejections, stage)
            tables += [beside(table, block, handle, arm.hand_corners) for table in handle_tables]
    if not any(map(len, tables)) and reach.grasp is not None and all(map(is_flat, (block, *handles))):
        rejections.add("too low for a grasp except from above")
    elif not any(map(len, tables)) and not rejections.counts["under something else"]:
        _count_no_grip(reach, (block, *handles), arm, rejections)
    way = way_out(reach.body, scene) if any(map(len, tables)) else ONWARDS
    if way is None:
        rejections.add(NO_WAY_OUT, sum(map(len, tables)))
        return []
    if len(way):
        return [taken_out(table, way) for table in tables]
    room = _room_above(reach.body, scene)
    return tables if room >= LIFT else [lifted(table, room) for table in tables]


def _room_above(name: str, scene: PlanningScene) -> float:
    """Headroom of a thing where it is, or was grasped [m]."""
    block = scene.bodies.block(name)
    boxes, _ = scene.collisions.boxes_but((name,))
    return float(headroom(block, np.array([[*block.centre, block.yaw]]), boxes)[0])


def _count_no_grip(reach: Reach, grips: Sequence[Block], arm: ArmModel, rejections: Rejections) -> None:
    """Count why a hand cannot grasp a body at all, with the sizes of both."""
    if arm.max_opening <= 0:
        rejections.add("no gripper")
        return
    body, opening = reach.body, f"{arm.name} opens to {arm.max_opening:.3f} m"
    part, grip = narrowest_grip(body, grips)
    wide = narrowest(grip)
    if wide > arm.max_opening:
        reason, figures = "too wide for the gripper", f"{part} is {wide:.3f} m wide, {opening}"
    elif not arm.bare and wide > arm.max_opening - BETWEEN_FINGERS:
        reason, figures = "too wide for the gripper", barely_too_wide(part, wide, arm.max_opening, arm.name)
    elif arm.bare:
        reason, figures = "hand without shapes", unknown_fit(part, wide, arm)
    elif arm.covering is not None:
        reason = "no room between the fingers"
        figures = (
            f"{part} is {wide:.3f} m wide and would fit between the fingers ({opening}), but the <collision> shape of "
            f"{arm.covering} in the URDF covers the place between them: draw it, and the fingers, as they are"
        )
    else:
        reason = "no room for the hand around it"
        high, across = grip.high - grip.low, narrowest(replace(grip, wall=0.0))
        figures = (
            f"{part} is {across:.3f} m wide and fits between the fingers, but is only {high:.3f} m high: the palm or "
            f"the fingertips would touch {body} or what it stands on"
        )
    rejections.add(reason)
    rejections.figures[reason] = figures


def barely_too_wide(part: str, wide: float, opening: float, arm: str) -> str:
    """State that a part of a width [m] leaves the open fingers of an arm no room; they open to ``opening`` [m]."""
    return (
        f"{part} is {wide:.3f} m wide; the gripper of {called(arm)} opens to {opening:.3f} m, and needs "
        f"{BETWEEN_FINGERS:g} m of that to get around it"
    )


def unknown_fit(part: str, wide: float, arm: ArmModel) -> str:
    """State that nobody knows whether a part of a width [m] fits into a hand, which lacks shapes."""
    known = f"whether that fits into the hand of {called(arm.name)} is not known"
    return f"{part} is {wide:.3f} m wide; {known}, as {arm.bare}: {REMEDY}"


def narrowest_grip(body: str, grips: Sequence[Block]) -> tuple[str, Block]:
    """Find the grip of a body (itself, then its handles) that needs the smallest opening, and name it."""
    number = min(range(len(grips)), key=lambda row: narrowest(grips[row]))
    return f"the handle of {body}" if number else body, grips[number]


def narrowest(grip: Block) -> float:
    """Smallest finger opening with which to grip a part of a thing [m]."""
    if grip.soft:
        return 0.0
    return grip.wall or 2 * (max if grip.round else min)(grip.half_x, grip.half_y)


def _around(
    block: Block, reach: Reach, arm: ArmModel, scene: PlanningScene, rejections: Rejections, stage: Stage
) -> list[GraspCandidates]:
    """Generate grasps of a body, or of one of its handles, according to its shape."""
    # if a level hand has no room above the surface, only grasps from above can put the thing far into it
    natural = NATURAL if block.centre[2] - block.low >= FOREARM else CLASSES
    classes = (GraspClass(reach.grasp),) if reach.grasp is not None else CLASSES if stage else natural
    headings = HEADINGS * 2**stage
    middle = () if is_flat(block) else tuple(one for one in classes if not (is_low(block) and one in FROM_ABOVE))
    gaps = arm.openings.widest_gaps
    tables = [grasping(reach.body, block, arm.frame, arm.max_opening, middle, headings, arm.palm, gaps)]
    above = FROM_ABOVE if is_dish(block) and reach.grasp is None else tuple(one for one in FROM_ABOVE if one in classes)
    for one in _gripped_from_above(block, arm) if above else ():
        hands = [arm.hand_corners @ one.rotations([0.0], [1], arm.frame)[0].T for one in FROM_ABOVE]
        below = tuple(-float(corners[:, 2].min()) for corners in hands)
        ahead = tuple(float(corners[:, 0].max()) for corners in hands)
        # fingers below a handle do not come near the support
        advance = arm.openings.advance(narrowest(one)) if block == scene.bodies.block(reach.body) else 0.0
        low = from_above(reach.body, one, arm.frame, arm.max_opening, above, headings, below, advance, ahead)
        boxes, _ = scene.collisions.boxes_but((reach.body,))
        covered = clearance_at(low.points[:, :2], boxes, ((block.high, block.high + OVER, 0.0),)) < 0
        rejections.add("under something else", int(covered.sum()))
        low = low.chosen(~covered)
        tables.append(low)
    return tables


def _gripped_from_above(block: Block, arm: ArmModel) -> list[Block]:
    """List what fingers close on from above: a vessel's rim; low vessels are also gripped around."""
    if block.wall == 0:
        return [block] if is_low(block) else []
    without_rim = [replace(block, wall=0.0)] if is_low(block) and not is_flat(block) else []
    return [block, *without_rim] if by_its_rim(block, arm.max_opening) else without_rim


def _of_class(candidates: GraspCandidates, reach: Reach, rejections: Rejections) -> GraspCandidates:
    if reach.grasp is None:
        return candidates
    kept = candidates.grasps == CLASSES.index(GraspClass(reach.grasp))
    reason = f"not by a {reach.grasp} grasp"
    rejections.add(reason, int((~kept).sum()))
    possible = " or ".join(CLASSES[one].value for one in np.unique(candidates.grasps).tolist())
    if possible and not kept.any():
        rejections.figures[reason] = f"only a {possible} grasp is possible here: ask for that, or leave the grasp open"
    return candidates.chosen(kept)
