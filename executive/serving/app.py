"""The application: a list of routers, each of one subject in a file of its own.

General layout: ``serving`` holds the state shared by all routes. ``vocabulary`` reads the ontologies of the server;
``uploads`` checks and describes uploads; ``catalogue`` indexes them for ``searching``, ``mirror`` for ``sparql``, and
``abilities`` compares them with robots. ``entries``, ``binaries`` and ``feed`` are routes of the API; ``problems``
writes error documents.
``page`` (from ``templates/`` and ``static/``), ``uploading`` and ``watching`` are the web page: ``forms`` limits the
size of requests and parses what browsers send, ``details``, ``floor_plan`` and ``sources`` prepare contents.
``workers`` run slow computations in processes of their own. ``rates`` limits the requests of a client,
``patience`` the time of a search, ``running`` the time of a connection; ``access`` is the access log.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any

from anyio import to_thread
from fastapi import APIRouter, FastAPI

from executive.serving import binaries, entries, feed, page, searching, sparql, uploading, watching
from executive.serving.abilities import Abilities
from executive.serving.access import AccessLog
from executive.serving.catalogue import Catalogue
from executive.serving.forms import BoundedBodies
from executive.serving.mirror import Mirror
from executive.serving.page import add_pages
from executive.serving.problems import RESPONSES, add_handlers
from executive.serving.rates import RateLimited, Rates
from executive.serving.serving import Served, Serving
from executive.serving.workers import Staff
from planlang.knowledge.entries import Store

MOST_THREADS = 200
"""Concurrent requests, including those that wait for a worker."""

_LOG = logging.getLogger(__name__)

health = APIRouter(prefix="/v1", tags=["health"])


@health.get("/health")
def healthy(served: Served) -> dict[str, Any]:
    """Report that the server works, its number of entries, and how many of them are still to be indexed again.

    A search may miss these (``stale``).
    """
    return {"status": "ok", "entries": len(served.catalogue), "stale": served.catalogue.stale}


ROUTERS = (
    *(health, searching.router, sparql.router, feed.router, binaries.router, entries.router),
    *(page.router, uploading.router, watching.router),
)
"""In the order in which paths are matched: the routes of entries come last, since they match any first segment."""


@asynccontextmanager
async def _lifespan(app: FastAPI) -> AsyncIterator[None]:
    """Start the workers and the mirror, renew outdated descriptions in the background, and shut all of them down."""
    to_thread.current_default_thread_limiter().total_tokens = MOST_THREADS
    ended = threading.Event()
    serving: Serving = app.state.serving

    def renew() -> None:
        while not ended.is_set():
            try:
                if not serving.catalogue.renew(serving.staff.behind):
                    return
            except Exception as problem:  # the store is unavailable: there is no request to report it to
                _LOG.warning("renewing descriptions failed and is tried again: %s", problem)
                ended.wait(1.0)

    serving.staff.start()
    serving.mirror.start()
    worker = threading.Thread(target=renew)
    worker.start()
    yield
    ended.set()
    worker.join()
    serving.mirror.close()


def application(
    store: Store,
    staff: Staff | None = None,
    *,
    rates: Rates | None = None,
    access: Callable[[str], None] | None = None,
) -> FastAPI:
    """Create the application that serves a store.

    ``staff`` are its workers, in whose folders imports of uploads are looked up; several applications may share them.
    ``access`` receives the lines of the access log.
    """
    staff, rates = staff or Staff(), rates or Rates()
    vocabulary = staff.vocabulary
    app = FastAPI(
        title="planlang knowledge base",
        version="1",
        docs_url=None,
        redoc_url=None,
        responses=RESPONSES,
        lifespan=_lifespan,
    )
    catalogue, abilities = Catalogue(store, vocabulary), Abilities(store, staff.reading)
    app.state.serving = Serving(store, catalogue, vocabulary, abilities, Mirror(store, staff.behind), staff, rates)
    for router in ROUTERS:
        app.include_router(router)
    add_handlers(app)
    add_pages(app)
    app.add_middleware(BoundedBodies)
    app.add_middleware(RateLimited, rates=rates)
    if access is not None:
        app.add_middleware(AccessLog, write=access)
    return app
