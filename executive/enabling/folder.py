"""The folder in which a robot keeps what it took from a knowledge base: the files, and a list of what they are."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import asdict, field
from pathlib import Path
from typing import Any

from executive.enabling.shelf import Shelf, verified
from planlang.diagnostics import BadInput, Span, error
from planlang.files import read_file
from planlang.knowledge.answers import Found, NotAsAgreed, as_json, read_as, read_found
from planlang.knowledge.entries import Entry
from planlang.knowledge.pulled import has_digest
from planlang.knowledge.pulling import SUFFIXES, pull
from planlang.outputs import replace
from planlang.records import dataclass

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
        folder = cls(path, {one.found.entry.uid: one for one in kept})
        folder.kept = {uid: one for uid, one in folder.kept.items() if folder._is_whole(one.found.entry)}
        return folder

    def _is_whole(self, entry: Entry) -> bool:
        """Return whether all files of an entry are as they were taken."""
        digests = {self.file(entry): entry.revision.sha256}
        digests |= {self.file(entry).parent / one.name: one.sha256 for one in entry.attachments}
        return all(has_digest(path, sha256) for path, sha256 in digests.items())

    def file(self, entry: Entry) -> Path:
        """Return the file of an entry's content."""
        return self.path / entry.kind.value / entry.uid / f"{entry.uid}{SUFFIXES[entry.syntax]}"

    def content(self, entry: Entry) -> bytes:
        """Return the content of a kept entry. Raises BadInput if it is not there, or not what was taken."""
        return verified(read_file(self.file(entry)), entry.revision.sha256, str(self.file(entry)))

    def take(self, taken: Iterable[tuple[Found, Iterable[str]]], shelf: Shelf) -> tuple[Path, ...]:
        """Download entries with their files, and list them with the needs that each is for; returns what was written.

        All of them, or none if one cannot be had. Raises BadInput.
        """
        new = [Kept(found, tuple(needs), shelf.url) for found, needs in taken]
        entries = [(one.found.entry, self.file(one.found.entry).parent) for one in new]
        try:
            files = pull(shelf, entries)
        except NotAsAgreed as problem:
            raise BadInput([error("K032", f"{shelf.url}: {problem}")]) from None
        if new:
            self.kept.update((one.found.entry.uid, one) for one in new)
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
