"""The folder in which a robot keeps what it took from a knowledge base: the files, and a list of what they are."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from hashlib import sha256
from pathlib import Path
from typing import Any

from executive.enabling.shelf import Shelf, verified
from planlang.diagnostics import BadInput, Span, error
from planlang.files import read_file
from planlang.knowledge.answers import Found, NotAsAgreed, as_json, read_as, read_found
from planlang.knowledge.entries import Entry, Syntax
from planlang.knowledge.pulled import Origin, check_bounds, record

LIST = "taken.json"
_SUFFIXES = {Syntax.RDFXML: ".owl", Syntax.TURTLE: ".ttl", Syntax.MANCHESTER: ".omn"}


@dataclass(frozen=True, slots=True)
class Kept:
    """An entry that was taken: for which needs, from where."""

    found: Found
    needs: tuple[str, ...]
    source: str


@dataclass(slots=True)
class Folder:
    """A robot's folder: ``recipes``, ``environments``, ``objects`` and others with files, and the list beside them.

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
        return self.path / entry.kind.value / f"{entry.uid}{_SUFFIXES[entry.syntax]}"

    def content(self, entry: Entry) -> bytes:
        """Return the content of a kept entry. Raises BadInput if it is not there, or not what was taken."""
        return verified(read_file(self.file(entry)), entry.revision.sha256, str(self.file(entry)))

    def take(self, found: Found, needs: Iterable[str], shelf: Shelf) -> tuple[Path, ...]:
        """Download an entry with its files, and list it; returns what was written. Raises BadInput, OSError."""
        entry = found.entry
        check_bounds(entry)
        beside = self.path / entry.kind.value / entry.uid
        files = {beside / one.name: shelf.attachment(entry, one) for one in entry.attachments}
        files[self.file(entry)] = shelf.content(entry)
        for path, data in files.items():
            self._write(path, data, is_own=entry.uid in self.kept)
            origin = Origin(shelf.name, entry.uid, entry.author, entry.revision.number, sha256(data).hexdigest())
            record(path.parent, {path.name: origin}, force=True)
        self.kept[entry.uid] = Kept(found, tuple(needs), shelf.name)
        records = [_record(self.kept[uid]) for uid in sorted(self.kept)]
        text = json.dumps({"taken": records}, indent=1, ensure_ascii=False) + "\n"
        self._write(self.path / LIST, text.encode(), is_own=True)
        return tuple(files)

    def _write(self, path: Path, data: bytes, *, is_own: bool) -> None:
        """Write a file, whole or not at all. Raises BadInput for one that is somebody else's, or cannot be written."""
        if path.exists() and not is_own and (path.is_dir() or path.read_bytes() != data):
            raise BadInput([error("C004", f"{path} is there already", help="move it, or name another folder")])
        unfinished = path.with_name(f".{path.name}.part")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            unfinished.write_bytes(data)
            unfinished.replace(path)
        except OSError as problem:
            raise BadInput([error("C004", f"{path} cannot be written: {problem.strerror or problem}")]) from None


def _record(kept: Kept) -> dict[str, Any]:
    found = kept.found
    return {**asdict(found.entry), "links": found.links, "needs": kept.needs, "source": kept.source}


def _kept(record: object) -> Kept:
    """Return what a record is of. Raises NotAsAgreed."""
    stated = record if isinstance(record, dict) else {}
    needs = read_as(tuple[str, ...], stated.get("needs"))
    return Kept(read_found(record), needs, read_as(str, stated.get("source")))
