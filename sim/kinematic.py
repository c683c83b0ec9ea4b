"""Common base of the true world and the planning world: a scene and a robot that stay where they are put.

Kinematic only: nothing has mass, nothing is pushed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from planlang.geometry import Pose
from planlang.geometry.matrices import moved
from planlang.protocols import Configuration, Contact
from planlang.state import Grip, Hold, Made, WorldState
from planlang.state.matter import ON, Matter
from sim.bodies import Bodies, Part
from sim.camera import Camera, Rays
from sim.contact import PARTED, Contacts, HeldObject, Query
from sim.engine import bullet, connect
from sim.falling import Falling
from sim.leaves import LeafGrasp, Leaves
from sim.people import ComfortZone, People, parts_of
from sim.robot import Robot
from sim.scene import Body, BodyShape, CameraModel, CameraNoise, RobotBody, Scene
from sim.truth import ROBOT

NEAR_BY = 0.01
"""Distance within which bodies may touch a leaf when a hand grasps it [m]: frames, neighbours, seals."""


class KinematicScene:
    """A scene and at most one robot in its own physics client; any number of scenes live side by side."""

    has_camera = False
    """True if a robot takes pictures in it."""
    rate = 30
    """Steps per second."""

    def __init__(self, scene: Scene, robot: RobotBody | None = None, *, gui: bool = False) -> None:
        """Create the scene.

        Raises ``RuntimeError`` without a display for ``gui``, ``BadInput`` for a URDF that cannot be loaded.
        """
        self.scene = scene
        self._client = connect(gui=gui)
        persons = {body.name: parts_of(body) for body in scene.bodies if body.shape is BodyShape.PERSON}
        self._bodies = Bodies(self._client, scene, persons, shown=gui or (self.has_camera and robot is not None))
        if gui:
            self._bodies.fill(np.full(3, -np.inf), np.full(3, np.inf))
        self._camera = Camera(self._client, self._bodies)
        self._people = People(self._bodies, self.rate)
        self.held: dict[str, HeldObject] = {}
        """What hands hold, and what stands on that."""
        self.matter = Matter()
        """What things hold, and how they are."""
        self.changed = 0
        """Number of changes that actions have made; those that time brings are not counted."""
        self._leaves = Leaves(scene, self._bodies)
        self._robot: Robot | None = None
        self._now = Configuration(scene.start, {})
        self._shown: tuple[Configuration, int] | None = None
        """Configuration last shown at rest, with the robot's ``moves`` at that time."""
        if robot is not None:
            try:
                self._robot = Robot(self._client, robot)
            except BaseException:
                self.close()
                raise
            self._now = Configuration(scene.start, dict(self._robot.shown))
            self._contacts = Contacts(
                self._robot, self._bodies, self.held, self._leaves, lambda name: self.matter.gives_way(name)
            )
        self._rays = Rays(self._client, self._bodies, self._robot)
        self.gravity = Falling(self._bodies, self._rays, self.rate)
        self._made: dict[str, Made] = {}
        """Bodies of :meth:`arrange` that were not in the scene."""
        for body in scene.bodies:
            self._contain(body)
        self._show(self._now)

    # States

    def world_state(self, robot: str = ROBOT) -> WorldState:
        """The present state as a value, in which the robot has a name; held bodies are where they are now."""
        self._here()
        held = {}
        for name, one in self.held.items():
            if one.on is None:
                others = tuple(Hold(link, link, offset) for link, offset in one.others.items())
                before = self._bodies.poses[name]
                held[name] = Grip(one.link, one.link, one.offset, before, others, self.riders(name))
        return WorldState(
            {robot: self.configuration()} if self.has_robot else {},
            {name: self._bodies.poses[name] for name in self.names()},
            dict(self._leaves.values),
            held,
            self.led(),
            {name: frozenset(one.touched) for name, one in self.held.items()},
            self.matter,
            made=dict(self._made),
            changes=self.changed,
        )

    def recall_touched(self, touched: Mapping[str, frozenset[str]]) -> None:
        """Set what held bodies have touched since they were grasped; others keep what was computed then."""
        for name, bodies in touched.items():
            if name in self.held:
                self.held[name].touched = set(bodies)

    def arrange(self, state: WorldState) -> None:
        """Bring things to a state: make those that came to be, take out those that are not there, place the others.

        What hands carry stays in them; what they carry and is not there falls out of them.
        """
        for name, made in state.made.items():
            if self._made.get(name) != made:
                self._made[name] = made
                shape = BodyShape.CYLINDER if made.is_round else BodyShape.BOX
                self._create(Body(name, made.at, made.size, shape, type=made.type, movable=True))
        there, carried = self.poses(), state.carried()
        for name in there:
            if not state.there(name):
                self.remove(name)
        for name, pose in state.poses.items():
            if name in state.away:
                continue
            if name not in there:
                self.restore(name)
            at = there[name] if name in there else self.pose(name)
            if name not in carried and at is not pose and at != pose:
                self.set_pose(name, pose)
        self.matter, self.changed = state.matter, state.changes

    # The robot

    @property
    def has_robot(self) -> bool:
        """False if the world was made without a RobotBody."""
        return self._robot is not None

    @property
    def robot(self) -> Robot:
        """The robot; raises ``RuntimeError`` in a world without one."""
        if self._robot is None:
            raise RuntimeError("this world has no robot: it was made without a RobotBody")
        return self._robot

    def configuration(self) -> Configuration:
        """Current configuration of the robot."""
        return Configuration(self._now.base, dict(self._now.joints))

    def set_configuration(self, configuration: Configuration) -> None:
        """Place the robot, with what it holds; joints not named keep their values."""
        target = Configuration(configuration.base, {**self._now.joints, **configuration.joints})
        self._show(target)
        self._now = target

    def link_pose(self, link: str) -> Pose:
        """Pose of a link frame in the map; ``KeyError`` for an unknown link."""
        self._here()
        return self.robot.link_pose(link)

    def _here(self) -> None:
        if self._bodies.hidden:  # a query was interrupted
            self._bodies.show(sorted(self._bodies.hidden))
        self._show(self._now)

    def _show(self, configuration: Configuration) -> None:
        if self._robot is None:
            return
        if configuration is not self._now and self._robot.shown.keys() != configuration.joints.keys():
            configuration = Configuration(configuration.base, {**self._now.joints, **configuration.joints})
        if self._shown is None or self._shown[0] is not configuration or self._shown[1] != self._robot.moves:
            self._robot.show(configuration)
        if configuration is self._now:
            self._shown = configuration, self._robot.moves
        for name, held in self.held.items():
            if held.placed != self._robot.moves and held.moves:
                self._bodies.carry(name, self._robot.link_pose(held.link) @ held.offset)
                held.placed = self._robot.moves
        for leaf, led in self._leaves.led.items():
            if led.placed != self._robot.moves:
                self._leaves.follow(leaf, self._robot.link_pose(led.link))
                led.placed = self._robot.moves

    def _find(self, configuration: Configuration, query: Query) -> tuple[Contact, ...]:
        if query.among is not None and not query.among:
            return ()
        self._show(configuration)
        return self._contacts.find(query)

    def _optics(self) -> CameraModel:
        return self.robot.body.camera

    @property
    def camera_noise(self) -> CameraNoise:
        """How the robot's camera errs; exact without a robot."""
        return CameraNoise() if self._robot is None else self._optics().noise

    # Bodies

    def names(self) -> tuple[str, ...]:
        """Names of all bodies but removed ones, in the order of the scene."""
        return tuple(body.name for body in self.scene.bodies if body.name not in self._bodies.removed)

    def pose(self, name: str) -> Pose:
        """Pose of the body's box centre in the map; ``KeyError`` for an unknown body."""
        self._here()
        self.scene.body(name)
        return self._bodies.poses[name]

    def poses(self) -> Mapping[str, Pose]:
        """Body -> pose in the map, for all bodies; the same object until the body is placed again."""
        self._here()
        return {name: self._bodies.poses[name] for name in self.names()}

    def size(self, name: str) -> tuple[float, float, float]:
        """Extents of the body's box along its own axes [m]."""
        return self.scene.body(name).size

    def pieces(self, name: str) -> tuple[tuple[Part, Pose], ...]:
        """Primitives of a body, each with its pose in the body's frame; the poses of limbs change."""
        return tuple((self._bodies.pieces[k].part, self._bodies.pieces[k].offset) for k in self._bodies.of[name])

    def set_pose(self, name: str, pose: Pose) -> None:
        """Place a body, at rest; if it is held, its pose in the hand changes."""
        self.scene.body(name)
        self._here()
        self.gravity.stop(name)
        self._bodies.place(name, pose)
        if name not in self.held:
            self._people.lose(name)
        else:
            held = self.held[name]
            held.offset, held.placed = self.robot.link_pose(held.link).inverse() @ pose, None
            held.others = {link: self.robot.link_pose(link).inverse() @ pose for link in held.others}

    def remove(self, name: str) -> None:
        """Take a body out of the world until :meth:`restore`; a held one is released first."""
        self.scene.body(name)
        if name in self.held:
            self._let_go(name)
        self.gravity.stop(name)
        self._people.lose(name)
        self._bodies.remove(name)

    def restore(self, name: str) -> None:
        """Bring a removed body back to its last pose."""
        self.scene.body(name)
        self._bodies.restore(name)

    def attach(self, link: str, name: str) -> None:
        """Fix a body to a link of the robot, in place, in addition to links that hold it; a person lets it go.

        A body that takes several hands does not move before they all hold it; then what stands on it moves along.
        """
        body = self.scene.body(name)
        self._here()
        pose = self._bodies.poses[name]
        offset, hand = self.robot.link_pose(link).inverse() @ pose, self.robot.hand_of(link)
        self.gravity.stop(name)
        self._people.lose(name)
        held = self.held.get(name)
        if held is None or held.on is not None or link == held.link:
            touched = self._contacts.touching(name, PARTED)
            held = self.held[name] = HeldObject(link, offset, hand, touched, needs=body.hands)
        else:
            held.others[link], held.hand = offset, held.hand | hand
        if held.needs > 1 and held.moves:
            for rider in self.standing_on(name):
                self._ride(rider, name)

    def _ride(self, rider: str, name: str) -> None:
        """Let a body move with the held one on which it stands."""
        link = self.held[name].link
        offset = self.robot.link_pose(link).inverse() @ self._bodies.poses[rider]
        self.held[rider] = HeldObject(link, offset, frozenset(), self._contacts.touching(rider, PARTED), on=name)

    def release(self, name: str) -> None:
        """Release a body in place, with what stands on it; ``KeyError`` if it is not held."""
        if name not in self.held:
            raise KeyError(f"{name!r} is not held; held: {', '.join(self.held) or 'nothing'}")
        self._here()
        self._let_go(name)

    def _let_go(self, name: str) -> None:
        del self.held[name]
        for rider in [one for one, held in self.held.items() if held.on == name]:
            del self.held[rider]

    def attached(self) -> Mapping[str, str]:
        """Held body -> link of the robot that holds it (the first of several), or that holds what it stands on."""
        return {name: held.link for name, held in self.held.items()}

    def holders(self, name: str) -> tuple[str, ...]:
        """Links of the robot that hold a body; empty if it is free or only stands on a held one."""
        held = self.held.get(name)
        return () if held is None or held.on is not None else tuple(held.links)

    def carrier(self, name: str) -> str | None:
        """Held body on which a body stands, so that it moves with it; None for one in a hand, or a free one."""
        return self.held[name].on if name in self.held else None

    def riders(self, name: str) -> tuple[str, ...]:
        """Bodies that move with a held one because they stand on it."""
        return tuple(rider for rider, held in self.held.items() if held.on == name)

    def _create(self, body: Body) -> None:
        """Add a new body to the world."""
        others = (one for one in self.scene.bodies if one.name != body.name)
        self.scene = replace(self.scene, bodies=(*others, body))
        self._bodies.create(body)
        if body.name not in self._leaves.movable:
            self._leaves.movable.append(body.name)

    def _contain(self, body: Body) -> None:
        """Set the initial contents and device state of a body."""
        for portion in body.content:
            self.matter = self.matter.put(body.name, portion)
        if body.is_on:
            self.matter = self.matter.switched(body.name, ON)

    # Doors and drawers

    def joint(self, leaf: str) -> float:
        """Value of a leaf's joint [rad, m]; ``KeyError`` if there is no such leaf."""
        self._here()
        return self._leaves.values[leaf]

    def set_joint(self, leaf: str, value: float) -> None:
        """Set a leaf's joint value, with its parts and contents; a hand that holds the leaf loses it.

        ``KeyError`` if there is no such leaf, ``ValueError`` for a value beyond the limits.
        """
        joint = self._leaves.joints[leaf]
        if not joint.lower <= value <= joint.upper:
            raise ValueError(f"joint values of {leaf} are from {joint.lower} to {joint.upper}, not {value}")
        self._here()
        self._leaves.led.pop(leaf, None)
        self._leaves.put(leaf, value, self._leaves.inside(leaf, self.held))

    def lead(self, link: str, leaf: str) -> None:
        """Let a leaf follow a link of the robot, whose fingers are closed on it, as far as its joint allows."""
        joint = self._leaves.joints[leaf]
        self._here()
        hand = self.robot.link_pose(link)
        near = {other for name in joint.bodies for other in self._contacts.touching(name, NEAR_BY)}
        touched = frozenset((*near, *joint.bodies, *joint.frame, *((joint.holder,) if joint.holder else ())))
        carried = self._leaves.inside(leaf, self.held)
        handle = self._leaves.handle(leaf, hand)
        closed = self._leaves.closed(leaf, handle)
        grip = moved((hand.inverse() @ joint.motion(self._leaves.values[leaf])).matrix(), closed)
        turn = hand.inverse() @ joint.motion(self._leaves.values[leaf]) if joint.is_knob else None
        hands, moves = self.robot.hand_of(link), self.robot.moves
        self._leaves.led[leaf] = LeafGrasp(link, handle, grip, closed, hands, touched, carried, moves, turn)

    def let_go(self, leaf: str) -> None:
        """Release a leaf where it is; no effect if no hand holds it."""
        self._here()
        self._leaves.led.pop(leaf, None)

    def led(self) -> Mapping[str, str]:
        """Leaf -> link of the robot that moves it."""
        return {leaf: led.link for leaf, led in self._leaves.led.items()}

    # Questions

    def support(self, name: str) -> str | None:
        """Find what a body would rest on if released here; None if nothing is below."""
        self.scene.body(name)
        self._here()
        return self.gravity.rest(name)[1]

    def height_above_support(self, name: str) -> float:
        """Compute how far a body would fall if released here [m]; ``inf`` if nothing is below."""
        self.scene.body(name)
        self._here()
        rest, support = self.gravity.rest(name)
        return self._bodies.poses[name].position[2] - rest.position[2] if support else float("inf")

    def stands(self, name: str) -> bool:
        """Check whether a body surely stands on a box, within 3 cm, without asking for more; False may be wrong."""
        return self.gravity.stands(name)

    def standing_on(self, name: str) -> tuple[str, ...]:
        """List the movable bodies that stand on a body, directly or not, and that nothing holds."""
        self.scene.body(name)
        self._here()
        return tuple(self.gravity.standing_on(name, self.held))

    def person(self, name: str) -> ComfortZone:
        """Comfort zone of a person: shoulders, arm length and facing direction."""
        return self._people.reach(name)

    def contacts(self) -> tuple[Contact, ...]:
        """Find the current penetrations of the robot and of what it holds, without the allowed ones."""
        return () if self._robot is None else self._find(self._now, Query())

    def close(self) -> None:
        """Disconnect the physics client; the world cannot be used afterwards. Closing twice does nothing."""
        if self._client >= 0:
            bullet.disconnect(physicsClientId=self._client)
            self._client = -1
