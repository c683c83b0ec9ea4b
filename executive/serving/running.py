"""Running the application behind an HTTP server until it is told to end."""

from __future__ import annotations

import errno
import signal
import socket
from collections.abc import Callable
from types import FrameType

import uvicorn
from fastapi import FastAPI

from executive.serving.connections import MOST, Guarded
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
