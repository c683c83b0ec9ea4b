"""Routes of subscriptions and news."""

from __future__ import annotations

from http import HTTPStatus
from typing import Annotated, Any

from fastapi import APIRouter, Query

from executive.serving.problems import Problem
from executive.serving.serving import Asker, Author, Served, now

router = APIRouter(prefix="/v1", tags=["news"])

MOST_NEWS = 100


@router.get("/subscriptions")
def subscriptions(author: Author, served: Served) -> dict[str, Any]:
    """Return the identifiers that an author subscribed to."""
    return {"subscriptions": served.store.subscriptions(author)}


@router.put("/subscriptions/{uid}", status_code=HTTPStatus.NO_CONTENT)
def subscribe(uid: str, author: Author, served: Served) -> None:
    """Let news of an entry appear in the author's feed."""
    with served.writing:
        served.store.subscribe(author, uid, now())


@router.delete("/subscriptions/{uid}", status_code=HTTPStatus.NO_CONTENT)
def unsubscribe(uid: str, author: Author, served: Served) -> None:
    """Take a subscription back."""
    with served.writing:
        served.store.unsubscribe(author, uid)


@router.get("/news")
def news(
    asker: Asker,
    served: Served,
    after: Annotated[int, Query(ge=0, lt=2**53)] = 0,
    mine: bool = False,
    limit: Annotated[int, Query(ge=1, le=MOST_NEWS)] = MOST_NEWS,
) -> dict[str, Any]:
    """Return what happened behind a line of the feed; with ``mine`` to what the asker subscribed to."""
    if mine and asker is None:
        raise Problem(HTTPStatus.UNAUTHORIZED, "whose news these are, only a key tells: Authorization: Bearer KEY")
    found = served.store.news(after, author=asker if mine else None, limit=limit)
    return {"news": found, "next": found[-1].number if found else after}
