"""The access log: one line of JSON for each request, whatever strangers have written into it."""

from __future__ import annotations

import json
import logging
import os
import time
from collections.abc import Callable
from pathlib import Path

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from executive.serving.serving import now

LONGEST_PATH = 500
"""Characters of an address that are written."""
TO_STDERR = Path("-")
_LOG = logging.getLogger(__name__)


class Logged:
    """An application of which each request is written down when it has been answered.

    Neither bodies, headers nor the words behind ``?`` are written: keys come in some of these, questions in others.
    """

    def __init__(self, app: ASGIApp, write: Callable[[str], None]) -> None:
        self._app, self._write = app, write

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, and write a line about it."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        began, status, size = time.monotonic(), 0, 0

        async def counted(message: Message) -> None:
            nonlocal status, size
            status = message.get("status", status)
            size += len(message.get("body", b""))
            await send(message)

        try:
            await self._app(scope, receive, counted)
        finally:
            told = {
                "time": now(),
                "address": (scope.get("client") or ("", 0))[0],
                "author": scope.get("state", {}).get("author"),
                "method": scope["method"],
                "path": scope["path"][:LONGEST_PATH],
                "status": status,
                "bytes": size,
                "seconds": round(time.monotonic() - began, 4),
            }
            self._write(json.dumps(told))  # escapes all but printable ASCII


class Lines:
    """Appends lines to a file, or writes them to the standard error for ``-``. Threads may share it."""

    def __init__(self, path: Path) -> None:
        """Open the file, which is made if there is none. Raises OSError."""
        flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT
        self._handle = os.dup(2) if path == TO_STDERR else os.open(path, flags, 0o640)
        self._is_failing = False

    def __call__(self, line: str) -> None:
        """Write a line; where that cannot be done requests are answered nevertheless."""
        try:
            os.write(self._handle, f"{line}\n".encode())
            self._is_failing = False
        except OSError as problem:
            if not self._is_failing:
                _LOG.warning("the access log cannot be written: %s", problem)
            self._is_failing = True

    def close(self) -> None:
        """Close the file."""
        os.close(self._handle)
