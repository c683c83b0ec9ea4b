"""``planlang list``: what there is to name: robots, rooms, recipes, classes, relations and failures."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from itertools import takewhile
from pathlib import Path
from typing import Any

from executive.cli.arguments import ListArguments, Listed
from executive.commands.answers import Answer, ExitCode
from planlang import failures
from planlang.closure import reached
from planlang.designators import local_name
from planlang.files import Bundled, bundled
from planlang.ontology import Literal, Ontology, expand, load
from planlang.plan_failure import PlanFailure
from planlang.records import dataclass
from planlang.relations import RELATIONS
from planlang.spelling import guess


@dataclass(frozen=True, slots=True)
class Entry:
    """Something that can be named: ``words`` are its label or its description, ``more`` is for JSON only."""

    name: str
    words: str = ""
    more: Mapping[str, Any] | None = None
    above: tuple[str, ...] = ()
    """Keys of the entries that it is below, for trees."""
    key: str = ""
    """What tells it from all others; its name if that does."""
    also: tuple[str, ...] = ()
    """Other names that it is found by."""

    @property
    def id(self) -> str:
        return self.key or self.name

    def has(self, word: str) -> bool:
        """Return True if a word, in whatever case, is in a name or in the description."""
        wanted = word.casefold()
        return any(wanted in text.casefold() for text in (self.name, self.words, *self.also))

    def as_json(self) -> dict[str, Any]:
        """Return name, words and what else is known."""
        return {"name": self.name, "words": self.words, **(self.more or {})}


def command(arguments: ListArguments) -> Answer:
    """List what was asked for; exit code 1 if a word is in none of it."""
    kind, word = arguments.kind, arguments.word
    entries = _LISTS[kind]()
    found = [one for one in entries if word is None or one.has(word)]
    data = {"kind": kind.value, "entries": [one.as_json() for one in found]}
    if not found:
        advice = guess(word or "", (one.name for one in entries))
        text = (
            f"none of the {len(entries)} {kind.value} has {word!r} in its name or description{advice and '; '}{advice}"
        )
        return Answer(ExitCode.FAILED, text=text.rstrip(), data=data)
    is_tree = kind in (Listed.CLASSES, Listed.FAILURES)
    lines = tree(entries, {one.id for one in found}) if is_tree else table(found)
    return Answer(text="\n".join(lines), data=data)


# What is listed


def files(kind: Bundled, folder: Path | None = None) -> list[Entry]:
    """Return the bundled files of a kind, by name, with the first sentence of each; those below ``folder`` follow."""
    named = [(name, kind.find(name)) for name in kind.names()]
    if folder is not None:
        named += [(f"{folder.name}/{path.stem}", path) for path in sorted(folder.glob("*.omn"))]
    return [Entry(name, opening(path), {"file": str(path)}) for name, path in named]


def opening(path: Path) -> str:
    """Return the first sentence of the comment that a file begins with, "" if it begins otherwise."""
    with path.open(encoding="utf-8") as file:
        comment = [line.removeprefix("#").strip() for line in takewhile(lambda line: line.startswith("# "), file)]
    return sentence(" ".join(comment))


def sentence(text: str) -> str:
    """Return the first sentence of a text, without its end."""
    return re.split(r"\.(?:\s|$)", " ".join(text.replace("``", "").split()), maxsplit=1)[0]


def classes() -> list[Entry]:
    """Return the classes of the bundled vocabulary, by name."""
    ontology = load(bundled("ontologies") / "knowrob.omn")
    also: dict[str, list[str]] = {}
    for triple in ontology.triples(p=expand("alsoCalled")):
        if isinstance(triple.object, Literal):
            also.setdefault(str(triple.subject), []).append(triple.object.value)
    named = {iri for iri in ontology.class_names() if ontology.defined(iri)}
    found = [_class(ontology, iri, named, also.get(iri, ())) for iri in named]
    return sorted(found, key=lambda one: (one.name.casefold(), one.id))


def _class(ontology: Ontology, iri: str, known: Collection[str], also: Sequence[str]) -> Entry:
    label, parents = ontology.label(iri) or "", [one for one in ontology.parents(iri) if one in known]
    names = tuple(sorted(also))
    words = ", ".join(filter(None, (label, *(f"also called {name}" for name in names))))
    more = {"iri": iri, "label": label, "also_called": list(names), "below": parents}
    return Entry(local_name(iri), words, more, tuple(parents), iri)


def relations() -> list[Entry]:
    """Return the relations of locations, in the order of their table."""
    return [
        Entry(
            " | ".join(one.forms),
            f"{local_name(one.owl)}, {one.name}",
            {"forms": list(one.forms), "owl": expand(one.owl), "python": one.name, "synonyms": list(one.synonyms)},
        )
        for one in dict.fromkeys(RELATIONS.values())
    ]


def plan_failures() -> list[Entry]:
    """Return the failures of plans, in the order of their module, each with its first sentence."""
    found = [PlanFailure, *(one for one in vars(failures).values() if _is_failure(one))]
    return [
        Entry(
            one.__name__,
            sentence(inspect.cleandoc(one.__doc__ or "")),
            {"below": [above.__name__ for above in one.__bases__ if _is_failure(above) or above is PlanFailure]},
            tuple(above.__name__ for above in one.__bases__),
        )
        for one in dict.fromkeys(found)
    ]


def _is_failure(value: object) -> bool:
    return isinstance(value, type) and issubclass(value, PlanFailure) and value is not PlanFailure


_LISTS: Mapping[Listed, Callable[[], list[Entry]]] = {
    Listed.ROBOTS: lambda: files(Bundled.ROBOT),
    Listed.ROOMS: lambda: files(Bundled.ENVIRONMENT),
    Listed.RECIPES: lambda: files(Bundled.RECIPE, bundled("recipes") / "library"),
    Listed.CLASSES: classes,
    Listed.RELATIONS: relations,
    Listed.FAILURES: plan_failures,
}


# How it is shown


def table(entries: Sequence[Entry]) -> Iterator[str]:
    """Yield a line for each entry: name, words, and the file if it is one."""
    wide = max(len(one.name) for one in entries)
    for one in entries:
        file = (one.more or {}).get("file")
        yield "  ".join(filter(None, (f"{one.name:{wide}}", one.words, f"({file})" if file else ""))).rstrip()


def tree(entries: Sequence[Entry], wanted: Collection[str]) -> Iterator[str]:
    """Yield what was found with all that it is below and all below it, as a tree; what is repeated ends in ``...``."""
    known = {one.id: one for one in entries}
    below: dict[str, list[Entry]] = {}
    for one in entries:
        for above in one.above:
            below.setdefault(above, []).append(one)
    shown = {*reached(wanted, lambda id: [one.id for one in below.get(id, ())])}
    shown.update(reached(wanted, lambda id: [above for above in known[id].above if above in known]))
    drawn: set[str] = set()

    def lines(one: Entry, depth: int) -> Iterator[str]:
        inside = [other for other in below.get(one.id, ()) if other.id in shown]
        is_repeated = bool(inside) and one.id in drawn
        drawn.add(one.id)
        yield f"{'  ' * depth}{one.name}{' ...' if is_repeated else ''}{one.words and '  '}{one.words}"
        for other in () if is_repeated else inside:
            yield from lines(other, depth + 1)

    for one in entries:
        if one.id in shown and not any(above in known for above in one.above):
            yield from lines(one, 0)
