"""Knowledge bases for tests: stores with entries that were checked as a server checks them."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path

from executive.serving.uploads import read_upload
from executive.serving.vocabulary import Vocabulary, read_vocabulary
from planlang.files import Bundled
from planlang.knowledge.entries import Content, Entry, File, Kind
from planlang.knowledge.sqlite_store import SqliteStore

NOW = "2026-01-01T00:00:00Z"
HEAD = """Prefix: : <http://example.org/{name}.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Prefix: roboearth: <http://www.roboearth.org/kb/roboearth.owl#>
Prefix: comp: <http://knowrob.org/kb/srdl2-comp.owl#>
Prefix: cap: <http://knowrob.org/kb/srdl2-cap.owl#>
Ontology: <http://example.org/{name}.owl>
    Import: <http://www.roboearth.org/kb/roboearth.owl>
    Import: <http://knowrob.org/kb/srdl2.owl>
"""

PIECES = {
    "recipe": "serveadrink.ward",
    "recognition model DrinkingBottle": "drinkingbottlemodel.ada",
    "recognition model Patient": "patientmodel.ada",
    "map with DrinkingBottle, Patient": "hospital_room.ward",
}
"""What serving a drink needs, as an explanation names it -> the entry that is it in :func:`hospital`."""


@cache
def vocabulary() -> Vocabulary:
    """Return the bundled vocabulary."""
    return read_vocabulary()


@cache
def checked(kind: Kind, name: str, data: bytes, about: str | None) -> Content:
    """Return what an upload is once it was checked; most tests hand in the same few."""
    return read_upload(kind, name, data, about, vocabulary()).content


def put(store: SqliteStore, kind: Kind, name: str, data: bytes | str, about: str | None = None) -> Entry:
    """Check an upload and keep it."""
    return store.create(checked(kind, name, data.encode() if isinstance(data, str) else data, about), "ada", NOW)


def ontology(name: str, text: str) -> str:
    """Return an ontology in Manchester syntax, with the usual prefixes and imports."""
    return HEAD.format(name=name) + text


def recognition_model(cls: str) -> str:
    """Return the ontology of a recognition model of a class of knowrob."""
    facts = f"roboearth:providesModelFor knowrob:{cls}, roboearth:createdByAlgorithm roboearth:RoboEarthObjRecSystem"
    return ontology(cls, f"Individual: {cls}Model\n    Types: roboearth:RoboEarthObjRecModel3D\n    Facts: {facts}\n")


def hospital(path: Path, without: str | None = None) -> SqliteStore:
    """Return a store with all that serving a drink needs, and what it does not, but for one entry."""
    entries: Mapping[str, tuple[Kind, str, bytes | str]] = {
        "serveadrink.ward": (Kind.RECIPE, "ward", Bundled.RECIPE.find("serve_a_drink").read_bytes()),
        "hospital_room.ward": (Kind.ENVIRONMENT, "ward", Bundled.ENVIRONMENT.find("hospital_room").read_bytes()),
        "day_room.ward": (Kind.ENVIRONMENT, "ward", Bundled.ENVIRONMENT.find("kitchenette").read_bytes()),
        "drinkingbottlemodel.ada": (Kind.OBJECT, "ada", recognition_model("DrinkingBottle")),
        "patientmodel.ada": (Kind.OBJECT, "ada", recognition_model("Patient")),
        "cupmodel.ada": (Kind.OBJECT, "ada", recognition_model("Cup")),
    }
    store = SqliteStore(path)
    for uid, (kind, name, data) in entries.items():
        if uid != without:
            put(store, kind, name, data)
    model = PIECES["recognition model Patient"]
    if model != without:
        store.attach(model, File("patient.model", "application/octet-stream", b"*"), "ada", NOW)
    return store
