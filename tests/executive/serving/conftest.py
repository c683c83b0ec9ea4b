"""A knowledge base of its own for each test, with a client who has a key, one who has another, and one without."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from fastapi import FastAPI
from fastapi.testclient import TestClient

from executive.serving.app import application
from executive.serving.workers import Staff
from planlang.knowledge.sqlite_store import SqliteStore

NOW = "2026-01-01T00:00:00Z"


@pytest.fixture
def store(tmp_path: Path) -> Iterator[SqliteStore]:
    opened = SqliteStore(tmp_path / "kb.sqlite")
    yield opened
    opened.close()


@pytest.fixture(scope="session")
def staff() -> Iterator[Staff]:
    workers = Staff()
    yield workers
    workers.close()


@pytest.fixture
def app(store: SqliteStore, staff: Staff) -> Iterator[FastAPI]:
    served = application(store, staff)
    yield served
    served.state.serving.mirror.close()


def client_of(app: FastAPI, store: SqliteStore, author: str) -> TestClient:
    return TestClient(app, headers={"Authorization": f"Bearer {store.new_key(author, NOW)}"})


@pytest.fixture
def client(app: FastAPI, store: SqliteStore) -> TestClient:
    return client_of(app, store, "ada")


@pytest.fixture
def other(app: FastAPI, store: SqliteStore) -> TestClient:
    return client_of(app, store, "bob")


@pytest.fixture
def stranger(app: FastAPI) -> TestClient:
    return TestClient(app)
