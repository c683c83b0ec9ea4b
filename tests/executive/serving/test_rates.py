"""Rates: who asks more often than permitted waits, and nobody else."""

from __future__ import annotations

from http import HTTPStatus

import pytest
import uvicorn
from fastapi.testclient import TestClient
from hypothesis import given
from hypothesis import strategies as st

from executive.serving.app import application
from executive.serving.rates import BURST, MOST_CLIENTS, Rates
from executive.serving.workers import Staff
from planlang.knowledge.sqlite_store import SqliteStore

NOW = "2026-01-01T00:00:00Z"


@given(st.lists(st.floats(0, 2), max_size=200), st.integers(1, 5))
def test_nobody_asks_more_often_than_permitted_and_who_waits_as_told_is_answered(
    pauses: list[float], rate: int
) -> None:
    time = [0.0]
    rates = Rates(rate, lambda: time[0])
    taken = 0
    for pause in pauses:
        time[0] += pause
        wait = rates.wait("192.0.2.1")
        taken += wait == 0
        if wait:
            time[0] += wait + 1e-6
            assert rates.wait("192.0.2.1") == 0
            taken += 1
        assert taken <= rate * (time[0] + BURST) + 1


def test_askers_are_counted_by_network_until_their_key_is_known() -> None:
    rates = Rates(0.05, lambda: 0.0)
    assert rates.wait("2001:db8::1") == 0
    assert rates.wait("2001:db8::2", "Bearer ada's") > 0
    assert rates.wait("2001:db8:0:1::1") == 0
    rates.know("Bearer ada's", "ada")
    assert rates.wait("2001:db8::2", "Bearer ada's") == 0
    assert rates.wait("192.0.2.9", "Bearer ada's") > 0


def test_as_many_askers_as_there_are_addresses_are_not_all_remembered() -> None:
    rates = Rates(0.05, lambda: 0.0)
    for number in range(MOST_CLIENTS + 2):
        assert rates.wait(str(number)) == 0
    assert rates.wait("0") == 0
    assert rates.wait(str(MOST_CLIENTS)) > 0


def test_a_server_tells_when_to_come_back_and_an_author_is_not_held_up_by_strangers(
    store: SqliteStore, staff: Staff
) -> None:
    app = application(store, staff, rates=Rates(0.1, lambda: 0.0))
    author = TestClient(app, headers={"Authorization": f"Bearer {store.new_key('ada', NOW)}"})
    assert author.get("/v1/subscriptions").status_code == HTTPStatus.OK
    stranger = TestClient(app)
    answers = [stranger.get("/v1/health") for _ in range(3)]
    assert [one.status_code for one in answers] == [200, 429, 429]
    assert answers[1].headers["Retry-After"] == "10"
    assert answers[1].headers["content-type"] == "application/problem+json"
    assert author.get("/v1/health").status_code == HTTPStatus.OK


def test_a_dropped_key_is_counted_as_a_strangers_once_it_is_refused(store: SqliteStore, staff: Staff) -> None:
    app = application(store, staff, rates=Rates(0.1, lambda: 0.0))
    author = TestClient(app, headers={"Authorization": f"Bearer {store.new_key('ada', NOW)}"})
    assert author.get("/v1/subscriptions").status_code == HTTPStatus.OK
    store.drop_keys("ada")
    assert author.get("/v1/subscriptions").status_code == HTTPStatus.UNAUTHORIZED
    assert TestClient(app).get("/v1/health").status_code == HTTPStatus.OK
    assert author.get("/v1/subscriptions").status_code == HTTPStatus.TOO_MANY_REQUESTS


@pytest.mark.parametrize(("proxy", "held_up"), [("127.0.0.1", [200, 429, 200]), ("192.0.2.7", [200, 429, 429])])
def test_addresses_are_taken_from_proxies_on_the_same_machine_alone(
    store: SqliteStore, staff: Staff, proxy: str, held_up: list[int]
) -> None:
    app = application(store, staff, rates=Rates(0.05, lambda: 0.0))
    config = uvicorn.Config(app)
    config.load()
    client = TestClient(config.loaded_app, client=(proxy, 50000))
    asked = ("198.51.100.1", "198.51.100.1", "198.51.100.2")
    answers = [client.get("/v1/health", headers={"X-Forwarded-For": one}).status_code for one in asked]
    assert answers == held_up
