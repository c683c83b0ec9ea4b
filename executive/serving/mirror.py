"""The mirror of a store for SPARQL's engine: the triples of every entry, kept in step with the store."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pyoxigraph as ox

from planlang.diagnostics import BadInput
from planlang.knowledge.entries import Change, Entry, Syntax
from planlang.knowledge.sparql import Endpoint, Limits
from planlang.knowledge.stores import NoSuchEntry, Store
from planlang.ontology.convert import Target, convert_content

_FORMATS = {Syntax.RDFXML: ox.RdfFormat.RDF_XML, Syntax.TURTLE: ox.RdfFormat.TURTLE}


class Mirror:
    """The entries of a store in SPARQL's engine. It follows the store's news; threads may share it."""

    def __init__(self, store: Store, limits: Limits | None = None) -> None:
        self._store = store
        self._endpoint = Endpoint(self._contents, limits)
        self._lock = threading.Lock()
        self._seen = 0

    def ask(self, question: str) -> dict[str, Any]:
        """Return the answer to a question. Raises NoAnswer and Exceeded."""
        with self._lock:
            self._follow()
        return self._endpoint.ask(question)

    def close(self) -> None:
        """End the engine."""
        self._endpoint.close()

    def _contents(self) -> Iterator[tuple[str, str]]:
        for entry in self._store.entries():
            triples = self._triples(entry)
            if triples is not None:
                yield entry.uid, triples

    def _follow(self) -> None:
        if not self._endpoint.is_running:  # it reads everything when it starts
            self._seen = self._store.last_news()
            return
        while news := self._store.news(self._seen):
            for uid, change in {one.uid: one.change for one in news if one.change is not Change.RATED}.items():
                triples = None if change is Change.DELETED else self._of(uid)
                if triples is None:
                    self._endpoint.drop(uid)
                else:
                    self._endpoint.put(uid, triples)
            self._seen = news[-1].number

    def _of(self, uid: str) -> str | None:
        try:
            return self._triples(self._store.entry(uid))
        except NoSuchEntry:  # deleted since
            return None

    def _triples(self, entry: Entry) -> str | None:
        """Return the N-Triples of an entry; None if it is gone, or if no reader takes it."""
        try:
            data = self._store.content(entry.uid)
            form = _FORMATS.get(entry.syntax)
            if form is not None:
                with suppress(SyntaxError, ValueError):  # our reader takes more than the standard
                    parsed = ox.parse(data, form, base_iri=entry.about)
                    return (ox.serialize(parsed, format=ox.RdfFormat.N_TRIPLES) or b"").decode()
            return convert_content(data, Path(entry.uid), Target.NTRIPLES).text
        except (NoSuchEntry, BadInput):
            return None
