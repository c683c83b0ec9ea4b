"""The content of an entry as its page shows it: how a recipe's steps follow each other, and what they require."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import field
from itertools import islice

from executive.robots import requirements
from executive.serving.sources import LARGEST_SHOWN
from executive.serving.uploads import load_upload, unpacked
from executive.serving.vocabulary import Vocabulary
from executive.serving.workers import Busy, Failed, Workers
from planlang.compiler import compile_ontology
from planlang.compiler.drawing import figure, task_graph
from planlang.designators import local_name
from planlang.diagnostics import BadInput, Diagnostic
from planlang.knowledge.axioms import NOTHING, THING
from planlang.knowledge.descriptions import Description, contradiction
from planlang.knowledge.entries import Entry, Kind
from planlang.ontology import Ontology
from planlang.recipe import RecipeSet
from planlang.records import dataclass

MOST_STEPS = 200
"""Steps of a drawing on a page; larger ones are drawn by ``planlang compile --graph``."""

MOST_CLASSES, MOST_PLACES = 6, 20


@dataclass(frozen=True, slots=True)
class Required:
    """Something that a recipe requires of a robot, and the names of the classes that lead to it."""

    name: str
    iri: str
    because: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Details:
    """A recipe as its page shows it. ``drawing`` is an SVG element, empty for a recipe that is too large for one."""

    drawing: str = ""
    capabilities: tuple[Required, ...] = ()
    components: tuple[Required, ...] = ()
    diagnostics: tuple[Diagnostic, ...] = ()
    """The reason why a recipe cannot be compiled now, though it could be when it was taken."""


def details_of(entry: Entry, data: bytes, workers: Workers) -> Details | None:
    """Return what a recipe's revision shows; None for other kinds, what is too large, and what cannot be read now."""
    if entry.kind is not Kind.RECIPE or len(data) > LARGEST_SHOWN:
        return None
    try:
        return workers.call(read_details, entry, data)
    except BadInput as problem:
        return Details(diagnostics=problem.diagnostics)
    except (Failed, Busy):
        return None


def read_details(entry: Entry, data: bytes, vocabulary: Vocabulary) -> Details:
    """Return what a recipe's content shows. Raises BadInput."""
    ontology = load_upload(entry.uid.partition(".")[2], data, vocabulary)
    plan = compile_ontology(ontology, task=entry.about)
    steps = sum(len(recipe.steps) for recipe in plan.recipes.recipes.values())
    drawing = figure(task_graph(plan.recipes, plan.added, plan.recoveries)) if steps <= MOST_STEPS else ""
    capabilities, components = _required(ontology, plan.recipes)
    return Details(drawing, capabilities, components)


def _required(ontology: Ontology, recipes: RecipeSet) -> Iterable[tuple[Required, ...]]:
    """Return the capabilities and the components that all recipes of a set and their steps require."""
    actions = [
        action
        for recipe in recipes.recipes.values()
        for action in (recipe.action_class, *(step.action_class for step in recipe.steps))
    ]
    return map(_listed, requirements(ontology, actions))


def _listed(found: Mapping[str, tuple[str, ...]]) -> tuple[Required, ...]:
    listed = (Required(local_name(iri), iri, tuple(map(local_name, path))) for iri, path in found.items())
    return tuple(sorted(listed, key=lambda one: one.name))


@dataclass(frozen=True, slots=True)
class Known:
    """Ways to find an entry: class expressions that it is in, as shown and as asked, and names of its place."""

    classes: Mapping[str, str] = field(default_factory=dict)
    expressions: Mapping[str, str] = field(default_factory=dict)
    place: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    impossible: str = ""
    """The reason why nothing can be what the entry describes; empty if something can."""


def known_of(stored: bytes, vocabulary: Vocabulary, asked: Callable[[str], str]) -> Known:
    """Return what a stored description says; nothing for one that an earlier version wrote.

    ``asked`` returns how a class or a property is asked for: by its local name, or by its IRI.
    """
    kept, _ = unpacked(stored, vocabulary)
    if kept is None or not kept.facts.nodes:
        return Known()
    description = kept.description()
    root = description.nodes[0]
    impossible = impossible_by(description, vocabulary) if NOTHING in root.labels else ""
    classes = {local_name(label): asked(label) for label in _classes(root.labels)[:MOST_CLASSES]}
    expressions: dict[str, str] = {}
    for prop, target in root.links:
        labels = (target,) if isinstance(target, str) else description.nodes[target].labels
        for cls in _classes(labels)[:1]:
            expressions[f"{local_name(prop)} some {local_name(cls)}"] = f"{asked(prop)} some {asked(cls)}"
    place: dict[str, tuple[str, ...]] = {}
    for level, text in description.place[:MOST_PLACES]:
        place[level] = (*place.get(level, ()), text)
    return Known(classes, dict(islice(expressions.items(), MOST_CLASSES)), place, impossible)


def impossible_by(description: Description, vocabulary: Vocabulary) -> str:
    """Return why nothing can be what a description says, as far as two named classes show it."""
    found = contradiction(description, vocabulary.axioms)
    if found is None:
        return "what it states contradicts itself or this server's ontologies"
    return "{} and {} exclude each other in this server's ontologies, and it needs something that is both".format(
        *map(local_name, found)
    )


def _classes(labels: Iterable[str]) -> list[str]:
    """Return the IRIs of classes among labels, without individuals and what everything is."""
    return [label for label in labels if label not in (THING, NOTHING) and not label.startswith("{")]
