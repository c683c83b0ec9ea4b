"""Progress of long work: when it is shown, and what it says of the time left."""

from __future__ import annotations

import io
import math

import pytest
from cli_runs import invoke

from executive.cli.progress import Progress
from tests.support.examples import some


class Clock:
    """Seconds that a test sets."""

    now = 0.0

    def __call__(self) -> float:
        return self.now


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def progress(clock: Clock, monkeypatch: pytest.MonkeyPatch) -> Progress:
    monkeypatch.setattr(Progress, "_watch", lambda self, ended: None)  # the test itself says when to look
    return Progress(clock)


def at(progress: Progress, clock: Clock, now: float, share: float | None = None) -> None:
    clock.now = now
    if share is not None:
        progress("building", share)
    progress.tick()


def test_a_pipe_gets_a_line_every_ten_seconds_with_the_time_left(
    progress: Progress, clock: Clock, capsys: pytest.CaptureFixture[str]
) -> None:
    for now in range(26):
        at(progress, clock, float(now), now / 40)
    assert capsys.readouterr().err.splitlines() == ["building: 25%, 30 s left", "building: 50%, 20 s left"]


def test_what_was_done_before_does_not_count_for_the_time_left(
    progress: Progress, clock: Clock, capsys: pytest.CaptureFixture[str]
) -> None:
    at(progress, clock, 0.0, 0.5)
    at(progress, clock, 10.0, 0.6)
    assert capsys.readouterr().err == "building: 60%, 40 s left\n"


def test_a_terminal_gets_one_line_that_goes_when_the_work_has_ended(
    progress: Progress, clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    screen = Terminal()
    monkeypatch.setattr("sys.stderr", screen)
    for now, share in ((0.0, 0.0), (1.0, 0.1), (3.0, 0.5), (3.2, 1.0), (9.0, None)):
        at(progress, clock, now, share)
    drawn, cleared = "\r[##########          ] building: 50%, 3 s left\x1b[K", "\r\x1b[K"
    assert screen.getvalue() == drawn + cleared


def test_work_whose_end_is_unknown_shows_its_time_and_what_was_found_so_far(
    progress: Progress, clock: Clock, capsys: pytest.CaptureFixture[str]
) -> None:
    found = ["a"]
    with progress.during(lambda: f"searching, {len(found)} found", most=120.0):
        found.append("b")
        at(progress, clock, 10.0)
    at(progress, clock, 30.0)
    assert capsys.readouterr().err == "searching, 2 found: 10 s of at most 2 min 0 s\n"


def test_inner_work_is_shown_until_it_ends(
    progress: Progress, clock: Clock, capsys: pytest.CaptureFixture[str]
) -> None:
    with progress.during(lambda: "searching"):
        at(progress, clock, 1.0, 0.0)
        at(progress, clock, 11.0, 0.5)
        progress("", 1.0)
        at(progress, clock, 21.0)
    assert capsys.readouterr().err.splitlines() == ["building: 50%, 10 s left", "searching: 21 s"]


def test_reported_work_whose_end_is_unknown_is_shown_with_its_time_until_a_report_ends_it(
    progress: Progress, clock: Clock, capsys: pytest.CaptureFixture[str]
) -> None:
    with progress.during(lambda: "still at Grasp"):
        progress("searching", math.nan)
        at(progress, clock, 10.0)
        at(progress, clock, 11.0, 0.0)  # a map that the search needs
        at(progress, clock, 21.0, 0.5)
        progress("", 1.0)
        at(progress, clock, 31.0)
        progress("", 1.0)
        at(progress, clock, 41.0)
    assert capsys.readouterr().err.splitlines() == [
        "searching: 10 s",
        "building: 50%, 10 s left",
        "searching: 31 s",
        "still at Grasp: 41 s",
    ]


@pytest.mark.parametrize("option", some(["--quiet", "--json"]))
def test_quiet_and_json_silence_it(option: str, monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[object] = []
    monkeypatch.setattr(Progress, "_push", lambda self, work: shown.append(work))
    invoke("check", "recipes/library", option)
    assert shown == []
    invoke("check", "recipes/library")
    assert shown
