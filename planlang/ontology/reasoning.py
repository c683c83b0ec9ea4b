"""Finds contradictions in an ontology with the reasoners HermiT or Pellet, which owlready2 includes.

The classes are checked first, then the individuals too: from an inconsistent individual everything follows, which
would hide the unsatisfiable classes. Each reasoner is a Java process with a time limit. Pellet explains what was found
by the statements that contradict each other.

The jars of owlready2 are called directly. Its ``sync_reasoner_pellet`` reads through Jena, which in version 0.51 has a
class for Java 25 only; ``sync_reasoner`` classifies every individual, which takes longer than the checks here; and
neither has a time limit.

The reasoner gets only axioms that it can process. HermiT aborts at datatypes that OWL 2 does not have, such as the
units of QUDT. Facts with them are dropped, and a restriction with them becomes a class without axioms, so that every
contradiction that is found is a real one. A number is converted to the datatype of its property's range, because to OWL
0.5 and "0.5"^^xsd:float are different values.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import time
from collections.abc import Container, Iterable, Iterator, Sequence
from dataclasses import field, replace
from enum import Enum
from importlib.util import find_spec
from pathlib import Path

from planlang.designators import local_name
from planlang.diagnostics import BadInput, Diagnostic, Span, error, note
from planlang.extras import install_command
from planlang.ontology.checks import is_malformed
from planlang.ontology.nested_writers import rdfxml
from planlang.ontology.ontology import Ontology
from planlang.ontology.terms import INTEGER, OWL, RDF, RDFS, XSD, BNode, Literal, Term, Triple
from planlang.records import dataclass
from planlang.temporary import temporary_folder
from planlang.words import Option, Text

MEMORY = 2000
"""Memory limit of a reasoner [MB]."""
SECONDS = 120.0
"""Default time limit of a reasoner [s]."""
MOST_EXPLAINED = 20
"""Greatest number of statements shown in an explanation."""


class Reasoner(Enum):
    """Reasoners that owlready2 includes."""

    HERMIT = "hermit"
    PELLET = "pellet"

    @property
    def title(self) -> str:
        """Name as its authors spell it."""
        return "HermiT" if self is Reasoner.HERMIT else "Pellet"


@dataclass(frozen=True, slots=True)
class Reasoned:
    """Result of a reasoner: sizes of its input, and contradictions with the explanations that Pellet finds."""

    classes: int
    individuals: int
    diagnostics: tuple[Diagnostic, ...]


def missing() -> str | None:
    """Message about a missing requirement of reasoning; None if all are installed."""
    if find_spec("owlready2") is None:
        return f"reasoning needs owlready2: {install_command('reason')}"
    return None if shutil.which("java") else "reasoning needs Java: install it, and put `java` on the PATH"


def reason(ontology: Ontology, reasoner: Reasoner = Reasoner.HERMIT, seconds: float = SECONDS) -> Reasoned:
    """Find contradictions in an ontology with all its imports.

    Raises BadInput if Java or owlready2 is missing, if the reasoner exceeds ``seconds``, or if it fails.
    """
    if (lacking := missing()) is not None:
        raise BadInput([error("O064", lacking)])
    given = reasoner_input(ontology)
    with temporary_folder() as folder:
        run = _Reasoning(ontology, given, reasoner, folder, time.monotonic() + seconds, seconds)
        contradictions = run.diagnostics()
    classes = sum(ontology.is_class(iri) for iri in given.names.values())
    individuals = len({given.triples[row].subject for row in given.facts})
    return Reasoned(classes, individuals, (*given.notes, *contradictions))


class _Stopped(Exception):
    """A reasoner exceeded its time limit, or failed; the message says which."""

    def __init__(self, message: str, advice: Text | None = None) -> None:
        super().__init__(message)
        self.advice = advice


@dataclass(frozen=True, slots=True)
class _Reasoning:
    """Queries to a reasoner about one ontology; ``end`` is its deadline on the monotonic clock [s]."""

    ontology: Ontology
    given: ReasonerInput
    reasoner: Reasoner
    folder: Path
    end: float
    seconds: float

    def diagnostics(self) -> list[Diagnostic]:
        """Report each unsatisfiable class, and the contradiction among the individuals, if any."""
        found: list[Diagnostic] = []
        try:
            found += self._unsatisfiable(self._written("classes", without=self.given.facts))
            found += self._inconsistent(self._written("all"))
        except _Stopped as stopped:
            raise BadInput(
                [*self.given.notes, *found, error("O063", str(stopped), self._document(), stopped.advice)]
            ) from None
        return found

    def _written(self, name: str, without: Container[int] = ()) -> Path:
        path = self.folder / f"{name}.owl"
        path.write_text(self.given.text(without), encoding="utf-8")
        return path

    # Queries

    def _unsatisfiable(self, path: Path) -> Iterator[Diagnostic]:
        if self.reasoner is Reasoner.HERMIT:
            output, is_inconsistent = self._hermit("-N", "-U", path.as_uri())
            names = re.findall(r"^\t\S+#(\w+)$", output, re.MULTILINE)
            names = [name for name in names if name in self.given.names]
            why = self._explained("--all-unsat", path) if names else {}
        else:
            why = self._explanations("--all-unsat", path)
            is_inconsistent = "Thing" in why and "Thing" not in self.given.names
            names = [name for name in why if name in self.given.names]
        if is_inconsistent:
            yield self._contradiction(self._explained("--inconsistent", path).get("Thing", ()))
        order = {name: rank for rank, name in enumerate(self.given.names)}
        for name in sorted(names, key=order.__getitem__):
            iri = self.given.names[name]
            message = f"the class `{name}` is unsatisfiable: it cannot have any individual"
            yield error("O060", message, self.ontology.span(iri), _because(why.get(name, ())))

    def _inconsistent(self, path: Path) -> Iterator[Diagnostic]:
        if self.reasoner is Reasoner.HERMIT:
            _, is_inconsistent = self._hermit("-N", "-k", path.as_uri())
            if is_inconsistent:
                yield self._contradiction(self._explained("--inconsistent", path).get("Thing", ()))
        elif (why := self._explanations("--inconsistent", path)).get("Thing"):
            yield self._contradiction(why["Thing"])

    def _contradiction(self, why: Sequence[str]) -> Diagnostic:
        """Make the error of an inconsistent ontology, at the first individual of the explanation."""
        facts = {str(self.given.triples[row].subject).rpartition("#")[2] for row in sorted(self.given.facts)}
        words = dict.fromkeys(word for line in why for word in re.findall(r"\w+", line.partition(" (")[0]))
        named = [word for word in words if word in facts]
        if not named:
            return error("O061", "the ontology is inconsistent", self._document(), _because(why))
        names = " and ".join(f"`{name}`" for name in named)
        message = f"the statements about {names} contradict each other"
        return error("O061", message, self.ontology.span(self.given.names[named[0]]), _because(why))

    def _document(self) -> Span | None:
        return Span(str(self.ontology.documents[0].path)) if self.ontology.documents else None

    # Processes

    def _hermit(self, *arguments: str) -> tuple[str, bool]:
        """Run HermiT; returns its output, and whether it finds the ontology inconsistent."""
        home = _home() / "hermit"
        done = self._run([str(home), str(home / "HermiT.jar")], "org.semanticweb.HermiT.cli.CommandLine", arguments)
        if "InconsistentOntologyException" in done.stderr:
            return "", True
        if done.returncode != 0 or "Exception in thread" in done.stderr:
            raise _Stopped(f"HermiT cannot process the ontology: {_first_line(done.stderr)}")
        return done.stdout, False

    def _explained(self, question: str, path: Path) -> dict[str, tuple[str, ...]]:
        """Explain findings of HermiT; empty if Pellet fails, or takes more than half of the remaining time."""
        half = replace(self, end=self.end - (self.end - time.monotonic()) / 2)
        try:
            return half._explanations(question, path)
        except _Stopped:
            return {}

    def _explanations(self, question: str, path: Path) -> dict[str, tuple[str, ...]]:
        """Ask Pellet why classes are unsatisfiable: name of the class -> the statements. Raises _Stopped."""
        jars = sorted(str(jar) for jar in (_home() / "pellet").glob("*.jar"))
        arguments = ("explain", question, "--ignore-imports", path.as_uri())
        done = self._run([*jars, str(_home() / "pellet")], "pellet.Pellet", arguments)
        if "Axiom:" not in done.stdout and done.returncode != 0:
            raise _Stopped(f"Pellet cannot process the ontology: {_first_line(done.stderr or done.stdout)}")
        explanations = {}
        for block in re.split(r"^Axiom: ", done.stdout, flags=re.MULTILINE)[1:]:
            name, _, rest = block.partition(" subClassOf Nothing")
            if "NOT ENTAILED" not in rest:
                lines = [re.sub(r"^\d+\)", "", line).strip() for line in rest.partition(":")[2].splitlines()]
                statements = {line for line in lines if line and not line.startswith("Explanation")}
                # sorted, as Pellet prints them in a different order in each run
                explanations[name.strip()] = tuple(_located(one, self.given.triples) for one in sorted(statements))
        return explanations

    def _run(self, classpath: Sequence[str], main: str, arguments: Sequence[str]) -> subprocess.CompletedProcess[str]:
        command = ["java", f"-Xmx{MEMORY}M", "-cp", os.pathsep.join(classpath), main, *arguments]
        late = f"{self.reasoner.title} took more than {self.seconds:g} s"
        more = Text("allow more with ", Option("reason_seconds"))
        left = self.end - time.monotonic()
        if left <= 0:
            raise _Stopped(late, more)
        try:
            return subprocess.run(command, capture_output=True, text=True, errors="replace", timeout=left, check=False)
        except subprocess.TimeoutExpired:
            raise _Stopped(late, more) from None
        except OSError as problem:
            raise _Stopped(f"java cannot be started: {problem}") from None


def _home() -> Path:
    """Folder of owlready2, which is not imported, as only its jars are needed."""
    spec = find_spec("owlready2")
    assert spec is not None
    assert spec.origin is not None
    return Path(spec.origin).parent


def _located(statement: str, triples: Sequence[Triple]) -> str:
    """Add file and line to a statement in Pellet's notation, if its triple can be identified."""
    words = statement.split()
    if len(words) < 3:
        return statement
    predicate = "equivalentClass" if words[1] == "equivalentTo" else words[1]
    ends = {NAMESPACE + words[0], NAMESPACE + words[-1]}  # unordered: Pellet swaps the operands of disjointWith
    named = [one for one in triples if local_name(one.predicate) == predicate and one.subject in ends]
    exact = [one for one in named if {one.subject, one.object} == ends]
    exact = exact or [one for one in named if one.subject == NAMESPACE + words[0]]
    if len({one.span for one in exact}) != 1:
        return statement
    span = exact[0].span
    return f"{statement} ({Path(span.file).name}:{span.line})"


def _because(why: Sequence[str]) -> str | None:
    if not why:
        return None
    more = f"; and {len(why) - MOST_EXPLAINED} more" if len(why) > MOST_EXPLAINED else ""
    return f"because {'; '.join(why[:MOST_EXPLAINED])}{more}"


def _first_line(text: str) -> str:
    lines = [line.strip() for line in text.splitlines() if line.strip() and not line.strip().startswith("at ")]
    line = next(
        (one for one in lines if "Exception" in one or "ERROR" in one), lines[0] if lines else "no reason given"
    )
    return line.removeprefix('Exception in thread "main" ').replace(NAMESPACE, "")[:300]


_INTEGERS = frozenset(
    XSD + name
    for name in (
        *("integer", "nonNegativeInteger", "nonPositiveInteger", "positiveInteger", "negativeInteger", "long", "int"),
        *("short", "byte", "unsignedLong", "unsignedInt", "unsignedShort", "unsignedByte"),
    )
)
_FRACTIONS = frozenset(XSD + name for name in ("decimal", "double", "float"))
_TEXTS = ("string", "normalizedString", "token", "language", "Name", "NCName", "NMTOKEN")
_OTHERS = ("boolean", "hexBinary", "base64Binary", "anyURI", "dateTime", "dateTimeStamp")
BUILT_IN = frozenset(
    {*_INTEGERS, *_FRACTIONS, *(XSD + name for name in (*_TEXTS, *_OTHERS))}
    | {OWL + "real", OWL + "rational", RDF.PlainLiteral, RDF.XMLLiteral, RDF.langString, RDFS.Literal}
)
"""Datatypes of OWL 2."""

_NUMBER = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_FILLERS = frozenset((OWL.someValuesFrom, OWL.allValuesFrom, OWL.hasValue, OWL.onDataRange))
_WORDS = frozenset((RDFS.label, RDFS.comment, RDFS.seeAlso, RDFS.isDefinedBy, OWL.versionInfo, OWL.imports))
_W3C = "http://www.w3.org/"
NAMESPACE = "http://planlang/#"
"""Namespace of the short names in a reasoner's input."""


@dataclass(slots=True)
class ReasonerInput:
    """Axioms of an ontology under short unique names; ``notes`` report what was dropped or changed."""

    triples: list[Triple]
    facts: frozenset[int]
    """Indices of the triples about individuals."""
    names: dict[str, str]
    """Name -> IRI."""
    notes: list[Diagnostic] = field(default_factory=list)

    def text(self, without: Container[int] = ()) -> str:
        """Write the axioms in RDF/XML, without those at these indices."""
        header = Triple("http://planlang/", RDF.type, OWL.Ontology, Span(""))
        kept = (triple for row, triple in enumerate(self.triples) if row not in without)
        return rdfxml([header, *kept], {"e": NAMESPACE})[0]


def reasoner_input(ontology: Ontology) -> ReasonerInput:
    """Select the axioms of an ontology that reasoners can process."""
    selection = _AxiomFilter(ontology)
    triples = selection.without_foreign_values(list(map(selection.with_numbers, selection.axioms())))
    individuals = {
        subject
        for subject in dict.fromkeys(triple.subject for triple in triples)
        if _is_about_individual(ontology, subject)
    }
    facts = frozenset(row for row, triple in enumerate(triples) if triple.subject in individuals)
    renamed, names = _renamed(triples)
    return ReasonerInput(renamed, facts, names, selection.notes())


def _is_about_individual(ontology: Ontology, subject: str | BNode) -> bool:
    if isinstance(subject, BNode):
        return any(not one.startswith(_W3C) for one in ontology.types(subject))
    return ontology.is_individual(subject) and not ontology.is_class(subject) and not ontology.is_property(subject)


class _AxiomFilter:
    """Selects and converts axioms for a reasoner, and records what was dropped or changed."""

    def __init__(self, ontology: Ontology) -> None:
        self._ontology = ontology
        self._properties = {
            triple.subject: triple.object
            for triple in ontology.triples(p=OWL.onProperty)
            if isinstance(triple.object, str)
        }
        self._ranges: dict[str, str | None] = {}
        self._foreign: dict[str, Span] = {}
        self._numbers: list[Span] = []
        self._rows = 0

    def axioms(self) -> Iterator[Triple]:
        """Yield the triples that are neither annotations nor about documents."""
        ontology = self._ontology
        headers = {triple.subject for triple in ontology.triples(p=RDF.type, o=OWL.Ontology)}
        words = {*_WORDS, *(t.subject for t in ontology.triples(p=RDF.type, o=OWL.AnnotationProperty))}
        for triple in ontology.triples():
            if triple.subject not in headers and triple.predicate not in words:
                yield triple

    def with_numbers(self, triple: Triple) -> Triple:
        """Convert the number of a triple, if it has one, to the datatype of the property's range."""
        value = triple.object
        if not isinstance(value, Literal) or value.datatype not in {None, XSD.string, *_INTEGERS, *_FRACTIONS}:
            return triple
        is_filler = triple.predicate == OWL.hasValue
        prop = self._properties.get(triple.subject) if is_filler else triple.predicate
        datatype = self._range(prop) if prop is not None and not prop.startswith(_W3C) else None
        form = INTEGER if datatype in _INTEGERS else _NUMBER
        if datatype is None or datatype == value.datatype or not form.fullmatch(value.value.strip()):
            return triple
        self._numbers.append(triple.span)
        return replace(triple, object=Literal(value.value.strip(), datatype))

    def _range(self, prop: str) -> str | None:
        """Numeric datatype in the range of a property or its superproperties, if any."""
        if prop not in self._ranges:
            above = self._ontology.superproperties(prop)
            ranges = (range_ for one in above for range_ in self._ontology.values(one, RDFS.range))
            numeric = (one for one in ranges if one in _INTEGERS or one in _FRACTIONS)
            self._ranges[prop] = next((str(one) for one in numeric), None)
        return self._ranges[prop]

    def without_foreign_values(self, triples: Sequence[Triple]) -> list[Triple]:
        """Drop triples with literals and data ranges that OWL 2 does not have."""
        foreign, restrictions = self._foreign_terms(triples)
        kept = []
        for triple in triples:
            if triple.subject in foreign or triple.subject in restrictions or triple.object in foreign:
                self._rows += 1
                continue
            if triple.object in restrictions and isinstance(triple.object, BNode):
                triple = replace(triple, object=restrictions[triple.object])
            kept.append(triple)
        span = Span("")
        return [*kept, *(Triple(name, RDF.type, OWL.Class, span) for name in restrictions.values())]

    def _foreign_terms(self, triples: Sequence[Triple]) -> tuple[set[Term], dict[Term, str]]:
        """Find literals and data ranges that OWL 2 does not have, and map restrictions with one to a new class."""
        foreign: set[Term] = set()
        restrictions: dict[Term, str] = {}
        above: dict[Term, list[Triple]] = {}
        waiting: list[Term] = []
        for triple in triples:
            above.setdefault(triple.object, []).append(triple)
            datatype = self._foreign_datatype(triple)
            if datatype is not None and triple.object not in foreign:
                self._foreign.setdefault(local_name(datatype) or datatype, triple.span)
                foreign.add(triple.object)
                waiting.append(triple.object)
        while waiting:
            for triple in above.get(waiting.pop(), ()):
                node = triple.subject
                if not isinstance(node, BNode) or node in foreign or node in restrictions:
                    continue
                if triple.predicate in _FILLERS:
                    restrictions[node] = f"urn:unread#UnreadRestriction{len(restrictions) + 1}"
                elif not _is_about_individual(self._ontology, node):
                    foreign.add(node)
                    waiting.append(node)
        return foreign, restrictions

    def _foreign_datatype(self, triple: Triple) -> str | None:
        """Datatype or malformed value of a triple's object that OWL 2 does not have; None if it has it."""
        value = triple.object
        if isinstance(value, Literal):
            if is_malformed(value):
                return repr(value.value[:20])
            return None if value.datatype is None or value.datatype in BUILT_IN else value.datatype
        if isinstance(value, BNode) or triple.predicate not in {RDFS.range, OWL.onDatatype, *_FILLERS}:
            return None
        if value in BUILT_IN:
            return None
        kinds = self._ontology.values(value, RDF.type)
        prop = triple.subject if triple.predicate == RDFS.range else self._properties.get(triple.subject)
        of_data = isinstance(prop, str) and OWL.DatatypeProperty in self._ontology.values(prop, RDF.type)
        is_datatype = value.startswith(XSD) or RDFS.Datatype in kinds or (of_data and OWL.Class not in kinds)
        return value if is_datatype else None

    def notes(self) -> list[Diagnostic]:
        """Report what was dropped and changed; changed numbers only of the main document."""
        notes = []
        if self._foreign:
            message = f"reasoning ignores statements with datatypes that OWL 2 lacks: {_listed(self._foreign)}"
            notes.append(note("O062", f"{message} ({self._rows})", next(iter(self._foreign.values()))))
        own = {str(document.path) for document in self._ontology.documents[:1]}
        numbers = [span for span in self._numbers if span.file in own]
        if numbers:
            message = f"reasoning converts numbers to the datatypes of their properties' ranges ({len(numbers)})"
            notes.append(note("O062", message, numbers[0]))
        return notes


def _listed(names: Iterable[str]) -> str:
    first, *others = sorted(names)
    more = f" and {len(others) - 3} more" if len(others) > 3 else ""
    return ", ".join([first, *others[:3]]) + more


def _renamed(triples: Iterable[Triple]) -> tuple[list[Triple], dict[str, str]]:
    """Replace IRIs by unique local names in one namespace; also return name -> IRI."""
    short_iris: dict[str, str] = {}
    names: dict[str, str] = {}

    def short(iri: str) -> str:
        if iri.startswith(_W3C):
            return iri
        if iri not in short_iris:
            name = candidate = "_".join(re.findall(r"[A-Za-z0-9_]+", local_name(iri))).lstrip("0123456789") or "thing"
            while name in names:
                name = f"{candidate}_{len(names)}"
            short_iris[iri], names[name] = NAMESPACE + name, iri
        return short_iris[iri]

    def term(value: Term) -> Term:
        return short(value) if isinstance(value, str) else value

    renamed = []
    for one in triples:
        subject = short(one.subject) if isinstance(one.subject, str) else one.subject
        renamed.append(Triple(subject, short(one.predicate), term(one.object), one.span))
    return renamed, names
