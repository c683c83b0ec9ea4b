"""Grounding of motion constraints: features by object models, tools in hands, objects in the map."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from copy import copy
from dataclasses import replace
from functools import partial

import numpy as np

from executive.belief.planning_scene import PlanningScene
from executive.belief.scene_collisions import BasePose
from executive.maps.object_models import ObjectModels, Thing
from executive.modules.phases import Phase
from executive.modules.platform import Platform
from executive.motion.arm_group import ArmGroup
from executive.motion.constrained_ends import JointRates, MotionProblem
from executive.motion.constraint_functions import Surroundings
from executive.robots.arms import ArmModel
from planlang.designators import Action, Device, Location, Object, snake_case
from planlang.failures import ActionUnresolvable, ObjectUnresolvable
from planlang.geometry import IDENTITY, Array, Pose
from planlang.geometry.matrices import moved, product
from planlang.motion_constraints import (
    STANDING_FOR,
    ConstraintKind,
    Feature,
    FeatureKind,
    MotionConstraint,
    a_constraint,
    a_feature,
)
from planlang.records import dataclass

PALM = 0.1
"""Distance of a hand's palm behind its grip [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class GroundedMotion:
    """Constraints with grounded features, the arms that move, and the poses of tools and objects."""

    constraints: tuple[MotionConstraint, ...]
    """Constraints in the stated order."""
    arms: tuple[ArmModel, ...]
    tools: dict[Object, tuple[int, Array]]
    """Tool -> index of its arm, and its pose (4, 4) in the frame of the arm's tip."""
    things: dict[Object, Array]
    """Object of the world -> its pose (4, 4) in the map when the recipe began."""

    def of_arm(self, number: int) -> GroundedMotion:
        """Select the constraints on the tools of one arm."""
        tools = {what: (0, offset) for what, (arm, offset) in self.tools.items() if arm == number}
        constraints = tuple(one for one in self.constraints if one.tool.of in tools)
        return GroundedMotion(constraints, self.arms[number : number + 1], tools, self.things)


UP = Object("Up", "map:up")
"""Pseudo-object whose frame is the map's, for constraints relative to the vertical."""


class Grounding:
    """Grounds the constraints of one phase of a recipe on one platform.

    Fingers of the moving arms may touch the bodies ``touches``. Bodies ``gone`` are ignored in collision checks,
    because the hand pushes them ahead.
    """

    def __init__(
        self,
        platform: Platform,
        constraints: Sequence[MotionConstraint],
        phase: Phase | None = None,
        touches: Iterable[str] = (),
        gone: Iterable[str] = (),
    ) -> None:
        """Prepare; without a ``phase``, it is the only one of its recipe."""
        self._platform, self.constraints, self.phase = platform, tuple(constraints), phase or Phase()
        self._touches, self._gone = frozenset(touches), frozenset(gone)
        self._models = ObjectModels(platform.belief.map.ontology)

    def supposing(self, scene: PlanningScene) -> Grounding:
        """Make the same grounding in a scene that is supposed; it remembers no poses of objects."""
        other = copy(self)
        other._platform, other.phase = self._platform.supposing(scene), replace(self.phase, things={})
        return other

    def before(self) -> Grounding:
        """Make the grounding of the phase before."""
        other = copy(self)
        other.constraints, other.phase = self.phase.before, replace(self.phase, before=())
        return other

    def world_things(self) -> tuple[str, ...]:
        """Resolve the names of the objects that the world features belong to. Raises ObjectUnresolvable."""
        bind = self._platform.scene.bodies.bind
        return tuple(dict.fromkeys(bind(one.world.of) for one in self.constraints))

    def grounded(self) -> GroundedMotion:
        """Ground the constraints in the belief.

        Raises ObjectUnresolvable if a tool is in no hand, and ActionUnresolvable if an object model lacks a feature, or
        if an arm would have to move alone that holds an object together with another.
        """
        tools: dict[Object, tuple[str, Pose]] = {}
        things: dict[Object, Array] = {}
        grounded = []
        for one in self.constraints:
            tool, arm, offset = self._tool(one.tool)
            world, pose = self._world(one.world)
            tools[tool.of], things[world.of] = (arm, offset), pose.matrix()
            grounded.append(replace(one, tool=tool, world=world))
        names = {arm for arm, _ in tools.values()}
        arms = tuple(arm for arm in self._platform.scene.arms.all if arm.name in names)
        if any(self._platform.scene.arms.mates(name) for name in names):
            message = "two arms hold an object together, so neither moves alone; put it down first"
            raise ActionUnresolvable(message, designator=str(grounded[0]))
        number = {arm.name: k for k, arm in enumerate(arms)}
        held = {what: (number[arm], offset.matrix()) for what, (arm, offset) in tools.items()}
        return GroundedMotion(tuple(grounded), arms, held, things)

    def _tool(self, feature: Feature) -> tuple[Feature, str, Pose]:
        """Ground the feature of a tool; return it, the arm with the tool, and the tool's pose in the tip frame."""
        scene, of, held_by = self._platform.scene, feature.of, feature.held_by
        if isinstance(of, Device):
            return self._hand(feature, of)
        known = self.phase.tools.get(f"{of.iri or of.type} {held_by}")
        arms = {arm.name for arm in (scene.arms.all if held_by is None else scene.arms.of(held_by))}
        for name, grip in self._platform.belief.held.items():
            if grip.arm in arms and (name == known if known is not None else self._fits(name, of)):
                self.phase.tools[f"{of.iri or of.type} {held_by}"] = name
                return self._feature(feature, name), grip.arm, grip.offset
        by = "no hand" if held_by is None else f"no hand of {held_by}"
        raise ObjectUnresolvable(f"{by} holds {of}", designator=str(of))

    def _fits(self, name: str, of: Object) -> bool:
        """Check whether a held object matches a designator, itself or by its content."""
        belief = self._platform.belief
        thing = next((one for one in belief.things if one.name == name), None)
        if thing is None:
            return False
        if of.iri is not None and any(one.iri == of.iri and one.name in belief.names() for one in belief.things):
            return thing.iri == of.iri
        content = belief.state.matter.contents.get(name, {})
        is_a = self._platform.scene.mirror.queries.rules.is_a
        return belief.is_a(thing, of.type) or any(is_a(one, of.type) for one in content)

    def _hand(self, feature: Feature, device: Device) -> tuple[Feature, str, Pose]:
        """Ground a feature of an empty hand; an ungrounded one becomes the hand's approach axis."""
        arms = self._platform.scene.arms.of(device)
        if not arms:
            raise ActionUnresolvable(f"the robot has no {device}", designator=str(device))
        if feature.is_grounded:
            return feature, arms[0].name, IDENTITY
        x, y, z = map(float, arms[0].frame.approach)
        line = replace(feature, kind=FeatureKind.LINE, position=(0.0, 0.0, 0.0), direction=(x, y, z))
        return line, arms[0].name, IDENTITY

    def _world(self, feature: Feature) -> tuple[Feature, Pose]:
        name = self._platform.scene.bodies.bind(feature.of)
        pose = self.phase.things.get(name, self._platform.scene.world.pose(name))
        return self._feature(feature, name), pose

    def _feature(self, feature: Feature, name: str) -> Feature:
        """Ground a feature by the object's model, and bind it to this object. Raises ActionUnresolvable."""
        thing = next(one for one in self._platform.belief.things if one.name == name)
        world, grip = self._platform.scene.world, self._platform.belief.held.get(name)
        hand = palm = None
        if grip is not None:
            back = -PALM * np.array(self._platform.robot.arm(grip.arm).approach)
            hand, palm = moved(grip.offset.inverse().matrix(), np.stack([np.zeros(3), back]))
        wall = world.scene.body(name).wall
        model = Thing(thing.iri, world.size(name), world.pose(name).rotation[2], wall, hand, palm)
        grounded = self._models.grounded(feature, model)
        if grounded is None:
            raise ActionUnresolvable(
                f"no object model of {name} has {' of '.join(feature.path[::-1])}", designator=str(feature)
            )
        return replace(grounded, of=Object(feature.of.type, thing.iri or f"thing:{name}"))

    def uprights(self, motion: GroundedMotion) -> tuple[MotionConstraint, ...]:
        """Build constraints that keep tools within their tilt limits, unless the motion itself tilts them farther."""
        bodies = self._platform.scene.world.scene.bodies
        limits = {body.iri or f"thing:{body.name}": body.largest_tilt for body in bodies}
        uprights = []
        for tool in motion.tools:
            if (limit := limits.get(tool.iri or "")) is None:
                continue
            least = math.cos(limit)
            angles = (one for one in motion.constraints if one.kind is ConstraintKind.PERPENDICULARITY)
            if any(one.tool.of == tool and one.limits[1] < least for one in angles):
                continue
            axis, level = (
                a_feature(kind, of=of, position=(0.0, 0.0, 0.0), direction=(0.0, 0.0, 1.0))
                for kind, of in (("LINE", tool), ("PLANE", UP))
            )
            uprights.append(a_constraint("PERPENDICULARITY", axis, level, lower=least, name=f"{tool} upright"))
        return tuple(uprights)

    # The problem for the solver

    @staticmethod
    def group(motion: GroundedMotion) -> ArmGroup:
        """Combine the arms of a motion into one joint space."""
        return ArmGroup([arm.chain for arm in motion.arms])

    def touching(
        self, motion: GroundedMotion, q: Array, base: BasePose | None = None, *, clear: bool = False
    ) -> list[tuple[str, str]]:
        """Find the forbidden contacts with the arms of a motion at joint positions (n,); ``clear`` as in `problem`."""
        bodies = () if clear else sorted(self._touches)
        links = [link for arm in motion.arms for link in sorted(self._platform.scene.collisions.touching_links(arm))]
        pairs = [(link, body) for body in bodies for link in links]
        ignore = [*pairs, *(() if clear else sorted(self._gone))]
        joints = dict(zip(self.group(motion).names, q.tolist(), strict=True))
        return self._platform.scene.collisions.touching(joints, base, ignore=ignore)

    def problem(
        self, motion: GroundedMotion, base: BasePose | None = None, *, blocked: bool = True, clear: bool = False
    ) -> MotionProblem:
        """Build the problem of making the motion from a base pose, by default the current one.

        Without ``blocked``, collisions are ignored; with ``clear``, fingers may not touch even permitted bodies.
        """
        platform, scene = self._platform, self._platform.scene
        current = platform.base()
        link = scene.world.link_pose(platform.robot.base_link).matrix()
        link_in_base = product(Pose.planar(*current).inverse().matrix(), link)
        place = current if base is None else base
        group = self.group(motion)
        frames = {one.frame.lstrip("/"): self._frame(one.frame, place) for one in motion.constraints if one.frame}
        base_link = product(Pose.planar(*place).matrix(), link_in_base)
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
        """Compute the rotation (3, 3) in the map of a reference frame with the base at ``base``.

        Frames are links or the map; an unknown name, as in recipes for other robots, means the base.
        """
        link, world = name.lstrip("/"), self._platform.scene.world
        if link == "map":
            return np.eye(3)
        if link not in world.robot.links:
            return Pose.planar(0.0, 0.0, base[2]).rotation
        turn = Pose.planar(0.0, 0.0, base[2] - self._platform.base()[2]).rotation
        return product(turn, world.link_pose(link).rotation)


def constraints_of(action: Action) -> tuple[MotionConstraint, ...]:
    """Read the constraints of an action, with placeholders replaced by the objects that it names.

    Raises ActionUnresolvable if the action does not name such an object.
    """
    stated = action.get("constrained_by")
    every = stated if isinstance(stated, tuple) else (stated,)
    return tuple(
        replace(one, tool=_resolved(one.tool, action), world=_resolved(one.world, action))
        for one in every
        if isinstance(one, MotionConstraint)
    )


def _resolved(feature: Feature, action: Action) -> Feature:
    """Replace the placeholder object of a feature by the object that the action names for its role."""
    if feature.of.type not in STANDING_FOR:
        return feature
    role = snake_case(STANDING_FOR[feature.of.type])
    filler = action.get(role)
    parts = filler.objects() if isinstance(filler, Location) else (filler,)
    what = next((one for one in parts if isinstance(one, Object)), None)
    if what is None:
        raise ActionUnresolvable(f"the constraint on {feature} needs {role}; state it", designator=str(action))
    return replace(feature, of=what)
