"""The PyBullet world: a scene, at most one robot, time in steps. Kinematic: nothing has mass, nothing is pushed."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from planlang.geometry import Array, Pose
from planlang.geometry.matrices import rotations
from planlang.protocols import Configuration, Contact, Detection, Motion, Trajectory
from sim import picture, snapshots
from sim.bodies import Bodies, Part
from sim.camera import Camera, Picture
from sim.contact import PARTED, Contacts, Held, Ignored, Query
from sim.engine import bullet, connect
from sim.falling import Falling
from sim.outline import Band, Outline, Shape, Solid, held_bands, shape_of, solids
from sim.people import People
from sim.person import Reach, parts_of
from sim.playback import BASE, Playback, advance, begin
from sim.rays import Rays
from sim.robot import Robot
from sim.scene import CameraModel, RobotBody, Scene
from sim.view import viewpoint


class PyBulletWorld:
    """Implements :class:`planlang.protocols.World` and the queries that planning asks of a world.

    Every instance has a physics client of its own: the truth and any number of planning worlds live side by side.
    A query about another configuration (:meth:`contacts`, :meth:`link_pose`, :meth:`visible`) shows the robot there and
    leaves it; whatever needs the robot where it is puts it back first, so that a series of queries costs no restoring.
    """

    def __init__(
        self, scene: Scene, robot: RobotBody | None = None, *, gui: bool = False, rate: int = 30, seed: int = 0
    ) -> None:
        """``rate``: steps per second. ``seed`` is kept for records: nothing in here is random.

        Raises ``RuntimeError`` without a display for ``gui``, ``BadInput`` for a URDF that cannot be loaded.
        """
        self.scene, self.rate, self.seed, self.steps = scene, rate, seed, 0
        self._client = connect(gui=gui)
        persons = {body.name: parts_of(body) for body in scene.bodies if body.shape == "person"}
        self._bodies = Bodies(self._client, scene, persons)
        self._camera = Camera(self._client, self._bodies)
        self._people = People(self._bodies, rate)
        self._held: dict[str, Held] = {}
        self._motions: dict[str, Playback] = {}
        self._robot: Robot | None = None
        self._now = Configuration(scene.start, {})
        if robot is not None:
            try:
                self._robot = Robot(self._client, robot)
            except BaseException:
                self.close()
                raise
            self._now = Configuration(scene.start, dict(self._robot.shown))
            self._contacts = Contacts(self._robot, self._bodies, self._held)
        self._rays = Rays(self._client, self._bodies, self._robot)
        self._falling = Falling(self._bodies, self._rays, rate)
        self._show(self._now)

    # Time

    def step(self) -> None:
        """Advance by one step: motions in the order of their groups' first start, then people, then what falls."""
        for playback in self._motions.values():
            if playback.state().state == "moving":
                self._now = advance(playback, self._find, self._now)
        self._here()
        if self._robot is not None:
            self._contacts.part()
        self._people.step({name: self._bodies.poses[name] for name in self._held})
        self._falling.step()
        self.steps += 1

    # The robot

    @property
    def robot(self) -> Robot:
        """The robot; raises ``RuntimeError`` in a world without one."""
        if self._robot is None:
            raise RuntimeError("this world has no robot: give PyBulletWorld a RobotBody")
        return self._robot

    def configuration(self) -> Configuration:
        """Where the robot is."""
        return Configuration(self._now.base, dict(self._now.joints))

    def set_configuration(self, configuration: Configuration) -> None:
        """Put the robot, with what it holds, somewhere; joints not named stay. Motions under way are halted."""
        there = Configuration(configuration.base, {**self._now.joints, **configuration.joints})
        self._show(there)
        self._now = there
        for group in self._motions:
            self.halt(group)
        if self._robot is not None:
            self._contacts.part()

    def link_pose(self, link: str, configuration: Configuration | None = None) -> Pose:
        """Pose of a link frame in the map, now or at another configuration; ``KeyError`` for an unknown link."""
        self._show(configuration or self._now)
        return self.robot.link_pose(link)

    def solid_frames(self, configuration: Configuration | None = None) -> Array:
        """(n, 4, 4) frames in the map of the robot's solid links, in their order, now or at another configuration."""
        self._show(configuration or self._now)
        places = self.robot.frames()
        frames = np.zeros((len(places), 4, 4))
        frames[:, :3, :3], frames[:, :3, 3], frames[:, 3, 3] = rotations(places[:, 3:]), places[:, :3], 1.0
        return frames

    def start(self, group: str, trajectory: Trajectory) -> None:
        """Begin a motion. A joint obeys the newest motion: another group that moves one of these joints is halted.

        A trajectory that moves finger joints alone lets each finger go on until it touches something by itself.
        Raises ``ValueError`` for unknown joints, wrong shapes, values outside the limits, or a first row elsewhere.
        """
        begun = begin(self.robot, self._find, self._now, trajectory)
        for other, playback in self._motions.items():
            if other != group and set(playback.names) & set(trajectory.names):
                self.halt(other)
        self._motions[group] = begun

    def motion(self, group: str) -> Motion:
        """State of the group's last motion; a group that has never moved is done."""
        return self._motions[group].state() if group in self._motions else Motion("done")

    def halt(self, group: str) -> None:
        """Stop the group where it is; nothing happens when it does not move."""
        if group in self._motions and self._motions[group].state().state == "moving":
            self._motions[group].halted = True

    def _find(self, configuration: Configuration, query: Query) -> tuple[Contact, ...]:
        self._show(configuration)
        return self._contacts.find(query)

    def contacts(
        self,
        configuration: Configuration | None = None,
        moving: Collection[str] | None = None,
        *,
        ignore: Ignored = (),
        among: Collection[tuple[str, str]] | None = None,
    ) -> tuple[Contact, ...]:
        """Penetrations of the robot and of what it holds, now or at another configuration; joints not named stay.

        ``moving``: joint names, "x", "y", "yaw" or "base": look only at links that these move, and in self-collision
        only at pairs that they move against each other. ``ignore``: names of
        bodies or links, or (part, body) pairs, that may touch. In self-collision the body is a link's name as well.
        ``among``: the only pairs that can touch at all, where somebody knows; they are looked at, nothing else.
        Left out: penetrations up to 0.5 mm; a hand and what it holds; hands, or held objects, and a person's arms; up
        to 2 cm between a held object and what it has touched since it was grasped.
        """
        if self._robot is None:
            return ()
        links, itself, apart = None, True, None
        if moving is not None:
            links = frozenset[int]().union(*(self._robot.moved_by(name) for name in moving))
            itself = not set(moving) <= {*BASE, "base"}
            apart = self._robot.moved_apart(frozenset(moving)) if itself else None
        return self._find(configuration or self._now, Query(links, apart, ignore, itself=itself, among=among))

    def self_contacts(self, configuration: Configuration | None = None) -> tuple[Contact, ...]:
        """Those of :meth:`contacts` that do not depend on where the robot is: with what it holds, in itself."""
        return () if self._robot is None else self._find(configuration or self._now, Query(others=False))

    def passed(self, start: Configuration, steps: Sequence[Mapping[str, float]]) -> frozenset[str]:
        """Bodies that the links which some joints move may meet on a way; no others can be touched there.

        ``start``: the configuration at the beginning; ``steps``: the joints' values, one after another.
        """
        self._show(start)
        links = frozenset[int]().union(*(self.robot.moved_by(name) for step in steps for name in step))
        lower, upper = self.robot.boxes_along(sorted(links), steps)
        near = self._bodies.near(lower, upper).any(axis=0)
        return frozenset(self._bodies.pieces[index].body for index in np.flatnonzero(near).tolist())

    def silhouette(self, without: Collection[str] = ()) -> tuple[Band, ...]:
        """What the robot, with what it holds, needs of room when it turns on the spot in its present posture.

        Bands (z_low, z_high, radius) [m] around the vertical through the base, one for each solid link and held object;
        what a joint of ``without`` moves is left out.
        """
        found = self._shape(without).bands
        if self._held:
            self._at_origin()
            found = (*found, *held_bands(self.robot, self._bodies, self._held, without))
        self._here()
        return found

    def outlines(self, without: Collection[str] = ()) -> tuple[Outline, ...]:
        """The robot from above in its present posture: z_low, z_high [m] and a convex polygon for each solid link.

        Polygons (n, 2) are in the frame of the base, counter-clockwise, and hold no more than the link does; what a
        joint of ``without`` moves is left out.
        """
        found = self._shape(without).outlines
        self._here()
        return found

    def _shape(self, without: Collection[str]) -> Shape:
        return shape_of(self.robot, self._now.joints, without, self._at_origin)

    def _at_origin(self) -> None:
        self._show(Configuration((0.0, 0.0, 0.0), self._now.joints))

    def solids(self) -> tuple[Solid, ...]:
        """The convex pieces of all bodies not held, where they are, floors left out."""
        self._here()
        return tuple(solids(self._bodies, self._held))

    def between_fingers(self, fingers: str | Collection[str]) -> str | None:
        """The body between the fingers of a hand (its link, or the finger links), each within 1 cm of it."""
        links = self.robot.body.hands[fingers] if isinstance(fingers, str) else fingers
        self._here()
        return self._contacts.between(links)

    def _here(self) -> None:
        if self._bodies.hidden:  # a query was interrupted
            self._bodies.show(sorted(self._bodies.hidden))
        self._show(self._now)

    def _show(self, configuration: Configuration) -> None:
        if self._robot is None:
            return
        if configuration is not self._now and self._robot.shown.keys() != configuration.joints.keys():
            configuration = Configuration(configuration.base, {**self._now.joints, **configuration.joints})
        self._robot.show(configuration)
        for name, held in self._held.items():
            if held.placed != self._robot.moves:
                self._bodies.place(name, self._robot.link_pose(held.link) @ held.offset)
                held.placed = self._robot.moves

    # Bodies

    def names(self) -> tuple[str, ...]:
        """Names of all bodies, in the order of the scene; removed ones are left out."""
        return tuple(body.name for body in self.scene.bodies if body.name not in self._bodies.removed)

    def pose(self, name: str) -> Pose:
        """Pose of the body's box centre in the map; ``KeyError`` for an unknown body."""
        self._here()
        self.scene.body(name)
        return self._bodies.poses[name]

    def size(self, name: str) -> tuple[float, float, float]:
        """Extents of the body's box along its own axes [m]."""
        return self.scene.body(name).size

    def pieces(self, name: str) -> tuple[tuple[Part, Pose], ...]:
        """The primitives that a body consists of, each with its pose in the body's frame; that of a limb changes."""
        return tuple((self._bodies.pieces[k].part, self._bodies.pieces[k].offset) for k in self._bodies.of[name])

    def set_pose(self, name: str, pose: Pose) -> None:
        """Put a body somewhere, at rest; a held one is from now on held like that."""
        self.scene.body(name)
        self._here()
        self._falling.stop(name)
        self._bodies.place(name, pose)
        if name not in self._held:
            self._people.lose(name)
        else:
            held = self._held[name]
            held.offset, held.placed = self.robot.link_pose(held.link).inverse() @ pose, None

    def remove(self, name: str) -> None:
        """Take a body out of the world until :meth:`restore`; a held one is let go first."""
        self.scene.body(name)
        self._held.pop(name, None)
        self._falling.stop(name)
        self._people.lose(name)
        self._bodies.remove(name)

    def restore(self, name: str) -> None:
        """Bring a removed body back to its last pose."""
        self.scene.body(name)
        self._bodies.restore(name)

    def attach(self, link: str, name: str) -> None:
        """Fix a body to a link of the robot, where it is; a person who held it lets go."""
        self.scene.body(name)
        self._here()
        offset = self.robot.link_pose(link).inverse() @ self._bodies.poses[name]
        self._falling.stop(name)
        self._people.lose(name)
        touched = self._contacts.touching(name, PARTED)
        self._held[name] = Held(link, offset, self.robot.hand_of(link), touched)

    def release(self, name: str) -> None:
        """Let a body go: it sinks in free fall unless a person has taken it. ``KeyError`` when it is not held."""
        if name not in self._held:
            raise KeyError(f"{name!r} is not held; held are {', '.join(self._held) or 'none'}")
        self._here()
        del self._held[name]
        if self._people.holder(name) is None:
            self._falling.begin(name)

    def attached(self) -> Mapping[str, str]:
        """Body -> link of the robot that holds it."""
        return {name: held.link for name, held in self._held.items()}

    def touched_since_grasp(self, name: str) -> frozenset[str]:
        """Bodies that a held one has touched ever since it was grasped: it may go on touching them a little."""
        return frozenset(self._held[name].touched)

    def falling(self, name: str) -> bool:
        """Whether a body is on its way down."""
        return name in self._falling.on_the_way

    def support(self, name: str) -> str | None:
        """What a body would rest on if it were let go here; None when that is nothing."""
        self.scene.body(name)
        self._here()
        return self._falling.rest(name)[1]

    def height_above_support(self, name: str) -> float:
        """How far a body would sink if it were let go here [m]; ``inf`` when there is nothing below."""
        self.scene.body(name)
        self._here()
        rest, support = self._falling.rest(name)
        return self._bodies.poses[name].position[2] - rest.position[2] if support else float("inf")

    def clearance(self, first: str, second: str, within: float = 1.0) -> float:
        """Distance of two bodies' surfaces [m], negative in penetration, ``inf`` beyond ``within``."""
        self._here()
        pieces = [self._bodies.of[self.scene.body(name).name] for name in (first, second)]
        return self._bodies.gap(pieces[0], pieces[1], within)

    # People

    def person(self, name: str) -> Reach:
        """Shoulders, arm length and facing direction of a person; tells whether a point is comfortable for them."""
        return self._people.reach(name)

    def shoulder(self, name: str) -> tuple[float, float, float]:
        """The point between a person's shoulders, in the map."""
        return self._people.reach(name).shoulder

    def arm_length(self, name: str) -> float:
        """From a person's shoulder to the palm [m]."""
        return self._people.reach(name).arm_length

    def hand(self, name: str, side: str = "right") -> tuple[float, float, float]:
        """Where a person's palm is, in the map."""
        x, y, z = self._people.hand(name, 0 if side == "right" else 1).tolist()
        return (x, y, z)

    def taken(self, name: str) -> str | None:
        """The person who has taken a body, None if nobody has."""
        return self._people.holder(name)

    # Looking

    def detect(self, camera_link: str) -> tuple[Detection, ...]:
        """What the camera at a link sees in its picture, in the order of the scene."""
        self._here()
        return self._camera.detect(self._optics(), self.robot.link_pose(camera_link))

    def visible(self, name: str, camera: Pose | str | None = None, configuration: Configuration | None = None) -> float:
        """Share (0..1) of a body that the camera would see without obstruction, by rays.

        ``camera``: a link (default: the camera's), at the robot's configuration or another; or a pose of the camera's
        link in the map, from where the robot itself hides nothing.
        """
        self.scene.body(name)
        if isinstance(camera, Pose):
            self._here()
            return self._camera.sight(name, self._optics(), camera, self._rays.seeing_through_the_robot)[0]
        self._show(configuration or self._now)
        pose = self.robot.link_pose(camera or self._optics().link)
        return self._camera.sight(name, self._optics(), pose, self._rays.cast)[0]

    def sight(self, name: str, configuration: Configuration | None = None) -> tuple[float, Mapping[str, int]]:
        """What is :meth:`visible` of a body by the robot's camera, and what lines to the side that faces it hit first.

        The latter as name -> lines; the robot's own links are told by their names, and lines that reach the body count
        for it.
        """
        self.scene.body(name)
        self._show(configuration or self._now)
        pose = self.robot.link_pose(self._optics().link)
        return self._camera.sight(name, self._optics(), pose, self._rays.cast)

    def _optics(self) -> CameraModel:
        return self.robot.body.camera

    def ray(self, start: Sequence[float], end: Sequence[float]) -> str | None:
        """Name of the body, or of the robot's link, that a segment hits first; None when it is free."""
        return self.rays(np.asarray([start], dtype=float), np.asarray([end], dtype=float))[0]

    def rays(self, starts: Array, ends: Array) -> tuple[str | None, ...]:
        """As :meth:`ray` for (n, 3) starts and ends, any number of them."""
        self._here()
        return self._rays.cast(starts, ends)

    def render(
        self,
        width: int = 640,
        height: int = 480,
        eye: Sequence[float] | None = None,
        target: Sequence[float] | None = None,
    ) -> Picture:
        """(height, width, 3) picture, by default of everything from above a corner; walls in between are left out."""
        self._here()
        default_eye, default_target = viewpoint(self._bodies, width / height)
        return self._camera.render(width, height, eye or default_eye, target or default_target)

    def save_picture(self, path: Path | str, width: int = 640, height: int = 480) -> None:
        """Write :meth:`render` as a PNG file; raises ``OSError`` as writing does."""
        picture.write(Path(path), self.render(width, height))

    # The whole

    def state(self) -> tuple[object, ...]:
        """A hashable snapshot: equal for worlds in which everything is at the same place."""
        self._here()
        return (
            self.steps,
            self._now.base,
            tuple(sorted(self._now.joints.items())),
            tuple((name, pose.position, pose.orientation) for name, pose in self._bodies.poses.items()),
            tuple(self.attached().items()),
            tuple(self._falling.on_the_way),
            tuple((group, playback.row, playback.state()) for group, playback in self._motions.items()),
            self._people.state(),
        )

    def snapshot(self) -> dict[str, Any]:
        """The state as JSON, from which :meth:`restore` makes an equal one in a world of the same scene and robot.

        Motions under way are not told; the robot is taken to stand where it is.
        """
        self._here()
        return {
            "step": self.steps,
            **snapshots.configuration(self._now),
            **snapshots.bodies(self._bodies, self._held),
            "held": snapshots.held(self._held),
            "falling": snapshots.falling(self._falling),
            "groups": list(self._motions),
            **snapshots.people(self._people),
        }

    def restore_state(self, state: Mapping[str, Any]) -> None:
        """Go on from a :meth:`snapshot`; raises ValueError for one of another scene or robot, or that is damaged."""
        try:
            now = snapshots.configuration_of(state)
            if now.joints.keys() != self._now.joints.keys():
                raise ValueError("the robot has other joints")
            snapshots.restore_bodies(self._bodies, state)
            if self._robot is not None:
                snapshots.restore_held(self._held, self._robot, self._bodies, state["held"])
            self._motions = {str(group): snapshots.at_rest() for group in state["groups"]}
            snapshots.restore_falling(self._falling, state["falling"])
            snapshots.restore_people(self._people, state)
            self.steps, self._now = int(state["step"]), now
        except (KeyError, TypeError, AttributeError) as problem:
            raise ValueError(f"the state of the world is damaged: {problem!r}") from None
        self._here()

    def close(self) -> None:
        """End the physics client; the world cannot be used afterwards. Closing twice does nothing."""
        if self._client >= 0:
            bullet.disconnect(physicsClientId=self._client)
            self._client = -1
