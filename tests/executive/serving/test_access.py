"""The access log: a line for each request, in which strangers' text stays text and keys are not."""

from __future__ import annotations

import json
from pathlib import Path
from urllib.parse import quote

import pytest
from fastapi.testclient import TestClient

from executive.serving.access import Lines
from executive.serving.app import application
from executive.serving.rates import Rates
from executive.serving.workers import Staff
from planlang.knowledge.sqlite_store import SqliteStore


def test_each_request_is_one_line_of_json_without_keys_and_questions(
    store: SqliteStore, staff: Staff, tmp_path: Path
) -> None:
    lines = Lines(tmp_path / "access.log")
    served = application(store, staff, rates=Rates(0.15), access=lines)
    key = store.new_key("ada", "2026-01-01T00:00:00Z")
    client = TestClient(served)
    client.get("/v1/subscriptions", headers={"Authorization": f"Bearer {key}"})
    hostile = 'no\r\n{"status": 1}\x1b[2J\u2028.x'
    client.get(f"/v1/recipes/{quote(hostile)}", params={"secret": "question"})
    assert client.get("/v1/recipes").status_code == 429
    lines.close()
    text = (tmp_path / "access.log").read_text("ascii")
    assert text.isascii()
    assert text.replace("\n", "").isprintable()
    assert key not in text
    assert "question" not in text
    told = [json.loads(line) for line in text.splitlines()]
    assert [(one["method"], one["author"], one["status"]) for one in told] == [
        ("GET", "ada", 200),
        ("GET", None, 404),
        ("GET", None, 429),
    ]
    assert told[1]["path"] == f"/v1/recipes/{hostile}"
    assert all(one["bytes"] > 0 and one["address"] == "testclient" for one in told)
    served.state.serving.mirror.close()


def test_a_log_that_cannot_be_written_costs_nobody_an_answer(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    full = Path("/dev/full")
    if not full.exists():
        pytest.skip("there is no /dev/full")
    lines = Lines(full)
    for _ in range(3):
        lines("{}")
    lines.close()
    assert len(caplog.records) == 1
