"""The page of two runs in a real Chromium: what one shows, the other shows at the same time."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from browsers import Watched, started_browser

from planlang.report.side_by_side import Side, side_by_side
from tests.executive.report.conftest import Reported


def shows(frame: Any, seconds: str) -> None:
    """Wait until the clock of a page shows a time."""
    frame.wait_for_function("start => document.getElementById('now').textContent.startsWith(start)", arg=seconds)


def test_the_clock_of_one_run_moves_that_of_the_other(reported: Reported, tmp_path: Path) -> None:
    page = reported.page.read_text(encoding="utf-8")
    file = tmp_path / "both.html"
    both = side_by_side("two runs", "planlang run", Side("before", page), Side("after", page), 2.0)
    file.write_text(both, encoding="utf-8")
    with started_browser("--disable-3d-apis") as browser:
        watched = Watched(browser, viewport={"width": 1600, "height": 900})
        watched.page.goto(file.as_uri())
        frames = watched.page.frames[1:]
        for frame in frames:
            frame.wait_for_selector("html[data-ready=all]")
        for moved, other, time in ((frames[0], frames[1], "3"), (frames[1], frames[0], "1.5")):
            slider = f"const one = document.getElementById('slider'); one.value = {time};"
            moved.evaluate(f"() => {{ {slider} one.dispatchEvent(new Event('input')); }}")
            shows(other, f"{float(time):.2f}")
        assert watched.said == []
