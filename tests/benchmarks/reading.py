"""Measure what reading costs: each syntax against the library that reads it elsewhere, a recipe with its vocabulary.

First the vocabulary of actions in every syntax: seconds here, seconds of rdflib or horned-owl for the same text in the
same run, and their ratio. Then compiling the bundled recipe in a process, vocabulary included, with the cache of parsed
files and without, in multiples of rdflib reading that vocabulary. The best of several runs counts.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import pyhornedowl
import rdflib

from planlang.files import bundled
from planlang.ontology.convert import Target, write
from planlang.ontology.documents import read_syntax

REPETITIONS = 5
VOCABULARY = bundled("ontologies") / "knowrob.omn"
COMPILE = """
import time, sys
from pathlib import Path
import planlang.compiler
from planlang.files import bundled
recipe = bundled("recipes") / "serve_a_drink.omn"
began = time.perf_counter()
planlang.compiler.compile_recipe(recipe)
print(time.perf_counter() - began)
"""


def best(work: Callable[[], object]) -> float:
    """Seconds of the fastest of several runs, after one that fills caches."""
    work()
    seconds = []
    for _ in range(REPETITIONS):
        began = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - began)
    return min(seconds)


def compiled(cache: str, *, keeps: bool) -> float:
    """Seconds that compiling takes in a new process; without ``keeps`` its cache is empty each time."""
    seconds = []
    for number in range(REPETITIONS + 1):
        folder = cache if keeps else f"{cache}-{number}"
        environment = os.environ | {"XDG_CACHE_HOME": folder}
        said = subprocess.run(
            [sys.executable, "-c", COMPILE], env=environment, capture_output=True, text=True, check=True
        )
        seconds.append(float(said.stdout))
    return min(seconds[1:])


def main() -> None:
    """Measure and print one line per syntax, then two about compiling."""
    os.environ.setdefault("PYTHONPATH", str(Path(__file__).resolve().parents[2]))
    content = VOCABULARY.read_bytes()
    parsed = read_syntax(content, "v", base="http://example.org/v", label="b")
    print(f"{len(parsed.triples)} triples of {VOCABULARY.name}")
    print(f"{'syntax':12}{'here':>10}{'peer':>10}{'here/peer':>11}  peer")
    reference = 0.0
    for target in Target:
        text, _ = write(parsed.triples, target, parsed.prefixes)
        data = text.encode()
        here = best(lambda data=data: read_syntax(data, "v", base="http://example.org/v", label="b"))  # type: ignore[misc]
        if target is Target.MANCHESTER:
            name = "horned-owl (Rust)"
            peer = best(lambda text=text: pyhornedowl.open_ontology_from_string(text, "omn"))  # type: ignore[misc]
        else:
            name = "rdflib"
            form = {Target.TURTLE: "turtle", Target.NTRIPLES: "nt", Target.RDFXML: "xml"}[target]
            peer = best(lambda text=text, form=form: rdflib.Graph().parse(data=text, format=form))  # type: ignore[misc]
        reference = peer if target is Target.TURTLE else reference
        print(f"{target.value:12}{here:8.3f} s{peer:8.3f} s{here / peer:10.2f}   {name}")
    with tempfile.TemporaryDirectory() as folder:
        for words, keeps in (("parsed files kept", True), ("nothing kept", False)):
            seconds = compiled(f"{folder}/{keeps}", keeps=keeps)
            print(f"compile serve_a_drink, {words:18}{seconds:8.3f} s, {seconds / reference:.2f} x rdflib's Turtle")


if __name__ == "__main__":
    main()
