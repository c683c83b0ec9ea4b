"""The entries that a robot can have: what it keeps in its folder, and what a knowledge base offers now."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from executive.belief.recognition_models import model_files
from executive.belief.semantic_map import read_map
from executive.enabling.folder import Folder, Kept
from executive.enabling.shelf import Shelf
from planlang.designators import local_name
from planlang.diagnostics import BadInput
from planlang.knowledge.answers import Found
from planlang.knowledge.entries import Entry
from planlang.ontology import Ontology, load

MODELS = "providesModelFor"
MOST_READ = 300
"""Contents that are read for a task unless told otherwise: each takes up to a second."""


@dataclass(slots=True)
class Stock:
    """The entries of a folder and of a shelf. Contents are read once, ``limit`` of them at most.

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
    _contents: dict[str, Ontology | BadInput] = field(default_factory=dict)
    _things: dict[str, tuple[frozenset[str], frozenset[str]]] = field(default_factory=dict)

    def latest(self, kept: Kept, offered: Found | None) -> Found:
        """Return a kept entry, or what the knowledge base that it was taken from offers in its place now."""
        if offered is None or (kept.source != self.shelf.url and not _is_same(kept.found.entry, offered.entry)):
            return kept.found
        if _is_same(kept.found.entry, offered.entry):
            self.unchanged.add(offered.entry.uid)
            return kept.found
        self.renewed[offered.entry.uid] = kept.found.entry.revision.number
        return offered

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
        return f"{uid} is kept in {path}, {'unchanged' if uid in self.unchanged else f'and not offered by {url}'}"

    def may_read(self, found: Found) -> bool:
        """Return whether a content has been read, or the limit lets it be."""
        return found.entry.uid in self._contents or len(self._contents) < self.limit

    def content(self, found: Found) -> Ontology:
        """Return the ontology of an entry. Raises BadInput."""
        uid = found.entry.uid
        if uid not in self._contents:
            try:
                self._contents[uid] = self._loaded(found.entry)
            except BadInput as problem:
                if any(one.code == "K031" for one in problem.diagnostics):  # the others will not be had either
                    raise
                self._contents[uid] = problem
        known = self._contents[uid]
        if isinstance(known, BadInput):
            raise known
        return known

    def _loaded(self, entry: Entry) -> Ontology:
        data = self.folder.content(entry) if self.is_kept(entry.uid) else self.shelf.content(entry)
        return load(self.folder.file(entry), folders=self.folders, content=data)

    def things_in(self, found: Found) -> tuple[frozenset[str], frozenset[str]]:
        """Return the individuals of a map, and their classes with those above. Raises BadInput."""
        uid = found.entry.uid
        if uid not in self._things:
            ontology = self.content(found)
            things = read_map(ontology).objects
            types = {cls for thing in things for cls in thing.types}
            above = (up for cls in types for up in ontology.ancestors(cls))
            self._things[uid] = (frozenset(thing.iri for thing in things), frozenset(types.union(above)))
        return self._things[uid]

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


def _is_same(one: Entry, other: Entry) -> bool:
    return (one.revision.sha256, one.attachments) == (other.revision.sha256, other.attachments)
