"""Maps from above: what has a box is drawn in its place, as large as it is, whatever it is called."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from hypothesis import given
from hypothesis import strategies as st

from executive.maps.classes import MapObject
from executive.maps.semantic_map import SemanticMap, read_map
from executive.serving.floor_plan import HEIGHT, MARGIN, WIDTH, floor_plan, read_plan
from executive.serving.workers import Busy, Failed, Workers
from planlang.files import Bundled
from planlang.geometry import Pose
from planlang.ontology import load
from tests.support.knowledge_bases import vocabulary

ROOM = Bundled.ENVIRONMENT.find("hospital_room")
SVG = "{http://www.w3.org/2000/svg}"
EXTENTS = st.floats(1e-4, 1e4)


def outlines(drawing: str) -> dict[str, list[tuple[float, float]]]:
    """Return the corners of each thing by its title's beginning [px]."""
    found = {}
    for shape in ElementTree.fromstring(drawing).iter(f"{SVG}polygon"):
        corners = [(float(x), float(y)) for x, y in re.findall(r"([-\d.]+),([-\d.]+)", shape.attrib["points"])]
        found[str(shape[0].text).partition(":")[0]] = corners
    return found


def test_a_thing_stands_where_the_map_says_to_scale() -> None:
    found = outlines(floor_plan(read_map(load(ROOM))))
    assert len(found) == 9
    room, bed = (sorted(found[name]) for name in ("room1", "bed1"))
    scale = (room[-1][0] - room[0][0]) / 6.0
    assert bed[-1][0] - bed[0][0] == pytest.approx(2.0 * scale, abs=0.2)
    assert (bed[0][0] + bed[-1][0]) / 2 == pytest.approx(room[0][0] + (1.95 + 3.0) * scale, abs=0.2)
    upper, lower = (min(y for _, y in room), max(y for _, y in room))
    assert lower - upper == pytest.approx(5.0 * scale, abs=0.2)
    assert sum(y for _, y in bed) / 4 == pytest.approx(lower - (0.6 + 2.5) * scale, abs=0.2)


@given(st.lists(st.tuples(st.tuples(*(st.floats(-1e4, 1e4),) * 3), st.tuples(*(EXTENTS,) * 3), st.text()), min_size=1))
def test_whatever_a_map_states_stays_on_the_page_and_is_text(
    boxes: list[tuple[tuple[float, ...], tuple[float, ...], str]],
) -> None:
    ontology = load(ROOM).alone()
    things = [
        MapObject(f"urn:{number}", name, ("urn:a#<b>",), Pose(position, (0.0, 0.6, 0.0, 0.8)), size)
        for number, (position, size, name) in enumerate(boxes)
    ]
    drawing = floor_plan(SemanticMap(None, ontology, tuple(things), ()))
    assert drawing.count("<polygon") == len(things)
    assert "<b>" not in drawing
    for x, y in re.findall(r"([-\d.]+),([-\d.]+)", " ".join(re.findall(r'points="([^"]*)"', drawing))):
        assert MARGIN - 1 <= float(x) <= WIDTH + 2 * MARGIN
        assert MARGIN - 1 <= float(y) <= HEIGHT + 2 * MARGIN


def drawing_of(*things: MapObject) -> str:
    return floor_plan(SemanticMap(None, load(ROOM).alone(), things, ()))


def test_the_ruler_of_a_map_that_has_just_not_room_for_the_next_length_is_the_one_below() -> None:
    drawing = drawing_of(MapObject("urn:1", "box", ("urn:Box",), Pose((1.1, 0.0, 0.0)), (0.6, 0.3, 0.3)))
    assert ">0.05 m</text>" in drawing  # 0.1 m are six times in 1.4 - 0.8 m, which is less than 0.6 m by a rounding


def test_a_map_of_too_many_things_says_how_many_are_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    assert "Only the first" not in read_plan("room.ward", ROOM.read_bytes(), vocabulary())
    monkeypatch.setattr("executive.serving.floor_plan.MOST_THINGS", 5)
    assert "Only the first 5 of its 9 things are drawn." in read_plan("room.ward", ROOM.read_bytes(), vocabulary())


@pytest.mark.parametrize("problem", [Failed("ZeroDivisionError"), Busy(1)])
def test_the_page_of_an_entry_is_there_though_it_cannot_be_drawn_and_compared_now(
    client: TestClient, monkeypatch: pytest.MonkeyPatch, problem: Exception
) -> None:
    client.post("/v1/environments?name=ward", content=ROOM.read_bytes())
    client.post("/v1/recipes?name=ward", content=Bundled.RECIPE.find("serve_a_drink").read_bytes())
    client.post("/v1/robots?name=tue", content=Bundled.ROBOT.find("amigo").with_suffix(".omn").read_bytes())

    def call(*_: object) -> None:
        raise problem

    monkeypatch.setattr(Workers, "call", call)
    for address in ("/environments/hospital_room.ward", "/recipes/serveadrink.ward"):
        page = client.get(address)
        assert page.status_code == 200
        assert "<svg" not in page.text
        assert "cannot be compared now; try again later" in page.text


def test_a_map_is_drawn_on_its_page_with_its_files_and_their_digests(client: TestClient, tmp_path: Path) -> None:
    client.post("/v1/environments?name=ward", content=ROOM.read_bytes())
    kept = client.put("/v1/binaries/hospital_room.ward/grid.pgm", content=b"P5 1 1 255 0").json()["attachments"][0]
    page = client.get("/environments/hospital_room.ward").text
    assert 'aria-label="Map from above: 9 things"' in page
    assert f"SHA-256 {kept['sha256']}" in page
    assert "12 bytes" in page
