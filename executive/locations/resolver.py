"""Resolves locations: places for the base, ways of a hand, poses of objects; lazily, best first, judged exactly.

A base that has to reach something is looked for by inverting reachability maps (``candidates``), any other on a grid
around what it is about. Candidates come in blocks: spheres inside the arm and warm-started inverse kinematics rule out
most of them, the planning world judges the rest one by one, only as many as are asked for. When a first, natural choice
of hand poses leads to nothing, all of them are looked at once before the resolution fails.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from executive.locations.answers import Answers
from executive.locations.areas import Area, Facing
from executive.locations.candidates import Candidates, InverseMap, blocks, inverse_map, invert
from executive.locations.grid import around_places
from executive.locations.hand_ways import ways_of
from executive.locations.reach import (
    OFF_LATTICE,
    ON_LATTICE,
    Reach,
    ReachSolution,
    from_base,
    solve,
    touched_at,
    touched_by,
    touched_on_the_way,
    unblocked,
)
from executive.locations.reachability import GraspClass
from executive.locations.rejections import Rejections, first_body
from executive.locations.relations import (
    KINDS,
    BaseDemand,
    base_demand,
    block_of,
    hand_demand,
    is_held,
    thing_demand,
)
from executive.locations.resting import thing_holds, thing_poses
from executive.locations.sight import sight_score
from executive.locations.surroundings import ArmModel, Base, Surroundings
from executive.locations.ways import CLASSES, Ways
from executive.motion.solids import Solids
from planlang.designators import Device, Location, Object
from planlang.failures import LocationUnresolvable
from planlang.protocols import Array, Pose, Solution


class Effort:
    """How much is looked at: rows of the maps by score and number for each height, places of a way, in all, exactly."""

    def __init__(self, *, fine: bool, least: float, rows: int, each: int, most: int, block: int, exact: int) -> None:
        self.fine, self.least, self.rows, self.each = fine, least, rows, each
        self.most, self.block, self.exact = most, block, exact


EFFORTS = (
    Effort(fine=False, least=0.1, rows=400, each=16, most=384, block=48, exact=60),
    Effort(fine=True, least=0.05, rows=400, each=16, most=1024, block=96, exact=100),
    Effort(fine=True, least=0.0, rows=4000, each=48, most=4096, block=256, exact=200),
)
ANOTHER_PLACE = 0.4
"""Whatever was not seen from one place is looked for from places at least this far away [m]."""
APART = 0.05
"""Solutions are at least this far apart [m]."""
ALIKE = 0.06
"""A candidate this near to one that failed exactly, with the hand from the same side, is not judged again [m]."""
TRAVEL = 8.0
"""Distance over which a place loses most of its worth [m]."""
MOST_CROWDED = 48
"""When there is no room, obstacles of so many promising places are named."""
MOST_AREAS = 600
"""Places without reach that are judged."""

Bases = NDArray[np.float64]


class Blind:
    """From where the robot's own body hides a thing: told by where the thing is for the robot.

    What hides it at some distance hides what is nearer in that direction; if ``strict`` only places nearly like that
    are taken as seen through.
    """

    def __init__(self, what: Array, *, strict: bool) -> None:
        self._what, self._strict = what, strict
        self._known: list[tuple[float, float]] = []

    def _seen(self, base: Sequence[float] | Array) -> tuple[float, float]:
        x, y = float(self._what[0] - base[0]), float(self._what[1] - base[1])
        return math.hypot(x, y), math.remainder(math.atan2(y, x) - float(base[2]), 2 * math.pi)

    def add(self, base: Sequence[float]) -> None:
        """The robot hides it from there."""
        self._known.append(self._seen(base))

    def covers(self, base: Array) -> bool:
        """Whether it is probably hidden from a place as well."""
        away, bearing = self._seen(base)
        if self._strict:
            return any(abs(away - d) < 0.03 and abs(bearing - b) < 0.1 for d, b in self._known)
        return any(away < d + 0.03 and abs(bearing - b) < 0.25 for d, b in self._known)


class Resolver:
    """Turns locations into places for the base, ways of the hand and poses of objects."""

    def __init__(self, around: Surroundings) -> None:
        self.around = around
        self._inverse: dict[tuple[str, GraspClass], InverseMap] = {}
        self._answers: Answers[Solution] = Answers()
        self._reached: dict[tuple[str, Base], dict[Reach, ReachSolution]] = {}

    # Places for the base

    def bases(self, location: Location, log: Rejections | None = None) -> Iterator[Solution]:
        """Places that satisfy a location, lazily, best first; raises LocationUnresolvable when there are no more.

        Answers are kept until the belief changes or the robot moves. ``log`` is told all that is looked at, anew.
        """
        if log is not None:
            return self._bases(location, log)
        state = (self.around.revision(), self.around.posture())
        return self._answers.of(location, state, lambda: self._bases(location, Rejections()))

    def satisfies(self, location: Location, base: Base) -> Solution | None:
        """The solution at one given base, or None."""
        demand = base_demand(location, self.around)
        return self._judge(base, 1.0, demand, self._arms(demand), Rejections())

    def _bases(self, location: Location, log: Rejections) -> Iterator[Solution]:
        around = self.around
        demand = base_demand(location, around)
        wanted = self._wanted(demand)
        arms = self._arms(demand)
        if (wanted or demand.unreached) and not around.arms:
            raise LocationUnresolvable("the robot has no arm that could reach there", designator=str(location))
        if wanted and not arms:
            raise LocationUnresolvable("the robot has no arm as it is asked for", designator=str(location))
        found: list[Base] = []
        x, y, yaw = around.base()
        here = (x, y, math.remainder(yaw, 2 * math.pi))
        if (solution := self._judge(here, 1.0, demand, arms, log)) is not None:
            found.append(here)
            yield solution
        for effort in EFFORTS if wanted else EFFORTS[:1]:
            counted = log if effort is EFFORTS[0] or log.places else Rejections()
            places = self._reaching(wanted, demand, arms, effort, counted) if wanted else self._areas(demand, counted)
            for solution in places:
                if any(math.dist(solution.base[:2], other[:2]) <= APART for other in found):
                    continue
                found.append(solution.base)
                yield solution
            if found:
                break
        raise log.failure(location)

    def reached_from(self, base: Base) -> Mapping[tuple[str, Base], Mapping[Reach, ReachSolution]]:
        """How arms can reach from a place what was asked for when it was found, if that is the last that was found."""
        return {key: ways for key, ways in self._reached.items() if key[1] == _rounded(base)}

    def remember(self, reached: Mapping[tuple[str, Base], Iterable[ReachSolution]]) -> None:
        """The inverse of :meth:`reached_from`."""
        self._reached = {key: {way.reach: way for way in ways} for key, ways in reached.items()}

    def _arms(self, demand: BaseDemand) -> Sequence[ArmModel]:
        """The arms that may do all that is asked, where no device is said: those that hold something, else all."""
        holding = [arm for arm in self.around.arms if self.around.held(arm.name) is not None]
        general = holding or self.around.arms
        named = [reach.arms for reach in demand.reaches if reach.arms is not None]
        if named and len(named) == len(demand.reaches):
            return [arm for arm in self.around.arms if any(arm.name in names for names in named)]
        return general

    def _wanted(self, demand: BaseDemand) -> tuple[Reach, ...]:
        """What has to be reached from the base: not what is in the hand already."""
        free = (r for r in demand.reaches if r.kind != "retreat" and not is_held(r.body, self.around))
        return tuple(sorted(free, key=lambda reach: KINDS.index(reach.kind)))

    def _arms_for(self, reach: Reach, arms: Sequence[ArmModel]) -> Sequence[ArmModel]:
        if reach.arms is None:
            return arms
        return [arm for arm in self.around.arms if arm.name in reach.arms]

    def _reaching(
        self,
        wanted: Sequence[Reach],
        demand: BaseDemand,
        arms: Sequence[ArmModel],
        effort: Effort,
        log: Rejections,
    ) -> Iterator[Solution]:
        """Places from which the first reach is possible by the maps, judged block by block."""
        around, first = self.around, wanted[0]
        hands = []
        for arm in self._arms_for(first, arms):
            ways = ways_of(first, arm, around, log, fine=effort.fine)
            if ways is not None and len(ways := unblocked(ways, arm, around.solids(), log)):
                hands.append((arm, ways))
        if not hands:
            return
        middle = np.mean([ways.points.mean(axis=0) for _, ways in hands], axis=0)
        spread = max(float(np.linalg.norm(ways.points[:, :2] - middle[:2], axis=1).max()) for _, ways in hands)
        reach = max(self.inverse(arm, CLASSES[int(g)]).reach for arm, ways in hands for g in np.unique(ways.grasps))
        floor = around.floor()
        room = floor.field((float(middle[0]), float(middle[1])), block_of(first.body, around).yaw, spread + reach)
        terms = demand.areas
        others = [self._band(reach, arms) for reach in wanted[1:]]

        def weigh(bases: Bases) -> Array:
            weight = np.ones(len(bases))
            for centre, least, most in others:
                away = np.linalg.norm(bases[:, :2] - centre, axis=1)
                weight = weight * ((away >= least) & (away <= most))
            for term in terms:
                weight = weight * _scored(term, bases)
            return weight

        found = invert(
            hands,
            self.inverse,
            room,
            weigh if terms or others else None,
            around.lifts,
            least=effort.least,
            rows=effort.rows,
            each=effort.each,
        )
        log.scored.append((found.bases, found.scores))
        log.add("no room for the base", found.without_room)
        log.add("not where the other conjuncts say", found.unwanted)
        self._name_crowding(found, log)
        if not len(found):
            if not found.without_room and not found.unwanted:
                log.add("out of reach", sum(len(ways) for _, ways in hands))
            return
        yield from self._in_blocks(found, hands, wanted, demand, effort, middle, spread + reach, log)

    def _in_blocks(
        self,
        found: Candidates,
        hands: Sequence[tuple[ArmModel, Ways]],
        wanted: Sequence[Reach],
        demand: BaseDemand,
        effort: Effort,
        middle: Array,
        radius: float,
        log: Rejections,
    ) -> Iterator[Solution]:
        around = self.around
        x, y, _ = around.base()
        order = found.order(np.exp(-np.hypot(found.bases[:, 0] - x, found.bases[:, 1] - y) / TRAVEL))[: effort.most]
        bases = np.column_stack([found.bases[:, :2], np.arctan2(np.sin(found.bases[:, 2]), np.cos(found.bases[:, 2]))])
        bases = bases.round(4)  # as they are told
        solids = around.solids().near(middle, radius)
        floor, judged, failed = around.floor(), 0, list[tuple[int, Array, float]]()
        blind = Blind(middle[:2], strict=effort.fine)
        for part in blocks(len(order), effort.block):
            rows = order[part]
            roomy = floor.at(bases[rows, :2]) > 0.0
            log.add("no room for the base", int((~roomy).sum()))
            rows = rows[roomy]
            ways_ok, joints = self._solved(found, rows, bases, hands, solids, log)
            for row in rows[ways_ok]:
                number = int(found.arms[row])
                arm, ways = hands[number]
                way = int(found.ways[row])
                base = bases[row]
                if _like(failed, number, base, float(ways.headings[way])) or blind.covers(base):
                    continue
                if judged >= effort.exact:
                    log.add("not looked at")
                    return
                place = (float(base[0]), float(base[1]), float(base[2]))
                solution = ReachSolution(wanted[0], arm, ways.plan(way), joints[int(row)])
                answer = self._complete(place, float(found.scores[row]), solution, wanted, demand, blind, log)
                if answer is not None:
                    yield answer
                else:
                    judged += 1
                    failed.append((number, base, float(ways.headings[way])))

    def _solved(
        self,
        found: Candidates,
        rows: NDArray[np.intp],
        bases: Array,
        hands: Sequence[tuple[ArmModel, Ways]],
        solids: Solids,
        log: Rejections,
    ) -> tuple[NDArray[np.bool_], dict[int, Array]]:
        """Which candidates (rows) have joint values as far as spheres tell, and these (k, d) by row."""
        ok = np.zeros(len(rows), bool)
        joints: dict[int, Array] = {}
        for number, (arm, ways) in enumerate(hands):
            for grasp in np.unique(ways.grasps):
                mine = np.flatnonzero(
                    (found.arms[rows] == number) & (ways.grasps[found.ways[rows] % len(ways)] == grasp)
                )
                if not len(mine):
                    continue
                chosen = rows[mine]
                forward = self.inverse(arm, CLASSES[int(grasp)]).forward
                seeds = forward.seeds(found.rows[chosen], found.torsos[chosen])
                slack = OFF_LATTICE if arm.lift is None else ON_LATTICE
                solved = solve(
                    ways,
                    found.ways[chosen],
                    bases[chosen],
                    arm,
                    seeds[:, None],
                    solids,
                    log,
                    own=self.around.own_body(arm),
                    slack=slack,
                )
                ok[mine] = solved.ok
                joints.update(
                    (int(row), values)
                    for row, values, good in zip(chosen, solved.joints, solved.ok, strict=True)
                    if good
                )
        return ok, joints

    def _complete(
        self,
        base: Base,
        score: float,
        solution: ReachSolution,
        wanted: Sequence[Reach],
        demand: BaseDemand,
        blind: Blind,
        log: Rejections,
    ) -> Solution | None:
        """The exact judgement of a place whose first reach is solved as far as spheres tell."""
        if not self._stands(base, score, demand, log):
            return None
        body = touched_at(solution.joints, solution, base, self.around)
        if body is None:
            if not self._sees(base, score, demand, log, blind):
                return None
            body = touched_on_the_way(solution, base, self.around)
        if body is not None:
            log.collision(body)
            log.judge(base, score, "in collision", body)
            return None
        reached = {wanted[0]: solution}
        for reach in wanted[1:]:
            options = self._arms_for(reach, [solution.arm])
            if (way := self._first(reach, base, options, log)) is None:
                log.judge(base, score, "out of reach")
                return None
            reached[reach] = way
        return self._answer(base, score, reached, demand, log)

    def _judge(
        self, base: Base, score: float, demand: BaseDemand, arms: Sequence[ArmModel], log: Rejections
    ) -> Solution | None:
        """The solution at ``base`` with any of the arms, or None with the reason counted."""
        wanted = self._wanted(demand)
        if any(
            math.dist(base[:2], centre) > most or math.dist(base[:2], centre) < least
            for centre, least, most in (self._band(reach, arms) for reach in wanted)
        ):
            return None
        if not self._stands(base, score, demand, log) or not self._sees(base, score, demand, log):
            return None
        if not wanted:
            return self._answer(base, score, {}, demand, log)
        for arm in arms:
            reached: dict[Reach, ReachSolution] = {}
            for reach in wanted:
                if (way := self._first(reach, base, self._arms_for(reach, [arm]), log)) is None:
                    break
                reached[reach] = way
            else:
                return self._answer(base, score, reached, demand, log)
        log.judge(base, score, "out of reach")
        return None

    def _stands(self, base: Base, score: float, demand: BaseDemand, log: Rejections) -> bool:
        """Whether the base can stand there, by all conjuncts that do not concern a hand, cheapest first."""
        around = self.around
        place = np.array([base])
        for term in demand.areas:
            if _scored(term, place)[0] <= 0:
                return _reject(log, base, score, f"not {term.words}".replace("not not ", ""))
        if contacts := around.contacts(base):
            body = first_body(contacts)
            log.add("no room for the base")
            log.blocking[body] += 1
            log.judge(base, score, "no room for the base", body)
            return False
        return True

    def _sees(self, base: Base, score: float, demand: BaseDemand, log: Rejections, blind: Blind | None = None) -> bool:
        """Whether what has to be seen from the base is: what is asked for, and what is going to be handled."""
        around = self.around
        for name in demand.seen:
            if any(math.dist(base[:2], other[:2]) < ANOTHER_PLACE for other in around.looked_in_vain(name)):
                return _reject(log, base, score, "looked from there in vain")
        handled = [r.body for r in self._wanted(demand) if r.kind in ("grasp", "offer")] if around.sighted() else []
        for name in dict.fromkeys((*demand.seen, *handled)):
            occluder = around.hidden(base, name)
            if occluder is not None:
                log.add("not visible")
                if occluder:
                    log.blocking[occluder] += 1
                if occluder and blind is not None and occluder not in around.names():
                    blind.add(base)
                log.judge(base, score, "not visible", occluder or None)
                return False
        for name in demand.unseen:
            if around.hidden(base, name) is None:
                return _reject(log, base, score, f"{name} is visible")
        return True

    def _answer(
        self, base: Base, score: float, reached: dict[Reach, ReachSolution], demand: BaseDemand, log: Rejections
    ) -> Solution | None:
        for reach in demand.unreached:
            if self._first(reach, base, self._arms_for(reach, self.around.arms), Rejections()) is not None:
                _reject(log, base, score, f"{reach.body} is in reach")
                return None
        log.judge(base, score)
        if not reached:
            return Solution(base, self.around.revision(), self._sides(demand))
        arm = next(iter(reached.values())).arm.name
        for way in reached.values():
            self._reached.setdefault((way.arm.name, _rounded(base)), {}).update(reached)
        while len(self._reached) > 64:
            del self._reached[next(iter(self._reached))]
        detail = {"arm": arm, "reaches": [way.plan.label for way in reached.values()], **self._sides(demand)}
        return Solution(base, self.around.revision(), detail)

    def _sides(self, demand: BaseDemand) -> dict[str, object]:
        """Whose left and right was meant, where a location names sides."""
        said = {
            term.words: "its own" if self.around.front(term.body) is not None else "the viewer's"
            for term in demand.areas
            if isinstance(term, Area) and term.directions
        }
        return {"frame": said} if said else {}

    def _first(self, reach: Reach, base: Base, arms: Sequence[ArmModel], log: Rejections) -> ReachSolution | None:
        """The best way to satisfy a reach from a base with one of some arms."""
        for arm in arms:
            for fine in (False, True):
                ways = ways_of(reach, arm, self.around, log, fine=fine)
                if ways is None:
                    continue
                ways = unblocked(ways, arm, self.around.solids(), log)
                way = next(from_base(reach, base, arm, ways, self.around, self.inverse, log), None)
                if way is not None:
                    return way
        return None

    def _band(self, reach: Reach, arms: Sequence[ArmModel]) -> tuple[tuple[float, float], float, float]:
        """A circle around what a reach is about, outside of which no base can satisfy it: middle, radii [m]."""
        around = self.around
        longest = max(
            (float(np.hypot(*a.shoulder_low[:2])) + a.reach for a in self._arms_for(reach, arms)), default=0.0
        )
        if reach.kind == "offer":
            zone = around.zone(reach.body)
            x, y, _ = np.mean(zone.shoulders, axis=0)
            return (float(x), float(y)), 0.0, longest + zone.arm_length + 0.5
        block = block_of(reach.body, around)
        extent = 0.0 if reach.kind == "grasp" else math.hypot(block.half_x, block.half_y)
        return (block.x, block.y), 0.0, longest + extent + 0.2

    def _name_crowding(self, found: Candidates, log: Rejections) -> None:
        """Count which bodies take the room of promising places, of ways that have no other place."""
        best = sorted(range(len(found.crowded)), key=lambda index: (-round(found.crowded[index][0], 6), index))
        for index in best[:MOST_CROWDED]:
            score, place = found.crowded[index]
            base = (float(place[0]), float(place[1]), math.remainder(float(place[2]), 2 * math.pi))
            body = first_body(contacts) if (contacts := self.around.contacts(base)) else None
            if body is not None:
                log.blocking[body] += 1
            log.judge(base, score, "no room for the base", body)

    def _areas(self, demand: BaseDemand, log: Rejections) -> Iterator[Solution]:
        """Places without reach: on a grid around what they are about, or over the whole floor."""
        around = self.around
        terms = list(demand.areas)
        bases, room, squares = around_places(demand, around)
        score = np.ones(len(bases))
        for term in terms:
            score = score * _scored(term, bases)
            log.add(f"not {term.words}".replace("not not ", ""), int((_scored(term, bases) <= 0).sum()))
        for name in demand.seen:
            score = score * sight_score(bases, block_of(name, around), around.camera_range())
        roomy = room > 0
        log.add("no room for the base", int((~roomy & (score > 0)).sum()))
        x, y, _ = around.base()
        travel = np.hypot(bases[:, 0] - x, bases[:, 1] - y)
        total = score * (0.4 + np.clip(room, 0.0, 0.3)) * np.exp(-travel / TRAVEL)
        crowded = np.flatnonzero(~roomy & (score > 0))
        if not (roomy & (score > 0)).any():
            promising = crowded[np.argsort(-score[crowded].round(9), kind="stable")][:MOST_CROWDED]
            found = Candidates()
            found.crowded = [(float(score[index]), bases[index]) for index in promising]
            self._name_crowding(found, log)
        good = np.flatnonzero(roomy & (score > 0))
        log.scored.append((bases[good], total[good]))
        order = good[np.argsort(-total[good].round(9), kind="stable")]
        for row in islice(_spread(squares[order], order), MOST_AREAS):
            place = bases[row].round(4)
            base = (float(place[0]), float(place[1]), math.remainder(float(place[2]), 2 * math.pi))
            worth = float(total[row])
            if not self._stands(base, worth, demand, log) or not self._sees(base, worth, demand, log):
                continue
            answer = self._answer(base, float(total[row]), {}, demand, log)
            if answer is not None:
                yield answer

    # Ways of a hand

    def hands(self, location: Location, arm: ArmModel, seed: Array) -> Iterator[ReachSolution]:
        """Ways of a hand to a location from where the base stands; raises LocationUnresolvable when there are no more.

        Near ``seed`` (d,), the arm's joint values, where several are as good; a way by which the place was found first.
        """
        around = self.around
        reach = replace(hand_demand(location, around), arms=None)
        base = around.base()
        known = {
            replace(other, arms=None): way for other, way in self._reached.get((arm.name, _rounded(base)), {}).items()
        }.get(reach)
        log = Rejections()
        stated = None if known is None else ways_of(reach, arm, around, Rejections(), fine=True)
        if (
            known is not None
            and stated is not None
            and _among(known, stated)
            and touched_by(known, base, around) is None
        ):
            yield known  # still a way: what it is about has not moved since
        begun = seed if known is None else known.joints[min(1, len(known.joints) - 1)]
        for fine in (False, True):
            counted = Rejections() if fine else log
            ways = ways_of(reach, arm, around, counted, fine=fine)
            found = False
            if ways is not None:
                ways = unblocked(ways, arm, around.solids(), counted)
                for way in from_base(reach, base, arm, ways, around, self.inverse, counted, seed=begun, generous=True):
                    found = True
                    yield way
            if found:
                break
        raise log.failure(location)

    # Poses of objects

    def things(self, location: Location, what: Object, log: Rejections | None = None) -> Iterator[Pose]:
        """Poses of an object's box centre at a location, best first; raises LocationUnresolvable at the end."""
        around, log = self.around, log or Rejections()
        name = around.bind(what)
        size = around.size(name)
        x, y, _ = around.base()
        demand = thing_demand(location, around, max(size[:2]) / 2, (x, y))
        if demand.on is None and demand.inside is None and not any(inside for _, inside in demand.people):
            raise LocationUnresolvable(
                f"{location} does not say where {name} rests: it needs on, in_ or in_reach_of a person",
                designator=str(location),
            )
        for pose in thing_poses(name, size, demand, around, log):
            if thing_holds(name, pose, size, demand, around):
                yield pose
        raise log.failure(location)

    # What holds now

    def holds(self, location: Location, what: Object | None = None) -> bool:
        """Whether the base, the hand of a device, or an object is at a location, judged as candidates are."""
        around = self.around
        if what is None:
            return self.satisfies(location, around.base()) is not None
        if isinstance(what, Device):
            reach = hand_demand(location, around)
            return any(self._is_at(reach, arm) for arm in around.arms_of(what))
        name = around.bind(what)
        size = around.size(name)
        x, y, _ = around.base()
        demand = thing_demand(location, around, max(size[:2]) / 2, (x, y))
        return thing_holds(name, around.pose(name), size, demand, around)

    def _is_at(self, reach: Reach, arm: ArmModel) -> bool:
        """Whether a hand is within 2 cm and 0.2 rad of a key pose or the first pose of a way."""
        around = self.around
        tip = around.tip(arm)
        ways = ways_of(reach, arm, around, Rejections(), fine=True)
        if ways is None:
            return False
        poses = ways.poses(np.arange(len(ways)))[:, [0, ways.key]].reshape(-1, 4, 4)
        away = np.linalg.norm(poses[:, :3, 3] - tip[:3, 3], axis=1)
        cosine = (np.einsum("nij,ij->n", poses[:, :3, :3], tip[:3, :3]) - 1) / 2
        return bool(((away < 0.02) & (cosine > math.cos(0.2))).any())

    def inverse(self, arm: ArmModel, grasp: GraspClass) -> InverseMap:
        """The reachability map of an arm and class of grasp, prepared for inversion."""
        key = (arm.name, grasp)
        if key not in self._inverse:
            facts = (arm.solver.chain.digest, arm.lift, arm.frame, arm.seeds.tobytes(), grasp)
            self._inverse[key] = inverse_map(self.around.reachability(arm, grasp), facts)
        return self._inverse[key]


def _scored(term: object, bases: Bases) -> Array:
    """The score (n,) of a conjunct about the floor for bases (n, 3)."""
    return term.score(bases if isinstance(term, Facing) else bases[:, :2])  # type: ignore[attr-defined,no-any-return]


def _reject(log: Rejections, base: Base, score: float, reason: str) -> bool:
    log.add(reason)
    log.judge(base, score, reason)
    return False


def _like(failed: Sequence[tuple[int, Array, float]], arm: int, base: Array, heading: float) -> bool:
    """Whether a place nearly like this one, with the hand from the same side, has failed."""
    return any(
        number == arm
        and abs(other[0] - base[0]) + abs(other[1] - base[1]) < ALIKE
        and abs(math.remainder(heading - before, 2 * math.pi)) < 0.3
        for number, other, before in failed
    )


def _spread(squares: NDArray[np.intp], order: NDArray[np.intp]) -> Iterator[int]:
    """The order, so that of each square the best comes first, then the second best of each, and so on."""
    rank = np.zeros(len(order), np.intp)
    seen: dict[int, int] = {}
    for index, value in enumerate(squares.tolist()):
        rank[index] = seen.get(value, 0)
        seen[value] = rank[index] + 1
    return iter(order[np.argsort(rank, kind="stable")].tolist())


def _among(known: ReachSolution, ways: Ways) -> bool:
    """Whether a way's poses are those of one of some ways."""
    poses = ways.poses(np.arange(len(ways)))
    if poses.shape[1:] != known.plan.poses.shape:
        return False
    return bool((np.abs(poses - known.plan.poses).max(axis=(1, 2, 3)) < 1e-6).any())


def _rounded(base: Base) -> Base:
    """The same for a place and for where the base stands after it went there."""
    x, y, yaw = base
    return round(x, 4), round(y, 4), round(math.remainder(yaw, 2 * math.pi), 4)
