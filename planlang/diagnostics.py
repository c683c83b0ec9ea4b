"""Diagnostics for bad input: positions, severities, codes, and the one renderer."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict
from enum import Enum
from typing import NamedTuple

from planlang.records import dataclass


class Severity(Enum):
    """The severity of a diagnostic. Only errors stop."""

    ERROR = "error"
    WARNING = "warning"
    NOTE = "note"


class Span(NamedTuple):
    """A position in a file; line and column count from 1."""

    file: str
    line: int = 1
    column: int = 1

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}"


@dataclass(frozen=True, slots=True)
class Rename:
    """Write one name (IRI) for another that nothing defines; ``is_sure`` if no third is nearly as like it."""

    written: str
    meant: str
    is_sure: bool = False

    def __str__(self) -> str:
        written, meant = self.written, self.meant
        short = meant.rsplit("#", 1)[-1].rsplit("/", 1)[-1]
        is_elsewhere = written.removesuffix(written.rsplit("#", 1)[-1]) != meant.removesuffix(meant.rsplit("#", 1)[-1])
        return f"`{short}` ({meant})" if is_elsewhere else f"`{short}`"


@dataclass(frozen=True, slots=True)
class Order:
    """State in a task that one step comes before another (all IRIs)."""

    task: str
    before: str
    after: str


@dataclass(frozen=True, slots=True)
class Declaration:
    """Declare an entity of XML; ``is_sure`` if no other value of it is known."""

    entity: str
    value: str
    is_sure: bool = True

    def __str__(self) -> str:
        return f'<!ENTITY {self.entity} "{self.value}">'


Suggestion = Rename | Order | Declaration
"""A change of the file that a help proposes."""


@dataclass(frozen=True, slots=True)
class Diagnostic:
    """One message about the user's input. ``code`` is a key of :data:`CODES`.

    ``suggestion`` is what the help says as a change of the file, where that can be said so.
    """

    severity: Severity
    code: str
    message: str
    span: Span | None = None
    help: str | None = None
    suggestion: Suggestion | None = None

    def __str__(self) -> str:
        where = f"{self.span}: " if self.span else ""
        text = f"{where}{self.severity.value} {self.code} {self.message}"
        return f"{text}\n    help: {self.help}" if self.help else text

    def as_json(self) -> dict[str, object]:
        """Return severity, code, message, span and help (or null), and the suggestion if there is one, for JSON."""
        suggestion = {"suggestion": asdict(self.suggestion)} if self.suggestion is not None else {}
        return {
            "severity": self.severity.value,
            "code": self.code,
            "message": self.message,
            "span": self.span._asdict() if self.span else None,
            "help": self.help,
            **suggestion,
        }


class BadInput(Exception):
    """Input that cannot be used; carries all diagnostics found."""

    def __init__(self, diagnostics: Sequence[Diagnostic]) -> None:
        self.diagnostics = tuple(diagnostics)
        super().__init__("\n".join(map(str, diagnostics)))


def error(
    code: str,
    message: str,
    span: Span | None = None,
    help: str | None = None,
    suggestion: Suggestion | None = None,
) -> Diagnostic:
    """Return an error: the input cannot be used."""
    return Diagnostic(Severity.ERROR, code, message, span, help, suggestion)


def warning(
    code: str,
    message: str,
    span: Span | None = None,
    help: str | None = None,
    suggestion: Suggestion | None = None,
) -> Diagnostic:
    """Return a warning: usable, but probably not what was meant."""
    return Diagnostic(Severity.WARNING, code, message, span, help, suggestion)


def note(code: str, message: str, span: Span | None = None, help: str | None = None) -> Diagnostic:
    """Return a note: what was repaired or assumed."""
    return Diagnostic(Severity.NOTE, code, message, span, help)


def has_errors(diagnostics: Iterable[Diagnostic]) -> bool:
    """Return True if any of them is an error."""
    return any(d.severity is Severity.ERROR for d in diagnostics)


CODES: dict[str, str] = {
    # O: reading ontologies
    "O001": "not a file that holds an ontology, or it cannot be read",
    "O002": "the file is empty",
    "O003": "the file is too large",
    "O004": "the file is not text in a known encoding",
    "O005": "the file is not well-formed XML",
    "O006": "a malformed comment or a misplaced declaration of an XML file is skipped",
    "O007": "an attribute of an XML element is stated twice",
    "O008": "entities, elements or expressions are nested or expanded beyond the bounds",
    "O009": "an external or parameter entity is refused",
    "O010": "something that is not RDF in an RDF/XML file is skipped",
    "O011": "an rdf:ID is given twice",
    "O012": "a term of RDF, RDFS or OWL is written in the wrong namespace",
    "O013": "RDF, RDFS or OWL has no such term",
    "O014": "a restriction does not say that it is one",
    "O015": "names of an old namespace are read as those of the new one",
    "O016": "an entity of an XML file is not declared and is read as others declare it",
    "O017": "a restriction lacks its property or filler, or has several",
    "O018": "a list is broken: it lacks an item or its end, or comes back to itself",
    "O019": "a value is none of its datatype",
    "O020": "a syntax error in Manchester syntax or Turtle",
    "O021": "a prefix is not declared",
    "O022": "names without prefix are used without a default prefix",
    "O023": "a rule in Manchester syntax is skipped",
    "O030": "an import was not found",
    "O031": "an import of an unknown address is left out",
    "O032": "an import outside the given folders is left out",
    "O033": "too many files are imported",
    "O034": "an imported file cannot be used",
    "O041": "nothing defines a superclass",
    "O042": "someValuesFrom is used with an individual",
    "O043": "hasValue is used with a class",
    "O050": "a syntax cannot say what a file says: it is lost in converting it",
    "O051": "a syntax declares what a converted file does not declare",
    "O052": "a syntax says in another way what a converted file says",
    "O053": "comments or prefixes of a converted file are not kept",
    "O060": "a class is unsatisfiable: nothing can be of it",
    "O061": "what is said of individuals contradicts itself",
    "O062": "a reasoner is not given a statement as it is",
    "O063": "a reasoner has not ended in its time, or cannot take an ontology",
    "O064": "reasoning needs Java and owlready2",
    # R: recipes
    "R001": "the file has no task, or not the requested one",
    "R002": "the file has several tasks, and none was chosen",
    "R003": "parts of a recipe belong to no task",
    "R004": "the task has no sub-actions",
    "R005": "words of the recipe vocabulary are in another namespace; they are read as the vocabulary's",
    "R010": "an ordering constraint names something that is not a sub-action",
    "R011": "an ordering constraint is undefined or incomplete",
    "R012": "the ordering constraints form a cycle",
    "R013": "an ordering constraint repeats another one",
    "R014": "some ordering constraints are redundant: they follow from the others",
    "R015": "orderings and overlaps of steps contradict each other",
    "R020": "a sub-action is not defined",
    "R021": "nothing performs a sub-action yet: it is not a primitive and has no recipe; a process module may",
    "R022": "a recipe performs itself, possibly through a superclass",
    "R023": "recipes are nested too deeply",
    "R024": "a sub-action is stated twice, or required several times",
    "R030": "two fillers of an action are exchanged; they are read the right way round",
    "R031": "a property is not listed for the action",
    "R032": "a filler is not in the range of its property",
    "R033": "a filler is not defined",
    "R034": "a thing given by its class is read as the only individual of that class",
    "R035": "a filler is an anonymous expression",
    "R036": "a place has no relation to anything, and is not a posture of a robot",
    "R037": "a value is not a number, or its unit does not fit the property",
    "R038": "a statement about a step or a place is ignored: nothing is done with such a property",
    "R039": "a location designator or a thing of the file is unused",
    "R040": "two base motions are not ordered",
    "R041": "an order was added: steps at one place are performed together",
    "R042": "an ordering is missing that was probably meant",
    "R043": "a recovery names an unknown strategy or failure, or gives no proper number",
    "R044": "a recovery by the next place handles or raises other failures than a location scope",
    "R045": "steps that need the same resource of the robot are not ordered",
    "R046": "a requirement is not defined, impossible or circular",
    "R047": "some steps are not ordered",
    "R048": "two steps have the same name",
    "R049": "the class of a filler is unknown; it is treated as an object",
    "R050": "a state is not defined",
    "R051": "a state is not a sub-action; it is treated as one",
    "R052": "a finite-state recipe does not have exactly one start, or has no end",
    "R053": "one outcome of a state leads to two states",
    "R054": "a state cannot be reached",
    "R055": "no transition covers an outcome of a state, or a transition is never taken",
    "R056": "no transition handles failures",
    "R057": "ordering constraints of a finite-state recipe are ignored",
    "R058": "a name is misspelt: it is unknown, and nearly the same as a known one",
    "R059": "a statement about steps or their order has no effect, or says more than was probably meant",
    "R060": "a filler is of another kind than the action needs",
    "R061": "a motion states no target",
    "R062": "an action does not state what it needs; it becomes a parameter of the plan",
    "R063": "what an action class needs is declared in a way that cannot be read",
    "R065": "a constraint of a motion lacks its kind or a feature, or nothing can be within its limits",
    "R067": "a step comes before what it needs is brought about, such as handing over before lifting",
    "R068": "an action does not state what a recipe should say; the robot chooses",
    # M: maps and worlds
    "M001": "a pose's matrix was repaired: a reflection, or not orthonormal",
    "M002": "a number is expected, and a finite one",
    "M003": "a pose has neither a complete matrix nor a translation",
    "M004": "a pose has no rotation, or one without three directions; it is taken as not turned",
    "M005": "a size was filled in: doors are thin, other things have the default of their class",
    "M006": "a thing has no size that is known: it is a mere place",
    "M007": "a size is negative; the thing is a mere place",
    "M008": "poses are relative to each other in a circle",
    "M009": "nothing in the file has a place: it is no map",
    "M010": "a pose is relative to something that has no place",
    "M011": "the time of a perception cannot be read; it counts as the oldest",
    "M012": "a thing has a size but no place; it is not in the world",
    "M013": "furniture in which things lie is hollow behind its doors and at its compartments",
    "M014": "things lie inside of something that is modelled as a solid box",
    "M015": "a thing stands on nothing",
    "M016": "a door inside of its furniture is moved to a face of it",
    "M017": "the limits of a joint leave it no way to be closed and opened; those of its box are used",
    "M018": "a direction has no three numbers, or is of length zero",
    "M019": "a link of a world in URDF has no box: its mesh is not there, and no label tells its size",
    "M020": "a file of labels for a world in URDF is not as it should be",
    "M021": "a larger place is stated as a part of a smaller one; it is turned around",
    "M022": "maps that are merged disagree: about a pose, a value or a class",
    "M023": "maps that are merged have one thing by two names",
    "M024": "an occupancy grid, points or an octree cannot be read; its obstacles are left out",
    "M025": "a file of a map is not here, or of a kind that is not read",
    "M026": "a thing has parts, or their poses, from the model of its class",
    "M027": "a map is in another frame than the first; `planlang merge` moves it",
    "M028": "nothing tells how the frames of maps that are merged lie to each other",
    "M029": "rooms are connected, and nothing says where; a doorway is assumed, or there is no way",
    "M030": "a number is in a unit of another dimension, or in an unknown one",
    "M031": "a thing's class is unknown; it is read as the class that is called so, if there is one",
    "M032": "obstacles of a file are so many that some are joined, with what is between them",
    # B: binding robots
    "B001": "a robot file is not as it should be",
    "B002": "there is no robot in the file",
    "B003": "a link of a composition was found by name, or is the child of the joint that is named",
    "B004": "a composition begins or ends at a link that the URDF does not have",
    "B005": "the URDF moves an arm by a joint that the self-model does not have",
    "B006": "a gripper has no joint that moves",
    "B007": "links and joints of the self-model that are not in the URDF",
    "B008": "no such robot, or no URDF for it",
    "B009": "the URDF cannot be read",
    "B010": "numbers about the robot are assumed",
    "B011": "a robot file names what the URDF does not have, or a position outside of its limits",
    "B012": "the URDF is another robot's",
    "B013": "meshes of the URDF are not there or cannot be read; simple shapes stand in for them",
    "B014": "the URDF is in a package that is not installed",
    "B015": "no link of the URDF has a shape for contacts; those for looks are used, if there are any",
    "B016": "something is missing in a robot that is made from its URDF alone",
    # P: phrases
    "P001": "a phrase has a relation that is not known",
    "P002": "a phrase names a thing, a class or an arm that is not known",
    "P003": "a phrase ends, goes on or is nested where it should not",
    "P004": "a phrase has a length that is none",
    "P005": "a phrase names two arms or two grasps for one location",
    "P006": "a phrase bounds the distance of a relation that has none",
    "P007": "a noun of a phrase could mean several classes of things of the map",
    "P008": "a phrase is about something that the map does not have",
    "P009": "of several things that a phrase could mean the nearest was taken",
    "P010": "a phrase is of no place: it means nothing for what is looked for, or contradicts itself",
    "P011": "a phrase names an arm or a grasp that nothing in it uses; it is left out",
    # X: running
    "X001": "a plan cannot be imported, or an earlier version of planlang has compiled it",
    "X002": "a file defines no plan",
    "X003": "there is no free pose for the robot to start at",
    "X004": "a plan has no such parameter",
    "X005": "a parameter is set to a thing that is not in the map",
    "X006": "a parameter is set to a thing of another class",
    "X007": "the robot cannot start at the given pose",
    "X008": "the robot cannot do one of several alternatives of a plan",
    "X009": "it is unknown whether the robot has something that a plan requires",
    "X010": "the environment was chosen automatically, as only it contains the named objects",
    "X011": "a file or package of process modules cannot be used",
    "X012": "several process modules perform the same action class",
    "X013": "a robot without camera needs --trust-map to handle things",
    "X014": "a parameter of the plan is not set, and has no default",
    "X020": "the file is not a trace, or is damaged",
    "X021": "the run of a trace has ended or failed; nothing is left to resume",
    "X022": "a trace is of another run: plan, seed, robot, map, modules or parameters differ",
    "X023": "a run went on without its earlier steps, and cannot be repeated",
    "X024": "a result cannot be stored as JSON: a run is not resumed behind it, or steps run again",
    "X025": "a trace was written with other versions of packages",
    "X026": "the last line of a trace is incomplete and ignored",
    "X027": "a resumed run does something else than before",
    "X028": "a parameter that is not set is the only thing of the class that its step names",
    "X029": "an individual of the recipe is not in the map; a thing of its class is meant",
    "X030": "what had begun outside of a run, and not ended when it was killed, is done again",
    # C: command line
    "C001": "a named file or folder does not exist or cannot be read",
    "C002": "the file is neither a recipe nor a plan",
    "C003": "the file is Python, but no plan",
    "C004": "an output cannot be written",
    "C005": "an output would overwrite a file that planlang did not write, or an edited plan",
    "C006": "the compiler, or an import of the recipe, has changed since the plan was compiled",
    "C007": "a plan was given instead of a recipe",
    "C008": "no robot or environment was named, and there is no default",
    "C009": "the recipe has changed since the plan was compiled",
    "C010": "the plan was edited since it was compiled",
    "C011": "the recipe of a plan was not found or cannot be read",
    "C012": "recordings need a package that is not installed",
    "C013": "there is no display for a window",
    "C014": "unknown graph format",
    "C015": "there is no uncertain fix with this code",
    "C016": "a fix was not applied, as it is uncertain or cannot be written into the text",
    "C017": "a recipe was fixed before it was compiled, as --accept says",
    "C018": "a line of a file of settings is not NAME=THING",
    "C019": "a unit that numbers are to be shown in is unknown, or nothing that is shown can be in it",
    "C020": "there is not enough memory",
    "C021": "no folder takes temporary files",
    "C022": "an accepted fix was refused, as it would make the recipe worse",
    "C023": "a merge of a plan has conflicts, or is not possible",
    "C024": "a plan misspells a role of an action",
    "C030": "a file has no sweep, or a damaged one",
    "C031": "a file has another sweep: other arguments, inputs or shard",
    "C032": "another process is writing the file of a sweep",
    "C033": "a sweep is not complete: worlds are missing",
    # K: knowledge base
    "K001": "the file of a knowledge base is none, or has another layout",
    "K002": "nothing is known by a name of a question, or several things are",
    "K003": "a question is no single class expression",
    "K004": "the server needs packages that are not installed",
    "K005": "the server cannot listen at an address",
    "K006": "the name of an author is empty, too long or not printable",
    "K010": "several things of an upload could be its subject",
    "K011": "an upload has nothing of its kind, or not what it is to be about",
    "K012": "the name of an upload, or of its subject, makes no identifier",
    "K013": "an upload says more than can be indexed",
    "K014": "an upload is in a syntax that is not kept",
    "K015": "checking an upload, converting or comparing a content takes more time or memory than the server gives it",
    "K020": "contents are kept in a file, or beside an endpoint, not both",
    "K030": "no server was named, or its address is none",
    "K031": "a server does not answer",
    "K032": "an answer is none of a knowledge base, or is damaged",
    "K033": "a server does not answer; what was read from it before is used",
    "K034": "a file or environment variable holds no key",
    "K035": "the record of what was pulled into a folder is damaged",
    "K036": "a server refuses a request",
    "K037": "a robot has no self-model to ask with",
    "K038": "a file was pulled and is a program: it runs only with --trust",
    "K039": "the name of what is pushed means nothing, or several things",
    "K040": "what a knowledge base gives has not the hash that its entry states",
    "K041": "the list of what a robot took from a knowledge base is damaged",
    "K042": "the file of a recognition model is not with it: the model is left out",
    "K043": "a key was sent over a network without TLS",
    "K044": "an endpoint or a storage that a server stands on does not answer",
    "K045": "a server has more entries for a need than are looked at",
    "K046": "entries of a store cannot be read any more",
    "K047": "a subscription that is to end is none of yours",
    "K080": "a narrative tells of no episode, or contradicts itself",
    "K081": "a log of poses is none, or of another run than the trace",
}
"""Code -> what it means, one line each; the README's table is made from it."""
