"""Running the application behind an HTTP server until it is told to end."""

from __future__ import annotations

import signal
from collections.abc import Callable
from types import FrameType

import uvicorn
from fastapi import FastAPI

from planlang.diagnostics import BadInput, error

PATIENCE = 10
"""Seconds in which open requests are answered at the end."""
MOST_CONNECTIONS = 500
"""Connections at a time; others are told to come back."""


def run(app: FastAPI, host: str, port: int, on_ready: Callable[[str], None]) -> str:
    """Serve until SIGINT or SIGTERM, answer what was asked, and return the address. Raises BadInput with K005."""
    config = uvicorn.Config(
        app,
        host=host,
        port=port,
        log_level="warning",
        server_header=False,
        limit_concurrency=MOST_CONNECTIONS,
        timeout_graceful_shutdown=PATIENCE,
    )
    try:
        listening = config.bind_socket()
    except (OSError, SystemExit) as problem:
        raise BadInput([error("K005", f"nothing can listen at {host}, port {port}: {problem}")]) from None
    name, number = listening.getsockname()[:2]
    url = f"http://{f'[{name}]' if ':' in name else name}:{number}"
    before = signal.signal(signal.SIGTERM, _interrupt)  # the server raises it again when it has ended
    try:
        on_ready(url)
        uvicorn.Server(config).run(sockets=[listening])
    except KeyboardInterrupt:
        pass
    finally:
        signal.signal(signal.SIGTERM, before)
        listening.close()
    return url


def _interrupt(_: int, __: FrameType | None) -> None:
    raise KeyboardInterrupt
