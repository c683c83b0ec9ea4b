"""SPARQL 1.1 questions to a mirror of all entries, in forks of a child process that end at their limits.

Each entry is a graph ``urn:entry:UID``; the default graph is all of them together, or those that ``FROM`` names. The
engine would follow ``SERVICE`` to any address and knows no limit of time, so it works where it can open no connection
and can be ended.
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
    """Limits of one question: seconds of wall clock, bytes of memory beyond the mirror's, rows and bytes of answer."""

    seconds: float = 10.0
    memory: int = 500_000_000
    rows: int = 10_000
    bytes: int = 16_000_000


class Exceeded(Exception):
    """A question was ended at a limit; the text says which."""


class NoAnswer(Exception):
    """The text is no question of SPARQL, or wants something that is not there, such as another server."""


class Endpoint:
    """Answers questions, one at a time. Threads may share it."""

    def __init__(self, limits: Limits | None = None) -> None:
        self._limits = limits or Limits()
        self._lock = threading.Lock()
        self._child: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Start the process, in the place of an earlier one: it knows nothing yet."""
        with self._lock:
            self._end()
            self._child = subprocess.Popen(
                # -P: nothing is imported from this folder, where strangers' files may lie
                [sys.executable, "-P", "-m", "planlang.knowledge.sparql_child"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                start_new_session=True,
            )

    def ask(self, question: str) -> dict[str, Any]:
        """Return the answer in SPARQL's JSON form, or ``{"triples": [line, ...]}``. Raises NoAnswer and Exceeded."""
        limits = self._limits
        if not self._lock.acquire(timeout=limits.seconds):
            raise Exceeded(f"other questions took {limits.seconds:g} s")
        try:
            found = self._told({"query": question, **asdict(limits)})
        except OSError:
            raise Exceeded("what answers questions has ended, and is started anew") from None
        finally:
            self._lock.release()
        if "exceeded" in found:
            raise Exceeded(f"the question needs more than {found['exceeded']}")
        if "limit" in found:
            raise Exceeded(f"the answer has {found['limit']}")
        if "error" in found:
            raise NoAnswer(found["error"])
        if "rows" in found:
            return {"head": found["head"], "results": {"bindings": found["rows"]}}
        return found

    @property
    def is_running(self) -> bool:
        """True if the process is there."""
        return self._child is not None and self._child.poll() is None

    def put(self, uid: str, content: bytes, media_type: str = N_TRIPLES, base: str = "urn:entry") -> bool:
        """Add the content of an entry, in the place of an earlier one. Raises OSError.

        Returns False for what is no content of this type, and for an identifier that names no graph.
        """
        with self._lock:
            head = {"put": uid, "type": media_type, "base": base, "size": len(content)}
            return bool(self._told(head, content)["done"])

    def drop(self, uid: str) -> None:
        """Forget an entry. Raises OSError."""
        with self._lock:
            self._told({"drop": uid})

    def _told(self, message: dict[str, Any], content: bytes = b"") -> dict[str, Any]:
        """Return what is answered to a message. Raises OSError if the process is not there, or ends."""
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
