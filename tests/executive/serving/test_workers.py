"""Work in other processes: it ends at its limits, in turn, and nobody waits for long."""

from __future__ import annotations

import math
import os
import threading
import time
from collections.abc import Iterator
from http import HTTPStatus
from pathlib import Path

import httpx
import pytest
from fastapi.testclient import TestClient

from executive.processes.workers import Limits, Source
from executive.serving.app import application
from executive.serving.vocabulary import Vocabulary
from executive.serving.workers import PREPARE, Busy, Failed, Staff, Workers
from planlang.diagnostics import BadInput
from planlang.files import Bundled
from planlang.knowledge.sqlite_store import SqliteStore
from tests.support.refusals import refusal
from tests.support.servers import running_server

NOW = "2026-01-01T00:00:00Z"
RECIPE = Bundled.RECIPE.find("serve_a_drink").read_bytes()
LARGE = b"@prefix : <http://example.org/a#> .\n" + b"".join(
    b":a%d a :B ; :p :a%d .\n" % (n, n + 1) for n in range(200_000)
)
SMALL_LIMITS = Limits(seconds=1, memory=200_000_000)


@pytest.fixture(scope="module")
def source() -> Iterator[Source]:
    made = Source(PREPARE)
    yield made
    made.close()


# what workers are told to do


def spin(vocabulary: Vocabulary) -> None:
    while vocabulary is not None:
        pass


def fill(vocabulary: Vocabulary) -> int:
    return len(bytearray(10**9)) + len(vocabulary.names)


def count(_: Vocabulary) -> int:
    return 1


def mistake(_: Vocabulary) -> float:
    return 1 / 0


def end(path: Path, times: int, _: Vocabulary) -> int:
    """Let the worker end, ``times`` times; returns how often it has."""
    ended = len(path.read_bytes())
    if ended < times:
        path.write_bytes(bytes(ended + 1))
        os._exit(1)
    return ended


def refused_at(workers: Workers) -> None:
    with pytest.raises(BadInput):
        workers.call(spin)


@pytest.mark.long
def test_a_call_ends_at_its_limits_and_the_next_one_is_answered(source: Source) -> None:
    workers = Workers(source, 1, SMALL_LIMITS)
    for endless, limit in ((spin, "1 s"), (fill, "200 MB of memory")):
        with refusal("K015", naming=limit) as refused:
            workers.call(endless)
        assert ("check_seconds" in str(refused.value.diagnostics[0].help)) == (endless is spin)
        assert workers.call(count) == 1
    workers.close()


@pytest.mark.long
def test_files_of_the_folder_in_which_it_is_started_are_not_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "numpy.py").write_text("open('was_run', 'w')")
    monkeypatch.chdir(tmp_path)
    source = Source(PREPARE)
    workers = Workers(source, 1, Limits())
    assert workers.call(count) == 1
    workers.close()
    source.close()
    assert not (tmp_path / "was_run").exists()


@pytest.mark.long
def test_a_mistake_of_ours_is_no_refusal(source: Source) -> None:
    workers = Workers(source, 1, SMALL_LIMITS)
    with pytest.raises(Failed, match="ZeroDivisionError"):
        workers.call(mistake)
    workers.close()


@pytest.mark.long
def test_a_worker_that_ends_within_its_limits_is_replaced_once_and_no_refusal(source: Source, tmp_path: Path) -> None:
    workers, ended = Workers(source, 1, Limits()), tmp_path / "ended"
    ended.touch()
    assert workers.call(end, ended, 1) == 1
    with pytest.raises(Failed, match="several processes in a row died"):
        workers.call(end, ended, 9)
    assert workers.call(count) == 1
    workers.close()


@pytest.mark.long
def test_who_would_wait_for_long_is_told_when_to_come_back(source: Source) -> None:
    workers = Workers(source, 1, SMALL_LIMITS, longest_wait=0.0)
    refused_at(workers)
    busy = threading.Thread(target=refused_at, args=(workers,))
    busy.start()
    while workers.are_free:
        time.sleep(0.001)
    with pytest.raises(Busy) as refused:
        workers.call(count)
    assert refused.value.seconds == 1
    busy.join()
    assert workers.call(count) == 1
    workers.close()


@pytest.mark.long
def test_nobody_waits_for_long_behind_what_takes_longer_than_expected(source: Source) -> None:
    workers = Workers(source, 1, SMALL_LIMITS, longest_wait=0.1)
    busy = threading.Thread(target=refused_at, args=(workers,))
    busy.start()
    while workers.are_free:
        time.sleep(0.001)
    with pytest.raises(Busy):
        workers.call(count)
    assert workers.waiting == 0
    busy.join()
    assert workers.call(count) == 1
    workers.close()


@pytest.mark.long
def test_calls_are_answered_in_the_order_in_which_they_came(source: Source) -> None:
    workers, order = Workers(source, 1, SMALL_LIMITS, math.inf), list[int]()
    threads: list[threading.Thread] = []

    def ask(number: int) -> None:
        if number == 0:
            refused_at(workers)
        else:
            workers.call(count)
        order.append(number)

    for number in range(6):
        threads.append(threading.Thread(target=ask, args=(number,)))
        threads[-1].start()
        while workers.are_free or workers.waiting < number:
            time.sleep(0.001)
    for thread in threads:
        thread.join()
    assert order == [0, 1, 2, 3, 4, 5]
    workers.close()


@pytest.mark.long
def test_an_upload_that_takes_too_long_is_refused_with_the_limit(tmp_path: Path) -> None:
    store, staff = SqliteStore(tmp_path / "kb.sqlite"), Staff((), SMALL_LIMITS)
    app = application(store, staff)
    client = TestClient(app, headers={"Authorization": f"Bearer {store.new_key('ada', NOW)}"})
    answer = client.post("/v1/objects?name=large", content=LARGE)
    assert answer.status_code == HTTPStatus.UNPROCESSABLE_ENTITY, answer.text
    (diagnostic,) = answer.json()["diagnostics"]
    assert (diagnostic["code"], diagnostic["message"]) == ("K015", "the check takes more than 1 s")
    assert client.post("/v1/recipes?name=ward", content=RECIPE).status_code == HTTPStatus.CREATED
    app.state.serving.close()
    store.close()


@pytest.mark.long
def test_readers_do_not_wait_while_hostile_uploads_are_checked(tmp_path: Path) -> None:
    with running_server(tmp_path / "kb.sqlite", SMALL_LIMITS) as server:
        headers, statuses = {"Authorization": f"Bearer {server.key('ada')}"}, list[int]()
        with httpx.Client(base_url=server.url, headers=headers, timeout=60) as client:
            made = client.post("/v1/recipes?name=ward", content=RECIPE).headers["Location"]

            def attack() -> None:
                url = f"{server.url}/v1/objects?name=x"
                statuses.append(httpx.post(url, content=LARGE, headers=headers, timeout=60).status_code)

            attackers = [threading.Thread(target=attack) for _ in range(2)]
            for one in attackers:
                one.start()
            times, start = [], time.perf_counter()
            while any(one.is_alive() for one in attackers):
                began = time.perf_counter()
                assert client.get(made).status_code == HTTPStatus.OK
                times.append(time.perf_counter() - began)
            assert statuses == [HTTPStatus.UNPROCESSABLE_ENTITY] * 2
            checks = time.perf_counter() - start
        assert sorted(times)[len(times) // 2] < checks / 40  # 50 ms if two seconds of CPU take two seconds
