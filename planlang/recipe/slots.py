"""Slots: the properties that actions of a class must or may have, and the kinds of their fillers.

Ontologies declare them (``ontologies/primitives.omn``). A class inherits the slots of its ancestors; for each property
the nearest class that declares it wins.
"""

from __future__ import annotations

from collections.abc import Iterator

from planlang.diagnostics import Diagnostic, error
from planlang.motion_constraints import STANDING_FOR
from planlang.ontology import Literal, Ontology, Triple, expand
from planlang.recipe.fillers import CONSTRAINED_BY, is_of_unknown_kind
from planlang.recipe.model import (
    Absence,
    Constraint,
    Filler,
    Kind,
    Name,
    Parameter,
    Part,
    Place,
    Recipe,
    Slot,
    Step,
    Thing,
)


def parameter_for(slot: Slot, owner: str) -> Thing:
    """Parameter of a plan that fills the slot of an action (name)."""
    kind = next(kind for kind in (Kind.PLACE, Kind.OBJECT, Kind.PERSON, Kind.DEVICE, Kind.NUMBER) if kind in slot.kinds)
    cls = "Person" if kind is Kind.PERSON else "SpatialThing-Localized"
    return Thing(kind, cls, None, expand(cls), owner, slot)


def in_words(slot: Slot) -> str:
    """Spell out the kinds that a slot accepts: ``a place or an object``."""
    words = [f"{'an' if kind is Kind.OBJECT else 'a'} {kind.value}" for kind in slot.kinds]
    return " or ".join([", ".join(words[:-1]), words[-1]] if words[:-1] else words)


def accepts(ontology: Ontology, slot: Slot, filler: Filler) -> bool:
    """Check whether a filler may fit a slot: False only if its kind is known to be another."""
    match filler:
        case Thing():
            has_any_kind = filler.slot is not None or is_of_unknown_kind(ontology, filler.stated)
            return has_any_kind or filler.kind in slot.kinds
        case Part():
            return Kind.OBJECT in slot.kinds or filler.of.kind in slot.kinds
        case Place():
            return Kind.PLACE in slot.kinds
        case Name():
            return is_of_unknown_kind(ontology, filler.iri)
        case int() | float():
            return Kind.NUMBER in slot.kinds
        case _:
            return False


def requires_filler(step: Step, slot: Slot) -> bool:
    """Check whether a step needs a filler for a slot."""
    if slot.absence is not Absence.CONSTRAINED:
        return slot.absence in (Absence.ERROR, Absence.PARAMETER)
    constraints = (one for one in step.fillers(CONSTRAINED_BY) if isinstance(one, Constraint))
    wholes = (part.of.type for one in constraints for part in (one.tool, one.world))
    return any(STANDING_FOR.get(cls) == slot.property for cls in wholes)


def fitting_parameters(ontology: Ontology, owner: Step | Recipe, slot: Slot) -> list[Parameter]:
    """List the distinct parameters of an action that fit a slot of one of its steps."""
    distinct = {one.filler: one for one in reversed(owner.parameters) if one.property == slot.property}
    fitting = [one for one in distinct.values() if isinstance(one.filler, (Thing, Place, int, float))]
    return [one for one in reversed(fitting) if accepts(ontology, slot, one.filler)]


def read_slots(ontology: Ontology) -> tuple[dict[str, dict[str, Slot]], tuple[Diagnostic, ...]]:
    """Read the slots declared for classes (IRIs), with an error (R063) for each malformed declaration."""
    slots_of: dict[str, dict[str, Slot]] = {}
    problems: list[Diagnostic] = []
    for declarer, subject in (("Primitive", "performsAction"), ("Signature", "ofAction")):
        for individual in ontology.individuals(expand(declarer)):
            slots = {slot.property: slot for slot in _declared(ontology, individual, problems)}
            for action in ontology.iris(individual, subject) if slots else ():
                slots_of.setdefault(action, {}).update(slots)
    return slots_of, tuple(problems)


def _declared(ontology: Ontology, individual: str, problems: list[Diagnostic]) -> Iterator[Slot]:
    for absence in Absence:
        for triple in ontology.triples(individual, expand(absence.value)):
            slot = _slot(ontology, triple, absence)
            if slot is not None:
                yield slot
            else:
                kinds = ", ".join(kind.value for kind in Kind)
                message = f"{absence.value} needs a property and the kinds of its fillers"
                advice = f'write for example {absence.value} "toLocation: place, object"; kinds: {kinds}'
                problems.append(error("R063", message, triple.span, advice))


def _slot(ontology: Ontology, triple: Triple, absence: Absence) -> Slot | None:
    """Parse ``property: kind, kind``, with plural kinds for a shared slot; None if malformed."""
    text = triple.object.value if isinstance(triple.object, Literal) else ""
    name, _, rest = text.partition(":")
    words = [word.strip() for word in rest.split(",")]
    is_shared = all(word.endswith("s") for word in words)
    known = {f"{kind.value}s" if is_shared else kind.value: kind for kind in Kind}
    if not ontology.is_property(expand(name.strip())) or not known.keys() >= set(words):
        return None
    return Slot(name.strip(), tuple(known[word] for word in words), absence, is_shared)
