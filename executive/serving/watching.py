"""The page of news: what happened to the entries that an author watches, and which these are."""

from __future__ import annotations

from contextlib import suppress
from itertools import islice

from fastapi import APIRouter, Response

from executive.serving.forms import Filled
from executive.serving.page import author_of
from executive.serving.pages import PageRoute, page
from executive.serving.problems import REFUSALS, refusal
from executive.serving.serving import Served, Serving, now
from planlang.knowledge.entries import Entry, News
from planlang.knowledge.stores import NoSuchEntry

router = APIRouter(route_class=PageRoute, include_in_schema=False)

MOST_NEWS, MOST_WATCHED = 50, 200
_AT_A_TIME = 1000


@router.get("/news")
def ask() -> Response:
    """Return the form that asks for a key."""
    return page("news", author="", news=(), watched=(), reason="")


@router.post("/news")
def show(form: Filled, served: Served) -> Response:
    """Watch an entry, or no longer, if the form names one; return what happened to all that the author watches."""
    try:
        author = author_of(form, served)
        uid = form.text("uid")
        if uid:
            with served.writing:
                if form.text("do") == "stop":
                    served.store.unsubscribe(author, uid)
                else:
                    served.store.subscribe(author, uid, now())
    except REFUSALS as problem:
        return page("news", author="", news=(), watched=(), reason=refusal(problem)[1])
    return page("news", author=author, news=_latest(served, author), watched=_watched(served, author), reason="")


def _latest(served: Serving, author: str) -> list[News]:
    """Return the last news of what an author watches, the newest first."""
    found: list[News] = []
    while some := served.store.news(found[-1].number if found else 0, author=author, limit=_AT_A_TIME):
        found = [*found, *some][-MOST_NEWS:]
    return found[::-1]


def _watched(served: Serving, author: str) -> list[tuple[str, Entry | None]]:
    """Return the entries that an author watches; None for one that was deleted."""
    found: list[tuple[str, Entry | None]] = []
    for uid in islice(served.store.subscriptions(author), MOST_WATCHED):
        entry = None
        with suppress(NoSuchEntry):
            entry = served.store.entry(uid)
        found.append((uid, entry))
    return found
