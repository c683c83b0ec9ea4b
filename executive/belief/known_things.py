"""The robot's knowledge of the things of a map: which one a designator means, where it is, how that is known."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import chain
from typing import Any

import numpy as np

from executive.belief.knowledge import Grip, Knowledge, Source
from executive.belief.obstacles import NAMES
from executive.belief.recognition import VISION, Recognition
from executive.maps.class_names import is_kind
from executive.maps.contents import is_content
from executive.maps.semantic_map import MapObject, SemanticMap
from planlang.designators import Object
from planlang.failures import AmbiguousPerception, ObjectUnresolvable
from planlang.geometry import Pose
from sim import PlanningWorld
from sim.joints import Articulation
from sim.leaves import inside

ALIKE = 0.02
"""Things whose distances from the robot differ by less are equally near [m]."""


def _ignore(event: str, details: Mapping[str, Any]) -> None:
    """Ignore a change."""


class KnownThings:
    """The robot's knowledge of things, to be asked; :class:`executive.belief.Belief` changes it."""

    def __init__(
        self, semantic_map: SemanticMap, world: PlanningWorld, *, trusts_map: bool = False, unknown: Iterable[str] = ()
    ) -> None:
        """Believe the poses of ``world``, a planning world of the map's scene.

        With ``trusts_map`` they count as seen, wherever the base is. Of things that are ``unknown`` the robot does not
        know where they are until it has seen them.
        """
        self.map = semantic_map
        self.trusts_map = trusts_map
        self.recognition = Recognition(semantic_map.ontology)
        self.revision = 0
        self._suppositions = 0
        self.held: dict[str, Grip] = {}
        self.refused: dict[str, list[Pose]] = {}
        """Thing -> poses of it in the frame of a hand's tip, with which it could not be used."""
        self.dropped: dict[str, str] = {}
        """Arm -> the thing that it lost and nothing has grasped since: it may stand between the fingers."""
        self.tell: Callable[[str, Mapping[str, Any]], None] = _ignore
        """The listener to which changes are written: event, details."""
        self._poses: dict[str, Pose] = {name: world.pose(name) for name in world.names()}
        closed = {name: world.scene.body(name).pose for joint in world.scene.joints for name in joint.bodies}
        self._first = self._poses | {name: pose for name, pose in closed.items() if name in self._poses}
        self.unknown = {name: self._poses.pop(name) for name in dict.fromkeys(unknown) if name in self._poses}
        """Things of which the robot does not know where they are, with the pose that the map states."""
        self._absent = {name: None for name in NAMES if name in self._poses}
        """Obstacles in store, the next one first."""
        self.met: str | None = None
        """Name of the obstacle that was felt last, None while there is none."""
        self._taken: set[str] = set()
        """Things that a person has taken."""
        self._known: dict[str, Knowledge] = {}
        self._moves = 0
        self._bound: dict[Object, str] = {}
        self._in_vain: dict[str, list[tuple[float, float, float]]] = {}
        self.joints: dict[str, Articulation] = {joint.leaf: joint for joint in world.scene.joints}
        """The joints, by leaf."""
        self._values = {leaf: world.joint(leaf) for leaf in self.joints}
        self.led: dict[str, str] = {}
        """Leaf -> link of the hand that moves it."""
        self._moving = {name: leaf for leaf, joint in self.joints.items() for name in joint.bodies}
        self._boxes = {body.name: body.size for body in world.scene.bodies if body.movable or body.name in self.joints}
        self._matter = world.changes.matter
        """Contents of the believed world."""
        self.made: dict[str, MapObject] = {}
        """Things that came into being, by name."""
        self._gone: dict[str, None] = {}
        self.time = 0.0
        """Plan time up to which heat is believed to have done its work [s]."""

    # Asking

    @property
    def things(self) -> Iterator[MapObject]:
        """Things of the map, then those that came into being, whether they have a place or not."""
        return chain(self.map.objects, self.made.values())

    def joint(self, leaf: str) -> float:
        """Return how far a door or drawer is believed to be open [rad, m]; 0 is closed."""
        return self._values[leaf]

    def is_left_open(self, leaf: str) -> bool:
        """Return whether a door or drawer is believed to be open, be it a little; knobs open nothing."""
        return not (self.joints[leaf].is_knob or self.joints[leaf].is_shut(self._values[leaf]))

    def names(self) -> tuple[str, ...]:
        """Return the names of all things with a place, in the order of the map, then of obstacles that were felt."""
        return tuple(name for name in self._poses if name not in self._absent)

    def pose(self, name: str) -> Pose:
        """Return a thing's believed pose; of a held one, where it was last known to stand."""
        return self._poses[name]

    def closed_pose(self, name: str) -> Pose:
        """Return the believed pose of a thing; of what moves with a door or drawer, that when it is closed."""
        pose, leaf = self._poses[name], self._moving.get(name)
        if leaf is None and name not in self.held:
            opened = (one for one, value in self._values.items() if value and not self.joints[one].is_knob)
            within = (one for one in opened if inside(self._poses[one], self._boxes[one], np.array([pose.position]))[0])
            leaf = next(within, None)
        return pose if leaf is None else self.joints[leaf].motion(self._values[leaf]).inverse() @ pose

    def reference_pose(self, name: str) -> Pose:
        """Return what locations relative to a thing refer to: its pose, of a held one that before it was grasped."""
        return self.held[name].before if name in self.held else self._poses[name]

    def carried(self) -> frozenset[str]:
        """Return the things that hands hold, and those that stand on them and go with them."""
        return frozenset(self.held).union(*(grip.riders for grip in self.held.values()))

    def seen_from_here(self, name: str) -> bool:
        """Return True if a thing has been seen since the base last moved, or the map is trusted about it."""
        return (self.trusts_map and name not in self._in_vain) or self.seen(name)

    def seen(self, name: str) -> bool:
        """Return True if the camera has shown a thing since the base last moved."""
        known = self.knowledge(name)
        return known.source is Source.SEEN and known.moves == self._moves

    def knowledge(self, name: str) -> Knowledge:
        """Return how it is known where a thing is."""
        return self._known.get(name, Knowledge(Source.TOLD if self.trusts_map else Source.MAP))

    def remembers(self, name: str) -> bool:
        """Return True if a thing has been seen, from wherever, and nothing has been sensed or done since to move it."""
        return self.knowledge(name).source in (Source.SEEN, Source.TOLD) and name not in self._in_vain

    def remembered(self) -> frozenset[str]:
        """Return the things that it :meth:`remembers` seeing."""
        return frozenset(name for name in self._known if self.remembers(name))

    def by_map_alone(self, name: str) -> bool:
        """Return True if a thing is believed to be where the map has it, and was never seen."""
        return self._poses[name] == self._first[name] and self.knowledge(name).source is not Source.SEEN

    def looked_in_vain(self, name: str) -> tuple[tuple[float, float, float], ...]:
        """Return the places of the base from where a thing was looked for without being seen."""
        return tuple(self._in_vain.get(name, ()))

    def bind(self, what: Object, near: tuple[float, float, float]) -> str:
        """Return the thing that a designator means: that of its IRI; else, of its class, the nearest to the robot.

        What a designator was bound to once it keeps meaning, wherever the robot goes, as long as that is there. Without
        such a thing it is what contains a substance of that class, as long as it does. Raises ObjectUnresolvable,
        telling what there is; AmbiguousPerception if two that were seen from here are equally near.
        """
        if what not in self._bound:
            found = self._find(what, near)
            if found is None:
                return self._container(what, near)
            self._bound[what] = found
        return self._bound[what]

    def bound_to(self, what: Object, name: str) -> None:
        """Let a designator mean a thing from now on."""
        self._bound[what] = name

    def of_class(self, what: Object) -> tuple[str, ...]:
        """Return the things of a designator's class, in the order of the map."""
        return tuple(thing.name for thing in self.things if thing.name in self._poses and self.is_a(thing, what.type))

    def _find(self, what: Object, near: tuple[float, float, float]) -> str | None:
        placed = [thing for thing in self.things if thing.name in self._poses]
        for thing in placed:
            if what.iri is not None and thing.iri == what.iri:
                return thing.name
        fitting = {
            thing.name: math.dist(self._poses[thing.name].position[:2], near[:2])
            for thing in placed
            if self.is_a(thing, what.type)
        }
        if not fitting or self._meant(what) is not None:
            return None
        nearest = min(fitting, key=lambda name: fitting[name])
        equal = tuple(n for n in fitting if fitting[n] - fitting[nearest] < ALIKE and self.seen_from_here(n))
        if len(equal) > 1 and nearest in equal:
            raise AmbiguousPerception(what=str(what), candidates=equal)
        return nearest

    def _container(self, what: Object, near: tuple[float, float, float]) -> str:
        """Return the nearest thing that contains what a designator means."""
        meant = self._meant(what)
        holding = [
            name
            for name, content in self._matter.contents.items()
            if name in self._poses and any(self._is_kind(one.type, what.type) for one in content.values())
            if meant is None or any(meant in one.origins for one in content.values())
        ]
        if not holding:
            known = ", ".join(name for name in self._poses if name not in NAMES)
            missing = "is not there any more" if meant in self._gone else "is not in the map"
            missing = "has not been found yet" if meant in self.unknown else missing
            raise ObjectUnresolvable(f"{what} ({what.type}) {missing}; there are {known}", designator=str(what))
        return min(holding, key=lambda name: math.dist(self._poses[name].position[:2], near[:2]))

    def _meant(self, what: Object) -> str | None:
        """Return the individual that a designator names, if it is in something else, not found yet, or gone."""
        named = (thing for thing in self.things if what.iri is not None and thing.iri == what.iri)
        elsewhere = {*self._gone, *self.unknown}
        return next((thing.name for thing in named if is_content(thing) or thing.name in elsewhere), None)

    def means(self, what: Object, name: str) -> bool:
        """Return whether a designator means a thing itself, not what is in it."""
        thing = next((one for one in self.things if one.name == name), None)
        return thing is not None and (thing.iri == what.iri or self.is_a(thing, what.type))

    def is_a(self, thing: MapObject, cls: str) -> bool:
        """Return whether a thing is of a class, or was before it was heated."""
        return any(self._is_kind(one, cls) for one in (*thing.types, *self._matter.types.get(thing.name, ())))

    def _is_kind(self, one: str, cls: str) -> bool:
        """Return whether a class is below one; one that the map's vocabulary lacks is recognised by its name."""
        return is_kind(self.map.ontology, one, cls)

    def recognises(self, name: str) -> bool:
        """Return whether a thing would be recognised in a picture; what was made here is known without a model."""
        thing = self.map.find(name)
        if thing is None:
            return name not in self.made or self.recognition.runs(VISION)
        return self.recognition.recognises(thing)
