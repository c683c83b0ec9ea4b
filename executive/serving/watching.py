"""The page of news about the entries that an author watches."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress

from fastapi import APIRouter, Response

from executive.serving.forms import Filled
from executive.serving.page import PageRoute, author_of, page, status_of
from executive.serving.problems import REFUSALS, Refusal, refusal
from executive.serving.serving import Served, Serving, now
from planlang.knowledge.entries import Entry, NoSuchEntry

router = APIRouter(route_class=PageRoute, include_in_schema=False)

MOST_NEWS, MOST_WATCHED = 50, 200


@router.get("/news")
def ask() -> Response:
    """Show the form for the key."""
    return _key_form()


@router.post("/news")
def show(form: Filled, served: Served) -> Response:
    """Start or stop watching the entry named in the form, if any, and show the news of all watched entries."""
    try:
        author = author_of(form, served)
        stopped = form.text("stop")
        if uid := stopped or form.text("uid"):
            with served.writing:
                if stopped or form.text("do") == "stop":
                    served.store.unsubscribe(author, uid)
                else:
                    served.store.subscribe(author, uid, now())
    except REFUSALS as problem:
        return _key_form(problem)
    subscriptions = served.store.subscriptions(author)
    watched = _watched(served, subscriptions[:MOST_WATCHED])
    latest = served.store.news(author=author, limit=MOST_NEWS, newest_first=True)
    news = [(one, one.uid in served.catalogue) for one in latest]
    return page("news", author=author, news=news, watched=watched, count=len(subscriptions), reason="")


def _key_form(problem: Refusal | None = None) -> Response:
    reason = "" if problem is None else refusal(problem)[1]
    return page("news", status_of(problem), author="", news=(), watched=(), count=0, reason=reason)


def _watched(served: Serving, uids: Iterable[str]) -> list[tuple[str, Entry | None]]:
    """Look up entries; None stands for a deleted one."""
    watched: list[tuple[str, Entry | None]] = []
    for uid in uids:
        entry = None
        with suppress(NoSuchEntry):
            entry = served.store.entry(uid)
        watched.append((uid, entry))
    return watched
