"""Measure the knowledge base with 10,000 entries: questions, uploads, start, many clients at once, and kill -9.

``search`` asks selective and broad class expressions, and pyoxigraph the same over the same content in the same run
(median of 5, and it is not asked for properties below others). ``upload`` and ``start`` tell what a server needs for
these. In CPU time, uploads in real time, medians of 20. ``load`` lets 50 clients read and write for 30 s at a real
server; ``kill``, only if it is asked for, ends real servers 100 times while they write. ``sparql`` reads entries while
an endless question is computed. Entries are drawn.

    python tests/benchmarks/knowledge.py --parts search,upload,start,load,sparql,kill
"""

from __future__ import annotations

import argparse
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from random import Random
from statistics import median

import httpx
import pyoxigraph

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

from many_clients import traffic

from executive.serving.catalogue import Catalogue
from executive.serving.uploads import packed
from executive.serving.vocabulary import Vocabulary, read_vocabulary
from planlang.files import Bundled, bundled
from planlang.knowledge.axioms import Axioms, Some
from planlang.knowledge.descriptions import described
from planlang.knowledge.entries import Content, Kind, Syntax
from planlang.knowledge.sqlite_store import SqliteStore
from planlang.ontology import Ontology, load
from planlang.ontology.convert import Target, write

ENTRIES, REPETITIONS, QUESTIONS = 10_000, 20, 60
CLIENTS, SECONDS, KILLS = 50, 30.0, 100
NOW = "2026-01-01T00:00:00Z"
KNOWROB = "http://knowrob.org/kb/knowrob.owl#"
ROLES = ("objectActedOn", "toLocation", "fromLocation", "deviceUsed", "objectOfStateChange")
BROAD = (
    "Event",
    "SpatialThing",
    "Event and objectActedOn some SpatialThing",
    "Event and subAction some (Event and objectActedOn some SpatialThing)",
    "owl:Thing",
)
MEMORY = Path("/dev/shm")
"""Where drawn entries are written fast, if it is there; what is measured does not depend on it."""


@dataclass(frozen=True)
class Drawn:
    """An entry: superclasses and restrictions of its class, and of the class of one of its parts."""

    name: str
    kind: Kind
    above: str
    fillers: tuple[tuple[str, str], ...]
    part: str | None = None

    @property
    def iri(self) -> str:
        """The class that the entry describes."""
        return f"http://example.org/{self.name}#{self.name.title()}"

    def statements(self) -> Iterator[tuple[str, str, str | None]]:
        """Yield (class, class above, property or None) for each of its axioms."""
        yield self.iri, self.above, None
        for role, filler in self.fillers:
            yield self.iri, filler, KNOWROB + role
        if self.part is not None:
            yield self.iri, f"{self.iri}Part", f"{KNOWROB}subAction"
            yield f"{self.iri}Part", self.part, None
            yield f"{self.iri}Part", self.fillers[0][1], f"{KNOWROB}objectActedOn"

    def content(self, vocabulary: Vocabulary) -> Content:
        """Return what a store is given."""
        own = Axioms()
        for lower, upper, role in self.statements():
            own.state(lower, upper if role is None else Some(role, upper))
        text = "".join(f"{triple} .\n" for triple in map(str, self.triples()))
        description = described(self.iri, vocabulary.axioms, own, words=[self.name])
        about, syntax = self.iri, Syntax.TURTLE
        data = packed(description, vocabulary)
        return Content(self.kind, about, self.name, self.name, syntax, text.encode(), data)

    def triples(self) -> Iterator[pyoxigraph.Triple]:
        """Yield the entry as RDF."""
        node, rdfs = pyoxigraph.NamedNode, "http://www.w3.org/2000/01/rdf-schema#"
        owl = "http://www.w3.org/2002/07/owl#"
        yield pyoxigraph.Triple(node(self.iri), node("urn:entry"), pyoxigraph.Literal(self.name))
        for lower, upper, role in self.statements():
            end: pyoxigraph.NamedNode | pyoxigraph.BlankNode = node(upper)
            if role is not None:
                end = pyoxigraph.BlankNode()
                yield pyoxigraph.Triple(end, node(f"{owl}onProperty"), node(role))
                yield pyoxigraph.Triple(end, node(f"{owl}someValuesFrom"), node(upper))
            yield pyoxigraph.Triple(node(lower), node(f"{rdfs}subClassOf"), end)


class World:
    """The vocabulary, and entries drawn from its classes."""

    def __init__(self) -> None:
        self.ontology: Ontology = load(bundled("ontologies") / "knowrob.omn")
        self.vocabulary = read_vocabulary()
        self._random = Random(0)
        known = self.vocabulary.names
        self._actions, self._things = (
            [iri for iri in self.ontology.subclasses(KNOWROB + name) if known.get(iri.partition("#")[2]) == [iri]]
            for name in ("Event", "SpatialThing")
        )
        self.entries = [self._draw(number) for number in range(ENTRIES)]

    def _draw(self, number: int) -> Drawn:
        random = self._random
        if number % 4 == 0:
            return Drawn(f"thing{number}", Kind.OBJECT, random.choice(self._things), ())
        fillers = tuple((role, random.choice(self._things)) for role in random.sample(ROLES, 3))
        return Drawn(f"task{number}", Kind.RECIPE, random.choice(self._actions), fillers, random.choice(self._actions))

    def questions(self) -> list[str]:
        """Return selective questions: of random classes."""
        random, found = self._random, list[str]()
        for _ in range(QUESTIONS):
            action, thing = (random.choice(some).partition("#")[2] for some in (self._actions, self._things))
            found.append(f"{action} and {random.choice(ROLES)} some {thing}")
        return found

    def store(self, folder: Path) -> SqliteStore:
        """Return a store with all entries."""
        store = SqliteStore(folder / "kb.sqlite")
        for drawn in self.entries:
            store.create(drawn.content(self.vocabulary), "ada", NOW)
        return store

    def mirror(self) -> pyoxigraph.Store:
        """Return everything as RDF in memory."""
        store = pyoxigraph.Store()
        text, _ = write(list(self.ontology.triples()), Target.NTRIPLES, {})
        store.load(text.encode(), pyoxigraph.RdfFormat.N_TRIPLES)
        for drawn in self.entries:
            store.extend(pyoxigraph.Quad(*triple) for triple in drawn.triples())
        return store


def cpu(work: Callable[[], object], repetitions: int = REPETITIONS) -> float:
    """Milliseconds of CPU of this process, the median of several runs."""
    spent = []
    for _ in range(repetitions):
        began = time.process_time()
        work()
        spent.append((time.process_time() - began) * 1e3)
    return median(spent)


def row(*cells: object) -> None:
    """Print a row of a table."""
    print("|" + "|".join(f" {cell} " for cell in cells) + "|", flush=True)


def milliseconds(values: Sequence[float]) -> str:
    """Return median and 95th percentile as text."""
    return f"{median(values):.2f} / {sorted(values)[int(0.95 * (len(values) - 1))]:.2f}"


# search


def sparql(question: str) -> str:
    """Return a question of this benchmark in SPARQL, with specialisations."""
    head = """PREFIX k: <http://knowrob.org/kb/knowrob.owl#> PREFIX owl: <http://www.w3.org/2002/07/owl#>
        PREFIX rdfs: <http://www.w3.org/2000/01/rdf-schema#> SELECT DISTINCT ?e {{ ?c0 <urn:entry> ?e . {} }}"""
    conditions, number = list[str](), 0
    for part in question.replace("(", "").replace(")", "").split(" and "):
        words = part.split(" some ")
        if len(words) > 1:
            at, number = number if words[0] == "objectActedOn" else 0, number + 1
            conditions.append(f"?c{at} rdfs:subClassOf* ?a{number} . ?a{number} rdfs:subClassOf ?r{number} .")
            conditions.append(f"?r{number} owl:onProperty k:{words[0]} ; owl:someValuesFrom ?c{number} .")
        if words[-1] != "owl:Thing":
            conditions.append(f"?c{number} rdfs:subClassOf* k:{words[-1]} .")
    return head.format(" ".join(conditions))


def measure_search(world: World, catalogue: Catalogue) -> None:
    """Print what questions cost, here and with pyoxigraph."""
    mirror = world.mirror()
    print("\n| question | entries | index | with reading the question | pyoxigraph |\n|---|---|---|---|---|")
    costs: dict[str, list[tuple[float, float, float]]] = {"selective": [], "broad": []}
    for kind, questions in (("broad", BROAD), ("selective", world.questions())):
        for text in questions:
            expression = catalogue.question(text)
            found = catalogue.find(expression)
            others = list(mirror.query(sparql(text)))  # type: ignore[arg-type]
            whole = cpu(lambda text=text: catalogue.find(catalogue.question(text)))
            alone = cpu(lambda expression=expression: catalogue.find(expression))
            other = cpu(lambda text=text: list(mirror.query(sparql(text))), 5)
            costs[kind].append((alone, whole, other))
            if kind == "broad":
                row(text, f"{len(found)} ({len(others)})", *(f"{one:.2f} ms" for one in costs[kind][-1]))
    for kind, found in (*costs.items(), ("all", [one for some in costs.values() for one in some])):
        row(f"{kind}, median / p95", "", *(f"{milliseconds([one[n] for one in found])} ms" for n in range(3)))


# upload and start

_START = """
import sys, time
from pathlib import Path
from executive.serving.app import application
from planlang.knowledge.sqlite_store import SqliteStore
began = time.process_time()
app = application(SqliteStore(Path(sys.argv[1])))
print(time.process_time() - began, time.process_time())
"""


def measure_start(path: Path) -> None:
    """Print the CPU time of a new process until it can serve."""
    spent = []
    for _ in range(6):
        said = subprocess.run([sys.executable, "-c", _START, str(path)], capture_output=True, text=True, check=True)
        spent.append([float(one) for one in said.stdout.split()])
    served, whole = (median(one[n] for one in spent[1:]) for n in (0, 1))
    print(f"\nstart with {ENTRIES:,} entries: {whole:.2f} s of CPU, of which {served:.2f} s behind the imports")


def measure_upload(store: SqliteStore) -> None:
    """Print what an upload of the bundled recipe costs, and questions, over HTTP without a network."""
    from fastapi.testclient import TestClient

    from executive.serving.app import application

    recipe, numbers = Bundled.RECIPE.find("serve_a_drink").read_bytes(), iter(range(10**6))
    with TestClient(application(store), headers={"Authorization": f"Bearer {store.new_key('bob', NOW)}"}) as client:

        def upload() -> None:
            answer = client.post("/v1/recipes", params={"name": f"drink{next(numbers)}"}, content=recipe)
            assert answer.status_code == 201, answer.text

        upload()
        taken = []
        for _ in range(REPETITIONS):
            began = time.perf_counter()  # workers compute
            upload()
            taken.append(1000 * (time.perf_counter() - began))
        print(f"\nupload of serve_a_drink with its checks, real time: {median(taken):.0f} ms")
        for text in ("ServingFoodOrDrink", *BROAD[:4]):
            spent = cpu(lambda text=text: client.get("/v1/search", params={"expression": text}).raise_for_status())
            print(f"GET /v1/search?expression={text}: {spent:.1f} ms")


# a real server


@contextmanager
def server(path: Path) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """Start a server at a free port; gives its address and process, and ends it."""
    command = [sys.executable, "-m", "planlang_command", "serve", "--store", str(path), "--port", "0"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        try:
            yield process.stderr.readline().rpartition(" ")[2].strip(), process
        finally:
            process.send_signal(signal.SIGTERM)


TASK = """Prefix: : <http://example.org/load.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://example.org/load.owl>
Class: Bottle{number}
    SubClassOf: knowrob:Bottle
"""


def measure_load(store: SqliteStore, path: Path, seconds: float) -> None:
    """Print what many clients at once see of a real server, and if everything that it accepted is there."""
    with server(path) as (url, _):
        found = traffic(url, store.new_key("carl", NOW), CLIENTS, seconds)
        lost = found.lost(url)
    print(f"\n{CLIENTS} clients, {seconds:.0f} s, real time; clients on the same cores")
    print("| call | answers | median | p99 |\n|---|---|---|---|")
    for call, times in sorted(found.times.items()):
        row(call, len(times), f"{median(times):.2f} s", f"{times[int(0.99 * (len(times) - 1))]:.2f} s")
    print(f"not answered well: {found.failures or 'none'}; accepted and not readable afterwards: {lost or 'none'}")


ENDLESS = "SELECT (COUNT(*) AS ?n) { ?a ?b ?c . ?d ?e ?f . ?g ?h ?i . ?j ?k ?l }"


def measure_sparql(path: Path) -> None:
    """Print how long reading takes while a cross product over all entries is computed, and how that ends."""
    with server(path) as (url, _), httpx.Client(base_url=url, timeout=600) as client:
        entries = client.get("/v1/recipes", params={"limit": 50}).json()["entries"]
        client.get("/v1/sparql", params={"query": "ASK {}"}).raise_for_status()  # the mirror is made
        with ThreadPoolExecutor(1) as beside:
            endless = beside.submit(httpx.get, f"{url}/v1/sparql", params={"query": ENDLESS}, timeout=60)
            times = []
            while not endless.done():
                began = time.perf_counter()
                client.get(f"/v1/recipes/{entries[len(times) % len(entries)]['uid']}").raise_for_status()
                times.append(1000 * (time.perf_counter() - began))
        cut = endless.result()
    p99 = sorted(times)[int(0.99 * (len(times) - 1))]
    print(f"\na cross product: {cut.status_code}, {cut.json()['detail']}")
    print(f"{len(times)} entries read meanwhile, real time: median {median(times):.1f} ms, p99 {p99:.1f} ms")


def measure_kill(folder: Path, kills: int) -> None:
    """Print if everything is there that servers accepted before they were killed while clients wrote."""
    path, accepted = folder / "killed.sqlite", list[tuple[str, int]]()
    store = SqliteStore(path)
    key = store.new_key("dora", NOW)
    store.close()
    for kill in range(kills):
        with server(path) as (url, process):
            clients = [threading.Thread(target=_write, args=(url, key, 100 * kill + n, accepted)) for n in range(4)]
            for client in clients:
                client.start()
            before, patience = len(accepted), time.monotonic() + 30
            while len(accepted) < before + 1 + kill % 7 and time.monotonic() < patience:
                time.sleep(0.002)
            time.sleep(Random(kill).uniform(0, 0.1))
            process.kill()
            for client in clients:
                client.join()
    store = SqliteStore(path)
    lost = [uid for uid, number in accepted if f"Bottle{number}\n" not in store.content(uid).decode()]
    described_ = {one.uid for one in store.descriptions()}
    lost += [uid for uid, _ in accepted if uid not in described_]
    print(f"\nkill -9, {kills} times: {len(accepted)} accepted uploads, {len(described_)} kept, lost: {lost}")


def _write(url: str, key: str, first: int, accepted: list[tuple[str, int]]) -> None:
    """Create entries one after the other until the server is gone."""
    try:
        with httpx.Client(base_url=url, headers={"Authorization": f"Bearer {key}"}, timeout=60) as client:
            for number in range(1000 * first, 1000 * first + 1000):
                arguments = {"name": f"n{number}", "about": f"Bottle{number}"}
                answer = client.post("/v1/objects", params=arguments, content=TASK.format(number=number))
                if answer.status_code == 201:
                    accepted.append((answer.json()["entry"]["uid"], number))
    except httpx.TransportError:
        return


def main() -> None:
    """Measure the parts that were asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--parts", default="search,upload,start,load,sparql")
    parser.add_argument("--seconds", type=float, default=SECONDS)
    parser.add_argument("--kills", type=int, default=KILLS)
    arguments = parser.parse_args()
    parts = set(arguments.parts.split(","))
    with tempfile.TemporaryDirectory(dir=MEMORY if MEMORY.is_dir() else None) as name:
        folder = Path(name)
        if parts - {"kill"}:
            world = World()
            began = time.process_time()
            store = world.store(folder)
            print(f"{ENTRIES:,} entries drawn, described and kept in {time.process_time() - began:.1f} s")
            if "start" in parts:
                measure_start(folder / "kb.sqlite")
            if "search" in parts:
                measure_search(world, Catalogue(store, world.vocabulary))
            if "upload" in parts:
                measure_upload(store)
            if "load" in parts:
                measure_load(store, folder / "kb.sqlite", arguments.seconds)
            if "sparql" in parts:
                measure_sparql(folder / "kb.sqlite")
            store.close()
    if "kill" in parts:
        with tempfile.TemporaryDirectory() as name:  # on a disk
            measure_kill(Path(name), arguments.kills)


if __name__ == "__main__":
    main()
