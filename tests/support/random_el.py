"""Ontologies of OWL 2 EL drawn at random: a vocabulary, entries that extend it, and class expressions to ask for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from random import Random

from planlang.knowledge.axioms import Axioms, axioms_of, own_axioms_of
from planlang.knowledge.descriptions import Description, described
from planlang.knowledge.index import Index
from planlang.knowledge.names import Names, names_in
from planlang.knowledge.questions import read_question
from planlang.ontology import load
from planlang.ontology.convert import Target, convert_content

START = "http://example.org/el#"
_HEAD = f"Prefix: : <{START}>\nPrefix: owl: <http://www.w3.org/2002/07/owl#>\n"
_CLASSES = [f"C{number}" for number in range(12)]
_PROPERTIES = [f"p{number}" for number in range(5)]
_INDIVIDUALS = ["i0", "i1", "i2"]


@dataclass(frozen=True)
class Drawn:
    """Texts in Manchester syntax: frames of the vocabulary and of each entry, and questions."""

    vocabulary: str
    entries: dict[str, str]
    questions: tuple[str, ...]

    def whole(self) -> str:
        """Return one ontology of everything, in which question number n is the class Qn."""
        frames = f"{self.vocabulary}\n{''.join(self.entries.values())}"
        return f"{_HEAD}Ontology: <{START[:-1]}>\n{frames}{asked(self.questions)}"

    def answers(self, folder: Path) -> list[set[str]]:
        """Return what the index answers to each question when every entry is described on its own."""
        head = f"{_HEAD}Ontology: <{START[:-1]}>\n"
        (folder / "vocabulary.omn").write_text(head + self.vocabulary)
        vocabulary = load(folder / "vocabulary.omn", builtin=False)
        axioms = axioms_of(vocabulary)
        index = Index(axioms)
        for uid, frames in self.entries.items():
            index.add(uid, self._described(folder, uid, frames, axioms))
        names = Names(names_in(START + name for name in (*_CLASSES, *_PROPERTIES, *_INDIVIDUALS)))
        return [set(index.answers(read_question(text, names))) for text in self.questions]

    @staticmethod
    def _described(folder: Path, uid: str, frames: str, vocabulary: Axioms) -> Description:
        text = f"{_HEAD}Ontology: <urn:{uid}>\n{frames}"
        entry = load(folder / f"{uid}.omn", builtin=False, also=[folder / "vocabulary.omn"], content=text.encode())
        return described(START + uid, vocabulary, own_axioms_of(entry, vocabulary))


def asked(questions: Sequence[str]) -> str:
    """Return frames of classes Q0, Q1, ... that are equivalent to some expressions."""
    return "".join(f"Class: <{START}Q{n}>\n  EquivalentTo: {text}\n" for n, text in enumerate(questions))


def write_for_reasoners(text: str, path: Path) -> Path:
    """Write an ontology in Manchester syntax as RDF/XML without what only some readers read."""
    path.write_text(convert_content(text.encode(), path.with_suffix(".omn"), Target.RDFXML).text)
    return path


class Draw:
    """Draws ontologies. ``rich``: with ranges and chains of properties, and classes of single individuals."""

    def __init__(self, seed: int, *, rich: bool = False) -> None:
        self._random = Random(seed)
        self._rich = rich

    def ontology(self, entries: int = 8, questions: int = 25) -> Drawn:
        """Return a vocabulary with some entries and questions."""
        described = {f"E{number}": self._entry(number) for number in range(entries)}
        return Drawn(self._vocabulary(), described, tuple(self.expression(3, unions=True) for _ in range(questions)))

    def expression(self, depth: int = 2, *, unions: bool = False) -> str:
        """Return a class expression."""
        random, kind = self._random, self._random.random()
        if depth == 0 or kind < 0.4:
            return random.choice(_CLASSES)
        if kind < 0.75:
            return f"({random.choice(_PROPERTIES)} some {self.expression(depth - 1, unions=unions)})"
        if self._rich and kind < 0.8:
            return f"({random.choice(_PROPERTIES)} value {random.choice(_INDIVIDUALS)})"
        word = "or" if unions and kind > 0.95 else "and"
        return f"({self.expression(depth - 1, unions=unions)} {word} {self.expression(depth - 1, unions=unions)})"

    def _other(self, than: str) -> str:
        """Return another expression: some readers take no class that is equivalent to itself."""
        while (text := self.expression()) == than:
            pass
        return text

    def _vocabulary(self) -> str:
        return "\n".join((*self._properties(), *self._classes(), *self._individuals())) + "\n"

    def _properties(self) -> list[str]:
        random, lines = self._random, list[str]()
        for number, prop in enumerate(_PROPERTIES):
            lines.append(f"ObjectProperty: {prop}")
            lower = _PROPERTIES[:number]  # circles among chains are forbidden in OWL 2
            if random.random() < 0.5:
                lines.append(f"  SubPropertyOf: {random.choice(_PROPERTIES[number:])}")
            if random.random() < 0.25:
                lines.append(f"  Domain: {random.choice(_CLASSES)}")
            if random.random() < 0.25:
                lines.append("  Characteristics: Transitive")
            if self._rich and random.random() < 0.3:
                lines.append(f"  Range: {random.choice(_CLASSES)}")
            if self._rich and lower and random.random() < 0.5:
                lines.append(f"  SubPropertyChain: {' o '.join(random.choices(lower, k=random.choice((2, 3))))}")
        return lines

    def _classes(self) -> list[str]:
        random, lines = self._random, list[str]()
        for number, cls in enumerate(_CLASSES):
            lines.append(f"Class: {cls}")
            if number and random.random() < 0.8:
                lines.append(f"  SubClassOf: {_CLASSES[random.randrange(number)]}")
            if random.random() < 0.5:
                lines.append(f"  SubClassOf: {self.expression()}")
            if random.random() < 0.25:
                lines.append(f"  EquivalentTo: {self._other(cls)}")
        one = self.expression()
        lines.append(f"EquivalentClasses: {one}, {self._other(one)}")
        return lines

    def _individuals(self) -> list[str]:
        random, lines = self._random, list[str]()
        for individual in _INDIVIDUALS:
            lines.append(f"Individual: {individual}\n  Types: {random.choice(_CLASSES)}")
            if self._rich:
                lines.append(f"  Facts: {random.choice(_PROPERTIES)} {random.choice(_INDIVIDUALS)}")
        return lines

    def _entry(self, number: int) -> str:
        """Return a class below some expressions, with a property of its own."""
        random = self._random
        own = f"q{number}"
        lines = [f"ObjectProperty: {own}\n  SubPropertyOf: {random.choice(_PROPERTIES)}"]
        lines.append(f"Class: E{number}\n  SubClassOf: {own} some {random.choice(_CLASSES)}")
        lines += (f"  SubClassOf: {self.expression()}" for _ in range(random.randrange(1, 5)))
        lines.append(f"  SubClassOf: {random.choice(_PROPERTIES)} some Part{number}")
        lines.append(f"Class: Part{number}\n  SubClassOf: {self.expression()}")
        return "\n".join(lines) + "\n"
