"""The page of a run in a real Chromium: one clock, causes with their lines, without WebGL, readable for everybody."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from html import escape
from pathlib import Path
from typing import Any

import pytest
from browsers import Watched, another_browser, started_browser
from click.testing import CliRunner

from executive.cli.app import app
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
    tried = first.locator(".events").inner_text()
    assert "moving to another place (to x -1.52 y -0.50 yaw -2.90): done in 4.2 s" in tried
    assert "looking for something (bottle1): done in 1.1 s" in tried
    drive = lines.all_inner_texts()[1:]
    assert [text.split(maxsplit=1)[1].strip() for text in (drive[0], drive[-1])] == [
        "Class: MoveBaseToGraspPose",
        "knowrob:toLocation value graspingPlace",
    ]
    page.keyboard.press("Home")
    first.get_by_role("button", name="Show the moment").click()
    assert page.locator("#slider").get_attribute("aria-valuetext") == "5.37 s of 5.37 s"
    assert page.get_by_role("treeitem", name="at_location").get_attribute("aria-selected") == "true"
    page.get_by_role("tab", name="Map").click()
    page.get_by_text("no place was found").wait_for()
    assert watched.findings() == []
    assert (watched.said, watched.asked) == ([], [])


def test_a_run_that_was_cut_off_opens_where_it_stopped(browser: Any, tmp_path: Path) -> None:
    async def first() -> None:
        await sleep(2)

    async def then() -> None:
        await par(first)
        await sleep(2)

    *lines, _ = run_plan(then).trace.text().splitlines(keepends=True)
    trace = tmp_path / "cut.jsonl"
    trace.write_text("".join(lines), encoding="utf-8")
    CliRunner().invoke(app, ["report", str(trace)])
    shown = opened(browser, tmp_path / "cut.html").page
    assert shown.locator("#outcome").inner_text() == "not ended"
    assert shown.locator("#slider").get_attribute("aria-valuetext") == "2.00 s of 2.00 s"


@pytest.mark.parametrize("scheme", some(["light", "dark"]))
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


@pytest.mark.long
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


@pytest.mark.long
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
    seek(page, float(page.evaluate("planlang.model.end")) - 0.5)
    assert status(page, "Later") == "running"


@pytest.mark.long
def test_open_cards_leave_room_for_the_scene_and_a_step_fails_only_once_it_has(
    browser: Any, pages: dict[str, Path]
) -> None:
    page = opened(browser, pages["failed"]).page
    page.set_viewport_size({"width": 1280, "height": 720})
    assert page.locator("#scene").evaluate("(scene) => scene.clientHeight") >= 250
    assert "Why it failed" in page.locator("#details").inner_text()
    assert "--start 0,0,0" in page.locator("#facts").inner_text()
    seek(page, 2)
    assert "Why it failed" not in page.locator("#details").inner_text()
    assert "fails at 5.37 s" in page.locator("#details").inner_text()
    page.locator("#search").fill("bottle1")
    assert page.get_by_role("option").first.inner_text().startswith("bottle1, a thing")


@pytest.mark.long
def test_a_card_that_is_cut_fades_and_grows_to_all_of_it(browser: Any, pages: dict[str, Path]) -> None:
    page = opened(browser, pages["failed"]).page
    cards, last = page.locator("#cards"), page.locator("#cards .card").first.locator(".excerpt").last
    page.wait_for_selector("#cards.fading")
    page.get_by_role("button", name="all of it").click()
    page.wait_for_selector("#cards:not(.fading)")
    assert cards.evaluate("(cards) => cards.clientHeight === cards.scrollHeight")
    assert last.is_visible()
    page.get_by_role("button", name="less of it").click()
    page.wait_for_selector("#cards.fading")


@pytest.mark.long
def test_showing_a_moment_at_which_the_clock_is_flashes_it(browser: Any, pages: dict[str, Path]) -> None:
    page = opened(browser, pages["failed"]).page
    page.get_by_role("button", name="Show the moment").click()
    page.get_by_role("button", name="Shown: 5.37 s").wait_for()
    page.wait_for_selector("#now.flash")
    page.wait_for_selector(".row-line.flash")


@pytest.mark.long
def test_a_story_opens_at_the_clock_and_keeps_it_in_view(browser: Any, pages: dict[str, Path]) -> None:
    page = opened(browser, pages["recovered"]).page
    page.keyboard.press("End")
    page.get_by_role("tab", name="Story").click()
    inside = """() => {
        const box = document.getElementById("story").getBoundingClientRect();
        const now = document.querySelector("#story .current").getBoundingClientRect();
        return box.top <= now.top && now.bottom <= box.bottom + 1;
    }"""
    assert page.evaluate(inside)
    for key in ("Home", "End"):
        page.keyboard.press(key)
        assert page.evaluate(inside)


def far(page: Any) -> float:
    """Return the distance from the eye to the point that the camera is turned to [m]."""
    return float(page.evaluate("planlang.scene.camera.position.distanceTo(planlang.scene.controls.target)"))


@pytest.mark.long
def test_the_camera_opens_on_what_happens_and_stays_unless_it_is_to_follow(
    browser: Any, pages: dict[str, Path]
) -> None:
    page = opened(browser, pages["failed"]).page
    tags = page.locator(".tags span")
    assert sorted(tags.all_inner_texts()) == ["amigo", "bottle1"]
    near = far(page)
    seek(page, 0)
    assert far(page) == near
    page.get_by_role("button", name="whole room").click()
    assert far(page) > near
    page.locator(".tags").get_by_text("patient1").wait_for()
    page.get_by_label("follow the steps with the camera").check()
    first = far(page)
    seek(page, 4.5)
    assert far(page) != first
    page.get_by_role("button", name="whole room").click()
    page.get_by_role("button", name="Show the moment").click()
    assert far(page) == pytest.approx(near)


@pytest.mark.long
def test_marks_of_the_scene_are_explained_and_things_named_where_they_are_clicked(
    browser: Any, pages: dict[str, Path]
) -> None:
    watched = opened(browser, pages["recovered"])
    page = watched.page
    page.get_by_text("what marks mean").click()
    legend = page.locator(".legend li").all_inner_texts()
    assert {"place to stand, chosen", "believed to be there, but is not"} <= set(legend)
    assert "place to stand, rejected: out of reach" in legend
    page.get_by_label("names").uncheck()
    page.locator(".tags span").first.wait_for(state="detached")
    spot = page.evaluate(
        """() => {
            const { scene } = planlang, box = scene.canvas.getBoundingClientRect();
            for (let y = 20; y < box.height; y += 8) for (let x = 20; x < box.width; x += 8) {
                const at = { clientX: box.left + x, clientY: box.top + y };
                if (scene.under(at)?.object.userData.entity?.kind === "link") return { x, y };
            }
        }"""
    )
    page.locator("#scene canvas").click(position=spot)
    page.locator(".tags").get_by_text("amigo").wait_for()
    assert watched.findings() == []
    assert watched.said == []


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
