"""The access log: one line of JSON for each request, safe against control characters in requests."""

from __future__ import annotations

import json
import logging
import os
import time
from collections.abc import Callable
from pathlib import Path

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from executive.serving.serving import now
from planlang.outputs import is_device

LONGEST_PATH = 500
"""Characters of a path that are logged."""
TO_STDERR = Path("-")
_LOG = logging.getLogger(__name__)


class AccessLog:
    """Middleware that logs each request after its response.

    Bodies, headers and query strings are not logged, since they contain keys and the users' queries.
    """

    def __init__(self, app: ASGIApp, write: Callable[[str], None]) -> None:
        self._app, self._write = app, write

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle a request and log it."""
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
            entry = {
                "time": now(),
                "address": (scope.get("client") or ("", 0))[0],
                "author": scope.get("state", {}).get("author"),
                "method": scope["method"],
                "path": scope["path"][:LONGEST_PATH],
                "status": status,
                "bytes": size,
                "seconds": round(time.monotonic() - began, 4),
            }
            self._write(json.dumps(entry))  # escapes all but printable ASCII


class Lines:
    """Appends lines to a file, or to the standard error for ``-``. Thread-safe."""

    def __init__(self, path: Path) -> None:
        """Open the file and create it if necessary. Raises OSError."""
        # a device may be named by a link, a file not
        flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | (0 if is_device(path) else os.O_NOFOLLOW)
        self._handle = os.dup(2) if path == TO_STDERR else os.open(path, flags, 0o640)
        self._is_failing = False

    def __call__(self, line: str) -> None:
        """Write a line; a failure is logged once and does not fail the request."""
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
