"""Description logic on request: HermiT or Pellet, as owlready2 brings them along, find what contradicts itself.

First the classes alone, then the individuals too: an inconsistent individual makes everything follow, and would hide
which classes are unsatisfiable. Each reasoner is a Java process, ended when its time is over. What is found is
explained by Pellet, which tells the statements that contradict each other.

The jars of owlready2 are called directly. Its ``sync_reasoner_pellet`` reads through Jena, of which it has (0.51) a
class for Java 25 only; ``sync_reasoner`` places every individual below each of its classes, which takes longer than
what is asked here; and neither has a limit of time.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from enum import Enum
from importlib.util import find_spec
from pathlib import Path

from planlang.designators import local_name
from planlang.diagnostics import BadInput, Diagnostic, Span, error
from planlang.ontology.ontology import Ontology
from planlang.ontology.reasoner_input import NAMESPACE, ReasonerInput, reasoner_input
from planlang.ontology.terms import Triple
from planlang.records import dataclass

MEMORY = 2000
"""Memory of a reasoner [MB]."""
SECONDS = 120.0
"""Time of a reasoner unless told otherwise [s]."""
MOST_EXPLAINED = 20
"""Lines of an explanation that are shown."""


class Reasoner(Enum):
    """The reasoners that owlready2 brings along."""

    HERMIT = "hermit"
    PELLET = "pellet"

    @property
    def title(self) -> str:
        """The name that its makers write."""
        return "HermiT" if self is Reasoner.HERMIT else "Pellet"


@dataclass(frozen=True, slots=True)
class Reasoned:
    """Findings of a reasoner: contradictions, each with an explanation where Pellet has one."""

    classes: int
    individuals: int
    diagnostics: tuple[Diagnostic, ...]


def missing() -> str | None:
    """Return what reasoning lacks here, in words; None if nothing."""
    if find_spec("owlready2") is None:
        return "reasoning needs owlready2: pip install 'planlang[reason]'"
    return None if shutil.which("java") else "reasoning needs Java: no `java` is found in the folders of PATH"


def reason(ontology: Ontology, reasoner: Reasoner = Reasoner.HERMIT, seconds: float = SECONDS) -> Reasoned:
    """Return what contradicts itself in an ontology with all its imports.

    Raises BadInput if Java or owlready2 is missing, if the reasoner does not end in its time, or cannot take the
    ontology.
    """
    if (lacking := missing()) is not None:
        raise BadInput([error("O064", lacking)])
    given = reasoner_input(ontology)
    with tempfile.TemporaryDirectory() as folder:
        found = _Reasoning(ontology, given, reasoner, Path(folder), time.monotonic() + seconds, seconds).diagnostics()
    classes = sum(ontology.is_class(iri) for iri in given.names.values())
    individuals = len({given.triples[row].subject for row in given.facts})
    return Reasoned(classes, individuals, (*given.notes, *found))


class _Stopped(Exception):
    """A reasoner has not ended in its time, or has failed; the message says which."""


@dataclass(frozen=True, slots=True)
class _Reasoning:
    """The questions to a reasoner about one ontology."""

    ontology: Ontology
    given: ReasonerInput
    reasoner: Reasoner
    folder: Path
    end: float
    seconds: float

    def diagnostics(self) -> list[Diagnostic]:
        """Return an error for each unsatisfiable class, and for what contradicts itself in the individuals."""
        found: list[Diagnostic] = []
        try:
            found += self._unsatisfiable(self._written("classes", facts=False))
            found += self._inconsistent(self._written("all", facts=True))
        except _Stopped as stopped:
            raise BadInput([*self.given.notes, *found, error("O063", str(stopped), self._document())]) from None
        return found

    def _written(self, name: str, *, facts: bool) -> Path:
        path = self.folder / f"{name}.owl"
        path.write_text(self.given.text(facts=facts), encoding="utf-8")
        return path

    # What is asked

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
            message = f"the class `{name}` is unsatisfiable: nothing can be of it"
            yield error("O060", message, self.ontology.span(iri), _because(why.get(name, ())))

    def _inconsistent(self, path: Path) -> Iterator[Diagnostic]:
        if self.reasoner is Reasoner.HERMIT:
            _, is_inconsistent = self._hermit("-N", "-k", path.as_uri())
            if is_inconsistent:
                yield self._contradiction(self._explained("--inconsistent", path).get("Thing", ()))
        elif (why := self._explanations("--inconsistent", path)).get("Thing"):
            yield self._contradiction(why["Thing"])

    def _contradiction(self, why: Sequence[str]) -> Diagnostic:
        """Return the error of what contradicts itself, at the first individual of the explanation."""
        facts = {str(self.given.triples[row].subject).rpartition("#")[2] for row in sorted(self.given.facts)}
        words = dict.fromkeys(word for line in why for word in re.findall(r"\w+", line.partition(" (")[0]))
        named = [word for word in words if word in facts]
        if not named:
            message = "what the ontology says contradicts itself: nothing can be as it says"
            return error("O061", message, self._document(), _because(why))
        names = " and ".join(f"`{name}`" for name in named)
        message = f"what is said of {names} contradicts itself"
        return error("O061", message, self.ontology.span(self.given.names[named[0]]), _because(why))

    def _document(self) -> Span | None:
        return Span(str(self.ontology.documents[0].path)) if self.ontology.documents else None

    # Processes

    def _hermit(self, *arguments: str) -> tuple[str, bool]:
        """Return what HermiT prints, and whether it finds the ontology inconsistent."""
        home = _home() / "hermit"
        done = self._run([str(home), str(home / "HermiT.jar")], "org.semanticweb.HermiT.cli.CommandLine", arguments)
        if "InconsistentOntologyException" in done.stderr:
            return "", True
        if done.returncode != 0 or "Exception in thread" in done.stderr:
            raise _Stopped(f"HermiT cannot take the ontology: {_first_line(done.stderr)}")
        return done.stdout, False

    def _explained(self, question: str, path: Path) -> dict[str, tuple[str, ...]]:
        """Return explanations of what HermiT has found; none if Pellet fails, or needs half of the time left."""
        half = replace(self, end=self.end - (self.end - time.monotonic()) / 2)
        try:
            return half._explanations(question, path)
        except _Stopped:
            return {}

    def _explanations(self, question: str, path: Path) -> dict[str, tuple[str, ...]]:
        """Return the statements by which classes are below Nothing, for the name of each; raises _Stopped."""
        jars = sorted(str(jar) for jar in (_home() / "pellet").glob("*.jar"))
        arguments = ("explain", question, "--ignore-imports", path.as_uri())
        done = self._run([*jars, str(_home() / "pellet")], "pellet.Pellet", arguments)
        if "Axiom:" not in done.stdout and done.returncode != 0:
            raise _Stopped(f"Pellet cannot take the ontology: {_first_line(done.stderr or done.stdout)}")
        found = {}
        for block in re.split(r"^Axiom: ", done.stdout, flags=re.MULTILINE)[1:]:
            name, _, rest = block.partition(" subClassOf Nothing")
            if "NOT ENTAILED" not in rest:
                lines = [re.sub(r"^\d+\)", "", line).strip() for line in rest.partition(":")[2].splitlines()]
                told = {line for line in lines if line and not line.startswith("Explanation")}
                placed = [_located(line, self.given.triples) for line in sorted(told)]  # Pellet has no order
                found[name.strip()] = tuple(placed)
        return found

    def _run(self, classpath: Sequence[str], main: str, arguments: Sequence[str]) -> subprocess.CompletedProcess[str]:
        command = ["java", f"-Xmx{MEMORY}M", "-cp", os.pathsep.join(classpath), main, *arguments]
        late = f"{self.reasoner.title} has not ended after {self.seconds:g} s; --reason-seconds gives it more"
        left = self.end - time.monotonic()
        if left <= 0:
            raise _Stopped(late)
        try:
            return subprocess.run(command, capture_output=True, text=True, errors="replace", timeout=left, check=False)
        except subprocess.TimeoutExpired:
            raise _Stopped(late) from None
        except OSError as problem:
            raise _Stopped(f"java cannot be started: {problem}") from None


def _home() -> Path:
    """Return the folder of owlready2, which is not imported: its jars are all that is needed."""
    spec = find_spec("owlready2")
    assert spec is not None
    assert spec.origin is not None
    return Path(spec.origin).parent


def _located(told: str, triples: Sequence[Triple]) -> str:
    """Return a statement as Pellet tells it, with the place where it is written if that can be found."""
    words = told.split()
    if len(words) < 3:
        return told
    predicate = "equivalentClass" if words[1] == "equivalentTo" else words[1]
    ends = {NAMESPACE + words[0], NAMESPACE + words[-1]}  # in any order: Pellet turns disjointWith around
    named = [one for one in triples if local_name(one.predicate) == predicate and one.subject in ends]
    exact = [one for one in named if {one.subject, one.object} == ends]
    exact = exact or [one for one in named if one.subject == NAMESPACE + words[0]]
    if len({one.span for one in exact}) != 1:
        return told
    span = exact[0].span
    return f"{told} ({Path(span.file).name}:{span.line})"


def _because(why: Sequence[str]) -> str | None:
    if not why:
        return None
    more = f"; and {len(why) - MOST_EXPLAINED} more" if len(why) > MOST_EXPLAINED else ""
    return f"because {'; '.join(why[:MOST_EXPLAINED])}{more}"


def _first_line(text: str) -> str:
    lines = [line.strip() for line in text.splitlines() if line.strip() and not line.strip().startswith("at ")]
    told = next((line for line in lines if "Exception" in line or "ERROR" in line), lines[0] if lines else "no reason")
    return told.removeprefix('Exception in thread "main" ').replace(NAMESPACE, "")[:300]
