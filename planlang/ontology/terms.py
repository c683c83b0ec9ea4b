"""RDF terms, triples with positions, the namespaces of W3C and KnowRob, and the resolution of relative IRIs."""

from __future__ import annotations

import math
import re
from functools import cache, lru_cache
from urllib.parse import urljoin

from planlang.designators import local_part
from planlang.diagnostics import Span
from planlang.files import bundled
from planlang.records import dataclass

INTEGER = re.compile(r"[+-]?[0-9]+")
_SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*:")


def resolve(base: str, reference: str) -> str:
    """Resolve a relative IRI against the address of its document; an IRI with a scheme is unchanged."""
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
    # urljoin drops an empty fragment, but namespaces end with "#"
    return joined + "#" if reference.endswith("#") and not joined.endswith("#") else joined


class Namespace(str):
    """Namespace IRI of a W3C vocabulary with its terms as attributes, such as ``OWL.Class``.

    ``terms`` are the local names of all its terms; any other attribute raises AttributeError.
    """

    terms: frozenset[str]

    def __new__(cls, iri: str, terms: str) -> Namespace:
        self = super().__new__(cls, iri)
        self.terms = frozenset(terms.split())
        vars(self).update((term, iri + term) for term in self.terms)
        return self

    def __getattr__(self, name: str) -> str:
        raise AttributeError(f"{self} has no term {name}")


RDF = Namespace(
    "http://www.w3.org/1999/02/22-rdf-syntax-ns#",
    """type first rest nil value subject predicate object Statement List Property langString XMLLiteral PlainLiteral
    langRange HTML JSON Bag Seq Alt CompoundLiteral language direction""",
)
RDFS = Namespace(
    "http://www.w3.org/2000/01/rdf-schema#",
    """subClassOf subPropertyOf domain range label comment seeAlso isDefinedBy member Class Datatype Literal Resource
    Container ContainerMembershipProperty""",
)
OWL = Namespace(
    "http://www.w3.org/2002/07/owl#",
    """AllDifferent AllDisjointClasses AllDisjointProperties Annotation AnnotationProperty AsymmetricProperty Axiom
    Class DataRange DatatypeProperty DeprecatedClass DeprecatedProperty FunctionalProperty InverseFunctionalProperty
    IrreflexiveProperty NamedIndividual NegativePropertyAssertion Nothing ObjectProperty Ontology OntologyProperty
    ReflexiveProperty Restriction SymmetricProperty Thing TransitiveProperty allValuesFrom annotatedProperty
    annotatedSource annotatedTarget assertionProperty backwardCompatibleWith bottomDataProperty bottomObjectProperty
    cardinality complementOf datatypeComplementOf deprecated differentFrom disjointUnionOf disjointWith distinctMembers
    equivalentClass equivalentProperty hasKey hasSelf hasValue imports incompatibleWith intersectionOf inverseOf
    maxCardinality maxQualifiedCardinality members minCardinality minQualifiedCardinality onClass onDataRange onDatatype
    onProperties onProperty oneOf priorVersion propertyChainAxiom propertyDisjointWith qualifiedCardinality sameAs
    someValuesFrom sourceIndividual targetIndividual targetValue topDataProperty topObjectProperty unionOf versionIRI
    versionInfo withRestrictions rational real""",
)
XSD = Namespace(
    "http://www.w3.org/2001/XMLSchema#",
    """string boolean token decimal float double integer positiveInteger nonNegativeInteger long int short byte
    unsignedLong unsignedInt unsignedShort""",
)
"""Only the datatypes that planlang uses; the other three namespaces are complete."""

LANGUAGES = (OWL, RDF, RDFS, XSD)
"""Namespaces of the languages themselves."""

KNOWROB = "http://knowrob.org/kb/knowrob.owl#"
ROBOEARTH = "http://www.roboearth.org/kb/roboearth.owl#"
SOMA = "http://www.ease-crc.org/ont/SOMA.owl#"
URDF_WORLDS = "http://planlang.org/kb/urdf/"
"""Start of the ontology IRI of a URDF, followed by the name of its robot element; links are names in there."""
MOVED_LINKS = {"prismatic": "Drawer", "revolute": "Door", "continuous": "ControlKnob"}
"""Type of the joint above a link -> class of the link, if no label has one."""
UPPER = (SOMA, "http://www.ontologydesignpatterns.org/ont/dul/DUL.owl#")
"""Namespaces whose axioms say what kinds of things there are, and nothing about those of a recipe."""
VOCABULARIES: dict[str, str] = {
    "knowrob": KNOWROB,
    "srdl2": "http://knowrob.org/kb/srdl2.owl#",
    "srdl2-cap": "http://knowrob.org/kb/srdl2-cap.owl#",
    "srdl2-comp": "http://knowrob.org/kb/srdl2-comp.owl#",
    "srdl2-action": "http://knowrob.org/kb/srdl2-action.owl#",
    "motion-constraints": "http://knowrob.org/kb/motion-constraints.owl#",
    "roboearth": ROBOEARTH,
}
"""Prefix -> namespace of the bundled vocabularies; bare names are looked up in this order."""

PREFIXES: dict[str, str] = {"rdf": RDF, "rdfs": RDFS, "owl": OWL, "xsd": XSD, **VOCABULARIES}
"""Prefixes that :func:`expand` resolves."""


@dataclass(frozen=True, slots=True)
class BNode:
    """Blank node. Labels are unique within an ontology and the same in every run."""

    label: str

    def __str__(self) -> str:
        return f"_:{self.label}"


@dataclass(frozen=True, slots=True)
class Literal:
    """RDF literal: its text, the IRI of its datatype (None: plain text), its language tag in lower case."""

    value: str
    datatype: str | None = None
    language: str | None = None

    def number(self) -> float:
        """Convert the text to a number, integers to int. Raises ValueError unless it is a finite number."""
        text = self.value.strip()
        if "_" in text:
            raise ValueError(f"not a number: {text!r}")
        number = float(text)
        if not math.isfinite(number):
            raise ValueError(f"not a finite number: {text!r}")
        return int(text) if INTEGER.fullmatch(text) else number

    def __str__(self) -> str:
        quoted = '"' + self.value.replace("\\", "\\\\").replace('"', '\\"') + '"'
        if self.language:
            return f"{quoted}@{self.language}"
        return f"{quoted}^^{shorten(self.datatype)}" if self.datatype else quoted


Term = str | BNode | Literal
"""An IRI (a plain ``str``), a blank node, or a literal."""


@dataclass(frozen=True, slots=True)
class Triple:
    """Statement with its position: of the element in RDF/XML, of the word that states it in Manchester syntax."""

    subject: str | BNode
    predicate: str
    object: Term
    span: Span


_PREFIXED = re.compile(r"([A-Za-z][\w.-]*):(?!//)(.*)", re.DOTALL)
ABSOLUTE = ("http://", "https://")
"""Schemes of absolute IRIs that :func:`expand` leaves unchanged."""
_FRAME = re.compile(
    r"^(?:Class|ObjectProperty|DataProperty|AnnotationProperty|Individual|Datatype):[ \t]+(\S+)", re.MULTILINE
)


@lru_cache(maxsize=10_000)
def expand(name: str) -> str:
    """Expand a bare name of the bundled vocabulary or a prefixed name to its IRI; an IRI is unchanged.

    A bare name that the vocabulary does not define is put into KnowRob's namespace.
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
    """Shorten an IRI to the bare name that :func:`expand` maps back to it; other IRIs are unchanged."""
    name = local_part(iri)
    namespace = iri[: len(iri) - len(name)]
    if namespace == KNOWROB:
        return iri if not name or name in _other_names() else name
    return name if namespace in VOCABULARIES.values() and _other_names().get(name) == iri else iri


def is_vocabulary(name: str) -> bool:
    """Check whether the bundled vocabulary defines a bare name."""
    return name in _headings()[0] or name in _headings()[1]


def _other_names() -> dict[str, str]:
    return _headings()[1]


@cache
def _headings() -> tuple[frozenset[str], dict[str, str]]:
    """Collect KnowRob's names, and bare name -> IRI of the names that bundled files define in other namespaces.

    Only the frame headings of the files are matched: parsing them takes too long for a look-up.
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
                iri, known = VOCABULARIES[prefix] + name, others.get(name)
                if known is None or _rank(iri) < _rank(known):
                    others[name] = iri
    return frozenset(knowrob), {name: iri for name, iri in others.items() if name not in knowrob}


def _rank(iri: str) -> int:
    """Position of an IRI's namespace in VOCABULARIES; of equal bare names the first namespace counts."""
    return next((rank for rank, space in enumerate(VOCABULARIES.values()) if iri.startswith(space)), len(VOCABULARIES))
