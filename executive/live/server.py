"""HTTP server for the page of a live run, for browsers on this computer only: the standard library's, in a thread.

Requests need the token in the URL; connections without one are few and short. The Host header is checked against DNS
rebinding, and the Origin header of commands, which are POST requests, against forgery by other pages (CSRF).
"""

from __future__ import annotations

import json
import secrets
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from socket import SHUT_RDWR, socket
from threading import Lock, Thread
from types import TracebackType
from typing import Any, Self
from urllib.parse import parse_qs, urlsplit

from planlang.records import dataclass

HERE = "127.0.0.1"
LONGEST_COMMAND = 1000
"""Largest command [bytes]."""
MOST_STRANGERS = 64
"""Connections that have not shown the token, at a time."""
STRANGER_SECONDS = 10.0
"""Time that they have for a request with it [s]."""
CLOSING = 0.05
"""Polling interval of the server, and so the longest time for its shutdown [s]."""
NEVER_KEPT = {
    "Cache-Control": "no-store",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cross-Origin-Resource-Policy": "same-origin",
}


@dataclass(frozen=True, slots=True)
class Served:
    """Callbacks that answer a browser's requests."""

    page: Callable[[], bytes]
    """Renders the complete page in its current state."""
    news: Callable[[int], Iterator[Mapping[str, Any]]]
    """Yields the updates after a number, and then new ones as they come, until the run ends."""
    command: Callable[[Mapping[str, Any]], str | None]
    """Executes a command; the result is an error message or None."""


class LiveServer:
    """Context manager that runs the server; ``address`` is the URL of the page."""

    def __init__(self, served: Served) -> None:
        """Bind a free port of this computer. Raises OSError."""
        token = secrets.token_urlsafe(16)  # random, but the run does not depend on it
        self._server = _Server((HERE, 0), served, token)
        self.address = f"http://{HERE}:{self._server.server_port}/{token}/"
        self._thread = Thread(target=self._server.serve_forever, args=(CLOSING,), name="planlang page", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, problem: BaseException | None, where: TracebackType | None
    ) -> None:
        self._server.shutdown()
        self._server.server_close()


class _Server(ThreadingHTTPServer):
    """Each connection has a thread. Those that have not shown the token are few, and soon closed."""

    daemon_threads = True
    block_on_close = False  # the thread of a page that waits for updates would never end
    request_queue_size = 128

    def __init__(self, place: tuple[str, int], served: Served, token: str) -> None:
        super().__init__(place, _Request)
        self.served, self.token = served, token
        self._lock = Lock()
        self._strangers: dict[socket, float] = {}
        """Connections without a valid request so far, the oldest first, and since when they are open [s]."""
        self.hosts = {f"{name}:{self.server_port}" for name in (HERE, "localhost")}

    def process_request(self, request: Any, client_address: Any) -> None:
        """Answer in a thread; beyond ``MOST_STRANGERS`` the oldest connection of a stranger is closed."""
        with self._lock:
            self._strangers[request] = time.monotonic()
            for one in list(self._strangers)[:-MOST_STRANGERS]:
                self._end(one)
        super().process_request(request, client_address)

    def service_actions(self) -> None:
        """Close the connections of strangers whose time is over; called at each poll."""
        latest = time.monotonic() - STRANGER_SECONDS
        with self._lock:
            for one in [one for one, since in self._strangers.items() if since < latest]:
                self._end(one)

    def _end(self, request: socket) -> None:
        del self._strangers[request]
        with suppress(OSError):
            request.shutdown(SHUT_RDWR)  # its thread reads the end, and closes it

    def know(self, request: socket) -> None:
        """Leave a connection open as long as its browser wants: it has shown the token."""
        with self._lock:
            self._strangers.pop(request, None)

    def shutdown_request(self, request: Any) -> None:
        """Close a connection."""
        self.know(request)
        super().shutdown_request(request)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Ignore errors of closed connections."""


class _Request(BaseHTTPRequestHandler):
    server: _Server
    protocol_version = "HTTP/1.1"
    server_version, sys_version = "planlang", ""

    def log_message(self, format: str, *arguments: Any) -> None:
        """Log nothing: the terminal belongs to the run."""

    def do_GET(self) -> None:
        """Answer a request for the page or its updates."""
        path = self._path()
        if path is None:
            return
        match path.path:
            case "":
                self._answer(HTTPStatus.OK, "text/html; charset=utf-8", self.server.served.page())
            case "news":
                self._follow(parse_qs(path.query))
            case _:
                self._refuse(HTTPStatus.NOT_FOUND, "not found")

    def do_POST(self) -> None:
        """Execute a command."""
        path = self._path()
        if path is None:
            return
        if self.headers.get("Origin") not in {f"http://{host}" for host in self.server.hosts}:
            self._refuse(HTTPStatus.FORBIDDEN, "commands have to come from the page of this run")
            return
        if path.path != "command":
            self._refuse(HTTPStatus.NOT_FOUND, "not found; send commands to command")
            return
        command = self._command()
        problem = "the command has to be a JSON object" if command is None else self.server.served.command(command)
        if problem is not None:
            self._refuse(HTTPStatus.BAD_REQUEST, problem)
            return
        self._answer(HTTPStatus.OK, "application/json", b"{}")

    def _path(self) -> Any:
        """Split the URL and strip the token; None if the request was refused."""
        if self.headers.get("Host") not in self.server.hosts:
            self._refuse(HTTPStatus.FORBIDDEN, "this page is for browsers on this computer")
            return None
        path = urlsplit(self.path)
        token, slash, rest = path.path.removeprefix("/").partition("/")
        if not slash or not secrets.compare_digest(token.encode(), self.server.token.encode()):
            self._refuse(HTTPStatus.FORBIDDEN, "open the address that was printed when the run began")
            return None
        self.server.know(self.connection)
        return path._replace(path=rest)

    def _command(self) -> Mapping[str, Any] | None:
        try:
            size = int(self.headers.get("Content-Length", ""))
            command = json.loads(self.rfile.read(size)) if 0 <= size <= LONGEST_COMMAND else None
        except ValueError:
            return None
        return command if isinstance(command, dict) else None

    def _follow(self, query: Mapping[str, list[str]]) -> None:
        """Stream updates (server-sent events, HTML standard 9.2) until the run ends or the browser disconnects."""
        last = self.headers.get("Last-Event-ID") or query.get("after", ["0"])[0]
        number = int(last) if last.isdecimal() else 0
        self.send_response(HTTPStatus.OK)
        self._headers("text/event-stream")
        self.send_header("Connection", "close")
        self.end_headers()
        self.close_connection = True
        for place, news in enumerate(self.server.served.news(number), number + 1):
            self.wfile.write(f"id: {place}\ndata: {json.dumps(news)}\n\n".encode())
            self.wfile.flush()

    def _refuse(self, status: HTTPStatus, why: str) -> None:
        self.close_connection = True
        self._answer(status, "text/plain; charset=utf-8", f"{why}\n".encode())

    def _answer(self, status: HTTPStatus, kind: str, body: bytes) -> None:
        self.send_response(status)
        self._headers(kind)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def _headers(self, kind: str) -> None:
        self.send_header("Content-Type", kind)
        for name, value in NEVER_KEPT.items():
            self.send_header(name, value)
