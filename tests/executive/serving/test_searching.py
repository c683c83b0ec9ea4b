"""Search over HTTP: by classes with their specialisations, words and places, and for a robot that sends its model."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable
from http import HTTPStatus
from pathlib import Path
from typing import Any, TypeVar

import pytest
from fastapi.testclient import TestClient

from executive.processes.workers import Source
from executive.serving.app import application
from executive.serving.catalogue import Catalogue
from executive.serving.workers import LIMITS, PREPARE, Failed, Staff, Workers
from planlang.files import Bundled
from planlang.knowledge.sqlite_store import SqliteStore
from tests.support.knowledge_bases import recognition_model, vocabulary

T = TypeVar("T")
BARE_ROBOT = """Prefix: : <http://example.org/bare.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://example.org/bare.owl>
Individual: bare
    Types: knowrob:Robot
"""
CUP_MODEL = """Prefix: : <http://example.org/cup.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Prefix: roboearth: <http://www.roboearth.org/kb/roboearth.owl#>
Ontology: <http://example.org/cup.owl>
Individual: cupModel
    Types: roboearth:RoboEarthObjRecModel
    Facts: roboearth:providesModelFor knowrob:Cup
"""


@pytest.fixture(autouse=True)
def entries(client: TestClient) -> None:
    robot = Bundled.ROBOT.find("amigo").with_suffix(".omn")
    for kind, name, data in (
        ("recipes", "ward", Bundled.RECIPE.find("serve_a_drink").read_bytes()),
        ("environments", "west", Bundled.ENVIRONMENT.find("hospital_room").read_bytes()),
        ("robots", "one", robot.read_bytes()),
        ("objects", "cup", CUP_MODEL.encode()),
    ):
        made = client.post(f"/v1/{kind}", params={"name": name}, content=data)
        assert made.status_code == HTTPStatus.CREATED, made.text


def test_the_number_of_entries_and_the_names_are_those_of_the_store(client: TestClient) -> None:
    assert client.get("/v1/health").json() == {"status": "ok", "entries": 4, "stale": 0}
    assert client.get("/names?start=TeaCupOf").json() == {"names": []}
    cup = b"Ontology: <urn:o> Class: <urn:o#TeaCupOfMine> SubClassOf: <http://knowrob.org/kb/knowrob.owl#Cup>"
    client.post("/v1/objects?name=cup", content=cup)
    assert client.get("/names?start=TeaCupOf").json() == {"names": ["TeaCupOfMine"]}
    assert client.get("/v1/health").json() == {"status": "ok", "entries": 5, "stale": 0}


def found(client: TestClient, **question: Any) -> list[str]:
    answer = client.get("/v1/search", params=question)
    assert answer.status_code == HTTPStatus.OK, answer.text
    posted = client.post("/v1/search", json=question)
    assert posted.json() == answer.json()
    return [one["uid"] for one in answer.json()["entries"]]


SERVING, ROOM, MODEL = "serveadrink.ward", "hospital_room.west", "cupmodel.cup"


EXPRESSIONS = (
    ("ServingFoodOrDrink", [SERVING]),
    ("Event", [SERVING]),
    ("ServeADrink and subAction some (VoluntaryBodyMovement or Reaching)", [SERVING]),
    ("subAction some (objectActedOn some Bottle)", [SERVING]),
    ("subAction some (objectActedOn some Bed-PieceOfFurniture)", []),
    ("SemanticEnvironmentMap", [ROOM]),
    ("mapOf some Bed-PieceOfFurniture and mapOf some Patient", [ROOM]),
    ("mapOf some Refrigerator", []),
    ("providesModelFor some Cup", [MODEL]),
    ("providesModelFor some DrinkingVessel", [MODEL]),
    ("providesModelFor some Cupboard", []),
    ("Robot and hasCapability some BaseMotionCapability", ["amigo1.one"]),
)


def test_a_class_expression_includes_specialisations(client: TestClient) -> None:
    answers = {expression: found(client, expression=expression) for expression, _ in EXPRESSIONS}
    assert answers == dict(EXPRESSIONS)


SHORT_MAP = """\
Prefix: : <http://example.org/flat.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://example.org/flat.owl>
{map}
Individual: room1
    Types: knowrob:RoomInAConstruction
    Facts: knowrob:translation "0 0 1.3", knowrob:boundingBoxSize "8 5 2.6"
Individual: table1
    Types: knowrob:Table-PieceOfFurniture
    Facts: knowrob:translation "1.5 0 0.38", knowrob:boundingBoxSize "0.6 1.0 0.76"
Individual: mug1
    Types: knowrob:DrinkingMug
    Facts: knowrob:translation "1.5 0 0.81", knowrob:boundingBoxSize "0.08 0.08 0.1", knowrob:on-Physical table1
"""


@pytest.mark.parametrize("written", ["Individual: flat Types: knowrob:SemanticEnvironmentMap", ""], ids=["map", "room"])
def test_a_map_is_found_by_its_things_though_they_do_not_say_that_it_describes_them(
    client: TestClient, written: str
) -> None:
    made = client.post("/v1/environments?name=short", content=SHORT_MAP.format(map=written))
    assert made.status_code == HTTPStatus.CREATED, made.text
    uid = "flat.short" if written else "room1.short"
    assert found(client, expression="mapOf some DrinkingMug") == [uid]
    assert found(client, expression="mapOf some (Cup and on-Physical some FurniturePiece)") == [uid]
    assert found(client, expression="mapOf value <http://example.org/flat.owl#mug1>") == [uid]
    assert found(client, expression="mapOf some Refrigerator") == []


SOMA_MAP = """\
@prefix : <http://example.org/corner.owl#> .
@prefix soma: <http://www.ease-crc.org/ont/SOMA.owl#> .
:corner a <http://knowrob.org/kb/knowrob.owl#SemanticEnvironmentMap> .
:glass1 a soma:WaterGlass ; soma:hasShape [ soma:hasRadius 0.04 ; soma:hasLength 0.1 ] ;
  soma:hasLocalization [ soma:hasSpaceRegion [ soma:hasPositionVector "1 0 0.05" ] ] .
"""


def test_a_map_in_somas_words_is_found_by_knowrobs(client: TestClient) -> None:
    made = client.post("/v1/environments?name=words", content=SOMA_MAP)
    assert made.status_code == HTTPStatus.CREATED, made.text
    assert found(client, expression="mapOf some DrinkingGlass") == ["corner.words"]
    assert found(client, expression="mapOf some <http://www.ease-crc.org/ont/SOMA.owl#Glass>") == ["corner.words"]
    assert found(client, expression="mapOf some Cupboard") == []


def test_words_are_parts_of_labels_and_names_in_any_case(client: TestClient) -> None:
    assert found(client, label="SERVE a d") == [SERVING]
    assert found(client, label="graspbottle", kind="recipes") == [SERVING]
    assert found(client, label="graspbottle", kind="robots") == []


def test_places_are_asked_for_by_number_name_or_label(client: TestClient) -> None:
    assert found(client, room="3001") == found(client, floor="3", room="ROOM1") == [ROOM]
    assert found(client, building="hospital1", kind="environments") == [ROOM]
    assert found(client, room="3002") == found(client, room="3001", floor="4") == []


def test_pages_go_on_behind_the_last_identifier(client: TestClient) -> None:
    first = client.get("/v1/search", params={"limit": 3}).json()
    assert (len(first["entries"]), first["next"]) == (3, first["entries"][-1]["uid"])
    second = client.get("/v1/search", params={"limit": 3, "after": first["next"]}).json()
    assert (len(second["entries"]), second["next"]) == (1, None)


def test_what_is_no_question_is_refused_with_a_reason(client: TestClient) -> None:
    for expression in ("Event and", "not Event", "(" * 5000, "SrvingFoodOrDrink"):
        refused = client.get("/v1/search", params={"expression": expression})
        assert refused.status_code == HTTPStatus.UNPROCESSABLE_ENTITY, expression
    assert "ServingFoodOrDrink" in refused.json()["diagnostics"][0]["help"]


def test_a_robot_is_told_what_it_can_do_and_what_it_lacks(client: TestClient) -> None:
    question = {"kind": "recipes", "robot": Bundled.ROBOT.find("amigo").with_suffix(".omn").read_text()}
    (able,) = client.post("/v1/search", json=question).json()["entries"]
    assert (able["can"], able["missing"]) == ("yes", [])
    (unable,) = client.post("/v1/search", json=question | {"robot": BARE_ROBOT}).json()["entries"]
    assert unable["can"] == "no"
    assert "GripperMotionCapability" in {one["name"] for one in unable["missing"]}
    refused = client.post("/v1/search", json={"robot": CUP_MODEL})
    assert refused.status_code == HTTPStatus.UNPROCESSABLE_ENTITY


def test_changed_and_deleted_entries_are_found_no_more_as_they_were(client: TestClient) -> None:
    path = "/v1/objects/cupmodel.cup"
    other = CUP_MODEL.replace("Cup", "Bottle").encode()
    tag = client.put(f"{path}/content", content=other, headers={"If-Match": client.get(path).headers["ETag"]})
    assert found(client, expression="providesModelFor some Cup") == []
    assert found(client, expression="providesModelFor some Bottle") == [MODEL]
    client.delete(path, headers={"If-Match": tag.headers["ETag"]})
    assert found(client, expression="providesModelFor some Bottle") == []


def test_what_another_server_on_the_same_store_takes_is_found(
    client: TestClient, store: SqliteStore, staff: Staff
) -> None:
    second = TestClient(application(store, staff), headers=client.headers)
    second.post("/v1/objects", params={"name": "second"}, content=CUP_MODEL)
    assert found(client, expression="providesModelFor some Cup") == [MODEL, "cupmodel.second"]


@pytest.mark.long
def test_descriptions_of_another_layout_are_made_anew_from_the_contents(
    client: TestClient, store: SqliteStore, staff: Staff
) -> None:
    for uid in (SERVING, MODEL):
        store.describe(uid, b"0 an older one", store.entry(uid).etag)
    restarted = application(store, staff)
    assert TestClient(restarted).get("/v1/health").json() == {"status": "ok", "entries": 4, "stale": 2}
    with TestClient(restarted) as later:
        while restarted.state.serving.catalogue.stale:
            later.get("/v1/health")
        assert found(later, expression="providesModelFor some Cup") == [MODEL]
        assert found(later, expression="subAction some (objectActedOn some Bottle)") == [SERVING]
    assert not store.description(MODEL).startswith(b"0")


@pytest.mark.long
def test_descriptions_are_made_anew_though_the_store_could_not_be_used_in_between(
    client: TestClient, store: SqliteStore, staff: Staff, monkeypatch: pytest.MonkeyPatch
) -> None:
    for uid in (SERVING, MODEL):
        store.describe(uid, b"0 an older one", store.entry(uid).etag)
    describe, problems = store.describe, [sqlite3.OperationalError("database is locked")]

    def described(uid: str, description: bytes, expected: str) -> None:
        if problems:
            raise problems.pop()
        describe(uid, description, expected)

    monkeypatch.setattr(store, "describe", described)
    restarted = application(store, staff)
    with TestClient(restarted) as later:
        while restarted.state.serving.catalogue.stale:
            later.get("/v1/health")
        assert found(later, expression="providesModelFor some Cup") == [MODEL]
        assert found(later, expression="subAction some (objectActedOn some Bottle)") == [SERVING]


def test_a_content_that_cannot_be_described_keeps_what_it_has_and_no_other_waits_for_it(
    client: TestClient, store: SqliteStore
) -> None:
    class Mistaken(Workers):
        def call(self, function: Callable[..., T], *arguments: object) -> T:
            raise Failed("ZeroDivisionError")

    for uid in (SERVING, MODEL):
        store.describe(uid, b"0 an older one", store.entry(uid).etag)
    catalogue = Catalogue(store, vocabulary())
    workers = Mistaken(Source(PREPARE), 1, LIMITS)
    assert [catalogue.renew(workers) for _ in range(3)] == [True, True, False]
    assert {SERVING, MODEL} <= set(catalogue.find(None))


def test_a_name_that_several_entries_define_means_any_of_their_classes(client: TestClient) -> None:
    theirs = Bundled.RECIPE.find("serve_a_drink").read_bytes().replace(b"kb/serve_a_drink.owl", b"kb/another.owl")
    client.post("/v1/recipes", params={"name": "west"}, content=theirs)
    assert found(client, expression="ServeADrink") == [SERVING, "serveadrink.west"]
    assert found(client, expression="Event and ServeADrink", label="ward") == []
    assert found(client, expression="<http://planlang.org/kb/another.owl#ServeADrink>") == ["serveadrink.west"]
    assert found(client, expression="subAction some GraspBottle") == [SERVING, "serveadrink.west"]


def test_the_best_rated_come_first_if_that_is_asked_for(client: TestClient) -> None:
    for name, rating in (("a", 1), ("b", None), ("c", 9), ("d", 8)):
        made = client.post("/v1/objects", params={"name": name}, content=recognition_model("Cup"))
        assert made.status_code == 201, made.text
        if rating is not None:
            for author in ("bob", "eve", "kim"):
                store = client.app.state.serving.store  # type: ignore[attr-defined]
                store.rate(made.json()["entry"]["uid"], author, rating, "2026-01-01T00:00:00Z")
    found, after = [], ""
    while after is not None:
        page = client.get("/v1/search", params={"sort": "rating", "limit": 3, "after": after}).json()
        names = (one["uid"].partition(".")[2] for one in page["entries"])
        found += [name for name in names if name in "abcd"]
        after = page["next"]
    assert found == ["c", "d", "b", "a"], "an entry without a rating is ranked as a middling one"
    assert client.get("/v1/search", params={"sort": "rating", "after": "cupmodel.x"}).status_code == 422


def test_a_question_may_use_somas_words(client: TestClient) -> None:
    take = Path(__file__).parents[1] / "maps" / "soma" / "take.ttl"
    assert client.post("/v1/recipes?name=soma", content=take.read_bytes()).status_code == HTTPStatus.CREATED
    for action in ("soma:PickingUp", "PickingUp", "PickingUpAnObject"):
        assert found(client, expression=f"subAction some {action}") == ["take.soma"]
