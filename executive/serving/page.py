"""The web page: entries to browse, search, read, upload and rate, without any script of the browser's if need be.

Every page is made from a template here; scripts only help to type. Keys come as fields of forms, never in addresses.
A form that is refused is shown again with the reason, as a page like any other; its status is 401 or 403 for who may
not send it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from http import HTTPStatus
from typing import Annotated, Any
from urllib.parse import urlencode

from fastapi import APIRouter, Depends, Query, Request, Response
from fastapi.responses import RedirectResponse
from pydantic import ValidationError

from executive.serving.abilities import Judgement
from executive.serving.details import details_of, known_of
from executive.serving.entries import MOST_LISTED, known, listing
from executive.serving.floor_plan import plan_of
from executive.serving.forms import Filled, Form
from executive.serving.pages import FILES, HEADERS, PageRoute, page, status_of
from executive.serving.patience import Patience
from executive.serving.problems import REFUSALS, Problem, Refusal, refusal
from executive.serving.searching import Question, answered
from executive.serving.serving import Bounds, Served, Serving, now
from executive.serving.sources import LARGEST_SHOWN, MOST_SHOWN, lines_of, text_of
from executive.serving.workers import Busy, Failed
from planlang.diagnostics import BadInput, Diagnostic
from planlang.files import decode
from planlang.knowledge.entries import HIGHEST_RATING, LOWEST_RATING, Entry, Kind, NoSuchEntry
from planlang.knowledge.places import LEVELS
from planlang.records import dataclass

MOST_NAMES, MOST_NEWS = 12, 8
MOST_ROBOTS = 20
"""Robots of the store that are offered for a search, and that an entry is compared with unasked."""
JUDGED = (Kind.RECIPE, Kind.OBJECT, Kind.ENVIRONMENT)
"""Kinds that require something of a robot."""


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


@router.get("/search")
def search(request: Request, served: Served, bounds: Bounds) -> Response:
    """Return what fits a question, and what a robot of the store can do of it."""
    asked = _asked(request.query_params)
    robot = request.query_params.get("robot", "").strip()
    if robot and not asked:
        asked["kind"] = Kind.RECIPE.value
    return _search_page(served, bounds, asked, robot)


@router.post("/search")
def search_for_a_robot(form: Filled, served: Served, bounds: Bounds) -> Response:
    """Return what fits a question, and what a robot can do of it whose self-model was sent along."""
    return _search_page(served, bounds, _asked(form.fields), sent=sent_model(form))


def _asked(given: Mapping[str, str]) -> dict[str, str]:
    return {name: text.strip() for name, text in given.items() if text.strip() and name in Question.model_fields}


def sent_model(form: Form) -> bytes:
    """Return the self-model that a form has, empty if it has none."""
    return form.files.get("model") or form.text("text").encode()


def _search_page(
    served: Serving, bounds: Patience, asked: dict[str, str], robot: str = "", sent: bytes = b""
) -> Response:
    shown: dict[str, Any] = {"asked": asked, "robot": robot, "robots": stored_robots(served), "levels": tuple(LEVELS)}
    shown |= {"reason": "", "diagnostics": (), "found": None, "onward": None}
    if not asked:
        return page("search", **shown)
    try:
        model = decode(sent, "model") if sent else None
        if robot:
            model = self_model(served, known(served, Kind.ROBOT, robot))
        found = _found(served, bounds, asked, model)
    except REFUSALS as problem:
        _, shown["reason"], shown["diagnostics"] = refusal(problem)
        return page("search", **shown)
    if found["next"] and not sent:
        shown["onward"] = "/search?" + urlencode(asked | {"robot": robot, "after": found["next"]})
    return page("search", **shown | {"found": found["entries"]})


def _found(served: Serving, bounds: Patience, asked: dict[str, str], model: str | None) -> dict[str, Any]:
    """Return what fits a question; with a self-model, what it can do of that. Raises BadInput, and Problem."""
    try:
        question = Question.model_validate({"sort": "rating", **asked})
    except ValidationError as problem:
        reasons = "; ".join(f"{'.'.join(map(str, one['loc']))}: {one['msg']}" for one in problem.errors())
        raise Problem(HTTPStatus.UNPROCESSABLE_ENTITY, reasons) from None
    if model is not None:
        served.abilities.check(model)

    def shown(entry: Entry) -> dict[str, Any]:
        judgement = None
        if model is not None and entry.kind in JUDGED:
            with suppress(BadInput):  # what was taken when more was known cannot be compared
                judgement = served.abilities.of(model, entry)
        return {"entry": entry, "judgement": judgement}

    return answered(question, served, shown, bounds)


def stored_robots(served: Serving) -> list[Entry]:
    """Return the first robots of the store."""
    found = []
    for uid in served.catalogue.uids(Kind.ROBOT, limit=MOST_ROBOTS):
        with suppress(NoSuchEntry):  # deleted in the meantime
            found.append(served.store.entry(uid))
    return found


def self_model(served: Serving, robot: Entry) -> str:
    """Return the text of a robot's self-model. Raises BadInput."""
    return decode(served.store.content(robot.uid), robot.uid)
