"""Reads every ontology below a folder, and compares its triples with those that other readers find.

``python -m tests.benchmarks.ontologies_tried FOLDER`` prints a row for each file: its syntax, the triples that we read
and those of the other reader, how many of each the other one lacks, and our CPU time. RDF/XML and Turtle are compared
with rdflib, functional syntax and OWL/XML with py-horned-owl, whose axioms are taken as triples. A restriction
to at least one ``owl:Thing`` is one without a class for py-horned-owl, which makes five triples of ours four.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from pathlib import Path

import pyhornedowl
import rdflib

from planlang.diagnostics import BadInput
from planlang.files import ONTOLOGIES, decode
from planlang.ontology.canonical import differences
from planlang.ontology.documents import Syntax, read_syntax, syntax_of
from planlang.ontology.triples import Triples

BASE = "http://example.org/base"
FORMATS = {Syntax.RDFXML: "xml", Syntax.TURTLE: "turtle", Syntax.FUNCTIONAL: "ofn", Syntax.OWLXML: "owx"}
MOST = 60_000
"""Greatest number of triples that are compared."""


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    files = sorted(path for path in parser.parse_args().folder.rglob("*") if path.name.endswith(ONTOLOGIES))
    print(
        "| file | syntax | triples | of the other | only ours | only the other's | s |\n|---|---|---|---|---|---|---|"
    )
    for path in files:
        print(f"| {path.name} | {' | '.join(row(path))} |", flush=True)


def row(path: Path) -> Iterator[str]:
    """Yield the cells of a file's row, from its syntax on."""
    begin = time.process_time()
    try:
        content = path.read_bytes()
        syntax = syntax_of(decode(content, str(path)), str(path))
        ours = read_syntax(content, str(path), base=BASE, label="b").triples
    except BadInput as problem:
        yield from ("refused", "", "", "", "", str(problem.diagnostics[0]).splitlines()[0][:100].replace("|", "/"))
        return
    seconds = time.process_time() - begin
    yield from (syntax.value, f"{distinct(ours)}")
    theirs = None
    if syntax in FORMATS and len(ours) <= MOST:
        try:
            theirs = oracle(content.decode("utf-8", "replace"), FORMATS[syntax])
        except Exception as problem:  # whatever another reader raises
            yield from (f"refused: {str(problem).splitlines()[0][:60]}".replace("|", "/"), "", "")
    if theirs is not None:
        only_ours, only_theirs = differences(ours, theirs)
        yield from (f"{distinct(theirs)}", f"{len(only_ours)}", f"{len(only_theirs)}")
    elif syntax not in FORMATS or len(ours) > MOST:
        yield from ("", "", "")
    yield f"{seconds:.2f}"


def distinct(triples: Triples) -> int:
    """Number of triples, each counted once."""
    return len({(one.subject, one.predicate, one.object) for one in triples})


def oracle(text: str, kind: str) -> Triples:
    """Read a text with the other reader."""
    if kind in ("ofn", "owx"):
        text, kind = pyhornedowl.open_ontology_from_string(text, kind).save_to_string("rdf"), "xml"
    rdflib.NORMALIZE_LITERALS = False  # it would write 0.60 as 0.6
    found = rdflib.Graph().parse(data=text, format=kind, publicID=BASE).serialize(format="nt")
    return read_syntax(found.encode(), "oracle.nt", base=BASE, label="o").triples


if __name__ == "__main__":
    main()
