"""Measure what it costs to find a combination of entries in which nothing is unmet.

A knowledge base of 1,080 alternatives on six levels: for each of 20 components of a level there are entries that need
two components of the next one. Only the last of each can be had: the others also need hardware that the robot lacks, or
what needs them in turn. CPU seconds of one search in the opened store, the median of several in new objects each.
"""

from __future__ import annotations

import statistics
import tempfile
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

from executive.enabling.explanation import Explanation
from executive.enabling.needs import Enabling
from executive.enabling.shelf import LocalShelf, RemoteShelf, Shelf
from executive.enabling.stock import Folder, Stock
from executive.robots.matching import Possessions
from executive.serving.uploads import read_upload
from executive.serving.vocabulary import read_vocabulary
from planlang.knowledge.client import Client
from planlang.knowledge.entries import Kind
from planlang.knowledge.sqlite_store import SqliteStore
from tests.support.servers import running_server

REPETITIONS, ALTERNATIVES, DEPTH, WIDTH = 5, 1080, 6, 20
HEAD = """Prefix: : <http://example.org/levels.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Prefix: comp: <http://knowrob.org/kb/srdl2-comp.owl#>
Ontology: <http://example.org/{name}.owl>
    Import: <{imported}>
"""
SRDL, LEVELS = "http://knowrob.org/kb/srdl2.owl", "http://example.org/levels.owl"
NEEDS = "comp:dependsOnComponent some "
TASK = f"""
Class: Working
    SubClassOf: knowrob:Action, {NEEDS}Level0-0
Class: WorkDeeply
    SubClassOf: knowrob:Action, knowrob:subAction some Working
"""


def vocabulary_text() -> str:
    """Return the ontology of all components."""
    classes = [f"Class: Level{level}-{place}\n" for level in range(DEPTH + 1) for place in range(WIDTH)]
    below = "    SubClassOf: comp:SoftwareComponent\n"
    return HEAD.format(name="levels", imported=SRDL) + below.join([*classes, ""])


def alternative(number: int, each: int) -> str:
    """Return the ontology of an entry: the last of ``each`` that are there for a component can be had."""
    component, variant = divmod(number, each)
    level, place = divmod(component, WIDTH)
    below = [f"Level{level + 1}-{(place + step) % WIDTH}" for step in (1, 7)] if level < DEPTH - 1 else []
    if variant < each - 1:
        below.append("comp:Tilting2DLaserScanner" if variant % 2 else f"Level0-{place}")
    types = ", ".join((f"Level{level}-{place}", *(NEEDS + one for one in below)))
    return HEAD.format(name=f"part{number}", imported=LEVELS) + f"\nIndividual: part{number}\n    Types: {types}\n"


def filled(folder: Path) -> LocalShelf:
    """Return a knowledge base with all alternatives and a task that needs the first component."""
    (folder / "levels.omn").write_text(vocabulary_text())
    vocabulary, store = read_vocabulary((folder,)), SqliteStore(folder / "kb.sqlite")
    each = ALTERNATIVES // (DEPTH * WIDTH)
    texts = {f"part{number}": alternative(number, each) for number in range(DEPTH * WIDTH * each)}
    texts["WorkDeeply"] = HEAD.format(name="task", imported=LEVELS) + TASK
    for name, text in texts.items():
        kind = Kind.RECIPE if name == "WorkDeeply" else Kind.OBJECT
        upload = read_upload(kind, "bench", text.encode(), name, vocabulary)
        store.create(upload.content, "ada", "2026-01-01T00:00:00Z")
    store.close()
    return LocalShelf(folder / "kb.sqlite", (folder,))


def seconds(shelf: Shelf, folder: Path, clock: Callable[[], float]) -> float:
    """Return the median of the time in which a combination is found; prints what was looked at."""
    spent, found = [], None
    for _ in range(REPETITIONS):
        robot = Possessions("robot", (), {})
        began = clock()
        stock = Stock(shelf, Folder.read(folder / "none"), (folder,))
        enabling = Enabling(robot, stock, own_map=Path("map"))
        found = Explanation(enabling, enabling.combination(enabling.task("WorkDeeply")))
        spent.append(clock() - began)
    assert found is not None
    considered = sum(len(one.considered) for one in found.combination.answers.values())
    taken = len(found.as_json()["taken"])
    print(f"{considered} alternatives for {len(found.combination.answers)} needs, {taken} taken, {found.unmet()}")
    return statistics.median(spent)


def main() -> None:
    """Print the seconds, and how much was looked at."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        shelf = filled(folder)
        spent = seconds(shelf, folder, time.process_time)
        print(f"{spent:.3f} s of CPU in a store (median of {REPETITIONS}; at most 0.5 s)")
        shelf.close()
        with (
            running_server(folder / "kb.sqlite", folders=(folder,)) as server,
            closing(RemoteShelf(Client(server.url))) as far,
        ):
            spent = seconds(far, folder, time.thread_time)
            print(f"{spent:.3f} s of CPU from a server, without its own (median of {REPETITIONS}; at most 0.5 s)")


if __name__ == "__main__":
    main()
