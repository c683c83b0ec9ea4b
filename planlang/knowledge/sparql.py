"""SPARQL 1.1 queries on a mirror of all entries, each in a fork of a child process that is ended at its limits.

Each entry is a graph ``urn:entry:UID``; the default graph is the union of all, or of those named by ``FROM``. The
engine would follow ``SERVICE`` to any address and has no time limit, so it runs in a process that can open no
connection and can be killed.
"""

from __future__ import annotations

import json
import subprocess
import sys
import threading
from contextlib import suppress
from dataclasses import asdict
from typing import Any

from planlang.records import dataclass

N_TRIPLES = "application/n-triples"


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of a query: wall-clock time [s], memory beyond the mirror [bytes], rows and bytes of the result."""

    seconds: float = 10.0
    memory: int = 500_000_000
    rows: int = 10_000
    bytes: int = 16_000_000


class Exceeded(Exception):
    """A query exceeded a limit; the text says which."""


class NoAnswer(Exception):
    """The text is not valid SPARQL, or needs something unsupported, such as another server."""


class Endpoint:
    """Runs queries, one at a time; safe for use by several threads."""

    def __init__(self, limits: Limits | None = None) -> None:
        self._limits = limits or Limits()
        self._lock = threading.Lock()
        self._child: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Start the process, replacing an earlier one, with an empty mirror."""
        with self._lock:
            self._end()
            self._child = subprocess.Popen(
                # -P: import nothing from the working directory, which may have untrusted files
                [sys.executable, "-P", "-m", "planlang.knowledge.sparql_child"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                start_new_session=True,
            )

    def ask(self, question: str) -> dict[str, Any]:
        """Run a query; return SPARQL's JSON results, or ``{"triples": [line, ...]}``. Raises NoAnswer and Exceeded."""
        limits = self._limits
        if not self._lock.acquire(timeout=limits.seconds):
            raise Exceeded(f"other queries took {limits.seconds:g} s")
        try:
            found = self._told({"query": question, **asdict(limits)})
        except OSError:
            raise Exceeded("the query process has ended and is being restarted") from None
        finally:
            self._lock.release()
        if "exceeded" in found:
            raise Exceeded(f"the query needs more than {found['exceeded']}")
        if "limit" in found:
            raise Exceeded(f"the answer has {found['limit']}")
        if "error" in found:
            raise NoAnswer(found["error"])
        if "rows" in found:
            return {"head": found["head"], "results": {"bindings": found["rows"]}}
        return found

    @property
    def is_running(self) -> bool:
        """True while the process runs."""
        return self._child is not None and self._child.poll() is None

    def put(self, uid: str, content: bytes, media_type: str = N_TRIPLES, base: str = "urn:entry") -> bool:
        """Add or replace the content of an entry. Raises OSError.

        Returns False for content that is not of this type, and for an identifier that cannot name a graph.
        """
        with self._lock:
            head = {"put": uid, "type": media_type, "base": base, "size": len(content)}
            return bool(self._told(head, content)["done"])

    def drop(self, uid: str) -> None:
        """Remove an entry. Raises OSError."""
        with self._lock:
            self._told({"drop": uid})

    def _told(self, message: dict[str, Any], content: bytes = b"") -> dict[str, Any]:
        """Send a message and return the response. Raises OSError if the process does not run or ends."""
        if self._child is None:
            raise BrokenPipeError("there is no process")
        assert self._child.stdin is not None
        assert self._child.stdout is not None
        self._child.stdin.write(json.dumps(message).encode() + b"\n" + content)
        self._child.stdin.flush()
        line = self._child.stdout.readline()
        if not line.endswith(b"\n"):
            self._end()
            raise BrokenPipeError("the process has ended")
        found: dict[str, Any] = json.loads(line)
        return found

    def _end(self) -> None:
        if self._child is not None:
            self._child.kill()
            with suppress(BrokenPipeError):
                self._child.__exit__(None, None, None)
            self._child = None

    def close(self) -> None:
        """End the process."""
        with self._lock:
            self._end()
