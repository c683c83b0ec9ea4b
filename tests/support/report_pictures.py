"""Writes the pictures of docs/guides/report.md and docs/first_steps/own_robot.md anew; needs Chromium.

``python tests/support/report_pictures.py``
"""

from __future__ import annotations

import io
import shutil
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

CHECKOUT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(CHECKOUT))

from browsers import started_browser  # noqa: E402
from PIL import Image  # noqa: E402

from executive.runs.options import RunOptions  # noqa: E402
from executive.runs.plan_run import run_plan_file  # noqa: E402
from planlang.files import Bundled  # noqa: E402
from tests.support.page_runs import PageRun  # noqa: E402

TUTORIAL = CHECKOUT / "docs" / "first_steps" / "own_robot.md"

SIZE = {"width": 1280, "height": 800}
ROOM = Bundled.ENVIRONMENT.find("hospital_room")
SERVED = RunOptions(
    recipe=Bundled.RECIPE.find("serve_a_drink"), robot=Bundled.ROBOT.find("amigo"), environment=ROOM, seed=3
)


def raised_bottle(folder: Path) -> Path:
    """Write a map in which the bottle is out of reach."""
    tower = folder / "tower.omn"
    tower.write_text(ROOM.read_text().replace("knowrob:m23 0.9,", "knowrob:m23 2.3,"))
    return tower


def picture(browser: Any, page: Path, scheme: str, *actions: str) -> Image.Image:
    """Return a picture of a page after some clicks on tabs and ``#elements`` or ``.elements``; ``t=SECONDS`` seeks."""
    shown = browser.new_context(viewport=SIZE, color_scheme=scheme).new_page()
    shown.goto(page.as_uri())
    shown.wait_for_selector("html[data-ready=all]")
    for action in actions:
        if action.startswith("t="):
            shown.evaluate(f"planlang.clock.seek({float(action[2:])})")
        elif action.startswith(("#", ".")):
            shown.locator(action).click()
        else:
            shown.get_by_role("tab", name=action, exact=True).click()
    shown.wait_for_timeout(500)  # until the scene is drawn
    return Image.open(io.BytesIO(shown.screenshot())).convert("RGB")


def main() -> None:
    """Write the pictures of a run that recovers, of one that fails, and of the tutorial."""
    with tempfile.TemporaryDirectory() as name, started_browser() as browser:
        folder = Path(name)
        run_plan_file(replace(SERVED, report=folder / "done.html"))
        run_plan_file(replace(SERVED, environment=raised_bottle(folder), seed=0, report=folder / "failed.html"))
        PageRun(TUTORIAL.read_text(encoding="utf-8"), folder).run()
        made = folder / "fetch_screwdriver"
        for file in ("own_room.png", "own_robot.png", "own_robot_husky.png", "own_robot_inspect.png"):
            shutil.copy(made / file, CHECKOUT / "docs" / "images" / file)
        for file, page, scheme, actions in (
            ("own_robot_report.png", "fetch_screwdriver/run.html", "light", ("#aim", "t=18")),
            ("report.png", "done.html", "light", ("#aim", "t=30", ".legend")),
            ("report_map.png", "done.html", "dark", ("Map", "Story", "t=10")),
            ("report_failed.png", "failed.html", "light", ()),
            ("report_failed_dark.png", "failed.html", "dark", ("Map",)),
        ):
            picture(browser, folder / page, scheme, *actions).save(CHECKOUT / "docs" / "images" / file, optimize=True)


if __name__ == "__main__":
    main()
