"""SPARQL 1.1 questions to a mirror of all entries, in a child process that is killed when it exceeds its limits.

Each entry is a graph ``urn:entry:UID``; the default graph is all of them together. The engine would follow ``SERVICE``
to any address and knows no limit of time, so it works where it can open no connection and can be ended.
"""

from __future__ import annotations

import json
import subprocess
import sys
import threading
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of one question: seconds of wall clock, bytes of memory beyond the mirror's, rows of the answer."""

    seconds: float = 10.0
    memory: int = 500_000_000
    rows: int = 10_000


class Exceeded(Exception):
    """A question was ended at a limit; the text says which."""


class NoAnswer(Exception):
    """The text is no question of SPARQL, or wants something that is not there, such as another server."""


class Endpoint:
    """Answers questions, one at a time. Threads may share it."""

    def __init__(self, contents: Callable[[], Iterable[tuple[str, str]]], limits: Limits | None = None) -> None:
        """``contents`` yields the identifier and the N-Triples of every entry; asked again after a child was killed."""
        self._contents = contents
        self._limits = limits or Limits()
        self._lock = threading.Lock()
        self._child: subprocess.Popen[str] | None = None

    def ask(self, question: str) -> dict[str, Any]:
        """Return the answer in SPARQL's JSON form, or ``{"triples": [line, ...]}``. Raises NoAnswer and Exceeded."""
        if not self._lock.acquire(timeout=self._limits.seconds):
            raise Exceeded(f"other questions took {self._limits.seconds:g} s")
        try:
            return self._ask(question)
        finally:
            self._lock.release()

    def _ask(self, question: str) -> dict[str, Any]:
        child = self._started()
        killer = threading.Timer(self._limits.seconds, child.kill)
        killer.start()
        try:
            self._send(child, {"query": question, "rows": self._limits.rows})
            assert child.stdout is not None
            line = child.stdout.readline()
        except BrokenPipeError:
            line = ""
        finally:
            is_late = not killer.is_alive()
            killer.cancel()
        if not line.endswith("\n"):
            self._end()
            limit = f"{self._limits.seconds:g} s" if is_late else f"{self._limits.memory / 1e6:g} MB of memory"
            raise Exceeded(f"the question needs more than {limit}")
        found: dict[str, Any] = json.loads(line)
        if "limit" in found:
            raise Exceeded(f"the answer has {found['limit']}")
        if "error" in found:
            raise NoAnswer(found["error"])
        if "rows" in found:
            return {"head": found["head"], "results": {"bindings": found["rows"]}}
        return found

    @property
    def is_running(self) -> bool:
        """True if the child is there; one that starts reads all contents."""
        return self._child is not None and self._child.poll() is None

    def put(self, uid: str, triples: str) -> None:
        """Add the N-Triples of an entry, in the place of earlier ones."""
        self._change({"put": uid, "triples": triples})

    def drop(self, uid: str) -> None:
        """Forget an entry."""
        self._change({"drop": uid})

    def _change(self, message: dict[str, str]) -> None:
        with self._lock:
            if self._child is not None:  # one that starts later reads everything
                try:
                    self._send(self._child, message)
                except BrokenPipeError:
                    self._end()

    def _started(self) -> subprocess.Popen[str]:
        if self._child is not None and self.is_running:
            return self._child
        arguments = [sys.executable, "-m", "planlang.knowledge.sparql_child"]
        self._child = subprocess.Popen(
            arguments, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        )
        for uid, triples in self._contents():
            self._send(self._child, {"put": uid, "triples": triples})
        self._send(self._child, {"limit": self._limits.memory})
        assert self._child.stdout is not None
        self._child.stdout.readline()
        return self._child

    @staticmethod
    def _send(child: subprocess.Popen[str], message: dict[str, Any]) -> None:
        assert child.stdin is not None
        child.stdin.write(json.dumps(message) + "\n")
        child.stdin.flush()

    def _end(self) -> None:
        if self._child is not None:
            self._child.kill()
            with suppress(BrokenPipeError):
                self._child.__exit__(None, None, None)
            self._child = None

    def close(self) -> None:
        """End the child."""
        with self._lock:
            self._end()
