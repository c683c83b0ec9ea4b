"""The believed world as location resolving and motion planning see it: a planning world kept equal to the belief."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence

import numpy as np

from executive.belief import Belief
from executive.locations import ArmModel, Base, Block, ComfortZone, Door, Held
from executive.locations.field import Floor
from executive.locations.own_view import OwnView, still_pieces
from executive.locations.reachability import GraspClass, ReachabilityMap
from executive.locations.reachability_building import Progress, keep_maps, reachability_maps
from executive.motion import Boxes, Gaze, QuickCheck
from executive.motion.arm_bodies import ArmBodies, ArmShapes, Ignored, Room
from executive.motion.clearance import Band
from executive.motion.footprint import outlines
from executive.motion.link_shapes import links_of
from executive.motion.solids import Solids
from executive.robots import Robot
from planlang.designators import Device, Object
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import moved, rotated
from planlang.ontology import expand
from planlang.protocols import Configuration, Contact
from sim import PyBulletWorld
from sim.bodies import FLOOR

SEEN_SHARE = 0.3
"""Share of an object that must be visible for a place to count as one from where it is seen."""
LEANING = 0.05
"""How far a top may lean to count as level [rad]."""
CLOSING_STEPS = 24
"""In how many steps closing fingers are looked at."""


class BelievedSurroundings:
    """Implements :class:`executive.locations.Surroundings` over a planning world; nothing here touches the truth."""

    def __init__(
        self,
        world: PyBulletWorld,
        robot: Robot,
        belief: Belief,
        arms: Sequence[ArmModel],
        gaze: Gaze | None,
    ) -> None:
        self.world, self.robot, self.belief, self.gaze = world, robot, belief, gaze
        self.arms: tuple[ArmModel, ...] = tuple(arms)
        self._maps: dict[tuple[str, GraspClass], ReachabilityMap] = {}
        self._bodies: tuple[object, Boxes, Solids] | None = None
        self._floor: tuple[object, Floor] | None = None
        self._links = frozenset(world.robot.solid_names)
        self._rest = {arm.name: self._links - self._own_links(arm) for arm in arms}
        links = links_of(world)
        self._chains = {
            arm.name: ArmShapes(world, links, arm.solver.chain, robot.base_link, robot.arm(arm.name).tip)
            for arm in arms
        }
        self._checks: tuple[object, dict[object, QuickCheck]] = (None, {})
        self._obstacles: tuple[Solids, Room] | None = None
        self._near: tuple[Room, Array, float, Room] | None = None
        self._touched: tuple[object, tuple[Contact, ...]] | None = None
        self._lifts: tuple[object, dict[tuple[str, float], list[tuple[str, str]]]] = (None, {})
        self._arm_bodies: dict[tuple[str, bool], tuple[object, ArmBodies]] = {}

    def _own_links(self, arm: ArmModel) -> frozenset[str]:
        """Links that other joints of an arm than the torso's move."""
        robot = self.world.robot
        moved = (robot.moved_by(name) for name in arm.joints if arm.lift is None or name != arm.lift.joint)
        return frozenset(robot.solid_names[number] for number in frozenset[int]().union(*moved))

    def arms_of(self, device: Device) -> Sequence[ArmModel]:
        """Arms that a device designator may mean: by the robot's part, else by type and side."""
        names = [arm.name for arm in self.robot.arms_of(device)]
        return [arm for arm in self.arms if arm.name in names]

    def bind(self, what: Object) -> str:
        """The body that an object designator means; raises ObjectUnresolvable."""
        return self.belief.bind(what, self.base())

    def block(self, name: str) -> Block:
        """The believed shape of a body; for a held one where it was grasped."""
        cylinder = self.world.scene.body(name).shape == "cylinder"
        return Block.of(self.belief.reference_pose(name), self.world.size(name), cylinder=cylinder)

    def is_person(self, name: str) -> bool:
        """Whether the body is a person."""
        return self.world.scene.body(name).shape == "person"

    def is_room(self, name: str) -> bool:
        """Whether the body is a room: everything is in it."""
        return self.world.scene.body(name).shape == "room"

    def is_graspable(self, name: str) -> bool:
        """Whether the body can be taken into a hand."""
        return self.world.scene.body(name).graspable

    def zone(self, name: str) -> ComfortZone:
        """Where the person takes things."""
        person = self.world.person(name)
        heading = math.atan2(person.facing[1], person.facing[0])
        return ComfortZone(
            person.shoulders, heading, person.arm_length, lambda point: person.comfortable(tuple(map(float, point)))
        )

    def held(self, arm: str) -> Held | None:
        """What the arm holds."""
        for name, grip in self.belief.held.items():
            if grip.arm == arm:
                return Held(name, grip.offset, self.world.size(name))
        return None

    def grasped_at(self, name: str) -> Array:
        """The tip pose (4, 4) in the map at which a held body was grasped."""
        grip = self.belief.held[name]
        return (self.belief.reference_pose(name) @ grip.offset.inverse()).matrix()

    def base(self) -> Base:
        """Where the base is."""
        return self.world.configuration().base

    def revision(self) -> int:
        """Revision of the belief."""
        return self.belief.revision

    def posture(self) -> object:
        """The robot's configuration, as something that can be compared."""
        now = self.world.configuration()
        return now.base, tuple(now.joints.items())

    def floor(self) -> Floor:
        """What takes room from the base: with the robot's body, arms left out, as it is now."""
        joints = tuple(self.world.configuration().joints.items())
        state = (self._state(), joints)
        if self._floor is None or self._floor[0] != state:
            arms = [name for arm in self.robot.arms for name in arm.joints]
            shapes = outlines(self.world.outlines(arms))
            floor = Floor(self.obstacles(), self.world.silhouette(arms), shapes, self.world.scene.bounds)
            self._floor = state, floor
        return self._floor[1]

    def solids(self) -> Solids:
        """The pieces of all bodies that are not held."""
        return self._of_bodies()[1]

    def _state(self) -> object:
        """What the places of all bodies depend on."""
        return self.belief.revision, tuple(self.belief.held), tuple(self.world.attached())

    def reachability(self, arm: ArmModel, grasp: GraspClass) -> ReachabilityMap:
        """The map of an arm and class of grasp, from the cache or built now."""
        key = (arm.name, grasp)
        if key not in self._maps:
            self._maps[key] = reachability_maps(arm, self.robot.torso, (grasp,))[grasp]
        return self._maps[key]

    def prepare(self) -> None:
        """Work out now what arms need to find their way, once for this robot: later a plan would wait for it."""
        for arm in self.arms:
            self.quick_check(arm, None)

    def map_reach(self, progress: Progress | None = None) -> None:
        """Build the maps of all arms that are not in the user's cache: later a plan would wait for them.

        ``progress`` is told of those built.
        """
        self._maps |= keep_maps(self.arms, self.robot.torso, progress)

    def quick_check(self, arm: ArmModel, touches: str | None) -> QuickCheck:
        """What tells without PyBullet how an arm may move here; ``touches`` as in :meth:`contacts`."""
        bodies = self._bodies_of(arm, opened=False)
        base = self.world.link_pose(self.robot.base_link).matrix()
        middle = moved(base, bodies.centre)
        return bodies.against(base, self._room().near(middle, bodies.reach), (arm.hand_links, touches))

    def arm_check(
        self, arm: ArmModel, touches: str | None, *, opened: bool, near: tuple[Array, float] | None = None
    ) -> QuickCheck:
        """What rules out postures of an arm from any base, and poses of its hand."""
        key, ignored = ("arm", arm.name, touches, opened), (arm.hand_links, touches)
        return self._check(key, near, lambda: self._bodies_of(arm, opened=opened), ignored)

    def stance_check(self, near: tuple[Array, float] | None = None) -> QuickCheck:
        """What rules out bases from which an arm, in its present posture, would stick into something."""
        several = [self._chains[arm.name] for arm in self.arms]
        return self._check("stance", near, lambda: ArmShapes.still(self.world, several), (frozenset(), None))

    def _check(
        self, key: object, near: tuple[Array, float] | None, bodies: Callable[[], ArmBodies], ignored: Ignored
    ) -> QuickCheck:
        """The check of some bodies against the room, kept as long as nothing moves."""
        state = self._state(), tuple(self.world.configuration().joints.items()), tuple(self.belief.held.values())
        if self._checks[0] != state:
            self._checks = state, {}
        whole = key, None if near is None else (near[0].tobytes(), near[1])
        found = self._checks[1].get(whole)
        if found is None:
            found = self._checks[1][whole] = bodies().against(np.eye(4), self._room_near(near), ignored)
        return found

    def _room_near(self, near: tuple[Array, float] | None) -> Room:
        """The bodies that meet a sphere, or all; the last is remembered, as several checks ask for the same."""
        room = self._room()
        if near is None:
            return room
        known = self._near
        if known is None or known[0] is not room or known[2] != near[1] or not np.array_equal(known[1], near[0]):
            known = self._near = room, *near, room.near(*near)
        return known[3]

    def _room(self) -> Room:
        """All bodies as obstacles."""
        solids = self.solids()
        if self._obstacles is None or self._obstacles[0] is not solids:
            floor = next((body.name for body in self.world.scene.bodies if body.shape == "room"), FLOOR)
            self._obstacles = solids, Room.of(solids, floor)
        return self._obstacles[1]

    def _bodies_of(self, arm: ArmModel, *, opened: bool) -> ArmBodies:
        """An arm with all that its joints move and may meet of the robot; its own joints may be anywhere."""
        joints = self.world.configuration().joints
        rest = tuple(item for item in joints.items() if item[0] not in arm.joints)
        opened = opened and any(joints.get(name) != value for name, value in self._fingers(arm).items())
        state = rest, self._in_hands()
        known = self._arm_bodies.get((arm.name, opened))
        if known is None or known[0] != state:
            found = self._chains[arm.name].now(self.world, self._fingers(arm) if opened else None)
            known = self._arm_bodies[arm.name, opened] = state, found
        return known[1]

    def _in_hands(self) -> object:
        """What the bodies of arms depend on beside joints; with empty hands nothing that happens in the world."""
        held = tuple(self.belief.held.values())
        return (self._state(), held) if held or self.world.attached() else None

    def _fingers(self, arm: ArmModel) -> Mapping[str, float]:
        """The joints of an arm's fingers where they are open."""
        gripper = self.robot.arm(arm.name).gripper
        return gripper.opened if gripper is not None else {}

    def lifted(self, arm: ArmModel, torsos: Sequence[float]) -> tuple[float, ...]:
        """Positions of the torso at which the rest of the robot, in its present posture, does not touch itself."""
        if arm.lift is None:
            return tuple(torsos)
        now = self.world.configuration()
        state = tuple(now.joints.items())
        if self._lifts[0] != state:
            self._lifts = state, {}
        known, joint, rest = self._lifts[1], arm.lift.joint, self._rest[arm.name]
        for torso in torsos:
            if (joint, torso) not in known:
                found = self.world.self_contacts(Configuration(now.base, {**now.joints, joint: torso}))
                known[joint, torso] = [(contact.part, contact.body) for contact in found]
        return tuple(torso for torso in torsos if not any(rest.issuperset(pair) for pair in known[joint, torso]))

    def boxes_but(self, without: Sequence[str]) -> tuple[Boxes, tuple[str, ...]]:
        """Boxes around the pieces of all bodies that are not held, some left out; and whose they are."""
        boxes, solids = self._of_bodies()
        if not set(without) & set(solids.bodies):
            return boxes, solids.bodies
        kept = np.flatnonzero([body not in without for body in solids.bodies])
        return boxes.only(kept), tuple(solids.bodies[index] for index in kept)

    def _of_bodies(self) -> tuple[Boxes, Solids]:
        """Boxes around the pieces, and the pieces themselves."""
        state = self._state()
        if self._bodies is None or self._bodies[0] != state:
            pieces = self.world.solids()
            sizes = np.array([piece.size for piece in pieces]).reshape(-1, 3)
            self._bodies = state, Boxes.around([piece.pose for piece in pieces], sizes), Solids.of(pieces)
        return self._bodies[1:]

    def is_round(self, name: str) -> bool:
        """Whether a body is a cylinder."""
        return self.world.scene.body(name).shape == "cylinder"

    def names(self) -> Sequence[str]:
        """All bodies."""
        return self.world.names()

    def radius(self) -> float:
        """Of the base's outline [m]."""
        return self.robot.base.radius

    def support(self, name: str) -> str | None:
        """What a body is believed to rest on."""
        found = self.world.support(name)
        return found if found in self.world.names() else None

    def rests_at(self, name: str) -> float | None:
        """Height of the level top on which things can rest, of a room its floor [m]; None for what has none."""
        shape, block = self.world.scene.body(name).shape, self.block(name)
        if shape == "room":
            return block.low
        leans = np.abs(self.pose(name).matrix()[2, :3]).max() < math.cos(LEANING)
        lying = shape == "cylinder" and not block.round
        return None if shape in ("person", "marker") or leans or lying else block.high

    def is_solid(self, name: str) -> bool:
        """Whether a body can be touched: a marker cannot."""
        return self.world.scene.body(name).shape != "marker"

    def pose(self, name: str) -> Pose:
        """Where a body is believed to be."""
        return self.belief.reference_pose(name)

    def size(self, name: str) -> tuple[float, float, float]:
        """Extents of a body's box along its axes [m]."""
        return self.world.size(name)

    def front(self, name: str) -> float | None:
        """The heading of a body's front: where a person faces, where a door is, else the x axis of furniture.

        What a hand can take, round things, rooms and mere places have none.
        """
        body = self.world.scene.body(name)
        if body.shape == "person":
            return self.zone(name).facing
        if body.graspable or body.shape in ("cylinder", "marker", "room"):
            return None
        block = self.block(name)
        for door in self.doors(name):
            if door.name != name:  # the side of the box that the door's middle is nearest to
                middle = np.array([[door.x, door.y]]) + door.width / 2 * np.array(
                    [[math.cos(door.heading), math.sin(door.heading)]]
                )
                x, y = block.to_local(middle)[0] / np.array([block.half_x, block.half_y])
                turn = (0.0 if x > 0 else math.pi) if abs(x) >= abs(y) else math.copysign(math.pi / 2, y)
                return block.yaw + turn
        return block.yaw

    def doors(self, name: str) -> Sequence[Door]:
        """The doors that a body is or has: things of the class Door, and those hinged to it that stand upright."""
        known = {thing.iri: thing for thing in self.belief.map.objects}
        things = [thing for thing in known.values() if thing.name == name and self._is_door(thing.types)]
        own = next((thing for thing in known.values() if thing.name == name), None)
        if own is not None and not things:
            hinged = (thing for thing in known.values() if own.iri in thing.hinged_to or thing.iri in own.parts)
            things = [thing for thing in hinged if self._is_door(thing.types)]
        return [self._door(thing.name, name) for thing in things if thing.name in self.belief.names()]

    def _is_door(self, types: Sequence[str]) -> bool:
        ontology = self.belief.map.ontology
        return any(ontology.is_a(one, expand(cls)) for one in types for cls in ("Door", "DoorwayCovering"))

    def _door(self, name: str, owner: str) -> Door:
        """A closed leaf: hinged at the vertical edge that is nearer to a side of its owner, else at its left edge."""
        leaf = self.block(name)
        along = leaf.yaw if leaf.half_x >= leaf.half_y else leaf.yaw + math.pi / 2
        half = max(leaf.half_x, leaf.half_y)
        hinge = -1.0
        if owner != name:
            frame = self.block(owner)
            ends = leaf.yaw, along
            places = np.array(
                [[leaf.x + s * half * math.cos(ends[1]), leaf.y + s * half * math.sin(ends[1])] for s in (-1, 1)]
            )
            spare = np.array([frame.half_x, frame.half_y]) - np.abs(frame.to_local(places))
            axis = int(np.argmax(np.abs(np.diff(frame.to_local(places), axis=0))[0]))
            hinge = -1.0 if spare[0, axis] <= spare[1, axis] else 1.0
        x, y = leaf.x + hinge * half * math.cos(along), leaf.y + hinge * half * math.sin(along)
        return Door(name, x, y, 2 * half, along if hinge < 0 else along + math.pi)

    def tip(self, arm: ArmModel) -> Array:
        """Pose (4, 4) of an arm's tip in the map."""
        return self.world.link_pose(self.robot.arm(arm.name).tip).matrix()

    def obstacles(self) -> Boxes:
        """Boxes around the pieces of all bodies that are not held, the floor left out."""
        return self.boxes_but(())[0]

    def silhouette(self) -> tuple[Band, ...]:
        """What the robot needs of room when it stands or turns, with what it holds, in its present posture."""
        return self.world.silhouette()

    def contacts(
        self,
        base: Base,
        arm: ArmModel | None = None,
        q: Array | None = None,
        touches: str | None = None,
        opened: bool = False,
        among: Collection[tuple[str, str]] | None = None,
    ) -> tuple[Contact, ...]:
        """Penetrations with an arm at ``q``, all else as it is; its hand may touch the body ``touches``.

        ``opened``: with the fingers of the arm open. ``among``: the only pairs that can touch, if that is known.
        """
        now = self.world.configuration().joints
        if arm is None or q is None:
            found = self.world.contacts(Configuration(base, now), ("base",), among=among)
            return found if among is not None else (*found, *self._own_contacts(now))
        joints = dict(now)
        gripper = self.robot.arm(arm.name).gripper
        joints |= gripper.opened if opened and gripper is not None else {}
        joints |= zip(arm.joints, map(float, q), strict=True)
        ignore = [(link, touches) for link in sorted(arm.hand_links)] if touches is not None else []
        moving = (*arm.joints, *(gripper.opened if opened and gripper is not None else ()))
        return self.world.contacts(Configuration(base, joints), moving, ignore=ignore, among=among)

    def _own_contacts(self, joints: Mapping[str, float]) -> tuple[Contact, ...]:
        """Where the robot, as it is, with what it holds, touches itself: wherever it stands."""
        state = tuple(joints.items()), tuple(self.world.attached())
        if self._touched is None or self._touched[0] != state:
            self._touched = state, self.world.self_contacts(Configuration(self.base(), joints))
        return self._touched[1]

    def stops_closing(self, base: Base, arm: ArmModel, q: Array, around: str) -> str | None:
        """The body that a finger of an arm at ``q`` would meet, closing from open, before it meets ``around``."""
        gripper = self.robot.arm(arm.name).gripper
        if gripper is None:
            return None
        joints = dict(self.world.configuration().joints) | dict(zip(arm.joints, map(float, q), strict=True))
        joints |= gripper.opened
        moving = list(gripper.joints)
        steps = [
            {name: (1.0 - share) * gripper.opened[name] + share * gripper.closed[name] for name in moving}
            for share in np.linspace(0.0, 1.0, CLOSING_STEPS + 1)[1:].tolist()
        ]
        links = [self.world.robot.moved_by(name) for name in moving]
        apart = len(frozenset[int]().union(*links)) == sum(map(len, links))
        if apart and self.world.passed(Configuration(base, joints), steps) <= {around}:
            return None  # each finger goes its way whatever becomes of the others
        for step in steps:
            for name in tuple(moving):
                value = step[name]
                contacts = self.world.contacts(Configuration(base, joints | {name: value}), [name])
                bodies = [contact.body for contact in contacts]
                if not bodies:
                    joints[name] = value
                elif around in bodies or set(bodies) <= self._links:
                    moving.remove(name)
                else:
                    return next(body for body in bodies if body not in self._links)
        return None

    def looked_in_vain(self, name: str) -> Sequence[Base]:
        """Places from where the body was looked for and not seen."""
        return self.belief.looked_in_vain(name)

    def sighted(self) -> bool:
        """Whether the robot has a camera."""
        return self.gaze is not None

    def camera_range(self) -> tuple[float, float]:
        """Distances between which the camera recognises things [m]."""
        camera = self.robot.camera
        return (0.0, 0.0) if camera is None else (camera.near, camera.far)

    def own_view(self) -> OwnView | None:
        """What the robot's own body, neck and camera, in its present posture, leave to be seen; None without camera."""
        camera = self.robot.camera
        if self.gaze is None or camera is None:
            return None
        return OwnView(still_pieces(self.world, self.gaze.joints), self.gaze, camera.half_angle, self.camera_range())

    def hidden(self, base: Base, name: str) -> str | None:
        """None if the neck can turn the camera to a body from a base and nothing is in between.

        Else what hides most of it, "" if it is beyond the limits of neck or camera.
        """
        if self.gaze is None or self.robot.camera is None:
            return ""
        x, y, yaw = base
        c, s = math.cos(yaw), math.sin(yaw)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        centre = self.block(name).centre
        neck, beyond, camera = self.gaze.at(rotated(turn.T, centre - np.array([x, y, 0.0])))
        away = float(np.linalg.norm(centre - (rotated(turn, camera) + np.array([x, y, 0.0]))))
        if beyond > self.robot.camera.half_angle or not self.robot.camera.near <= away <= self.robot.camera.far:
            return ""
        joints = {**self.world.configuration().joints, **dict(zip(self.gaze.joints, map(float, neck), strict=True))}
        configuration = Configuration(base, joints)
        share, lines = self.world.sight(name, configuration)
        if share >= SEEN_SHARE:
            return None
        hits = {hit: number for hit, number in lines.items() if hit != name}
        return max(hits, key=lambda hit: hits[hit]) if hits else ""
