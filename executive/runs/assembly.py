"""Assembly of a run: worlds, belief, robot, and the executive that plans see.

The executive resolves locations, decides conditions by the belief and offers process modules. Its snapshot in a trace
is about 5 kB of JSON: worlds, belief, random numbers, and choices that are kept.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import replace
from functools import cache
from itertools import chain, islice
from typing import Any

import numpy as np

from executive.ahead.closing import leads_back
from executive.ahead.later_steps import fetched_beside
from executive.belief import Belief
from executive.belief.facts import decide
from executive.belief.obstacles import with_store
from executive.belief.planning_scene import PlanningScene
from executive.belief.purposes import Purposes
from executive.belief.scene_collisions import BasePose
from executive.belief.snapshots import changed_since, with_changes
from executive.locations import HandSolution, ReachKind, Resolver
from executive.locations.supposed import at_rest, with_in_hand
from executive.locations.ways_to_goals import check_goals
from executive.maps import SemanticMap, default_starts
from executive.modules.around_actions import RobotModule
from executive.modules.effects import ActionEffects
from executive.modules.giving_way import Lookout
from executive.modules.platform import Platform
from executive.robots import CARRYING, Robot
from executive.robots.arms import RobotHandle, RobotModel
from planlang.action_classes import ancestors_of
from planlang.action_conditions import declared
from planlang.changes import Physics
from planlang.designators import Action, Condition, Device, FixedPose, Location, Object, a_location, a_posture, action
from planlang.diagnostics import BadInput, Span, error
from planlang.failures import LocationUnresolvable, ObjectNotFound, ObjectUnresolvable
from planlang.geometry.matrices import apart
from planlang.language.performing import actions_around
from planlang.language.process_module import ProcessModule
from planlang.ontology import expand, shorten
from planlang.progress import Report, unreported
from planlang.protocols import Configuration, RobotInterface, Solution
from planlang.state import Hold, WorldState
from planlang.words import Blank, Option, Text
from sim import PlanningWorld, PyBulletWorld, Scene, WorldMirror, perturb
from sim.mirror import become
from sim.truth import ROBOT

MOST_NEAREST = 50
"""Free places near a start that is not, of which one is advised."""
MOST_STARTS = 5000
"""Maximum number of free base poses to try for one where the arms have room, too: a disc of 2 m in the fine grid."""


def real_scene(scene: Scene, seed: int, robot_in: PlanningWorld) -> Scene:
    """Displace things in a scene by a seed; ``robot_in`` is a world with the robot at its start pose."""
    bands = robot_in.silhouette()
    radius, height = max(radius for _, _, radius in bands), max(high for _, high, _ in bands)
    return perturb(scene, seed, radius=radius, height=height)


Holding = tuple[Scene, Mapping[str, Hold]]
"""A scene, and what the robot's hands hold in it."""


def world_at_start(
    scene: Scene,
    robot: Robot,
    start: BasePose | None,
    stack: ExitStack,
    held: Mapping[str, Hold] | None = None,
    there: Holding | None = None,
) -> PlanningWorld:
    """Make a world with the robot at its start: the user's pose, else a free pose near the middle.

    Things in ``held`` have room there, too. The pose is also free in the true world, ``there``, if that is not as the
    scene. ``stack`` closes the world. Raises BadInput if no pose is free, or the user's is not.
    """
    poses = default_starts(scene, robot.base.radius) if start is None else iter((start,))
    first = next(poses, None)
    if first is None:
        raise _no_start()

    def at(pose: BasePose, scene: Scene, held: Mapping[str, Hold] | None) -> PlanningWorld:
        world = PlanningWorld(replace(with_store(scene), start=pose), robot.body())
        stack.callback(world.close)
        if not world.robot.solid:
            message = "no link has a shape (<collision> or <visual>): collisions cannot be checked"
            raise BadInput([error("B015", message, Span(str(robot.urdf)))])
        return WorldMirror(world, robot.name).at(world.world_state(robot.name).gripping(held)) if held else world

    worlds = [at(first, scene, held)]
    if start is not None:
        _check_start(worlds[0], default_starts(scene, robot.base.radius))
    if there is not None:
        worlds.append(at(first, *there))
        if start is not None:
            _check_start(worlds[1], default_starts(there[0], robot.base.radius), " in the world")
    now = worlds[0].configuration()
    for pose in chain((first,), islice(poses, MOST_STARTS)):
        if not any(world.contacts(replace(now, base=pose), moving=("base",)) for world in worlds):
            break
    else:
        raise _no_start()
    return worlds[0] if pose == first and not held else at(pose, scene, None)


START = Option("start", Blank("X,Y,YAW"))
"""The option that places the robot."""


def _no_start() -> BadInput:
    advice = Text("choose a pose with ", START)
    return BadInput([error("X003", "no free start pose for the robot was found", help=advice)])


def _check_start(world: PlanningWorld, free: Iterator[BasePose], where: str = "") -> None:
    """Raise BadInput if the start pose is in collision or off the map; the help is the nearest of some ``free`` ones.

    Of these, the robot with its arms has room only at some.
    """
    x, y, yaw = world.scene.start
    x_min, y_min, x_max, y_max = world.scene.bounds
    place = f"the robot cannot start at {x:g},{y:g},{yaw:g}{where}"
    advice = Text(START, f" with x in {x_min:g}..{x_max:g}, y in {y_min:g}..{y_max:g}")
    if not (x_min < x < x_max and y_min < y < y_max):
        raise BadInput([error("X007", f"{place}: it is off the map", help=advice)])
    touched = sorted({contact.body for contact in world.contacts()})
    if touched:
        now = world.configuration()
        nearest = sorted(islice(free, MOST_STARTS), key=lambda pose: math.dist(pose[:2], (x, y)))[:MOST_NEAREST]
        for near in ((round(a, 2), round(b, 2), round(c, 2)) for a, b, c in nearest):
            if not world.contacts(replace(now, base=near), moving=("base",)):
                advice = Text(Option("start", near), " is the nearest free place that was found")
                break
        raise BadInput([error("X007", f"{place}: it would collide with {', '.join(touched)}", help=advice)])


def platform_of(
    robot: Robot,
    semantic_map: SemanticMap,
    interface: RobotInterface,
    believed: PlanningWorld,
    seed: int,
    report: Report = unreported,
    *,
    trusts_map: bool = False,
    unknown: Iterable[str] = (),
    models: Iterable[str] | None = None,
    arm: str | None = None,
    grasp: str | None = None,
) -> Platform:
    """Make the platform of a robot: its interface, belief and planning scene.

    ``report`` gets the progress of reachability maps. With ``trusts_map``, poses of the map count as seen; the poses of
    ``unknown`` things are not known. ``models``: classes with recognition models, beside the robot file's; None: all.
    ``arm`` and ``grasp`` are used first where the plan leaves them open. Raises BadInput for an arm that it has not.
    """
    own = robot.camera.recognises if robot.camera else None
    classes = own if models is None else (*(own or ()), *models)
    belief = Belief(
        semantic_map, believed, robot=robot.name, trusts_map=trusts_map, unknown=unknown, recognised=classes
    )
    if arm is not None or grasp is not None:
        belief.prefer(_other_hands(robot, arm), grasp)
    handle = RobotHandle(robot.name, interface, RobotModel.of(robot, believed))
    planning_scene = PlanningScene(believed, handle.model, belief)
    ontology = semantic_map.ontology

    @cache
    def vocabulary(cls: str) -> tuple[str, ...]:
        return tuple(map(shorten, ontology.ancestors(expand(cls))))

    return Platform(
        handle,
        belief,
        planning_scene,
        Resolver(planning_scene, report),
        lambda cls: ancestors_of(cls, vocabulary),
        frozenset(map(shorten, declared(ontology).ending("holding"))),
        np.random.default_rng(seed),
    )


def _other_hands(robot: Robot, arm: str | None) -> list[str]:
    names = [one.name for one in robot.arms]
    if arm is not None and arm not in names:
        advice = f"its arms: {', '.join(names) or 'none'}"
        raise BadInput([error("X005", Text(Option("arm", arm), f": {robot.name} has no such arm"), help=advice)])
    return [] if arm is None else [one for one in names if one != arm]


def take(platform: Platform, truth: PyBulletWorld | None, held: Mapping[str, Hold]) -> None:
    """Put things into the robot's hands and close the fingers on them, in the true world and in the belief.

    Without a true world, only in the belief: what is in the hands there is another matter.
    """
    state = None if truth is None else truth.world_state()
    for name, hold in held.items():
        if truth is not None and state is not None:
            scene, arm = platform.scene, next(arm for arm in platform.scene.arms.all if arm.name == hold.arm)
            base, q = platform.base(), platform.arm_joints(arm)
            supposed = scene.belief.state.placed({name: scene.world.link_pose(hold.link) @ hold.offset})
            fingers = scene.supposing(supposed).collisions.closed_on(base, arm, q, name)
            there = Configuration(base, {**state.robots[ROBOT].joints, **(fingers or {})})
            state = state.with_robot(ROBOT, there).placed({name: truth.link_pose(hold.link) @ hold.offset})
            state = state.gripped(name, hold)
        platform.belief.grasped(name, *hold)
    if held and truth is not None and state is not None:
        become(truth, ROBOT, state)


class RobotExecutive:
    """Implements :class:`planlang.language.executive.Executive` for one platform."""

    def __init__(
        self, platform: Platform, modules: Iterable[Callable[[Platform], ProcessModule]], physics: Physics | None
    ) -> None:
        """``modules`` are classes of process modules; the first that performs an action is used.

        ``physics`` is the simulated world that the platform's interface commands, in which effects come true; None if
        the interface is that of a real robot.
        """
        self.platform = platform
        self._effects = ActionEffects(platform, physics)
        ontology = platform.belief.map.ontology
        primitives = [iri for iri in ontology.individuals("Primitive") if ontology.values(iri, "finds")]
        self.finding = frozenset(shorten(cls) for iri in primitives for cls in ontology.iris(iri, "performsAction"))
        """Action classes that search for things, whose poses need not be known before."""
        self.modules: Sequence[ProcessModule] = tuple(
            RobotModule(create(platform), platform, self._effects, self.finding) for create in modules
        )
        self._start = self._believed()
        belief = platform.belief
        belief.purposes = Purposes(ontology, platform.ancestors, self._decide, self._individuals)

    def _individuals(self, what: Object) -> Sequence[Object]:
        """List designators of all things of a class."""
        belief = self.platform.belief
        return tuple(map(belief.designator, belief.of_class(what)))

    def may_create(self, what: Object, actions: Iterable[str]) -> bool:
        """Check whether actions of some classes, or heat, may create what a designator means."""
        return self._effects.may_create(what, actions)

    def may_find(self, what: Object, actions: Iterable[str]) -> bool:
        """Check whether a thing is known, or may be found by actions of some classes, or where the map has it."""
        bodies = self.platform.scene.bodies
        if bodies.known(what) is not None or bodies.means_unknown(what):
            return True
        return any(cls in self.finding for action in actions for cls in self.ancestors(action))

    def ancestors(self, action_type: str) -> Sequence[str]:
        """The class itself and its superclasses, nearest first, as local names."""
        return self.platform.ancestors(action_type)

    def revision(self) -> int:
        """Number of changes of the belief."""
        return self.platform.belief.revision

    def solutions(self, location: Location) -> Iterator[Solution]:
        """Yield base poses for the present belief, best first.

        Before the search fails, hands that were given up are tried again, a thing that is unreachable by the map alone
        is looked at, and other robots that stand in the way get the time to leave. Raises ObjectNotFound for a thing
        without a known pose, and ObjectUndeliverable for one that is taken to where the base has no way.
        """
        if isinstance(location, FixedPose):
            yield Solution(self.platform.base_at(location), self.revision(), {})
            return
        resolver, is_found = self.platform.resolver, False
        try:
            while True:
                self.platform.observe()
                try:
                    check_goals(location, actions_around(), self.platform.scene)
                    bases = self._with_a_hand_left(location)
                    for solution in self.platform.ahead.first(str(location), bases, self._gets_away):
                        is_found = True
                        yield solution
                except LocationUnresolvable as problem:
                    if type(problem) is LocationUnresolvable and self.platform.belief.rely_on_all_hands():
                        continue
                    if type(problem) is LocationUnresolvable and not is_found:
                        for what_may_help in (resolver.look_at_unseen, self._waiting):
                            if (first := what_may_help(location)) is not None:
                                yield first
                    raise
        except ObjectUnresolvable as problem:
            missing = next(filter(self.platform.scene.bodies.means_unknown, location.things()), None)
            if missing is None:
                raise
            raise ObjectNotFound(f"it is not known where {missing} is", what=str(missing)) from problem

    def _with_a_hand_left(self, location: Location) -> Iterator[Solution]:
        """Yield base poses, first those of another arm if the best one's takes the hand that is needed next.

        That is where a later step takes another thing that only this hand reaches, before it is empty again.
        """
        platform = self.platform
        found = platform.resolver.bases(location)
        first = next(found, None)
        if first is None:
            return
        if location.device is None and not self._leaves_a_hand(first):
            for arm in platform.arms.free(platform.scene.arms.hands):
                with suppress(LocationUnresolvable):
                    other = next(platform.resolver.bases(replace(location, device=self._device(arm.name))))
                    if arm.name != first.detail.get("arm") and self._leaves_a_hand(other):
                        yield other
        yield first
        yield from found

    def _leaves_a_hand(self, solution: Solution) -> bool:
        """Check whether what is grasped from a solution leaves a hand for what is taken beside it."""
        platform = self.platform
        for grasp, state in self._grasped(solution):
            other = fetched_beside(grasp.reach.body, platform.scene)
            if other is not None and not platform.ahead.reaches(a_location(in_reach_of=other), state):
                return False
        return True

    def _gets_away(self, solution: Solution) -> bool:
        """Check whether the base gets away from a solution with all things that are grasped from there."""
        return all(self.platform.ahead.gets_away(state) for _, state in self._grasped(solution))

    def _grasped(self, solution: Solution) -> Iterator[tuple[HandSolution, WorldState]]:
        """Yield the grasps from a base pose, each with the state once the thing is in the hand."""
        scene = self.platform.scene
        for found in self.platform.resolver.reached_from(solution.base).values():
            for one in found.values():
                if one.reach.kind is ReachKind.GRASP:
                    yield one, with_in_hand(scene, at_rest(scene, scene.belief.state, solution.base), one)

    def _waiting(self, location: Location) -> Solution | None:
        """Wait for other robots that keep the base from a location where they stand now; None without any."""
        names = self.platform.resolver.waits_for(location)
        if not names:
            return None
        name = names[0]
        what, longest = self.platform.scene.bodies.designator(name), Lookout(self.platform).patience(names)
        wait = action("Waiting", object_acted_on=what, duration=longest, to_location=location)
        return Solution(self.platform.base(), self.revision(), {}, (wait,), provisional=True)

    def move_to(self, solution: Solution) -> Action:
        """Make the base motion to a solution; its arm becomes the plan's choice."""
        if (arm := solution.detail.get("arm")) is not None:
            self.platform.arms.choices.choose(arm)
        x, y, yaw = map(float, solution.base)
        return action("Translation-LocationChange", x=x, y=y, yaw=yaw)

    def is_at(self, solution: Solution) -> bool:
        """Check whether the base is at the pose of a solution, within 1 cm and about 1 degree."""
        away, turn = apart(self.platform.base(), solution.base)
        return away < 0.01 and turn < 0.02

    def holds(self, condition: Condition) -> bool:
        """Decide a condition by the belief. Raises ValueError for an unknown predicate.

        A door is open or closed, and a device on, only once the robot has seen or felt it: a map that says so is not
        enough for a goal to hold.
        """
        self._effects.catch_up()
        return self._decide(condition)

    def _decide(self, condition: Condition) -> bool:
        """Decide a condition by the belief as it is."""
        match condition:
            case Condition("holding", (Object() as what,)):
                bodies = self.platform.scene.bodies  # a thing that was not found yet is in no hand
                known = bodies.known(what) if bodies.means_unknown(what) else bodies.bind(what)
                return known in self.platform.belief.held
            case Condition("hand_free", ()):
                arms = self.platform.scene.arms
                return any(arm.gripper is not None and arms.held(arm.name) is None for arm in arms.able(arms.all))
            case Condition("open" | "closed" as state, (Object() as what,)):
                belief, leaves = self.platform.belief, self.platform.scene.bodies.leaves_of(what, shut=state == "open")
                values = [(joint, belief.joint(joint.leaf)) for joint in leaves if belief.witnessed(joint.leaf)]
                if state == "open":
                    return any(joint.is_open(value) for joint, value in values)
                return 0 < len(leaves) == sum(joint.is_shut(value) for joint, value in values)
            case Condition("leads_back", (Object() as door, FixedPose() as beyond)):
                return leads_back(self.platform.scene, door, self.platform.base_at(beyond))
            case Condition("located", (Location() as where,)):
                return self.platform.resolver.holds(where)
            case Condition("located", (Location() as where, Object() as what)):
                return self.platform.resolver.holds(where, what)
        decided = decide(condition, self.platform.belief, self.platform.scene.mirror.queries)
        if decided is not None:
            return decided
        raise ValueError(
            f"cannot decide {condition}; valid conditions: holding(object), open(object), closed(object), hand_free(), "
            "located(location, object or device), contains(thing, substance, amount), baked(thing, seconds), "
            "switched_on(device), destroyed(thing), created(thing), transformed_into(thing, thing)"
        )

    def before_retry(self) -> Iterable[Action]:
        """Yield motions that open emptied hands, make room for the arms by the base, and bring them to carrying."""
        platform = self.platform
        for name in platform.belief.memory.dropped:  # the lost thing may stand between the fingers
            yield action("OpeningAGripper", device_used=self._device(name))
        untucked = platform.arms.untucked()
        if not untucked:
            return
        room = platform.standing().with_room_for(untucked)
        if room is not None and room != platform.base():
            x, y, yaw = map(float, room)
            yield action("Translation-LocationChange", x=x, y=y, yaw=yaw)
        for arm, _ in untucked if room is not None else ():
            yield action("Reaching", to_location=a_posture(CARRYING), device_used=self._device(arm.name))

    def _device(self, name: str) -> Device:
        arm = self.platform.robot.arm(name)
        return Device(f"{(arm.side or '').capitalize()}Arm", arm.iri)

    def held(self) -> Sequence[str]:
        """Names of the objects that the robot holds."""
        return tuple(self.platform.belief.held)

    def releases(self, action: Action) -> bool:
        """Check whether an action releases something, by its declared effects."""
        return any(cls in self.platform.releasing for cls in self.ancestors(action.type))

    def snapshot(self) -> dict[str, Any]:
        """What is believed as JSON, to resume a run in the world as it was left: what differs from the start.

        The base's pose is told, too: a resumed run starts elsewhere.
        """
        return {"base": list(self.platform.base()), **changed_since(self._start, self._believed())}

    def _believed(self) -> dict[str, Any]:
        return {**self.platform.belief.snapshot(), "leaning": sorted(self.platform.leaning)}

    def restore(self, changed: Mapping[str, Any]) -> None:
        """Restore the belief from a snapshot. Raises ValueError if it does not fit."""
        platform = self.platform
        try:
            left = with_changes(self._start, changed)
            platform.belief.restore(left)
            platform.leaning.update(map(str, left["leaning"]))
            self._effects.restored()
        except (KeyError, TypeError, AttributeError) as problem:
            raise ValueError(f"the state of the robot is damaged: {problem!r}") from None

    def record(self, write: Callable[[str, Mapping[str, Any]], None]) -> None:
        """Write further changes of the belief to the trace."""
        self.platform.belief.tell = write
