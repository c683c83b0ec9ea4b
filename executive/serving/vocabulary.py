"""Vocabulary of a server: the bundled ontologies and those in the operator's folders."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path

from planlang.designators import local_name
from planlang.diagnostics import BadInput, Diagnostic
from planlang.files import ONTOLOGIES, bundled
from planlang.knowledge.axioms import Axioms, axioms_of
from planlang.knowledge.names import names_in
from planlang.ontology import Ontology, load
from planlang.ontology.classes import twin
from planlang.ontology.terms import KNOWROB, SOMA
from planlang.records import dataclass

MOST_FILES = 150
"""Largest number of ontologies read from the operator's folders."""
ALIGNED = (SOMA, "http://knowrob.org/kb/urdf.owl#")
"""Namespaces of which soma.omn relates classes to KnowRob's."""


@dataclass(frozen=True, slots=True)
class Vocabulary:
    """Axioms and names that all entries share. Imports of uploads are looked up in ``folders``."""

    folders: tuple[Path, ...]
    axioms: Axioms
    names: Mapping[str, Sequence[str]]
    """IRIs by local name."""
    digest: str
    """Digest of all files read."""
    diagnostics: tuple[Diagnostic, ...] = ()
    """Errors of files that were left out."""


def read_vocabulary(folders: Sequence[Path] = ()) -> Vocabulary:
    """Read the bundled ontologies and those in ``folders``; unreadable files are left out and reported."""
    problems: list[Diagnostic] = []
    found = [path for folder in folders for path in sorted(folder.iterdir()) if path.name.endswith(ONTOLOGIES)]
    files = [path for path in found[:MOST_FILES] if _is_readable(path, folders, problems)]
    experience = bundled("ontologies") / "experience.omn"  # terms of recorded runs, which knowrob.omn does not import
    ontology = load(bundled("ontologies") / "knowrob.omn", folders=folders, also=[experience, *files])
    digest = hashlib.sha256("".join(document.sha256 for document in ontology.documents).encode())
    terms = (term for term in ontology.store.terms if isinstance(term, str))
    named = [
        iri for iri in terms if (ontology.defined(iri) or ontology.is_property(iri)) and not _has_twin(ontology, iri)
    ]
    return Vocabulary(tuple(folders), axioms_of(ontology), names_in(named), digest.hexdigest(), tuple(problems))


def _has_twin(ontology: Ontology, iri: str) -> bool:
    """Check for a term of RoboEarth or SOMA that KnowRob has under the same name, for which this name stands then."""
    other = KNOWROB + local_name(iri) if iri.startswith(ALIGNED) else twin(iri)
    return other is not None and ontology.defined(other)


def _is_readable(path: Path, folders: Sequence[Path], problems: list[Diagnostic]) -> bool:
    try:
        load(path, folders=folders, builtin=False)
    except BadInput as problem:
        problems += problem.diagnostics
        return False
    return True
