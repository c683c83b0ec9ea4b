"""Recognition models that a robot is given as files, and the classes of objects that it recognises with them.

A model is an individual of a subclass of ``ObjectRecognitionModel`` that ``providesModelFor`` classes of objects; its
data is a file beside the ontology, read by the recognition algorithm. Programs and maps in the same folders become
parts of the robot as well.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from executive.robots import Robot
from executive.robots.robot import Part
from planlang.designators import local_name
from planlang.diagnostics import BadInput, Diagnostic, Span, error, warning
from planlang.files import ONTOLOGIES
from planlang.ontology import Literal, Ontology, expand, load
from planlang.ontology.terms import OWL
from planlang.records import dataclass
from planlang.words import Option, Text, calling

_UNRECOGNISED = tuple(map(expand, ("Place-NonAgent", "SpaceInAHOC", "HumanOccupationConstruct", "AnimalBodyPart")))
MOST_FILES = 1000
"""Greatest number of ontologies read per folder."""
_MODEL, _PROVIDES = expand("ObjectRecognitionModel"), expand("providesModelFor")
_FILE = expand("roboearth:linkToRecognitionModel")
_KNOWLEDGE = (_MODEL, expand("SoftwareObject"), expand("srdl2-comp:SoftwareComponent"), expand("Map"))
"""Classes of parts that a robot can be given as files."""


@dataclass(frozen=True, slots=True)
class GivenPart:
    """An individual that a file describes, with all its classes, and the classes that it is a recognition model of."""

    iri: str
    classes: frozenset[str]
    recognises: tuple[str, ...]
    span: Span | None


def read_given_parts(
    folders: Iterable[Path], imports: Sequence[Path], notes: list[Diagnostic]
) -> tuple[GivenPart, ...]:
    """Read the models, programs and maps described in some folders and their direct subfolders. Raises BadInput.

    A recognition model without its file beside the ontology is skipped, with a warning in ``notes``.
    """
    problems: list[Diagnostic] = []
    given: dict[str, GivenPart] = {}
    for folder in folders:
        if not folder.is_dir():
            problems.append(error("C001", Text(Option("models", folder), " is not a folder")))
            continue
        inside = [
            *folder.iterdir(),
            *(path for below in folder.iterdir() if below.is_dir() for path in below.iterdir()),
        ]
        files = sorted(path for path in inside if path.is_file() and path.name.endswith(ONTOLOGIES))
        for path in files[:MOST_FILES]:
            try:
                given.update((one.iri, one) for one in _parts(load(path, folders=imports), path.parent, notes))
            except BadInput as problem:
                problems += problem.diagnostics
    if problems:
        raise BadInput(problems)
    return tuple(given.values())


def _parts(ontology: Ontology, folder: Path, notes: list[Diagnostic]) -> Iterator[GivenPart]:
    """Yield the parts that the main document describes, without those of its imports."""
    subjects = dict.fromkeys(triple.subject for triple in ontology.alone().triples() if isinstance(triple.subject, str))
    for iri in subjects:
        types = ontology.types(iri)
        classes = frozenset(above for cls in types for above in (cls, *ontology.ancestors(cls)))
        if not classes.isdisjoint(_KNOWLEDGE):
            lacking = [name for name in model_files(ontology, iri) if not (folder / name).is_file()]
            if lacking:
                message = f"the recognition model {local_name(iri)} is left out: {', '.join(lacking)} is not beside it"
                notes.append(warning("K042", message, ontology.span(iri), Text(calling("enable"), " downloads both")))
                continue
            targets = ontology.values_below(iri, _PROVIDES) if _MODEL in classes else ()
            yield GivenPart(iri, classes, tuple(one for one in targets if isinstance(one, str)), ontology.span(iri))


def with_given_parts(robot: Robot, given: Iterable[GivenPart]) -> Robot:
    """Add models, programs and maps to the parts of a robot's self-model."""
    parts = (Part(local_name(one.iri), one.classes, None, one.span) for one in given)
    return replace(robot, parts=(*robot.parts, *parts))


def needs_model(ontology: Ontology, types: Iterable[str]) -> bool:
    """Check whether objects of some classes need a recognition model: places and parts of bodies do not.

    Neither do objects without a specific class: a model of any class will do for them.
    """
    return not any(is_anything(ontology, cls) or ontology.any_is_a((cls,), _UNRECOGNISED) for cls in types)


def is_anything(ontology: Ontology, cls: str) -> bool:
    """Check whether a class is so general that it only means an object."""
    return cls == OWL.Thing or ontology.is_a(expand("EnduringThing-Localized"), cls)


def model_files(ontology: Ontology, iri: str) -> tuple[str, ...]:
    """List the file names of a recognition model: the last part of each link."""
    links = [one.value for one in ontology.values_below(iri, _FILE) if isinstance(one, Literal)]
    return tuple(dict.fromkeys(link.strip().rpartition("/")[2] for link in links))


def missing_model(what: str, types: Sequence[str]) -> str:
    """Write the message for an object that cannot be recognised: the missing model, and how to get it."""
    cls = local_name(types[0]) if types else "Thing"
    return (
        f"{what} cannot be recognised: there is no recognition model of {cls} "
        f"(searched as: ObjectRecognitionModel and providesModelFor some {cls})"
    )
