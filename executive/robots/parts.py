"""What a robot has: parts with their classes, and capabilities that it claims."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

from executive.robots.self_model import SelfModel
from planlang.designators import local_name
from planlang.diagnostics import Span
from planlang.ontology import Ontology, expand


@dataclass(frozen=True, slots=True)
class Part:
    """A component of a robot. ``classes`` holds superclasses, too (IRIs); ``iri`` is None for what only shape tells."""

    name: str
    classes: frozenset[str]
    iri: str | None = None
    span: Span | None = None


def parts_of(model: SelfModel) -> tuple[Part, ...]:
    """The parts that a self-model lists, software included."""
    ontology = model.ontology
    return tuple(
        Part(local_name(iri), _upwards(ontology, ontology.types(iri)), iri, ontology.span(iri))
        for iri in model.components
    )


def claims_of(model: SelfModel) -> dict[str, Span | None]:
    """The capabilities (IRIs of classes) that a self-model claims, for the robot or its classes, and where."""
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
    """Parts and capabilities of a robot without self-model: what its shape implies, a base that drives included.

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
