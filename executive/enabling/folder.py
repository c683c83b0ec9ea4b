"""The folder in which a robot keeps what it took from a knowledge base: the files, and a list of what they are."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from executive.enabling.shelf import Found, Shelf, verified
from planlang.diagnostics import BadInput, Span, error
from planlang.files import read_file
from planlang.knowledge.entries import Attachment, Entry, Kind, Revision, Syntax

LIST = "taken.json"
_UID = re.compile(r"[a-z0-9][a-z0-9_-]{0,99}\.[a-z0-9][a-z0-9_-]{0,99}")
_FILE = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,199}")
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
            records = json.loads(read_file(listed))
            kept = [_kept(one) for one in records]
        except (ValueError, KeyError, TypeError, AttributeError):
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
        _check_names(entry)
        files = {self.file(entry): shelf.content(entry)}
        beside = self.path / entry.kind.value / entry.uid
        for one in entry.attachments:
            files[beside / one.name] = shelf.attachment(entry, one)
        for path, data in files.items():
            self._write(path, data, is_own=entry.uid in self.kept)
        self.kept[entry.uid] = Kept(found, tuple(needs), shelf.name)
        records = [asdict(self.kept[uid]) for uid in sorted(self.kept)]
        text = json.dumps(records, indent=1, ensure_ascii=False) + "\n"
        self._write(self.path / LIST, text.encode(), is_own=True)
        return tuple(files)

    def _write(self, path: Path, data: bytes, *, is_own: bool) -> None:
        """Write a file, whole or not at all. Raises BadInput for one that is somebody else's, or cannot be written."""
        if path.exists() and not is_own:
            raise BadInput([error("C004", f"{path} is there already", help="move it, or name another folder")])
        unfinished = path.with_name(f".{path.name}.part")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            unfinished.write_bytes(data)
            unfinished.replace(path)
        except OSError as problem:
            raise BadInput([error("C004", f"{path} cannot be written: {problem.strerror or problem}")]) from None


def _check_names(entry: Entry) -> None:
    """Raise BadInput for an entry that names files outside the folder: a knowledge base may be a stranger's."""
    for name, form in ((entry.uid, _UID), *((one.name, _FILE) for one in entry.attachments)):
        if not form.fullmatch(name):
            raise BadInput([error("K042", f"{name[:80]!r} is no name of an entry or of a file")])


def _kept(data: Any) -> Kept:
    record = dict(data["found"]["entry"])
    record["kind"], record["syntax"] = Kind(record["kind"]), Syntax(record["syntax"])
    record["revision"] = Revision(**record["revision"])
    record["attachments"] = tuple(Attachment(**one) for one in record["attachments"])
    links = tuple((str(prop), str(target)) for prop, target in data["found"]["links"])
    return Kept(Found(Entry(**record), links), tuple(map(str, data["needs"])), str(data["source"]))
