"""The application: a list of routers, each of one subject in a file of its own.

General layout: ``serving`` is what routes work with. ``vocabulary`` is what the server knows beforehand; ``uploads``
checks and describes what it is given, with ``places`` of maps; ``catalogue`` finds it again for ``searching``,
``mirror`` for ``sparql``, and ``abilities`` compares it with robots.
``entries``, ``binaries`` and ``feed`` are routes; ``problems`` and ``records`` write answers.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fastapi import APIRouter, FastAPI

from executive.serving import binaries, entries, feed, searching, sparql
from executive.serving.abilities import Abilities
from executive.serving.catalogue import Catalogue
from executive.serving.mirror import Mirror
from executive.serving.problems import add_handlers
from executive.serving.serving import Served, Serving
from executive.serving.vocabulary import read_vocabulary
from planlang.knowledge.stores import Store

health = APIRouter(prefix="/v1", tags=["health"])


@health.get("/health")
def healthy(served: Served) -> dict[str, Any]:
    """Return that the server works, and how many entries it has."""
    return {"status": "ok", "entries": len(served.catalogue)}


ROUTERS = (health, searching.router, sparql.router, feed.router, binaries.router, entries.router)
"""In the order in which addresses are compared: those of entries, which take any first word, last."""


def application(store: Store, folders: Sequence[Path] = (), *, routers: Sequence[APIRouter] = ROUTERS) -> FastAPI:
    """Return the application that serves a store. Imports of uploads are looked for in ``folders``."""
    vocabulary = read_vocabulary(folders)
    app = FastAPI(title="planlang knowledge base", version="1", docs_url=None, redoc_url=None)
    catalogue, abilities = Catalogue(store, vocabulary), Abilities(store, vocabulary)
    app.state.serving = Serving(store, catalogue, vocabulary, abilities, Mirror(store))
    for router in routers:
        app.include_router(router)
    add_handlers(app)
    return app
