"""A motion's constraints with what they are about: features by models, tools in hands, things in the map."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from executive.belief.scene_collisions import BasePose
from executive.maps.object_models import ObjectModels, Thing
from executive.modules.phases import Phase
from executive.modules.platform import Platform
from executive.motion.arm_group import ArmGroup
from executive.motion.constrained_ends import JointRates, MotionProblem
from executive.motion.constraint_functions import Surroundings
from executive.robots.arms import ArmModel
from planlang.designators import Device, Object
from planlang.failures import ActionUnresolvable, ObjectUnresolvable
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import moved, product
from planlang.motion_constraints import ConstraintKind, Feature, FeatureKind, MotionConstraint, a_constraint, a_feature
from planlang.records import dataclass

PALM = 0.1
"""Distance of the palm of a hand behind its grip [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class GroundedMotion:
    """Constraints whose features have places, the arms that move, and the tools and things by designators of theirs."""

    constraints: tuple[MotionConstraint, ...]
    """In the order in which they are stated."""
    arms: tuple[ArmModel, ...]
    tools: dict[Object, tuple[int, Array]]
    """Tool -> the number of its arm, and its pose (4, 4) in the frame of the tip."""
    things: dict[Object, Array]
    """Thing of the world -> its pose (4, 4) in the map when the recipe began."""

    def of_arm(self, number: int) -> GroundedMotion:
        """Return what is asked of one arm."""
        tools = {what: (0, offset) for what, (arm, offset) in self.tools.items() if arm == number}
        asked = tuple(one for one in self.constraints if one.tool.of in tools)
        return GroundedMotion(asked, self.arms[number : number + 1], tools, self.things)


UP = Object("Up", "map:up")
"""Stands for the vertical."""


class Grounding:
    """Grounds motions of one platform.

    Fingers of the arms that move may touch bodies ``touches``; bodies ``gone`` are pushed ahead, so that arms come to
    where these are now.
    """

    def __init__(self, platform: Platform, touches: Iterable[str] = (), gone: Iterable[str] = ()) -> None:
        self._platform = platform
        self._touches, self._gone = frozenset(touches), frozenset(gone)
        self._models = ObjectModels(platform.belief.map.ontology)

    def world_things(self, constraints: Iterable[MotionConstraint]) -> tuple[str, ...]:
        """Return the names of the things that features of the world belong to; raises ObjectUnresolvable."""
        bind = self._platform.scene.bodies.bind
        return tuple(dict.fromkeys(bind(one.world.of) for one in constraints))

    def grounded(self, constraints: Sequence[MotionConstraint], phase: Phase) -> GroundedMotion:
        """Return a motion; raises ObjectUnresolvable for a tool in no hand.

        ActionUnresolvable without a feature, and if one arm of several that hold something together was to move alone.
        """
        tools: dict[Object, tuple[str, Pose]] = {}
        things: dict[Object, Array] = {}
        found = []
        for one in constraints:
            tool, arm, offset = self._tool(one.tool, phase)
            world, pose = self._world(one.world, phase)
            tools[tool.of], things[world.of] = (arm, offset), pose.matrix()
            found.append(replace(one, tool=tool, world=world))
        names = {arm for arm, _ in tools.values()}
        arms = tuple(arm for arm in self._platform.scene.arms.all if arm.name in names)
        if any(self._platform.scene.arms.mates(name) for name in names):
            raise ActionUnresolvable("the arms hold something together: neither moves alone", designator=str(found[0]))
        number = {arm.name: k for k, arm in enumerate(arms)}
        held = {what: (number[arm], offset.matrix()) for what, (arm, offset) in tools.items()}
        return GroundedMotion(tuple(found), arms, held, things)

    def _tool(self, feature: Feature, phase: Phase) -> tuple[Feature, str, Pose]:
        """Return the feature of a tool, the arm that holds it, and its pose in the frame of the arm's tip."""
        scene, of, held_by = self._platform.scene, feature.of, feature.held_by
        if isinstance(of, Device):
            return self._hand(feature, of)
        known = phase.tools.get(f"{of.iri or of.type} {held_by}")
        arms = {arm.name for arm in (scene.arms.all if held_by is None else scene.arms.of(held_by))}
        for name, grip in self._platform.belief.held.items():
            if grip.arm in arms and (name == known if known is not None else self._fits(name, of)):
                phase.tools[f"{of.iri or of.type} {held_by}"] = name
                return self._feature(feature, name), grip.arm, grip.offset
        by = "no hand" if held_by is None else f"no hand of {held_by}"
        raise ObjectUnresolvable(f"{by} holds {of}", designator=str(of))

    def _fits(self, name: str, of: Object) -> bool:
        """Return whether a thing is what a designator means, or contains that."""
        belief = self._platform.belief
        thing = next((one for one in belief.things if one.name == name), None)
        if thing is None:
            return False
        if of.iri is not None and any(one.iri == of.iri and one.name in belief.names() for one in belief.things):
            return thing.iri == of.iri
        content = self._platform.scene.world.changes.matter.contents.get(name, {})
        is_a = self._platform.scene.world.changes.rules.is_a
        return belief.is_a(thing, of.type) or any(is_a(one, of.type) for one in content)

    def _hand(self, feature: Feature, device: Device) -> tuple[Feature, str, Pose]:
        """Return a feature of an empty hand: its main axis is the way in which it approaches things."""
        arms = self._platform.scene.arms.of(device)
        if not arms:
            raise ActionUnresolvable(f"the robot has no {device}", designator=str(device))
        if feature.is_grounded:
            return feature, arms[0].name, Pose((0.0, 0.0, 0.0))
        x, y, z = map(float, arms[0].frame.approach)
        line = replace(feature, kind=FeatureKind.LINE, position=(0.0, 0.0, 0.0), direction=(x, y, z))
        return line, arms[0].name, Pose((0.0, 0.0, 0.0))

    def _world(self, feature: Feature, phase: Phase) -> tuple[Feature, Pose]:
        name = self._platform.scene.bodies.bind(feature.of)
        pose = phase.things.get(name, self._platform.scene.world.pose(name))
        return self._feature(feature, name), pose

    def _feature(self, feature: Feature, name: str) -> Feature:
        """Return a feature of a thing, with a designator that means this thing alone; raises ActionUnresolvable."""
        thing = next(one for one in self._platform.belief.things if one.name == name)
        world, grip = self._platform.scene.world, self._platform.belief.held.get(name)
        hand = palm = None
        if grip is not None:
            back = -PALM * np.array(self._platform.robot.arm(grip.arm).approach)
            hand, palm = moved(grip.offset.inverse().matrix(), np.stack([np.zeros(3), back]))
        wall = world.scene.body(name).wall
        described = Thing(thing.iri, world.size(name), world.pose(name).rotation[2], wall, hand, palm)
        found = self._models.grounded(feature, described)
        if found is None:
            raise ActionUnresolvable(
                f"no model of {name} has {' of '.join(feature.path[::-1])}", designator=str(feature)
            )
        return replace(found, of=Object(feature.of.type, thing.iri or f"thing:{name}"))

    def uprights(self, motion: GroundedMotion) -> tuple[MotionConstraint, ...]:
        """Return that tools which may not lean stay upright, but for those that a constraint lets lean farther."""
        bodies = self._platform.scene.world.scene.bodies
        limits = {body.iri or f"thing:{body.name}": body.largest_tilt for body in bodies}
        found = []
        for tool in motion.tools:
            if (limit := limits.get(tool.iri or "")) is None:
                continue
            least = math.cos(limit)
            asked = (one for one in motion.constraints if one.kind is ConstraintKind.PERPENDICULARITY)
            if any(one.tool.of == tool and one.limits[1] < least for one in asked):
                continue
            axis, level = (
                a_feature(kind, of=of, position=(0.0, 0.0, 0.0), direction=(0.0, 0.0, 1.0))
                for kind, of in (("LINE", tool), ("PLANE", UP))
            )
            found.append(a_constraint("PERPENDICULARITY", axis, level, lower=least, name=f"{tool} upright"))
        return tuple(found)

    # The problem that is solved

    @staticmethod
    def group(motion: GroundedMotion) -> ArmGroup:
        """Return the arms of a motion as one space of joints."""
        return ArmGroup([arm.solver.chain for arm in motion.arms])

    def touching(
        self, motion: GroundedMotion, q: Array, base: BasePose | None = None, *, clear: bool = False
    ) -> list[tuple[str, str]]:
        """Return what touches wrongly with the arms of a motion at joint values (n,); ``clear`` as in `problem`."""
        bodies = () if clear else sorted(self._touches)
        links = [link for arm in motion.arms for link in sorted(self._platform.scene.collisions.touching_links(arm))]
        pairs = [(link, body) for body in bodies for link in links]
        ignore = [*pairs, *(() if clear else sorted(self._gone))]
        joints = dict(zip(self.group(motion).names, q.tolist(), strict=True))
        return self._platform.scene.collisions.touching(joints, base, ignore=ignore)

    def problem(
        self, motion: GroundedMotion, base: BasePose | None = None, *, blocked: bool = True, clear: bool = False
    ) -> MotionProblem:
        """Return the problem of moving from where the base is, or from elsewhere; unless ``blocked`` without bodies.

        ``clear``: fingers touch nothing, not even what they otherwise may.
        """
        platform, scene = self._platform, self._platform.scene
        now = platform.base()
        link = scene.world.link_pose(platform.robot.base_link).matrix()
        map_to_base = product(Pose.planar(*now).inverse().matrix(), link)
        place = now if base is None else base
        group = self.group(motion)
        frames = {one.frame.lstrip("/"): self._frame(one.frame, place) for one in motion.constraints if one.frame}
        base_link = product(Pose.planar(*place).matrix(), map_to_base)
        where = Surroundings(
            base_link,
            motion.tools,
            {**motion.things, UP: np.eye(4)},
            frames,
            Pose.planar(0.0, 0.0, place[2]).rotation,
        )
        limits = [platform.robot.limits[name] for name in group.names]
        speed, acceleration, jerk = (
            np.array([getattr(one, kind) for one in limits]) for kind in ("speed", "acceleration", "jerk")
        )
        rates = JointRates(speed, acceleration, jerk, platform.world.rate)
        if not blocked:
            return MotionProblem(group, where, rates)

        allowed = (frozenset[str](), frozenset[str]()) if clear else (self._touches, self._gone)
        check = scene.collisions.group_check(group, motion.arms, base_link, *allowed)
        return MotionProblem(group, where, rates, check, partial(self.touching, motion, base=base, clear=clear))

    def _frame(self, name: str, base: BasePose) -> Array:
        """Return the rotation (3, 3) of a reference frame, a link; one that the robot lacks is its base."""
        named, world = name.lstrip("/"), self._platform.scene.world
        if named == "map":
            return np.eye(3)
        if named not in world.robot.links:
            return Pose.planar(0.0, 0.0, base[2]).rotation
        turn = Pose.planar(0.0, 0.0, base[2] - self._platform.base()[2]).rotation
        return product(turn, world.link_pose(named).rotation)
