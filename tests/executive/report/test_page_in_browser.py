"""The page of a run in a real Chromium: one clock, causes with their lines, without WebGL, readable for everybody."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from html import escape
from pathlib import Path
from typing import Any

import pytest
from browsers import Watched, another_browser, started_browser

from executive.runs.options import Outcome
from executive.runs.plan_run import run_plan_file
from planlang import par, sleep
from planlang.files import Bundled
from planlang.ontology.convert import Target, convert
from planlang.testing import run_plan
from tests.executive.conftest import BUNDLED
from tests.executive.report.conftest import Reported
from tests.support.examples import some

RECIPE = Bundled.RECIPE.find("serve_a_drink")
ROOM = Bundled.ENVIRONMENT.find("hospital_room")
HOSTILE = "</script><img src=x onerror=\"document.title = 'run'\"><!--<script>"
WITHOUT_WEBGL = "--disable-3d-apis"


@pytest.fixture(scope="module")
def pages(reported: Reported, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Pages of a run that recovers and of one that fails."""
    folder = tmp_path_factory.mktemp("pages")
    tower = folder / "tower.omn"
    text = ROOM.read_text().replace("knowrob:m23 0.9,", "knowrob:m23 2.3,")
    assert "bottle1" in text
    tower.write_text(text)
    failed = run_plan_file(replace(BUNDLED, environment=tower, report=folder / "failed.html"))
    assert (reported.result.outcome, failed.outcome) == (Outcome.DONE, Outcome.FAILED)
    return {"recovered": reported.page, "failed": folder / "failed.html"}


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with started_browser() as started:
        yield started


def opened(browser: Any, file: Path, address: str = "", **options: Any) -> Watched:
    """Open a page from the disk, and wait until all of it is there."""
    watched = Watched(browser, viewport={"width": 1280, "height": 800}, **options)
    watched.page.goto(file.as_uri() + address)
    watched.page.wait_for_selector("html[data-ready=all]")
    return watched


def seek(page: Any, seconds: float) -> None:
    """Put the slider of the clock somewhere, as a hand does."""
    page.locator("#slider").evaluate(
        "(slider, time) => { slider.value = time; slider.dispatchEvent(new Event('input')); }", seconds
    )


def status(page: Any, name: str) -> str:
    return str(page.get_by_role("treeitem", name=name).first.get_attribute("data-status"))


@pytest.mark.parametrize("scheme", some(["light", "dark"]))
def test_scene_tree_and_lanes_move_with_one_clock(browser: Any, pages: dict[str, Path], scheme: str) -> None:
    watched = opened(browser, pages["recovered"], color_scheme=scheme)
    page = watched.page
    before = page.locator("#scene canvas").screenshot()
    assert status(page, "LiftBottle") == "waiting"
    seek(page, 30)
    assert status(page, "LiftBottle") == "running"
    assert page.locator("#scene").get_attribute("data-time") == "30.00"
    assert page.locator("#lanes canvas").get_attribute("data-time") == "30.00"
    assert page.locator("#scene canvas").screenshot() != before
    page.get_by_role("tab", name="Map").click()
    assert page.locator("#map").get_attribute("data-time") == "30.00"
    page.get_by_role("tab", name="Recipe").click()
    assert page.locator("#graph .box[data-status=running]").count() > 0
    page.keyboard.press("End")
    assert status(page, "LiftBottle") == "succeeded"
    assert watched.findings() == []
    assert (watched.said, watched.asked) == ([], [])


def test_a_failure_opens_with_what_to_change_its_cause_and_its_line(browser: Any, pages: dict[str, Path]) -> None:
    watched = opened(browser, pages["failed"])
    page = watched.page
    first = page.locator("#cards .card").first
    assert "0.84 m too high" in first.locator(".advice").inner_text()
    assert "because of LocationUnresolvable" in first.inner_text()
    assert "out of reach: 320" in first.inner_text()
    lines = first.locator(".excerpt .at")
    assert "at_location" in lines.nth(0).inner_text()
    assert "ServeADrink" in lines.nth(1).inner_text()
    page.keyboard.press("Home")
    first.get_by_role("button", name="Show the moment").click()
    assert page.locator("#slider").get_attribute("aria-valuetext") == "5.37 s of 5.37 s"
    assert page.get_by_role("treeitem", name="at_location").get_attribute("aria-selected") == "true"
    page.get_by_role("tab", name="Map").click()
    page.get_by_text("no place was found").wait_for()
    assert watched.findings() == []
    assert (watched.said, watched.asked) == ([], [])


@pytest.mark.long
@pytest.mark.parametrize("scheme", some(["light", "dark"], every=2))
def test_without_webgl_the_map_takes_the_place_of_the_scene_and_says_so(
    browser: Any, pages: dict[str, Path], scheme: str
) -> None:
    with another_browser(browser, WITHOUT_WEBGL) as plain:
        watched = opened(plain, pages["recovered"], color_scheme=scheme)
        page = watched.page
        page.get_by_text("The map shows the room from above, without heights").wait_for()
        assert page.get_by_role("tab", name="Scene").is_disabled()
        robot = page.locator("#map .robot")
        before = robot.get_attribute("cx")
        seek(page, 20)
        assert robot.get_attribute("cx") != before
        assert page.locator("#map .ghost").count() > 0
        assert watched.findings() == []
        assert watched.said == []


@pytest.mark.long
def test_an_address_leads_to_a_moment_and_a_step(browser: Any, pages: dict[str, Path]) -> None:
    watched = opened(browser, pages["recovered"])
    page = watched.page
    page.get_by_role("treeitem", name="LiftBottle").click()
    seek(page, 30)
    page.wait_for_url("**#t=30&node=*")
    other = opened(browser, pages["recovered"], "#" + page.url.partition("#")[2])
    assert other.page.locator("#details h2").inner_text().startswith("LiftBottle")
    assert status(other.page, "LiftBottle") == "running"


def test_a_run_is_searched_and_told_by_the_keyboard_alone(browser: Any, pages: dict[str, Path]) -> None:
    watched = opened(browser, pages["recovered"])
    page = watched.page
    page.keyboard.press("/")
    page.keyboard.type("handover pose")
    assert page.get_by_role("option").count() > 0
    page.keyboard.press("Enter")
    assert "MoveBaseToHandoverPose" in page.locator("#details h2").inner_text()
    page.locator("#tree").focus()
    page.keyboard.press("ArrowDown")
    assert "ReachToHandoverPose" in page.locator("#details h2").inner_text()
    page.keyboard.press("5")
    story = page.locator("#story").text_content()
    assert "fails: the arm has no room at its goal" in story
    assert story.index("fails: the arm has no room") < story.index("The robot chooses another place to stand")
    page.keyboard.press("?")
    page.get_by_role("heading", name="Keys").wait_for()
    assert watched.findings() == []
    assert watched.said == []


@pytest.mark.long
def test_markup_in_a_map_and_in_labels_of_a_recipe_is_text(browser: Any, tmp_path: Path) -> None:
    room, recipe, page = tmp_path / "room.owl", tmp_path / "serve_a_drink.omn", tmp_path / "run.html"
    written = convert(ROOM, Target.RDFXML).text
    assert "chair1" in written
    room.write_text(written.replace("chair1", "chair1" + escape(HOSTILE, quote=True)), encoding="utf-8")
    label = "drive to where the bottle is in reach"
    quoted = HOSTILE.replace('"', '\\"')
    recipe.write_text(RECIPE.read_text().replace(f'"{label}"', f'"{label} {quoted}"'), encoding="utf-8")
    result = run_plan_file(replace(BUNDLED, recipe=recipe, environment=room, report=page))
    assert result.outcome is Outcome.DONE
    watched = opened(browser, page)
    watched.page.keyboard.press("5")
    assert f"the bottle is in reach {HOSTILE}" in watched.page.locator("#story").text_content()
    watched.page.keyboard.press("2")
    assert "<!--<script>" in watched.page.locator("#map").inner_text()
    assert watched.page.locator("img").count() == 0
    assert watched.page.title() == "serve_a_drink: done"
    assert (watched.said, watched.asked) == ([], [])


def test_ten_thousand_steps_are_there_within_a_second(browser: Any, tmp_path: Path) -> None:
    async def step() -> None:
        await sleep(0.01)

    async def block() -> None:
        for _ in range(50):
            await par(step)

    async def many() -> None:
        for _ in range(100):
            await par(block)

    run_plan(many).report(tmp_path / "run.html")
    watched = opened(browser, tmp_path / "run.html")
    assert len(watched.page.evaluate("planlang.model.nodes.map((node) => node.id)")) > 10_000
    assert watched.page.locator("#tree [role=treeitem]").count() < 100
    taken = watched.page.locator("html").get_attribute("data-took")
    assert float(str(taken)) < 3000, "a second on an idle machine [ms]"
    seek(watched.page, 25)
    assert watched.page.locator("#tree .now").count() > 0
    assert watched.said == []


def test_a_run_that_grows_is_shown_as_it_does(browser: Any, pages: dict[str, Path]) -> None:
    page = opened(browser, pages["recovered"]).page
    page.evaluate(
        """() => {
            const root = planlang.model.nodes[0], end = planlang.model.end + 5;
            const node = {id: 9999, parent: root.id, kind: "perform", name: "Later", text: "", status: "running",
                start: end - 1, end: null};
            planlang.grow({nodes: [{...root, status: "running", end: null}, node], end});
        }"""
    )
    seek(page, 66.5)
    assert status(page, "Later") == "running"


def test_open_cards_leave_room_for_the_scene_and_a_step_fails_only_once_it_has(
    browser: Any, pages: dict[str, Path]
) -> None:
    page = opened(browser, pages["failed"]).page
    page.set_viewport_size({"width": 1280, "height": 720})
    assert page.locator("#scene").evaluate("(scene) => scene.clientHeight") >= 250
    assert "Why it failed" in page.locator("#details").inner_text()
    assert "--start=0,0,0" in page.locator("#facts").inner_text()
    seek(page, 2)
    assert "Why it failed" not in page.locator("#details").inner_text()
    assert "fails at 5.37 s" in page.locator("#details").inner_text()
    page.locator("#search").fill("bottle1")
    assert page.get_by_role("option").first.inner_text().startswith("bottle1, a thing")


@pytest.mark.long
def test_a_narrow_page_has_everything_below_each_other(browser: Any, pages: dict[str, Path]) -> None:
    watched = opened(browser, pages["failed"])
    watched.page.set_viewport_size({"width": 400, "height": 800})
    assert watched.page.evaluate("document.documentElement.scrollWidth") == 400
    assert watched.findings() == []


@pytest.mark.long
def test_paper_has_causes_and_story(browser: Any, pages: dict[str, Path]) -> None:
    page = opened(browser, pages["failed"]).page
    page.emulate_media(media="print")
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    printed = page.locator("#printed")
    assert printed.is_visible()
    assert "The plan fails after 5.4 s" in printed.inner_text()
    assert not page.locator("#search").is_visible()
