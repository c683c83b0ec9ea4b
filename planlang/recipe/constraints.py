"""Reading constraints of motions: kind, limits, weight, and the parts of things that they relate.

A motion is ``constrainedBy`` classes of constraints (:mod:`planlang.motion_constraints`). Features are class
expressions over parts, as in "a handle that is part of a spatula that the left arm holds". A tool feature that names no
whole is part of the device that the motion uses, a world feature is part of the object that it acts on.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from planlang.designators import local_name
from planlang.motion_constraints import ConstraintKind, Speed
from planlang.ontology import BNode, Literal, Ontology, Term, shorten
from planlang.ontology.terms import OWL, RDFS
from planlang.recipe.fillers import CONSTRAINED_BY, kind_of, nearest_in_vocabulary
from planlang.recipe.model import Constraint, Kind, Name, Parameter, Part, Thing
from planlang.recipe.statements import KINDS, is_word
from planlang.units import IncompatibleUnits, stated_number, unit_of

ROLES = ("deviceUsed", "objectActedOn")
"""Properties of a motion whose fillers are the default wholes of tool and world features."""
FEATURES = ("toolFeature", "worldFeature")
LIMITS = ("constrLowerLimit", "constrUpperLimit", "constrWeight")

_OF_WHOLE = ("physicalPartOf", "properPhysicalPartOf", "partOf")
"""Properties from a part to the whole."""
_OF_PARTS = ("physicalParts", "properPhysicalParts", "parts")
"""Properties from the whole to a part; expressions use their inverses."""
_HELD_BY = ("predecessorInKinematicChain",)
_DEEPEST = 20
"""Maximum depth of parts of parts; deeper nesting is treated as a mistake, such as a part of itself."""


def read_constraints(ontology: Ontology, parameters: tuple[Parameter, ...]) -> tuple[Parameter, ...]:
    """Replace names of constraints and parts among the parameters of a motion by the constraints and parts themselves.

    A constraint replaces the constraints that it is a subclass of. An incomplete one stays a name;
    :mod:`planlang.recipe.checks.fillers` reports what it lacks.
    """
    if not any(one.property == CONSTRAINED_BY for one in parameters):
        return parameters
    read = [_with_part(ontology, one) for one in parameters]
    fillers = (next((p.filler for p in read if p.property == name), None) for name in ROLES)
    tool, world = (Part(one) if isinstance(one, Thing) else one if isinstance(one, Part) else None for one in fillers)
    named = [one.filler.iri for one in read if one.property == CONSTRAINED_BY and isinstance(one.filler, Name)]
    replaced = {ancestor for name in named for ancestor in _levels(ontology, name)[1:]}
    replaced_parameters = []
    for one in read:
        if one.property != CONSTRAINED_BY or not isinstance(one.filler, Name):
            replaced_parameters.append(one)
        elif one.filler.iri not in replaced:
            replaced_parameters.append(
                replace(one, filler=read_constraint(ontology, one.filler.iri, tool, world) or one.filler)
            )
    return tuple(replaced_parameters)


def read_constraint(ontology: Ontology, iri: str, tool: Part | None, world: Part | None) -> Constraint | None:
    """Read a class or an individual as a constraint; None if it lacks its kind, a feature, or valid limits.

    ``tool`` and ``world`` are the default wholes of features that name none.
    """
    kind = kind_of_constraint(ontology, iri)
    parts = [stated_feature(ontology, iri, word, whole) for word, whole in zip(FEATURES, (tool, world), strict=True)]
    numbers = [number_of(ontology, iri, word) for word in LIMITS]
    lower, upper, weight = (number if isinstance(number, float) else None for number in numbers)
    is_crossed = lower is not None and upper is not None and lower > upper
    is_wrong = any(isinstance(number, str) for number in numbers) or is_crossed or (weight or 0.0) < 0.0
    if kind is None or parts[0] is None or parts[1] is None or is_wrong:
        return None
    template = max((_stated(ontology, iri, word) or (0,))[0] for word in FEATURES)
    stating = _levels(ontology, iri)[template]
    comments = (term.value for term in ontology.values(stating, RDFS.comment) if isinstance(term, Literal))
    speeds = (Speed.of_owl_class(ancestor) for ancestor in _levels(ontology, iri))
    frame = _stated(ontology, iri, "refFeature")
    return Constraint(
        iri,
        stating,
        kind,
        parts[0],
        parts[1],
        lower,
        upper,
        1.0 if weight is None else weight,
        next((speed for speed in speeds if speed is not None), None),
        frame[1].value if frame is not None and isinstance(frame[1], Literal) else None,
        ontology.label(stating) or next(comments, None),
    )


def kind_of_constraint(ontology: Ontology, iri: str) -> ConstraintKind | None:
    """Kind of the nearest class above that has one."""
    kinds = (ConstraintKind.of_owl_class(ancestor) for ancestor in _levels(ontology, iri))
    return next((kind for kind in kinds if kind is not None), None)


def number_of(ontology: Ontology, iri: str, word: str) -> float | str | None:
    """Read the number that a constraint states or inherits; the text if it is not a number, None if there is none.

    Limits are in metres or without a unit, depending on the kind of the constraint; a number in any other unit is
    returned as text.
    """
    stated = _stated(ontology, iri, word)
    if stated is None:
        return None
    term = stated[1]
    if not isinstance(term, Literal):
        return local_name(str(term))
    kind = kind_of_constraint(ontology, iri)
    is_length = kind is not None and kind.value.unit == "m" and word != "constrWeight"
    try:
        return float(stated_number(term, "Meter" if is_length else "Unitless"))
    except IncompatibleUnits:
        return f"{term.value} {unit_of(term)}"
    except ValueError:
        return term.value


def _levels(ontology: Ontology, iri: str) -> tuple[str, ...]:
    """A class and its ancestors, nearest first; for an individual: itself, then its classes and theirs."""
    if ontology.is_class(iri) or not ontology.types(iri):
        return ontology.ancestors(iri)
    above = (ancestor for cls in ontology.types(iri) for ancestor in ontology.ancestors(cls))
    return tuple(dict.fromkeys((iri, *above)))


def _own_value(ontology: Ontology, iri: str, word: str) -> Term | None:
    """Value that a class or an individual itself states for a property."""
    for restriction in ontology.restrictions(iri):
        if restriction.kind in KINDS and is_word(restriction.property, word):
            return restriction.filler
    return next((triple.object for triple in ontology.said(iri, word)), None)


def _stated(ontology: Ontology, iri: str, word: str) -> tuple[int, Term] | None:
    """Nearest value of a property, with its distance in levels above the constraint; None if nothing states one."""
    for distance, level in enumerate(_levels(ontology, iri)):
        if (term := _own_value(ontology, level, word)) is not None:
            return distance, term
    return None


def stated_feature(ontology: Ontology, iri: str, word: str, whole: Part | None = None) -> Part | None:
    """Read the part that a constraint states for ``toolFeature`` or ``worldFeature``; None if it states none.

    A feature that names no whole is a part of ``whole``, or is ``whole`` itself if that is an instance of the feature's
    class. Without ``whole`` it is a thing of its own.
    """
    stated = _stated(ontology, iri, word)
    described = _described(ontology, stated[1]) if stated is not None else None
    if described is None:
        return None
    if described.path or described.held_by is not None or whole is None:
        return described
    cls = described.of.iri or described.of.stated
    if ontology.is_a(whole.of.stated, cls) and not whole.path:
        return whole
    return replace(whole, path=(*whole.path, shorten(cls)))


def _described(ontology: Ontology, term: Term, depth: int = 0) -> Part | None:
    if isinstance(term, Literal) or depth > _DEEPEST:
        return None
    if isinstance(term, str) and ontology.is_individual(term) and not ontology.is_class(term):
        return _individual_part(ontology, term, depth)
    cls, whole, holder = None, None, None
    for conjunct in _conjuncts(ontology, term):
        if isinstance(conjunct, str):
            cls = cls or conjunct
        for name, filler in _related(ontology, conjunct) if isinstance(conjunct, BNode) else ():
            if name in _HELD_BY and isinstance(filler, str):
                holder = filler
            elif name in _OF_WHOLE:
                whole = _described(ontology, filler, depth + 1)
    if cls is None:
        return None
    held_by = Thing(Kind.DEVICE, nearest_in_vocabulary(ontology, holder), None, holder) if holder else None
    if whole is None:
        return Part(Thing(kind_of(ontology, cls), nearest_in_vocabulary(ontology, cls), None, cls), (), held_by)
    return Part(whole.of, (*whole.path, shorten(cls)), whole.held_by or held_by)


def _individual_part(ontology: Ontology, iri: str, depth: int) -> Part | None:
    """An individual as a part of the thing that lists it among its parts; otherwise as a thing."""
    for word in _OF_PARTS:
        for prop in ontology.properties_named(word):
            for triple in ontology.triples(p=prop, o=iri):
                whole = _described(ontology, triple.subject, depth + 1) if isinstance(triple.subject, str) else None
                if whole is not None:
                    return replace(whole, path=(*whole.path, iri))
    cls = next(iter(ontology.types(iri)), None)
    if cls is None:
        return None
    return Part(Thing(kind_of(ontology, cls), nearest_in_vocabulary(ontology, cls), iri, cls))


def _conjuncts(ontology: Ontology, term: str | BNode) -> Iterator[Term]:
    """Yield the members of an intersection; for a named class, those of its equivalent classes too."""
    if isinstance(term, str):
        for triple in ontology.triples(s=term, p=OWL.equivalentClass):
            if isinstance(triple.object, BNode):
                yield from ontology.members(triple.object)
    yield from ontology.members(term)


def _related(ontology: Ontology, node: BNode) -> Iterator[tuple[str, Term]]:
    """Yield the property of a restriction, in the direction from part to whole, and its fillers."""
    prop = ontology.value(node, OWL.onProperty)
    fillers = (*ontology.values(node, OWL.someValuesFrom), *ontology.values(node, OWL.hasValue))
    if isinstance(prop, BNode):
        inverse = ontology.value(prop, OWL.inverseOf)
        name = _OF_WHOLE[0] if isinstance(inverse, str) and is_word(inverse, *_OF_PARTS) else ""
    else:
        name = local_name(str(prop))
    yield from ((name, filler) for filler in fillers)


def _with_part(ontology: Ontology, parameter: Parameter) -> Parameter:
    """Replace a class that describes a part of something by that part."""
    thing = parameter.filler
    if not isinstance(thing, Thing) or thing.iri is not None:
        return parameter
    described = _described(ontology, thing.stated)
    is_part = described is not None and (described.path or described.held_by is not None)
    return replace(parameter, filler=described) if is_part and described is not None else parameter
