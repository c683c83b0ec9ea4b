"""Copy of a store in the SPARQL engine: the triples of every entry, kept in step with the store."""

from __future__ import annotations

import logging
import threading
from pathlib import Path
from typing import Any

from executive.serving.vocabulary import Vocabulary
from executive.serving.workers import Busy, Failed, Workers
from planlang.diagnostics import BadInput
from planlang.knowledge.entries import Change, Entry, NoSuchEntry, Store
from planlang.knowledge.sparql import Endpoint, Exceeded, Limits
from planlang.ontology.convert import Target, convert_content

MOST_QUESTIONS = 8
"""Maximum number of queries running or queued."""
_LOG = logging.getLogger(__name__)


class Mirror:
    """The entries of a store in the SPARQL engine. It follows the store's news. Thread-safe."""

    def __init__(self, store: Store, workers: Workers, limits: Limits | None = None) -> None:
        """Prepare the mirror; ``workers`` convert contents that the engine cannot parse itself."""
        self._store, self._workers, self._limits = store, workers, limits or Limits()
        self._endpoint = Endpoint(self._limits)
        self._lock = threading.Lock()
        self._places = threading.Semaphore(MOST_QUESTIONS)
        self._reader: threading.Thread | None = None
        self._is_read = threading.Event()
        self._is_closed = False
        self._seen = self._read = 0

    def start(self) -> None:
        """Start loading all contents in a thread, unless that is done or under way."""
        with self._lock:
            is_reading = self._reader is not None and self._reader.is_alive()
            if is_reading or self._is_closed or (self._is_read.is_set() and self._endpoint.is_running):
                return
            self._is_read.clear()
            self._reader = threading.Thread(target=self._read_all, daemon=True)
            self._reader.start()

    def ask(self, question: str) -> dict[str, Any]:
        """Answer a query. Raises NoAnswer; Exceeded, also while contents are still being loaded; Busy."""
        if not self._places.acquire(blocking=False):
            raise Busy(1, "asked")
        try:
            return self._answer(question)
        finally:
            self._places.release()

    def _answer(self, question: str) -> dict[str, Any]:
        self.start()
        if not self._is_read.wait(self._limits.seconds):
            raise Exceeded(f"the server is still loading contents, {self._read:,} entries so far; ask again later")
        try:
            with self._lock:
                self._follow()
        except OSError:  # the engine has ended; the query below raises the reason
            pass
        return self._endpoint.ask(question)

    def end(self) -> None:
        """End the engine; the next query starts it again."""
        self._endpoint.close()

    def close(self) -> None:
        """End the engine for good."""
        with self._lock:
            self._is_closed = True
        self.end()
        if self._reader is not None:
            self._reader.join()
        self.end()  # the reader may have started the engine in the meantime

    def _read_all(self) -> None:
        self._read, self._seen = 0, self._store.last_news()
        try:
            self._endpoint.start()
            for entry in self._store.entries():
                if self._is_closed:
                    return
                self._put(entry)
                self._read += 1
        except OSError:  # the engine has ended; the next query starts over
            return
        self._is_read.set()

    def _follow(self) -> None:
        while news := self._store.news(self._seen):
            for uid in dict.fromkeys(one.uid for one in news if one.change is not Change.RATED):
                try:
                    self._put(self._store.entry(uid))
                except NoSuchEntry:
                    self._endpoint.drop(uid)
            self._seen = news[-1].number

    def _put(self, entry: Entry) -> None:
        """Load the content of an entry into the engine, or drop it if no reader can parse it. Raises OSError."""
        try:
            data = self._store.content(entry.uid)
            if not self._endpoint.put(entry.uid, data, entry.syntax.value, entry.about):
                self._endpoint.put(entry.uid, self._workers.call(triples_of, data, entry.uid))
        except (NoSuchEntry, BadInput, Failed) as problem:
            if isinstance(problem, Failed):
                _LOG.warning("SPARQL queries miss the content of %s: %s", entry.uid, problem)
            self._endpoint.drop(entry.uid)


def triples_of(data: bytes, uid: str, _: Vocabulary) -> bytes:
    """Convert a content to N-Triples; our parsers accept more than the engine's strict ones. Raises BadInput."""
    return convert_content(data, Path(uid), Target.NTRIPLES).text.encode()
