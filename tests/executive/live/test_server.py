"""The server of a run that goes on answers browsers on this computer that know its address, and nobody else."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator, Mapping
from typing import Any

import httpx
import pytest

from executive.live.server import LONGEST_COMMAND, LiveServer, Served


class Here:
    """What is served: a page, two news, and a list of the commands that came."""

    def __init__(self) -> None:
        self.commands: list[Mapping[str, Any]] = []

    def news(self, after: int) -> Iterator[Mapping[str, Any]]:
        """Yield two news."""
        yield {"number": 1}
        yield {"number": 2}

    def command(self, said: Mapping[str, Any]) -> str | None:
        """Keep a command."""
        self.commands.append(said)
        return None if said.get("command") == "pause" else "there is the command pause"


@pytest.fixture
def here() -> Here:
    return Here()


@pytest.fixture
def server(here: Here) -> Iterator[LiveServer]:
    with LiveServer(Served(lambda: b"<!doctype html>", here.news, here.command)) as server:
        yield server


def origin(server: LiveServer) -> str:
    return server.address.rsplit("/", 2)[0]


def post(server: LiveServer, what: Any = None, **headers: str) -> httpx.Response:
    """Send a command as the page does, but for some headers."""
    sent = {"Origin": origin(server), **headers}
    return httpx.post(f"{server.address}command", json=what or {"command": "pause"}, headers=sent, timeout=30)


def test_the_page_and_the_news_are_at_the_address(server: LiveServer) -> None:
    page = httpx.get(server.address)
    assert page.text == "<!doctype html>"
    assert page.headers["Referrer-Policy"] == "no-referrer"
    assert page.headers["Cache-Control"] == "no-store", "it names things of the user"
    news = httpx.get(f"{server.address}news")
    assert news.headers["Content-Type"] == "text/event-stream"
    assert news.text == 'id: 1\ndata: {"number": 1}\n\nid: 2\ndata: {"number": 2}\n\n'


def test_who_does_not_know_the_token_gets_nothing(server: LiveServer, here: Here) -> None:
    for path in ("/", "/news", "/wrong/", "/wrong/news", f"/{'x' * 22}/", "//", "/%00/"):
        assert httpx.get(f"{origin(server)}{path}").status_code == 403, path
    wrong = httpx.post(f"{origin(server)}/wrong/command", json={"command": "pause"}, headers={"Origin": origin(server)})
    assert wrong.status_code == 403
    assert here.commands == []


@pytest.mark.parametrize("host", ["evil.example", "evil.example:80", "127.0.0.1", "127.0.0.1.evil.example"])
def test_a_name_that_points_here_is_refused(server: LiveServer, here: Here, host: str) -> None:
    assert httpx.get(server.address, headers={"Host": host}).status_code == 403
    assert post(server, Host=host).status_code == 403
    assert here.commands == []


@pytest.mark.parametrize("where", ["http://evil.example", "null", "https://127.0.0.1", ""])
def test_commands_of_other_pages_are_refused(server: LiveServer, here: Here, where: str) -> None:
    assert post(server, Origin=where).status_code == 403
    assert here.commands == []


def test_commands_are_posted_and_never_asked_for(server: LiveServer, here: Here) -> None:
    assert httpx.get(f"{server.address}command").status_code == 404
    assert post(server).status_code == 200
    assert here.commands == [{"command": "pause"}]


@pytest.mark.parametrize("body", [b"", b"[]", b"{", b"\xff", b" " * (LONGEST_COMMAND + 1)])
def test_what_is_no_command_is_refused(server: LiveServer, here: Here, body: bytes) -> None:
    sent = httpx.post(f"{server.address}command", content=body, headers={"Origin": origin(server)})
    assert sent.status_code == 400
    assert "JSON object" in sent.text
    assert here.commands == []


def test_a_command_that_is_not_there_is_answered_with_those_that_are(server: LiveServer) -> None:
    assert post(server, {"command": "fly"}).text == "there is the command pause\n"


def strangers(server: LiveServer, number: int) -> list[socket.socket]:
    """Open connections that say nothing."""
    port = int(origin(server).rpartition(":")[2])
    return [socket.create_connection(("127.0.0.1", port), timeout=30) for _ in range(number)]


def test_connections_that_say_nothing_are_bounded_and_the_page_is_served_besides(
    server: LiveServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("executive.live.server.MOST_STRANGERS", 8)
    with httpx.Client() as viewer:
        assert viewer.get(server.address).status_code == 200
        opened = strangers(server, 100)
        assert opened[0].recv(1) == b"", "the oldest is closed"
        assert viewer.get(server.address).status_code == 200, "who has shown the token stays connected"
        assert httpx.get(server.address).status_code == 200
        assert sum(one.name.startswith("Thread") for one in threading.enumerate()) < 30
    for one in opened:
        one.close()


def test_a_connection_has_a_time_to_show_the_token(server: LiveServer, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("executive.live.server.STRANGER_SECONDS", 0.05)
    (silent, slow) = strangers(server, 2)
    slow.sendall(b"GET / HTTP/1.1\r\nHost: ")  # half a head
    assert (silent.recv(1), slow.recv(1)) == (b"", b"")
    silent.close()
    slow.close()
