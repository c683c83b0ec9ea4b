"""Maps of all kinds in a knowledge base: found by class and place, and what one robot learned served to the next."""

from dataclasses import replace
from http import HTTPStatus
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from executive.belief import Belief
from executive.belief.map_updating import updated_map
from executive.enabling.shelf import LocalShelf
from executive.maps import read_map, scene_of
from executive.maps.occupied_space import OBSTACLE
from planlang.files import Bundled
from planlang.geometry import Pose
from planlang.knowledge.entries import File, Kind
from planlang.knowledge.pulling import pull
from planlang.knowledge.sqlite_store import SqliteStore
from planlang.ontology import load
from sim import PlanningWorld
from tests.support.detections import recognise
from tests.support.knowledge_bases import NOW, put
from tests.support.refusals import refusal

FILES = {
    "semantic": "map_hospital_room@re_stack.owl.in",
    "grid": "ias_hospital_room_2D_occupancy_map@re_stack.owl.in",
    "octree": "ias_hospital_room_octomap@re_stack.owl.in",
}


@pytest.fixture
def entries(client: TestClient, corpus: Path) -> dict[str, str]:
    """The identifiers of the maps of one room."""
    uids = {}
    for name, file in FILES.items():
        content = (corpus / "environments" / file).read_bytes()
        made = client.post("/v1/environments", params={"name": name}, content=content)
        assert made.status_code == HTTPStatus.CREATED, made.text
        uids[name] = made.json()["entry"]["uid"]
    return uids


def found(client: TestClient, **question: str) -> set[str]:
    return {one["uid"] for one in client.get("/v1/search", params=question).json()["entries"]}


def test_every_map_of_a_room_is_found_by_its_place_whichever_way_round_it_is_stated(
    client: TestClient, entries: dict[str, str]
) -> None:
    asked = {"room": "3001", "floor": "3", "street": "Karlstrasse 45", "city": "Munich"}
    assert found(client, **asked) == set(entries.values())
    assert found(client, expression="roboearth:OccupancyGridMap", **asked) == {entries["grid"]}
    assert found(client, expression="roboearth:ThreeDimensionalMap", room="3001") == {entries["octree"]}
    assert found(client, expression="Map", street="Karlstrasse 45") == set(entries.values())
    assert found(client, room="3002") == set()


def test_a_map_that_one_robot_has_improved_is_served_to_the_next(client: TestClient, tmp_path: Path) -> None:
    path = Bundled.ENVIRONMENT.find("hospital_room")
    made = client.post("/v1/environments", params={"name": "ward"}, content=path.read_bytes())
    uid = made.json()["entry"]["uid"]
    semantic_map = read_map(load(path))
    world = PlanningWorld(scene_of(semantic_map))
    belief = Belief(semantic_map, world)
    recognise(belief, "bottle1", Pose((-2.7, -0.5, 0.9)), 1.0)
    text = updated_map(belief, {path}, (), [])
    world.close()
    where = f"/v1/environments/{uid}/content"
    changed = client.put(where, content=text.encode(), headers={"If-Match": made.headers["ETag"]})
    assert changed.status_code == HTTPStatus.OK, changed.text
    (tmp_path / "next.omn").write_bytes(client.get(where).content)
    bottle = read_map(load(tmp_path / "next.omn")).find("bottle1")
    assert bottle
    assert bottle.pose
    assert bottle.pose.position == pytest.approx((-2.7, -0.5, 0.9))


def test_a_thing_that_links_to_the_file_of_a_map_is_no_map(tmp_path: Path) -> None:
    room = Bundled.ENVIRONMENT.find("hospital_room").read_text(encoding="utf-8")
    plan = '\nIndividual: plan1\n    Types: knowrob:Poster\n    Facts: knowrob:linkToMapFile "ward.yaml"\n'
    store = SqliteStore(tmp_path / "kb.sqlite")
    entry = put(store, Kind.ENVIRONMENT, "ward", room + plan)
    store.close()
    assert entry.about.endswith("#hospital_room")


GRID = b"image: /home/somebody/ward.pgm\nresolution: 0.5\norigin: [-1, -1, 0]\n"
PICTURE = b"P5 4 4 255\n" + bytes([254] * 5 + [0, 0] + [254] * 9)


@pytest.mark.parametrize("link", ["ward.yaml", "http://dead.example.org/maps/ward.yaml"])
def test_the_grid_of_a_map_is_pulled_with_it_and_is_an_obstacle_then(link: str, tmp_path: Path) -> None:
    room = Bundled.ENVIRONMENT.find("hospital_room").read_text(encoding="utf-8")
    grid = f'\nIndividual: grid1\n    Types: knowrob:Map\n    Facts: knowrob:linkToMapFile "{link}"\n'
    store = SqliteStore(tmp_path / "kb.sqlite")
    uid = put(store, Kind.ENVIRONMENT, "ward", room + grid, about="hospital_room").uid
    store.attach(uid, File("ward.yaml", "application/yaml", GRID), "ada", NOW)
    store.attach(uid, File("ward.pgm", "image/x-portable-graymap", PICTURE), "ada", NOW)
    entry = store.entry(uid)
    store.close()
    shelf = LocalShelf(tmp_path / "kb.sqlite")
    files = pull(shelf, [(entry, tmp_path / "pulled")])
    (box,) = (body for body in scene_of(read_map(load(files[0]))).bodies if body.name.startswith(OBSTACLE))
    assert (box.pose.position[:2], box.size[:2]) == (pytest.approx((0.0, 0.25)), pytest.approx((1.0, 0.5)))
    changed = replace(entry.attachments[0], sha256="0" * 64)
    with refusal("K040"):
        pull(shelf, [(replace(entry, attachments=(changed,)), tmp_path / "again")])
    shelf.close()
