"""Connections of a real server: who says nothing, or little, holds no place for long, and takes none from others."""

from __future__ import annotations

import logging
import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing

import httpx
import pytest

from executive.serving import running as connections
from planlang.knowledge.entries import File, Kind
from tests.support.knowledge_bases import NOW, put, recognition_model
from tests.support.servers import RunningServer, running_server


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningServer]:
    with running_server(tmp_path_factory.mktemp("server") / "kb.sqlite") as running:
        yield running


def opened(server: RunningServer, said: bytes = b"", source: str = "127.0.0.1") -> socket.socket:
    port = int(server.url.rpartition(":")[2])
    connection = socket.create_connection(("127.0.0.1", port), timeout=10, source_address=(source, 0))
    connection.sendall(said)
    return connection


def answer(connection: socket.socket) -> bytes:
    """Return all that comes until the server closes the connection."""
    with closing(connection):
        return b"".join(iter(lambda: connection.recv(1000), b""))


def _ports(server: RunningServer) -> list[int]:
    """Return the ports from which connections come that the server has open."""
    return [one.client[1] for one in [*server.connections] if one.client is not None]


@pytest.mark.parametrize("said", [b"", b"GET /v1/health HTTP/1.1\r\nHost: kb\r\n"])
def test_a_head_that_does_not_come_is_not_waited_for(
    server: RunningServer, said: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connections, "HEAD_SECONDS", 0.1)
    assert answer(opened(server, said)).startswith(b"HTTP/1.1 408 Request Timeout\r\n")


def test_a_second_head_on_a_connection_is_waited_for_as_the_first(
    server: RunningServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connections, "HEAD_SECONDS", 0.2)
    connection = opened(server, b"GET /v1/health HTTP/1.1\r\nHost: kb\r\n\r\n")
    assert connection.recv(4000).startswith(b"HTTP/1.1 200 OK\r\n")
    connection.sendall(b"GET /v1/health HTT")
    assert b"HTTP/1.1 408 Request Timeout\r\n" in answer(connection)


def test_a_body_that_trickles_in_is_not_waited_for(
    server: RunningServer, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(connections, "GRACE_SECONDS", 0.1)
    head = b"POST /v1/sparql HTTP/1.1\r\nHost: kb\r\nContent-Length: 1000\r\n\r\nASK"
    with caplog.at_level(logging.WARNING, "uvicorn"):
        assert answer(opened(server, head)).startswith(b"HTTP/1.1 408 Request Timeout\r\n")
        assert httpx.get(f"{server.url}/v1/health").status_code == 200
    assert not caplog.records, "a client that leaves is no mistake of the server's"


def test_who_does_not_read_the_answer_loses_the_connection(
    server: RunningServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connections, "GRACE_SECONDS", 0.1)
    entry = put(server.store, Kind.OBJECT, "ada", recognition_model("Cup"))
    server.store.attach(entry.uid, File("large.bin", "application/octet-stream", bytes(12_000_000)), "ada", NOW)
    with closing(
        opened(server, f"GET /v1/binaries/{entry.uid}/large.bin HTTP/1.1\r\nHost: kb\r\n\r\n".encode())
    ) as reader:
        port, until = reader.getsockname()[1], time.monotonic() + 5
        while port in _ports(server) and time.monotonic() < until:
            time.sleep(0.02)
        assert port not in _ports(server)


def test_half_open_connections_take_no_place_from_those_who_ask(
    server: RunningServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connections, "MOST", 20)
    with ExitStack() as all_open:
        for _ in range(60):
            all_open.enter_context(closing(opened(server, b"GET /")))
        for _ in range(5):
            assert httpx.get(f"{server.url}/v1/health").status_code == 200


def test_an_address_has_a_bounded_number_of_connections_unless_it_is_a_trusted_proxy(
    server: RunningServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connections, "MOST_OF_AN_ADDRESS", 3)
    asked = b"GET /v1/health HTTP/1.1\r\nHost: kb\r\nConnection: close\r\n\r\n"
    with ExitStack() as all_open:
        for source in ("127.0.0.1", "127.0.0.2"):
            for _ in range(3):
                all_open.enter_context(closing(opened(server, source=source)))
        assert answer(opened(server, source="127.0.0.2")).startswith(b"HTTP/1.1 429 Too Many Requests\r\n")
        for source in ("127.0.0.1", "127.0.0.3"):
            assert answer(opened(server, asked, source)).startswith(b"HTTP/1.1 200 OK\r\n")
