"""The folder in which a robot keeps what it took from a knowledge base: the files, and a list of what they are."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from executive.enabling.shelf import Shelf, verified
from planlang.diagnostics import BadInput, Span, error
from planlang.files import read_file
from planlang.knowledge.answers import Found, NotAsAgreed, as_json, read_as, read_found
from planlang.knowledge.entries import Entry
from planlang.knowledge.pulling import SUFFIXES, pull
from planlang.outputs import replace

LIST = "taken.json"


@dataclass(frozen=True, slots=True)
class Kept:
    """An entry that was taken: for which needs, from where."""

    found: Found
    needs: tuple[str, ...]
    source: str


@dataclass(slots=True)
class Folder:
    """A robot's folder: ``recipes``, ``environments``, ``objects`` and others, in each a folder for every entry.

    It need not be there yet. What is there and not on the list is nobody's: it is neither used nor replaced.
    """

    path: Path
    kept: dict[str, Kept] = field(default_factory=dict)
    """By identifier."""

    @classmethod
    def read(cls, path: Path) -> Folder:
        """Return a folder as its list says. Raises BadInput for a list that is none."""
        listed = path / LIST
        if not listed.is_file():
            return cls(path)
        try:
            records = as_json(read_file(listed)).get("taken")
            kept = [_kept(one) for one in records] if isinstance(records, list) else []
        except NotAsAgreed:
            message = "this is no list of what a robot took from a knowledge base"
            raise BadInput([error("K041", message, Span(str(listed)), "remove it to take everything anew")]) from None
        return cls(path, {one.found.entry.uid: one for one in kept})

    def file(self, entry: Entry) -> Path:
        """Return the file of an entry's content."""
        return self.path / entry.kind.value / entry.uid / f"{entry.uid}{SUFFIXES[entry.syntax]}"

    def content(self, entry: Entry) -> bytes:
        """Return the content of a kept entry. Raises BadInput if it is not there, or not what was taken."""
        return verified(read_file(self.file(entry)), entry.revision.sha256, str(self.file(entry)))

    def take(self, found: Found, needs: Iterable[str], shelf: Shelf) -> tuple[Path, ...]:
        """Download an entry with its files, and list it; returns what was written. Raises BadInput."""
        entry = found.entry
        try:
            files = pull(shelf, entry, self.file(entry).parent)
        except NotAsAgreed as problem:
            raise BadInput([error("K032", f"{shelf.url}: {problem}")]) from None
        self.kept[entry.uid] = Kept(found, tuple(needs), shelf.url)
        records = [_record(self.kept[uid]) for uid in sorted(self.kept)]
        text = json.dumps({"taken": records}, indent=1, ensure_ascii=False) + "\n"
        replace(self.path / LIST, lambda unfinished: unfinished.write_text(text, encoding="utf-8"))
        return files


def _record(kept: Kept) -> dict[str, Any]:
    found = kept.found
    return {**asdict(found.entry), "links": found.links, "needs": kept.needs, "source": kept.source}


def _kept(record: object) -> Kept:
    """Return what a record is of. Raises NotAsAgreed."""
    stated = record if isinstance(record, dict) else {}
    needs = read_as(tuple[str, ...], stated.get("needs"))
    return Kept(read_found(record), needs, read_as(str, stated.get("source")))
