"""Run the application in an HTTP server until a signal ends it.

Connections without progress would take the places of working clients (Slowloris attacks). So a request's header has to
be complete in time, and bodies and responses have to be sent and read at a minimum rate; other connections are closed,
idle ones at once if the server needs their place. The number of connections per address is limited.
"""

from __future__ import annotations

import asyncio
import errno
import signal
import socket
from collections.abc import Callable
from http import HTTPStatus
from types import FrameType

import h11
import uvicorn
from fastapi import FastAPI
from uvicorn.middleware.proxy_headers import ProxyHeadersMiddleware
from uvicorn.protocols.http.h11_impl import H11Protocol

from executive.serving.rates import network
from planlang.diagnostics import BadInput, error
from planlang.words import Option, Text

PATIENCE = 10
"""Time for pending requests at shutdown [s]."""


def run(app: FastAPI, host: str, port: int, on_ready: Callable[[str], None]) -> str:
    """Serve until SIGINT, SIGTERM or SIGHUP, then answer pending requests; returns the URL.

    ``on_ready`` is called with the URL. An ignored SIGHUP stays ignored. Raises BadInput (K005) if the port is taken.
    """
    listening = _listening(host, port)
    config = uvicorn.Config(
        app,
        log_level="warning",
        server_header=False,
        limit_concurrency=MOST,
        http=Guarded,
        ws="none",
        timeout_graceful_shutdown=PATIENCE,
    )
    # send small responses at once: asyncio sets this option only for sockets created with an explicit protocol
    listening.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    name, number = listening.getsockname()[:2]
    url = f"http://{f'[{name}]' if ':' in name else name}:{number}"
    handlers = {signal.SIGTERM: _interrupt}  # uvicorn raises the signal again after its shutdown
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
        handlers[signal.SIGHUP] = _terminate
    before = {number: signal.signal(number, handler) for number, handler in handlers.items()}
    try:
        on_ready(url)
        uvicorn.Server(config).run(sockets=[listening])
    except KeyboardInterrupt:
        pass
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        listening.close()
    return url


def _listening(host: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        return socket.create_server((host, port), family=family)
    except OSError as problem:
        reason = (problem.strerror or str(problem)).partition(" (while")[0]
        advice = (
            Text("choose another ", Option("port"), "; 0 takes any free one")
            if problem.errno == errno.EADDRINUSE
            else None
        )
        message = f"cannot listen at {host}, port {port}: {reason}"
        raise BadInput([error("K005", message, help=advice)]) from None


def _interrupt(_: int, __: FrameType | None) -> None:
    raise KeyboardInterrupt


def _terminate(_: int, __: FrameType | None) -> None:
    """Handle SIGHUP as SIGTERM: uvicorn knows SIGINT and SIGTERM only."""
    signal.raise_signal(signal.SIGTERM)


MOST = 500
"""Concurrent connections."""
MOST_OF_AN_ADDRESS = 100
"""Concurrent connections of one IPv4 address or IPv6 network; trusted proxies are not limited."""
HEAD_SECONDS = 10.0
"""Time for the header of a request [s]."""
GRACE_SECONDS = 10.0
"""Time that a body, or the reader of a response, may go without progress [s]."""
LEAST_RATE = 10_000
"""Minimum rate of bodies after this time [bytes/s]; also the bytes of a response to be read in each such period."""


class Guarded(H11Protocol):
    """HTTP/1.1 with time limits."""

    _began = 0.0
    _received = 0
    _unsent = 0
    _part = None
    _timer: asyncio.TimerHandle | None = None
    _reader: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Start the timer of the header, or refuse an address with too many connections."""
        super().connection_made(transport)
        self._began = self.loop.time()
        if self._has_too_many():
            self._refuse(HTTPStatus.TOO_MANY_REQUESTS)
            return
        if len(self.connections) >= MOST:
            self._make_room()
        self._watch()

    def _has_too_many(self) -> bool:
        if self.client is None or (
            isinstance(self.app, ProxyHeadersMiddleware) and self.client[0] in self.app.trusted_hosts
        ):
            return False
        others = (one.client for one in self.connections if isinstance(one, Guarded))
        address = network(self.client[0])
        return sum(one is not None and network(one[0]) == address for one in others) > MOST_OF_AN_ADDRESS

    def _make_room(self) -> None:
        """Close the connection that has been idle longest."""
        idle = [one for one in self.connections if isinstance(one, Guarded) and one is not self and one._is_idle()]
        if idle:
            first = min(idle, key=lambda one: one._began)
            self.connections.discard(first)
            first.transport.close()

    def _is_idle(self) -> bool:
        return self.cycle is None or self.cycle.response_complete

    def data_received(self, data: bytes) -> None:
        """Pass on received data, and restart the timer if the next part of the request begins."""
        self._received += len(data)
        super().data_received(data)
        self._watch()

    def _watch(self) -> None:
        """Restart the timer when the protocol's state changes between header and body."""
        part = self.conn.their_state
        if part is self._part:
            return
        self._part, self._began, self._received = part, self.loop.time(), 0
        self._cancel()
        if part in (h11.IDLE, h11.SEND_BODY) and not self.transport.is_closing():
            self._timer = self.loop.call_later(HEAD_SECONDS if part is h11.IDLE else GRACE_SECONDS, self._late)

    def _late(self) -> None:
        """Refuse a request whose header is late, or whose body comes too slowly."""
        if self._part is h11.SEND_BODY:
            left = self._began + GRACE_SECONDS + self._received / LEAST_RATE - self.loop.time()
            if left > 0 or self.flow.read_paused:  # paused: the server itself is behind, not the client
                self._timer = self.loop.call_later(max(left, 1.0), self._late)
                return
        self._refuse(HTTPStatus.REQUEST_TIMEOUT)

    def _refuse(self, status: HTTPStatus) -> None:
        if self._is_idle() or not self.cycle.response_started:
            self.transport.write(f"HTTP/1.1 {status.value} {status.phrase}\r\nConnection: close\r\n\r\n".encode())
        self.transport.close()

    def pause_writing(self) -> None:
        """Start to monitor whether the client reads the response."""
        super().pause_writing()
        self._unsent = self.transport.get_write_buffer_size()
        self._reader = self.loop.call_later(GRACE_SECONDS, self._check_reader)

    def _check_reader(self) -> None:
        """Close the connection if the client reads too slowly."""
        unsent = self.transport.get_write_buffer_size()
        if self._unsent - unsent < LEAST_RATE:
            self.transport.abort()
            return
        self._unsent = unsent
        self._reader = self.loop.call_later(GRACE_SECONDS, self._check_reader)

    def resume_writing(self) -> None:
        """Stop monitoring the reader."""
        super().resume_writing()
        if self._reader is not None:
            self._reader.cancel()

    def connection_lost(self, exc: Exception | None) -> None:
        """Stop all timers."""
        self._cancel()
        if self._reader is not None:
            self._reader.cancel()
        super().connection_lost(exc)

    def _cancel(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
