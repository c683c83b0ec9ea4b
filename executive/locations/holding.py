"""What a hand holds: it closes on test boxes, cylinders and bowls.

Twice each: as plans do, with their grasp candidates and checks, and as the modelled fingers do, wherever between them
the thing is. Things that only the fingers hold show what the robot file states wrongly.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from enum import StrEnum
from functools import cache, partial
from itertools import pairwise
from pathlib import Path

import numpy as np

from executive.belief.belief import Belief
from executive.belief.planning_scene import PlanningScene
from executive.belief.scene_collisions import OPPOSED, opposed
from executive.locations.hand_predicates import Stage, candidates_of
from executive.locations.hand_solutions import HandHits, HandSolution, Trial, unblocked
from executive.locations.rejections import Rejections
from executive.maps import SemanticMap
from executive.robots import Arm, Robot
from executive.robots.arms import ArmModel, RobotModel
from executive.robots.mechanism import Mechanism
from executive.robots.openings import Fingers
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import inverse, product, rigid
from planlang.ontology import Ontology
from planlang.ontology.documents import Document, Reading
from planlang.ontology.triples import Triples
from planlang.progress import Report, Share, unreported
from planlang.protocols import Configuration, Touch
from planlang.records import dataclass
from planlang.relations.demands import Reach, ReachKind
from sim import Body, BodyShape, PlanningWorld

WIDTHS = tuple(centimetres / 100 for centimetres in range(2, 13))
"""Widths of the test things [m]."""
TALL, WALL = 0.15, 0.004
"""Height of boxes and cylinders, and thickness of a bowl's wall [m]."""
BOWL = 0.5
"""Height of a bowl as a share of its diameter."""
STAND = (0.3, 0.3, 0.7)
"""Extents of the stand under each thing [m]."""
APART, FIRST = 1.0, 5.0
"""Distance between stands, and of the first ones from the robot [m]."""
NEAR = 0.5
"""Distance from a thing within which other bodies count [m]."""
MOST = 4
"""Number of grasps of a kind that are closed on a thing; the hand is the same in all."""
ALONG = tuple(step / 100 for step in (0, 1, -1, 2, 3, 4, 5, 6))
"""Distances in front of the grip point at which the middle of a thing is tried between the fingers [m]."""
ACROSS = tuple(step / 100 for step in range(-7, 8))
"""Distances from the grip point along the closing direction at which it is tried [m]."""
POSTURES = 60
"""Random postures among which one with the hand far from the body is chosen."""
FIRM = -0.8
"""Largest cosine between opposite normals of fingers that hold a thing wherever it is: at its front they would slip."""
AGREE = 0.3
"""Least cosine between normals on one side of a thing."""
NARROW = 0.03
"""Distance between two fingers on a bowl's rim up to which they have its wall between them [m]."""
NUMBERS = ("no", "one", "two", "three", "four", "five", "six")
RIM, THUMB = "by the rim", "thumb"
_BASE = (0.0, 0.0, 0.0)


class Kind(StrEnum):
    """Kind of a test thing; the value is its plural."""

    BOX = "boxes"
    CYLINDER = "cylinders"
    BOWL = "bowls"


@dataclass(frozen=True, slots=True)
class Hold:
    """Widths of the things of one kind that a hand holds [m], and how: "between two fingers"."""

    kind: Kind
    widths: tuple[float, ...]
    how: str


@dataclass(frozen=True, slots=True)
class Holding:
    """What one arm's hand holds, in a plan and by the shapes of its fingers."""

    arm: str
    planned: tuple[Hold, ...] = ()
    """One for each kind; none if the moving fingers have no shape."""
    closed: float = 0.0
    """Width of the widest box or cylinder that the fingers alone close on [m]; 0 if there is none."""
    palm: str | None = None
    """Link that the fingers need as a counterpart, and that is none of the gripper's fingers."""
    touching: tuple[str, str] | None = None
    """Links of the open hand that touch each other, so that no grasp is free of contact."""
    bare: str = ""
    """Which links lack the shapes that would tell what the hand holds; "" if none does, or it holds things."""

    def __str__(self) -> str:
        """Say it: "boxes 2-8 cm, cylinders 2-7 cm between two fingers; no bowls"."""
        if self.bare or not self.planned:
            return f"not known, as {self.bare or 'its fingers have no shape'}"
        ways = dict.fromkeys(hold.how for hold in self.planned if hold.widths)
        held = (
            ", ".join(f"{hold.kind} {ranges(hold.widths)}" for hold in self.planned if hold.widths and hold.how == how)
            for how in ways
        )
        said = [f"{things} {how}" for things, how in zip(held, ways, strict=True)]
        none = [f"no {hold.kind}" for hold in self.planned if not hold.widths]
        return "; ".join([*said, " and ".join(none)] if none and said else said or ["nothing"])

    @property
    def widest(self) -> float:
        """Width of the widest box or cylinder that plans grasp [m]; 0 if there is none."""
        return max((max(hold.widths, default=0.0) for hold in self.planned if hold.kind is not Kind.BOWL), default=0.0)


def ranges(widths: Sequence[float]) -> str:
    """Word widths [m] as ranges of whole centimetres: "2-5, 8 cm"."""
    runs: list[list[int]] = []
    for width in (round(100 * one) for one in widths):
        if runs and width == runs[-1][-1] + 1:
            runs[-1].append(width)
        else:
            runs.append([width])
    return ", ".join(f"{run[0]}-{run[-1]}" if len(run) > 1 else f"{run[0]}" for run in runs) + " cm"


def holdings(
    robot: Robot, models: Sequence[ArmModel], world: PlanningWorld, report: Report = unreported
) -> tuple[Holding, ...]:
    """Close the hands of a robot on the test things, which ``world`` contains. ``report`` gets the progress."""
    nothing = Ontology([Reading(Document(Path(), None, ""), Triples(""), ())])
    belief = Belief(SemanticMap(None, nothing, (), ()), world, robot=robot.name, trusts_map=True)
    scene = PlanningScene(world, RobotModel(robot, tuple(models), None), belief)
    found: list[Holding] = []
    for arm, model in zip(robot.arms, models, strict=True):
        if arm.gripper is not None:
            share = partial(report, f"closing the hand of the {arm.name} arm on test things")
            found.append(_Hand(arm, model, scene).holding(share))
            report("", 1.0)
    return tuple(found)


@cache
def trial_things() -> Mapping[tuple[Kind, float], tuple[Body, Body]]:
    """Make the test things, each with the stand that it is on, far from the robot."""
    things = {}
    for row, kind in enumerate(Kind):
        for column, width in enumerate(WIDTHS):
            name = f"{kind} {width:g}"
            x, y = FIRST + APART * row, APART * column
            high = BOWL * width if kind is Kind.BOWL else TALL
            shape = BodyShape.BOX if kind is Kind.BOX else BodyShape.CYLINDER
            wall = WALL if kind is Kind.BOWL else 0.0
            at = Pose((x, y, STAND[2] + high / 2))
            thing = Body(name, at, (width, width, high), shape, type="Thing", movable=True, wall=wall)
            things[kind, width] = thing, Body(f"stand of {name}", Pose((x, y, STAND[2] / 2)), STAND, type="Thing")
    return things


@dataclass(frozen=True, slots=True)
class _Pinch:
    """Fingers closed on a thing: how, and the link of the hand that is no finger and that they need, if any."""

    how: str
    palm: str | None


class _Hand:
    """One hand with the test things, at a posture of the arm far from the robot's body."""

    def __init__(self, arm: Arm, model: ArmModel, scene: PlanningScene) -> None:
        self.arm, self.model, self.scene = arm, model, scene
        self.things = trial_things()
        self.branches = self._branches()
        self.q = self._stretched()
        joints = dict(zip(model.joints, map(float, self.q), strict=True))
        self.tip = scene.world.link_pose(arm.tip, Configuration(_BASE, joints)).matrix()

    def holding(self, share: Share) -> Holding:
        """Test all things."""
        if self.arm.gripper is None or not self._moved():
            return Holding(self.arm.name, bare=self.model.bare)
        planned: dict[Kind, dict[float, _Pinch]] = {kind: {} for kind in Kind}
        for number, (kind, width) in enumerate(self.things):
            share(number / len(self.things))
            if (pinch := self._planned(kind, width)) is not None:
                planned[kind][width] = pinch
        palms = [one.palm for found in planned.values() for one in found.values() if one.palm is not None]
        contacts = self._contacts(self.scene, self.q, self.model.openings.widest)
        touching = next((pair for pair in contacts if set(pair) <= self.model.hand_links), None)  # with the hand open
        holding = Holding(self.arm.name, _holds(planned), palm=_usual(palms), touching=touching)
        return self._with_closed(holding if holding.widest else replace(holding, bare=self.model.bare))

    def _with_closed(self, holding: Holding) -> Holding:
        """Add the widest thing that the fingers alone close on, if it is wider than those of plans."""
        for width in reversed([width for width in WIDTHS if width > holding.widest]):
            for kind in (Kind.BOX, Kind.CYLINDER):
                if (pinch := self._closed(kind, width)) is not None:
                    return replace(holding, closed=width, palm=holding.palm or pinch.palm)
        return replace(holding, closed=holding.widest)

    def _moved(self) -> frozenset[int]:
        """Numbers of the links with shapes that the gripper moves."""
        assert self.arm.gripper is not None
        return frozenset[int]().union(*map(self.scene.world.robot.moved_by, self.arm.gripper.joints))

    def _branches(self) -> dict[str, str]:
        """Map the links of moving fingers to names of their fingers, which contain "thumb" for a thumb."""
        robot, arm, mechanism = self.scene.world.robot, self.arm, Mechanism(self.scene.robot.urdf)
        branches = {robot.solid_names[number]: robot.solid_names[number] for number in sorted(self._moved())}
        for joint in mechanism.fingers(arm.hand_link):
            links = [joint.child]
            for link in links:
                links += [one.child for one in mechanism.joints.values() if one.parent == link]
            is_thumb = any(THUMB in link.lower() for link in links)
            branches |= dict.fromkeys(links, f"{THUMB} {joint.name}" if is_thumb else joint.name)
        return branches

    # The hand in the air

    def _stretched(self) -> Array:
        """Choose joint values (d,) of the arm with the hand far from the robot's body, free of contact if possible."""
        chain = self.model.chain
        rows = np.concatenate([self.model.seeds, chain.sample(np.random.default_rng(0), POSTURES)])
        tips = chain.fk(rows)[:, :3, 3]
        far = np.hypot(tips[:, 0], tips[:, 1]) + np.minimum(tips[:, 2], self.model.shoulder_high[2])
        order = np.argsort(-far.round(6), kind="stable")
        fingers = self.model.openings.widest
        free = (row for row in order.tolist() if not self._contacts(self.scene, rows[row], fingers))
        return np.asarray(rows[next(free, int(order[0]))])

    def _contacts(
        self, scene: PlanningScene, q: Array, fingers: Sequence[tuple[str, float]]
    ) -> tuple[tuple[str, str], ...]:
        contacts = scene.collisions.contacts(_BASE, self.model, q, fingers=tuple(fingers))
        return tuple((one.part, one.body) for one in contacts)

    # As plans do

    def _planned(self, kind: Kind, width: float) -> _Pinch | None:
        """Try the grasps that a plan has for a thing; None if none holds it."""
        thing, _ = self.things[kind, width]
        reach = Reach(ReachKind.GRASP, thing.name, arms=(self.arm.name,))
        log, near = Rejections(), (np.asarray(thing.pose.position), NEAR)
        tables = candidates_of(reach, self.model, self.scene, log, Stage.ALL)
        at = thing.pose.matrix()
        for _, table, _ in unblocked(self.model, tables, self.scene, log, near, hits=HandHits()):
            tried: dict[int, int] = {}
            for index in np.argsort(-table.weights.round(6), kind="stable").tolist():
                grasp = int(table.grasps[index])
                tried[grasp] = tried.get(grasp, 0) + 1
                if tried[grasp] > MOST:
                    continue
                plan = table.plan(index)
                scene = self._with(thing, product(self.tip, product(inverse(plan.poses[table.key]), at)))
                joints = np.tile(self.q, (len(plan.poses), 1))
                trial = Trial(HandSolution(reach, self.model, plan, joints), _BASE, scene)
                if trial.fails_to_grip() is None and self._holds(scene, thing, plan.fingers):
                    return self._pinched(scene, thing, plan.fingers)
        return None

    def _holds(self, scene: PlanningScene, thing: Body, fingers: Fingers) -> bool:
        return scene.collisions.closed_on(_BASE, self.model, self.q, thing.name, fingers) is not None

    def _with(self, thing: Body, at: Array) -> PlanningScene:
        """Suppose that a thing is at a pose (4, 4)."""
        return self.scene.supposing(self.scene.belief.state.placed({thing.name: Pose.from_matrix(at)}))

    # As the fingers do

    def _closed(self, kind: Kind, width: float) -> _Pinch | None:
        """Close the fingers on a thing upright between them, at the first places at which the open hand is free."""
        thing, _ = self.things[kind, width]
        approach, closing = np.asarray(self.arm.approach), np.asarray(self.arm.closing)
        turn = np.column_stack([approach, closing, np.cross(approach, closing)])
        fingers = self.model.openings.widest
        for along in ALONG:
            free = dict[float, PlanningScene]()
            for across in ACROSS:
                scene = self._with(thing, product(self.tip, rigid(turn, along * approach + across * closing)))
                if not any(thing.name in pair for pair in self._contacts(scene, self.q, fingers)):
                    free[across] = scene
            for across in _tried(tuple(free)):
                if (found := self._pinched(free[across], thing, fingers, FIRM)) is not None:
                    return found
        return None

    def _pinched(self, scene: PlanningScene, thing: Body, fingers: Fingers, least: float = OPPOSED) -> _Pinch | None:
        """Close the fingers on a thing in the hand; None if nothing of the hand touches it from opposite sides."""
        joints = scene.collisions.closed(_BASE, self.model, self.q, thing.name, fingers)
        if joints is None or self.arm.gripper is None:
            return None
        for links in (frozenset(self.arm.gripper.finger_links), self.model.hand_links):
            touches = scene.world.touches(sorted(links), Configuration(_BASE, joints))
            if (pair := opposed(touches, least)) is not None:
                sides = _alike(pair[0], touches), _alike(pair[1], touches)
                palm = next((one.link for side in sides for one in side if one.link not in self.branches), None)
                is_rim = thing.wall > 0 and math.dist(sides[0][0].point, sides[1][0].point) < NARROW
                return _Pinch(RIM if is_rim else self._how(sides, palm), palm)
        return None

    def _how(self, sides: tuple[Sequence[Touch], Sequence[Touch]], palm: str | None) -> str:
        """Word what is on the two sides of a thing: "between thumb and three fingers"."""
        one, other = ({self.branches.get(touch.link, palm or "") for touch in side} for side in sides)
        one, other = (one - other or one, other) if len(one) > 1 else (one, other - one or other)
        if palm is not None:
            return f"between {_counted(len((one | other) - {palm}))} and {palm}"
        thumbs = [len(side) == 1 and THUMB in next(iter(side)) for side in (one, other)]
        if any(thumbs):
            return f"between thumb and {_counted(len(other if thumbs[0] else one))}"
        few, many = sorted((len(one), len(other)))
        if few == many > 1 and len(one | other) > 2:  # the links of a linkage are no fingers of their own
            return "between its fingers"
        return "between two fingers" if len(one | other) == 2 else f"between {_counted(few)} and {_counted(many)}"


def _counted(fingers: int) -> str:
    return f"{NUMBERS[fingers]} fingers" if 1 < fingers < len(NUMBERS) else "a finger"


def _tried(free: Sequence[float]) -> tuple[float, ...]:
    """Select places of a row [m]: the one nearest to the grip point, and the ends of the free ones around it."""
    if not free:
        return ()
    runs, middle = [[free[0]]], min(free, key=lambda place: (abs(place), place))
    for before, place in pairwise(free):
        if place - before > 1.5 * (ACROSS[1] - ACROSS[0]):
            runs.append([])
        runs[-1].append(place)
    around = next(run for run in runs if middle in run)
    return tuple(dict.fromkeys((middle, around[0], around[-1])))


def _alike(one: Touch, touches: Sequence[Touch]) -> list[Touch]:
    """List a touch, then the others on the same side."""
    return [one, *(other for other in touches if other is not one and np.dot(other.normal, one.normal) >= AGREE)]


def _holds(found: Mapping[Kind, Mapping[float, _Pinch]]) -> tuple[Hold, ...]:
    """Collect what is held of each kind, and how mostly."""
    return tuple(
        Hold(kind, tuple(pinches), _usual([one.how for one in pinches.values()]) or "")
        for kind, pinches in found.items()
    )


def _usual(words: Sequence[str]) -> str | None:
    """Return the most frequent word, the first of several; None if there is none."""
    return max(dict.fromkeys(words), key=words.count, default=None)
