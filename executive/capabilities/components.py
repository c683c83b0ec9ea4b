"""Classes of a robot's parts, and the capabilities it claims; each with its superclasses."""

from __future__ import annotations

from collections.abc import Iterable

from executive.capabilities.robot import Arm
from executive.capabilities.self_model import SelfModel
from planlang.ontology import Ontology, expand


def components_of(model: SelfModel) -> tuple[frozenset[str], frozenset[str]]:
    """Component classes and claimed capabilities of a self-model, superclasses included (IRIs)."""
    ontology = model.ontology
    parts = _upwards(ontology, (cls for iri in model.components for cls in ontology.types(iri)))
    properties = set(ontology.subproperties(expand("srdl2-cap:hasCapability")))
    claims: list[str] = []
    for cls in _upwards(ontology, model.types):
        for restriction in ontology.restrictions(cls):
            if restriction.property in properties and isinstance(restriction.filler, str):
                claims.append(restriction.filler)
    for name in sorted(properties):
        for value in ontology.values(model.iri, name):
            if isinstance(value, str):
                claims += ontology.types(value) if ontology.is_individual(value) else (value,)
    return parts, _upwards(ontology, claims)


def inherent_components(arms: Iterable[Arm], has_camera: bool) -> tuple[frozenset[str], frozenset[str]]:
    """The same for a robot without self-model: what its shape implies, a base that drives included."""
    arms = tuple(arms)
    parts, claims = ["srdl2-comp:MobileBase", "srdl2-comp:WheeledBase"], ["srdl2-cap:BaseMotionCapability"]
    if arms:
        parts += ["srdl2-comp:ArmComponent", "srdl2-comp:ArmMotionController", "srdl2-comp:ManipulationEntity"]
        claims.append("srdl2-cap:ArmMotionCapability")
    if any(arm.gripper for arm in arms):
        parts.append("srdl2-comp:GripperComponent")
        claims += [
            "srdl2-cap:GripperMotionCapability",
            "srdl2-cap:GraspingCapability",
            "srdl2-cap:PickingUpAnObjectCapability",
        ]
    if has_camera:
        parts += ["srdl2-comp:Camera", "srdl2-comp:ObjectRecognitionComponent", "knowrob:ObjectRecognitionModel"]
        claims += ["srdl2-cap:PerceptionCapability", "srdl2-cap:ObjectRecognitionCapability"]
    return frozenset(map(expand, parts)), frozenset(map(expand, claims))


def _upwards(ontology: Ontology, classes: Iterable[str]) -> frozenset[str]:
    return frozenset(ancestor for cls in classes for ancestor in (cls, *ontology.ancestors(cls)))
