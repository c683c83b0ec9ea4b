"""Association of what a camera recognises with the things that are believed: which detection shows which thing.

Each detection shows at most one thing, each thing is shown by at most one detection of a picture, and together they are
as near as possible to where things are believed (Kuhn, The Hungarian method for the assignment problem, 1955). A thing
may be shown by a detection of its class, its size and its mark, within a gate that depends on how its place is known:
what has just been seen is where it was, what only the map states may have been moved, and what was not where it should
have been may be anywhere.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from itertools import count
from typing import Protocol

from executive.belief.estimates import Estimate
from executive.belief.memory import Memory, Source
from executive.belief.obstacles import NAMES
from executive.maps.classes import is_kind
from executive.maps.semantic_map import SemanticMap
from planlang.designators import local_name
from planlang.geometry import Pose
from planlang.graphs import assigned
from planlang.protocols import Detection
from planlang.records import dataclass
from planlang.state import WorldState
from sim.camera import READABLE
from sim.joints import Articulation
from sim.movers import Mover
from sim.scene import Body, BodyShape, CameraNoise

SEEN_GATE, ACTED_GATE, MAP_GATE, LEAF_GATE = 0.5, 1.0, 1.5, 0.3
"""Distance up to which a detection may show a thing that was seen, that the robot has moved or felt, that only the map
states, and a leaf or its part, from its way [m]."""
HAND_GATE = 0.3
"""The same for a thing in a hand [m]: it may have slipped."""
DRIFT = 0.02
"""Growth of these distances with the time for which a thing was not seen, as people move things [m/s]."""
SIZE_SHARE, SIZE_ERROR = 0.2, 0.01
"""Share of an extent and length [m] by which a size that is read may differ from the believed one."""
ANYWHERE = 100.0
"""Distance that counts for a thing whose place is unknown [m]: one at a known place is preferred."""
UNLIKE = 10.0
"""Distance that counts for each metre by which extents differ, where no place tells things apart."""


class Known(Protocol):
    """What association asks of the belief."""

    map: SemanticMap
    memory: Memory
    state: WorldState
    joints: dict[str, Articulation]
    camera_noise: CameraNoise


@dataclass(frozen=True, slots=True)
class Features:
    """What a camera may tell a thing by: classes, extents [m], mark and colour, if the map states them."""

    types: tuple[str, ...]
    size: tuple[float, float, float]
    mark: str | None = None
    colour: str | None = None


class Associator:
    """Finds which believed things detections show."""

    def __init__(self, belief: Known, bodies: Collection[Body], movers: Collection[Mover]) -> None:
        self._belief = belief
        of_map = {thing.name: thing for thing in belief.map.objects}
        self._features = {
            one.name: Features(
                tuple(dict.fromkeys((one.type, *(of_map[one.name].types if one.name in of_map else ())))),
                one.size,
                one.mark,
                one.colour,
            )
            for one in bodies
            if one.shape not in (BodyShape.MARKER, BodyShape.ROOM) and one.name not in NAMES
        }
        self._walking = {one.name for one in bodies if one.shape is BodyShape.PERSON} | {one.body for one in movers}
        """People and robots, which may have gone anywhere."""
        self._leaf_of = {name: leaf for leaf, joint in belief.joints.items() for name in joint.bodies}
        self._kinds: dict[tuple[str, str], bool] = {}
        self._fitting: dict[object, list[str]] = {}
        """Things that a detection with some features may show, valid for what has been made and heated so far."""
        self._made: object = None

    def features(self, name: str) -> Features:
        """Look up what a camera may tell a thing by."""
        made = self._belief.memory.made.get(name)
        return self._features[name] if made is None else Features(made.types, made.size or (0.0, 0.0, 0.0))

    def names(self, detections: Sequence[Detection], in_hands: Mapping[str, Pose]) -> list[str | None]:
        """Find the thing that each detection shows; None for one that shows nothing known.

        ``in_hands`` has the poses of things that hands carry.
        """
        costs = [self._costs(one, in_hands) for one in detections]
        first = [_nearest(one) for one in costs]
        taken = [name for name in first if name is not None]
        if len(taken) == len(set(taken)):  # each has the nearest thing for itself: nothing is nearer together
            return first
        return assigned(costs)

    def fitting(self, detection: Detection) -> list[str]:
        """List the things of the features of a detection, wherever they are, those of the most similar size first."""
        state, memory = self._belief.state, self._belief.memory
        now = memory.made, memory.gone, state.matter.types
        if self._made != now:
            self._fitting, self._made = {}, now
        key = detection.type, detection.size, detection.label, detection.colour, detection.visible < READABLE
        if key not in self._fitting:
            every = {**self._features, **memory.made}
            fitting = (name for name in every if self._fits(detection, name, self.features(name)))
            self._fitting[key] = sorted(fitting, key=lambda name: self._unlike(detection, name))
        return self._fitting[key]

    def new_name(self, cls: str) -> str:
        """Make a name for a thing of a class that no map has: as others of it are named, with the next number."""
        every = self._belief.memory.first
        alike = [name for name in every if self._is_known(name) and cls in self.features(name).types]
        word = local_name(cls)[:1].lower() + local_name(cls)[1:]
        stem = next(filter(None, (name.partition("#")[0].rstrip("0123456789_") for name in alike)), word)
        return next(name for number in count(len(alike) + 1) if (name := f"{stem}#{number}") not in every)

    def _is_known(self, name: str) -> bool:
        return name in self._features or name in self._belief.memory.made

    def is_part(self, detection: Detection) -> bool:
        """Check whether a detection shows a door, a drawer or a part of one, by its class."""
        kinds = {kind for name in self._leaf_of if name in self._features for kind in self._features[name].types}
        return any(self._is_kind(detection.type, kind) or self._is_kind(kind, detection.type) for kind in kinds)

    def is_of_kind(self, detection: Detection, name: str) -> bool:
        """Check whether a detection may show a thing by its class and its size."""
        one = self.features(name)
        types = (*one.types, *self._belief.state.matter.types.get(name, ()))
        if not any(self._may_be_told(kind, detection.type) for kind in types):
            return False
        return all(abs(read - known) <= SIZE_SHARE * known + SIZE_ERROR for read, known in _extents(detection, one))

    def may_be_at(self, name: str, pose: Pose, slack: float = 0.0) -> bool:
        """Check whether a thing may be at a pose, as far as is known of its place: whether that is within its gate.

        ``slack`` is by how much farther the pose may be [m].
        """
        believed = self._belief.state.poses.get(name)
        if believed is None or self._is_anywhere(name):
            return True
        return self._away(name, believed, pose) <= self._gate(name) + slack

    def is_in_gate(self, detection: Detection, name: str) -> bool:
        """Check whether a detection is within the gate of a thing."""
        slack = Estimate.of(detection).slack(self._belief.memory.estimates.get(name))
        return self.may_be_at(name, detection.pose, slack)

    def moves_on_a_way(self, name: str) -> bool:
        """Check whether a thing is a door, drawer or knob, or a part of one: it is told by the way that it moves on."""
        return name in self._leaf_of

    def _fits(self, detection: Detection, name: str, one: Features) -> bool:
        if not self.is_of_kind(detection, name):
            return False
        marks = ((one.mark, detection.label or detection.face_of), (one.colour, detection.colour))
        return all(
            said is None or said == shown or (shown is None and detection.visible < READABLE) for said, shown in marks
        )

    def _may_be_told(self, kind: str, cls: str) -> bool:
        """Check whether the camera may tell a thing of a kind to be of a class above or below, or of one by mistake."""
        if self._is_kind(kind, cls) or self._is_kind(cls, kind):
            return True
        confusions = self._belief.camera_noise.confusions
        return any(told == cls and self._is_kind(kind, true) for true, told, _ in confusions)

    def _unlike(self, detection: Detection, name: str) -> float:
        """Sum the lengths by which the extents of a detection and of a thing differ [m]."""
        return sum(abs(read - known) for read, known in _extents(detection, self.features(name)))

    def _is_kind(self, one: str, cls: str) -> bool:
        key = one, cls
        if key not in self._kinds:
            self._kinds[key] = one == cls or (bool(one and cls) and is_kind(self._belief.map.ontology, one, cls))
        return self._kinds[key]

    def _costs(self, detection: Detection, in_hands: Mapping[str, Pose]) -> dict[str, float]:
        """Map the things that a detection may show to how far it is from where they are believed [m]."""
        costs, memory, poses = dict[str, float](), self._belief.memory, self._belief.state.poses
        seen = Estimate.of(detection)
        for number, name in enumerate(self.fitting(detection)):
            if name in in_hands:
                away = in_hands[name].distance(detection.pose)
                if away <= HAND_GATE + seen.slack():
                    costs[name] = away
            elif name in memory.unknown:
                costs[name] = ANYWHERE + number
            elif name in poses:
                away = self._away(name, poses[name], detection.pose)
                if away <= self._gate(name) + seen.slack(memory.estimates.get(name)):
                    costs[name] = away
                elif self._is_anywhere(name):
                    far = ANYWHERE / 2 + away + UNLIKE * self._unlike(detection, name)
                    costs[name] = away if name in self._walking else far
        return costs

    def _away(self, name: str, believed: Pose, seen: Pose) -> float:
        """Compute the distance of a detection from a thing [m]; of a part of a leaf, from the way that it moves on."""
        leaf = self._leaf_of.get(name)
        if leaf is None:
            return believed.distance(seen)
        joint, closed = self._belief.joints[leaf], self._belief.memory.first[name]
        return (joint.motion(joint.within(joint.value_of(closed, seen))) @ closed).distance(seen)

    def _is_anywhere(self, name: str) -> bool:
        memory = self._belief.memory
        return name in memory.uncertain or name in memory.in_vain or name in self._walking

    def _gate(self, name: str) -> float:
        if name in self._leaf_of:
            return LEAF_GATE
        memory = self._belief.memory
        known = memory.known.get(name)
        if known is None or known.source in (Source.MAP, Source.TOLD) or name in self._belief.state.away:
            return MAP_GATE  # what a person has taken is wherever that puts it
        gate = SEEN_GATE if known.source is Source.SEEN else ACTED_GATE
        return min(gate + DRIFT * max(0.0, memory.time - known.time), MAP_GATE)


def _extents(detection: Detection, one: Features) -> list[tuple[float, float]]:
    """Pair the extents that are read with those of a thing [m]: the lesser and the greater of the base, the height."""
    (*base, height), (*known_base, known_height) = detection.size, one.size
    return [*zip(sorted(base), sorted(known_base), strict=True), (height, known_height)]


def _nearest(costs: Mapping[str, float]) -> str | None:
    return min(costs, key=lambda name: costs[name], default=None)
