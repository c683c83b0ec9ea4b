"""RDF terms, triples with positions, the names of the W3C and KnowRob vocabularies, and references made absolute."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import cache, lru_cache
from urllib.parse import urljoin

from planlang.designators import local_name
from planlang.diagnostics import Span
from planlang.resources import bundled

_SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*:")


def resolve(base: str, reference: str) -> str:
    """Return the IRI that a reference means in a document with this address; an IRI with a scheme is left as it is."""
    if reference.startswith("#"):
        return base.partition("#")[0] + reference
    if not reference:
        return base.partition("#")[0]
    if _SCHEME.match(reference):
        return reference
    try:
        joined = urljoin(base, reference)
    except ValueError:
        return reference
    return joined + "#" if reference.endswith("#") and not joined.endswith("#") else joined  # urljoin drops it


RDF = "http://www.w3.org/1999/02/22-rdf-syntax-ns#"
RDFS = "http://www.w3.org/2000/01/rdf-schema#"
OWL = "http://www.w3.org/2002/07/owl#"
XSD = "http://www.w3.org/2001/XMLSchema#"

TYPE = RDF + "type"
FIRST = RDF + "first"
REST = RDF + "rest"
NIL = RDF + "nil"
LANG_STRING = RDF + "langString"
SUBCLASS_OF = RDFS + "subClassOf"
SUBPROPERTY_OF = RDFS + "subPropertyOf"
DOMAIN = RDFS + "domain"
RANGE = RDFS + "range"
LABEL = RDFS + "label"
COMMENT = RDFS + "comment"
THING = OWL + "Thing"
CLASS = OWL + "Class"
RESTRICTION = OWL + "Restriction"
NAMED_INDIVIDUAL = OWL + "NamedIndividual"
ONTOLOGY = OWL + "Ontology"
IMPORTS = OWL + "imports"
EQUIVALENT_CLASS = OWL + "equivalentClass"
INTERSECTION_OF = OWL + "intersectionOf"
UNION_OF = OWL + "unionOf"
COMPLEMENT_OF = OWL + "complementOf"
ONE_OF = OWL + "oneOf"
ON_PROPERTY = OWL + "onProperty"
INVERSE_OF = OWL + "inverseOf"
STRING = XSD + "string"

KNOWROB = "http://knowrob.org/kb/knowrob.owl#"
ROBOEARTH = "http://www.roboearth.org/kb/roboearth.owl#"
VOCABULARIES: dict[str, str] = {
    "knowrob": KNOWROB,
    "srdl2": "http://knowrob.org/kb/srdl2.owl#",
    "srdl2-cap": "http://knowrob.org/kb/srdl2-cap.owl#",
    "srdl2-comp": "http://knowrob.org/kb/srdl2-comp.owl#",
    "srdl2-action": "http://knowrob.org/kb/srdl2-action.owl#",
    "roboearth": ROBOEARTH,
}
"""Prefix -> namespace of what the bundled files define; a bare name is looked for in this order."""

PREFIXES: dict[str, str] = {"rdf": RDF, "rdfs": RDFS, "owl": OWL, "xsd": XSD, **VOCABULARIES}
"""Prefixes that :func:`expand` knows."""


@dataclass(frozen=True, slots=True)
class BNode:
    """A node without a name. Labels are unique within an ontology and the same in every run."""

    label: str

    def __str__(self) -> str:
        return f"_:{self.label}"


@dataclass(frozen=True, slots=True)
class Literal:
    """A value: its text, the IRI of its datatype (None: plain text), its language tag in lower case."""

    value: str
    datatype: str | None = None
    language: str | None = None

    def number(self) -> float:
        """Return the value as a number. Raises ValueError if it is none, or not finite."""
        text = self.value.strip()
        if "_" in text:
            raise ValueError(f"not a number: {text!r}")
        number = float(text)
        if not math.isfinite(number):
            raise ValueError(f"not a finite number: {text!r}")
        return number

    def __str__(self) -> str:
        quoted = '"' + self.value.replace("\\", "\\\\").replace('"', '\\"') + '"'
        if self.language:
            return f"{quoted}@{self.language}"
        return f"{quoted}^^{shorten(self.datatype)}" if self.datatype else quoted


Term = str | BNode | Literal
"""An IRI (a plain ``str``), a nameless node, or a value."""


@dataclass(frozen=True, slots=True)
class Triple:
    """A statement and where it stands: RDF/XML at its element, Manchester at the word that says it."""

    subject: str | BNode
    predicate: str
    object: Term
    span: Span


_PREFIXED = re.compile(r"([A-Za-z][\w.-]*):(?!//)(.*)", re.DOTALL)
ABSOLUTE = ("http://", "https://")
"""The beginnings of full names."""
_FRAME = re.compile(
    r"^(?:Class|ObjectProperty|DataProperty|AnnotationProperty|Individual|Datatype):[ \t]+(\S+)", re.MULTILINE
)


def expand(name: str) -> str:
    """Return the IRI of a name: a bare name of the bundled vocabulary, a prefixed name, or an IRI as it is.

    A bare name that the vocabulary does not define is taken as one of KnowRob's.
    """
    if name.startswith(ABSOLUTE):
        return name
    if ":" not in name:
        return _other_names().get(name) or KNOWROB + name
    if match := _PREFIXED.fullmatch(name):
        namespace = PREFIXES.get(match[1])
        if namespace is not None:
            return namespace + match[2]
    return name


@lru_cache(maxsize=10_000)
def shorten(iri: str) -> str:
    """Return the bare name that :func:`expand` turns into this IRI, if there is one; else the IRI."""
    name = local_name(iri)
    namespace = iri[: len(iri) - len(name)]
    if namespace == KNOWROB:
        return iri if not name or name in _other_names() else name
    return name if namespace in VOCABULARIES.values() and _other_names().get(name) == iri else iri


def is_vocabulary(name: str) -> bool:
    """Return True if the bundled vocabulary defines this bare name."""
    return name in _headings()[0] or name in _headings()[1]


def _other_names() -> dict[str, str]:
    return _headings()[1]


@cache
def _headings() -> tuple[frozenset[str], dict[str, str]]:
    """KnowRob's names, and bare name -> IRI for what the bundled vocabulary defines in other namespaces.

    Read from the headings of the bundled files, without parsing them.
    """
    knowrob: set[str] = set()
    others: dict[str, str] = {}
    folder = bundled("ontologies")
    for path in sorted(folder.glob("*.omn")):
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError):
            continue
        for heading in _FRAME.findall(text):
            prefix, colon, name = heading.rpartition(":")
            if not colon or prefix in ("", "knowrob"):
                knowrob.add(name)
            elif prefix in VOCABULARIES and prefix != "roboearth":
                order = list(VOCABULARIES)
                known = others.get(name)
                iri = VOCABULARIES[prefix] + name
                if known is None or order.index(prefix) < _rank(known):
                    others[name] = iri
    return frozenset(knowrob), {name: iri for name, iri in others.items() if name not in knowrob}


def _rank(iri: str) -> int:
    return next((rank for rank, space in enumerate(VOCABULARIES.values()) if iri.startswith(space)), len(VOCABULARIES))
