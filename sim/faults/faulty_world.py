"""The true world of a run with faults: what faults do to it, and what they ask of it."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from itertools import combinations

import numpy as np

from planlang.geometry import Array, Pose
from planlang.geometry.matrices import moved
from planlang.protocols import Configuration, MotionState, Trajectory
from planlang.records import dataclass
from sim.joints import Articulation
from sim.people import People, Person
from sim.scene import Body, RobotBody, Scene
from sim.world import PyBulletWorld

_CLEAR = 0.005
"""Distance of a thing from all but its support where somebody puts it [m]."""
_LEVEL = 0.01
"""Difference of heights at which a thing stands on the same surface [m]."""

Heeds = Callable[[str, str], bool]


def _always(one: str, other: str) -> bool:
    return True


def _nothing() -> None:
    pass


@dataclass(frozen=True, slots=True)
class JammedJoint(Articulation):
    """A joint that moves within a part of its range only."""

    between: tuple[float, float] = (0.0, 0.0)

    def within(self, value: float) -> float:
        """Clamp a value to the part of the range."""
        least, most = self.between
        return min(max(value, least), most)


class HeedingPeople(People):
    """People who may not heed what is offered to them."""

    heeds: Heeds = staticmethod(_always)

    def _offer(self, name: str, person: Person, held: Mapping[str, Pose]) -> tuple[int, str] | None:
        offered = super()._offer(name, person, held)
        return offered if offered is not None and self.heeds(name, offered[1]) else None


class FaultyWorld(PyBulletWorld):
    """A true world in which things go wrong, as an :class:`~sim.faults.injection.Injection` decides."""

    _switches: Heeds = staticmethod(_always)
    _people: HeedingPeople

    def __init__(self, scene: Scene, robot: RobotBody | None, *, gui: bool = False, seed: int = 0) -> None:
        """Nothing goes wrong before somebody is asked."""
        super().__init__(scene, robot, gui=gui, seed=seed)
        self._go_on: Callable[[], None] = _nothing
        self._people = HeedingPeople(self._bodies, self.rate)

    def then(self, go_on: Callable[[], None]) -> None:
        """Call a function at the end of each step."""
        self._go_on = go_on

    def step(self) -> None:
        """Advance by one step, in which things may go wrong."""
        super().step()
        self._go_on()

    def heed(self, *, switches: Heeds, heeds: Heeds) -> None:
        """Ask whether a device switches to a state, and whether a person heeds a thing that is offered."""
        self._switches = switches
        self._people.heeds = heeds

    def _switch(self, device: str, state: str) -> None:
        if self._switches(device, state):
            super()._switch(device, state)

    # Things

    def add(self, body: Body) -> None:
        """Let a body appear."""
        self._create(body)

    def could_stand(self, name: str, pose: Pose, out_of: str | None = None) -> bool:
        """Check whether a body could stand at a pose on what it stands on now, clear of all else.

        ``out_of`` is the link of a hand between whose fingers it must not be. Of a body that a hand still holds, it is
        not asked whether the robot leaves room for it: the hand goes on.
        """
        before, support = self.pose(name), self.support(name)
        if support is None:
            return False
        self._bodies.place(name, pose)
        try:
            rest, below = self.gravity.rest(name)
            is_level = below == support and abs(rest.position[2] - pose.position[2]) <= _LEVEL
            is_free = is_level and not self._near(name, {support}) and (name in self.held or self.is_clear(name))
            return is_free and (out_of is None or not self._is_between(name, out_of))
        finally:
            self._bodies.place(name, before)

    def _near(self, name: str, but: Collection[str]) -> set[str]:
        return {one for one in self._contacts.touching(name, _CLEAR) if one not in but}

    def has_room(self, pose: Pose, size: Sequence[float], distance: float) -> bool:
        """Check whether a box of some extents [m] has room at an unturned pose, at a distance [m] from the robot."""
        lower, upper = np.array(pose.position) - np.array(size) / 2, np.array(pose.position) + np.array(size) / 2
        self._here()
        low, high = self.robot.boxes()
        is_robot = ((low <= upper + distance) & (high >= lower - distance)).all(axis=1).any()
        return not is_robot and not len(self._bodies.within(lower, upper))

    # Hands

    def hand_moved_by(self, joints: Collection[str]) -> str | None:
        """Find the link of the hand whose fingers some joints move."""
        numbers = frozenset[int]().union(*map(self.robot.moved_by, joints))
        return next((link for link in self.robot.body.hands if numbers & frozenset(self._fingers(link))), None)

    def hand_at(self, link: str) -> str:
        """Find the link by which the hand at a link goes here: several links may be of one hand."""
        hand = self.robot.hand_of(link)
        return next((one for one in self.robot.body.hands if self.robot.hand_of(one) == hand), link)

    def _fingers(self, link: str) -> list[int]:
        return sorted(self.robot.number[one] for one in self.robot.body.hands[link] if one in self.robot.number)

    def opens(self, link: str, trajectory: Trajectory) -> bool:
        """Check whether a motion takes the fingers of a hand away from each other."""
        return self._spread(link, trajectory, -1) > self._spread(link, trajectory, 0)

    def _spread(self, link: str, trajectory: Trajectory, row: int) -> float:
        """Sum the distances of fingers from each other, and from the grip point, in a row of a motion [m]."""
        values = np.asarray(trajectory.positions, dtype=float)[row].tolist()
        there = Configuration(self._now.base, {**self._now.joints, **dict(zip(trajectory.names, values, strict=True))})
        self._show(there)
        lower, upper = self.robot.boxes_of(self._fingers(link))
        points = [*(lower + upper) / 2, np.array(self.robot.link_pose(link).position)]
        self._here()
        return float(sum(np.linalg.norm(one - other) for one, other in combinations(points, 2)))

    def within_fingers(self, link: str) -> str | None:
        """Find the thing that the fingers of a hand are about to close on."""
        self._here()
        found = []
        for name in self.names():
            if not self.scene.body(name).graspable or name in self.held or self.taken(name) is not None:
                continue
            if self._is_between(name, link):
                (least, most), (low, high) = self._bodies.box_of(name), self._around_fingers(link)
                found.append((float(np.linalg.norm(least + most - low - high)), name))
        return min(found)[1] if found else None

    def _is_between(self, name: str, link: str) -> bool:
        """Check whether a body is where the fingers of a hand are, or between them."""
        (least, most), (low, high) = self._bodies.box_of(name), self._around_fingers(link)
        return bool(((least <= high) & (low <= most)).all())

    def _around_fingers(self, link: str) -> tuple[Array, Array]:
        lower, upper = self.robot.boxes_of(self._fingers(link))
        return lower.min(axis=0), upper.max(axis=0)

    def moving(self, link: str) -> tuple[str, ...]:
        """List the groups whose motions move a hand as a whole now."""
        hand = self.robot.hand_of(link)
        moving = [(group, one) for group, one in self._motions.items() if one.state().state is MotionState.MOVING]
        queries = [(group, strand.query) for group, one in moving for strand in one.strands]
        return tuple(
            group for group, query in queries if not query.grip and (query.links is None or bool(query.links & hand))
        )

    # Doors and drawers

    def leaf(self, name: str) -> Articulation:
        """Look up the joint of a leaf."""
        return self._leaves.joints[name]

    def jam(self, leaf: str, between: tuple[float, float] | None) -> None:
        """Let a leaf move between two values of its joint only; None: in all of its range again."""
        joint = next(one for one in self.scene.joints if one.leaf == leaf)
        if between is not None:
            least, most = (min(max(one, joint.lower), joint.upper) for one in between)
            fields = {one: getattr(joint, one) for one in Articulation.__slots__}
            joint = JammedJoint(**fields, between=(least, most))
        self._leaves.joints[leaf] = joint

    def strain(self, leaf: str) -> float:
        """Distance of the hand that moves a leaf from where the handle is [m]."""
        self._here()
        led = self._leaves.led[leaf]
        handle = moved(self.leaf(leaf).motion(self._leaves.values[leaf]).matrix(), led.closed)
        return float(np.linalg.norm(handle - moved(self.robot.link_pose(led.link).matrix(), led.grip)))
