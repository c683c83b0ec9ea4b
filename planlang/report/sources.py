"""Sources of plan and recipe, and the lines that steps come from."""

from __future__ import annotations

import inspect
import linecache
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field

from planlang.closure import grouped, reached
from planlang.designators import local_name
from planlang.diagnostics import BadInput
from planlang.kernel.tree import unbound
from planlang.language.source import PlanSource
from planlang.ontology import BNode, Ontology, Term
from planlang.recipe.model import Recipe, RecipeSet, Step
from planlang.records import dataclass
from planlang.report.tree import names

LONGEST = 200_000
"""Maximum length of a source in the page; a longer one is cut at the end of a line."""
_CLOSING = re.compile(r"\s*(</(?!\w*:RDF)[^>]*>|[])}.;,][])}.;,\s]*)\s*$")
"""A line that only closes a definition in RDF/XML or Turtle."""


@dataclass(frozen=True, slots=True)
class Source:
    """A file of the run: name without folders, text, and the line of each class of actions (local name)."""

    name: str
    text: str
    lines: Mapping[str, int]
    places: Mapping[str, Sequence[int]] = field(default_factory=dict)
    """For a plan: function -> lines that name ``at_location``, in order."""
    drives: Mapping[int, str] = field(default_factory=dict)
    """For a plan: line that names ``at_location`` -> class (local name) of the base motion."""
    ends: Mapping[str, int] = field(default_factory=dict)
    """For a recipe: class -> last line of its definition, which begins at its line."""

    def extent(self, cls: str) -> tuple[int, int] | None:
        """Find the first and the last line of a class."""
        line = self.lines.get(cls)
        return None if line is None else (line, self.ends.get(cls, line))


def plan_source(source: PlanSource) -> Source:
    """Read a plan with the lines of its actions, ``action(RECIPE + "GraspBottle", ...)``, and of its functions.

    If a class is performed at several lines the first is used, because a trace does not contain the line.
    """
    name, text = source.path.name, cut(source.text)
    try:
        named = [
            (one.function == "action_class", one.line, one.cls)
            for one in source.calls
            if one.function in ("action", "action_class", "plan") and one.cls
        ]
    except BadInput:  # no Python
        return Source(name, text, {})
    named += [(False, one.line, one.name) for one in source.functions]
    lines: dict[str, int] = {}
    for _, number, cls in sorted(named):  # a class that is only declared comes last
        lines.setdefault(cls, number)
    places = {one.name: one.locations for one in source.functions if one.locations}
    return Source(name, text, lines, places, drives=source.drives)


def source_of(function: object) -> Source | None:
    """Read the source of a plan function, which need not be in a file; None if it has no source."""
    code = getattr(inspect.unwrap(unbound(function)), "__code__", None) if callable(function) else None
    text = "".join(linecache.getlines(code.co_filename)) if code is not None else ""
    return plan_source(PlanSource(text, code.co_filename)) if code is not None and text else None


def cut(text: str) -> str:
    """Cut a text at the end of the last line that fits."""
    return text if len(text) <= LONGEST else text[: text.rfind("\n", 0, LONGEST) + 1] + "...\n"


def recipe_source(recipes: RecipeSet, ontology: Ontology, name: str, text: str) -> Source:
    """Read a recipe with the lines of its tasks and steps: of their definitions, else of their mention in a task.

    ``ontology`` has the file of the recipe as its main document; definitions in other files have no line.
    """
    lines: dict[str, int] = {}
    ends: dict[str, int] = {}
    defined = _definitions(ontology.alone(), text)
    for one in _described(recipes):
        cls = local_name(one.iri)
        if cls in lines:
            continue
        if one.iri in defined:
            lines[cls], ends[cls] = defined[one.iri]
        elif one.span is not None and names([one.span.file]) == names([recipes.source.file]):
            lines[cls] = one.span.line
    return Source(name, cut(text), lines, ends=ends)


def _definitions(document: Ontology, text: str) -> dict[str, tuple[int, int]]:
    """Map each name (IRI) of a document to the first and last line of its definition."""
    about: dict[Term, list[tuple[int, Term]]] = grouped(
        (triple.subject, (triple.span.line, triple.object)) for triple in document.triples()
    )
    spans = ((iri, document.span(iri)) for iri in about if isinstance(iri, str))
    begins = {iri: span.line for iri, span in spans if span is not None}
    starts, rows = sorted(set(begins.values())), text.splitlines()
    following = dict(zip(starts, [*starts[1:], len(rows) + 1], strict=True))
    extents = {}
    for iri, first in begins.items():
        last = max(line for line in _lines_about(iri, about) if first <= line < following[first])
        while last + 1 < following[first] and _CLOSING.match(rows[last]):
            last += 1
        extents[iri] = first, last
    return extents


def _lines_about(iri: str, about: Mapping[Term, Sequence[tuple[int, Term]]]) -> Iterator[int]:
    """Yield the lines of statements about a name, and about the anonymous nodes that it refers to."""

    def anonymous(node: Term) -> Iterator[Term]:
        return (value for _, value in about.get(node, ()) if isinstance(value, BNode))

    start: Term = iri
    yield from (line for node in reached((start,), anonymous) for line, _ in about.get(node, ()))


def labels_of(recipes: RecipeSet) -> dict[str, str]:
    """Labels of the recipe's tasks and steps, by the local names of their classes."""
    labels: dict[str, str] = {}
    for one in _described(recipes):
        if one.label:
            labels.setdefault(local_name(one.iri), one.label)
    return labels


def vocabulary_of(ontology: Ontology) -> dict[str, str]:
    """Labels of all classes, by their local names; the first wins if several share a name."""
    labels: dict[str, str] = {}
    for iri in ontology.class_names():
        if (label := ontology.label(iri)) is not None:
            labels.setdefault(local_name(iri), label)
    return labels


def _described(recipes: RecipeSet) -> Iterator[Recipe | Step]:
    for recipe in recipes.recipes.values():
        yield recipe
        yield from recipe.steps
