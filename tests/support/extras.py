"""Packages that are installed beyond what planlang needs."""

import shutil
from importlib.metadata import distributions

import pytest

HAS_PR2 = any(distributions(name="example-robot-data"))
"""True if the PR2's URDF is there: 430 MB, the extra pr2."""


def skip_without_pr2(words: str) -> None:
    """Skip the test if a command with these words needs the PR2 and its URDF is not there."""
    if "pr2" in words.split() and not HAS_PR2:
        pytest.skip("the PR2's URDF is in the extra pr2")


_BROWSERS = ("chromium", "chromium-browser", "google-chrome")


def chromium() -> str:
    """Return the path of an installed Chromium; the test is skipped where there is none, or nothing that drives it."""
    for package in ("playwright", "axe_playwright_python"):
        pytest.importorskip(package, reason="browsers are driven by playwright, which is in the extra dev")
    found = next(filter(None, map(shutil.which, _BROWSERS)), None)
    if found is None:
        pytest.skip("no Chromium is installed; on Debian: apt install chromium")
    return found
