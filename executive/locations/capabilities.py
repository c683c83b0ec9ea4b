"""What a robot can do: what its hands hold, how far its arms reach, through which doorways it drives.

And warnings about what its robot file or its URDF state wrongly, each with what to write. All follows from the bound
robot and the reachability maps of its arms; ``planlang robot inspect`` prints it, ``planlang robot make`` what needs
no map.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations

import numpy as np

from executive.locations.holding import WIDTHS, Holding, holdings, trial_things
from executive.locations.reachability import CELL, GraspClass, ReachabilityMap
from executive.motion.outlines import outlines
from executive.motion.passages import narrowest_doorway
from executive.robots import Arm, Robot
from executive.robots.arms import ArmModel, arm_models, called
from executive.robots.mechanism import BASE, Mechanism, is_still
from executive.robots.openings import REMEDY
from planlang.geometry import Pose
from planlang.geometry.matrices import inverse, moved
from planlang.geometry.shapes import SolidKind
from planlang.geometry.urdf import Joint
from planlang.progress import Report, unreported
from planlang.protocols import Configuration
from planlang.records import dataclass
from planlang.state import Hold
from sim import Body, BodyShape, PlanningWorld, Scene, WorldMirror

Maps = Mapping[GraspClass, ReachabilityMap]

TESTED = 300
"""Number of reachable poses of an arm at which contact with the robot's own body is tested."""
SELDOM, OFTEN = 0.01, 0.5
"""Shares of them above which it is worth naming the link in the way, and a warning."""
MOSTLY = 0.8
"""Share of an arm's reach over the base that is worth a warning."""
WIDEST = 0.3
"""Greatest plausible opening of a hand [m]."""
LONGEST = 0.4
"""Greatest plausible distance of a finger's end from the grip point [m]."""
WIDER, NARROWER = 0.015, 0.02
"""Differences between what plans grasp, and what fingers hold or a hand is said to open, that count [m]."""
SAME = 0.002
"""Difference of two openings that does not count [m]."""
_MUG = Body("mug", Pose((0.0, 5.0, 0.05)), (0.08, 0.08, 0.1), BodyShape.CYLINDER, type="Cup", movable=True)
_FROM = {GraspClass.SIDE: "grasps from the side", GraspClass.TILTED: "tilted ones", GraspClass.TOP: "from above"}
"""Grasp directions in words."""
_SIDES = re.compile(r"left|right|(?<![a-z])[lr](?![a-z])", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Reach:
    """What an arm reaches by grasps of one class."""

    grasp: GraspClass
    poses: int
    lowest: float | None
    """Height above the floor of the lowest pose of the hand [m]; None without any."""
    highest: float | None

    def __str__(self) -> str:
        """Say it: "18,767 from above at 0.2-0.91 m"."""
        heights = "" if self.lowest is None else f" at {self.lowest:g}-{self.highest:g} m"
        return f"{self.poses:,} {_FROM[self.grasp]}{heights}"


@dataclass(frozen=True, slots=True)
class OwnBody:
    """The parts of an arm's reach that are over the base, and in which it touches the robot's own body."""

    over: float
    """Share of the poses in which the hand is over the base, where things rarely are, 0..1."""
    share: float
    """Share of the others in which the arm touches the robot's own body, 0..1."""
    link: str | None
    """The link that is in the way most often, of the pairs of it and a link of the arm."""
    touched_by: str | None
    """That link of the arm."""
    other: str | None = None
    """Another arm, in its carrying posture, that one of these two links belongs to."""

    def __str__(self) -> str:
        """Say it: "below 9 % of that, in the way of 12 % of the rest, mostly mobile_base"."""
        is_worth = self.link is not None and self.share >= SELDOM
        said = f"below {_percent(self.over)} of that, in the way of {_percent(self.share)} of the rest"
        return f"{said}, mostly {self.link}" if is_worth else said


@dataclass(frozen=True, slots=True)
class ArmReach:
    """Reach of one arm."""

    arm: str
    reaches: tuple[Reach, ...]
    own_body: OwnBody
    spacing: tuple[float, float]
    """Distances between places of the hand in x and y [m], the coarsest of all grasps."""


@dataclass(frozen=True, slots=True)
class Doorways:
    """Widths of the narrowest doorways through which a robot drives in its carrying posture [m]; None: over 3 m."""

    empty: float | None
    with_mug: float | None
    """The same with a mug in the hand; None also if no hand holds one."""
    held_by: str | None
    """The arm with the mug."""

    def __str__(self) -> str:
        """Say it: "0.75 m wide, with a mug in the left hand 0.8 m"."""
        said = "over 3 m" if self.empty is None else f"{self.empty:g} m wide"
        if self.held_by is None:
            return said
        return f"{said}, with a mug in the hand {'over 3 m' if self.with_mug is None else f'{self.with_mug:g} m'}"


@dataclass(frozen=True, slots=True)
class Advice:
    """A warning about a robot, and what to write where."""

    what: str
    write: str

    def __str__(self) -> str:
        """Say both."""
        return f"{self.what}: {self.write}"


@dataclass(frozen=True, slots=True)
class Capabilities:
    """What a robot can do."""

    holdings: tuple[Holding, ...]
    reaches: tuple[ArmReach, ...]
    doorways: Doorways | None
    """None for a base that does not move."""
    warnings: tuple[Advice, ...]


def capabilities_of(
    robot: Robot, models: Sequence[ArmModel] = (), maps: Mapping[str, Maps] | None = None, report: Report = unreported
) -> Capabilities:
    """Find out what a robot with a carrying posture can do; without ``maps`` of its arms nothing about its reach.

    ``models`` are those of its arms, if they are known.
    """
    bodies = [body for pair in trial_things().values() for body in pair]
    world = PlanningWorld(Scene((_MUG, *bodies)), robot.body())
    try:
        models = models or arm_models(robot, world)
        known = maps or {}
        reaches = tuple(
            ArmReach(
                arm.name,
                tuple(_reach(grasp, found) for grasp, found in known[arm.name].items()),
                _own_body(robot, arm, known[arm.name], world),
                max(found.spacing for found in known[arm.name].values()),
            )
            for arm in models
            if arm.name in known
        )
        long, held = tuple(_too_long(robot, world)), holdings(robot, models, world, report)
        merged = {arm.name: link for arm in robot.arms if (link := _merged_jaw(robot, arm, world)) is not None}
        doorways = None if robot.base.fixed else _doorways(robot, world)
    finally:
        world.close()
    advice = (
        *_still_joints(robot),
        *long,
        *_bare(held),
        *_covered(models),
        *_openings(robot, models, held, merged),
        *_unequal(robot),
    )
    advice = (*advice, *_out_of_reach(reaches))
    return Capabilities(held, reaches, doorways, advice)


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %"


# Reach


def _reach(grasp: GraspClass, found: ReachabilityMap) -> Reach:
    if not len(found):
        return Reach(grasp, 0, None, None)
    rise = 0.0 if found.arm.lift is None else float(found.arm.lift.rise(found.arm.lift.highest))
    low, high = CELL * int(found.rows["z"].min()), CELL * int(found.rows["z"].max()) + rise
    return Reach(grasp, len(found), round(max(low, 0.0), 2), round(high, 2))


def _own_body(robot: Robot, arm: ArmModel, maps: Maps, world: PlanningWorld) -> OwnBody:
    """Test some of an arm's reachable poses beside the base, with all other joints as when it drives."""
    solid, now = world.robot.solid_names, world.configuration().joints
    own = frozenset[int]().union(*(world.robot.moved_by(name) for name in arm.joints if name != robot.torso))
    links = {solid[number] for number in own}
    bodily = set(solid) - links  # the floor is no part of the robot
    tested, inside, blocked = 0, 0, Counter[tuple[str, str]]()
    rng = np.random.default_rng(0)
    for found in maps.values():
        rows = found.rows
        torso = 0.0 if arm.lift is None else now[arm.lift.joint]
        rise = 0.0 if arm.lift is None else float(arm.lift.rise(torso))
        away = np.hypot(rows["x"], rows["y"]) * CELL > robot.base.radius
        beside = np.flatnonzero(away & (rows["z"] * CELL + rise >= 0.0))
        inside += int((~away).sum())
        some = np.sort(rng.permutation(len(beside))[: TESTED // len(maps)])
        for q in found.seeds(beside[some], torso):
            joints = {**now, **dict(zip(arm.joints, map(float, q), strict=True))}
            contacts = world.contacts(Configuration((0.0, 0.0, 0.0), joints), arm.joints)
            pairs = [(one.part, one.body) for one in contacts]
            ordered = (pair if pair[1] in links else pair[::-1] for pair in pairs)
            hits = (pair for pair in ordered if pair[1] in links and pair[0] in bodily)
            tested += 1
            if (hit := next(hits, None)) is not None:
                blocked[hit] += 1
    most = min(blocked, key=lambda pair: (-blocked[pair], pair), default=None)
    total = sum(map(len, maps.values()))
    over, share = inside / max(total, 1), blocked.total() / max(tested, 1)
    if most is None:
        return OwnBody(over, share, None, None)
    return OwnBody(over, share, *most, _other_arm(robot, arm, most, world))


def _other_arm(robot: Robot, arm: ArmModel, pair: Sequence[str], world: PlanningWorld) -> str | None:
    """Find another arm that one of two links belongs to: its own joints move it, where they put it for driving."""
    for one in robot.arms:
        joints = [name for name in one.joints if name not in arm.joints and name != robot.torso]
        numbers = frozenset[int]().union(*map(world.robot.moved_by, joints))
        if not {world.robot.solid_names[number] for number in numbers}.isdisjoint(pair):
            return one.name
    return None


# Doorways


def _doorways(robot: Robot, world: PlanningWorld) -> Doorways:
    """Drive through doorways in the present posture, with empty hands and with a mug in the first hand."""
    arm = next((arm for arm in robot.arms if arm.gripper is not None), None)
    empty = narrowest_doorway(world.silhouette(), outlines(world.outlines()))
    if arm is None:
        return Doorways(empty, None, None)
    offset = world.link_pose(arm.hand_link).inverse() @ Pose(world.link_pose(arm.tip).position)
    with_mug = world.world_state(robot.name).gripped(_MUG.name, Hold(arm.name, arm.hand_link, offset))
    world = WorldMirror(world, robot.name).at(with_mug)
    with_it = narrowest_doorway(world.silhouette(), outlines(world.outlines()))
    return Doorways(empty, with_it, arm.name)


# Warnings


def _still_joints(robot: Robot) -> Iterator[Advice]:
    """Name the joints of arms, hands, torso and camera that cannot move by their limits."""
    mechanism = Mechanism(robot.urdf)
    ends = [arm.tip for arm in robot.arms] + ([robot.camera.link] if robot.camera else [])
    joints: dict[str, Joint] = {joint.name: joint for end in ends for joint in mechanism.chain(end)}
    for arm in robot.arms:
        joints |= {joint.name: joint for joint in mechanism.fingers(arm.hand_link)}
    for name, joint in joints.items():
        if is_still(joint):
            what = f"joint {name} cannot move, its limits are {joint.lower:g} to {joint.upper:g}"
            yield Advice(what, f"if the robot's does, limits = [LOWEST, HIGHEST] in [joints.{name}]")


def _too_long(robot: Robot, world: PlanningWorld) -> Iterator[Advice]:
    """Name hands whose fingers are too long or open too wide to be fingers."""
    for arm in robot.arms:
        if arm.gripper is None:
            continue
        table = f"[arms.{arm.name}.gripper]"
        if arm.gripper.max_opening > WIDEST:
            what = f"the hand of the {arm.name} arm opens {arm.gripper.max_opening:g} m, which no hand does"
            yield Advice(what, f"fingers, opened, closed and max_opening in {table}, and hand in [arms.{arm.name}]")
        to_tip, names = inverse(world.link_pose(arm.tip).matrix()), world.robot.solid_names
        numbers = [names.index(link) for link in arm.gripper.finger_links if link in names]
        for number, points in zip(numbers, world.robot.points(numbers), strict=True):
            away = float(np.linalg.norm(moved(to_tip, points), axis=1).max(initial=0.0))
            if away > LONGEST:
                what = f"the finger {names[number]} of the {arm.name} arm ends {away:.2f} m from the grip point"
                yield Advice(what, f"tip and hand in [arms.{arm.name}], fingers in {table}")
                break


def _bare(held: Sequence[Holding]) -> Iterator[Advice]:
    """Name links without the shapes that tell what a hand holds."""
    for holding in held:
        if holding.bare:
            what = f"{holding.bare}, so what the hand of {called(holding.arm)} holds is not known"
            yield Advice(what, REMEDY)


def _covered(models: Sequence[ArmModel]) -> Iterator[Advice]:
    """Name links whose shapes are around the grip point: no thing fits there."""
    for arm in models:
        if arm.covering is not None:
            what = f"the <collision> shape of {arm.covering} covers the grip point of {called(arm.name)}"
            yield Advice(
                f"{what}, so nothing fits between its fingers",
                f"draw {arm.covering} in the URDF as it is, and each finger as a link with a shape of its own; tip and "
                f"tool_offset in [arms.{arm.name}] put the grip point between the fingertips",
            )


def _merged_jaw(robot: Robot, arm: Arm, world: PlanningWorld) -> str | None:
    """Find a finger that does not move, on the same link as the palm, where their meshes have one convex hull."""
    if arm.gripper is None:
        return None
    mechanism, names = Mechanism(robot.urdf), world.robot.solid_names
    palms = {link for joint in arm.gripper.joints for link in mechanism.ancestors(mechanism.joints[joint].parent)}
    jaws = (names.index(link) for link in arm.gripper.finger_links if link in palms and link in names)
    hulls = ((number, world.robot.hulls(number)) for number in jaws)
    return next((names[number] for number, one in hulls if any(hull.kind is SolidKind.MESH for hull in one)), None)


def _openings(
    robot: Robot, models: Sequence[ArmModel], held: Sequence[Holding], merged: Mapping[str, str]
) -> Iterator[Advice]:
    """Compare what plans grasp with what the fingers hold; ``merged`` are fingers on the link of a palm, by arm."""
    covered = {arm.name for arm in models if arm.covering is not None}
    for holding in held:
        if holding.planned and not holding.bare and holding.arm not in covered:
            yield from _opening(robot.arm(holding.arm), holding, merged.get(holding.arm))


def _opening(arm: Arm, holding: Holding, merged: str | None) -> Iterator[Advice]:
    assert arm.gripper is not None
    table, opening = f"[arms.{arm.name}.gripper]", arm.gripper.max_opening
    planned, closed, hand = holding.widest, holding.closed, f"the hand of the {arm.name} arm"
    narrower = planned < WIDTHS[-1] and opening > planned + NARROWER  # wider things than the widest were not tried
    if holding.touching is not None:
        one, other = holding.touching
        pair = f'["{one}", "{other}"]'
        what = f"{one} and {other} touch when {hand} is open, so it grasps nothing"
        yield Advice(what, f"allowed_contacts = [{pair}]")
    elif merged is not None and narrower:
        taken = f"takes things of up to {planned:g} m" if planned else "takes nothing"
        what = (
            f"{hand} is said to open {opening:g} m, and it {taken}, as the convex hull of {merged}, which is palm and"
        )
        yield Advice(f"{what} finger in one, fills the gap", "make that finger a link of its own in the URDF")
    elif not planned and not closed:
        yield Advice(
            f"the fingers of {hand} close on no box or cylinder",
            f"opened, closed and fingers in {table}, tip, approach",
        )
    elif not planned and holding.palm is not None:
        fingers = ", ".join(f'"{link}"' for link in (*arm.gripper.finger_links, holding.palm))
        what = f"{hand} holds things of up to {closed:g} m between its finger and {holding.palm}, which is no finger"
        yield Advice(what, f"fingers = [{fingers}] in {table}")
    elif closed > planned + WIDER and opening < closed:
        what = f"the fingers of {hand} hold things of up to {closed:g} m, and plans grasp up to {opening:g} m"
        yield Advice(what, f"max_opening = {closed:g} in {table}")
    elif not planned:
        what = f"the fingers of {hand} close on things of up to {closed:g} m, of which no plan grasps any"
        yield Advice(what, f"tip, approach and closing in [arms.{arm.name}], max_opening in {table}")
    elif narrower:
        what = f"{hand} is said to open {opening:g} m, and it takes things of up to {planned:g} m"
        yield Advice(what, f"max_opening in {table}, or a tip nearer to the fingertips in [arms.{arm.name}]")


def _unequal(robot: Robot) -> Iterator[Advice]:
    """Name two hands of one build that open differently."""
    grippers = [(arm, arm.gripper) for arm in robot.arms if arm.gripper is not None]
    for (one, first), (other, second) in combinations(grippers, 2):
        built = [sorted(_SIDES.sub("", joint) for joint in gripper.joints) for gripper in (first, second)]
        if built[0] == built[1] and abs(first.max_opening - second.max_opening) > SAME:
            widths = f"{first.max_opening:g} and {second.max_opening:g} m"
            what = f"the hands of the {one.name} and the {other.name} arm have the same joints and open {widths}"
            yield Advice(what, f"max_opening in [arms.{one.name}.gripper] and [arms.{other.name}.gripper]")


def _out_of_reach(reaches: Sequence[ArmReach]) -> Iterator[Advice]:
    """Name arms that reach nothing, and bodies in their way."""
    for one in reaches:
        table, own = f"[arms.{one.arm}]", one.own_body
        if not any(reach.poses for reach in one.reaches):
            yield Advice(f"the {one.arm} arm reaches nothing", f"tip, approach and closing in {table}")
        elif own.over > MOSTLY:
            what = f"{_percent(own.over)} of the reach of the {one.arm} arm is over the robot's own base"
            yield Advice(
                what, "a narrower size, or an at nearer to its edge, in [mount], or a smaller radius in [base]"
            )
        elif own.share > OFTEN and own.link is not None:
            what = f"the robot's own {own.link} is in the way of the {one.arm} arm in {_percent(own.share)} of places"
            if own.other is not None:
                what = f"the {one.arm} arm cannot go to {_percent(own.share)} of places, as parts of the robot touch"
                yield Advice(
                    f"{what}, mostly {own.link} and {own.touched_by}, with the {own.other} arm in its carrying posture",
                    f"another posture of the {own.other} arm in [postures.carrying]",
                )
            elif own.link == BASE:
                yield Advice(what, "a lower or narrower size, or an at nearer to its edge, in [mount]")
            else:
                pair = f'["{own.link}", "{own.touched_by}"]'
                yield Advice(
                    f"{what}, mostly of its {own.touched_by}",
                    f"allowed_contacts = [{pair}], if their shapes in the URDF are coarser than they are",
                )
