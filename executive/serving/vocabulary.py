"""The vocabulary that a server begins with: the bundled ontologies and those of the operator's folders."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from planlang.diagnostics import BadInput, Diagnostic
from planlang.files import bundled
from planlang.knowledge.axioms import Axioms, axioms_of
from planlang.knowledge.names import names_in
from planlang.ontology import Ontology, load
from planlang.ontology.classes import twin
from planlang.records import dataclass

MOST_FILES = 150
"""Ontologies of the operator's folders that are read."""
_SUFFIXES = (".omn", ".owl", ".owl.in", ".ttl", ".nt", ".rdf")


@dataclass(frozen=True, slots=True)
class Vocabulary:
    """The axioms and names that all entries share. Imports of uploads are looked for in ``folders``."""

    folders: tuple[Path, ...]
    axioms: Axioms
    names: Mapping[str, Sequence[str]]
    """Local name -> IRIs."""
    digest: str
    """Digest of everything that was read."""
    diagnostics: tuple[Diagnostic, ...] = ()
    """Notes on files that could not be read."""


def read_vocabulary(folders: Sequence[Path] = ()) -> Vocabulary:
    """Read the bundled ontologies and every file in some folders; what cannot be read is left out and reported."""
    problems: list[Diagnostic] = []
    files = [path for path in _files(folders) if _is_readable(path, folders, problems)]
    words = bundled("ontologies") / "experience.omn"  # recipes, maps and robots say nothing of what was done
    ontology = load(bundled("ontologies") / "knowrob.omn", folders=folders, also=[words, *files])
    digest = hashlib.sha256("".join(document.sha256 for document in ontology.documents).encode())
    terms = (term for term in ontology.store.terms if isinstance(term, str))
    named = [
        iri for iri in terms if (ontology.defined(iri) or ontology.is_property(iri)) and not _has_twin(ontology, iri)
    ]
    return Vocabulary(tuple(folders), axioms_of(ontology), names_in(named), digest.hexdigest(), tuple(problems))


def _has_twin(ontology: Ontology, iri: str) -> bool:
    """Return True for RoboEarth's name of what KnowRob calls the same: whoever asks for one means both."""
    other = twin(iri)
    return other is not None and ontology.defined(other)


def _files(folders: Iterable[Path]) -> list[Path]:
    found = [path for folder in folders for path in sorted(folder.iterdir()) if path.name.endswith(_SUFFIXES)]
    return found[:MOST_FILES]


def _is_readable(path: Path, folders: Sequence[Path], problems: list[Diagnostic]) -> bool:
    try:
        load(path, folders=folders, builtin=False)
    except BadInput as problem:
        problems += problem.diagnostics
        return False
    return True
