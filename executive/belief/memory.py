"""What the robot remembers beside the believed state: where each fact of that comes from, and what it was told."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import field, replace
from enum import Enum
from typing import NamedTuple

from executive.belief.estimates import Estimate
from executive.maps.classes import MapObject
from planlang.designators import Object
from planlang.geometry import Pose
from planlang.ontology import Ontology
from planlang.records import dataclass
from planlang.state.matter import without

MOST_FAILURES = 2
"""Failures in a row of a hand's fingers after which another hand is used, if there is one: one may be an accident, and
plans repeat a step about three times."""
BasePose = tuple[float, float, float]
"""Pose of the base in the map (x [m], y [m], yaw [rad])."""


VISION, EXPLORATION = "vision", "exploration"


@dataclass(frozen=True, slots=True)
class Recognition:
    """State of the software components; a component runs until it is stopped."""

    ontology: Ontology = field(repr=False)
    classes: tuple[str, ...] | None = None
    """IRIs of the recognised classes; None for all."""
    stopped: tuple[str, ...] = ()
    """Components that were stopped, in that order."""

    def running(self, part: str) -> Recognition:
        """Make the state in which a component runs."""
        return replace(self, stopped=tuple(one for one in self.stopped if one != part))

    def without(self, part: str) -> Recognition:
        """Make the state in which a component is stopped."""
        return replace(self, stopped=(*self.running(part).stopped, part))

    def runs(self, part: str) -> bool:
        """Check whether a component runs."""
        return part not in self.stopped

    def with_models(self, classes: Iterable[str]) -> Recognition:
        """Make the state in which models of further classes (IRIs) have been loaded."""
        return self if self.classes is None else replace(self, classes=tuple(dict.fromkeys((*self.classes, *classes))))

    def recognises(self, thing: MapObject) -> bool:
        """Check whether an object would be recognised in an image."""
        if not self.runs(VISION):
            return False
        return self.classes is None or self.ontology.any_is_a(thing.types, self.classes)

    def may_recognise(self, classes: Iterable[str]) -> bool:
        """Check whether there is a model of one of some classes (IRIs), or of a superclass or subclass."""
        loaded, is_a = self.classes, self.ontology.is_a
        return loaded is None or any(is_a(one, cls) or is_a(cls, one) for one in classes for cls in loaded)


class Source(Enum):
    """Source of a believed pose."""

    MAP = "map"
    TOLD = "told"
    """The map, if the user trusts it (--trust-map)."""
    SEEN = "seen"
    FELT = "felt"
    DONE = "done"
    """The robot's own action: it released, pushed or lost the object there."""


class Knowledge(NamedTuple):
    """Source and age of an object's pose."""

    source: Source
    time: float = 0.0
    """Plan time at which the pose became known [s]."""
    moves: int = 0
    """Number of motions of the base before that."""


class Meaning(NamedTuple):
    """What a designator by class means in one performance of a step."""

    occasion: str
    """Occasion of the performance: the same in each attempt at it."""
    step: str
    """The step, the same in each of its performances."""
    aim: str
    """What it is for, the same for all steps that want the same of different things; the step, if that is unknown."""
    name: str
    """The thing."""
    served: bool
    """True if the step, or one within it, brings about something that lasts, such as where the thing is."""


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
    in_vain: Mapping[str, tuple[BasePose, ...]] = field(default_factory=dict)
    """Object -> base poses from which it was looked for and not seen, since it was last seen."""
    uncertain: frozenset[str] = frozenset()
    """Objects that should have been seen at their place and were not, so that they may be elsewhere."""
    estimates: Mapping[str, Estimate] = field(default_factory=dict)
    """Object -> where it is by all pictures since it was last moved, if the camera errs."""
    unseen: Mapping[str, int] = field(default_factory=dict)
    """Object -> number of pictures that should have shown it since it was last seen and did not, if the camera may miss
    things."""
    bound: Mapping[Object, str] = field(default_factory=dict)
    """Designator -> object that it stands for as long as that exists; if by class, in the latest performance."""
    meanings: Mapping[Object, tuple[Meaning, ...]] = field(default_factory=dict)
    """Designator by class -> what it means in each performance of a step, in the order in which these needed it."""
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
    """Arm -> how often its fingers did not reach their goal, or missed or lost a thing, since it last grasped one."""
    neck: int = 0
    """How often the neck failed to point the camera since it last arrived."""
    grasp: str | None = None
    """Class of the grasps by which things are taken; None for any."""

    @property
    def given_up(self) -> tuple[str, ...]:
        """Arms whose hands have failed so often that others are to be used."""
        return tuple(arm for arm, times in self.failing.items() if times >= MOST_FAILURES)

    @property
    def neck_given_up(self) -> bool:
        """Whether the neck has failed so often that the base is turned instead."""
        return self.neck >= MOST_FAILURES

    def evidence(self) -> object:
        """Summarise what answers about places depend on, as a cache key: not when something became known.

        Nor what designators are bound to, as a question binds those that it names.
        """
        sources = {name: (known.source, known.moves == self.moves) for name, known in self.known.items()}
        return sources, self.in_vain, self.unknown, self.given_up, self.grasp, self.neck_given_up, self.uncertain

    def learned(self, names: Iterable[str], source: Source) -> Memory:
        """Know the poses of objects from a source, from now on."""
        known = dict.fromkeys(names, Knowledge(source, self.time, self.moves))
        kept = source is Source.SEEN or not self.estimates
        estimates = self.estimates if kept else {one: at for one, at in self.estimates.items() if one not in known}
        uncertain = self.uncertain - known.keys()
        return replace(self, known={**self.known, **known}, uncertain=uncertain, estimates=estimates)

    def found(self, name: str, source: Source) -> Memory:
        """Know the pose of an object that was looked for, or felt for, so that no hand has lost it any more."""
        dropped = {arm: lost for arm, lost in self.dropped.items() if lost != name}
        return replace(self.learned((name,), source), in_vain=without(self.in_vain, name), dropped=dropped)

    def without_place(self, name: str) -> Memory:
        """Forget where an object was; its designators may be bound to others."""
        bound = {what: meant for what, meant in self.bound.items() if meant != name}
        others = {what: tuple(one for one in had if one.name != name) for what, had in self.meanings.items()}
        rest, known, estimates = self.uncertain - {name}, without(self.known, name), without(self.estimates, name)
        return replace(self, known=known, bound=bound, meanings=others, uncertain=rest, estimates=estimates)

    def meant(self) -> frozenset[str]:
        """Collect the things that designators mean or have meant."""
        return frozenset((*self.bound.values(), *(one.name for had in self.meanings.values() for one in had)))

    def meant_in(self, what: Object, occasion: str, step: str) -> Meaning | None:
        """Look up what a designator by class means in a performance; None if no attempt at it has needed it yet."""
        had = self.meanings.get(what, ())
        return next((one for one in had if (one.occasion, one.step) == (occasion, step)), None)

    def meaning(self, what: Object, where: Meaning) -> Memory:
        """Bind a designator by class in a performance, and after it."""
        others = (one for one in self.meanings.get(what, ()) if one[:2] != where[:2])
        bound, meanings = {**self.bound, what: where.name}, {**self.meanings, what: (*others, where)}
        return replace(self, bound=bound, meanings=meanings)

    def destroyed(self, name: str) -> Memory:
        """Remember that an object exists no more."""
        return replace(self.without_place(name), gone=(*self.gone, name))

    def created(self, thing: MapObject, pose: Pose) -> Memory:
        """Remember a new object, and where it came to be."""
        return replace(self, made={**self.made, thing.name: thing}, first={**self.first, thing.name: pose})

    def witnesses(self, name: str) -> Memory:
        """Remember that the state of a leaf or device is as the robot itself has seen, felt or set it."""
        return self if name in self.witnessed else replace(self, witnessed=self.witnessed | {name})

    def dropping(self, name: str, arms: Collection[str]) -> Memory:
        """Remember which arms have lost an object."""
        return replace(self, dropped={**self.dropped, **dict.fromkeys(arms, name)})
