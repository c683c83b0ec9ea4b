"""Writes graphs in OWL/XML: the axioms of functional syntax, which has the same words, as elements."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from xml.sax.saxutils import escape, quoteattr

from planlang.ontology.canonical import Sorting
from planlang.ontology.functional_writer import Word, document_of
from planlang.ontology.nested_writers import is_legal
from planlang.ontology.structures import AXIOMS, ENTITIES, EXPRESSIONS, fitted
from planlang.ontology.terms import OWL, BNode, Literal, Term, Triple

_OF_KIND = {"class": "Class", "range": "Datatype", "property": "ObjectProperty", "chain": "ObjectProperty",
            "individual": "NamedIndividual", "value": "IRI"}  # fmt: skip
"""Kind of a part -> element of a name there."""
_OF_NAME = {"DisjointUnion": "Class", "DatatypeDefinition": "Datatype", "DatatypeRestriction": "Datatype",
            "ObjectInverseOf": "ObjectProperty"}  # fmt: skip
"""Word whose names are no properties of data -> their element."""


def owlxml(
    triples: Iterable[Triple], prefixes: Mapping[str, str], *, order: Sorting = Sorting.TERMS
) -> tuple[str, list[Triple]]:
    """Write a graph; also return the triples that OWL/XML cannot express.

    Equal graphs give equal texts if sorted. In the order of the file, unused prefixes are kept, too.
    """
    given = list(triples)
    document = document_of([triple for triple in given if is_legal(triple)], prefixes, order=order)
    attributes = zip(("xmlns", "ontologyIRI", "versionIRI"), (str(OWL), *document.names), strict=False)
    head = "".join(f"\n    {name}={quoteattr(value)}" for name, value in attributes)
    lines = [f"  <Prefix name={quoteattr(name)} IRI={quoteattr(iri)}/>\n" for name, iri in document.prefixes]
    lines += (line for word in (*document.header, *document.axioms) for line in _element(word, "  "))
    text = f'<?xml version="1.0" encoding="UTF-8"?>\n<Ontology{head}>\n{"".join(lines)}</Ontology>\n'
    return text, [*(triple for triple in given if not is_legal(triple)), *document.lost]


def _element(one: Word, pad: str) -> Iterator[str]:
    match one:
        case Word("Import", (str(iri),)):
            yield f"{pad}<Import>{escape(iri)}</Import>\n"
        case Word(word, (str(iri),)) if word in ENTITIES:
            yield f"{pad}<{word} IRI={quoteattr(iri)}/>\n"
        case Word(word, (Literal(number), *parts)) if word.endswith("Cardinality"):
            yield f'{pad}<{word} cardinality="{number}">\n'
            yield from _parts(word, parts, f"{pad}  ")
            yield f"{pad}</{word}>\n"
        case Word(word, parts):
            notes = [part for part in parts if isinstance(part, Word) and part.word == "Annotation"]
            yield f"{pad}<{word}>\n"
            for note in notes:
                yield from _element(note, f"{pad}  ")
            yield from _parts(word, parts[len(notes) :], f"{pad}  ")
            yield f"{pad}</{word}>\n"


def _parts(word: str, parts: Sequence[Term | Word], pad: str) -> Iterator[str]:
    match word, parts:
        case "HasKey", (first, Word(parts=of_objects), Word(parts=of_data)):
            yield from _part(first, "Class", pad)
            for kind, group in (("ObjectProperty", of_objects), ("DataProperty", of_data)):
                for part in group:
                    yield from _part(part, kind, pad)
        case "DatatypeRestriction", (base, *facets):
            yield from _part(base, "Datatype", pad)
            for facet, value in zip(facets[::2], facets[1::2], strict=True):
                yield f"{pad}<FacetRestriction facet={quoteattr(str(facet))}>\n"
                yield from _part(value, "", f"{pad}  ")
                yield f"{pad}</FacetRestriction>\n"
        case _:
            for part, kind in zip(parts, _elements_of_names(word, len(parts)), strict=True):
                yield from _part(part, kind, pad)


def _part(part: Term | Word, kind: str, pad: str) -> Iterator[str]:
    match part:
        case Word():
            yield from _element(part, pad)
        case BNode(label):
            yield f"{pad}<AnonymousIndividual nodeID={quoteattr(f'_:{label}')}/>\n"
        case Literal(value, datatype, language):
            of = f" xml:lang={quoteattr(language)}" if language else ""
            of = f" datatypeIRI={quoteattr(datatype)}" if datatype else of
            yield f"{pad}<Literal{of}>{escape(value, {chr(13): '&#13;'})}</Literal>\n"
        case _:
            yield f"{pad}<IRI>{escape(part)}</IRI>\n" if kind == "IRI" else f"{pad}<{kind} IRI={quoteattr(part)}/>\n"


def _elements_of_names(word: str, count: int) -> Iterator[str]:
    """Yield the element of a name at each place of a word's parts."""
    if word == "Declaration":
        yield ""
        return
    if "Annotation" in word:
        is_pair = word == "SubAnnotationPropertyOf"
        yield from ["AnnotationProperty", *["AnnotationProperty" if is_pair else "IRI"] * (count - 1)]
        return
    of_name = _OF_NAME.get(word, "DataProperty")
    wanted = (EXPRESSIONS.get(word) or AXIOMS[word]).parts.removeprefix("number ")
    yield from (_OF_KIND.get(kind, of_name) for kind in fitted(wanted, count) or ())
