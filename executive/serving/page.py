"""The web page: entries to browse, search, read, upload and rate, without any script of the browser's if need be.

Every page is made from a template here; scripts only help to type. Keys come as fields of forms, never in addresses.
A form that is refused is shown again with the reason, as a page like any other; its status is 401 or 403 for who may
not send it.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from http import HTTPStatus
from typing import Annotated, Any
from urllib.parse import urlencode

from fastapi import APIRouter, Depends, Query, Request, Response
from fastapi.responses import RedirectResponse

from executive.serving.abilities import Judgement
from executive.serving.asking import JUDGED, self_model, sent_model, stored_robots
from executive.serving.details import details_of, known_of
from executive.serving.entries import MOST_LISTED, known, listing
from executive.serving.floor_plan import plan_of
from executive.serving.forms import Filled, Form
from executive.serving.pages import FILES, HEADERS, PageRoute, page, status_of
from executive.serving.problems import REFUSALS, Problem, Refusal, refusal
from executive.serving.serving import Served, Serving, now
from executive.serving.sources import LARGEST_SHOWN, MOST_SHOWN, lines_of, text_of
from executive.serving.workers import Busy, Failed
from planlang.diagnostics import BadInput, Diagnostic
from planlang.files import decode
from planlang.knowledge.entries import HIGHEST_RATING, LOWEST_RATING, Entry, Kind, NoSuchEntry
from planlang.records import dataclass

MOST_NAMES, MOST_NEWS = 12, 8


def _kind(request: Request) -> Kind:
    return Kind(request.url.path.split("/")[1])


OfKind = Annotated[Kind, Depends(_kind)]
"""The kind that an address begins with."""

router = APIRouter(route_class=PageRoute, include_in_schema=False)


@router.get("/")
def home(served: Served) -> Response:
    """Return what there is, and what has happened last."""
    news = []
    for one in served.store.news(limit=MOST_NEWS, newest_first=True):
        label = None
        with suppress(NoSuchEntry):
            label = served.store.entry(one.uid).label
        news.append((one, label))
    counts = {kind: served.catalogue.count(kind) for kind in Kind}
    return page("home", counts=counts, news=news)


@router.get("/static/{name}")
def static(name: str) -> Response:
    """Return a style, script or picture of the pages."""
    if name not in FILES:
        raise Problem(HTTPStatus.NOT_FOUND, f"there is no file {name}")
    content, media_type = FILES[name]
    return Response(content, media_type=media_type, headers=HEADERS | {"Cache-Control": "max-age=86400"})


@router.get("/names")
def names(served: Served, start: Annotated[str, Query(min_length=1, max_length=100)]) -> dict[str, Any]:
    """Return names of classes, individuals and properties to complete what somebody has begun to type."""
    return {"names": served.catalogue.names_like(start, MOST_NAMES)}


@dataclass(frozen=True, slots=True)
class Compared:
    """An entry compared with a robot; ``reason`` says why it cannot be. ``robot`` is None for a model sent along."""

    robot: Entry | None
    judgement: Judgement | None
    reason: str = ""


_entries = APIRouter(route_class=PageRoute, include_in_schema=False)


@_entries.get("")
def browse(kind: OfKind, served: Served, after: str = "") -> Response:
    """Return the entries of a kind behind an identifier."""
    found = listing(served, served.catalogue.uids(kind, after, MOST_LISTED + 1), MOST_LISTED, _plain)
    onward = f"/{kind.value}?" + urlencode({"after": found["next"]}) if found["next"] else None
    return page("browse", kind=kind, found=found["entries"], onward=onward, count=served.catalogue.count(kind))


def _plain(entry: Entry) -> dict[str, Any]:
    return {"entry": entry, "judgement": None}


@_entries.get("/{uid}")
def read(
    kind: OfKind,
    uid: str,
    served: Served,
    revision: Annotated[int | None, Query(ge=1, lt=2**53)] = None,
    robot: str = "",
) -> Response:
    """Return everything about an entry, and what a robot can do of it."""
    return _entry_page(served, known(served, kind, uid), revision, robot=robot.strip())


@_entries.get("/{uid}/{part}")
def part_of(kind: OfKind, uid: str, part: str) -> Response:
    """Lead from the address of a form, if it is opened as a page, to its entry."""
    return RedirectResponse(f"/{kind.value}/{uid}", HTTPStatus.SEE_OTHER, HEADERS)


@_entries.post("/{uid}/robots")
def compare(kind: OfKind, uid: str, served: Served, form: Filled) -> Response:
    """Return the page of an entry, compared with a self-model that was sent along."""
    entry = known(served, kind, uid)
    try:
        data = sent_model(form)
        if not data:
            raise Problem(HTTPStatus.UNPROCESSABLE_ENTITY, "choose the file of a self-model")
        sent = Compared(None, served.abilities.of(decode(data, "model"), entry))
    except REFUSALS as problem:
        return _entry_page(served, entry, problem=problem, part="robots")
    return _entry_page(served, entry, sent=sent, part="robots")


@_entries.post("/{uid}/rating")
def rate(kind: OfKind, uid: str, served: Served, form: Filled) -> Response:
    """Keep a rating, and lead back to the page of the entry."""
    entry = known(served, kind, uid)
    try:
        author = author_of(form, served)
        rating = form.text("rating")
        if rating not in map(str, range(LOWEST_RATING, HIGHEST_RATING + 1)):
            reason = f"a rating is a whole number from {LOWEST_RATING} to {HIGHEST_RATING}"
            raise Problem(HTTPStatus.UNPROCESSABLE_ENTITY, reason)
        with served.writing:
            served.store.rate(uid, author, int(rating), now())
    except REFUSALS as problem:
        return _entry_page(served, entry, problem=problem, part="rating")
    return RedirectResponse(f"/{kind.value}/{uid}#rating", HTTPStatus.SEE_OTHER, HEADERS)


def author_of(form: Form, served: Serving) -> str:
    """Return the author whose key a form has. Raises Problem without one, and for nobody's."""
    author = served.store.author_of(form.text("key"))
    if author is None:
        reason = "this key is nobody's, or was dropped" if form.text("key") else "this needs your key"
        raise Problem(HTTPStatus.UNAUTHORIZED, reason)
    return author


def _entry_page(
    served: Serving,
    entry: Entry,
    revision: int | None = None,
    *,
    robot: str = "",
    sent: Compared | None = None,
    problem: Refusal | None = None,
    part: str = "",
) -> Response:
    """Return the page of an entry; ``problem`` is what went wrong in a ``part`` of it."""
    data = served.store.content(entry.uid, revision)
    _, reason, diagnostics = refusal(problem) if problem else (HTTPStatus.OK, "", ())
    text = text_of(data)
    return page(
        "entry",
        status_of(problem),
        entry=entry,
        revision=revision or entry.revision.number,
        revisions=served.store.revisions(entry.uid),
        size=len(data),
        lines=None if text is None else lines_of(text),
        details=details_of(entry, data, served.staff.reading),
        plan=plan_of(entry, data, served.staff.reading),
        known=known_of(served.store.description(entry.uid), served.vocabulary, served.catalogue.asked),
        is_judged=entry.kind in JUDGED,
        robot=robot,
        robots=[*([sent] if sent else []), *_compared(served, entry, robot, len(data))],
        ratings=range(LOWEST_RATING, HIGHEST_RATING + 1),
        reason=reason,
        diagnostics=_first(diagnostics),
        part=part,
    )


def _compared(served: Serving, entry: Entry, asked: str, size: int) -> list[Compared]:
    """Return what robots of the store can do of an entry: the one that is asked for, and others if that is quick."""
    if entry.kind not in JUDGED:
        return []
    robots = [known(served, Kind.ROBOT, asked)] if asked else []
    if size <= LARGEST_SHOWN:
        robots += (robot for robot in stored_robots(served) if robot.uid != asked)
    found = []
    for robot in robots:
        try:
            found.append(Compared(robot, served.abilities.of(self_model(served, robot), entry)))
        except BadInput as problem:  # it was taken when more was known, or by another version
            found.append(Compared(robot, None, f"cannot be read: {refusal(problem)[1]}"))
        except (Failed, Busy):
            found.append(Compared(robot, None, "cannot be compared now; try again later"))
    return found


def _first(diagnostics: Sequence[Diagnostic]) -> Sequence[Diagnostic]:
    """Return the most severe diagnostics, as many as a page shows."""
    return sorted(diagnostics, key=lambda one: ("error", "warning", "note").index(one.severity.value))[:MOST_SHOWN]


for _one in Kind:
    router.include_router(_entries, prefix=f"/{_one.value}")
