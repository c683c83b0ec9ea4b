"""Ways to break a file: its bytes, or the triples that it states."""

from __future__ import annotations

import random
from collections.abc import Callable

from planlang.diagnostics import BadInput, Span
from planlang.ontology import BNode, Literal, Term, Triple
from planlang.ontology.documents import read_syntax
from planlang.ontology.nested_writers import ntriples
from planlang.ontology.terms import OWL, RDF, RDFS, XSD

Random = random.Random
Bytes = Callable[[Random, bytearray, bytes], None]
Triples = Callable[[Random, list[Triple]], None]

ODD = (
    *(
        b"\x00",
        b"\xff",
        b"<",
        b">",
        b'"',
        b"&",
        b"#",
        b":",
        b"\\",
        b"(",
        b"[",
        b"{",
        b"\xc3",
        b"]]>",
        b"<!--",
        b"&amp;",
    ),
    *(b"  ", b"\r", b"\n\n", b"1e999", b"-1", b"99999999999999999999", b"nan", b"\xe2\x80\xae", b"\xef\xbb\xbf"),
    *(b"not ", b"some ", b"Class: ", b"rdf:nil", b"__import__", b"{0}", b"%s", b"../", b"file:///"),
)


def _place(draw: Random, content: bytearray) -> int:
    return draw.randrange(len(content) + 1)


def _slice(draw: Random, content: bytes | bytearray, longest: int = 400) -> tuple[int, int]:
    begin = draw.randrange(len(content) + 1)
    return begin, min(len(content), begin + draw.randint(1, longest))


def flip(draw: Random, content: bytearray, other: bytes) -> None:
    for _ in range(draw.choice((1, 1, 2, 8))):
        if content:
            content[draw.randrange(len(content))] ^= 1 << draw.randrange(8)


def insert(draw: Random, content: bytearray, other: bytes) -> None:
    at = _place(draw, content)
    content[at:at] = draw.choice(ODD)


def truncate(draw: Random, content: bytearray, other: bytes) -> None:
    del content[_place(draw, content) :]


def cut(draw: Random, content: bytearray, other: bytes) -> None:
    begin, end = _slice(draw, content)
    del content[begin:end]


def duplicate(draw: Random, content: bytearray, other: bytes) -> None:
    begin, end = _slice(draw, content)
    at = _place(draw, content)
    content[at:at] = content[begin:end] * draw.choice((1, 1, 2, 30))


def splice(draw: Random, content: bytearray, other: bytes) -> None:
    begin, end = _slice(draw, other, 2000)
    at = _place(draw, content)
    content[at : at + draw.choice((0, end - begin))] = other[begin:end]


def swap_lines(draw: Random, content: bytearray, other: bytes) -> None:
    lines = content.split(b"\n")
    one, two = draw.randrange(len(lines)), draw.randrange(len(lines))
    lines[one], lines[two] = lines[two], lines[one]
    content[:] = b"\n".join(lines)


def swap_words(draw: Random, content: bytearray, other: bytes) -> None:
    words = content.split(b" ")
    one, two = draw.randrange(len(words)), draw.randrange(len(words))
    words[one], words[two] = words[two], words[one]
    content[:] = b" ".join(words)


BYTES: tuple[Bytes, ...] = (flip, insert, truncate, cut, duplicate, splice, swap_lines, swap_words)


def _any(draw: Random, triples: list[Triple]) -> int:
    return draw.randrange(len(triples))


def _changed(triple: Triple, **parts: object) -> Triple:
    kept = {"subject": triple.subject, "predicate": triple.predicate, "object": triple.object, "span": triple.span}
    return Triple(**(kept | parts))  # type: ignore[arg-type]


def _resource(draw: Random, triples: list[Triple]) -> str | BNode:
    triple = triples[_any(draw, triples)]
    choices = [term for term in (triple.subject, triple.object) if not isinstance(term, Literal)]
    return draw.choice(choices)


def drop(draw: Random, triples: list[Triple]) -> None:
    for _ in range(draw.choice((1, 1, 3))):
        if triples:
            del triples[_any(draw, triples)]


def repeat(draw: Random, triples: list[Triple]) -> None:
    triple = triples[_any(draw, triples)]
    triples.append(_changed(triple, subject=_resource(draw, triples)))


def swap(draw: Random, triples: list[Triple]) -> None:
    one, two = _any(draw, triples), _any(draw, triples)
    first, second = triples[one].object, triples[two].object
    triples[one], triples[two] = _changed(triples[one], object=second), _changed(triples[two], object=first)


def turn_round(draw: Random, triples: list[Triple]) -> None:
    at = _any(draw, triples)
    triple = triples[at]
    if not isinstance(triple.object, Literal):
        triples[at] = _changed(triple, subject=triple.object, object=triple.subject)


def retarget(draw: Random, triples: list[Triple]) -> None:
    at = _any(draw, triples)
    value: Term = _resource(draw, triples)
    if draw.random() < 0.3:
        value = Literal(draw.choice(("", "x", "-1", "1e400", "NaN", "true", "a\nb", "__class__")),
                        draw.choice((None, XSD.double, XSD.integer, "http://example.org/no#type")))  # fmt: skip
    triples[at] = _changed(triples[at], object=value)


def retype(draw: Random, triples: list[Triple]) -> None:
    at = _any(draw, triples)
    triples[at] = _changed(triples[at], predicate=triples[_any(draw, triples)].predicate)


def cycle(draw: Random, triples: list[Triple]) -> None:
    """A node from which the way leads back to it: a list, a taxonomy, or any property."""
    lists = [at for at, triple in enumerate(triples) if triple.predicate in (RDF.rest, RDF.first)]
    if lists and draw.random() < 0.5:
        at = draw.choice(lists)
        triples[at] = _changed(triples[at], object=triples[draw.choice(lists)].subject)
        return
    predicate = draw.choice((RDFS.subClassOf, OWL.equivalentClass, RDF.type, triples[_any(draw, triples)].predicate))
    nodes = [_resource(draw, triples) for _ in range(draw.choice((1, 2, 3)))]
    for one, two in zip(nodes, nodes[1:] + nodes[:1], strict=True):
        triples.append(Triple(one, predicate, two, Span("")))


def unlist(draw: Random, triples: list[Triple]) -> None:
    lists = [at for at, triple in enumerate(triples) if triple.predicate == RDF.rest]
    if lists:
        at = draw.choice(lists)
        triples[at] = _changed(triples[at], object=draw.choice((Literal("end"), BNode("nowhere"), RDF.nil, RDF.type)))


def shuffle(draw: Random, triples: list[Triple]) -> None:
    draw.shuffle(triples)


def merge(draw: Random, triples: list[Triple]) -> None:
    """Two things become one."""
    one, two = _resource(draw, triples), _resource(draw, triples)
    for at, triple in enumerate(triples):
        subject = one if triple.subject == two else triple.subject
        triples[at] = _changed(triple, subject=subject, object=one if triple.object == two else triple.object)


TRIPLES: tuple[Triples, ...] = (drop, repeat, swap, turn_round, retarget, retype, cycle, unlist, shuffle, merge)


def mutated(draw: Random, content: bytes, other: bytes, name: str) -> tuple[bytes, tuple[str, ...]]:
    """A broken version of a file's content, and the names of what was done to it."""
    if draw.random() < 0.5:
        try:
            triples = list(read_syntax(content, name, base="http://example.org/fuzz.owl", label="b").triples)
        except BadInput:
            triples = []
        if triples:
            steps = [draw.choice(TRIPLES) for _ in range(draw.choice((1, 1, 2, 4)))]
            for change in steps:
                if triples:
                    change(draw, triples)
            return ntriples(triples).encode(errors="surrogatepass"), tuple(step.__name__ for step in steps)
    changed = bytearray(content)
    breaks = [draw.choice(BYTES) for _ in range(draw.choice((1, 1, 2, 4)))]
    for broken in breaks:
        broken(draw, changed, other)
    return bytes(changed), tuple(step.__name__ for step in breaks)
