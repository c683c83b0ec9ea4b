"""Searches that take long: ended at a limit or when nobody waits, a few at a time, and behind the usual ones."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest
from fastapi import FastAPI
from fastapi.testclient import TestClient

from executive.serving import patience
from executive.serving.patience import LONG, LONGEST, Lanes, Patience
from executive.serving.problems import Problem
from executive.serving.workers import Busy

QUESTION = {
    "expression": " or ".join(f"(subAction some {name})" for name in ("Reaching", "Event", "ServingFoodOrDrink"))
}


class Clock:
    """A clock that is set by hand."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


def bounds(lanes: Lanes, clock: Clock, *, is_gone: bool = False) -> Patience:
    return Patience(lanes, lambda: is_gone, clock, spent=clock)


def test_a_search_of_the_usual_kind_takes_no_place_and_looks_for_nobody() -> None:
    clock = Clock()
    usual = bounds(Lanes(0), clock, is_gone=True)
    with usual.searching():
        usual()
        clock.now = LONG / 2
        usual()


def test_a_long_search_takes_a_place_gives_it_back_and_ends_at_its_limit() -> None:
    clock, lanes = Clock(), Lanes(1)
    long, other = bounds(lanes, clock), bounds(lanes, clock)
    with long.searching(), other.searching():
        clock.now = 2 * LONG
        long()
        clock.now = LONGEST + 1
        with pytest.raises(Busy):
            other()
        with pytest.raises(Problem, match="more than 5 s"):
            long()
    with other.searching():
        clock.now += 2 * LONG
        other()


def test_a_search_ends_when_nobody_waits_for_it() -> None:
    clock = Clock()
    left = bounds(Lanes(1), clock, is_gone=True)
    with left.searching():
        clock.now = 1.0
        with pytest.raises(Problem, match="closed the connection"):
            left()


@pytest.fixture
def hurried(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every search is a long one, and looks whether its asker is there at every step."""
    monkeypatch.setattr(patience, "LONG", -1.0)
    monkeypatch.setattr(patience, "ASKED_EVERY", -1.0)


@pytest.mark.usefixtures("hurried")
def test_a_search_whose_asker_has_gone_is_not_finished(app: FastAPI, stranger: TestClient) -> None:
    assert stranger.get("/v1/search", params=QUESTION).status_code == 200
    sent: list[dict[str, Any]] = []

    async def receive() -> dict[str, Any]:
        return {"type": "http.disconnect"}

    async def send(message: dict[str, Any]) -> None:
        sent.append(message)

    scope = {"type": "http", "method": "GET", "path": "/v1/search", "query_string": b"expression=Event", "headers": []}
    asyncio.run(app(scope, receive, send))  # type: ignore[arg-type]
    assert sent[0]["status"] == 408


def test_a_long_question_is_read_by_a_worker_and_answered_as_a_short_one(stranger: TestClient) -> None:
    long = " or ".join(["(subAction some Reaching)"] * 200)
    assert stranger.get("/v1/search", params={"expression": long}).json() == {"entries": [], "next": None}
    refused = stranger.get("/v1/search", params={"expression": "{" + ",".join(f"a{n}" for n in range(1500)) + "}"})
    assert refused.status_code == 422
    assert refused.json()["diagnostics"][0]["message"] == "unknown name a0"
    assert refused.json()["diagnostics"][-1]["message"] == "and 1490 more names"
