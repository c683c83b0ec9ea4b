"""What is kept is renewed, what is incomplete or hostile is refused by name, and nothing is left half-written."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest
from click.testing import CliRunner

from executive.cli.app import app
from executive.enabling.shelf import LocalShelf
from executive.serving.uploads import read_upload
from planlang.diagnostics import BadInput, error
from planlang.knowledge.entries import Attachment, Entry, File, Kind
from planlang.knowledge.sqlite_store import SqliteStore
from tests.executive.enabling.test_enable import enable, files
from tests.support.knowledge_bases import NOW, PIECES, hospital, ontology, put, recognition_model, vocabulary

BOTTLE = PIECES["recognition model DrinkingBottle"]
LINKED = '    Facts: roboearth:linkToRecognitionModel "http://example.org/models/bottle.model"\n'


def change(store: SqliteStore, uid: str, data: str) -> None:
    """Hand in the next revision of an entry."""
    entry = store.entry(uid)
    upload = read_upload(entry.kind, uid.partition(".")[2], data.encode(), None, vocabulary())
    store.change(uid, upload.content, "ada", entry.etag, NOW)


@pytest.mark.long
def test_what_is_kept_is_renewed_when_the_knowledge_base_has_a_newer_revision(tmp_path: Path) -> None:
    store = hospital(tmp_path / "kb.sqlite")
    enable(tmp_path / "kb.sqlite", tmp_path / "amigo")
    newer = recognition_model("DrinkingBottle") + '    Annotations: rdfs:label "better"\n'
    change(store, BOTTLE, newer)
    store.close()
    code, found = enable(tmp_path / "kb.sqlite", tmp_path / "amigo")
    told = json.dumps(found["explanation"])
    assert (code, found["taken"], found["renewed"]) == (0, [], [BOTTLE])
    assert f"{BOTTLE} is updated from {tmp_path / 'kb.sqlite'}: revision 2" in told
    assert f"{PIECES['recipe']} is kept in {tmp_path / 'amigo'}, unchanged" in told
    assert (tmp_path / "amigo" / "objects" / BOTTLE / f"{BOTTLE}.omn").read_text() == newer
    assert enable(tmp_path / "kb.sqlite", tmp_path / "amigo")[1]["renewed"] == []


@pytest.mark.long
def test_what_is_kept_stays_where_its_newer_revision_needs_what_is_missing(tmp_path: Path) -> None:
    store = hospital(tmp_path / "kb.sqlite")
    enable(tmp_path / "kb.sqlite", tmp_path / "amigo")
    change(store, BOTTLE, recognition_model("DrinkingBottle") + LINKED)
    store.close()
    code, found = enable(tmp_path / "kb.sqlite", tmp_path / "amigo")
    assert (code, found["taken"], found["renewed"]) == (0, [], [])
    told = f"{BOTTLE} is kept in {tmp_path / 'amigo'}: revision 2 of {tmp_path / 'kb.sqlite'} cannot be used"
    assert told in json.dumps(found["explanation"])


@pytest.mark.long
def test_what_is_not_complete_any_more_is_taken_again(tmp_path: Path) -> None:
    hospital(tmp_path / "kb.sqlite").close()
    enable(tmp_path / "kb.sqlite", tmp_path / "amigo")
    before = files(tmp_path / "amigo")
    (tmp_path / "amigo" / "objects" / "patientmodel.ada" / "patient.model").unlink()
    assert enable(tmp_path / "kb.sqlite", tmp_path / "amigo")[1]["taken"] == ["patientmodel.ada"]
    assert files(tmp_path / "amigo") == before


@pytest.mark.long
@pytest.mark.parametrize("is_writable", [True, False])
def test_entries_that_an_earlier_version_described_are_found_by_all_that_is_in_them(
    tmp_path: Path, is_writable: bool
) -> None:
    hospital(tmp_path / "kb.sqlite").close()
    with closing(sqlite3.connect(tmp_path / "kb.sqlite")) as database, database:
        database.execute("UPDATE entries SET description = ?", (b"1 earlier",))
        database.execute("INSERT INTO blobs VALUES ('wrong', ?)", (b"Ontology: <",))
        database.execute("UPDATE revisions SET sha256 = 'wrong' WHERE uid = 'cupmodel.ada'")
        if not is_writable:
            database.execute("CREATE TRIGGER no BEFORE UPDATE ON entries BEGIN SELECT RAISE(ABORT, 'no'); END")
    code, found = enable(tmp_path / "kb.sqlite", tmp_path / "amigo")
    assert (code, sorted(found["taken"])) == (0, sorted(PIECES.values()))
    assert [one["code"] for one in found["diagnostics"]] == ["K046"]
    assert "cupmodel.ada" in found["diagnostics"][0]["message"]
    with closing(SqliteStore(tmp_path / "kb.sqlite")) as store:
        assert store.description(BOTTLE).startswith(b"1 earlier") is not is_writable


@pytest.mark.long
def test_a_recognition_model_without_its_file_is_refused_by_name_and_recognises_nothing(tmp_path: Path) -> None:
    store = hospital(tmp_path / "kb.sqlite", without=BOTTLE)
    model = recognition_model("DrinkingBottle") + LINKED
    put(store, Kind.OBJECT, "ada", model)
    code, found = enable(tmp_path / "kb.sqlite", tmp_path / "amigo")
    assert (code, found["missing"]) == (3, ["recognition model DrinkingBottle"])
    assert "not attached: bottle.model" in json.dumps(found["explanation"])
    (tmp_path / "models").mkdir()
    (tmp_path / "models" / "bottle.omn").write_text(model)
    words = ["run", "serve_a_drink", "--models", str(tmp_path / "models"), "--json"]
    run = json.loads(CliRunner().invoke(app, words, catch_exceptions=False).stdout)
    assert [one["code"] for one in run["diagnostics"]] == ["K042"]
    assert "no recognition model of DrinkingBottle" in run["message"]
    store.attach(BOTTLE, File("bottle.model", "application/octet-stream", b"*"), "ada", NOW)
    store.close()
    assert enable(tmp_path / "kb.sqlite", tmp_path / "amigo")[0] == 0
    assert (tmp_path / "amigo" / "objects" / BOTTLE / "bottle.model").read_bytes() == b"*"


def gone(*_: object) -> bytes:
    raise BadInput([error("K031", "the server does not answer")])


@pytest.mark.parametrize("call", ["content", "attachment"])
def test_of_a_server_that_goes_away_in_the_middle_nothing_is_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: str
) -> None:
    hospital(tmp_path / "kb.sqlite").close()
    real: Callable[..., bytes] = getattr(LocalShelf, call)
    asked: list[str] = []

    def failing(shelf: LocalShelf, entry: Entry, what: Attachment | int | None = None) -> bytes:
        asked.append(entry.uid)
        is_last = call == "attachment" or asked.count(BOTTLE) > 1
        return gone() if is_last else real(shelf, entry, what)

    monkeypatch.setattr(LocalShelf, call, failing)
    code, found = enable(tmp_path / "kb.sqlite", tmp_path / "amigo")
    assert (code, [one["code"] for one in found["diagnostics"]]) == (2, ["K031"])
    assert not (tmp_path / "amigo").exists()


def test_an_entry_that_is_deleted_or_changed_after_it_was_found_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    hospital(tmp_path / "kb.sqlite").close()
    monkeypatch.setattr(SqliteStore, "content", lambda store, uid, number=None: b"Ontology: <urn:another>")
    code, found = enable(tmp_path / "kb.sqlite", tmp_path / "amigo")
    assert (code, found["missing"]) == (3, ["recipe serve_a_drink"])
    assert "differs from the checksum" in json.dumps(found["explanation"])
    assert not (tmp_path / "amigo").exists()


FARM = """
Class: Egg
    SubClassOf: comp:SoftwareComponent
Class: Hen
    SubClassOf: comp:SoftwareComponent
Individual: {name}
    Types: {types}, comp:dependsOnComponent some {needs}
"""


def test_entries_that_need_each_other_and_import_themselves_end_in_a_name(tmp_path: Path) -> None:
    store = hospital(tmp_path / "kb.sqlite", without=BOTTLE)
    facts = "    Facts: roboearth:providesModelFor knowrob:DrinkingBottle\n"
    for name, types, needs, more in (
        ("egg1", "Egg", "Hen", ""),
        ("hen1", "Hen", "Egg", ""),
        ("drinkingBottleModel", "roboearth:RoboEarthObjRecModel3D", "Egg", facts),
    ):
        text = ontology("farm", FARM.format(name=name, types=types, needs=needs) + more)
        importing = text.replace("    Import", "    Import: <http://example.org/farm.owl>\n    Import", 1)
        put(store, Kind.OBJECT, "ada", importing, name)
    store.close()
    code, found = enable(tmp_path / "kb.sqlite", tmp_path / "amigo")
    assert (code, found["missing"]) == (3, ["component Hen"])
    assert "it depends on itself" in json.dumps(found["explanation"])
    assert not (tmp_path / "amigo").exists()
