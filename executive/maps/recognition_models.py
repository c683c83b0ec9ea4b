"""Recognition models that a robot has as files: of which classes things are recognised with them.

A model is an individual of a class below ``ObjectRecognitionModel`` that ``providesModelFor`` classes of things; the
model itself is a file beside it, which its algorithm reads. What a folder describes else (programs, maps) are further
parts of the robot.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from executive.robots import Robot
from executive.robots.robot import Part
from planlang.designators import local_name
from planlang.diagnostics import BadInput, Diagnostic, Span, error, warning
from planlang.files import SUFFIXES
from planlang.ontology import Literal, Ontology, expand, load
from planlang.ontology.terms import OWL
from planlang.records import dataclass

_UNRECOGNISED = tuple(map(expand, ("Place-NonAgent", "SpaceInAHOC", "HumanOccupationConstruct", "AnimalBodyPart")))
MOST_FILES = 1000
"""Ontologies of a folder that are read."""
_MODEL, _PROVIDES = expand("ObjectRecognitionModel"), expand("providesModelFor")
_FILE = expand("roboearth:linkToRecognitionModel")
_KNOWLEDGE = (_MODEL, expand("SoftwareObject"), expand("srdl2-comp:SoftwareComponent"), expand("Map"))
"""Classes of what a robot can be given as a file."""


@dataclass(frozen=True, slots=True)
class GivenPart:
    """An individual that a file describes: its classes with those above them, and what it is a recognition model of."""

    iri: str
    classes: frozenset[str]
    recognises: tuple[str, ...]
    span: Span | None


def read_given_parts(
    folders: Iterable[Path], imports: Sequence[Path], notes: list[Diagnostic]
) -> tuple[GivenPart, ...]:
    """Return what the ontologies of some folders, and of those in them, describe. Raises BadInput.

    Appends a warning for each recognition model that is left out, as its file is not beside its ontology.
    """
    problems: list[Diagnostic] = []
    found: dict[str, GivenPart] = {}
    for folder in folders:
        if not folder.is_dir():
            problems.append(error("C001", f"--models {folder} is not a folder"))
            continue
        inside = [
            *folder.iterdir(),
            *(path for below in folder.iterdir() if below.is_dir() for path in below.iterdir()),
        ]
        files = sorted(path for path in inside if path.is_file() and path.name.endswith(SUFFIXES))
        for path in files[:MOST_FILES]:
            try:
                found.update((one.iri, one) for one in _parts(load(path, folders=imports), path.parent, notes))
            except BadInput as problem:
                problems += problem.diagnostics
    if problems:
        raise BadInput(problems)
    return tuple(found.values())


def _parts(ontology: Ontology, folder: Path, notes: list[Diagnostic]) -> Iterator[GivenPart]:
    """Yield what the main document describes."""
    stated = dict.fromkeys(triple.subject for triple in ontology.alone().triples() if isinstance(triple.subject, str))
    for iri in stated:
        types = ontology.types(iri)
        classes = frozenset(above for cls in types for above in (cls, *ontology.ancestors(cls)))
        if not classes.isdisjoint(_KNOWLEDGE):
            lacking = [name for name in model_files(ontology, iri) if not (folder / name).is_file()]
            if lacking:
                message = f"the recognition model {local_name(iri)} is left out: {', '.join(lacking)} is not beside it"
                notes.append(warning("K042", message, ontology.span(iri), "planlang enable takes both"))
                continue
            targets = ontology.values(iri, _PROVIDES, subproperties=True) if _MODEL in classes else ()
            yield GivenPart(iri, classes, tuple(one for one in targets if isinstance(one, str)), ontology.span(iri))


def with_given_parts(robot: Robot, given: Iterable[GivenPart]) -> Robot:
    """Return a robot that has models, programs and maps beside the parts of its self-model."""
    parts = (Part(local_name(one.iri), one.classes, None, one.span) for one in given)
    return replace(robot, parts=(*robot.parts, *parts))


def needs_model(ontology: Ontology, types: Iterable[str]) -> bool:
    """Return whether a thing of some classes is recognised by a model: not a place, nor a part of somebody's body.

    Nor is anything, of which no class says more: whatever there is a model of will do.
    """
    return not any(is_anything(ontology, cls) or ontology.any_is_a((cls,), _UNRECOGNISED) for cls in types)


def is_anything(ontology: Ontology, cls: str) -> bool:
    """Return whether a class means no more than some thing."""
    return cls == OWL.Thing or ontology.is_a(expand("EnduringThing-Localized"), cls)


def model_files(ontology: Ontology, iri: str) -> tuple[str, ...]:
    """Return the names of the files that a recognition model has: the last part of each link to one."""
    links = [one.value for one in ontology.values(iri, _FILE, subproperties=True) if isinstance(one, Literal)]
    return tuple(dict.fromkeys(link.strip().rpartition("/")[2] for link in links))


def missing_model(what: str, types: Sequence[str]) -> str:
    """Return the message that a thing of some classes cannot be recognised: which model is missing, and who has it."""
    cls = local_name(types[0]) if types else "Thing"
    return (
        f"{what} cannot be recognised: there is no recognition model of {cls} "
        f"(searched as: ObjectRecognitionModel and providesModelFor some {cls}; planlang enable takes one)"
    )
