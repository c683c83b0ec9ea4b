"""Packages that are installed beyond what planlang needs."""

import shutil
from importlib.metadata import distributions

import pytest

HAS_PR2 = any(distributions(name="example-robot-data"))
"""True if the PR2's URDF is there: 430 MB, the extra pr2."""


WITHOUT_PR2 = "the PR2's URDF is in the extra pr2"
"""Why tests with the mark ``pr2`` are skipped where it is not there."""


def robot_marks(command: str) -> tuple[pytest.MarkDecorator, ...]:
    """Return the marks of a test that runs a command: ``pr2`` if it names that robot."""
    return (pytest.mark.pr2,) if "pr2" in command.split() else ()


_BROWSERS = ("chromium", "chromium-browser", "google-chrome")


def chromium() -> str:
    """Return the path of an installed Chromium; the test is skipped where there is none, or nothing that drives it."""
    for package in ("playwright", "axe_playwright_python"):
        pytest.importorskip(package, reason="browsers are driven by playwright, which is in the extra dev")
    found = next(filter(None, map(shutil.which, _BROWSERS)), None)
    if found is None:
        pytest.skip("no Chromium is installed; on Debian: apt install chromium")
    return found
