"""Explains why no base pose satisfies a location, with what would have to change in the map or task."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from functools import cached_property

import numpy as np

from executive.belief.doorways import NarrowDoorway, narrow_doorway
from executive.belief.floor import CELL as FLOOR_CELL
from executive.belief.planning_scene import PlanningScene
from executive.belief.scene_collisions import BasePose
from executive.locations.changes import Changes, IsFeasible, WhatLacks, with_supports
from executive.locations.dropping import undroppable
from executive.locations.grasp_candidates import CLASSES, GraspCandidates
from executive.locations.grasps_from_above import BETWEEN_FINGERS
from executive.locations.hand_predicates import (
    Stage,
    barely_too_wide,
    candidates_of,
    narrowest,
    narrowest_grip,
    unknown_fit,
)
from executive.locations.inverse_maps import InverseMaps
from executive.locations.questions import Question
from executive.locations.reachability import CELL, GraspClass, ReachabilityMap
from executive.locations.rejections import (
    COLLISION,
    NO_HOLD,
    NO_ROOM,
    NOT_LOOKED_AT,
    NOT_VISIBLE,
    OUT_OF_REACH,
    Rejections,
)
from executive.robots.arms import ArmModel, called
from planlang.failure_wording import NO_WAY
from planlang.geometry import Array
from planlang.progress import unreported
from planlang.records import dataclass
from planlang.relations.demands import Reach, ReachKind

LEAST = 0.01
"""Smallest distance that is reported [m]."""
HAIR = 1e-3
"""Height difference up to which nothing counts as too high or too low [m]."""
BASES = frozenset({NO_ROOM, NO_WAY, NOT_VISIBLE})
"""Reasons for which base poses are rejected."""
APPROACHES = {GraspClass.SIDE: "from the side", GraspClass.TILTED: "at a slant", GraspClass.TOP: "from above"}
AROUND = 2.5
"""Distance from a thing within which to look for floor for the base [m]."""
NEARER = "; its base is fixed: move that nearer, or start the robot nearer to it"
"""What helps a robot that does not drive."""


def explain_bases(
    wanted: Sequence[Reach],
    arms: Sequence[ArmModel],
    scene: PlanningScene,
    inverse: InverseMaps,
    question: Question,
    is_feasible: IsFeasible | None,
    once_moved: IsFeasible | None = None,
    once_emptied: IsFeasible | None = None,
    needed: Collection[str] = (),
    what_lacks: WhatLacks | None = None,
) -> None:
    """Add to the log's figures what was measured about the decisive reason, and what would help.

    ``is_feasible`` and ``once_moved`` are asked about changes of the map, and about doors that the robot moves itself,
    ``once_emptied`` about hands that are full; ``what_lacks`` about the remaining task after a change.
    The ``needed`` bodies are part of the location or the plan: leaving them out helps nobody.
    """
    log = question.log
    if wanted and scene.robot.base.fixed and not log.counts:
        log.add(OUT_OF_REACH.text)  # of the only base pose that it has
    if not wanted or not log.counts:
        return
    explanation = _Explanation(wanted[0], arms, scene, inverse, question, needed)
    reason = explanation.deciding()
    if reason in log.figures:
        return
    makers = {
        OUT_OF_REACH.text: explanation.out_of_reach,
        COLLISION: explanation.in_collision,
        NO_ROOM: explanation.no_room,
        NO_WAY: explanation.no_way,
    }
    measured = makers[reason]() if reason in makers else ""
    helping, advice = "", None
    if is_feasible is not None and not (reason == NO_WAY and explanation.narrow is not None):
        changes = Changes(wanted[0].body, scene, log, is_feasible, needed=needed, what_lacks=what_lacks)
        # where something closes the way, nothing that is done to the thing opens it
        if closing := explanation.closing() if reason == NO_WAY else ():
            advice = changes.without_one_of(closing)
        else:
            log.first, advice = changes.by_the_robot(once_moved or is_feasible)
            if advice is None and once_emptied is not None and wanted[0].kind is ReachKind.GRASP:
                advice = changes.in_order(once_emptied)
            advice = advice or changes.helping()
        helping = changes.none_found() if advice is None else advice.sentence
        log.changes = () if advice is None else advice.changes
    if advice is None and (instead := explanation.excluded() or explanation.no_hold()):
        measured, helping = instead, ""
    if advice is None and reason not in BASES:
        measured = "; ".join(filter(None, (measured, explanation.not_dropped())))
    if measured or helping:
        # of a long reason the last clause is told first: what helps, else what was measured
        told = (helping, measured) if advice is None else (measured, helping)
        log.figures[reason] = "; ".join(filter(None, told))


def explain_hands(reach: Reach, arm: ArmModel, scene: PlanningScene, inverse: InverseMaps, log: Rejections) -> None:
    """Add to the figures of the log by how much a thing is too high, too low or too far for an arm from where it is."""
    if next(iter(log.ordered()), "") == OUT_OF_REACH.text:
        explanation = _Explanation(reach, (arm,), scene, inverse, Question(log))
        if measured := explanation.too_high() or explanation.too_far_from(scene.base()):
            log.figures[OUT_OF_REACH.text] = measured


def height_of(name: str, scene: PlanningScene, arms: Sequence[ArmModel]) -> str:
    """Say at which height a body is, and by how much that is too high or too low for all arms, if it is."""
    at, inverse = scene.bodies.pose(name).position[2], InverseMaps(scene.robot.name, unreported)
    found = ((arm.name, inverse(arm, grasp).forward) for arm in arms for grasp in CLASSES)
    each = [(arm, *_heights(one)) for arm, one in found if len(one)]
    said, lowest = f"{name} is at {at:.2f} m", min(each, key=lambda one: one[1], default=None)
    highest = max(each, key=lambda one: one[2], default=None)
    if lowest is not None and at < lowest[1] - HAIR:
        return f"{said}, {lowest[1] - at:.2f} m too low; {called(lowest[0])} reaches down to {lowest[1]:.2f} m"
    if highest is not None and at > highest[2] + HAIR:
        return f"{said}, {at - highest[2]:.2f} m too high; {called(highest[0])} reaches up to {highest[2]:.2f} m"
    return said


def _heights(found: ReachabilityMap) -> tuple[float, float]:
    """Compute the lowest and the highest tip that an arm reaches with a class of grasps [m]."""
    half, rise = _slack(found.arm)
    return CELL * (float(found.rows["z"].min()) - half), CELL * (float(found.rows["z"].max()) + half) + rise


def _slack(arm: ArmModel) -> tuple[float, float]:
    """Compute by how many cells of the map an arm reaches beyond it, and how far its torso lifts it [m].

    A torso covers the heights between the cells of the map.
    """
    return (0.5, 0.0) if arm.lift is None else (0.0, float(arm.lift.rise(arm.lift.highest)))


@dataclass(frozen=True, slots=True)
class _Limit:
    """Heights of candidates for one arm and approach, and the heights that the arm reaches [m]."""

    arm: str
    grasp: GraspClass
    wanted: tuple[float, float]
    reached: tuple[float, float]
    reach: float
    """Greatest distance from the base that the arm reaches at the heights of the candidates [m]."""

    @property
    def gap(self) -> float:
        """Missing height: positive if the candidates are too high, negative if they are too low, else 0."""
        if self.wanted[0] > self.reached[1]:
            return self.wanted[0] - self.reached[1]
        return min(self.wanted[1] - self.reached[0], 0.0)


class _Explanation:
    """Measurements of one reach for which no base pose was found."""

    def __init__(
        self,
        reach: Reach,
        arms: Sequence[ArmModel],
        scene: PlanningScene,
        inverse: InverseMaps,
        question: Question,
        needed: Collection[str] = (),
    ) -> None:
        self.reach, self.arms, self.scene, self.inverse, self._needed = reach, arms, scene, inverse, needed
        self.log, self.known = question.log, question.known

    def deciding(self) -> str:
        """Select the reason to explain: the most frequent one, unless it only left what is out of reach.

        Hands that collide wherever the base is are counted first; the others decide. Where the base has room but no
        way, a doorway that is too narrow decides: beside each thing there are more places without room.
        """
        counts = {reason: number for reason, number in self.log.ordered().items() if reason != NOT_LOOKED_AT}
        bases = sum(counts.get(reason, 0) for reason in BASES)
        if OUT_OF_REACH.text in counts and (self.height() is not None or bases <= 1):  # one: the present base pose
            return OUT_OF_REACH.text
        first = next(iter(counts), NOT_LOOKED_AT)
        return NO_WAY if first == NO_ROOM and counts.get(NO_WAY) and self.narrow is not None else first

    def height(self) -> _Limit | None:
        """Find the limit by which the thing is least too high or too low; None if it is neither."""
        nearest = min(self.limits, key=lambda one: abs(one.gap), default=None)
        return nearest if nearest is not None and abs(nearest.gap) >= HAIR else None

    def out_of_reach(self) -> str:
        """Return by how much the thing is too high or too low; else how near the base gets, and how far arms reach."""
        if not (said := self.too_high()):
            too_far = self.too_far_from(self.scene.base()) if self.scene.robot.base.fixed else self._too_far()
            return "; ".join(filter(None, (too_far, self.in_collision())))
        return "; ".join(filter(None, (said, self.in_collision() if self.log.counts[COLLISION] else "")))

    def too_high(self) -> str:
        """Return by how much the thing is too high or too low for all arms, "" if it is not."""
        nearest = self.height()
        if nearest is None:
            return ""
        high = nearest.gap > 0
        at, limit = (nearest.wanted[0], nearest.reached[1]) if high else (nearest.wanted[1], nearest.reached[0])
        does = "grasps" if self.reach.kind is ReachKind.GRASP else "reaches"
        gap, digits = abs(nearest.gap), 2 if abs(nearest.gap) > 2 * LEAST else 3
        return (
            f"{self._aim()} is at {at:.{digits}f} m, {gap:.{digits}f} m too {'high' if high else 'low'}; "
            f"{called(nearest.arm)} {does} {APPROACHES[nearest.grasp]} "
            f"{'up' if high else 'down'} to {limit:.{digits}f} m"
        )

    def too_far_from(self, base: BasePose) -> str:
        """Return how far a thing is from a base pose, and how far arms reach at its height; "" if that is enough."""
        farthest = max(self.limits, key=lambda one: one.reach, default=None)
        places = [np.array([self.scene.bodies.pose(self.reach.body).position])]
        if self.reach.kind is not ReachKind.GRASP:
            places = [table.points for _, table in self._tables()]
        away = min((float(np.hypot(*(at[:, :2] - base[:2]).T).min()) for at in places if len(at)), default=0.0)
        if farthest is None or away <= farthest.reach:
            return ""
        said = f"{self._aim()} is {away:.2f} m away from the centre of the robot"
        said = f"{said}; {called(farthest.arm)} reaches {farthest.reach:.2f} m at that height"
        return f"{said}{NEARER}" if self.scene.robot.base.fixed else said

    def _aim(self) -> str:
        """Name what the hand goes to: a thing, or a place on or at it."""
        kind, body = self.reach.kind, self.reach.body
        return body if kind is ReachKind.GRASP else f"the place for the hand at {body}"

    def _tables(self) -> Iterator[tuple[ArmModel, GraspCandidates]]:
        """Yield grasp candidates of arms: those with a collision-free hand, or all if there are none."""
        by_stage = self.known.hands
        free = [hand for hand in by_stage[max(by_stage)].hands if len(hand.candidates)] if by_stage else []
        yield from ((hand.arm, hand.candidates) for hand in free)
        for arm in () if free else self.arms:
            yield from ((arm, table) for table in candidates_of(self.reach, arm, self.scene, Rejections(), Stage.ALL))

    @cached_property
    def limits(self) -> list[_Limit]:
        """Heights of candidates and heights within reach, by arm and approach."""
        each = ((arm, table, number) for arm, table in self._tables() for number in sorted(set(table.grasps.tolist())))
        heights = ((arm, CLASSES[number], table.points[table.grasps == number, 2]) for arm, table, number in each)
        return [self._limit(*one) for one in heights if len(self.inverse(*one[:2]).forward)]

    def _limit(self, arm: ArmModel, grasp: GraspClass, heights: Array) -> _Limit:
        """Compare heights (n,) of candidates with those that an arm reaches with a class of grasps."""
        found, low, high = self.inverse(arm, grasp).forward, float(heights.min()), float(heights.max())
        rows, (half, rise) = found.rows, _slack(arm)
        at = (rows["z"] >= (low - rise) / CELL - half) & (rows["z"] <= high / CELL + half)
        away = CELL * np.hypot(rows["x"][at], rows["y"][at], dtype=np.float64)
        return _Limit(arm.name, grasp, (low, high), _heights(found), float(away.max(initial=0.0)))

    def _too_far(self) -> str:
        gap = self._gap()
        farthest = max(self.limits, key=lambda one: one.reach, default=None)
        if farthest is None or gap <= farthest.reach:
            return ""
        return f"{self._nearest(gap)}, and {called(farthest.arm)} reaches {farthest.reach:.2f} m at that height"

    def _nearest(self, gap: float) -> str:
        """State how near the centre of the base gets to that of the thing [m], inf if it has no room near it."""
        if not math.isfinite(gap):
            return f"the robot has no room to stand within {AROUND:g} m of {self.reach.body}"
        return f"the robot cannot get its centre closer than {gap:.2f} m to the centre of {self.reach.body}"

    def _gap(self) -> float:
        """Distance of the thing from the nearest place with room for the base, inf if there is none [m]."""
        floor, block = self.scene.collisions.floor(), self.scene.bodies.block(self.reach.body)
        steps = np.arange(-AROUND, AROUND, FLOOR_CELL)
        points = np.stack(np.meshgrid(block.x + steps, block.y + steps), axis=-1).reshape(-1, 2)
        return float(np.hypot(*(points[floor.fits(points)] - block.centre[:2]).T).min(initial=np.inf))

    def no_hold(self) -> str:
        """Compare the width of the thing with the opening of the hands, if some of them do not hold it."""
        if self.reach.kind is not ReachKind.GRASP or not self.log.counts[NO_HOLD.text]:
            return ""
        part, grip = narrowest_grip(self.reach.body, self.scene.bodies.grips(self.reach.body))
        wide = narrowest(grip)
        opening, arm = max((min(arm.max_opening, arm.openings.gap), arm.name) for arm in self.arms)
        unknown = next(
            (one for one in self.arms if one.bare and one.max_opening > wide > opening - BETWEEN_FINGERS), None
        )
        if unknown is not None:
            return unknown_fit(part, wide, unknown)
        if wide < opening - BETWEEN_FINGERS:
            return ""
        return barely_too_wide(part, wide, opening, arm)

    def in_collision(self) -> str:
        """Name the body that a hand or arm would collide with most often."""
        if not self.log.blocking:
            return ""
        body, number = next(iter(self.log.ordered_blocking().items()))
        obstacle = f"{body} itself" if body == self.reach.body else self.scene.bodies.as_obstacle(body)
        obstacle = obstacle if body in self.scene.bodies.names() else "itself"
        total = sum(self.log.counts.values())
        share = f"all {total}" if number == total else f"{number} of {total}"
        return f"in {share} ways to reach {self.reach.body} the robot would hit {obstacle}"

    def no_room(self) -> str:
        """Describe how near the base gets, and how far arms reach if that is not enough."""
        if self.reach.kind is ReachKind.OFFER:
            return ""
        return self._too_far() or self._nearest(self._gap())

    def not_dropped(self) -> str:
        """Say why what a hand holds is not let go above the container that it is to go into; "" if it may be."""
        held = (self.scene.arms.held(arm.name) for arm in self.arms)
        return next((said for one in held if one and (said := undroppable(self.reach, one.name, self.scene))), "")

    def excluded(self) -> str:
        """Return that a relation of the location leaves none of the candidates; "" if others left some out, too."""
        (reason, number), *others = self.log.counts.items()
        met = reason.removeprefix("not ")
        if others or met == reason or reason in (NOT_VISIBLE, NOT_LOOKED_AT):
            return ""
        return f"none of the {number} candidates is {met}: another place or relation is needed"

    def no_way(self) -> str:
        """Say that no path leads to where the base would have to stand, and which doorway is too narrow."""
        sentence = f"the base cannot drive to where it could reach {self.reach.body}"
        return sentence if self.narrow is None else f"{sentence}: {self.narrow}"

    @cached_property
    def narrow(self) -> NarrowDoorway | None:
        """Doorway on the way to the thing through which the robot does not fit; None if there is none."""
        return narrow_doorway(self.scene, self.scene.bodies.block(self.reach.body).centre[:2])

    def closing(self) -> tuple[str, ...]:
        """Bodies without which, one at a time, the base could drive to where arms may reach the thing."""
        block = self.scene.bodies.block(self.reach.body)
        place = np.array([block.x, block.y])
        bodies, within = self.scene.bodies, max(self.inverse(arm, one).reach for arm in self.arms for one in CLASSES)
        # nobody can leave out rooms, what the hand goes to, and what the task needs
        fixed = {*with_supports({self.reach.body, *self._needed}, bodies), *filter(bodies.is_room, bodies.names())}
        return self.scene.collisions.closes_way(place, within, fixed)
