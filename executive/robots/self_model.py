"""SRDL self-models: the links, joints, compositions, parts and capabilities that a robot says it has."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field

from planlang.designators import local_name
from planlang.diagnostics import BadInput, Span, error
from planlang.ontology import Literal, Ontology, expand


@dataclass(frozen=True, slots=True)
class Composition:
    """Parts that are one thing (an arm, a gripper), given by where it begins and where it ends; names may dangle."""

    iri: str
    types: tuple[str, ...]
    base: str | None
    ends: tuple[str, ...]
    tool_frame: str | None
    label: str | None
    span: Span | None


@dataclass(frozen=True, slots=True)
class SelfModel:
    """What an ontology says about one robot."""

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
    """IRIs of everything that is part of it: chain, compositions, software."""
    span: Span | None = None
    dangling: frozenset[str] = field(default_factory=frozenset)
    """IRIs that compositions name although no individual has them."""


def read_self_model(ontology: Ontology) -> SelfModel:
    """Return the robot that an ontology describes: the first individual of a class of robots, or with parts of its own.

    Raises BadInput if there is none.
    """
    robot = _robot(ontology)
    if robot is None:
        document = ontology.documents[0] if ontology.documents else None
        span = Span(str(document.path)) if document else None
        help = "a self-model has an individual of a class below knowrob:Robot, with srdl2-comp:succeedingLink"
        raise BadInput([error("B002", "there is no robot in this file", span, help)])
    names = _urdf_names(ontology)
    joints = {iri: name for iri, name in names.items() if _is_joint(ontology, iri)}
    links = {iri: name for iri, name in names.items() if iri not in joints}
    compositions = tuple(_compositions(ontology, robot))
    members = dict.fromkeys([*_closure(ontology, robot), *names, *(c.iri for c in compositions)])
    members.pop(robot, None)
    ends = {iri for c in compositions for iri in (*c.ends, c.base, c.tool_frame) if iri}
    dangling = frozenset(iri for iri in ends if iri not in names and not ontology.defined(iri))
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
        dangling,
    )


def _robot(ontology: Ontology) -> str | None:
    robots = [r for r in ontology.individuals(expand("knowrob:Robot")) if not ontology.is_class(r)]
    if robots:
        return next((r for r in robots if ontology.main(r)), robots[0])
    for name in ("srdl2-comp:subComponent", "srdl2-comp:succeedingLink", "srdl2-comp:baseLinkOfComposition"):
        for triple in ontology.triples(None, expand(name)):
            iri = triple.subject
            if isinstance(iri, str) and not _urdf_name(ontology, iri) and not _is_composition(ontology, iri):
                return iri
    return None


def _urdf_names(ontology: Ontology) -> dict[str, str]:
    """IRI -> name in the URDF, of everything that has one."""
    found = {}
    for triple in ontology.triples(None, expand("srdl2-comp:urdfName")):
        if isinstance(triple.subject, str) and isinstance(triple.object, Literal):
            found[triple.subject] = triple.object.value.strip()
    return found


def _urdf_name(ontology: Ontology, iri: str) -> str | None:
    value = ontology.value(iri, expand("srdl2-comp:urdfName"))
    return value.value if isinstance(value, Literal) else None


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
        bases, tools = (
            _links(ontology, iri, "srdl2-comp:baseLinkOfComposition"),
            _links(ontology, iri, "srdl2-comp:toolFrame"),
        )
        yield Composition(
            iri,
            ontology.types(iri),
            bases[0] if bases else None,
            _links(ontology, iri, "srdl2-comp:endLinkOfComposition"),
            tools[0] if tools else None,
            ontology.label(iri),
            ontology.span(iri),
        )


def _links(ontology: Ontology, iri: str, prop: str) -> tuple[str, ...]:
    return tuple(dict.fromkeys(v for v in ontology.values(iri, expand(prop)) if isinstance(v, str)))


def _closure(ontology: Ontology, robot: str) -> tuple[str, ...]:
    """Return the robot and everything reached from it by chain and part relations, breadth first."""
    found = {robot: None}
    queue = [robot]
    while queue:
        iri = queue.pop(0)
        for name in ("srdl2-comp:subComponent", "srdl2-comp:succeedingLink", "srdl2-comp:succeedingJoint"):
            for part in _links(ontology, iri, name):
                if part not in found:
                    found[part] = None
                    queue.append(part)
    return tuple(found)


@dataclass(frozen=True, slots=True)
class Part:
    """A component of a robot. ``classes`` holds superclasses, too (IRIs); ``iri`` is None for what only shape tells."""

    name: str
    classes: frozenset[str]
    iri: str | None = None
    span: Span | None = None


def parts_of(model: SelfModel) -> tuple[Part, ...]:
    """Return the parts that a self-model lists, software included."""
    ontology = model.ontology
    return tuple(
        Part(local_name(iri), _upwards(ontology, ontology.types(iri)), iri, ontology.span(iri))
        for iri in model.components
    )


def claims_of(model: SelfModel) -> dict[str, Span | None]:
    """Return the capabilities (IRIs of classes) that a self-model claims, for the robot or its classes, and where."""
    ontology = model.ontology
    properties = set(ontology.subproperties(expand("srdl2-cap:hasCapability")))
    claims: dict[str, Span | None] = {}
    for cls in sorted(_upwards(ontology, model.types), key=_place(ontology)):
        for restriction in ontology.restrictions(cls):
            if restriction.property in properties and isinstance(restriction.filler, str):
                claims.setdefault(restriction.filler, restriction.span)
    for triple in ontology.triples(model.iri):
        value = triple.object
        if triple.predicate in properties and isinstance(value, str):
            for cls in ontology.types(value) if ontology.is_individual(value) else (value,):
                claims.setdefault(cls, triple.span)
    return claims


def inherent(arms: Iterable[tuple[str, bool]], has_camera: bool) -> tuple[tuple[Part, ...], Mapping[str, Span | None]]:
    """Return the parts and capabilities that a shape implies, for a robot without self-model: its base drives.

    ``arms`` are the names of arms, with whether they have a gripper.
    """
    arms = tuple(arms)
    parts = [_part("base", "srdl2-comp:MobileBase", "srdl2-comp:WheeledBase")]
    claims = ["srdl2-cap:BaseMotionCapability"]
    for name, has_gripper in arms:
        parts.append(_part(name, "srdl2-comp:ArmComponent", "srdl2-comp:ManipulationEntity"))
        if has_gripper:
            parts.append(_part(f"{name} gripper", "srdl2-comp:GripperComponent", "srdl2-comp:ManipulationEntity"))
    if arms:
        parts.append(_part("arm controller", "srdl2-comp:ArmMotionController"))
        claims.append("srdl2-cap:ArmMotionCapability")
    if any(has_gripper for _, has_gripper in arms):
        claims += [
            "srdl2-cap:GripperMotionCapability",
            "srdl2-cap:GraspingCapability",
            "srdl2-cap:PickingUpAnObjectCapability",
        ]
    if has_camera:
        parts.append(_part("camera", "srdl2-comp:Camera"))
        parts.append(_part("object recognition", "srdl2-comp:ObjectRecognitionComponent"))
        parts.append(_part("object models", "knowrob:ObjectRecognitionModel"))
        claims += ["srdl2-cap:PerceptionCapability", "srdl2-cap:ObjectRecognitionCapability"]
    return tuple(parts), dict.fromkeys(map(expand, claims))


def _part(name: str, *classes: str) -> Part:
    return Part(name, frozenset(map(expand, classes)))


def _upwards(ontology: Ontology, classes: Iterable[str]) -> frozenset[str]:
    return frozenset(ancestor for cls in classes for ancestor in (cls, *ontology.ancestors(cls)))


def _place(ontology: Ontology) -> Callable[[str], tuple[bool, Span, str]]:
    def key(iri: str) -> tuple[bool, Span, str]:
        span = ontology.span(iri)
        return span is None, span or Span(""), iri

    return key
