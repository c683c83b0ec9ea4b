"""The server over HTTP: what is handed in is checked, found again, and changed by its author alone."""

from __future__ import annotations

from fastapi.testclient import TestClient

from planlang.files import Bundled

RECIPE = Bundled.RECIPE.find("serve_a_drink").read_bytes()

BARE_ROBOT = """Prefix: : <http://example.org/bare.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://example.org/bare.owl>
Individual: bare
    Types: knowrob:Robot
"""


def test_a_recipe_is_handed_in_read_and_found(client: TestClient) -> None:
    made = client.post("/v1/recipes", params={"name": "ward"}, content=RECIPE)
    assert made.status_code == 201, made.text
    assert made.headers["Location"] == "/v1/recipes/serveadrink.ward"
    entry = made.json()["entry"]
    assert client.get("/v1/recipes/serveadrink.ward").json() == entry
    assert client.get("/v1/recipes/serveadrink.ward/content").content == RECIPE
    assert client.get("/v1/recipes").json() == {"entries": [entry], "next": None}
    for question in (
        {"expression": "ServingFoodOrDrink and subAction some Reaching"},
        {"label": "serve a d"},
        {"kind": "recipes"},
    ):
        found = client.get("/v1/search", params=question)
        assert [one["uid"] for one in found.json()["entries"]] == ["serveadrink.ward"], (question, found.text)


def test_a_robot_is_told_what_it_can_do_and_what_it_lacks(client: TestClient) -> None:
    client.post("/v1/recipes", params={"name": "ward"}, content=RECIPE)
    model = Bundled.ROBOT.find("amigo").with_suffix(".omn").read_text()
    question = {"kind": "recipes", "robot": model}
    (able,) = client.post("/v1/search", json=question).json()["entries"]
    assert (able["can"], able["missing"]) == ("yes", [])
    (unable,) = client.post("/v1/search", json=question | {"robot": BARE_ROBOT}).json()["entries"]
    assert unable["can"] == "no"
    assert "GripperMotionCapability" in {one["name"] for one in unable["missing"]}
