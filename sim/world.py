"""The true world in PyBullet: it is commanded and sensed like a robot's real environment, and time goes on in steps."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from planlang.geometry import Array
from planlang.protocols import Configuration, Contact, Detection, Motion, MotionState, Touch, Trajectory
from planlang.records import dataclass
from sim.contact import Query
from sim.controls import Controls
from sim.kinematic import KinematicScene
from sim.outlook import Outlook
from sim.processes import Processes
from sim.pushing import Pushing
from sim.robot import BASE, Robot
from sim.scene import RobotBody, Scene

DEEPER = 0.003
"""A contact that was there before the motion blocks it once it is deeper by more than this [m]."""

_JUMP = 0.05
"""Distance of a trajectory's first row from the robot [m, rad] beyond which it was planned for another place."""
_LIMIT = 1e-3
"""Tolerance of rows beyond a joint's limits [m, rad]: timing rounds, PyBullet reads limits as floats."""
Find = Callable[[Configuration, Query], tuple[Contact, ...]]
Feel = Callable[[Contact], Touch | None]


@dataclass(slots=True)
class Playback:
    """A motion under way: row ``row`` of the trajectory was reached, ``strands`` move on independently.

    An arm is one strand; each finger is a strand of its own, so that one which touches waits for the others.
    """

    trajectory: Trajectory
    strands: list[Strand]
    row: int = 0
    halted: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of the joints and bodies that the motion moves."""
        return self.trajectory.names

    def state(self) -> Motion:
        """See :class:`planlang.protocols.Motion`."""
        blocked = next((strand for strand in self.strands if strand.blocked_by), None)
        if self.halted:
            return Motion(MotionState.HALTED)
        over = self.row + 1 >= len(self.trajectory.positions)
        if blocked and (over or all(strand.blocked_by for strand in self.strands)):
            return Motion(MotionState.BLOCKED, blocked.blocked_by, blocked.touch)
        return Motion(MotionState.DONE) if over else Motion(MotionState.MOVING)


@dataclass(slots=True)
class Strand:
    """Columns of a trajectory that stop together, and the contacts there were when it began."""

    columns: list[int]
    query: Query
    before: dict[tuple[str, str], float]
    blocked_by: str | None = None
    touch: Touch | None = None


def begin(robot: Robot, find: Find, now: Configuration, trajectory: Trajectory) -> Playback:
    """Check a trajectory against the robot and where it is, and get ready to play it.

    Raises ``ValueError``: an unknown joint, a wrong shape, a number that is none, a row outside the joint limits, or a
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
    """Return the value of a joint or of x, y, yaw."""
    return configuration.base[BASE.index(name)] if name in BASE else configuration.joints[name]


def moved(configuration: Configuration, names: Sequence[str], values: Array) -> Configuration:
    """Return the configuration with some coordinates changed."""
    base, joints = list(configuration.base), dict(configuration.joints)
    for name, value in zip(names, values.tolist(), strict=True):
        if name in BASE:
            base[BASE.index(name)] = value
        else:
            joints[name] = value
    return Configuration((base[0], base[1], base[2]), joints)


def advance(playback: Playback, find: Find, feel: Feel, now: Configuration) -> Configuration:
    """Advance by one row; return the robot's configuration then: ``now`` where the way is blocked.

    ``feel`` returns what is felt of a contact that was found last.
    """
    playback.row += 1
    row = np.asarray(playback.trajectory.positions, dtype=float)[playback.row]
    for strand in playback.strands:
        if strand.blocked_by is not None:
            continue
        following = moved(now, [playback.names[k] for k in strand.columns], row[strand.columns])
        contacts = find(following, strand.query)
        obstacle = _obstacle(contacts, strand.before)
        if obstacle is not None:
            strand.blocked_by, strand.touch = obstacle.body, feel(obstacle)
        else:
            current = {(contact.part, contact.body) for contact in contacts}
            strand.before = {pair: depth for pair, depth in strand.before.items() if pair in current}
            now = following
    return now


def _obstacle(contacts: Sequence[Contact], before: Mapping[tuple[str, str], float]) -> Contact | None:
    for contact in contacts:
        known = before.get((contact.part, contact.body))
        if known is None or contact.depth > known + DEEPER:
            return contact
    return None


STRAYED, TWISTED = 0.01, 0.1
"""What several hands hold slips off when one is farther [m, rad] from where it took it than this."""


class PyBulletWorld(KinematicScene):
    """Implements :class:`planlang.protocols.RobotInterface` for the robot, and :class:`sim.truth.Truth` for all else.

    Motions are played back (:class:`Playback`): a step that would make the robot touch something is taken back.
    """

    def __init__(
        self, scene: Scene, robot: RobotBody | None = None, *, gui: bool = False, rate: int = 30, seed: int = 0
    ) -> None:
        """Initialize as every scene; ``seed`` is kept for records: nothing in here is random."""
        super().__init__(scene, robot, gui=gui, rate=rate)
        self.seed, self.steps = seed, 0
        self._pushes: dict[str, str] = {}
        """Group whose motion pushes -> the link of the hand with which it does."""
        self._processes = Processes(self.changes)
        self._motions: dict[str, Playback] = {}
        self._controls = Controls(scene.controls, self._matter)
        hands = {} if robot is None else robot.hands
        self._hands = frozenset((*hands, *(link for fingers in hands.values() for link in fingers)))
        if self._robot is not None:
            self._pushing = Pushing(self._bodies, self._leaves, self._contacts, self.changes)
            self._outlook = Outlook(self._contacts, self._here)

    # Time and motions

    def step(self) -> None:
        """Advance by one step: motions in the order of their groups' first start, then people, then what falls."""
        moving = [playback for playback in self._motions.values() if playback.state().state is MotionState.MOVING]
        for playback in moving:
            free = [strand for strand in playback.strands if strand.blocked_by is None]
            find = self._met if len(moving) > 1 else partial(self._met_alone, playback)
            self._now = advance(playback, find, self._contacts.felt, self._now)
            self._push(free)
        for group in [one for one in self._pushes if self.motion(one).state is not MotionState.MOVING]:
            self._stop_pushing(group)
        if self._robot is not None and (self._held or self._leaves.led):
            self._here()
            self._contacts.part()
            self._slip(self._robot)
            self._open(self._robot, moving)
        self._people.step({name: self._bodies.poses[name] for name, held in self._held.items() if held.on is None})
        self._falling.step()
        self._controls.turned(self._leaves.values, self._leaves.joints)
        self._processes.step(1 / self.rate)
        self.steps += 1

    def _met(self, configuration: Configuration, query: Query) -> tuple[Contact, ...]:
        """Return the contacts at a configuration, once what hands push has given way."""
        return self._pushing.contacts_after(lambda: self._find(configuration, query))

    def _met_alone(self, playback: Playback, configuration: Configuration, query: Query) -> tuple[Contact, ...]:
        """Return the same for the only motion: what may touch in its next steps is mostly known, and mostly nothing."""
        is_simple = len(playback.strands) == 1 and not playback.strands[0].before and not query.grip
        if is_simple and not self._leaves.led and not self._pushing.hands:
            rows = np.asarray(playback.trajectory.positions, dtype=float)
            among = self._outlook.among(playback, playback.names, rows, playback.row, query)
            if among is not None and not self._find(configuration, replace(query, among=among)):
                return ()
        return self._met(configuration, query)

    def _stop_pushing(self, group: str) -> None:
        """Let the hand that a group's motion pushed with be stopped by what it meets again."""
        if (link := self._pushes.pop(group, None)) is not None:
            self._pushing.end(link)

    def _push(self, moved: Sequence[Strand]) -> None:
        """Let hands push the buttons that stop them."""
        for strand in moved:
            if (
                strand.blocked_by in self._bodies.poses
                and strand.touch is not None
                and strand.touch.link in self._hands
            ):
                self._controls.pushed(strand.blocked_by, strand.touch, self._bodies.poses[strand.blocked_by])

    def _slip(self, robot: Robot) -> None:
        """Let leaves stay behind from which a hand has slipped off, and what slips out of one of its hands fall."""
        for leaf, link in self.led().items():
            if self._leaves.strayed(leaf, robot.link_pose(link)):
                self.let_go(leaf)
        for name in [name for name, held in self._held.items() if held.needs > 1]:
            for link, offset in self._held[name].links.items():
                there, here = self._bodies.poses[name], robot.link_pose(link) @ offset
                strayed = here.distance(there) > STRAYED or here.turn(there) > TWISTED
                if strayed or name not in self._contacts.between(link):
                    self.release(name)
                    break

    def _open(self, robot: Robot, moving: Sequence[Playback]) -> None:
        """Let hands hold nothing any more the fingers of which have moved off it."""
        fingers = [one.query.links for playback in moving for one in playback.strands if one.query.grip]
        moved = frozenset[int]().union(*(links for links in fingers if links is not None))
        holding = (*self.led().values(), *(link for name in self._held for link in self.holders(name)))
        for link in dict.fromkeys(holding) if moved else ():
            if moved & robot.hand_of(link) and not self._contacts.between(link):
                self.loosen(link)

    def start(self, group: str, trajectory: Trajectory, *, pushes: str | None = None) -> None:
        """Begin a motion. A joint obeys the newest motion: another group that moves one of these joints is halted.

        A trajectory that moves finger joints alone lets each finger go on until it touches something by itself.
        ``pushes`` is a link whose hand pushes meanwhile what it meets and can be moved. Raises ``ValueError`` for
        unknown joints, wrong shapes, values outside the limits, or a first row elsewhere.
        """
        begun = begin(self.robot, self._find, self._now, trajectory)
        for other, playback in self._motions.items():
            if other != group and set(playback.names) & set(trajectory.names):
                self.halt(other)
        self._motions[group] = begun
        self._stop_pushing(group)
        if pushes is not None:
            self._pushes[group] = pushes
            self._pushing.begin(pushes)

    def motion(self, group: str) -> Motion:
        """Return the state of the group's last motion; a group that has never moved is done."""
        return self._motions[group].state() if group in self._motions else Motion(MotionState.DONE)

    def halt(self, group: str) -> None:
        """Stop the group where it is; nothing happens when it does not move."""
        if group in self._motions and self._motions[group].state().state is MotionState.MOVING:
            self._motions[group].halted = True
        self._stop_pushing(group)

    def set_configuration(self, configuration: Configuration) -> None:
        """Put the robot, with what it holds, somewhere; joints not named stay. Motions under way are halted."""
        super().set_configuration(configuration)
        for group in self._motions:
            self.halt(group)

    # Grippers

    def grip(self, link: str) -> None:
        """Hold, or lead, what is between the fingers of the hand at a link, whatever the robot believes that to be."""
        self._here()
        for name in self._contacts.between(link):
            leaf = self._leaves.leaf_of(name)
            if leaf is not None:
                self.lead(link, leaf)
            elif self._bodies.bodies[name].graspable:
                self.attach(link, name)

    def loosen(self, link: str) -> None:
        """Let go what the hand at a link holds; what fewer hands still hold than it takes slips off them, too."""
        for leaf in [leaf for leaf, leader in self.led().items() if leader == link]:
            self.let_go(leaf)
        for name in [name for name in self._held if link in self.holders(name)]:
            held = self._held[name]
            links = {other: offset for other, offset in held.links.items() if other != link}
            if len(links) < held.needs:
                self.release(name)
                continue
            held.link, held.offset = next(iter(links.items()))
            del links[held.link]
            held.others, held.hand, held.placed = links, frozenset().union(*map(self.robot.hand_of, held.links)), None

    def feels(self, link: str) -> bool:
        """Return whether the hand at a link holds or leads something."""
        return link in self.led().values() or any(link in self.holders(name) for name in self._held)

    def pulled(self, link: str) -> bool:
        """Return whether a person has hold of what the hand at a link holds."""
        return any(link in self.holders(name) and self.taken(name) is not None for name in self._held)

    def release(self, name: str) -> None:
        """Let a body go: it sinks in free fall unless a person has taken it. ``KeyError`` when it is not held."""
        riders = self.riders(name)
        super().release(name)
        if self._people.holder(name) is None:
            self._falling.begin(name, riders)

    # What is so: implements sim.truth.Truth

    def contents(self, name: str) -> Mapping[str, float]:
        """Return class of substance -> amount of it in a body [ml]."""
        return {one.type: one.amount for one in self._matter.contents.get(name, {}).values()}

    def condition(self, name: str) -> str | None:
        """Return the state of a body, such as on or clean; None if it has none."""
        return self._matter.states.get(name)

    def falling(self, name: str) -> bool:
        """Return whether a body is on its way down."""
        return name in self._falling.on_the_way

    def taken(self, name: str) -> str | None:
        """Return the person who has taken a body, None if nobody has."""
        return self._people.holder(name)

    def hand(self, name: str, side: str = "right") -> tuple[float, float, float]:
        """Return where a person's palm is, in the map."""
        x, y, z = self._people.hand(name, 0 if side == "right" else 1).tolist()
        return (x, y, z)

    def touches(self, links: Collection[str]) -> tuple[Touch, ...]:
        """Return where links are touched."""
        self._here()
        return self._contacts.touches(links)

    def detect(self, camera_link: str) -> tuple[Detection, ...]:
        """Return what the camera at a link sees in its picture, in the order of the scene."""
        self._here()
        return self._camera.detect(self._optics(), self.robot.link_pose(camera_link))

    def scan(self, camera_link: str) -> tuple[Array, NDArray[np.bool_]]:
        """Return where lines through the camera's pixels end (n, 3) in the map, and whether at a surface, (n,)."""
        self._here()
        return self._camera.scan(self._optics(), self.robot.link_pose(camera_link))

    def state(self) -> tuple[object, ...]:
        """Return something hashable, equal for worlds where everything is in the same pose and motion."""
        motions = tuple((group, playback.row, playback.state()) for group, playback in self._motions.items())
        *things, people = super().state()
        return (self.steps, *things, motions, people)
