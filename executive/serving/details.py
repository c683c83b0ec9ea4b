"""Details on an entry's page: the order of a recipe's steps, its requirements, and queries that find the entry."""

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
"""Largest number of steps drawn on a page; ``planlang compile --graph`` draws larger recipes."""

MOST_CLASSES, MOST_PLACES = 6, 20


@dataclass(frozen=True, slots=True)
class Required:
    """A requirement of a recipe, and the chain of classes that it follows from."""

    name: str
    iri: str
    because: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Details:
    """Details of a recipe. ``drawing`` is an SVG element, empty if the recipe is too large to be drawn."""

    drawing: str = ""
    capabilities: tuple[Required, ...] = ()
    components: tuple[Required, ...] = ()
    diagnostics: tuple[Diagnostic, ...] = ()
    """Errors if the recipe can no longer be compiled."""


def details_of(entry: Entry, data: bytes, workers: Workers) -> Details | None:
    """Details of a revision; None if it is no recipe, is too large, or the workers are busy or fail."""
    if entry.kind is not Kind.RECIPE or len(data) > LARGEST_SHOWN:
        return None
    try:
        return workers.call(read_details, entry, data)
    except BadInput as problem:
        return Details(diagnostics=problem.diagnostics)
    except (Failed, Busy):
        return None


def read_details(entry: Entry, data: bytes, vocabulary: Vocabulary) -> Details:
    """Compile a recipe and collect its details. Raises BadInput."""
    ontology = load_upload(entry.uid.partition(".")[2], data, vocabulary)
    plan = compile_ontology(ontology, task=entry.about)
    steps = sum(len(recipe.steps) for recipe in plan.recipes.recipes.values())
    drawing = figure(task_graph(plan.recipes, plan.added, plan.recoveries)) if steps <= MOST_STEPS else ""
    capabilities, components = _required(ontology, plan.recipes)
    return Details(drawing, capabilities, components)


def _required(ontology: Ontology, recipes: RecipeSet) -> Iterable[tuple[Required, ...]]:
    """Capabilities and components required by all recipes of a set and by their steps."""
    actions = [
        action
        for recipe in recipes.recipes.values()
        for action in (recipe.action_class, *(step.action_class for step in recipe.steps))
    ]
    return map(_sorted, requirements(ontology, actions))


def _sorted(paths: Mapping[str, tuple[str, ...]]) -> tuple[Required, ...]:
    required = (Required(local_name(iri), iri, tuple(map(local_name, path))) for iri, path in paths.items())
    return tuple(sorted(required, key=lambda one: one.name))


@dataclass(frozen=True, slots=True)
class Queries:
    """Queries that find an entry: displayed text and query of class expressions, and names of its place."""

    classes: Mapping[str, str] = field(default_factory=dict)
    expressions: Mapping[str, str] = field(default_factory=dict)
    place: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    impossible: str = ""
    """Reason why the description is unsatisfiable; empty if it is satisfiable."""


def queries_for(stored: bytes, vocabulary: Vocabulary, query_name: Callable[[str], str]) -> Queries:
    """Derive queries from a stored description; none if an earlier version wrote it.

    ``query_name`` maps an IRI to its name in queries.
    """
    kept, _ = unpacked(stored, vocabulary)
    if kept is None or not kept.facts.nodes:
        return Queries()
    description = kept.description()
    root = description.nodes[0]
    impossible = impossible_by(description, vocabulary) if NOTHING in root.labels else ""
    classes = {local_name(label): query_name(label) for label in _classes(root.labels)[:MOST_CLASSES]}
    expressions: dict[str, str] = {}
    for prop, target in root.links:
        labels = (target,) if isinstance(target, str) else description.nodes[target].labels
        for cls in _classes(labels)[:1]:
            expressions[f"{local_name(prop)} some {local_name(cls)}"] = f"{query_name(prop)} some {query_name(cls)}"
    place: dict[str, tuple[str, ...]] = {}
    for level, text in description.place[:MOST_PLACES]:
        place[level] = (*place.get(level, ()), text)
    return Queries(classes, dict(islice(expressions.items(), MOST_CLASSES)), place, impossible)


def impossible_by(description: Description, vocabulary: Vocabulary) -> str:
    """Explain why a description is unsatisfiable, by two disjoint classes if there are such."""
    disjoint = contradiction(description, vocabulary.axioms)
    if disjoint is None:
        return "its statements contradict each other or this server's ontologies"
    return "{} and {} exclude each other in this server's ontologies, and it needs something that is both".format(
        *map(local_name, disjoint)
    )


def _classes(labels: Iterable[str]) -> list[str]:
    """Named classes among the labels of a node, without individuals, owl:Thing and owl:Nothing."""
    return [label for label in labels if label not in (THING, NOTHING) and not label.startswith("{")]
