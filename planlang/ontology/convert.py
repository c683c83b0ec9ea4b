"""Convert a file to another syntax, and list what is lost."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, Span, note, warning
from planlang.files import Target as Target
from planlang.files import decode, position_of
from planlang.ontology.bson import is_bson
from planlang.ontology.canonical import Sorting, differences, labelled
from planlang.ontology.checks import malformed, repair
from planlang.ontology.documents import Syntax, base_of, read_bytes, read_syntax, syntax_of
from planlang.ontology.functional_writer import functional
from planlang.ontology.manchester_writer import manchester
from planlang.ontology.nested_writers import ntriples, rdfxml, turtle
from planlang.ontology.owlxml_writer import owlxml
from planlang.ontology.terms import OWL, RDF, BNode, Literal, Term, Triple
from planlang.records import dataclass

_HEAD = re.compile(r"@prefix|Prefix[:(]|Ontology\(|\)$|<\?xml|</?rdf:RDF|</?Ontology\b|xmlns|<Prefix\b")
"""Beginnings of the lines of a file, as it is written here, that state nothing of its terms."""


@dataclass(frozen=True, slots=True)
class Converted:
    """Converted text, the triples that it was made from, and diagnostics of reading and writing."""

    text: str
    triples: tuple[Triple, ...]
    diagnostics: tuple[Diagnostic, ...]
    unread: tuple[Diagnostic, ...] = ()
    """Errors about things of the file that the text lacks."""


def write(
    triples: Iterable[Triple], target: Target, prefixes: Mapping[str, str], *, order: Sorting = Sorting.TERMS
) -> tuple[str, list[Triple]]:
    """Write a graph; also return the triples that the syntax cannot express. Equal graphs give equal texts.

    In the order of the file, unused prefixes are kept, too.
    """
    given = list(triples)
    own = next((t.subject for t in given if t.predicate == RDF.type and t.object == OWL.Ontology), None)
    name = own if isinstance(own, str) else None
    match target:
        case Target.MANCHESTER:
            return manchester(given, prefixes, order=order)
        case Target.TURTLE:
            return turtle(given, prefixes, name, order=order), []
        case Target.NTRIPLES:
            return ntriples(labelled(given, order=order)), []
        case Target.FUNCTIONAL:
            return functional(given, prefixes, order=order)
        case Target.OWLXML:
            return owlxml(given, prefixes, order=order)
        case Target.RDFXML:
            return rdfxml(given, prefixes, name, order=order)


def excerpt(triples: Iterable[Triple], target: Target, prefixes: Mapping[str, str]) -> str:
    """Write some statements in one line, to be put among those of a file: without prefixes and the ontology."""
    lines = map(str.strip, write(triples, target, prefixes)[0].splitlines())
    return " ".join(line for line in lines if line and not _HEAD.match(line))


def convert(path: Path, target: Target, value: Callable[[Literal], Literal] | None = None) -> Converted:
    """Read a file in any syntax and write it in another, in the same order, without its imports.

    ``value`` maps each literal to the one to write, for example in another unit. The text is read again and compared
    with the file; diagnostics list statements that are lost or expressed differently, and the mistakes that were
    repaired on reading. Raises BadInput if the file cannot be read.
    """
    return convert_content(read_bytes(path), path, target, value, order=Sorting.FILE)


def convert_content(
    content: bytes,
    path: Path,
    target: Target,
    value: Callable[[Literal], Literal] | None = None,
    *,
    order: Sorting = Sorting.TERMS,
) -> Converted:
    """Convert the content of a file, which need not exist (any more), as :func:`convert` does."""
    file = str(path)
    base = base_of(path)
    parsed = read_syntax(content, file, base=base, label="b")
    repairs = repair(parsed.triples)
    triples: Sequence[Triple] = list(parsed.triples)
    if value is not None:
        triples = [
            replace(one, object=value(one.object)) if isinstance(one.object, Literal) else one for one in triples
        ]
    beside = _beside(content, file, parsed.prefixes, target) if order is Sorting.FILE else []
    text, lost = write(triples, target, parsed.prefixes, order=order)
    again = read_syntax(text.encode(), "the text", base=base, label="b").triples if text.strip() else ()
    compared = _compared(triples, lost, again, target, Span(file))
    diagnostics = (*parsed.diagnostics, *repairs, *malformed(parsed.triples), *compared, *beside)
    return Converted(text, tuple(triples), diagnostics, tuple(parsed.unread))


_COMMENT = re.compile(r'"""[\s\S]*?"""|"(?:\\.|[^"\\])*"|<!--|<[^<>\s]*>|(#[^\n]*)')
"""Strings and IRIs, which contain no comments, the start of XML comments, and (the group) other comments."""


def _beside(content: bytes, file: str, prefixes: Mapping[str, str], target: Target) -> list[Diagnostic]:
    """Make a note of comments and prefixes of a file that the other syntax does not keep."""
    text = "" if is_bson(content) else decode(content, file)
    syntax = syntax_of(text, file) if text else Syntax.NEEM
    is_xml = syntax in (Syntax.RDFXML, Syntax.OWLXML, Syntax.URDF)
    comments = () if syntax is Syntax.NEEM else _COMMENT.finditer(text)
    places = [match.start() for match in comments if (match[0] == "<!--" if is_xml else match[1] is not None)]
    lost = [f"{len(places)} comments" if len(places) > 1 else "a comment"] if places else []
    if target is Target.NTRIPLES and prefixes:
        lost.append(f"{len(prefixes)} prefixes" if len(prefixes) > 1 else "a prefix")
    if not lost:
        return []
    verb = "are" if len(places) > 1 or len(lost) > 1 or lost[0][0] != "a" else "is"
    where = position_of(text, places[0], file) if places else Span(file)
    return [note("O053", f"{' and '.join(lost)} {verb} not kept", where)]


def _compared(
    triples: Sequence[Triple], lost: Sequence[Triple], again: Sequence[Triple], target: Target, span: Span
) -> list[Diagnostic]:
    found = []
    name = {
        Target.MANCHESTER: "Manchester syntax",
        Target.RDFXML: "RDF/XML",
        Target.FUNCTIONAL: "functional syntax",
        Target.OWLXML: "OWL/XML",
    }.get(target, target.value)
    if lost:
        first = min(lost, key=lambda triple: triple.span)
        what = f"{len(lost)} statements" if len(lost) > 1 else "a statement"
        message = f"{name} cannot express {what}: {_shown(first)}{' and others' if len(lost) > 1 else ''}"
        found.append(warning("O050", message, first.span, "convert to turtle or ntriples, which can express all"))
    missing = set(lost)
    gone, new = differences([triple for triple in labelled(triples) if triple not in missing], again)
    declared = [t for t in new if t.predicate == RDF.type and isinstance(t.object, str) and isinstance(t.subject, str)]
    if declared:
        names = ", ".join(dict.fromkeys(local_name(str(triple.subject)) for triple in declared[:3]))
        more = f" and {len(declared) - 3} more" if len(declared) > 3 else ""
        message = f"{name} declares what the file does not: {names}{more}"
        found.append(note("O051", message, span))
    if gone:
        first = min(gone, key=lambda triple: triple.span)
        message = f"{name} expresses a statement in another way: {_shown(first)}"
        advice = "nothing is to be done, unless a program needs these very triples"
        found.append(warning("O052", message, first.span, advice))
    return found


def _shown(triple: Triple) -> str:
    return " ".join(_name(term) for term in (triple.subject, triple.predicate, triple.object))


def _name(term: Term) -> str:
    if isinstance(term, BNode):
        return "..."
    return (local_name(term) or term if isinstance(term, str) else str(term))[:60]
