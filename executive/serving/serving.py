"""State shared by all routes: the store, its catalogue, and the author of a request."""

from __future__ import annotations

import threading
from dataclasses import field
from datetime import UTC, datetime
from http import HTTPStatus
from typing import Annotated, cast

from anyio import from_thread
from fastapi import Depends, Request, Security
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer

from executive.serving.abilities import Abilities
from executive.serving.catalogue import Catalogue
from executive.serving.mirror import Mirror
from executive.serving.patience import Lanes, Patience
from executive.serving.problems import Problem
from executive.serving.rates import Rates
from executive.serving.vocabulary import Vocabulary
from executive.serving.workers import Staff
from planlang.knowledge.entries import Store
from planlang.records import dataclass


@dataclass(frozen=True, slots=True)
class Serving:
    """A store and the services around it. The lock ``writing`` is held during changes."""

    store: Store
    catalogue: Catalogue
    vocabulary: Vocabulary
    abilities: Abilities
    mirror: Mirror
    staff: Staff
    rates: Rates
    writing: threading.Lock = field(default_factory=threading.Lock)
    lanes: Lanes = field(default_factory=Lanes)

    def close(self) -> None:
        """End its processes."""
        self.mirror.close()
        self.staff.close()


def now() -> str:
    """Current time, UTC in ISO 8601; the only place where the server reads the clock for its records."""
    return datetime.now(UTC).isoformat(timespec="seconds").replace("+00:00", "Z")


def _serving(request: Request) -> Serving:
    return cast(Serving, request.app.state.serving)


_bearer = HTTPBearer(auto_error=False, description="A key that the operator of the server made")


def _optional_author(
    request: Request, credentials: Annotated[HTTPAuthorizationCredentials | None, Security(_bearer)]
) -> str | None:
    """Author of a request's key; None without a key. Raises Problem if the key is not valid."""
    if credentials is None:
        if "authorization" in request.headers:
            raise Problem(HTTPStatus.UNAUTHORIZED, "write Authorization: Bearer KEY")
        return None
    served = _serving(request)
    author = served.store.author_of(credentials.credentials)
    if author is None:
        served.rates.forget(request.headers["authorization"])
        raise Problem(HTTPStatus.UNAUTHORIZED, "this key is unknown or was revoked")
    served.rates.know(request.headers["authorization"], author)
    request.state.author = author  # for the access log
    return author


def _author(author: Annotated[str | None, Depends(_optional_author)]) -> str:
    if author is None:
        raise Problem(HTTPStatus.UNAUTHORIZED, "this needs a key: Authorization: Bearer KEY")
    return author


def _patience(request: Request) -> Patience:
    return Patience(_serving(request).lanes, lambda: from_thread.run(request.is_disconnected))


async def _body(request: Request) -> bytes:
    return await request.body()


Served = Annotated[Serving, Depends(_serving)]
"""The shared state."""
OptionalAuthor = Annotated[str | None, Depends(_optional_author)]
"""Author of the request; None if it has no key."""
Author = Annotated[str, Depends(_author)]
"""Author of the request, which needs a key."""
Bounds = Annotated[Patience, Depends(_patience)]
"""Limits of a search."""
Body = Annotated[bytes, Depends(_body)]
"""Body of the request (:mod:`executive.serving.forms` limits its size)."""
