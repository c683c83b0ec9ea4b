"""The web page in a real Chromium: what its scripts help with, what they may not do, and what everybody can read."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from browsers import Watched, started_browser
from servers import RunningServer, running_server

from planlang.files import Bundled
from planlang.knowledge.entries import Kind

NOW = "2026-01-01T00:00:00Z"
RECIPE = Bundled.RECIPE.find("serve_a_drink")
MAP = "/environments/hospital_room.ward"
BROKEN = RECIPE.read_text().replace("toLocation value graspingPlace", "toLocation valu graspingPlace", 1)
SCRIPT = "<script>document.title = 'run'</script><img src=x onerror=\"document.title = 'run'\">"


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with started_browser() as started:
        yield started


@pytest.fixture
def server(tmp_path: Path) -> Iterator[RunningServer]:
    with running_server(tmp_path / "kb.sqlite") as running:
        yield running


@pytest.mark.long
def test_a_recipe_is_uploaded_mended_found_and_rated(browser: Any, server: RunningServer, tmp_path: Path) -> None:
    watched = Watched(browser, server.url)
    page, key = watched.page, server.key("ada")
    file = tmp_path / "ward.omn"
    file.write_text(BROKEN)
    page.goto("/")
    page.get_by_role("link", name="Upload", exact=True).click()
    page.get_by_label("File").set_input_files(file)
    page.wait_for_function("document.getElementById('text').value.length > 0")
    assert page.get_by_label("Your name for it").input_value() == "ward"
    page.get_by_label("Your key").fill(key)
    page.get_by_role("button", name="Upload").click()

    diagnostic = page.locator(".source .diagnostic.error").first
    diagnostic.wait_for()
    line = BROKEN.split("\n").index("        knowrob:toLocation valu graspingPlace") + 1
    assert page.locator(".source .diagnosed .number").first.inner_text() == str(line)
    assert watched.findings() == []

    diagnostic.get_by_role("link", name=f"edit line {line}").click()
    text = page.get_by_label("Text")
    chosen = text.evaluate("field => field.value.slice(field.selectionStart, field.selectionEnd)")
    assert chosen == "        knowrob:toLocation valu graspingPlace"
    page.keyboard.type(chosen.replace("valu ", "value "))
    assert page.get_by_label("Your key").input_value() == key
    page.get_by_role("button", name="Upload").click()
    page.get_by_text("Accepted.").wait_for()
    assert watched.findings() == []

    page.get_by_role("link", name="Search", exact=True).click()
    page.get_by_label("Class expression").press_sequentially("servingfood")
    page.get_by_role("option", name="ServingFoodOrDrink", exact=True).wait_for()
    page.keyboard.press("ArrowDown")
    page.keyboard.press("Enter")
    assert page.get_by_label("Class expression").input_value() == "ServingFoodOrDrink"
    page.keyboard.press("Enter")
    page.get_by_role("link", name="serve a drink").click()
    page.get_by_role("img", name="ServeADrink").wait_for()
    page.get_by_label("8", exact=True).check()
    page.get_by_label("Your key").fill(server.key("eve"))
    page.get_by_role("button", name="Rate").click()
    page.get_by_text("1 rating").wait_for()
    assert server.store.entry("serveadrink.ward").ratings == 1
    assert key not in page.url
    assert watched.said == []


LIGHT, DARK = ("light", 1280), ("dark", 360)


@pytest.mark.long
@pytest.mark.parametrize(("scheme", "width"), [pytest.param(*LIGHT, marks=pytest.mark.long), DARK])
def test_every_page_is_accessible(browser: Any, server: RunningServer, scheme: str, width: int) -> None:
    fill(server)
    viewport = {"width": width, "height": 800}
    watched = Watched(browser, server.url, color_scheme=scheme, viewport=viewport)
    paths = ("/", "/recipes", "/recipes/serveadrink.ward", "/robots/amigo1.tue", MAP, "/search?expression=Nonsense")
    for path in (*paths, "/search?kind=recipes&robot=amigo1.tue", "/upload", "/news"):
        watched.page.goto(path)
        assert watched.findings() == [], path
        assert watched.page.evaluate("document.documentElement.scrollWidth") == width, path
    watched.page.goto("/recipes/serveadrink.ward")
    watched.page.locator("#watch-key").fill(server.key("eve"))
    watched.page.get_by_role("button", name="Watch", exact=True).click()
    watched.page.get_by_role("heading", name="Entries that eve watches").wait_for()
    assert watched.findings() == []
    watched.page.goto("/search")
    watched.page.get_by_label("Class expression").press_sequentially("bott")
    watched.page.get_by_role("option").first.wait_for()
    watched.page.keyboard.press("ArrowDown")
    assert watched.findings() == []
    assert watched.said == []


@pytest.mark.long
def test_everything_is_read_and_rated_without_scripts(browser: Any, server: RunningServer) -> None:
    fill(server)
    page = Watched(browser, server.url, java_script_enabled=False).page
    page.goto("/")
    page.get_by_label("Label or name").fill("drink")
    page.get_by_role("button", name="Search").click()
    page.get_by_role("link", name="serve a drink").click()
    page.get_by_role("img", name="ServeADrink").wait_for()
    page.get_by_text("amigo1.tue").wait_for()
    page.get_by_label("8", exact=True).check()
    page.get_by_label("Your key").fill(server.key("eve"))
    page.get_by_role("button", name="Rate").click()
    page.get_by_text("1 rating").wait_for()


@pytest.mark.long
def test_a_map_is_shown_from_above_and_its_things_tell_what_they_are(browser: Any, server: RunningServer) -> None:
    fill(server)
    watched = Watched(browser, server.url)
    watched.page.goto(MAP)
    watched.page.get_by_role("img", name="Map from above: 9 things").wait_for()
    bed, patient = (
        watched.page.locator(f".plan .thing:has-text('{name}1:')").bounding_box() for name in ("bed", "patient")
    )
    assert bed["width"] == pytest.approx(bed["height"] * 2.0 / 0.92, rel=0.02)
    assert bed["x"] < patient["x"]
    assert patient["x"] + patient["width"] <= bed["x"] + bed["width"]
    assert watched.said == []


@pytest.mark.long
def test_scripts_in_labels_and_steps_do_nothing(browser: Any, server: RunningServer) -> None:
    hostile = RECIPE.read_text()
    for label in ("serve a drink", "drive to where the bottle is in reach"):
        hostile = hostile.replace(f'"{label}"', '"' + SCRIPT.replace('"', '\\"') + '"')
    fill(server, hostile.encode())
    assert server.store.entry("serveadrink.ward").label == SCRIPT
    watched = Watched(browser, server.url)
    for path in ("/", "/recipes", "/recipes/serveadrink.ward", f"/search?label={SCRIPT}&expression={SCRIPT}"):
        watched.page.goto(path)
        watched.page.wait_for_load_state("networkidle")
        assert watched.page.locator("main").text_content().count("document.title") > 0 or "expression" in path
        assert watched.page.title() != "run"
        assert watched.page.locator("main script, main img[src]").count() == 0
    assert watched.said == []


def fill(server: RunningServer, recipe: bytes = RECIPE.read_bytes()) -> None:
    """Put a recipe, a robot and a map into the store of a server."""
    from executive.serving.uploads import read_upload
    from executive.serving.vocabulary import read_vocabulary

    vocabulary = read_vocabulary()
    robot = Bundled.ROBOT.find("amigo").with_suffix(".omn").read_bytes()
    room = Bundled.ENVIRONMENT.find("hospital_room").read_bytes()
    given = ((Kind.RECIPE, "ward", recipe), (Kind.ROBOT, "tue", robot), (Kind.ENVIRONMENT, "ward", room))
    for kind, name, data in given:
        server.store.create(read_upload(kind, name, data, None, vocabulary).content, "ada", NOW)
