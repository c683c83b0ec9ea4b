"""``planlang list``: bundled robots, rooms and recipes; classes, actions, relations and failures that may be named."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from itertools import takewhile
from pathlib import Path
from typing import Any

import planlang.failures as failures
from executive.cli.authoring_arguments import ListArguments, Listed
from executive.cli.console import Answer, ExitCode
from executive.modules.bundled import bundled_registry
from planlang.closure import reached
from planlang.designators import local_name
from planlang.files import Bundled, bundled
from planlang.ontology import Literal, Ontology, expand, load
from planlang.ontology.terms import OWL, SOMA
from planlang.plan_failure import PlanFailure
from planlang.records import dataclass
from planlang.relations import RELATIONS
from planlang.spelling import similar

_ALIKE = 0.8
"""Minimum similarity of a suggestion: a search is often for a word that no name has, so a rhyme is no help."""
_BEFORE_WORD = re.compile(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")


@dataclass(frozen=True, slots=True)
class Entry:
    """Entry of a list: ``words`` is its label or description, ``more`` is for JSON only."""

    name: str
    words: str = ""
    more: Mapping[str, Any] | None = None
    above: tuple[str, ...] = ()
    """Keys of its parents, for trees."""
    key: str = ""
    """Unique key; the name if empty."""
    also: tuple[str, ...] = ()
    """Further names that are searched."""

    @property
    def id(self) -> str:
        return self.key or self.name

    def has(self, word: str) -> bool:
        """Check whether a word of a name or of the description begins with a word, in whatever case.

        Words of names begin with capitals, so ``bottle`` finds DrinkingBottle, but ``waving`` not MicrowavingSomething.
        """
        begins = re.compile(rf"(?<![^\W\d_]){re.escape(word)}", re.IGNORECASE)
        names = (_BEFORE_WORD.sub(" ", text) for text in (self.name, *self.also))
        return any(begins.search(text) for text in (self.name, self.words, *self.also, *names))

    def as_json(self) -> dict[str, Any]:
        """Name, words and further data."""
        return {"name": self.name, "words": self.words, **(self.more or {})}


def command(arguments: ListArguments) -> Answer:
    """List entries of a kind; exit code 1 if none has the word."""
    kind, word = arguments.kind, arguments.word
    entries = _LISTS[kind]()
    matching = [one for one in entries if word is None or one.has(word)]
    data = {"kind": kind.value, "entries": [one.as_json() for one in matching]}
    if not matching:
        folded = {called.casefold(): one.name for one in entries for called in (*one.also, one.name)}
        alike = similar((word or "").casefold(), folded, least=_ALIKE)
        advice = f"; did you mean {folded[alike[0]]}?" if alike else ""
        text = f"none of the {len(entries)} {kind.value} has a word that begins with {word!r}{advice}"
        return Answer(ExitCode.FAILED, text=text, data=data)
    if kind in (Listed.CLASSES, Listed.FAILURES):
        lines = tree(entries, {one.id for one in matching}, mark="" if word is None else "* ")
    else:
        lines = table(matching, verbose=arguments.verbose)
    return Answer(text="\n".join(lines), data=data)


# Entries


def files(kind: Bundled, folder: Path | None = None) -> list[Entry]:
    """Bundled files of a kind by name, with the first sentence of each; then the files in ``folder``."""
    named = [(name, kind.find(name)) for name in kind.names()]
    if folder is not None:
        named += [(f"{folder.name}/{path.stem}", path) for path in sorted(folder.glob("*.omn"))]
    return [Entry(name, opening(path), {"file": str(path)}) for name, path in named]


def opening(path: Path) -> str:
    """First sentence of the comment at the top of a file; "" without one."""
    with path.open(encoding="utf-8") as file:
        comment = [line.removeprefix("#").strip() for line in takewhile(lambda line: line.startswith("# "), file)]
    return sentence(" ".join(comment))


def sentence(text: str) -> str:
    """First sentence of a text, without its full stop."""
    return re.split(r"\.(?:\s|$)", " ".join(text.replace("``", "").split()), maxsplit=1)[0]


def classes() -> list[Entry]:
    """Classes of the bundled vocabulary and of SOMA, by name; one of SOMA that KnowRob has is another name."""
    ontology = load(bundled("ontologies") / "knowrob.omn", also=[bundled("ontologies") / "soma.omn"])
    also: dict[str, list[str]] = {}
    for triple in ontology.triples(p=expand("alsoCalled")):
        if isinstance(triple.object, Literal):
            also.setdefault(str(triple.subject), []).append(triple.object.value)
    equal = ((str(one.subject), str(one.object)) for one in ontology.triples(p=OWL.equivalentClass))
    same = {cls: other for cls, other in equal if cls.startswith(SOMA)}
    for cls, other in same.items():
        also.setdefault(other, []).append(f"soma:{local_name(cls)}")
    named = {iri for iri in ontology.class_names() if ontology.defined(iri) and iri not in same}
    entries = [_class(ontology, iri, named, also.get(iri, ()), same) for iri in named]
    return sorted(entries, key=lambda one: (one.name.casefold(), one.id))


def _class(ontology: Ontology, iri: str, known: Collection[str], also: Sequence[str], same: Mapping[str, str]) -> Entry:
    above = dict.fromkeys(same.get(one, one) for one in ontology.parents(iri))
    label, parents = ontology.label(iri) or "", [one for one in above if one in known and one != iri]
    names = tuple(sorted(also))
    words = ", ".join(filter(None, (label, *(f"also called {name}" for name in names))))
    more = {"iri": iri, "label": label, "also_called": list(names), "below": parents}
    name = local_name(iri)
    return Entry(f"soma:{name}" if iri.startswith(SOMA) else name, words, more, tuple(parents), iri, names)


def actions() -> list[Entry]:
    """Action classes that bundled process modules perform, with their labels, by name."""
    ontology = load(bundled("ontologies") / "primitives.omn")
    return [Entry(name, ontology.label(expand(name)) or "") for name in sorted(bundled_registry().actions)]


def relations() -> list[Entry]:
    """Location relations, in the order of their table."""
    return [
        Entry(
            " | ".join(one.forms),
            f"{local_name(one.owl)}, {one.name}",
            {"forms": list(one.forms), "owl": expand(one.owl), "python": one.name, "synonyms": list(one.synonyms)},
        )
        for one in dict.fromkeys(RELATIONS.values())
    ]


def plan_failures() -> list[Entry]:
    """Plan failures in the order of their module, each with its first sentence."""
    kinds = [PlanFailure, *(one for one in vars(failures).values() if _is_failure(one))]
    return [
        Entry(
            one.__name__,
            sentence(inspect.cleandoc(one.__doc__ or "")),
            {"below": [above.__name__ for above in one.__bases__ if _is_failure(above) or above is PlanFailure]},
            tuple(above.__name__ for above in one.__bases__),
        )
        for one in dict.fromkeys(kinds)
    ]


def _is_failure(value: object) -> bool:
    return isinstance(value, type) and issubclass(value, PlanFailure) and value is not PlanFailure


_LISTS: Mapping[Listed, Callable[[], list[Entry]]] = {
    Listed.ROBOTS: lambda: files(Bundled.ROBOT),
    Listed.ROOMS: lambda: files(Bundled.ENVIRONMENT),
    Listed.RECIPES: lambda: files(Bundled.RECIPE, bundled("recipes") / "library"),
    Listed.CLASSES: classes,
    Listed.ACTIONS: actions,
    Listed.RELATIONS: relations,
    Listed.FAILURES: plan_failures,
}


# Output


def table(entries: Sequence[Entry], *, verbose: bool) -> Iterator[str]:
    """Yield a line for each entry: name, words, and if ``verbose`` its file if there is one."""
    wide = max(len(one.name) for one in entries)
    for one in entries:
        file = (one.more or {}).get("file") if verbose else None
        yield "  ".join(filter(None, (f"{one.name:{wide}}", one.words, f"({file})" if file else ""))).rstrip()


def tree(entries: Sequence[Entry], matching: Collection[str], *, mark: str = "") -> Iterator[str]:
    """Yield matching entries with their ancestors and descendants as a tree; ``...`` marks a repeated subtree.

    The lines of matching entries begin with ``mark``, the others are indented by as much.
    """
    by_id = {one.id: one for one in entries}
    below: dict[str, list[Entry]] = {}
    for one in entries:
        for above in one.above:
            below.setdefault(above, []).append(one)
    shown = {*reached(matching, lambda id: [one.id for one in below.get(id, ())])}
    shown.update(reached(matching, lambda id: [above for above in by_id[id].above if above in by_id]))
    drawn: set[str] = set()

    def lines(one: Entry, depth: int) -> Iterator[str]:
        inside = [other for other in below.get(one.id, ()) if other.id in shown]
        is_repeated = bool(inside) and one.id in drawn
        drawn.add(one.id)
        margin = mark if one.id in matching else " " * len(mark)
        yield f"{margin}{'  ' * depth}{one.name}{' ...' if is_repeated else ''}{one.words and '  '}{one.words}"
        for other in () if is_repeated else inside:
            yield from lines(other, depth + 1)

    for one in entries:
        if one.id in shown and not any(above in by_id for above in one.above):
            yield from lines(one, 0)
