"""Measure the server of a knowledge base: questions to 10,000 entries, uploads, its start, and 50 clients at a time.

Questions are asked in CPU time, medians and 95th percentiles of 20, beside pyoxigraph in memory over the same entries
with the same classes in the same run. Clients are threads of another process, so their times are those of the clock.
"""

from __future__ import annotations

import os
import random
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import pyoxigraph as ox

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

from many_clients import traffic

from executive.serving.catalogue import Catalogue
from executive.serving.uploads import Upload, read_upload, warm_up
from executive.serving.vocabulary import Vocabulary, read_vocabulary
from planlang.diagnostics import BadInput
from planlang.files import bundled
from planlang.knowledge.entries import Kind
from planlang.knowledge.sqlite_store import SqliteStore
from planlang.ontology import Ontology, load
from planlang.ontology.terms import KNOWROB, RDFS

ENTRIES, DIFFERENT, REPETITIONS = 10_000, 300, 20
CLIENTS, SECONDS = 50, 30.0
NOW = "2026-01-01T00:00:00Z"
QUESTIONS = (
    ("OpeningAContainerArtifact", None),
    ("OpeningAContainerArtifact", "Refrigerator"),
    ("Event", None),
    ("PhysicalEvent", "Container"),
    ("Event", "SpatialThing"),
)
"""Class of the task, class of what it is about."""


def timed(work: Callable[[], object]) -> tuple[float, float]:
    """Return the median and the 95th percentile of a number of runs [ms CPU]."""
    found = []
    for _ in range(REPETITIONS):
        start = time.process_time()
        work()
        found.append(1000 * (time.process_time() - start))
    return statistics.median(found), sorted(found)[int(0.95 * len(found)) - 1]


def task(number: int, cls: str, thing: str) -> bytes:
    """Return a recipe of one step."""
    return f"""Prefix: : <http://example.org/r{number}.owl#>
Prefix: knowrob: <{KNOWROB}>
Ontology: <http://example.org/r{number}.owl>
Class: Task{number} SubClassOf: <{cls}>, knowrob:objectActedOn some <{thing}>, knowrob:subAction some Step{number}
Class: Step{number} SubClassOf: knowrob:VisualPerception, knowrob:objectActedOn some <{thing}>
""".encode()


def uploads(vocabulary: Vocabulary, ontology: Ontology) -> list[Upload]:
    """Check recipes for random tasks with random things, and print how long that takes."""
    chance = random.Random(1)
    tasks = [one for one in ontology.subclasses("ActionOnObject") if one.startswith(KNOWROB)]
    things = [one for one in ontology.subclasses("HumanScaleObject") if one.startswith(KNOWROB)]
    warm_up(vocabulary)
    found, times = [], []
    for number in range(DIFFERENT):
        start = time.process_time()
        data = task(number, chance.choice(tasks), chance.choice(things))
        with suppress(BadInput):  # of a hand, or of a part of a body
            found.append(read_upload(Kind.RECIPE, "x", data, None, vocabulary))
        times.append(1000 * (time.process_time() - start))
    print(f"upload with checks: {statistics.median(times):.0f} ms, slowest {max(times):.0f} ms")
    return found


def mirrored(ontology: Ontology, found: list[Upload]) -> ox.Store:
    """Return the same entries in pyoxigraph, with the classes of the vocabulary."""
    store = ox.Store()
    above, about = ox.NamedNode(RDFS.subClassOf), ox.NamedNode("urn:about")
    quads = []
    for cls in ontology.taxonomy.classes():
        quads += [ox.Quad(ox.NamedNode(cls), above, ox.NamedNode(up)) for up in ontology.taxonomy.parents(cls)]
    for number in range(ENTRIES):
        root, entry = found[number % len(found)].description.nodes[0], ox.NamedNode(f"urn:entry:{number}")
        quads += [ox.Quad(entry, above, ox.NamedNode(one)) for one in root.labels if not one.startswith("{")]
        quads += [ox.Quad(entry, about, ox.NamedNode(one)) for _, one in root.links if isinstance(one, str)]
    store.bulk_extend(quads)
    return store


def compare(catalogue: Catalogue, mirror: ox.Store) -> None:
    """Print how long questions take."""
    for cls, thing in QUESTIONS:
        text = cls + (f" and objectActedOn some {thing}" if thing else "")
        about = f" ?e <urn:about>/<{RDFS.subClassOf}>* <{KNOWROB}{thing}> ." if thing else ""
        query = (
            f"SELECT DISTINCT ?e {{ ?e <{RDFS.subClassOf}>+ <{KNOWROB}{cls}> .{about} "
            'FILTER(STRSTARTS(STR(?e), "urn:entry:")) }'
        )
        number = len(catalogue.find(catalogue.question(text)))
        ours = timed(lambda text=text: catalogue.find(catalogue.question(text)))
        theirs = timed(lambda query=query: list(mirror.query(query)))
        shown = f"{ours[0]:.2f} / {ours[1]:.2f} ms; pyoxigraph {theirs[0]:.1f} / {theirs[1]:.1f} ms"
        print(f"{text}: {number} entries, {shown}")


def serve_clients(folder: Path) -> None:
    """Print what clients of a server in another process are answered, and how fast."""
    store = SqliteStore(folder / "clients.sqlite")
    key = store.new_key("ada", NOW)
    command = [sys.executable, "-m", "executive", "serve", "--store", str(folder / "clients.sqlite"), "--port", "0"]
    server = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    assert server.stderr is not None
    url = server.stderr.readline().split()[-1]
    found = traffic(url, key, CLIENTS, SECONDS)
    for call, times in sorted(found.times.items()):
        slowest = times[int(0.99 * (len(times) - 1))]
        print(f"{CLIENTS} clients, {call}: {len(times)}, {1000 * statistics.median(times):.0f} ms, p99 {slowest:.2f} s")
    print(f"not answered well: {found.failures or 'none'}; accepted and lost: {len(found.lost(url))}")
    os.kill(server.pid, signal.SIGTERM)
    server.wait()
    store.close()


def main() -> None:
    """Measure everything."""
    ontology = load(bundled("ontologies") / "knowrob.omn")
    vocabulary = read_vocabulary()
    found = uploads(vocabulary, ontology)
    with tempfile.TemporaryDirectory() as folder:
        store = SqliteStore(Path(folder) / "kb.sqlite")
        store._database.execute("PRAGMA synchronous = OFF")
        for number in range(ENTRIES):
            store.create(replace(found[number % len(found)].content, name=f"n{number}"), "ada", NOW)
        start = time.process_time()
        catalogue = Catalogue(store, read_vocabulary())
        print(f"start with {ENTRIES} entries: {time.process_time() - start:.2f} s")
        compare(catalogue, mirrored(ontology, found))
        store.close()
        serve_clients(Path(folder))


if __name__ == "__main__":
    main()
