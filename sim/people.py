"""The people of a world: each step they look at what the robot holds, and reach for it when it is offered."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from planlang.geometry import Array, Pose
from planlang.geometry.matrices import moved
from sim.bodies import Bodies
from sim.person import TAKING_DISTANCE, TAKING_TIME, Person, Reach, arm_parts, reach_from, taking_point

_REST = 8
"""Steps for which an object must have been at rest before it counts as offered."""
_LOST = 0.1
"""A person who has taken something lets go when the robot moves it by more than this [m]."""


class People:
    """All persons of a scene; the world tells them what the robot holds and asks them what they have taken."""

    def __init__(self, bodies: Bodies, rate: int) -> None:
        self.bodies, self.rate = bodies, rate
        self.persons = {name: Person.of(b) for name, b in bodies.bodies.items() if b.shape == "person"}
        self.still: dict[str, tuple[Pose, int]] = {}
        """Thing in the robot's hand -> where it is, and for how many steps it has been at rest there."""
        self._reach: dict[str, tuple[Pose, Reach]] = {}

    def reach(self, name: str) -> Reach:
        """What a person reaches now; ``KeyError`` when that is no person."""
        if name not in self.persons:
            raise KeyError(f"{name!r} is no person; the persons are {', '.join(self.persons) or 'none'}")
        pose = self.bodies.poses[name]
        if name not in self._reach or self._reach[name][0] != pose:
            self._reach[name] = (pose, reach_from(self.persons[name].figure, pose))
        return self._reach[name][1]

    def hand(self, name: str, k: int) -> Array:
        """Position of a palm (0 right, 1 left) in the map."""
        return moved(self.bodies.poses[name].matrix(), self.persons[name].hands[k])

    def holder(self, name: str) -> str | None:
        """The person who has taken a body."""
        return next((person for person, state in self.persons.items() if name in state.holds), None)

    def lose(self, name: str) -> None:
        """Nobody holds the body any more."""
        for person in self.persons.values():
            person.holds.pop(name, None)

    def step(self, held: Mapping[str, Pose]) -> None:
        """One step of everybody; ``held`` are the objects in the robot's hands and where they are."""
        if not self.persons:
            return
        self._watch(held)
        for name, person in self.persons.items():
            for taken, (_, pose) in list(person.holds.items()):
                if taken in held and held[taken].distance(pose) > _LOST:
                    del person.holds[taken]
            if name not in self.bodies.removed:
                self._step(name, person, held)

    def _watch(self, held: Mapping[str, Pose]) -> None:
        for name, pose in held.items():
            before, count = self.still.get(name, (pose, 0))
            self.still[name] = (pose, count + 1 if before.distance(pose) < 1e-3 else 0)
        for name in [name for name in self.still if name not in held]:
            del self.still[name]

    def _step(self, name: str, person: Person, held: Mapping[str, Pose]) -> None:
        target = self._offer(name, person, held)
        person.reaching = target
        stirred = [False, False]
        if target is None:
            person.close = 0
            for k in (0, 1):
                if person.free(k):
                    stirred[k] = person.move_hand(k, person.figure.hands[k], self.rate)
        else:
            k, thing = target
            size = self.bodies.bodies[thing].size
            goal = taking_point(held[thing], size, self.reach(name).shoulders[k])
            inverse = self.bodies.poses[name].inverse().matrix()
            stirred[k] = person.move_hand(k, moved(inverse, goal), self.rate)
        if any(stirred):
            self.place_arms(name, [k for k in (0, 1) if stirred[k]])
        if target is not None:
            self._take(name, person, target, held)

    def _take(self, name: str, person: Person, target: tuple[int, str], held: Mapping[str, Pose]) -> None:
        k, thing = target
        palm = [self._limbs(name)[3 * k + 2]]
        near = self.bodies.gap(palm, self.bodies.of[thing], TAKING_DISTANCE) <= TAKING_DISTANCE
        person.close = person.close + 1 if near else 0
        if person.close >= round(TAKING_TIME * self.rate):
            person.holds[thing] = (k, held[thing])
            person.reaching, person.close = None, 0

    def _offer(self, name: str, person: Person, held: Mapping[str, Pose]) -> tuple[int, str] | None:
        """The arm and the object to reach for: at rest, in the comfort zone, not yet taken by anybody."""
        reach = self.reach(name)
        for thing, pose in held.items():
            if self.still[thing][1] < _REST or self.holder(thing):
                continue
            k = reach.arm_for(pose.position)
            if k is None:
                continue
            if person.reaching is not None and person.reaching[1] == thing:
                k = person.reaching[0]
            if person.free(k):
                return k, thing
        return None

    def _limbs(self, name: str) -> list[int]:
        return [index for index in self.bodies.of[name] if self.bodies.pieces[index].part.limb]

    def place_arms(self, name: str, arms: Iterable[int]) -> None:
        """Put arms where their hands are."""
        person, limbs = self.persons[name], self._limbs(name)
        for k in arms:
            parts = arm_parts(person.figure, k, person.hands[k])
            for index, part in zip(limbs[3 * k : 3 * k + 3], parts, strict=True):
                self.bodies.place_part(index, part.offset)

    def state(self) -> tuple[object, ...]:
        """Hashable: where all hands are and what they hold."""
        return tuple(
            (name, *(tuple(np.asarray(hand).tolist()) for hand in person.hands), tuple(person.holds))
            for name, person in self.persons.items()
        )
