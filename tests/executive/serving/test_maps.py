"""Maps of all kinds in a knowledge base: found by class and place, and what one robot learned served to the next."""

from http import HTTPStatus
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from executive.belief import Belief, read_map, scene_of
from executive.belief.map_updating import updated_map
from planlang.files import Bundled
from planlang.geometry import Pose
from planlang.ontology import load
from planlang.protocols import Detection
from sim import PlanningWorld

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
    belief.see([Detection("bottle1", Pose((-2.7, -0.5, 0.9)), 1.0)])
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
