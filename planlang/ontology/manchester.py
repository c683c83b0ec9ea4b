"""Manchester syntax: the driver of the parser, which continues after errors, its messages, and the scope of names."""

from __future__ import annotations

import re

from lark import UnexpectedInput

from planlang.diagnostics import BadInput, Diagnostic, Span, error, note
from planlang.files import decode, offset_of, position_of
from planlang.ontology.axioms import Axioms
from planlang.ontology.frames import Frames
from planlang.ontology.parsing import Grammar, unexpected, where, word_at
from planlang.ontology.terms import OWL, RDF, RDFS, XSD, expand, is_vocabulary, resolve
from planlang.ontology.triples import Parsed
from planlang.spelling import guess, similar

FRAME_WORDS = (
    "Class:", "ObjectProperty:", "DataProperty:", "AnnotationProperty:", "Datatype:", "Individual:",
    "EquivalentClasses:", "DisjointClasses:", "EquivalentProperties:", "DisjointProperties:", "SameIndividual:",
    "DifferentIndividuals:",
)  # fmt: skip
"""Keywords that begin a frame, or an axiom outside of frames."""

_SPOKEN = {
    "NAME": "a name",
    "FULL_IRI": "an <IRI>",
    "NODE": "a node _:name",
    "STRING": 'a "string"',
    "NUMBER": "a number",
    "BOOLEAN": "true or false",
    "PREFIX": "a prefix with its colon",
    "LANGUAGE": "a @language",
    "CHARACTERISTIC": "Functional, Transitive or another characteristic",
    "FACET": "a facet such as >=",
    "SELF": "Self",
    "$END": "the end of the file",
}
"""Names of the grammar's terminals in messages; the other terminals are keywords."""


def explain(problem: UnexpectedInput, text: str, offset: int, file: str) -> Diagnostic:
    """Make the diagnostic of a syntax error at an offset, with what was expected there."""
    message, keywords, spoken = unexpected(problem, GRAMMAR, _SPOKEN, text, offset)
    found, word = message.removeprefix("unexpected "), word_at(text, offset)
    if "," in keywords and word and _mends(",", text, offset):
        begins_line = not text[text.rfind("\n", 0, offset) + 1 : offset].strip()
        other = "" if begins_line or "some" not in spoken else ", or a word such as some,"
        message = f"a comma{other} is missing before {word[:40]}"
        return error("O020", message, position_of(text, offset, file), f"write `, {word[:40]}`")
    guessed = guess(found, {*keywords, *FRAME_WORDS} - {found}, least=0.75)
    return error("O020", message, position_of(text, offset, file), f"{guessed}expected: {_phrase(keywords, spoken)}")


def _mends(sign: str, text: str, offset: int) -> bool:
    """Check whether inserting a sign at an offset lets the parser read the word there, within the frame."""
    begin = max((one.start() for one in _FRAME_START.finditer(text, 0, offset)), default=0)
    following = _FRAME_START.search(text, offset)
    frame = f"{text[begin:offset]}{sign} {text[offset : following.start() if following else len(text)]}"
    names = _Names(frame, "", "")
    reader = Frames(Axioms("", "", frozenset(), frozenset()), names.resolve, names.is_class, "")
    try:
        GRAMMAR.parse(frame, reader)
    except UnexpectedInput as problem:
        return where(problem, frame) > offset - begin + len(sign) + len(word_at(text, offset))
    except BadInput:
        return True
    return True


def unclosed(text: str, offset: int) -> int | None:
    """Find the opening quotation mark of a string that ends just before a syntax error and was probably not closed.

    Such a string contains keywords of sections, or ends at the quotation mark that should open the next string.
    """
    last = next(
        (one for one in _BESIDE.finditer(text) if one.end() <= offset and not text[one.end() : offset].strip()), None
    )
    if last is None or last[0][0] != '"':
        return None
    is_joined = last.end() == offset and text[offset : offset + 1].isalnum()
    return last.start() if is_joined or _SECTION.search(last[0]) else None


def _phrase(keywords: list[str], spoken: list[str]) -> str:
    sections = [word for word in keywords if word.endswith(":")]
    parts = [*spoken, *(repr(word) for word in keywords if not word.endswith(":"))]
    if set(FRAME_WORDS) <= set(sections):
        sections = [word for word in sections if word not in FRAME_WORDS]
        parts.append("the next frame")
    if sections:
        parts.append(" ".join(sections))
    return ", ".join(parts[:-1]) + (" or " if len(parts) > 1 else "") + parts[-1] if parts else "nothing"


MOST_ERRORS = 20
"""Syntax errors reported of one file."""

_FRAME_START = re.compile(rf"^[ \t]*(?:{'|'.join(FRAME_WORDS)})(?=\s)", re.MULTILINE)
_SECTION = re.compile(r"^[ \t]*[A-Z]\w+:(?=\s)", re.MULTILINE)
_BESIDE = re.compile(r'"[^"\\]*(?:\\.[^"\\]*)*"|#[^\n]*|<[^<>\s]*>', re.DOTALL)
_PREFIX = re.compile(r"Prefix:(?<!\SPrefix:)\s*([^\s:<>]*):\s*<([^<>\s]*)>")
_ONTOLOGY = re.compile(r"Ontology:(?<!\SOntology:)\s*<([^<>\s]*)>")
_CLASS = re.compile(r"Class:(?<!\SClass:)\s+(\S+)")
_DECLARED = re.compile(r"Data(?<!\SData)(Property|type):\s+(\S+)")
"""Patterns with a literal start, which ``re`` finds many times faster than a pattern that starts with a look-behind."""

_COUNTED = ("LPAR", "LBRACE", "NOT", "INVERSE", "SOME", "ONLY", "MIN", "MAX", "EXACTLY", "_ANNOTATIONS", "COMMA")
"""Terminals after which expressions or annotations can be nested, and the comma, which ends an item."""


GRAMMAR = Grammar("manchester", Frames, _COUNTED)


def read_manchester(content: bytes | str, file: str, *, base: str, label: str = "b") -> Parsed:
    """Read a file in Manchester syntax. ``base`` is its address unless ``Ontology:`` has an IRI.

    ``label`` is the prefix of blank-node labels. Raises BadInput with all syntax errors, each with its position and
    what was expected there.
    """
    text = decode(content, file)
    names = _Names(text, file, base)
    statements = Axioms(file, label, names.declared("Property"), names.declared("type"))
    problems: list[Diagnostic] = []
    frames = Frames(statements, names.resolve, names.is_class, file)
    rest: str | None = text
    while rest is not None:
        rest = _parse(rest, file, frames, problems)
    problems = sorted(problems + names.problems, key=lambda problem: problem.span or Span(file))
    if problems:
        raise BadInput(problems[:MOST_ERRORS])
    return Parsed(statements.triples, names.notes + frames.skipped, names.prefixes)


def _parse(text: str, file: str, frames: Frames, problems: list[Diagnostic]) -> str | None:
    """Parse up to the first syntax error, and return the text with everything before the next frame made blank.

    Line numbers stay the same. None: the end of the file was reached, or there are too many errors.
    """
    try:
        GRAMMAR.parse(text, frames)
        return None
    except BadInput as problem:
        problems.extend(problem.diagnostics)
        if any(found.code == "O003" for found in problem.diagnostics):
            return None
        span = problem.diagnostics[0].span
        offset = len(text) if span is None else offset_of(text, span)
    except UnexpectedInput as problem:
        offset = where(problem, text)
        opening = unclosed(text, offset)
        if opening is None:
            problems.append(explain(problem, text, offset, file))
        else:
            line = text.count("\n", 0, offset) + 1
            advice = f"close it where it should end; it runs up to the next quotation mark, in line {line}"
            problems.append(error("O020", "a string is not closed", position_of(text, opening, file), advice))
            offset = opening
    start = len(text) - len(text.lstrip())
    following = _FRAME_START.search(text, max(offset, start + 1))
    if following is None or len(problems) >= MOST_ERRORS:
        return None
    return re.sub(r"[^\n]", " ", text[: following.start()]) + text[following.start() :]


class _Names:
    """Resolves names of a file to IRIs, and collects diagnostics of those that cannot be resolved."""

    def __init__(self, text: str, file: str, base: str) -> None:
        self.prefixes: dict[str, str] = {"rdf": RDF, "rdfs": RDFS, "owl": OWL, "xsd": XSD}
        words = _BESIDE.sub(lambda found: found[0] if found[0][0] == "<" else " ", text)  # without texts and comments
        self.prefixes |= dict(_PREFIX.findall(words))
        self.problems: list[Diagnostic] = []
        self.notes: list[Diagnostic] = []
        self._noted = False
        self._words = words
        self._file = file
        ontology = _ONTOLOGY.search(words)
        self._own = (ontology[1] if ontology else base).rstrip("#") + "#"
        self.prefixes = {name: resolve(base, self._absolute(start)) for name, start in self.prefixes.items()}
        self._known: dict[str, str] = {}
        self._classes = frozenset(_CLASS.findall(words))

    def declared(self, frame: str) -> frozenset[str]:
        """IRIs with a frame ``DataProperty`` or ``Datatype``; ``frame`` is the keyword without Data."""
        names = (name for kind, name in _DECLARED.findall(self._words) if kind == frame)
        return frozenset(iri for name in names if (iri := self._iri(name)) is not None)

    def is_class(self, name: str) -> bool:
        """Check whether the file has a frame for a class of this name."""
        return name in self._classes

    def resolve(self, name: str, span: Span) -> str:
        """Resolve ``<IRI>``, ``prefix:name`` or ``name`` to an IRI; an unknown prefix is an error and gets a dummy."""
        iri = self._known.get(name)
        if iri is None:
            iri = self._iri(name)
            if iri is None:
                prefix = name.partition(":")[0]
                alike = similar(prefix, self.prefixes)
                guessed = f"did you mean {alike[0]}:? " if alike else ""
                advice = f"{guessed}declare it: Prefix: {prefix}: <http://...#>"
                self.problems.append(error("O021", f"unknown prefix {prefix}: in {name}", span, advice))
                iri = self._own + name
            self._known[name] = iri
            if ":" not in name and "" not in self.prefixes and not self._noted:
                self._note_bare_names(span)
        return iri

    def _iri(self, name: str) -> str | None:
        if name.startswith("<"):
            return self._absolute(name[1:-1])
        prefix, colon, local = name.rpartition(":")
        if colon or "" in self.prefixes:
            namespace = self.prefixes.get(prefix)
            return None if namespace is None else namespace + local
        return expand(name) if is_vocabulary(name) else self._own + name

    def _absolute(self, iri: str) -> str:
        if not iri or iri.startswith("#"):
            return self._own.rstrip("#") + iri
        return iri

    def _note_bare_names(self, span: Span) -> None:
        self._noted = True
        advice = f"declare it for names of this file: Prefix: : <{self._own}>"
        message = f"the prefix ':' is not declared; names are read as KnowRob's if it has them, else as {self._own}NAME"
        self.notes.append(note("O022", message, span, advice))
