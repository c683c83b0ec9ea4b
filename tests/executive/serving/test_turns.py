"""Turns at what takes long: never more than a number at a time, and who waits too long is told so."""

from __future__ import annotations

from http import HTTPStatus

import pytest
from fastapi.testclient import TestClient

from executive.serving import uploads
from executive.serving.turns import Busy, Turns


def test_a_turn_is_taken_back_also_if_what_was_computed_failed() -> None:
    turns = Turns(1, 0.0)
    for _ in range(3):
        with pytest.raises(ZeroDivisionError), turns:
            _ = 1 / 0
    with turns, pytest.raises(Busy), turns:
        pass


def test_who_waits_too_long_is_told_to_come_back(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    turns = Turns(1, 0.0)
    monkeypatch.setattr(uploads, "TURNS", turns)
    with turns:
        answer = client.post("/v1/recipes", params={"name": "ward"}, content=b"Ontology: <http://x>")
    assert answer.status_code == HTTPStatus.TOO_MANY_REQUESTS
    assert answer.headers["Retry-After"] == "5"
    assert client.get("/v1/health").status_code == HTTPStatus.OK
