"""World state: poses of bodies, joints of doors and drawers, the robot, and what its hands hold."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import field, replace
from typing import ClassVar, NamedTuple

from planlang.geometry import Pose
from planlang.protocols import Configuration
from planlang.records import dataclass
from planlang.state.matter import Matter


class Hold(NamedTuple):
    """Hold of one hand on an object."""

    arm: str
    link: str
    offset: Pose
    """Pose of the object in the link's frame."""


@dataclass(frozen=True, slots=True)
class Grip:
    """Grip of one or more hands on an object; the first hand's hold is ``arm``, ``link`` and ``offset``."""

    arm: str
    link: str
    offset: Pose
    """Pose of the object in the link's frame."""
    before: Pose
    """Pose of the object in the map when it was grasped, to which relative locations refer until it is released."""
    others: tuple[Hold, ...] = ()
    """Holds of further hands."""
    riders: tuple[str, ...] = ()
    """Objects that stand on it and move with it."""

    @property
    def hands(self) -> tuple[Hold, ...]:
        """Holds of all hands."""
        return (Hold(self.arm, self.link, self.offset), *self.others)

    @property
    def arms(self) -> tuple[str, ...]:
        """Arms of all hands."""
        return tuple(hand.arm for hand in self.hands)


@dataclass(frozen=True, slots=True)
class Made:
    """Thing that came to be after the start: its class, its extents along its own axes [m], and where it appeared."""

    type: str
    size: tuple[float, float, float]
    at: Pose
    """Pose of its box centre in the map at first, before it came to rest."""
    capacity: ClassVar[float] = 0.0
    """Nothing is poured into it: what joins it becomes a part of it [ml]."""

    @property
    def is_round(self) -> bool:
        """Check whether it is an upright cylinder rather than a box."""
        return math.isclose(self.size[0], self.size[1])


@dataclass(frozen=True, slots=True, eq=False)
class WorldState:
    """What is where, at one moment or in one hypothesis. Immutable: the object itself is the version.

    Its mappings are never changed either, so that two states share those in which they do not differ, and caches may
    use them as keys: the same object is equal at once, an equal one made anew after a comparison.
    """

    robots: Mapping[str, Configuration]
    """Robot -> its configuration."""
    poses: Mapping[str, Pose]
    """Body -> pose of its box centre in the map; of a held one, where it stood before."""
    joints: Mapping[str, float] = field(default_factory=dict)
    """Leaf -> position of its joint [rad, m]; 0 is closed."""
    held: Mapping[str, Grip] = field(default_factory=dict)
    """Held object -> grip, in the order of grasping."""
    led: Mapping[str, str] = field(default_factory=dict)
    """Leaf -> link of the hand that moves it."""
    touched: Mapping[str, frozenset[str]] = field(default_factory=dict)
    """Carried object -> bodies that it has touched without interruption since it was grasped, as far as computed."""
    matter: Matter = field(default_factory=Matter)
    """What things hold, and how they are."""
    away: frozenset[str] = frozenset()
    """Bodies with a pose that are not in the room: in a person's hands, or in reserve."""
    made: Mapping[str, Made] = field(default_factory=dict)
    """Things that came to be, in order, with those that are gone again."""
    changes: int = 0
    """Number of changes that actions have made; those that time brings are not counted."""

    def with_robot(self, name: str, configuration: Configuration) -> WorldState:
        """Make the state in which a robot has another configuration."""
        return replace(self, robots={**self.robots, name: configuration})

    def placed(self, poses: Mapping[str, Pose | None]) -> WorldState:
        """Make the state in which bodies are at other poses, or (None) absent."""
        there = dict(self.poses)
        for name, pose in poses.items():
            if pose is None:
                there.pop(name, None)
            else:
                there[name] = pose
        return replace(self, poses=there)

    def there(self, name: str) -> bool:
        """Check whether a body is in the room."""
        return name in self.poses and name not in self.away

    def gripped(self, name: str, hand: Hold) -> WorldState:
        """Make the state in which a hand holds an object, in addition to others that hold it already."""
        grip = self.held.get(name)
        if grip is None or hand.arm in grip.arms:
            grip = Grip(*hand, self.poses[name])
        else:
            grip = replace(grip, others=(*grip.others, hand))
        return replace(self, held={**self.held, name: grip}, away=self.away - {name})

    def gripping(self, held: Mapping[str, Hold]) -> WorldState:
        """Make the state in which hands hold objects besides, each by one hand."""
        state = self
        for name, hand in held.items():
            state = state.gripped(name, hand)
        return state

    def carried(self) -> frozenset[str]:
        """Collect the held objects and those that stand on them."""
        return frozenset(self.held).union(*(grip.riders for grip in self.held.values()))
