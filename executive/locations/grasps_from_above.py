"""Grasps from above of low things: by the rim of a dish, across flat things, by a fold of soft ones.

How deep the fingers go depends on the hand: their tips stay above the support, or above a dish's floor.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache

import numpy as np

from executive.locations.grasp_candidates import (
    CLASSES,
    OBLIQUE,
    GraspCandidates,
    directions,
    grasp_series,
    oriented,
)
from executive.locations.reachability import GraspClass
from executive.robots.arms import HandFrame
from planlang.geometry import Array
from planlang.geometry.areas import Block
from sim.bodies import SEGMENTS

FROM_ABOVE = (GraspClass.TOP, GraspClass.TILTED)
"""Classes of such grasps: a tilted hand reaches farther over a table."""
LOW = 0.08
"""Height up to which things are also grasped like this [m]; higher ones are gripped in the middle."""
FLAT = 0.04
"""Height up to which things are grasped only from above [m]: from the side the hand would hit their support."""
CLEARANCES = {GraspClass.TOP: (0.004, 0.012), GraspClass.TILTED: (-0.008, -0.002, 0.004)}
"""Distances of the hand from what is below it [m]: tips of tilted fingers are often round, and higher when open."""
OFF_FLOOR = 0.002
"""Least distance of a finger from the floor of a dish when it closes on the rim [m]."""
LONG = 3.0
"""Ratio of length to width above which a thing is also gripped off its middle."""
DEEPEST = 0.025
"""Depth to which fingers reach beside a rim [m]."""
ALONG_RIM = (0.0, 0.5, -0.5)
"""Places along a straight rim, from its middle, as shares of half its length."""
SHALLOW = 0.9
"""Weight of a grip that is higher than necessary."""
SMALL = 0.001
"""Advance of closing fingers below which no higher grip is needed [m]."""
BETWEEN_FINGERS = 0.003
"""Room that open fingers need beyond the width of a thing [m]."""
LEAST = 0.005
"""Smallest depth of the fingers beside what they grip [m]."""


def is_flat(block: Block) -> bool:
    """Check whether a thing is grasped only from above: plates, cloth, and flat things."""
    return block.soft or block.high - block.low <= FLAT


def is_low(block: Block) -> bool:
    """Check whether a thing is grasped from above with the fingers deep beside it, rather than in its middle."""
    return is_flat(block) or block.high - block.low <= LOW


def is_dish(block: Block) -> bool:
    """Check whether a thing is grasped from above by default: flat things and low vessels."""
    return is_flat(block) or (block.wall > 0 and is_low(block))


def by_its_rim(block: Block, max_opening: float) -> bool:
    """Check whether a hollow thing is grasped by its rim: a dish, or a vessel too wide for the fingers [m]."""
    return block.wall > 0 and (is_low(block) or 2 * min(block.half_x, block.half_y) > max_opening - BETWEEN_FINGERS)


def grips(block: Block) -> Array:
    """Grip points (n, 3) of a thing in the map: on its rim, on a cloth, or in its middle.

    They are at its top, except for the middle of a vessel.
    """
    edges = [(x, y, block.high) for x, y, _ in _places(block, 1)]
    return np.array(edges if block.wall == 0 or is_flat(block) else [*edges, block.centre])


@lru_cache(maxsize=8)
def from_above(
    name: str,
    block: Block,
    frame: HandFrame,
    max_opening: float,
    classes: tuple[GraspClass, ...],
    headings: int,
    below: tuple[float, ...],
    advance: float = 0.0,
    ahead: tuple[float, ...] = (0.0, 0.0),
) -> GraspCandidates:
    """Generate pre-grasp, grasp, lift and retreat from above for a low thing.

    ``classes`` are among :data:`FROM_ABOVE`; ``below`` and ``ahead`` are how far the hand extends below the grip point
    and, along a wall, beyond it in each of these [m], ``advance`` how far its fingers advance as they close.
    """
    parts = []
    for one in classes:
        number = FROM_ABOVE.index(one)
        reach = below[number], ahead[number]
        # fingers at a rim are rarely as low as the support
        raised = (0.0, advance * math.sin(one.pitch)) if advance > SMALL and not block.wall else (0.0,)
        parts += [_of_class(name, block, frame, max_opening, one, headings, reach, rise) for rise in raised]
    return GraspCandidates.joined(parts)


def _of_class(
    name: str,
    block: Block,
    frame: HandFrame,
    max_opening: float,
    grasp: GraspClass,
    headings: int,
    reach: tuple[float, float],
    rise: float,
) -> GraspCandidates:
    """Generate the grasps of one class, ``rise`` [m] higher, since the fingers come down when they close.

    ``reach`` is how far the hand extends below the grip point, and beyond it along a wall [m].
    """
    (below, ahead), floor = reach, block.low + block.wall
    # a tilted grip allows placing farther into a table; without the need to rise the fingers grip deeper
    natural = (0.7 if grasp is GraspClass.TOP else 0.8) * (SHALLOW if rise else 1.0)
    rows = []
    for x, y, yaw in _places(block, headings):
        bent = block.wall + 2 * _bend(block, ahead)
        if not block.wall:
            across = 2 * block.support(yaw + math.pi / 2)
        else:  # where fingers that are open so far would not fit, those around the wall alone may
            across = bent if bent <= min(max_opening, min(block.half_x, block.half_y)) else block.wall
        turn = yaw - block.yaw
        weight = 1.0 if block.round or block.wall or abs(math.sin(2 * turn)) < 1e-6 else OBLIQUE
        for tips in _depths(block, floor, CLEARANCES[grasp]) if block.soft or across <= max_opening else ():
            for roll in grasp.rolls:
                span = math.inf if block.soft else across, max(block.high - tips - below, 0.0)
                rows.append((x, y, tips + below + rise, yaw, natural * weight, roll, *span))
    table = np.array(rows).reshape(-1, 8)
    count = len(table)
    kinds, rolls = [CLASSES.index(grasp)] * count, table[:, 5].astype(int).tolist()
    candidates = oriented(
        f"grasp {name}",
        table[:, :3],
        grasp_series(directions(kinds, table[:, 3].tolist())),
        1,
        kinds,
        table[:, 3].tolist(),
        rolls,
        table[:, 4].tolist(),
        frame,
        touches=name,
    )
    return replace(candidates, spans=table[:, 6:])


def _places(block: Block, headings: int) -> Iterator[tuple[float, float, float]]:
    """Yield grip points (x, y) and headings; the fingers close across the heading."""
    if block.wall > 0:
        yield from _rim(block)
        return
    shares = [(0.0, 0.0)]
    if block.soft or block.half_x > LONG * block.half_y:
        shares += [(0.5, 0.0), (-0.5, 0.0)]
    if block.soft or block.half_y > LONG * block.half_x:
        shares += [(0.0, 0.5), (0.0, -0.5)]
    for x, y in block.to_map(np.array(shares) * [block.half_x, block.half_y]).tolist():
        for number in range(headings):
            yield x, y, block.yaw + number * 2 * math.pi / headings


def _rim(block: Block) -> Iterator[tuple[float, float, float]]:
    """Yield points in the middle of a wall, with headings along it, both ways."""
    if block.round:
        radius = max(block.half_x, block.half_y) * math.cos(math.pi / SEGMENTS) - block.wall / 2
        turns = [number * 2 * math.pi / SEGMENTS for number in range(SEGMENTS)]
        local = [(radius * math.cos(turn), radius * math.sin(turn), turn) for turn in turns]
    else:
        x, y = block.half_x - block.wall / 2, block.half_y - block.wall / 2
        sides = [(x, 0.0, 0.0, y), (-x, 0.0, math.pi, y), (0.0, y, math.pi / 2, x), (0.0, -y, -math.pi / 2, x)]
        local = [
            (a - share * along * math.sin(turn), b + share * along * math.cos(turn), turn)
            for share in ALONG_RIM
            for a, b, turn, along in sides
        ]
    for x, y, turn in local:
        (place,) = block.to_map(np.array([[x, y]])).tolist()
        for along in (turn + math.pi / 2, turn - math.pi / 2):
            yield place[0], place[1], block.yaw + along


def _bend(block: Block, ahead: float) -> float:
    """Compute how far a wall curves aside within a distance along it [m]: it must not meet the finger inside there."""
    if not block.round:
        return 0.0
    inner = max(block.half_x, block.half_y) - block.wall
    return inner - math.sqrt(max(inner**2 - ahead**2, 0.0))


def _depths(block: Block, floor: float, clearances: tuple[float, ...]) -> list[float]:
    """List heights of the fingertips: above soft things, else as deep as possible beside a wall or a thing."""
    if block.soft:
        return [block.high + clearance for clearance in clearances]
    if block.wall:  # a finger that touches the floor of a dish cannot close on its rim
        over = (OFF_FLOOR, *(clearance for clearance in clearances if clearance > OFF_FLOOR))
        heights = [max(floor + clearance, block.high - DEEPEST) for clearance in over]
    else:  # for flat things, exact checks reject what is too deep
        heights = [floor + clearance for clearance in clearances]
    return [height for height in dict.fromkeys(heights) if max(height, floor) <= block.high - LEAST]
