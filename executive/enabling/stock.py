"""The entries that a robot can have: what it keeps in its folder, and what a knowledge base offers now."""

from __future__ import annotations

from dataclasses import field
from pathlib import Path

from executive.enabling.folder import Folder
from executive.enabling.shelf import Shelf
from executive.maps.recognition_models import model_files
from executive.maps.semantic_map import read_map
from planlang.designators import local_name
from planlang.diagnostics import BadInput
from planlang.knowledge.answers import Found
from planlang.ontology import Ontology, load
from planlang.records import dataclass

MODELS = "providesModelFor"
MOST_READ = 300
"""Contents that are read for a task unless told otherwise: each takes up to a second."""


@dataclass(slots=True)
class Stock:
    """The entries of a folder and of a shelf. Contents of ``limit`` of them are read at most.

    ``folders`` have ontologies that entries import.
    """

    shelf: Shelf
    folder: Folder
    folders: tuple[Path, ...] = ()
    limit: int = MOST_READ
    found: dict[str, Found] = field(default_factory=dict)
    """Entries that were offered, by identifier."""
    unchanged: set[str] = field(default_factory=set)
    """Entries that are kept as the knowledge base has them now."""
    renewed: dict[str, int] = field(default_factory=dict)
    """Entries of which the knowledge base has a newer revision, with the one that is kept so far."""
    passed_over: dict[str, int] = field(default_factory=dict)
    """Newer revisions that are not taken, as they need what is missing."""
    _read: set[str] = field(default_factory=set)
    _failed: dict[str, BadInput] = field(default_factory=dict)
    _classes: dict[str, frozenset[str]] = field(default_factory=dict)

    def latest(self, offered: Found) -> Found:
        """Return what is offered, or what is kept in its place: the same, or of another knowledge base."""
        uid = offered.entry.uid
        kept = self.folder.kept.get(uid)
        if kept is None:
            return offered
        before = kept.found.entry
        if (before.revision.sha256, before.attachments) == (offered.entry.revision.sha256, offered.entry.attachments):
            self.unchanged.add(uid)
        elif kept.source == self.shelf.url and uid not in self.passed_over:
            self.renewed[uid] = before.revision.number
            return offered
        return kept.found

    def pass_over(self) -> None:
        """Leave what is kept as it is, although the knowledge base has newer revisions."""
        self.passed_over |= {uid: self.found[uid].entry.revision.number for uid in self.renewed if uid in self.found}
        self.renewed.clear()
        self._failed.clear()
        self._classes.clear()

    def is_kept(self, uid: str) -> bool:
        """Return whether an entry need not be taken."""
        return uid in self.folder.kept and uid not in self.renewed

    def said_of(self, uid: str) -> str:
        """Return where an entry is had from, in words."""
        url, path = self.shelf.url, self.folder.path
        if uid in self.renewed:
            now = self.found[uid].entry.revision.number
            return f"{uid} is renewed from {url}: revision {now} in the place of {self.renewed[uid]}"
        if not self.is_kept(uid):
            return f"{uid} is taken from {url}"
        if uid in self.passed_over:
            return f"{uid} is kept in {path}: revision {self.passed_over[uid]} of {url} cannot be used"
        return f"{uid} is kept in {path}, {'unchanged' if uid in self.unchanged else f'and not offered by {url}'}"

    def may_read(self, found: Found) -> bool:
        """Return whether a content has been read, or the limit lets it be."""
        return found.entry.uid in self._read or len(self._read) < self.limit

    def content(self, found: Found) -> Ontology:
        """Return the ontology of an entry. Raises BadInput."""
        entry = found.entry
        self._read.add(entry.uid)
        if entry.uid in self._failed:
            raise self._failed[entry.uid]
        try:
            data = self.folder.content(entry) if self.is_kept(entry.uid) else self.shelf.content(entry)
            return load(self.folder.file(entry), folders=self.folders, content=data)
        except BadInput as problem:
            self._failed[entry.uid] = problem
            raise

    def classes_in(self, found: Found) -> frozenset[str]:
        """Return the classes of the things in a map, with those above. Raises BadInput."""
        uid = found.entry.uid
        if uid not in self._classes:
            ontology = self.content(found)
            types = {cls for thing in read_map(ontology).objects for cls in thing.types}
            self._classes[uid] = frozenset(types.union(up for cls in types for up in ontology.ancestors(cls)))
        return self._classes[uid]

    def damage(self, uid: str) -> str | None:
        """Return why a recognition model cannot be used: its file is not with it. None for anything else."""
        found = self.found[uid]
        if not any(local_name(prop) == MODELS for prop, _ in found.links):
            return None
        try:
            files = model_files(self.content(found), found.entry.about)
        except BadInput as problem:
            return unusable(problem)
        there = {one.name for one in found.entry.attachments}
        lacking = [name for name in files if name not in there]
        return f"the file of the model is not with it: {', '.join(lacking)}" if lacking else None


def unusable(problem: BadInput) -> str:
    """Return why an entry is refused. Raises the problem again where the knowledge base is gone."""
    if any(one.code == "K031" for one in problem.diagnostics):
        raise problem
    return f"it cannot be used: {problem.diagnostics[0].message}"
