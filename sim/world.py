"""The true world in PyBullet: commanded and sensed like a robot's real environment; time advances in steps."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from planlang.changes import Change, Simulated
from planlang.geometry import Array, Pose
from planlang.protocols import Configuration, Contact, Detection, Motion, MotionState, Touch, Trajectory
from planlang.records import dataclass
from planlang.state import WorldState, apply, is_free
from sim.contact import Query
from sim.erring import Erring
from sim.joints import Controls
from sim.kinematic import KinematicScene
from sim.mirror import EngineQueries
from sim.movers import Movers
from sim.outlook import Outlook
from sim.processes import Processes
from sim.pushing import Pushing
from sim.robot import BASE, Robot
from sim.scene import RobotBody, Scene
from sim.truth import ROBOT

DEEPER = 0.003
"""Growth of a contact that existed before a motion beyond which it blocks the motion [m]."""

_JUMP = 0.05
"""Distance of a trajectory's first row from the robot [m, rad] above which it was planned for another configuration."""
_LIMIT = 1e-3
"""Tolerance for rows beyond joint limits [m, rad]: timing rounds, and PyBullet reads limits as floats."""
Find = Callable[[Configuration, Query], tuple[Contact, ...]]
Feel = Callable[[Contact], Touch | None]


@dataclass(slots=True)
class Playback:
    """Motion in progress: ``row`` of the trajectory has been reached; ``strands`` advance independently.

    An arm is one strand; each finger is its own strand, so that a finger that touches something waits for the others.
    """

    trajectory: Trajectory
    strands: list[Strand]
    row: int = 0
    halted: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the joints and base coordinates that the motion moves."""
        return self.trajectory.names

    def state(self) -> Motion:
        """State of the motion, as in :class:`planlang.protocols.Motion`."""
        blocked = next((strand for strand in self.strands if strand.blocked_by), None)
        if self.halted:
            return Motion(MotionState.HALTED)
        at_end = self.row + 1 >= len(self.trajectory.positions)
        if blocked and (at_end or all(strand.blocked_by for strand in self.strands)):
            return Motion(MotionState.BLOCKED, blocked.touch)
        return Motion(MotionState.DONE) if at_end else Motion(MotionState.MOVING)


@dataclass(slots=True)
class Strand:
    """Columns of a trajectory that stop together."""

    columns: list[int]
    query: Query
    before: dict[tuple[str, str], float]
    """Contacts that existed before the motion, with their depths [m]; pairs that part are dropped."""
    blocked_by: str | None = None
    touch: Touch | None = None


def begin(robot: Robot, find: Find, now: Configuration, trajectory: Trajectory) -> Playback:
    """Check a trajectory against the robot and its configuration, and prepare to play it.

    Raises ``ValueError`` for an unknown joint, a wrong shape, a non-finite number, a row outside the joint limits, or a
    first row that is not where the robot is.
    """
    _check(robot, now, trajectory)
    fingers = {link for links in robot.body.hands.values() for link in links}
    numbers = {robot.number[link] for link in fingers if link in robot.number}
    moved = [robot.moved_by(name) for name in trajectory.names]
    grip = bool(moved) and all(links and links <= numbers for links in moved)
    columns = [[k] for k in range(len(moved))] if grip else [list(range(len(moved)))]
    strands = []
    for chosen in columns:
        query = Query(
            frozenset().union(*(moved[k] for k in chosen)), grip=grip, itself=not set(trajectory.names) <= set(BASE)
        )
        before = {(contact.part, contact.body): contact.depth for contact in find(now, query)}
        strands.append(Strand(chosen, query, before))
    return Playback(trajectory, strands)


def _check(robot: Robot, now: Configuration, trajectory: Trajectory) -> None:
    names, rows = trajectory.names, np.asarray(trajectory.positions, dtype=float)
    for name in names:
        if name not in BASE and name not in robot.joints:
            raise ValueError(f"the robot has no joint {name!r}; it has x, y, yaw and {', '.join(robot.joints)}")
    if rows.ndim != 2 or not len(rows) or rows.shape[1] != len(names) or len(set(names)) != len(names):
        raise ValueError(f"a trajectory of {len(names)} different names needs (n, {len(names)}) rows, got {rows.shape}")
    if not np.isfinite(rows).all():
        raise ValueError(f"the trajectory of {', '.join(names)} contains a value that is not finite")
    here = [coordinate(now, name) for name in names]
    for k, name in enumerate(names):
        offset = abs(rows[0, k] - here[k])
        if name == "yaw":
            offset = abs((offset + np.pi) % (2 * np.pi) - np.pi)
        if offset > _JUMP:
            raise ValueError(f"the trajectory begins at {name} = {rows[0, k]:.4f}, the robot is at {here[k]:.4f}")
        lower, upper = robot.limits.get(name, (-np.inf, np.inf))
        for extreme in (float(rows[:, k].min()), float(rows[:, k].max())):
            if not lower - _LIMIT <= extreme <= upper + _LIMIT:
                raise ValueError(f"the trajectory takes {name} to {extreme:.4f}, limits are {lower:.4f} to {upper:.4f}")


def coordinate(configuration: Configuration, name: str) -> float:
    """Look up the value of a joint or of x, y, yaw."""
    return configuration.base[BASE.index(name)] if name in BASE else configuration.joints[name]


def moved(configuration: Configuration, names: Sequence[str], values: Array) -> Configuration:
    """Copy a configuration with some coordinates changed."""
    base, joints = list(configuration.base), dict(configuration.joints)
    for name, value in zip(names, values.tolist(), strict=True):
        if name in BASE:
            base[BASE.index(name)] = value
        else:
            joints[name] = value
    return Configuration((base[0], base[1], base[2]), joints)


def advance(playback: Playback, find: Find, feel: Feel, now: Configuration) -> Configuration:
    """Advance by one row; return the robot's new configuration, or ``now`` if blocked.

    ``feel`` returns what the robot feels of a contact found by the last call of ``find``.
    """
    playback.row += 1
    row = np.asarray(playback.trajectory.positions, dtype=float)[playback.row]
    for strand in playback.strands:
        if strand.blocked_by is not None:
            continue
        following = moved(now, [playback.names[k] for k in strand.columns], row[strand.columns])
        contacts = find(following, strand.query)
        blocking = _obstacle(contacts, strand.before)
        if blocking is not None:
            strand.blocked_by, strand.touch = blocking.body, feel(blocking)
        else:
            current = {(contact.part, contact.body) for contact in contacts}
            strand.before = {pair: depth for pair, depth in strand.before.items() if pair in current}
            now = following
    return now


def _obstacle(contacts: Sequence[Contact], before: Mapping[tuple[str, str], float]) -> Contact | None:
    for contact in contacts:
        earlier = before.get((contact.part, contact.body))
        if earlier is None or contact.depth > earlier + DEEPER:
            return contact
    return None


def order(detection: Detection) -> tuple[object, ...]:
    """Key by which detections are sorted, so that their order tells nothing of what is behind them."""
    return detection.type, detection.pose.position


STRAYED, TWISTED = 0.01, 0.1
"""Displacement of a hand from its grasp [m, rad] above which an object held by several hands slips off."""


class PyBulletWorld(KinematicScene):
    """Implements :class:`planlang.protocols.RobotInterface` for the robot, :class:`sim.truth.Truth` for all else.

    Motions are played back kinematically (:class:`Playback`): a step into something is undone.
    """

    has_camera = True

    def __init__(self, scene: Scene, robot: RobotBody | None = None, *, gui: bool = False, seed: int = 0) -> None:
        """Create the world; by the ``seed`` the camera errs, if it does: nothing else in here is random."""
        super().__init__(scene, robot, gui=gui)
        self.seed, self.steps = seed, 0
        self._pushes: dict[str, str] = {}
        """Motion group that pushes -> link of the hand with which it pushes."""
        self.queries = EngineQueries(self, self.enact)
        """Answers about states to which changes, flow or heat lead from the present one."""
        self._placed: Mapping[str, Pose] = {}
        """Poses of the state to which things have been brought last."""
        self._processes = Processes(self, self.queries)
        self._movers = Movers(scene.movers, self._bodies.poses, self._bodies.place, self.rate)
        self._motions: dict[str, Playback] = {}
        self.simulated = Simulated()
        """What has happened by physics so far."""
        self._controls = Controls(scene.controls, self.condition, self._switch, self._leaves.is_turned)
        hands = {} if robot is None else robot.hands
        self._hands = frozenset((*hands, *(link for fingers in hands.values() for link in fingers)))
        if self._robot is not None:
            self._pushing = Pushing(self._bodies, self._leaves, self._contacts, self.gravity)
            self._outlook = Outlook(self._contacts, self._here)
            self._erring = Erring(self._optics(), seed, lambda name: self._bodies.bodies[name].kinds)

    # Time and motions

    def step(self) -> None:
        """Advance by one step: motions in the order of their groups' first start, people, falling bodies, movers."""
        moving = [playback for playback in self._motions.values() if playback.state().state is MotionState.MOVING]
        for playback in moving:
            free = [strand for strand in playback.strands if strand.blocked_by is None]
            find = self._contacts_at if len(moving) > 1 else partial(self._contacts_alone, playback)
            self._now = advance(playback, find, self._contacts.felt, self._now)
            self._push(free)
        for group in [one for one in self._pushes if self.motion(one).state is not MotionState.MOVING]:
            self._stop_pushing(group)
        if self._robot is not None and (self.held or self._leaves.led):
            self._here()
            self._contacts.part()
            self._slip(self._robot)
            self._open(self._robot, moving)
        self._people.step({name: self._bodies.poses[name] for name, held in self.held.items() if held.on is None})
        self.gravity.step()
        self._movers.step(self.is_clear)
        self._controls.turned()
        self._processes.step(1 / self.rate)
        self.steps += 1

    def is_clear(self, name: str) -> bool:
        """Check whether neither the robot nor what it carries touches a body."""
        if self._robot is None:
            return True
        self._here()
        (lower, upper), (low, high) = self._robot.boxes(), self._bodies.box_of(name)
        near = np.flatnonzero(((lower <= high) & (upper >= low)).all(axis=1)).tolist()
        parts = (*(self._robot.solid_names[number] for number in near), *self.held)
        return not self._find(self._now, Query(among=[(part, name) for part in parts]))

    def _contacts_at(self, configuration: Configuration, query: Query) -> tuple[Contact, ...]:
        """Find the contacts at a configuration, after things pushed by hands have given way."""
        return self._pushing.contacts_after(lambda: self._find(configuration, query))

    def _contacts_alone(self, playback: Playback, configuration: Configuration, query: Query) -> tuple[Contact, ...]:
        """Find the same for the only motion: its next steps are mostly known to be free (:class:`Outlook`)."""
        is_simple = len(playback.strands) == 1 and not playback.strands[0].before and not query.grip
        if is_simple and not self._leaves.led and not self._pushing.hands:
            rows = np.asarray(playback.trajectory.positions, dtype=float)
            among = self._outlook.among(playback, playback.names, rows, playback.row, query)
            if among is not None and not self._find(configuration, replace(query, among=among)):
                return ()
        return self._contacts_at(configuration, query)

    def _stop_pushing(self, group: str) -> None:
        """End the push of a group's motion, so that obstacles stop the hand again."""
        if (link := self._pushes.pop(group, None)) is not None:
            self._pushing.end(link)

    def _push(self, strands: Sequence[Strand]) -> None:
        """Press the buttons that have stopped hands."""
        for strand in strands:
            if (
                strand.blocked_by in self._bodies.poses
                and strand.touch is not None
                and strand.touch.link in self._hands
            ):
                self._controls.pushed(strand.blocked_by, strand.touch, self._bodies.poses[strand.blocked_by])

    def _slip(self, robot: Robot) -> None:
        """Release leaves that a hand has slipped off, and drop what slips out of one of several hands."""
        for leaf, link in self.led().items():
            if self._leaves.strayed(leaf, robot.link_pose(link)):
                self.let_go(leaf)
        for name in [name for name, held in self.held.items() if held.needs > 1]:
            for link, offset in self.held[name].links.items():
                there, here = self._bodies.poses[name], robot.link_pose(link) @ offset
                strayed = here.distance(there) > STRAYED or here.turn(there) > TWISTED
                if strayed or name not in self._contacts.between(link):
                    self.release(name)
                    break

    def _open(self, robot: Robot, moving: Sequence[Playback]) -> None:
        """Release what a hand holds once its fingers have moved off it."""
        fingers = [one.query.links for playback in moving for one in playback.strands if one.query.grip]
        moved = frozenset[int]().union(*(links for links in fingers if links is not None))
        holding = (*self.led().values(), *(link for name in self.held for link in self.holders(name)))
        for link in dict.fromkeys(holding) if moved else ():
            if moved & robot.hand_of(link) and not self._contacts.between(link):
                self.loosen(link)

    def start(self, group: str, trajectory: Trajectory, *, pushes: str | None = None) -> None:
        """Start a motion. A joint obeys the newest motion: other groups that move one of these joints are halted.

        In a trajectory of finger joints alone, each finger continues until it touches something. ``pushes`` names a
        link whose hand pushes movable things in its way. Raises ``ValueError`` for unknown joints, wrong shapes, values
        outside the limits, or a first row elsewhere.
        """
        new = begin(self.robot, self._find, self._now, trajectory)
        for other, playback in self._motions.items():
            if other != group and set(playback.names) & set(trajectory.names):
                self.halt(other)
        self._motions[group] = new
        self._stop_pushing(group)
        if pushes is not None:
            self._pushes[group] = pushes
            self._pushing.begin(pushes)

    def motion(self, group: str) -> Motion:
        """State of the group's last motion; DONE for a group that has never moved."""
        return self._motions[group].state() if group in self._motions else Motion(MotionState.DONE)

    def obstacle(self, group: str) -> str | None:
        """Name the body, or the link of the robot itself, that has blocked the group's last motion; None without one.

        The robot learns where it was touched, not by what.
        """
        strands = self._motions[group].strands if group in self._motions else ()
        return next((strand.blocked_by for strand in strands if strand.blocked_by is not None), None)

    def halt(self, group: str) -> None:
        """Stop a group where it is; no effect if it is not moving."""
        if group in self._motions and self._motions[group].state().state is MotionState.MOVING:
            self._motions[group].halted = True
        self._stop_pushing(group)

    def set_configuration(self, configuration: Configuration) -> None:
        """Place the robot, with what it holds; joints not named keep their values. Motions in progress are halted."""
        super().set_configuration(configuration)
        if self._robot is not None:
            self._contacts.part()
        for group in self._motions:
            self.halt(group)

    # Grippers

    def grip(self, link: str) -> None:
        """Attach whatever is between the fingers of the hand at a link, whatever the robot believes it to be."""
        self._here()
        for name in self._contacts.between(link):
            leaf = self._leaves.leaf_of(name)
            if leaf is not None:
                self.lead(link, leaf)
            elif self._bodies.bodies[name].graspable:
                self.attach(link, name)

    def loosen(self, link: str) -> None:
        """Release what the hand at a link holds, and what the remaining hands are too few to hold."""
        for leaf in [leaf for leaf, leader in self.led().items() if leader == link]:
            self.let_go(leaf)
        for name in [name for name in self.held if link in self.holders(name)]:
            held = self.held[name]
            links = {other: offset for other, offset in held.links.items() if other != link}
            if len(links) < held.needs:
                self.release(name)
                continue
            held.link, held.offset = next(iter(links.items()))
            del links[held.link]
            held.others, held.hand, held.placed = links, frozenset().union(*map(self.robot.hand_of, held.links)), None

    def feels(self, link: str) -> bool:
        """Check whether the hand at a link holds an object or a leaf."""
        return link in self.led().values() or any(link in self.holders(name) for name in self.held)

    def pulled(self, link: str) -> bool:
        """Check whether a person has hold of the object in the hand at a link."""
        return any(link in self.holders(name) and self.taken(name) is not None for name in self.held)

    def release(self, name: str) -> None:
        """Release a body: it falls unless a person has taken it. ``KeyError`` if it is not held."""
        riders = self.riders(name)
        super().release(name)
        if self._people.holder(name) is None:
            self.gravity.begin(name, riders)

    # Changes of things: implements planlang.changes.Physics

    def bring_about(self, change: Change, since: Simulated | None = None) -> bool:
        """Let a declared effect come true, as far as it has not happened by physics ``since`` an earlier moment.

        Return False if nothing was left to do.
        """
        left = change if since is None else self.simulated.left_of(change, since)
        if left is not None:
            self.enact(apply(left, self.world_state(), self.queries)[0])
        return left is not None

    def is_free(self, name: str) -> bool:
        """Check whether nothing has or had a name."""
        return is_free(self.world_state(), name, self.queries)

    def world_state(self, robot: str = ROBOT) -> WorldState:
        """The present state as a value, in which the robot has a name; held bodies are where they are now."""
        state = super().world_state(robot)
        self._placed = state.poses
        return state

    def enact(self, state: WorldState) -> PyBulletWorld:
        """Bring things to a state to which changes, flow or heat have led from the present one."""
        if state.poses is not self._placed:
            self.arrange(state)
            self._placed = state.poses
        self.matter, self.changed = state.matter, state.changes
        return self

    # Ground truth: implements sim.truth.Truth

    def contents(self, name: str) -> Mapping[str, float]:
        """Class of substance -> amount of it in a body [ml]."""
        return {one.type: one.amount for one in self.matter.contents.get(name, {}).values()}

    def condition(self, name: str) -> str | None:
        """State of a body, such as on or clean; None if it has none."""
        return self.matter.states.get(name)

    def _switch(self, device: str, state: str) -> None:
        """Switch a device by hand, which is no change by an action's effects."""
        switched = self.simulated.switched
        self.simulated = replace(self.simulated, switched={**switched, device: switched.get(device, 0) + 1})
        self.matter = self.matter.switched(device, state)

    def falling(self, name: str) -> bool:
        """Check whether a body is falling."""
        return name in self.gravity.on_the_way

    def taken(self, name: str) -> str | None:
        """Name the person who has taken a body, if any."""
        return self._people.holder(name)

    def hand(self, name: str, side: str = "right") -> tuple[float, float, float]:
        """Locate a person's palm in the map."""
        x, y, z = self._people.hand(name, 0 if side == "right" else 1).tolist()
        return (x, y, z)

    def touches(self, links: Collection[str]) -> tuple[Touch, ...]:
        """List the places where links are touched."""
        self._here()
        return self._contacts.touches(links)

    def detect(self, camera_link: str) -> tuple[Detection, ...]:
        """List what the camera at a link recognises in its picture, sorted by class and pose; devices by their state.

        A device shows its state by a lamp or display that is visible wherever the device is.
        """
        return tuple(sorted(self.shown(camera_link).values(), key=order))

    def shown(self, camera_link: str) -> dict[str, Detection]:
        """Body -> what the camera at a link recognises of it, in one picture: which body it is no robot knows."""
        self._here()
        optics, eye = self._optics(), self.robot.link_pose(camera_link)
        found = self._camera.detect(optics, eye)
        shown = {name: replace(one, state=self._controls.shown(name)) for name, one in found.items()}
        return shown if optics.noise.is_exact else self._erring.told(shown, eye)

    def scan(self, camera_link: str) -> tuple[Array, NDArray[np.bool_]]:
        """Trace lines through the camera's pixels: ends (n, 3) in the map, and whether each is on a surface, (n,)."""
        self._here()
        return self._camera.scan(self._optics(), self.robot.link_pose(camera_link))
