"""Routes of subscriptions and news."""

from __future__ import annotations

from http import HTTPStatus
from typing import Annotated, Any

from fastapi import APIRouter, Query

from executive.serving.problems import Problem
from executive.serving.serving import Author, OptionalAuthor, Served, now

router = APIRouter(prefix="/v1", tags=["news"])

MOST_NEWS = 100


@router.get("/subscriptions")
def subscriptions(author: Author, served: Served) -> dict[str, Any]:
    """List the identifiers that the author is subscribed to."""
    return {"subscriptions": served.store.subscriptions(author)}


@router.put("/subscriptions/{uid}", status_code=HTTPStatus.NO_CONTENT)
def subscribe(uid: str, author: Author, served: Served) -> None:
    """Subscribe the author to news of an entry."""
    with served.writing:
        served.store.subscribe(author, uid, now())


@router.delete("/subscriptions/{uid}", status_code=HTTPStatus.NO_CONTENT)
def unsubscribe(uid: str, author: Author, served: Served) -> None:
    """End a subscription."""
    with served.writing:
        served.store.unsubscribe(author, uid)


@router.get("/news")
def news(
    author: OptionalAuthor,
    served: Served,
    after: Annotated[int, Query(ge=0, lt=2**53)] = 0,
    mine: bool = False,
    limit: Annotated[int, Query(ge=1, le=MOST_NEWS)] = MOST_NEWS,
) -> dict[str, Any]:
    """Read the news after a number; ``mine`` limits them to the subscriptions of the key's author."""
    if mine and author is None:
        raise Problem(HTTPStatus.UNAUTHORIZED, "mine needs a key: Authorization: Bearer KEY")
    found = served.store.news(after, author=author if mine else None, limit=limit)
    return {"news": found, "next": found[-1].number if found else after}
