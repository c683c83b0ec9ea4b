"""A real server of a knowledge base in a thread of its own."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from executive.processes.workers import Limits
    from executive.serving.running import Guarded

NOW = "2026-01-01T00:00:00Z"


class RunningServer:
    """A server at an address; it can be stopped and started again, as one that fails."""

    def __init__(self, file: Path, limits: Limits | None = None, folders: Sequence[Path] = ()) -> None:
        for package in ("fastapi", "uvicorn"):
            pytest.importorskip(package, reason="the server is in the extra serve")
        from executive.processes.workers import Limits
        from executive.serving.app import application
        from executive.serving.workers import Staff
        from planlang.knowledge.sqlite_store import SqliteStore

        self.store = SqliteStore(file)
        self._app = application(self.store, Staff(tuple(folders), limits or Limits()))
        self._port = 0
        self.start()

    @property
    def url(self) -> str:
        """The address."""
        return f"http://127.0.0.1:{self._port}"

    @property
    def connections(self) -> Iterable[Guarded]:
        """The connections that are open."""
        return self._server.server_state.connections  # type: ignore[return-value]

    def key(self, author: str) -> str:
        """Return a new key of an author."""
        return self.store.new_key(author, NOW)

    def start(self) -> None:
        """Answer, at the same address as before."""
        import uvicorn

        from executive.serving.running import MOST, Guarded

        config = uvicorn.Config(
            self._app,
            port=self._port,
            log_level="critical",
            lifespan="off",
            limit_concurrency=MOST,
            http=Guarded,
            ws="none",
        )
        listening = config.bind_socket()
        listening.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)  # as a real server's
        self._port = listening.getsockname()[1]
        self._server = uvicorn.Server(config)
        self._thread = threading.Thread(target=self._server.run, kwargs={"sockets": [listening]})
        self._thread.start()
        while not self._server.started:
            time.sleep(0.01)

    def stop(self) -> None:
        """Answer no more."""
        self._server.should_exit = True
        self._thread.join()

    def close(self) -> None:
        """Answer no more, and end what belongs to it."""
        self.stop()
        self._app.state.serving.close()
        self.store.close()


@contextmanager
def running_server(file: Path, limits: Limits | None = None, folders: Sequence[Path] = ()) -> Iterator[RunningServer]:
    """Serve the knowledge base of a file, with ontologies of folders, while the block runs."""
    server = RunningServer(file, limits, folders)
    try:
        yield server
    finally:
        server.close()
