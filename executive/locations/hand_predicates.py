"""Predicates of hands and things at locations: candidates that meet conjuncts about a hand, and poses of things.

Things are on and in things and before people.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum
from functools import partial
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from executive.belief.believed_bodies import Block
from executive.belief.planning_scene import PlanningScene
from executive.locations.areas import area_of
from executive.locations.demands import HandTerm, Reach, ReachKind, ThingDemand, bounds, hand_terms, in_words
from executive.locations.grasp_candidates import (
    APPROACH,
    CLASSES,
    HEADINGS,
    LIFTS,
    GraspCandidates,
    classified,
    grasping,
    held_above,
    offering,
    placing,
    retreating,
)
from executive.locations.reachability import GraspClass
from executive.locations.rejections import Rejections
from executive.motion import clearance_at
from executive.robots.arms import ArmModel, Held
from planlang.designators import Location
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import product, rigid, rotated
from planlang.relations import HEIGHTS, RELATIONS, Sense

SPACING = 0.04
"""Distance of neighbouring places on a surface [m]."""
MOST_PLACES = 4000
"""Places on one surface: on a large one they are farther apart."""
FREE = 0.005
"""Distance that an object keeps from others [m]."""
RESTING = 0.02
"""Largest distance of an object's lowest point from the surface that it rests on [m]."""
ABOVE_SURFACE = 0.002
"""Height above the surface at which an object is put [m]."""
EDGE = 0.03
"""Distance from the edge of a surface from which a place is as good as can be [m]."""
HAIR = 1e-6
"""Length that rounding may add [m]."""
TRAVEL = 4.0
"""Distance of the base over which a place loses most of its worth [m]."""


@dataclass(frozen=True, slots=True)
class Placement:
    """An object, and where a location asks it to be."""

    name: str
    demand: ThingDemand
    scene: PlanningScene

    def poses(self, log: Rejections) -> Iterator[Pose]:
        """Yield poses of the object's box centre, upright, best first; reasons of others are counted."""
        demand, bodies = self.demand, self.scene.bodies
        centres, yaw = self._centres()
        if not len(centres):
            log.add("too small for the object")
        for area in demand.areas:
            wanted = area.score(centres[:, :2]) > 0
            log.refuse(f"not {area.words}".replace("not not ", ""), centres[~wanted])
            centres = centres[wanted]
        for person, inside in demand.people:
            zone = bodies.zone(person)
            keep = np.array([zone.contains(centre) == inside for centre in centres], bool)
            log.refuse(f"{'not ' if inside else ''}in reach of {person}", centres[~keep])
            centres = centres[keep]
        upright = self._block(Pose.planar(0.0, 0.0, yaw))
        for body, inside in demand.neither:
            there = self._rests(upright, centres, body, inside=inside)
            log.refuse(f"{'in' if inside else 'on'} {body}", centres[there])
            centres = centres[~there]
        if not len(centres):
            return
        room = self._room(centres)
        crowded = room < FREE
        log.refuse("no room for the object", centres[crowded])
        for body in self._crowding(centres[crowded]):
            log.blocking[body] += 1
        score = np.clip(room, 0.0, 0.1) / 0.1
        if where := demand.on or demand.inside:  # rather not at the very edge
            spare = -_overhang(upright, centres[:, :2], bodies.block(where))
            score = score * (0.3 + 0.7 * np.clip(spare, 0.0, EDGE) / EDGE)
        for area in demand.areas:
            score = score * area.score(centres[:, :2])
        x, y, _ = self.scene.base()
        score = score * np.exp(-np.hypot(centres[:, 0] - x, centres[:, 1] - y) / TRAVEL)
        log.scored.append((centres[~crowded], score[~crowded]))
        order = np.argsort(-score.round(9), kind="stable")
        for x, y, z in centres[order[~crowded[order]]]:
            yield Pose.planar(float(x), float(y), yaw, float(z))

    def holds(self, pose: Pose) -> bool:
        """Return whether the object, at a pose, is where it is asked to be."""
        demand, block = self.demand, self._block(pose)
        resting = [
            (demand.on, False, True),
            (demand.inside, True, True),
            *((*other, False) for other in demand.neither),
        ]
        for body, inside, wanted in resting:
            if body is not None and self._rests(block, block.centre[None], body, inside=inside)[0] != wanted:
                return False
        if not all(area.holds(pose.position[:2]) for area in demand.areas):
            return False
        centre, bodies = np.array(pose.position), self.scene.bodies
        return all(bodies.zone(person).contains(centre) == inside for person, inside in demand.people)

    @property
    def _size(self) -> tuple[float, float, float]:
        return self.scene.bodies.size(self.name)

    def _block(self, pose: Pose) -> Block:
        return Block.of(pose, self._size, cylinder=self.scene.bodies.is_round(self.name))

    def _rests(self, block: Block, centres: Array, body: str, *, inside: bool) -> NDArray[np.bool_]:
        """Return whether a block, centred at places (m, 3), rests on a body, or is ``inside`` it, as a whole (m,)."""
        outer, top = self.scene.bodies.block(body), self.scene.bodies.rests_at(body)
        half = (block.high - block.low) / 2
        low, high = centres[:, 2] - half, centres[:, 2] + half
        if inside:
            level = (low >= outer.low - RESTING) & (high <= outer.high + RESTING)
        else:
            level = np.zeros(len(centres), bool) if top is None else np.abs(low - top) <= RESTING
        if not level.any():
            return level
        return np.asarray(level & (_overhang(block, centres[:, :2], outer) <= HAIR))

    def _centres(self) -> tuple[Array, float]:
        """Return places (m, 3) for the object's centre, and its heading."""
        demand, bodies, size = self.demand, self.scene.bodies, self._size
        where = demand.on or demand.inside
        if where is None:
            zones = [bodies.zone(person).points() for person, inside in demand.people if inside]
            return np.concatenate([np.zeros((0, 3)), *zones]), 0.0
        block = bodies.block(where)
        floor = bodies.rests_at(where) if demand.on is not None else block.low
        half_x, half_y = block.half_x - size[0] / 2, block.half_y - size[1] / 2
        too_high = demand.inside is not None and size[2] > block.high - block.low
        if floor is None or half_x < 0 or half_y < 0 or too_high:
            return np.zeros((0, 3)), block.yaw
        spacing = max(SPACING, 2 * math.sqrt(half_x * half_y / MOST_PLACES))
        axes = [np.linspace(-half, half, 2 * math.ceil(half / spacing) + 1) for half in (half_x, half_y)]
        places = block.to_map(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2))
        if block.round:
            places = places[_overhang(self._block(Pose.planar(0.0, 0.0, block.yaw)), places, block) <= HAIR]
        return np.column_stack([places, np.full(len(places), floor + ABOVE_SURFACE + size[2] / 2)]), block.yaw

    def _room(self, centres: Array) -> Array:
        """Return free distance (m,) around the object at places (m, 3), to all but what it is on."""
        boxes, _ = self.scene.collisions.boxes_but((self.name, self.demand.on or ""))
        radius = max(self._size[:2]) / 2 if self.scene.bodies.is_round(self.name) else math.hypot(*self._size[:2]) / 2
        room = np.full(len(centres), np.inf)
        for z in np.unique(centres[:, 2]):
            level = centres[:, 2] == z
            room[level] = clearance_at(centres[level, :2], boxes, (self._band(float(z), radius),))
        return room

    def _crowding(self, centres: Array) -> list[str]:
        """Return the bodies that take the room at some of the places."""
        boxes, bodies = self.scene.collisions.boxes_but((self.name, self.demand.on or ""))
        found: dict[str, None] = {}
        for x, y, z in centres[:: max(1, len(centres) // 16)]:
            band = self._band(float(z), max(self._size[:2]) / 2)
            for index, body in enumerate(bodies):
                if body not in found and clearance_at([(x, y)], boxes.only(index), (band,))[0] < FREE:
                    found[body] = None
        return list(found)

    def _band(self, z: float, radius: float) -> tuple[float, float, float]:
        """Return the room that the object takes with its centre at a height, a little above what it is on."""
        half = self._size[2] / 2
        return z - half + ABOVE_SURFACE, z + half, radius


def _overhang(block: Block, points: Array, outer: Block) -> Array:
    """Return how far a block's footprint, its middle at points (m, 2), is at most beyond another's outline (m,) [m]."""
    if block.round:
        edge, radius = np.zeros((1, 2)), max(block.half_x, block.half_y)
    else:
        signs = np.array([[a, b] for a in (-1, 1) for b in (-1, 1)])
        edge = block.to_map(signs * [block.half_x, block.half_y]) - [block.x, block.y]
        radius = 0.0
    spots = (points[:, None] + edge).reshape(-1, 2)
    if outer.round:
        beyond = np.hypot(spots[:, 0] - outer.x, spots[:, 1] - outer.y) - max(outer.half_x, outer.half_y)
    else:
        beyond = (np.abs(outer.to_local(spots)) - [outer.half_x, outer.half_y]).max(axis=1)
    return np.asarray(beyond.reshape(len(points), -1).max(axis=1) + radius)


AT_CENTRE = 0.01
"""Largest distance of a grip point from the centre, or from the line from there up [m]."""
AT_POSE = 0.02
"""Largest distance of the hand from its pose before a thing [m]."""
LEVEL = 0.2
"""Largest lean of a level hand, or of an upright thing in it [rad]."""

Mask = NDArray[np.bool_]


def hand_holds(location: Location, arm: ArmModel, scene: PlanningScene, viewer: tuple[float, float]) -> bool:
    """Return whether an arm's hand is at a location now; raises LocationMeaningless for what means nothing."""
    terms = hand_terms(location, scene.bodies, viewer)
    tip = scene.arms.tip(arm)
    points, rotations = tip[None, :3, 3], tip[None, :3, :3]
    if location.grasp is not None and CLASSES[classified(tip[:3, :3], arm.frame)[0]] is not GraspClass(location.grasp):
        return False
    return all(bool(satisfied(term, points, rotations, arm, scene)[0]) for term in terms)


def satisfied(term: HandTerm, points: Array, rotations: Array, arm: ArmModel, scene: PlanningScene) -> Mask:
    """Return for which tip poses, points (n, 3) and rotations (n, 3, 3) in the map, a conjunct holds, (n,)."""
    return np.asarray(_holds(term, points, rotations, arm, scene) != term.negated)


def _holds(term: HandTerm, points: Array, rotations: Array, arm: ArmModel, scene: PlanningScene) -> Mask:
    held = scene.arms.held(arm.name)
    middles = points if held is None else points + held.offsets(rotations)
    block = scene.bodies.block(term.body)
    handled = scene.bodies.is_graspable(term.body) or scene.arms.is_held(term.body)
    meaning = RELATIONS[term.name].hand
    assert meaning is not None, f"{term.name} means nothing for a hand"
    match meaning.sense:
        case Sense.REACH if scene.bodies.is_person(term.body):
            zone = scene.bodies.zone(term.body)
            return np.array([zone.contains(point) for point in middles], bool)
        case Sense.GRASP_POINT:
            return _is_at(points, block)
        case Sense.REACH if handled:
            return _is_at(points, block)
        case Sense.REACH | Sense.OVER:
            low, high = bounds(term.within, term.beyond, meaning.bounds) if meaning.bounds else HEIGHTS
            over = points[:, 2] + arm.lowest(rotations, held) - block.high
            inside = block.distance(middles[:, :2]) <= 0
            return np.asarray((over >= low - HAIR) & (over <= high + HAIR) & inside & _level(rotations, arm, held))
        case Sense.SUPPORT | Sense.CONTAINMENT:
            if held is None or held.name == term.body:
                return np.zeros(len(points), bool)
            demand = ThingDemand(term.body) if meaning.sense is Sense.SUPPORT else ThingDemand(None, term.body)
            offset = held.pose.matrix()[:3, :3]
            placement, turned = Placement(held.name, demand, scene), rigid(product(rotations, offset), middles)
            return np.array([placement.holds(Pose.from_matrix(pose)) for pose in turned], bool)
        case Sense.PRE_GRASP if handled:
            ahead = points + APPROACH * rotated(rotations, np.asarray(arm.frame.approach)) - block.centre
            raised = max(LIFTS) if scene.arms.is_held(term.body) else 0.0
            near = np.linalg.norm(ahead[:, :2], axis=1) <= AT_POSE
            highest = max(raised, block.high - block.centre[2])
            return np.asarray(near & (ahead[:, 2] >= -AT_POSE) & (ahead[:, 2] <= highest + AT_POSE))
    assert meaning.bounds is not None, f"{term.name} is no area for a hand"
    area = area_of(
        term.name,
        term.body,
        block,
        RELATIONS[term.name].directions,
        front=scene.bodies.front(term.body),
        viewer=term.viewer or scene.base()[:2],
        radius=0.0,
        bounds=bounds(term.within, term.beyond, meaning.bounds),
    )
    return np.asarray(area.score(middles[:, :2]) > 0)


def _is_at(points: Array, block: Block) -> Mask:
    """Return which grip points (n, 3) are in the middle of a block, or over that as far as it reaches, (n,)."""
    away = points - block.centre
    away[:, 2] -= np.clip(away[:, 2], 0.0, block.high - block.centre[2])
    return np.asarray(np.linalg.norm(away, axis=1) <= AT_CENTRE)


def _level(rotations: Array, arm: ArmModel, held: Held | None) -> Mask:
    """Return whether the hand is level, or what it holds upright."""
    if held is not None:
        return np.asarray(rotated(rotations, held.pose.matrix()[:3, 2])[:, 2] >= math.cos(LEVEL))
    axes = [rotated(rotations, np.asarray(axis)) for axis in (arm.frame.approach, arm.frame.closing)]
    return np.asarray(np.max([np.abs(axis[:, 2]) for axis in axes], axis=0) <= math.sin(LEVEL))


class Stage(IntEnum):
    """The share of a hand's candidates that is looked at; each stage has those of the ones before."""

    NATURAL = 0
    ALL = 1
    CLOSEST = 2
    """With twice as many directions of a grasp: between things that stand close a few degrees matter."""


NATURAL = (GraspClass.SIDE,)
"""Classes of grasps that are tried first."""
MOST_SPOTS = 24
"""Places on a surface that a hand is asked to put something on."""


def candidates_of(
    reach: Reach, arm: ArmModel, scene: PlanningScene, rejections: Rejections, stage: Stage
) -> GraspCandidates | None:
    """Return candidates to satisfy a reach with an arm; None, with the reason counted, if there are none."""
    candidates = _made(reach, arm, scene, rejections, stage)
    if candidates is None or not len(candidates):
        return None
    step = candidates.key if not reach.before else 0 if reach.kind is ReachKind.GRASP else -1
    for term in reach.also:
        kept = satisfied(term, candidates.points + candidates.offsets[:, step], candidates.rotations, arm, scene)
        if not kept.all():
            unmet = in_words(term.name, term.body, negated=not term.negated)
            rejections.add(unmet, int((~kept).sum()))
        candidates = candidates.chosen(kept)
    return candidates if len(candidates) else None


def _made(
    reach: Reach, arm: ArmModel, scene: PlanningScene, rejections: Rejections, stage: Stage
) -> GraspCandidates | None:
    held, fine = scene.arms.held(arm.name), stage > Stage.NATURAL
    match reach.kind:
        case ReachKind.GRASP:
            return _grasps(reach, arm, scene, rejections, stage)
        case ReachKind.RETREAT:
            return retreating(reach.body, scene.arms.grasped_at(reach.body), arm.frame)
        case ReachKind.ABOVE:
            block, lowest = scene.bodies.block(reach.body), partial(arm.lowest, held=held)
            candidates = held_above(
                reach.body, block, arm.frame, held, lowest, reach.heights, inset=arm.hand_radius, fine=fine
            )
            return _of_class(candidates, reach, rejections)
        case ReachKind.OFFER:
            return _of_class(
                offering(reach.body, scene.bodies.zone(reach.body), arm.frame, held, fine=fine), reach, rejections
            )
    if held is None:
        rejections.add("nothing in the hand to put down")
        return None
    if held.name == reach.body:
        rejections.add("nothing rests on itself")
        return None
    demand = ThingDemand(None if reach.inside else reach.body, reach.body if reach.inside else None)
    spots = islice(Placement(held.name, demand, scene).poses(rejections), MOST_SPOTS)
    centres = np.array([spot.position for spot in spots]).reshape(-1, 3)
    return placing(reach.body, centres, arm.frame, held, fine=fine) if len(centres) else None


def _grasps(
    reach: Reach, arm: ArmModel, scene: PlanningScene, rejections: Rejections, stage: Stage
) -> GraspCandidates | None:
    block = scene.bodies.block(reach.body)
    classes = (GraspClass(reach.grasp),) if reach.grasp is not None else CLASSES if stage else NATURAL
    headings = HEADINGS * 2**stage
    candidates = grasping(reach.body, block, arm.frame, arm.max_opening, classes, headings, arm.palm)
    if not len(candidates):
        rejections.add("no gripper" if arm.max_opening <= 0 else "too wide for the gripper")
        return None
    return candidates


def _of_class(candidates: GraspCandidates, reach: Reach, rejections: Rejections) -> GraspCandidates:
    if reach.grasp is None:
        return candidates
    kept = candidates.grasps == CLASSES.index(GraspClass(reach.grasp))
    rejections.add(f"not by a {reach.grasp} grasp", int((~kept).sum()))
    return candidates.chosen(kept)
