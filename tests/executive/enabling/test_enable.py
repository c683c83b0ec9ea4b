"""The experiment: a robot that has nothing takes what it lacks for a task from a knowledge base, and does the task."""

from __future__ import annotations

import hashlib
import json
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from executive.cli.app import app
from planlang.files import Bundled
from tests.support.examples import some
from tests.support.knowledge_bases import PIECES, hospital
from tests.support.servers import running_server

FOLDERS = (
    "recipes/serveadrink.ward",
    "environments/hospital_room.ward",
    "objects/drinkingbottlemodel.ada",
    "objects/patientmodel.ada",
)


def enable(store: Path | str, folder: Path, *words: str, task: str = "serve_a_drink") -> tuple[int, dict[str, Any]]:
    words = ("enable", task, "--robot", "amigo", "--from", str(store), "--store", str(folder), "--json", *words)
    result = CliRunner().invoke(app, words, catch_exceptions=False)
    return result.exit_code, json.loads(result.stdout)


def files(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


TAKEN = {
    "taken.json",
    *(f"{folder}/.planlang-pulled.json" for folder in FOLDERS),
    "recipes/serveadrink.ward/serveadrink.ward.omn",
    "environments/hospital_room.ward/hospital_room.ward.omn",
    "objects/drinkingbottlemodel.ada/drinkingbottlemodel.ada.omn",
    "objects/patientmodel.ada/patientmodel.ada.omn",
    "objects/patientmodel.ada/patient.model",
}


@pytest.mark.long
def test_a_robot_that_has_nothing_takes_exactly_what_it_needs_and_serves_the_drink(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The experiment of the paper's section IX: one command, a server, a robot without recipe, models and map."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    hospital(tmp_path / "kb.sqlite").close()
    with running_server(tmp_path / "kb.sqlite") as server:
        code, found = enable(server.url, tmp_path / "amigo", "--run")
        assert (code, found["outcome"], found["final_state"]) == (0, "done", ["bottle1: held by patient1"])
        assert sorted(found["taken"]) == sorted(PIECES.values())
        assert files(tmp_path / "amigo") == TAKEN


@pytest.mark.long
def test_a_store_gives_what_a_server_gives_and_the_cache_what_it_gave_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    hospital(tmp_path / "kb.sqlite").close()
    _, local = enable(tmp_path / "kb.sqlite", tmp_path / "from_file")
    with running_server(tmp_path / "kb.sqlite") as server:
        code, found = enable(server.url, tmp_path / "amigo")
    assert (code, found["taken"]) == (0, local["taken"])
    assert files(tmp_path / "amigo") == files(tmp_path / "from_file") == TAKEN
    code, found = enable(server.url, tmp_path / "other")
    assert (code, [one["code"] for one in found["diagnostics"]]) == (0, ["K033"])
    code, found = enable("http://127.0.0.1:9", tmp_path / "none")
    assert (code, [one["code"] for one in found["diagnostics"]]) == (2, ["K031"])


@pytest.mark.parametrize(("piece", "uid"), some(PIECES.items(), every=4))
def test_whatever_one_piece_is_not_there_is_named_and_nothing_is_taken(tmp_path: Path, piece: str, uid: str) -> None:
    hospital(tmp_path / "kb.sqlite", without=uid).close()
    code, found = enable(tmp_path / "kb.sqlite", tmp_path / "amigo", "--run")
    assert (code, found["enabled"], found["taken"]) == (3, False, [])
    assert [one.removesuffix(" serve_a_drink") for one in found["missing"]] == [piece]
    assert not (tmp_path / "amigo").exists()


@pytest.mark.long
def test_what_was_taken_is_not_taken_again(tmp_path: Path) -> None:
    hospital(tmp_path / "kb.sqlite").close()
    enable(tmp_path / "kb.sqlite", tmp_path / "amigo")
    code, found = enable(tmp_path / "kb.sqlite", tmp_path / "amigo")
    assert (code, found["taken"], sorted(found["kept"])) == (0, [], sorted(PIECES.values()))
    hospital(tmp_path / "less.sqlite", without=PIECES["recipe"]).close()
    assert enable(tmp_path / "less.sqlite", tmp_path / "amigo")[0] == 0


def test_a_content_that_is_not_what_its_entry_states_is_refused(tmp_path: Path) -> None:
    store = hospital(tmp_path / "kb.sqlite")
    sha256 = store.entry("cupmodel.ada").revision.sha256
    wrong = store.entry(PIECES["recognition model Patient"]).revision.sha256
    store.close()
    assert hashlib.sha256(b"").hexdigest() not in (sha256, wrong)
    with closing(sqlite3.connect(tmp_path / "kb.sqlite")) as database, database:
        database.execute("UPDATE blobs SET data = ? WHERE sha256 = ?", (b"", wrong))
    code, found = enable(tmp_path / "kb.sqlite", tmp_path / "amigo")
    assert (code, found["missing"]) == (3, ["recognition model Patient"])
    refused = f"the content of {PIECES['recognition model Patient']} differs from the checksum of its entry"
    assert refused in json.dumps(found["explanation"])
    assert not (tmp_path / "amigo").exists()


@pytest.mark.long
def test_a_task_is_found_by_its_class_its_label_and_a_class_above_it(tmp_path: Path) -> None:
    hospital(tmp_path / "kb.sqlite").close()
    for name in ("ServeADrink", "serve a drink", "serveadrink.ward", "ServingFoodOrDrink"):
        code, found = enable(tmp_path / "kb.sqlite", tmp_path / "amigo", "--dry", task=name)
        assert (code, PIECES["recipe"] in found["taken"]) == (0, True), name
    code, found = enable(tmp_path / "kb.sqlite", tmp_path / "amigo", "--dry", task="Juggling")
    assert (code, found["missing"]) == (3, ["recipe Juggling"])


@pytest.mark.parametrize(
    ("task", "meant"),
    some(
        [("serve_a_drnk", "serve a drink"), ("ServADrink", "ServeADrink"), ("ServingFoodOrDrnk", "ServingFoodOrDrink")],
        every=3,
    ),
)
def test_names_like_that_of_an_unknown_task_are_proposed(tmp_path: Path, task: str, meant: str) -> None:
    hospital(tmp_path / "kb.sqlite").close()
    code, found = enable(tmp_path / "kb.sqlite", tmp_path / "amigo", task=task)
    assert (code, found["missing"]) == (3, [f"recipe {task}"])
    _, _, proposed = found["explanation"]["reason"].partition("; did you mean ")
    assert meant in proposed.removesuffix("?").split(" or ")


def test_what_the_robot_has_no_model_of_it_does_not_recognise(tmp_path: Path) -> None:
    """A run that is told its models ends with a failure that names the one that is missing."""
    (tmp_path / "models").mkdir()
    words = ["run", "serve_a_drink", "--models", str(tmp_path / "models"), "--json"]
    result = CliRunner().invoke(app, words, catch_exceptions=False)
    found = json.loads(result.stdout)
    assert (result.exit_code, "RecognitionModelMissing" in json.dumps(found["failure"])) == (1, True)
    assert "no recognition model of DrinkingBottle" in found["message"]


@pytest.mark.long
def test_a_model_that_is_taken_also_makes_the_robots_recognition_work(tmp_path: Path) -> None:
    """A robot whose self-model has no recognition model at all lacks a component, which the bottle's model is."""
    folder = Bundled.ROBOT.folder
    for path in folder.glob("amigo.*"):
        text = path.read_text(encoding="utf-8").replace(",\n        comp:subComponent recognition_model", "")
        (tmp_path / path.name).write_text(text, encoding="utf-8")
    hospital(tmp_path / "kb.sqlite").close()
    words = ("--robot", str(tmp_path / "amigo.toml"))
    code, found = enable(tmp_path / "kb.sqlite", tmp_path / "taken", "--run", *words)
    assert (code, found["final_state"]) == (0, ["bottle1: held by patient1"])
    assert sorted(found["taken"]) == sorted(PIECES.values())
    (capability,) = [one for one in found["explanation"]["requires"] if one["name"] == "GraspingCapability"]
    assert "ObjectRecognitionModel" in json.dumps(capability)


def test_a_damaged_list_and_a_file_of_the_users_own_are_reported_and_left(tmp_path: Path) -> None:
    hospital(tmp_path / "kb.sqlite").close()
    folder = tmp_path / "amigo"
    folder.mkdir()
    (folder / "taken.json").write_text('{"taken": [{"uid": "../../evil"}]}')
    code, found = enable(tmp_path / "kb.sqlite", folder)
    assert (code, [one["code"] for one in found["diagnostics"]]) == (2, ["K041"])
    (folder / "taken.json").unlink()
    mine = folder / "environments" / "hospital_room.ward" / "hospital_room.ward.omn"
    mine.parent.mkdir(parents=True)
    mine.write_text("mine")
    code, found = enable(tmp_path / "kb.sqlite", folder)
    assert (code, mine.read_text()) == (2, "mine")
