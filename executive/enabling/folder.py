"""The robot's local copy of knowledge base entries: their files, and a list with their records."""

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
from planlang.knowledge.pulling import pull
from planlang.outputs import replace
from planlang.records import dataclass

LIST = "taken.json"


@dataclass(frozen=True, slots=True)
class LocalCopy:
    """A downloaded entry, the needs that it was downloaded for, and the knowledge base that it came from."""

    found: Found
    needs: tuple[str, ...]
    source: str


@dataclass(slots=True)
class Folder:
    """A robot's folder: ``recipes``, ``environments``, ``objects`` and so on, each with one folder per entry.

    It need not exist yet. Files that are not on the list are the user's: they are neither used nor overwritten.
    """

    path: Path
    kept: dict[str, LocalCopy] = field(default_factory=dict)
    """By the entry's identifier."""

    @classmethod
    def read(cls, path: Path) -> Folder:
        """Read a folder's list; entries whose files were changed or removed are left out. Raises BadInput."""
        list_path = path / LIST
        if not list_path.is_file():
            return cls(path)
        try:
            records = as_json(read_file(list_path)).get("taken")
            kept = [_local_copy(one) for one in records] if isinstance(records, list) else []
        except NotAsAgreed:
            message = "this file does not list entries of a knowledge base"
            advice = "delete it to download everything again"
            raise BadInput([error("K041", message, Span(str(list_path)), advice)]) from None
        folder = cls(path, {one.found.entry.uid: one for one in kept})
        folder.kept = {uid: one for uid, one in folder.kept.items() if folder._is_whole(one.found.entry)}
        return folder

    def _is_whole(self, entry: Entry) -> bool:
        """Check whether all files of an entry are unchanged since the download."""
        digests = {self.file(entry): entry.revision.sha256}
        digests |= {self.file(entry).parent / one.name: one.sha256 for one in entry.attachments}
        return all(has_digest(path, sha256) for path, sha256 in digests.items())

    def file(self, entry: Entry) -> Path:
        """Path of an entry's content."""
        return self.path / entry.kind.value / entry.uid / f"{entry.uid}{entry.syntax.suffix}"

    def content(self, entry: Entry) -> bytes:
        """Content of an entry on the list. Raises BadInput if its file is missing or changed."""
        return verified(read_file(self.file(entry)), entry.revision.sha256, str(self.file(entry)))

    def take(self, taken: Iterable[tuple[Found, Iterable[str]]], shelf: Shelf) -> tuple[Path, ...]:
        """Download entries with their attachments and add them to the list; returns the paths written.

        ``taken`` pairs each entry with the needs that it meets. If one download fails, none of them is kept.
        Raises BadInput.
        """
        new = [LocalCopy(found, tuple(needs), shelf.url) for found, needs in taken]
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


def _record(kept: LocalCopy) -> dict[str, Any]:
    found = kept.found
    return {**asdict(found.entry), "links": found.links, "needs": kept.needs, "source": kept.source}


def _local_copy(record: object) -> LocalCopy:
    """Parse a record of the list. Raises NotAsAgreed."""
    values = record if isinstance(record, dict) else {}
    needs = read_as(tuple[str, ...], values.get("needs"))
    return LocalCopy(read_found(record), needs, read_as(str, values.get("source")))
