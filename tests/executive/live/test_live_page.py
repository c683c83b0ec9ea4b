"""A run watched in a real Chromium: held, stepped and stopped from the page; nothing there changes what it does."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from browsers import Watched, another_browser, started_browser

CHECKOUT = Path(__file__).resolve().parents[3]
pytestmark = pytest.mark.long


class Run:
    """A watched run of the bundled recipe in a process of its own, and the address that it has printed."""

    def __init__(self, folder: Path) -> None:
        self.trace = folder / "run.jsonl"
        command = [sys.executable, "-m", "executive", "run", "serve_a_drink", "--watch", "--trace", str(self.trace)]
        environment = {**os.environ, "PYTHONPATH": str(CHECKOUT)}
        pipe = subprocess.PIPE
        self.process = subprocess.Popen(command, cwd=folder, env=environment, text=True, stdout=pipe, stderr=pipe)
        assert self.process.stderr is not None
        found = re.search(r"http://127\.0\.0\.1:\d+/\S+/", self.process.stderr.readline())
        assert found is not None
        self.address = found[0]

    def says(self) -> str:
        """Read the next line on stderr."""
        assert self.process.stderr is not None
        return self.process.stderr.readline()

    def end(self) -> int:
        """Wait until it has ended; return its exit code."""
        self.process.communicate(timeout=120)
        return self.process.returncode


@contextmanager
def watched_run(folder: Path) -> Iterator[Run]:
    run = Run(folder)
    try:
        yield run
    finally:
        run.process.kill()
        run.process.communicate()


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with started_browser() as started:
        yield started


@pytest.fixture(scope="module")
def unwatched(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """Return the trace of the run that nobody watches."""
    folder = tmp_path_factory.mktemp("unwatched")
    command = [sys.executable, "-m", "executive", "run", "serve_a_drink", "--trace", "run.jsonl"]
    environment = {**os.environ, "PYTHONPATH": str(CHECKOUT)}
    subprocess.run(command, cwd=folder, env=environment, check=True, capture_output=True)
    return (folder / "run.jsonl").read_bytes()


def opened(browser: Any, run: Run) -> Any:
    watched = Watched(browser, viewport={"width": 1280, "height": 800})
    watched.page.goto(run.address)
    watched.page.wait_for_selector("html[data-ready=all]")
    return watched


def becomes(page: Any, state: str) -> None:
    page.wait_for_selector(f"#live-state:text-is('{state}')")


def test_a_run_is_held_goes_on_by_one_action_and_ends_in_the_page(
    tmp_path: Path, browser: Any, unwatched: bytes
) -> None:
    with watched_run(tmp_path) as run:
        watched = opened(browser, run)
        page = watched.page
        page.click("#live-pause")
        becomes(page, "held")
        held = f"the run is held: go on at {run.address}; Ctrl-C ends it\n"
        assert held in iter(run.says, ""), "it may come after lines of what has begun"
        before = page.inner_text("#now")
        steps = len(run.trace.read_bytes())
        page.wait_for_timeout(300)
        assert page.inner_text("#now") == before
        assert len(run.trace.read_bytes()) == steps, "no plan time has passed"
        page.click("#live-step")
        page.wait_for_selector(f"#now:not(:text-is('{before}'))")
        becomes(page, "held")
        page.select_option("#live-pace", "0")
        page.click("#live-pause")
        becomes(page, "the run has ended")
        assert page.inner_text("#outcome") == "done"
        assert watched.said == []
        assert run.end() == 0
        assert run.trace.read_bytes() == unwatched


def test_a_browser_that_dies_changes_nothing(tmp_path: Path, browser: Any, unwatched: bytes) -> None:
    with watched_run(tmp_path) as run:
        with another_browser(browser) as other:
            page = opened(other, run).page
            page.select_option("#live-pace", "0")
        assert run.end() == 0
        assert run.trace.read_bytes() == unwatched


def test_a_run_that_is_stopped_in_the_page_is_interrupted_and_can_be_resumed(
    tmp_path: Path, browser: Any, unwatched: bytes
) -> None:
    with watched_run(tmp_path) as run:
        page = opened(browser, run).page
        page.click("#live-stop")
        becomes(page, "the run has ended")
        assert run.end() == 130
    assert run.trace.read_bytes() != unwatched
    command = [sys.executable, "-m", "executive", "run", "--resume", str(run.trace)]
    subprocess.run(
        command, cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(CHECKOUT)}, check=True, capture_output=True
    )


def test_ctrl_c_ends_a_run_that_is_held_or_that_nobody_has_opened(tmp_path: Path, browser: Any) -> None:
    with watched_run(tmp_path) as run:
        run.process.send_signal(signal.SIGINT)
        assert run.end() == 130
    with watched_run(tmp_path) as run:
        page = opened(browser, run).page
        page.click("#live-pause")
        becomes(page, "held")
        run.process.send_signal(signal.SIGINT)
        assert run.end() == 130
