"""Running the application behind an HTTP server until it is told to end.

Whoever opens a connection and says nothing, or little, would take the place of somebody who asks. So a head has to come
in time, and a body and a reader have to get on; else the connection is closed after a while, or at once if the server
has no other place. One address has a bounded number of places.
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

PATIENCE = 10
"""Seconds in which open requests are answered at the end."""


def run(app: FastAPI, host: str, port: int, on_ready: Callable[[str], None]) -> str:
    """Serve until SIGINT, SIGTERM or SIGHUP, answer open requests, and return the address. Raises BadInput with K005.

    An ignored SIGHUP stays ignored.
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
    # what is small is sent at once: the loop does so only for sockets that name their protocol, which this one does not
    listening.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    name, number = listening.getsockname()[:2]
    url = f"http://{f'[{name}]' if ':' in name else name}:{number}"
    handlers = {signal.SIGTERM: _interrupt}  # the server raises it again when it has ended
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
        advice = "--port names another one; 0 takes any that is free" if problem.errno == errno.EADDRINUSE else None
        message = f"nothing can listen at {host}, port {port}: {reason}"
        raise BadInput([error("K005", message, help=advice)]) from None


def _interrupt(_: int, __: FrameType | None) -> None:
    raise KeyboardInterrupt


def _terminate(_: int, __: FrameType | None) -> None:
    """End as SIGTERM does: the server itself knows SIGINT and SIGTERM only."""
    signal.raise_signal(signal.SIGTERM)


MOST = 500
"""Connections at a time."""
MOST_OF_AN_ADDRESS = 100
"""Connections of one address (of an IPv6 network) at a time; a proxy, who is trusted, may have all."""
HEAD_SECONDS = 10.0
"""Seconds in which the head of a request has to be complete."""
GRACE_SECONDS = 10.0
"""Seconds without progress that a body, or whoever reads an answer, may have."""
LEAST_RATE = 10_000
"""Bytes a second that a body has to have, and an answer has to be read with, behind these."""


class Guarded(H11Protocol):
    """HTTP/1.1 with limits of time."""

    _began = 0.0
    _received = 0
    _unsent = 0
    _part = None
    _timer: asyncio.TimerHandle | None = None
    _reader: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin to wait for a head, unless there is no place for this address."""
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
        """Close the connection that has said nothing for the longest time."""
        idle = [one for one in self.connections if isinstance(one, Guarded) and one is not self and one._is_idle()]
        if idle:
            first = min(idle, key=lambda one: one._began)
            self.connections.discard(first)
            first.transport.close()

    def _is_idle(self) -> bool:
        return self.cycle is None or self.cycle.response_complete

    def data_received(self, data: bytes) -> None:
        """Take what has come, and wait for what has to come next."""
        self._received += len(data)
        super().data_received(data)
        self._watch()

    def _watch(self) -> None:
        """Begin to wait where another part of a request, its head or its body, has to come now."""
        part = self.conn.their_state
        if part is self._part:
            return
        self._part, self._began, self._received = part, self.loop.time(), 0
        self._cancel()
        if part in (h11.IDLE, h11.SEND_BODY) and not self.transport.is_closing():
            self._timer = self.loop.call_later(HEAD_SECONDS if part is h11.IDLE else GRACE_SECONDS, self._late)

    def _late(self) -> None:
        """Refuse a request whose head has not come in time, or whose body comes too slowly."""
        if self._part is h11.SEND_BODY:
            left = self._began + GRACE_SECONDS + self._received / LEAST_RATE - self.loop.time()
            if left > 0 or self.flow.read_paused:  # paused: it is us who do not get on
                self._timer = self.loop.call_later(max(left, 1.0), self._late)
                return
        self._refuse(HTTPStatus.REQUEST_TIMEOUT)

    def _refuse(self, status: HTTPStatus) -> None:
        if self._is_idle() or not self.cycle.response_started:
            self.transport.write(f"HTTP/1.1 {status.value} {status.phrase}\r\nConnection: close\r\n\r\n".encode())
        self.transport.close()

    def pause_writing(self) -> None:
        """Begin to look whether the answer is read."""
        super().pause_writing()
        self._unsent = self.transport.get_write_buffer_size()
        self._reader = self.loop.call_later(GRACE_SECONDS, self._reading)

    def _reading(self) -> None:
        """Close the connection of somebody who does not read."""
        unsent = self.transport.get_write_buffer_size()
        if self._unsent - unsent < LEAST_RATE:
            self.transport.abort()
            return
        self._unsent = unsent
        self._reader = self.loop.call_later(GRACE_SECONDS, self._reading)

    def resume_writing(self) -> None:
        """Stop looking: enough was read."""
        super().resume_writing()
        if self._reader is not None:
            self._reader.cancel()

    def connection_lost(self, exc: Exception | None) -> None:
        """Wait for nothing more."""
        self._cancel()
        if self._reader is not None:
            self._reader.cancel()
        super().connection_lost(exc)

    def _cancel(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
