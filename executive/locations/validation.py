"""Exact validation of base poses, conjunct by conjunct, cheapest first."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from executive.belief.planning_scene import PlanningScene
from executive.belief.scene_collisions import BasePose
from executive.locations.base_poses import BasePoses
from executive.locations.demands import ORDER, BaseDemand, sides
from executive.locations.hand_predicates import Stage, candidates_of
from executive.locations.hand_solutions import HandSolution, Trial, from_base
from executive.locations.inverse_maps import InverseMaps
from executive.locations.later_uses import LaterUses
from executive.locations.questions import Question
from executive.locations.rejections import COLLISION, NO_HOLD, NOT_VISIBLE, OUT_OF_REACH, Reason, Rejections, unmet
from executive.motion import QuickCheck
from executive.robots.arms import ArmModel, called
from planlang.designators import Location
from planlang.failures import BehindClosedDoor, HandsFull, HandsLacking, LocationUnresolvable, TooHeavy
from planlang.geometry import Array
from planlang.kept import Latest
from planlang.protocols import Solution
from planlang.relations.demands import Reach, ReachKind

PLACES = 6
"""Decimals of base poses [m, rad]: few enough that machines agree, enough that the map's origin does not matter."""
ANOTHER_PLACE = 0.4
"""Distance from a base pose from which something was not seen at which to look for it again [m]."""
MOST_REMEMBERED = 64
"""Base poses whose hand solutions are remembered."""


class SelfOcclusion:
    """Base poses, relative to a thing, from which the robot's own body hides it.

    What hides it at some distance also hides nearer things in that direction; if ``strict``, only similar base poses
    count.
    """

    def __init__(self, what: Array, *, strict: bool) -> None:
        self._what, self._strict = what, strict
        self._known: list[tuple[float, float]] = []

    def _seen(self, base: Sequence[float] | Array) -> tuple[float, float]:
        x, y = float(self._what[0] - base[0]), float(self._what[1] - base[1])
        return math.hypot(x, y), math.remainder(math.atan2(y, x) - float(base[2]), 2 * math.pi)

    def add(self, base: Sequence[float]) -> None:
        """Record a base pose from which the robot hides the thing."""
        self._known.append(self._seen(base))

    def covers(self, base: Array) -> bool:
        """Check whether it is probably hidden from another base pose as well."""
        distance, bearing = self._seen(base)
        if self._strict:
            return any(abs(distance - d) < 0.03 and abs(bearing - b) < 0.1 for d, b in self._known)
        return any(distance < d + 0.03 and abs(bearing - b) < 0.25 for d, b in self._known)


class BaseValidator:
    """Validates base poses in the believed world, and remembers the hand solutions of those it accepts."""

    def __init__(self, scene: PlanningScene, inverse: InverseMaps) -> None:
        self.scene, self.inverse = scene, inverse
        self._uses = LaterUses(scene, inverse)
        self.candidates = self._uses.candidates
        self._reached: Latest[tuple[str, BasePose], dict[Reach, HandSolution]] = Latest(MOST_REMEMBERED)

    def wanted(self, demand: BaseDemand) -> tuple[Reach, ...]:
        """Select the reaches required from the base: not those for things already in the hand."""
        free = (r for r in demand.reaches if r.kind is not ReachKind.RETREAT and not self.scene.bodies.is_held(r.body))
        return tuple(sorted(free, key=lambda reach: ORDER.index(reach.kind)))

    def arms(self, demand: BaseDemand) -> Sequence[ArmModel]:
        """List the arms, one of which performs all reaches, except those that only others can: see :meth:`arms_for`."""
        wanted = self.wanted(demand)
        open_choice = next((reach for reach in wanted if reach.arms is None), None)
        if open_choice is not None:
            return self.arms_for(open_choice, self.scene.arms.all)
        named = {arm.name for reach in wanted for arm in self.arms_for(reach, ())}
        return [arm for arm in self.scene.arms.all if arm.name in named]

    def arms_for(self, reach: Reach, arms: Sequence[ArmModel]) -> Sequence[ArmModel]:
        """List the arms that may perform a reach: those it names, or else the suitable ones among ``arms``.

        Grasping takes a free hand that can carry the thing, and was not given up. Everything else concerns held things:
        if any arms hold something, these do it, unless others are named.
        """
        if reach.arms is not None:
            arms = [arm for arm in self.scene.arms.all if arm.name in reach.arms]
        if reach.kind is ReachKind.GRASP:
            mass = self.scene.bodies.mass(reach.body)
            free = [arm for arm in arms if self.scene.arms.held(arm.name) is None and mass <= arm.payload]
            return self.scene.arms.able(free)
        full = [arm for arm in self.scene.arms.all if self.scene.arms.held(arm.name) is not None]
        if reach.arms is not None or not full:
            return arms
        return [arm for arm in arms if self.scene.arms.held(arm.name) is not None] or full

    def _closed_later(self, reach: Reach) -> tuple[str, str | None]:
        """Find where a thing will be put, and the closed door in front of it, if any."""
        inside = [use.body for use in reach.then if use.kind is ReachKind.PLACE and use.inside]
        doors = ((body, self.scene.bodies.door_of(body)) for body in inside)
        return next((one for one in doors if one[1] is not None), (reach.body, None))

    def check_hands(self, reach: Reach, location: Location) -> None:
        """Raise LocationUnresolvable if a door is closed, the thing is too heavy, or all hands are full."""
        door = self.scene.bodies.closed_before(reach.body) if reach.kind is ReachKind.GRASP else None
        what = reach.body
        if reach.kind is ReachKind.PLACE and reach.inside:
            door = self.scene.bodies.door_of(reach.body)
        if door is None and reach.kind is ReachKind.GRASP:
            empty = sum(self.scene.arms.held(arm.name) is None for arm in self.scene.arms.all)
            if empty <= self.scene.bodies.hands(reach.body):  # no hand stays free to open doors
                what, door = self._closed_later(reach)
        if door is not None:
            raise self._behind(door, what, location)
        if reach.kind is ReachKind.GRASP and (needed := self.scene.bodies.hands(reach.body)) > 1:
            hands = self.scene.arms.hands
            empty = sum(self.scene.arms.held(arm.name) is None for arm in hands)
            raise HandsLacking(designator=str(location), what=reach.body, needed=needed, hands=empty, of=len(hands))
        able = self.arms_for(reach, self.scene.arms.all)
        if reach.kind is ReachKind.PLACE and not any(self.scene.arms.held(arm.name) for arm in able):
            raise LocationUnresolvable(figures=self._not_in_hand(reach), designator=str(location))
        if able:
            return
        arms = [arm.name for arm in self.scene.arms.all if reach.arms is None or arm.name in reach.arms]
        free = [arm.payload for arm in self.scene.arms.all if arm.name in arms and not self.scene.arms.held(arm.name)]
        if free and reach.kind is ReachKind.GRASP:
            mass, load = self.scene.bodies.mass(reach.body), self.scene.bodies.load(reach.body)
            raise TooHeavy(designator=str(location), what=reach.body, mass=mass, payload=max(free), load=load)
        holding = {arm: held.name for arm in arms if (held := self.scene.arms.held(arm)) is not None}
        full = {arm: self.scene.bodies.designator(name) for arm, name in holding.items()}
        raise HandsFull(designator=str(location), what=reach.body, held=full)

    def _not_in_hand(self, reach: Reach) -> str:
        """Explain that the hands that are to put something down hold nothing: others do, or none does."""
        others = {arm.name: held.name for arm in self.scene.arms.all if (held := self.scene.arms.held(arm.name))}
        if not others or not reach.arms:
            return f"no hand holds anything to put down at {reach.body}; grasp it first"
        full = ", ".join(f"{called(arm)} holds {what}" for arm, what in others.items())
        return f"{full}, and {' and '.join(map(called, reach.arms))}, which is to put it down, holds nothing"

    def check_doors(self, reaches: Sequence[Reach], location: Location, log: Rejections) -> None:
        """Raise BehindClosedDoor if nothing inside is reachable because another door of the container is closed."""
        for reach in reaches:
            inside = reach.body if reach.kind is ReachKind.PLACE and reach.inside else None
            if reach.kind is ReachKind.GRASP:
                inside = self.scene.bodies.support(reach.body)
            shut = self.scene.bodies.shut_doors(inside) if inside is not None else ()
            for door in [name for name in log.ordered_blocking() if name in shut][:1]:
                raise self._behind(door, reach.body, location)

    def _behind(self, door: str, what: str, location: Location) -> BehindClosedDoor:
        return BehindClosedDoor(designator=str(location), what=what, door=self.scene.bodies.designator(door))

    def at(
        self, base: BasePose, score: float, demand: BaseDemand, arms: Sequence[ArmModel], question: Question
    ) -> Solution | None:
        """Validate ``base`` with any of the arms; None with the reason counted."""
        wanted = self.wanted(demand)
        if any(
            math.dist(base[:2], centre) > most or math.dist(base[:2], centre) < least
            for centre, least, most in (self.band(reach, arms) for reach in wanted)
        ):
            return None
        if not self.stands(base, score, demand, question) or not self.sees(base, score, demand, question):
            return None
        if not wanted:
            return self.answer(base, score, {}, demand, question)
        for arm in arms:
            if (reached := self._all(wanted, base, arm, question.log)) is not None:
                return self.answer(base, score, reached, demand, question)
        question.log.remember(base, score, OUT_OF_REACH.text)
        return None

    def complete(
        self,
        base: BasePose,
        score: float,
        solution: HandSolution,
        wanted: Sequence[Reach],
        demand: BaseDemand,
        occlusion: SelfOcclusion,
        question: Question,
        check: QuickCheck,
    ) -> Solution | str | None:
        """Validate exactly a base pose whose first reach is solved by inverse kinematics and collision spheres.

        On failure returns the body that the arm collides with, or the reason if the fingers have no grip, else None.
        """
        log = question.log
        # the arm at the grasp first: it collides most often
        trial = Trial(solution, base, self.scene, check)
        # few postures: without the quick check, which would take longer than exact queries
        body = Trial(solution, base, self.scene).touched(np.roll(solution.joints, -1, axis=0))
        reason = None if body is None else Reason(COLLISION, body)
        if reason is None:
            if not self.stands(base, score, demand, question):
                return None
            if not self.sees(base, score, demand, question, occlusion):
                return None
            reason = trial.stopped_on_the_way()
        if reason is not None:
            log.count([reason])
            log.remember(base, score, reason.text, reason.body)
            return NO_HOLD.text if reason is NO_HOLD else reason.body
        others = self._all(wanted[1:], base, solution.arm, log)
        if others is None:
            log.remember(base, score, OUT_OF_REACH.text)
            return None
        return self.answer(base, score, {wanted[0]: solution, **others}, demand, question)

    def stands(self, base: BasePose, score: float, demand: BaseDemand, question: Question) -> bool:
        """Check that the base can stand there, by all conjuncts that do not concern a hand, cheapest first."""
        for term in demand.areas:
            if term.score(np.array([base]))[0] <= 0:
                return question.log.reject(base, score, unmet(term))
        return BasePoses(self.scene, question).has_room(base, score)

    def sees(
        self,
        base: BasePose,
        score: float,
        demand: BaseDemand,
        question: Question,
        occlusion: SelfOcclusion | None = None,
    ) -> bool:
        """Check that everything to be seen from the base is visible: what is required, and what will be handled."""
        scene, log = self.scene, question.log
        for name in demand.seen:
            if any(math.dist(base[:2], other[:2]) < ANOTHER_PLACE for other in scene.belief.looked_in_vain(name)):
                return log.reject(base, score, "looked from there before without success")
        for name in self.to_see(demand):
            occluder = scene.visibility.hidden(base, name)
            if occluder is not None:
                log.add(NOT_VISIBLE)
                if occluder:
                    log.blocking[occluder] += 1
                if occluder and occlusion is not None and occluder not in scene.bodies.names():
                    occlusion.add(base)
                log.remember(base, score, NOT_VISIBLE, occluder or None)
                return False
        for name in demand.unseen:
            if scene.visibility.hidden(base, name) is None:
                return log.reject(base, score, f"{name} is visible")
        return True

    def to_see(self, demand: BaseDemand) -> tuple[str, ...]:
        """List what has to be visible from the base: what is required, and what will be handled."""
        handled = [reach.body for reach in self.wanted(demand) if reach.kind in (ReachKind.GRASP, ReachKind.OFFER)]
        handled = [name for name in handled if name not in demand.remembered and self.scene.visibility.sighted()]
        return tuple(dict.fromkeys((*demand.seen, *handled)))

    def blind(self, demand: BaseDemand) -> BaseDemand | None:
        """Drop sight of what will be handled from a demand; None if there is nothing to drop."""
        handled = tuple(name for name in self.to_see(demand) if name not in demand.seen)
        return replace(demand, remembered=handled) if handled else None

    def answer(
        self, base: BasePose, score: float, reached: dict[Reach, HandSolution], demand: BaseDemand, question: Question
    ) -> Solution | None:
        """Accept a base pose, unless there is no path, or something is in reach that must not be."""
        log = question.log
        if not BasePoses(self.scene, question).is_driven_to(base, score):
            return None
        for reach in demand.unreached:
            if self._first(reach, base, self.arms_for(reach, self.scene.arms.all), Rejections()) is not None:
                log.reject(base, score, f"{reach.body} is in reach")
                return None
        log.remember(base, score)
        # whose left and right was meant, if the location names sides
        frame: dict[str, object] = {"frame": said} if (said := sides(demand, self.scene)) else {}
        if not reached:
            return Solution(base, self.scene.belief.revision, frame)
        arm = next(iter(reached.values())).arm.name
        for reach, candidate in reached.items():
            self._reached.of((candidate.arm.name, rounded(base)), dict)[reach] = candidate
        detail = {"arm": arm, "reaches": [candidate.plan.label for candidate in reached.values()], **frame}
        return Solution(base, self.scene.belief.revision, detail)

    def _all(
        self, wanted: Sequence[Reach], base: BasePose, arm: ArmModel, log: Rejections
    ) -> dict[Reach, HandSolution] | None:
        """Find a hand solution for each of some reaches from a base with an arm; None if one has none."""
        reached: dict[Reach, HandSolution] = {}
        for reach in wanted:
            if (candidate := self._first(reach, base, self.arms_for(reach, [arm]), log)) is None:
                return None
            reached[reach] = candidate
        return reached

    def _first(self, reach: Reach, base: BasePose, arms: Sequence[ArmModel], log: Rejections) -> HandSolution | None:
        """Find the best hand solution for a reach from a base with one of some arms."""
        for arm in arms:
            for stage in tuple(Stage)[: None if reach.kind is ReachKind.OFFER else Stage.CLOSEST]:
                counted = Rejections()
                tables = self.candidates(reach, arm, counted, stage)
                if not tables:
                    continue
                candidate = next(from_base(reach, base, arm, tables, self.scene, self.inverse, counted), None)
                known = self.known(reach, arm, base) if candidate is None else None
                # an arm that stands there has few alternatives
                if known is not None and self.still_reaches(known, reach, base):
                    candidate = known
                if candidate is not None:
                    log.include(counted)
                    return candidate
            log.include(counted)  # those of the last stage, which include the natural ones
        return None

    def known(self, reach: Reach, arm: ArmModel, base: BasePose) -> HandSolution | None:
        """Recall how an arm reaches from an accepted base pose, whatever arms the reach names; None if unknown."""
        known = self._reached.get((arm.name, rounded(base)), {})
        return next((one for other, one in reversed(known.items()) if replace(other, arms=reach.arms) == reach), None)

    def still_reaches(self, known: HandSolution, reach: Reach, base: BasePose) -> bool:
        """Check exactly whether a solution is still valid for a reach from a base pose."""
        tables = candidates_of(reach, known.arm, self.scene, Rejections(), Stage.CLOSEST)
        same = (one for table in tables for one in known.among(table))
        is_usable = any(self._uses.serving(table, reach, known.arm).any() for table in same)
        return is_usable and Trial(known, base, self.scene).stopped() is None

    def band(self, reach: Reach, arms: Sequence[ArmModel]) -> tuple[tuple[float, float], float, float]:
        """Bound the base poses for a reach: centre, and least and greatest distance from it [m]."""
        scene = self.scene
        longest = max((float(np.hypot(*a.shoulder_low[:2])) + a.reach for a in self.arms_for(reach, arms)), default=0.0)
        if reach.kind is ReachKind.OFFER:
            zone = scene.bodies.zone(reach.body)
            x, y, _ = np.mean(zone.shoulders, axis=0)
            return (float(x), float(y)), 0.0, longest + zone.arm_length + 0.5
        block = scene.bodies.block(reach.body)
        stage = math.hypot(block.half_x, block.half_y)
        if reach.kind is ReachKind.GRASP:
            stage = max(math.dist((one.x, one.y), (block.x, block.y)) for one in scene.bodies.grips(reach.body))
        return (block.x, block.y), 0.0, longest + stage + 0.2

    def reached_from(self, base: BasePose) -> Mapping[tuple[str, BasePose], Mapping[Reach, HandSolution]]:
        """Hand solutions with which the last base pose found was validated."""
        return {key: candidates for key, candidates in self._reached.items() if key[1] == rounded(base)}


def rounded(base: BasePose) -> BasePose:
    """Round a base pose, so that it equals the pose at which the base arrives."""
    x, y, yaw = base
    return round(x, 4), round(y, 4), round(math.remainder(yaw, 2 * math.pi), 4)
