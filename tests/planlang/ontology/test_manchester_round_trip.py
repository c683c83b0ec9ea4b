"""Generated class expressions, written in Manchester syntax and read, are what they were."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from planlang.diagnostics import BadInput, Diagnostic
from planlang.ontology import BNode, Literal, Term, Triple
from planlang.ontology.manchester import read_manchester
from planlang.ontology.terms import OWL, RDF, RDFS

T = "http://example.org/t#"
NAMES = ("A", "Bed-PieceOfFurniture", "some", "value", "max", "o", "a.b", "Möbel", "x1", "and", "Types", "Self", "min")

TOKENS = [
    *("Class:", "Individual:", "ObjectProperty:", "SubClassOf:", "Types:", "Facts:", "Annotations:", "HasKey:"),
    *("Characteristics:", "Prefix:", "Ontology:", "Import:", "DisjointClasses:", "Functional", "A", "p", "x:y", "_:n"),
    *("<http://x>", "some", "only", "value", "min", "and", "or", "not", "inverse", "Self", "o", "true", "3", "2.5"),
    *("(", ")", "{", "}", "[", ",", '"t"', '"', "@en", "^^", "\n# a comment\n"),
]

Expression = tuple[object, ...]

names = st.sampled_from(NAMES).map(lambda name: ("name", name))
values = st.one_of(
    names.filter(lambda name: name[1] != "and"),
    st.text(st.characters(codec="utf-8", exclude_characters="\r\x00"), max_size=8).map(lambda text: ("text", text)),
    st.integers(-99, 99).map(lambda number: ("integer", str(number))),
)


def _compound(inner: st.SearchStrategy[Expression]) -> st.SearchStrategy[Expression]:
    several = st.lists(inner, min_size=2, max_size=3).map(tuple)
    return st.one_of(
        st.tuples(st.just("and"), several),
        st.tuples(st.just("or"), several),
        st.tuples(st.just("not"), inner),
        st.tuples(st.sampled_from(["some", "only"]), names, inner),
        st.tuples(st.just("value"), names, values),
        st.tuples(st.sampled_from(["min", "max", "exactly"]), names, st.integers(0, 9), inner),
        st.tuples(st.just("one of"), st.lists(names, min_size=1, max_size=3).map(tuple)),
    )


expressions = st.recursive(names, _compound, max_leaves=12)


def written(expression: Expression) -> str:
    match expression:
        case ("name", str(name)):
            return name
        case ("text", str(text)):
            return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
        case ("integer", str(number)):
            return number
        case ("and" | "or" as word, tuple(parts)):
            return f" {word} ".join(f"({written(part)})" for part in parts)
        case ("not", part):
            return f"not ({written(part)})"
        case ("value", prop, value):
            return f"{written(prop)} value {written(value)}"
        case ("some" | "only" as word, prop, filler):
            return f"{written(prop)} {word} ({written(filler)})"
        case ("one of", tuple(parts)):
            return "{" + ", ".join(written(part) for part in parts) + "}"
        case (word, prop, number, filler):
            return f"{written(prop)} {word} {number} ({written(filler)})"
    raise AssertionError(expression)


class Reader:
    """Makes expressions of triples again."""

    def __init__(self, triples: list[Triple]) -> None:
        self.said: dict[object, dict[str, Term]] = {}
        for triple in triples:
            self.said.setdefault(triple.subject, {})[triple.predicate] = triple.object

    def expression(self, term: Term) -> Expression:
        if isinstance(term, str):
            return ("name", term.removeprefix(T))
        if isinstance(term, Literal):
            return ("integer" if term.datatype else "text", term.value)
        said = self.said[term]
        if said[RDF.type] == OWL.Restriction:
            return self.restriction(said)
        assert said[RDF.type] == OWL.Class
        for word, predicate in (("and", "intersectionOf"), ("or", "unionOf"), ("one of", "oneOf")):
            if OWL + predicate in said:
                return (word, self.items(said[OWL + predicate]))
        return ("not", self.expression(said[OWL.complementOf]))

    def restriction(self, said: dict[str, Term]) -> Expression:
        prop = self.expression(said[OWL.onProperty])
        for word, predicate in (("some", "someValuesFrom"), ("only", "allValuesFrom"), ("value", "hasValue")):
            if OWL + predicate in said:
                return (word, prop, self.expression(said[OWL + predicate]))
        for word, predicate in (("min", "minQ"), ("max", "maxQ"), ("exactly", "q")):
            number = said.get(f"{OWL}{predicate}ualifiedCardinality")
            if isinstance(number, Literal):
                return (word, prop, int(number.value), self.expression(said[OWL.onClass]))
        raise AssertionError(said)

    def items(self, cell: Term) -> tuple[Expression, ...]:
        found = []
        while cell != RDF.nil:
            assert isinstance(cell, BNode)
            found.append(self.expression(self.said[cell][RDF.first]))
            cell = self.said[cell][RDF.rest]
        return tuple(found)


@given(st.lists(expressions, min_size=1, max_size=4))
@settings(max_examples=150, deadline=None)
def test_expressions_survive_writing_and_reading(generated: list[Expression]) -> None:
    text = f"Prefix: : <{T}>\nClass: subject\n    SubClassOf: {', '.join(map(written, generated))}\n"
    triples = read_manchester(text.encode(), "t.omn", base="http://example.org/base").triples
    reader = Reader(triples)
    read = [t.object for t in triples if t.subject == T + "subject" and t.predicate == RDFS.subClassOf]
    assert [reader.expression(term) for term in read] == generated


@given(st.text(max_size=200))
@settings(max_examples=200, deadline=None)
def test_any_text_is_read_or_refused_with_positions(text: str) -> None:
    found = problems(text)
    assert all(d.span is not None and d.span.line > 0 and d.span.column > 0 for d in found)


@given(st.lists(st.sampled_from(TOKENS), max_size=30))
@settings(max_examples=200, deadline=None)
def test_any_words_of_the_language_are_read_or_refused_with_positions(tokens: list[str]) -> None:
    found = problems(" ".join(tokens))
    assert all(d.span is not None and d.span.line > 0 and d.span.column > 0 for d in found)


def problems(text: str) -> tuple[Diagnostic, ...]:
    try:
        read_manchester(text.encode(errors="surrogatepass"), "t.omn", base="http://example.org/base")
    except BadInput as problem:
        return problem.diagnostics
    return ()
