"""The application: a list of routers, each of one subject in a file of its own.

General layout: ``serving`` is what routes work with. ``vocabulary`` is what the server knows beforehand; ``uploads``
checks and describes what it is given, with ``places`` of maps; ``catalogue`` finds it again for ``searching``,
``mirror`` for ``sparql``, and ``abilities`` compares it with robots. ``entries``, ``binaries`` and ``feed`` are routes;
``problems`` writes refusals, ``bodies`` bounds requests.
``page``, ``uploading`` and ``watching`` are the web page: ``forms`` reads what it sends, ``details``,
``floor_plan`` and ``sources`` are what it shows of a content, ``pages`` writes it by ``templates/`` and ``static/``.
``workers`` are processes in which all that takes long is computed (``worker``); ``rates`` bounds how often one asks,
``patience`` how long a search takes, ``running`` how long one may hold a connection; ``access`` is the access log.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from typing import Any

from anyio import to_thread
from fastapi import APIRouter, FastAPI

from executive.serving import binaries, entries, feed, page, searching, sparql, uploading, watching
from executive.serving.abilities import Abilities
from executive.serving.access import Logged
from executive.serving.bodies import BoundedBodies
from executive.serving.catalogue import Catalogue
from executive.serving.mirror import Mirror
from executive.serving.pages import add_pages
from executive.serving.problems import RESPONSES, add_handlers
from executive.serving.rates import Paced, Rates
from executive.serving.serving import Served, Serving
from executive.serving.workers import Staff
from planlang.knowledge.entries import Store

MOST_THREADS = 200
"""Requests that are worked on at a time, those among them that wait for their turn at what takes long."""

_LOG = logging.getLogger(__name__)

health = APIRouter(prefix="/v1", tags=["health"])


@health.get("/health")
def healthy(served: Served) -> dict[str, Any]:
    """Return that the server works, how many entries it has, and of how many of them it has to read anew what to find.

    Those are not found by all that is in them yet.
    """
    return {"status": "ok", "entries": len(served.catalogue), "stale": served.catalogue.stale}


ROUTERS = (
    *(health, searching.router, sparql.router, feed.router, binaries.router, entries.router),
    *(page.router, uploading.router, watching.router),
)
"""In the order in which addresses are compared: those of entries, which take any first word, last."""


@asynccontextmanager
async def _lifespan(app: FastAPI) -> AsyncIterator[None]:
    """Let requests wait in many threads; describe anew what another version or vocabulary described; end the mirror."""
    to_thread.current_default_thread_limiter().total_tokens = MOST_THREADS
    ended = threading.Event()
    serving: Serving = app.state.serving

    def renew() -> None:
        while not ended.is_set():
            try:
                if not serving.catalogue.renew(serving.staff.behind):
                    return
            except Exception as problem:  # the store cannot be used now: nobody asked, so nobody else is told
                _LOG.warning("a description is made anew later: %s", problem)
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
    routers: Sequence[APIRouter] = ROUTERS,
    rates: Rates | None = None,
    access: Callable[[str], None] | None = None,
) -> FastAPI:
    """Return the application that serves a store.

    ``staff``: its workers, in whose folders imports of uploads are looked for; several applications may share them.
    ``access`` is given the lines of the access log.
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
    for router in routers:
        app.include_router(router)
    add_handlers(app)
    add_pages(app)
    app.add_middleware(BoundedBodies)
    app.add_middleware(Paced, rates=rates)
    if access is not None:
        app.add_middleware(Logged, write=access)
    return app
