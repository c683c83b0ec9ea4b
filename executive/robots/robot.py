"""Self-models in SRDL, and the robot that results from binding one to a URDF.

A self-model has links, joints, compositions, parts and capabilities; the robot has arms, grippers, torso, neck, camera,
and the parameters of their motion.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import field, replace
from itertools import combinations
from pathlib import Path

from planlang.closure import reached
from planlang.designators import Device, Object, local_name
from planlang.diagnostics import BadInput, Diagnostic, Span, error
from planlang.ontology import Literal, Ontology, expand
from planlang.records import dataclass
from sim import CameraModel, RobotBody
from sim.scene import TYPICAL


@dataclass(frozen=True, slots=True)
class Composition:
    """A composition of parts (an arm, a gripper), given by its base and end links; these may be undefined IRIs."""

    iri: str
    types: tuple[str, ...]
    base: str | None
    ends: tuple[str, ...]
    label: str | None
    span: Span | None


@dataclass(frozen=True, slots=True)
class SelfModel:
    """The self-model of one robot in an ontology."""

    ontology: Ontology
    iri: str
    name: str
    types: tuple[str, ...]
    links: Mapping[str, str]
    """IRI of a link -> its name in the URDF."""
    joints: Mapping[str, str]
    """IRI of a joint -> its name in the URDF."""
    compositions: tuple[Composition, ...]
    components: tuple[str, ...]
    """IRIs of all its parts: links and joints, compositions, software."""
    span: Span | None = None


def read_self_model(ontology: Ontology) -> SelfModel:
    """Read the self-model of the first robot in an ontology: an individual of a class of robots, else one with parts.

    Raises BadInput if there is none.
    """
    names = _urdf_names(ontology)
    robot = _robot(ontology, names)
    if robot is None:
        document = ontology.documents[0] if ontology.documents else None
        span = Span(str(document.path)) if document else None
        help = "add an individual of a subclass of knowrob:Robot, with srdl2-comp:succeedingLink"
        raise BadInput([error("B002", "this file describes no robot", span, help)])
    joints = {iri: name for iri, name in names.items() if _is_joint(ontology, iri)}
    links = {iri: name for iri, name in names.items() if iri not in joints}
    compositions = tuple(_compositions(ontology, robot))
    below = ("srdl2-comp:subComponent", "srdl2-comp:succeedingLink", "srdl2-comp:succeedingJoint")
    parts = reached((robot,), lambda iri: (part for prop in below for part in ontology.iris(iri, prop)))
    members = dict.fromkeys([*parts, *names, *(c.iri for c in compositions)])
    members.pop(robot, None)
    return SelfModel(
        ontology,
        robot,
        local_name(robot),
        ontology.types(robot),
        links,
        joints,
        compositions,
        tuple(members),
        ontology.span(robot),
    )


def _robot(ontology: Ontology, names: Collection[str]) -> str | None:
    robots = [r for r in ontology.individuals(expand("knowrob:Robot")) if not ontology.is_class(r)]
    if robots:
        return next((r for r in robots if ontology.main(r)), robots[0])
    for name in ("srdl2-comp:subComponent", "srdl2-comp:succeedingLink", "srdl2-comp:baseLinkOfComposition"):
        for triple in ontology.triples(None, expand(name)):
            iri = triple.subject
            if isinstance(iri, str) and iri not in names and not _is_composition(ontology, iri):
                return iri
    return None


def _urdf_names(ontology: Ontology) -> dict[str, str]:
    """Map the IRIs of links and joints to their names in the URDF."""
    names = {}
    for triple in ontology.triples(None, expand("srdl2-comp:urdfName")):
        if isinstance(triple.subject, str) and isinstance(triple.object, Literal):
            names[triple.subject] = triple.object.value.strip()
    return names


def _is_joint(ontology: Ontology, iri: str) -> bool:
    return any(local_name(cls).endswith("UrdfJoint") for cls in ontology.types(iri))


def _is_composition(ontology: Ontology, iri: str) -> bool:
    return any(local_name(cls) == "ComponentComposition" for cls in ontology.types(iri))


def _compositions(ontology: Ontology, robot: str) -> Iterator[Composition]:
    subjects: dict[str, None] = {}
    for name in ("srdl2-comp:baseLinkOfComposition", "srdl2-comp:endLinkOfComposition"):
        for triple in ontology.triples(None, expand(name)):
            if isinstance(triple.subject, str) and triple.subject != robot:
                subjects[triple.subject] = None
    for iri in subjects:
        bases = ontology.iris(iri, "srdl2-comp:baseLinkOfComposition")
        yield Composition(
            iri,
            ontology.types(iri),
            bases[0] if bases else None,
            ontology.iris(iri, "srdl2-comp:endLinkOfComposition"),
            ontology.label(iri),
            ontology.span(iri),
        )


@dataclass(frozen=True, slots=True)
class Part:
    """A component of a robot; ``classes`` (IRIs) includes superclasses, ``iri`` is None if the URDF implies it."""

    name: str
    classes: frozenset[str]
    iri: str | None = None
    span: Span | None = None


def parts_of(model: SelfModel) -> tuple[Part, ...]:
    """List the parts of a self-model, software included."""
    ontology = model.ontology
    return tuple(
        Part(local_name(iri), _upwards(ontology, ontology.types(iri)), iri, ontology.span(iri))
        for iri in model.components
    )


def claims_of(model: SelfModel) -> dict[str, Span | None]:
    """Collect the capabilities (IRIs of classes) that a self-model claims, for the robot or its classes, and where."""
    ontology = model.ontology
    properties = set(ontology.subproperties(expand("srdl2-cap:hasCapability")))
    claims: dict[str, Span | None] = {}
    for cls in sorted(_upwards(ontology, model.types), key=_place(ontology)):
        for restriction in ontology.restrictions(cls):
            states = restriction.property in properties and restriction.kind not in ("only", "max")
            if states and isinstance(restriction.filler, str):
                claims.setdefault(restriction.filler, restriction.span)
    for triple in ontology.triples(model.iri):
        value = triple.object
        if triple.predicate in properties and isinstance(value, str):
            for cls in ontology.types(value) if ontology.is_individual(value) else (value,):
                claims.setdefault(cls, triple.span)
    return claims


def inherent(
    arms: Sequence[Arm], camera: CameraModel | None, base: BaseDrive
) -> tuple[tuple[Part, ...], Mapping[str, Span | None]]:
    """Infer parts and capabilities from the anatomy of a robot without a self-model."""
    parts = [] if base.fixed else [_part("base", "srdl2-comp:MobileBase", "srdl2-comp:WheeledBase")]
    claims = [] if base.fixed else ["srdl2-cap:BaseMotionCapability"]
    for arm in arms:
        parts.append(_part(arm.name, "srdl2-comp:ArmComponent", "srdl2-comp:ManipulationEntity"))
        if arm.gripper is not None:
            parts.append(_part(f"{arm.name} gripper", "srdl2-comp:GripperComponent", "srdl2-comp:ManipulationEntity"))
    if arms:
        parts.append(_part("arm controller", "srdl2-comp:ArmMotionController"))
        claims.append("srdl2-cap:ArmMotionCapability")
    if any(arm.gripper for arm in arms):
        claims += [
            "srdl2-cap:GripperMotionCapability",
            "srdl2-cap:GraspingCapability",
            "srdl2-cap:PickingUpAnObjectCapability",
        ]
    if camera is not None:
        parts += [_part("camera", "srdl2-comp:Camera"), *_RECOGNITION]
    return tuple(parts), dict.fromkeys([*map(expand, claims), *(_RECOGNISING if camera is not None else ())])


def _part(name: str, *classes: str) -> Part:
    return Part(name, frozenset(map(expand, classes)))


_RECOGNITION = (
    _part("object recognition", "srdl2-comp:ObjectRecognitionComponent"),
    _part("object models", "knowrob:ObjectRecognitionModel"),
)
_RECOGNISING = tuple(map(expand, ("srdl2-cap:PerceptionCapability", "srdl2-cap:ObjectRecognitionCapability")))


def _upwards(ontology: Ontology, classes: Iterable[str]) -> frozenset[str]:
    return frozenset(ancestor for cls in classes for ancestor in (cls, *ontology.ancestors(cls)))


def _place(ontology: Ontology) -> Callable[[str], tuple[bool, Span, str]]:
    def key(iri: str) -> tuple[bool, Span, str]:
        span = ontology.span(iri)
        return span is None, span or Span(""), iri

    return key


Axis = tuple[float, float, float]

CARRYING = "carrying"
"""Posture for driving, to which the arms return before another base pose is tried."""


@dataclass(frozen=True, slots=True)
class Gripper:
    """The hand of an arm. Positions are joint values [rad, m] by joint name."""

    name: str
    iri: str | None
    joints: tuple[str, ...]
    opened: Mapping[str, float]
    closed: Mapping[str, float]
    finger_links: tuple[str, ...]
    max_opening: float
    """Width of the widest object that fits between the opened fingers [m]."""


@dataclass(frozen=True, slots=True)
class Arm:
    """One arm, from the robot's base to its tip frame."""

    name: str
    iri: str | None
    side: str | None
    """"left", "right" or None."""
    joints: tuple[str, ...]
    """Actuated joints from base to tip, without the torso."""
    base_link: str
    """Parent link of the first joint."""
    tip: str
    """Link whose frame is the grip point."""
    hand_link: str
    """Link that carries the fingers; held objects are attached to it."""
    approach: Axis
    """Unit vector in the tip frame along which the hand moves towards an object."""
    closing: Axis
    """Unit vector in the tip frame along which the fingers close."""
    gripper: Gripper | None
    payload: float = math.inf
    """Largest mass that the hand carries [kg]."""

    @property
    def hand(self) -> Device:
        """A designator of this hand, unique even if no self-model names it."""
        return Device("Hand", self.iri or f"robot:#{self.name}_hand")


@dataclass(frozen=True, slots=True)
class BaseDrive:
    """Motion of the base: radius of its footprint [m], speeds [m/s, rad/s], accelerations [m/s2, rad/s2]."""

    radius: float
    speed: float
    acceleration: float
    turn_speed: float
    turn_acceleration: float
    jerk: float
    """Of translation [m/s3] and rotation [rad/s3]."""
    fixed: bool = field(default=False, kw_only=True)
    """True for a base that never moves from its start pose."""


@dataclass(frozen=True, slots=True)
class JointLimits:
    """Limits of a joint's motion [rad/s, rad/s2, rad/s3], of a prismatic one [m/s, m/s2, m/s3]."""

    speed: float
    acceleration: float
    jerk: float


@dataclass(frozen=True, slots=True)
class Robot:
    """A robot: a self-model or a robot file, bound to a URDF. What the robot lacks is None or empty."""

    name: str
    iri: str | None
    urdf: Path
    base_link: str
    """Root link of the URDF; stands on the floor at the base pose."""
    base: BaseDrive
    torso: str | None
    """Prismatic joint that carries all arms."""
    arms: tuple[Arm, ...]
    neck: tuple[str, ...]
    """Joints that move the camera but no arm."""
    camera: CameraModel | None
    postures: Mapping[str, Mapping[str, float]]
    """Name -> joint positions; other joints keep theirs."""
    limits: Mapping[str, JointLimits]
    """For every actuated joint of torso, arms, grippers and neck."""
    allowed_contacts: tuple[tuple[str, str], ...] = ()
    """Pairs of links that may touch."""
    parts: tuple[Part, ...] = ()
    """Its parts, software included; without a self-model, those inferred from its anatomy."""
    claims: Mapping[str, Span | None] = field(default_factory=dict)
    """Capabilities (IRIs of classes) that it claims, and where."""
    model: SelfModel | None = field(default=None, compare=False, repr=False)
    """The self-model, if there is one."""
    diagnostics: tuple[Diagnostic, ...] = field(default=(), compare=False)
    """Repairs, assumptions and omissions of the binding."""
    file: Path | None = field(default=None, compare=False)
    """The robot file that describes the arms, if no self-model does."""

    def arm(self, name: str) -> Arm:
        """Find the arm with this name. Raises KeyError, which lists the arms."""
        for arm in self.arms:
            if arm.name == name:
                return arm
        raise KeyError(f"{self.name} has no arm {name!r}; it has {', '.join(a.name for a in self.arms) or 'none'}")

    def arms_of(self, device: Object | None) -> tuple[Arm, ...]:
        """List the arms that a device designator can refer to, in the robot's order; all of them without a designator.

        A hand or gripper of this robot refers to its arm, and so does the name of an arm. Any other device is matched
        by side (left or right in its name or class; without one, any side) and, if it is a gripper or hand, only to
        arms that have a gripper.
        """
        if device is None:
            return self.arms
        words = (device.iri, device.type)
        exact = tuple(a for a in self.arms if device.iri in {a.hand.iri, a.gripper and a.gripper.iri} - {None})
        if exact:
            return exact
        called = "" if device.iri is None else _plain(local_name(device.iri))
        if named := tuple(a for a in self.arms if called and called in (_plain(a.name), f"{_plain(a.name)}arm")):
            return named
        side = side_of(*(local_name(text) for text in words if text))
        graspers = any(re.search(r"gripper|hand|finger", text, re.IGNORECASE) for text in words if text)
        return tuple(a for a in self.arms if (side is None or a.side == side) and (a.gripper or not graspers))

    def without(self, device: Object) -> str | None:
        """Say that no arm fits a designator of an arm or hand, and what arms there are; None if one fits."""
        names = " ".join(filter(None, (device.iri and local_name(device.iri), device.type)))
        if self.arms_of(device) or not re.search("arm|hand|gripper|finger", names, re.IGNORECASE):
            return None
        return f"{self.name} has no {device.name}; its arms: {', '.join(arm.name for arm in self.arms) or 'none'}"

    def body(self, posture: str | None = None) -> RobotBody:
        """Describe the robot for the simulator, starting in a posture (by default ``carrying``, if it has one).

        Fingers of one hand may touch each other.
        """
        camera = self.camera or CameraModel(self.base_link, near=0.0, far=0.0)
        hands = {arm.hand_link: arm.gripper.finger_links for arm in self.arms if arm.gripper}
        start = self.postures.get(posture or CARRYING, {}) if posture is None else self.postures[posture]
        fingers = tuple(pair for links in hands.values() for pair in combinations(links, 2))
        return RobotBody(self.urdf, camera, hands, (*self.allowed_contacts, *fingers), start, tuple(self.limits))


def with_options(robot: Robot, *, trusts_map: bool, camera_noise: float | None) -> Robot:
    """Make the robot as the options of a run change it.

    One that ``trusts_map`` gets the capability to recognise objects: it looks them up in the map, for which the user
    vouches. ``camera_noise`` multiplies how the camera errs, or would err typically, if it is exact.
    """
    if trusts_map:
        claims = {**dict.fromkeys(_RECOGNISING), **robot.claims}
        robot = replace(robot, parts=(*robot.parts, *_RECOGNITION), claims=claims)
    if camera_noise is None or robot.camera is None:
        return robot
    noise = TYPICAL if robot.camera.noise.is_exact else robot.camera.noise
    return replace(robot, camera=replace(robot.camera, noise=noise.scaled(camera_noise)))


def _plain(name: str) -> str:
    """Name without separators and capital letters."""
    return "".join(filter(str.isalnum, name.casefold()))


def side_of(*names: str) -> str | None:
    """Find the side in names: "left" or "right"; None if they contain neither or both."""
    sides = {word.lower() for name in names for word in re.findall(r"(?<![Uu]p)(?:[Ll]eft|[Rr]ight)|LEFT|RIGHT", name)}
    return sides.pop() if len(sides) == 1 else None
