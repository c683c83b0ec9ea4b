"""Poses of objects on and in things and before people, and checks of such poses."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from executive.belief.believed_bodies import Block
from executive.belief.planning_scene import PlanningScene
from executive.locations.demands import ThingDemand
from executive.locations.rejections import Rejections
from executive.motion import clearance_at
from planlang.geometry import Array, Pose

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

Size = tuple[float, float, float]


def thing_poses(
    name: str, size: Size, demand: ThingDemand, scene: PlanningScene, rejections: Rejections
) -> Iterator[Pose]:
    """Yield poses of an object's box centre, upright, best first; reasons of others are counted."""
    centres, yaw = _centres(name, size, demand, scene)
    if not len(centres):
        rejections.add("too small for the object")
    for area in demand.areas:
        wanted = area.score(centres[:, :2]) > 0
        rejections.refuse(f"not {area.words}".replace("not not ", ""), centres[~wanted])
        centres = centres[wanted]
    for person, inside in demand.people:
        zone = scene.bodies.zone(person)
        keep = np.array([zone.contains(centre) == inside for centre in centres], bool)
        rejections.refuse(f"{'not ' if inside else ''}in reach of {person}", centres[~keep])
        centres = centres[keep]
    upright = Block.of(Pose.planar(0.0, 0.0, yaw), size, cylinder=scene.bodies.is_round(name))
    for body, inside in demand.neither:
        there = _rests(upright, centres, body, scene, inside=inside)
        rejections.refuse(f"{'in' if inside else 'on'} {body}", centres[there])
        centres = centres[~there]
    if not len(centres):
        return
    room = _room(name, size, centres, demand, scene)
    crowded = room < FREE
    rejections.refuse("no room for the object", centres[crowded])
    for body in _crowding(name, size, centres[crowded], demand, scene):
        rejections.blocking[body] += 1
    score = np.clip(room, 0.0, 0.1) / 0.1
    if where := demand.on or demand.inside:  # rather not at the very edge
        spare = -_overhang(upright, centres[:, :2], scene.bodies.block(where))
        score = score * (0.3 + 0.7 * np.clip(spare, 0.0, EDGE) / EDGE)
    for area in demand.areas:
        score = score * area.score(centres[:, :2])
    x, y, _ = scene.base()
    score = score * np.exp(-np.hypot(centres[:, 0] - x, centres[:, 1] - y) / 4.0)
    rejections.scored.append((centres[~crowded], score[~crowded]))
    order = np.argsort(-score.round(9), kind="stable")
    for x, y, z in centres[order[~crowded[order]]]:
        yield Pose.planar(float(x), float(y), yaw, float(z))


def thing_holds(name: str, pose: Pose, size: Size, demand: ThingDemand, scene: PlanningScene) -> bool:
    """Return whether an object at a pose is where it is asked to be."""
    block = Block.of(pose, size, cylinder=scene.bodies.is_round(name))
    centre = block.centre[None]
    resting = [(demand.on, False, True), (demand.inside, True, True), *((*other, False) for other in demand.neither)]
    for body, inside, wanted in resting:
        if body is not None and _rests(block, centre, body, scene, inside=inside)[0] != wanted:
            return False
    x, y, z = pose.position
    if not all(area.holds((x, y)) for area in demand.areas):
        return False
    return all(scene.bodies.zone(person).contains(np.array([x, y, z])) == inside for person, inside in demand.people)


def _rests(block: Block, centres: Array, body: str, scene: PlanningScene, *, inside: bool) -> NDArray[np.bool_]:
    """Return whether a block, centred at places (m, 3), rests on a body, or is ``inside`` it, as a whole (m,)."""
    outer, top = scene.bodies.block(body), scene.bodies.rests_at(body)
    half = (block.high - block.low) / 2
    low, high = centres[:, 2] - half, centres[:, 2] + half
    if inside:
        level = (low >= outer.low - RESTING) & (high <= outer.high + RESTING)
    else:
        level = np.zeros(len(centres), bool) if top is None else np.abs(low - top) <= RESTING
    if not level.any():
        return level
    return np.asarray(level & (_overhang(block, centres[:, :2], outer) <= HAIR))


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


def _centres(name: str, size: Size, demand: ThingDemand, scene: PlanningScene) -> tuple[Array, float]:
    """Return places (m, 3) for an object's centre, and its heading."""
    where = demand.on or demand.inside
    if where is None:
        zones = [scene.bodies.zone(person).points() for person, inside in demand.people if inside]
        points = np.concatenate(zones) if zones else np.zeros((0, 3))
        return points, 0.0
    block = scene.bodies.block(where)
    floor = scene.bodies.rests_at(where) if demand.on is not None else block.low
    half_x, half_y = block.half_x - size[0] / 2, block.half_y - size[1] / 2
    if floor is None or half_x < 0 or half_y < 0 or (demand.inside is not None and size[2] > block.high - block.low):
        return np.zeros((0, 3)), block.yaw
    spacing = max(SPACING, 2 * math.sqrt(half_x * half_y / MOST_PLACES))
    axes = [np.linspace(-half, half, 2 * math.ceil(half / spacing) + 1) for half in (half_x, half_y)]
    places = block.to_map(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2))
    if block.round:
        upright = Block.of(Pose.planar(0.0, 0.0, block.yaw), size, cylinder=scene.bodies.is_round(name))
        places = places[_overhang(upright, places, block) <= HAIR]
    return np.column_stack([places, np.full(len(places), floor + ABOVE_SURFACE + size[2] / 2)]), block.yaw


def _room(name: str, size: Size, centres: Array, demand: ThingDemand, scene: PlanningScene) -> Array:
    """Return free distance (m,) around an object at places (m, 3) of one height, to all but what it is on."""
    boxes, _ = scene.collisions.boxes_but((name, demand.on or ""))
    radius = math.hypot(size[0], size[1]) / 2 if not scene.bodies.is_round(name) else max(size[:2]) / 2
    room = np.full(len(centres), np.inf)
    for z in np.unique(centres[:, 2]):
        level = centres[:, 2] == z
        band = (float(z) - size[2] / 2 + ABOVE_SURFACE, float(z) + size[2] / 2, radius)
        room[level] = clearance_at(centres[level, :2], boxes, (band,))
    return room


def _crowding(name: str, size: Size, centres: Array, demand: ThingDemand, scene: PlanningScene) -> list[str]:
    """Return the bodies that take the room at some of the places."""
    boxes, bodies = scene.collisions.boxes_but((name, demand.on or ""))
    radius = max(size[:2]) / 2
    found: dict[str, None] = {}
    for x, y, z in centres[:: max(1, len(centres) // 16)]:
        band = (float(z) - size[2] / 2 + ABOVE_SURFACE, float(z) + size[2] / 2, radius)
        for index, body in enumerate(bodies):
            if body not in found and clearance_at([(x, y)], boxes.only(index), (band,))[0] < FREE:
                found[body] = None
    return list(found)
