"""Platform of the process modules: motions are planned in the planning scene and executed in the true world.

Also its arms: which of them a step concerns, their postures and paths.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from copy import copy
from dataclasses import field
from pathlib import Path
from typing import TYPE_CHECKING, Self

import numpy as np

from executive.ahead.foresight import Foresight
from executive.belief.planning_scene import PlanningScene
from executive.belief.scene_collisions import BasePose
from executive.locations import HandSolution, Reach, ReachKind, Resolver
from executive.locations.demands import asks_for
from executive.locations.grasp_candidates import HandPoses
from executive.locations.likely_places import Searches
from executive.locations.standing import Standing
from executive.modules.arm_choices import ArmChoices
from executive.modules.arm_paths import ArmPaths
from executive.modules.carrying import is_near, upright_postures
from executive.modules.commanding import Control, Sensing
from executive.modules.drive import Drive
from executive.modules.flowing import Flowing
from executive.modules.hands import Hands
from executive.modules.phases import Phases
from executive.robots import CARRYING
from executive.robots.arms import ArmModel
from executive.robots.openings import Fingers
from planlang.designators import Action, FixedPose, Location, Object, action
from planlang.failures import ActionUnresolvable, AmbiguousPerception, ManipulationGoalInCollision
from planlang.geometry import Array, Pose, matrices
from planlang.language.performing import actions_around, perform
from planlang.protocols import Group, GroupKind, MotionState, Trajectory
from planlang.records import dataclass
from planlang.relations.beside import InFrontOf
from planlang.relations.reaching import InCenterOf

if TYPE_CHECKING:
    from executive.locations.next_view import Exploration

AT_PLACE = 0.01
"""Largest deviation from the put-down pose at which the planned retreat is still valid, per matrix entry [m, 1]."""
STANDS = 0.02
"""Largest height above its support at which a held object counts as put down [m]."""


class Arms(ArmPaths):
    """Chooses arms and plans their motions. ``rng`` feeds the path planner."""

    def __init__(self, control: Control, rng: np.random.Generator) -> None:
        super().__init__(control, rng)
        self.choices = ArmChoices()
        """Arms chosen where the plan leaves the choice open."""
        self.begun: dict[str, tuple[object, BasePose, HandSolution]] = {}
        """Arm -> what was where, the base pose at which it began a solution, and that solution."""

    # Which arm

    def in_order(self, arms: Sequence[ArmModel]) -> list[ArmModel]:
        """Sort arms: the one that this branch chose before first, those that other branches use last."""
        mine, others = self.choices.mine(), self.choices.others()
        return sorted(arms, key=lambda arm: (arm.name != mine, arm.name in others))

    def holding(self, arms: Sequence[ArmModel]) -> list[ArmModel]:
        """List the arms that hold an object for this branch of the plan, last chosen first."""
        others = self.choices.others()
        return [
            arm for arm in self.in_order(arms) if self._control.scene.arms.held(arm.name) and arm.name not in others
        ]

    def free(self, arms: Sequence[ArmModel]) -> list[ArmModel]:
        """List the empty arms, in the order of :meth:`in_order`, without hands that were given up."""
        held, able = self._control.scene.arms.held, self._control.scene.arms.able
        return able([arm for arm in self.in_order(arms) if held(arm.name) is None])

    def thing_of(self, action: Action) -> str | None:
        """Find the thing in hand, or to be taken in hand, that a step is about; None without one.

        The step names it as ``object_acted_on``, or else the nearest action around it does.
        """
        scene = self._control.scene
        for what in (one.get("object_acted_on") for one in (action, *actions_around())):
            with suppress(AmbiguousPerception):
                name = scene.bodies.known(what) if isinstance(what, Object) else None
                if name is not None and (scene.bodies.is_graspable(name) or scene.bodies.is_held(name)):
                    return name
        return None

    def holding_for(self, action: Action, arms: Sequence[ArmModel]) -> list[ArmModel]:
        """List the arms that hold an object for a step: the thing that it is about, or any if it is about none."""
        holding, thing = self.holding(arms), self.thing_of(action)
        return holding if thing is None else [arm for arm in holding if self._holds(arm, thing)]

    def with_stated(self, action: Action) -> list[ArmModel]:
        """List the arms that hold the object that a step names; if it names none, those that hold one for the step."""
        scene, what = self._control.scene, action.get("object_acted_on")
        if not isinstance(what, Object):
            return self.holding_for(action, scene.arms.all)
        name = scene.bodies.bind(what)
        return [arm for arm in scene.arms.all if self._holds(arm, name)]

    def opened_by(self, action: Action, arms: Sequence[ArmModel]) -> list[ArmModel]:
        """List the arms whose hand a step opens, best first, if it names none; none of them drops anything.

        The hands around the thing that the step is about; without such a thing those whose object stands already, or is
        taken by a person; then the empty ones.
        """
        holding, thing = self.holding(arms), self.thing_of(action)
        named = [arm for arm in holding if thing is not None and self._holds(arm, thing)]
        return named or [arm for arm in holding if thing is None and self._may_let_go(arm)] or self.free(arms)

    def closed_by(self, action: Action, arms: Sequence[ArmModel]) -> list[ArmModel]:
        """List the arms whose hand a step closes, best first: around its thing, else empty ones, else any."""
        thing = self.thing_of(action)
        named = [arm for arm in self.holding(arms) if thing is not None and self._holds(arm, thing)]
        return named or self.free(arms) or self.in_order(arms)

    def _holds(self, arm: ArmModel, thing: str | None) -> bool:
        held = self._control.scene.arms.held(arm.name)
        return held is not None and held.name == thing

    def _may_let_go(self, arm: ArmModel) -> bool:
        """Check whether what an arm holds would not fall if the hand opened."""
        control, held = self._control, self._control.scene.arms.held(arm.name)
        if held is None or control.world.pulled(arm.tip):
            return held is not None
        return control.scene.world.height_above_support(held.name) <= STANDS

    def use(self, arm: ArmModel, solution: HandSolution) -> None:
        """Record the choice of an arm, and the solution for the grasp or put-down that it begins."""
        self.choices.choose(arm.name)
        if solution.reach.kind in (ReachKind.GRASP, ReachKind.PLACE):
            self.begun[arm.name] = (self._control.scene.surroundings(), self._control.base(), solution)

    def begun_grasp(self, arm: ArmModel, location: Location) -> HandSolution | None:
        """Look up the solution to continue: the grasp after a pre-grasp, or the retreat after a put-down.

        None unless the location asks for it and neither things nor the base have moved since it began. A retreat is
        over once the hand has gone elsewhere: from there, in front of the thing is an approach.
        """
        if arm.name not in self.begun:
            return None
        there, base, solution = self.begun[arm.name]
        if solution.reach.kind is ReachKind.RETREAT:
            if not (asks_for(location, InFrontOf) and any(self._is_near(arm, pose) for pose in solution.plan.poses)):
                return None
        elif not asks_for(location, InCenterOf):
            return None
        bind = self._control.scene.bodies.bind
        bodies = [bind(one) for one in location.objects()]
        current = there == self._control.scene.surroundings() and base == self._control.base()
        return solution if current and solution.reach.body in bodies else None

    def opening(self, arm: ArmModel) -> Fingers:
        """Compute how far to open a hand: just beyond its object, as the begun grasp needs, else fully."""
        control = self._control
        if control.scene.arms.held(arm.name) is not None:
            return arm.openings.beyond(control.scene.world.configuration().joints)
        there, base, solution = self.begun.get(arm.name, (None, None, None))
        if solution is None or (there, base) != (control.scene.surroundings(), control.base()):
            return arm.openings.widest
        return solution.plan.fingers or arm.openings.widest

    def put_down(self, arm: ArmModel, what: str) -> None:
        """Begin the planned retreat from the object that the arm has just put down, if it is at the put-down pose."""
        _, base, solution = self.begun.get(arm.name, (None, (0.0, 0.0, 0.0), None))
        if solution is None or solution.reach.kind is not ReachKind.PLACE:
            return
        if not self._is_near(arm, solution.plan.poses[1]):
            return
        plan = HandPoses(f"retreat from {what}", solution.plan.poses[1:], what)
        retreat = HandSolution(Reach(ReachKind.RETREAT, what), arm, plan, solution.joints[2:])
        self.begun[arm.name] = (self._control.scene.surroundings(), base, retreat)

    # Where it is

    def _is_near(self, arm: ArmModel, pose: Array) -> bool:
        """Check whether the tip is near a pose (4, 4) in the map."""
        return bool(np.abs(self._control.scene.arms.tip(arm) - pose).max() <= AT_PLACE)

    def is_at(self, arm: ArmModel, q: Array) -> bool:
        """Check whether the arm is at joint positions (d,), within a milliradian or millimetre."""
        return bool(np.allclose(self._control.arm_joints(arm), q, atol=1e-3))

    def posture(self, arm: ArmModel, name: str) -> Array:
        """Look up the joint positions (d,) of a named posture; joints that it does not name keep their positions.

        A name that contains a posture's name means that posture ("parkingpose"), any other name the carrying posture,
        for which a slow torso keeps its height.
        Raises ActionUnresolvable if the robot has no such posture.
        """
        robot = self._control.robot
        known = robot.postures
        key = name if name in known else next((one for one in known if one in name.lower()), CARRYING)
        if key not in known:
            message = f"{robot.name} has no posture {name}; its postures: {', '.join(known) or 'none'}"
            raise ActionUnresolvable(message, designator=f"posture {name}")
        current = self._control.arm_joints(arm)
        there = np.array([known[key].get(joint, value) for joint, value in zip(arm.joints, current, strict=True)])
        if key == CARRYING and arm.lift is not None and arm.standing is not None:
            there[arm.lift.column] = current[arm.lift.column]
        return there

    def postures(self, arm: ArmModel, name: str) -> list[Array]:
        """Find joint positions (d,) for a named posture that keep the held object upright, best first.

        If nothing near the posture does: empty, or the posture itself for an object that may lie. Raises
        ActionUnresolvable as :meth:`posture` does.
        """
        named, held = self.posture(arm, name), self._control.scene.arms.held(arm.name)
        if held is None or held.largest_tilt is None:
            return [named]
        return upright_postures(self._control, arm, held, named) or [named] * held.may_lie

    def untucked(self) -> list[tuple[ArmModel, Array]]:
        """List the arms that are not in the carrying posture, each with its joint positions there (d,).

        A shared torso may have any height, because the object in another arm may need a different one.
        """
        arms = self._control.scene.arms
        moving = [arm for arm in arms.all if not arms.mates(arm.name) and not self._is_tucked(arm)]
        postures = [(arm, self.postures(arm, CARRYING)) for arm in moving]
        return [(arm, qs[0]) for arm, qs in postures if qs]

    def _is_tucked(self, arm: ArmModel) -> bool:
        q, named = self._control.arm_joints(arm), self.posture(arm, CARRYING)
        held = self._control.scene.arms.held(arm.name)
        if held is not None and held.largest_tilt is not None:
            upright = is_near(arm, held, named, q)
            if upright or not held.may_lie:
                return upright
        away = np.abs(q - named)
        return bool((away if arm.lift is None else np.delete(away, arm.lift.column)).max() <= 1e-3)


@dataclass
class Platform(Control):
    """Robot, world and services for all process modules: ``drive``, ``arms``, ``hands`` and ``sensing``."""

    resolver: Resolver
    ancestors: Callable[[str], Sequence[str]]
    """Maps an action class to itself and its superclasses, nearest first; local names."""
    releasing: frozenset[str]
    """Action classes that release an object."""
    rng: np.random.Generator
    drive: Drive = field(init=False)
    arms: Arms = field(init=False)
    hands: Hands = field(init=False)
    phases: Phases = field(init=False)
    leaning: set[str] = field(default_factory=set)
    """Held objects that running steps tilt beyond their limit on purpose."""
    sensing: Sensing = field(init=False)
    ahead: Foresight = field(init=False)
    upload: Path | None = field(init=False, default=None)
    """File that uploaded maps are written to."""
    _exploration: Exploration | None = field(init=False, default=None)
    _searches: Searches | None = field(init=False, default=None)

    @property
    def searches(self) -> Searches:
        """The searches of this run."""
        if self._searches is None:
            self._searches = Searches(self.scene, self.drive.seconds)
        return self._searches

    def supposing(self, scene: PlanningScene) -> Self:
        """Make the same robot in a scene that is supposed, and where that has it: its base and arms plan there."""
        other = super().supposing(scene)
        other.drive, other.arms = Drive(other), self.arms.supposing(other)
        return other

    def standing(self) -> Standing:
        """Build the sources of base poses in the current planning scene."""
        return Standing(self.scene)

    @property
    def exploration(self) -> Exploration:
        """The exploration of this run; its first use begins it, with the base's pose then as origin."""
        from executive.locations.next_view import Exploration  # few runs explore

        if self._exploration is None:
            self._exploration = Exploration(self.scene)
        return self._exploration

    @property
    def exploring(self) -> Exploration | None:
        """The exploration of this run, None if none has begun."""
        return self._exploration

    def base_at(self, pose: FixedPose) -> BasePose:
        """Convert a stated pose to a map pose of the base; one off the map is relative to the exploration's origin."""
        x_min, y_min, x_max, y_max = self.scene.world.scene.bounds
        if self._exploration is None or (x_min < pose.x < x_max and y_min < pose.y < y_max):
            return pose.x, pose.y, pose.yaw
        x, y, yaw = self._exploration.origin
        goal = Pose.planar(x, y, yaw) @ Pose.planar(pose.x, pose.y, pose.yaw)
        return goal.position[0], goal.position[1], goal.yaw

    def made_goal(self, name: str) -> BasePose | None:
        """Find the base pose for the name of an exploration or a search, which moves on at each use.

        None for other names. Raises ObjectNowhereToBeFound when a search has no more places.
        """
        if self._exploration is not None and name in self._exploration.names:
            return self._exploration.goal
        search = None if self._searches is None else self._searches.begun.get(name)
        return None if search is None else self.searches.next(search).base

    def goes_elsewhere(self, where: object) -> bool:
        """Check whether a name stands for an exploration or search, which may offer another place; records a miss."""
        name = where.name if isinstance(where, Location) else where
        if self._exploration is not None and name in self._exploration.names:
            self._exploration.missed()
            return self._exploration.goal is not None
        return self._searches is not None and name in self._searches.begun

    def watched(self, group: Group) -> Sequence[str]:
        """List the arms that must not lose what they hold: all while driving, else those of this branch of the plan."""
        if group.kind is GroupKind.BASE:
            return super().watched(group)
        opening = group.arms if group.kind is GroupKind.FINGERS else ()
        return [arm.name for arm in self.arms.holding(self.scene.arms.all) if arm.name not in opening]

    def missed(self, arm: ArmModel) -> None:
        """Record, for a robot without a camera, that a grasp missed, so the object is not where the map has it."""
        if self.robot.camera is None and arm.name in self.arms.begun:
            _, base, solution = self.arms.begun[arm.name]
            self.belief.missed(solution.reach.body, arm.name, base)

    def __post_init__(self) -> None:
        self.flowing = Flowing(self.belief, self.scene, self.world.rate)
        self.drive, self.hands, self.sensing = Drive(self), Hands(self), Sensing(self)
        self.arms, self.phases, self.ahead = Arms(self, self.rng), Phases(), Foresight(self.scene, self.resolver)
        self.observe()


class PlatformModule:
    """Process module on a platform. It uses the parts of the robot that it ``needs``, by default none."""

    needs: tuple[str, ...] = ()

    def __init__(self, platform: Platform) -> None:
        self.platform = platform

    def supposing(self, scene: PlanningScene) -> Self:
        """Make the same module on a platform with a scene that is supposed; it may plan, but not act."""
        other = copy(self)
        other.platform = self.platform.supposing(scene)
        return other

    def resources(self, action: Action) -> tuple[str, ...]:
        """List the parts of the robot that an action needs."""
        return self.needs

    def object_of(self, action: Action, does: str) -> Object:
        """Read the object that an action is to do something to. Raises ActionUnresolvable if it names none."""
        what = action.get("object_acted_on")
        if not isinstance(what, Object):
            raise ActionUnresolvable(f"name the object to {does} as object_acted_on", designator=str(action))
        return what

    def whole_robot(self) -> tuple[str, ...]:
        """List base, head, torso and all arms, for actions that find out only on the way which of them they need."""
        torso = [] if self.platform.robot.torso is None else ["torso"]
        return ("base", "head", *torso, *(arm.name for arm in self.platform.scene.arms.all))

    def back_of(self, arm: ArmModel) -> Array:
        """Compute the unit direction in the map (3,) in which a hand retreats, opposite to its approach."""
        return -matrices.rotated(self.platform.scene.arms.tip(arm)[:3, :3], np.asarray(arm.frame.approach))

    async def follow_to_end(
        self, arms: str, trajectory: Trajectory, what: str | None = None, *, pushes: str | None = None
    ) -> None:
        """Move arms along a trajectory. Raises ManipulationGoalInCollision if they are stopped, and records the touch.

        ``what``: object to name in the failure. ``pushes``: as for :meth:`Control.follow`.
        """
        motion = await self.platform.follow(arms, trajectory, pushes=pushes)
        if motion.state is not MotionState.DONE:
            met = await self.platform.sensing.bump(motion)
            raise ManipulationGoalInCollision(arm=arms, what=what, blocked_by=met)

    async def drive(self, base: BasePose) -> None:
        """Drive to a base pose through the process module for navigation. Raises a NavigationFailure."""
        x, y, yaw = map(float, base)
        await perform(action("Translation-LocationChange", x=x, y=y, yaw=yaw))
