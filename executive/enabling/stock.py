"""Entries available to a robot: local copies in its folder, and those that a knowledge base offers now.

The folder has the files of the copies, and a list with their records.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import asdict, field
from pathlib import Path
from typing import Any

from executive.enabling.shelf import Shelf, verified
from executive.maps.recognition_models import model_files
from executive.maps.semantic_map import read_map
from planlang.designators import local_name
from planlang.diagnostics import BadInput, Span, error
from planlang.files import read_file
from planlang.knowledge.answers import Found, NotAsAgreed, as_json, read_as, read_found
from planlang.knowledge.entries import Entry
from planlang.knowledge.pulled import has_digest
from planlang.knowledge.pulling import pull
from planlang.ontology import Ontology, load_apart
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


MODELS = "providesModelFor"
MOST_READ = 300
"""Default limit of recipes and maps read for a task: each takes up to a second."""


@dataclass(slots=True)
class Stock:
    """The entries of a folder and of a knowledge base. At most ``limit`` contents are read.

    ``folders`` contain the ontologies that entries import.
    """

    shelf: Shelf
    folder: Folder
    folders: tuple[Path, ...] = ()
    limit: int = MOST_READ
    ignore_unread: bool = False
    """Use maps of which something cannot be read."""
    found: dict[str, Found] = field(default_factory=dict)
    """Entries that were offered, by identifier."""
    unchanged: set[str] = field(default_factory=set)
    """Identifiers of local copies that equal the knowledge base's current revision."""
    renewed: dict[str, int] = field(default_factory=dict)
    """Local copies with a newer revision in the knowledge base: the local revision by identifier."""
    passed_over: dict[str, int] = field(default_factory=dict)
    """Newer revisions that are not used because they need something missing, by identifier."""
    _read: set[str] = field(default_factory=set)
    _failed: dict[str, BadInput] = field(default_factory=dict)
    _classes: dict[str, frozenset[str]] = field(default_factory=dict)

    def latest(self, offered: Found) -> Found:
        """Choose between an offered entry and its local copy, which only its own knowledge base can update."""
        uid = offered.entry.uid
        kept = self.folder.kept.get(uid)
        if kept is None:
            return offered
        local = kept.found.entry
        if (local.revision.sha256, local.attachments) == (offered.entry.revision.sha256, offered.entry.attachments):
            self.unchanged.add(uid)
        elif kept.source == self.shelf.url and uid not in self.passed_over:
            self.renewed[uid] = local.revision.number
            return offered
        return kept.found

    def pass_over(self) -> None:
        """Keep all local copies, although the knowledge base has newer revisions."""
        self.passed_over |= {uid: self.found[uid].entry.revision.number for uid in self.renewed if uid in self.found}
        self.renewed.clear()
        self._failed.clear()
        self._classes.clear()

    def is_kept(self, uid: str) -> bool:
        """Check whether the local copy of an entry is used, so that it need not be downloaded."""
        return uid in self.folder.kept and uid not in self.renewed

    def provenance(self, uid: str) -> str:
        """Describe where an entry comes from."""
        url, path = self.shelf.url, self.folder.path
        if uid in self.renewed:
            now = self.found[uid].entry.revision.number
            return f"{uid} is updated from {url}: revision {now} replaces {self.renewed[uid]}"
        if not self.is_kept(uid):
            return f"{uid} is taken from {url}"
        if uid in self.passed_over:
            return f"{uid} is kept in {path}: revision {self.passed_over[uid]} of {url} cannot be used"
        return f"{uid} is kept in {path}, {'unchanged' if uid in self.unchanged else f'and not offered by {url}'}"

    def may_read(self, found: Found) -> bool:
        """Check whether a content has been read already or the limit allows for one more."""
        return found.entry.uid in self._read or len(self._read) < self.limit

    def content(self, found: Found) -> Ontology:
        """Load the ontology of an entry. Raises BadInput."""
        entry = found.entry
        self._read.add(entry.uid)
        if entry.uid in self._failed:
            raise self._failed[entry.uid]
        try:
            data = self.folder.content(entry) if self.is_kept(entry.uid) else self.shelf.content(entry)
            return load_apart(self.folder.file(entry), folders=self.folders, content=data)
        except BadInput as problem:
            self._failed[entry.uid] = problem
            raise

    def classes_in(self, found: Found) -> frozenset[str]:
        """Classes of the things in a map, with their superclasses. Raises BadInput."""
        uid = found.entry.uid
        if uid not in self._classes:
            ontology = self.content(found)
            environment = read_map(ontology, ignore_unread=self.ignore_unread)
            types = {cls for thing in environment.objects for cls in thing.types}
            self._classes[uid] = frozenset(types.union(up for cls in types for up in ontology.ancestors(cls)))
        return self._classes[uid]

    def damage(self, uid: str) -> str | None:
        """Explain why a recognition model cannot be used: a file of it is missing. None for everything else."""
        found = self.found[uid]
        if not any(local_name(prop) == MODELS for prop, _ in found.links):
            return None
        try:
            files = model_files(self.content(found), found.entry.about)
        except BadInput as problem:
            return unusable(problem)
        attached = {one.name for one in found.entry.attachments}
        lacking = [name for name in files if name not in attached]
        return f"files of the model are not attached: {', '.join(lacking)}" if lacking else None


def unusable(problem: BadInput) -> str:
    """Explain why an entry is refused. Raises the problem again if the knowledge base does not answer (K031)."""
    if any(one.code == "K031" for one in problem.diagnostics):
        raise problem
    return f"it cannot be used: {problem.diagnostics[0].message}"
