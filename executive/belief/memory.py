"""What the robot remembers beside the believed state: where each fact of that comes from, and what it was told."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import field, replace

from executive.belief.knowledge import Knowledge, Source
from executive.belief.recognition import Recognition
from executive.maps.classes import MapObject
from planlang.designators import Object
from planlang.geometry import Pose
from planlang.records import dataclass
from planlang.state import Grip
from planlang.state.matter import without

MOST_FAILURES = 2
"""Failures in a row of a hand's fingers after which another hand is used, if there is one: one may be an accident, and
plans repeat a step about three times."""
Base = tuple[float, float, float]
"""Pose of the base in the map (x [m], y [m], yaw [rad])."""


@dataclass(frozen=True, slots=True)
class Memory:
    """Where the facts of a believed state come from. Immutable, as the state is: what happens makes another one.

    Its tables are never changed either, so that hypotheses share them, and equal memories may serve as keys.
    """

    recognition: Recognition
    first: Mapping[str, Pose]
    """Thing -> its pose in the map, or where it was created."""
    unknown: Mapping[str, Pose] = field(default_factory=dict)
    """Objects whose place is unknown -> pose that the map states, or where they were looked for in vain."""
    known: Mapping[str, Knowledge] = field(default_factory=dict)
    """Object -> source and age of its pose, if that is not the map's."""
    moves: int = 0
    """Number of motions of the base so far."""
    time: float = 0.0
    """Plan time up to which heating has been simulated in the believed world [s]."""
    witnessed: frozenset[str] = frozenset()
    """Leaves and devices whose state the robot has seen or felt, or set itself, since it could have changed."""
    in_vain: Mapping[str, tuple[Base, ...]] = field(default_factory=dict)
    """Object -> base poses from which it was looked for and not seen, since it was last seen."""
    bound: Mapping[Object, str] = field(default_factory=dict)
    """Designator -> object that it stands for as long as that exists."""
    made: Mapping[str, MapObject] = field(default_factory=dict)
    """Objects created during the run, by name."""
    gone: tuple[str, ...] = ()
    """Destroyed objects."""
    met: str | None = None
    """Name of the obstacle that was touched last; None while there is none."""
    dropped: Mapping[str, str] = field(default_factory=dict)
    """Arm -> object that it lost and that has not been grasped since: it may stand between the fingers."""
    refused: Mapping[str, tuple[Pose, ...]] = field(default_factory=dict)
    """Object -> its poses in the tip frame that are ruled out as grips, because it could not be used with them."""
    failing: Mapping[str, int] = field(default_factory=dict)
    """Arm -> how often its fingers failed to reach their goal since it last grasped something."""

    @property
    def given_up(self) -> tuple[str, ...]:
        """Arms whose hands have failed so often that others are to be used."""
        return tuple(arm for arm, times in self.failing.items() if times >= MOST_FAILURES)

    def evidence(self) -> object:
        """Summarise what answers about places depend on, as a cache key: not when something became known.

        Nor what designators are bound to, as a question binds those that it names.
        """
        sources = {name: (known.source, known.moves == self.moves) for name, known in self.known.items()}
        return sources, self.in_vain, self.unknown, self.given_up

    def learned(self, names: Iterable[str], source: Source) -> Memory:
        """Know the poses of objects from a source, from now on."""
        return replace(self, known={**self.known, **dict.fromkeys(names, Knowledge(source, self.time, self.moves))})

    def saw(self, name: str) -> Memory:
        """Know the pose of an object from the camera."""
        return replace(self.learned((name,), Source.SEEN), in_vain=without(self.in_vain, name))

    def not_seen(self, name: str, base: Base) -> Memory:
        """Remember from where an object was looked for in vain."""
        return replace(self, in_vain={**self.in_vain, name: (*self.in_vain.get(name, ()), base)})

    def without_place(self, name: str) -> Memory:
        """Forget where an object was; its designators may be bound to others."""
        bound = {what: meant for what, meant in self.bound.items() if meant != name}
        return replace(self, known=without(self.known, name), bound=bound)

    def lost_sight(self, name: str, pose: Pose) -> Memory:
        """Remember that an object is not where it was believed to be."""
        forgotten = self.without_place(name)
        return replace(forgotten, unknown={**self.unknown, name: pose}, in_vain=without(self.in_vain, name))

    def found(self, name: str) -> Memory:
        """Remember that the place of an object is known again."""
        return replace(self, unknown=without(self.unknown, name))

    def destroyed(self, name: str) -> Memory:
        """Remember that an object exists no more."""
        return replace(self.without_place(name), gone=(*self.gone, name))

    def created(self, thing: MapObject, pose: Pose) -> Memory:
        """Remember a new object, and where it came to be."""
        return replace(self, made={**self.made, thing.name: thing}, first={**self.first, thing.name: pose})

    def witnesses(self, name: str) -> Memory:
        """Remember that the state of a leaf or device is as the robot itself has seen, felt or set it."""
        return self if name in self.witnessed else replace(self, witnessed=self.witnessed | {name})

    def doubts(self, name: str) -> Memory:
        """Remember that the state of a leaf or device may have changed."""
        return replace(self, witnessed=self.witnessed - {name})

    def bind(self, what: Object, name: str) -> Memory:
        """Let a designator stand for an object."""
        return replace(self, bound={**self.bound, what: name})

    def grasped(self, name: str, arm: str) -> Memory:
        """Forget what an arm had lost and how its hand failed, and that any arm had lost what it holds now."""
        left = {one: lost for one, lost in self.dropped.items() if one != arm and lost != name}
        return replace(self, dropped=left, failing=without(self.failing, arm))

    def dropping(self, name: str, arms: Collection[str]) -> Memory:
        """Remember which arms have lost an object."""
        return replace(self, dropped={**self.dropped, **dict.fromkeys(arms, name)})

    def refusing(self, name: str, grip: Grip) -> Memory:
        """Rule out a grip of an object."""
        offsets = (*self.refused.get(name, ()), *(hand.offset for hand in grip.hands))
        return replace(self, refused={**self.refused, name: offsets})

    def allowing(self, name: str) -> Memory:
        """Rule out no grip of an object any more."""
        return replace(self, refused=without(self.refused, name))
