"""The web page: browse, search, read and rate entries. It works without JavaScript.

Pages are rendered from templates that escape uploaded text, with headers that let no foreign script run; scripts only
help with typing. Keys are sent in forms, never in URLs. A refused form is shown again with the reason; its status is
401 or 403 if the author may not do this, else 200.
"""

from __future__ import annotations

from collections.abc import Callable, Coroutine, Mapping, Sequence
from contextlib import suppress
from hashlib import sha256
from http import HTTPStatus
from pathlib import Path
from typing import Annotated, Any
from urllib.parse import urlencode

from fastapi import APIRouter, Depends, FastAPI, Query, Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.responses import HTMLResponse, RedirectResponse
from fastapi.routing import APIRoute
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from pydantic import ValidationError

from executive.serving.abilities import Judgement
from executive.serving.details import details_of, queries_for
from executive.serving.entries import MOST_LISTED, entry_of_kind, listing
from executive.serving.floor_plan import plan_of
from executive.serving.forms import Filled, Form
from executive.serving.patience import Patience
from executive.serving.problems import REFUSALS, Problem, Refusal, problem_response, refusal
from executive.serving.searching import Question, results
from executive.serving.serving import Bounds, Served, Serving, now
from executive.serving.sources import LARGEST_SHOWN, MOST_SHOWN, lines_of, text_of
from executive.serving.workers import Busy, Failed
from planlang.designators import local_name
from planlang.diagnostics import BadInput, Diagnostic
from planlang.files import decode
from planlang.knowledge.entries import HIGHEST_RATING, LOWEST_RATING, Entry, Kind, NoSuchEntry
from planlang.knowledge.places import LEVELS
from planlang.records import dataclass

_HERE = Path(__file__).parent
HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; "
    "connect-src 'self'; form-action 'self'; base-uri 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-cache",
}
"""Headers of every page: scripts and styles only from this server, no requests elsewhere, no frames on other sites."""

_MEDIA_TYPES = {".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}
FILES = {
    path.name: (path.read_bytes(), _MEDIA_TYPES[path.suffix])
    for path in sorted((_HERE / "static").iterdir())
    if path.suffix in _MEDIA_TYPES
}
"""Content and media type of the files that pages use, by name."""
_VERSION = sha256(b"".join(content for content, _ in FILES.values())).hexdigest()[:12]

_templates = Environment(
    loader=FileSystemLoader(_HERE / "templates"),
    autoescape=True,
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
)
_templates.globals |= {"kinds": tuple(Kind), "version": _VERSION}
_templates.filters |= {
    "local_name": local_name,
    "when": lambda time: time.replace("T", " ").removesuffix("Z") + " UTC",
    "bytes": lambda size: f"{size:,} bytes" if size < 10_000 else f"{size / 1000:,.0f} kB",
}


def page(name: str, status: HTTPStatus = HTTPStatus.OK, **shown: Any) -> Response:
    """Render a template."""
    return HTMLResponse(_templates.get_template(f"{name}.html").render(shown), int(status), HEADERS)


class PageRoute(APIRoute):
    """A route whose errors are rendered as pages, too."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Wrap the handler, so that errors become pages."""
        handle = super().get_route_handler()

        async def handled(request: Request) -> Response:
            try:
                return await handle(request)
            except REFUSALS as problem:
                return _refused(*refusal(problem))
            except RequestValidationError as problem:
                return _refused(HTTPStatus.UNPROCESSABLE_ENTITY, "; ".join(one["msg"] for one in problem.errors()))

        return handled


def status_of(problem: Refusal | None) -> HTTPStatus:
    """Status of a form that is shown again: 401 and 403 are kept, everything else is 200."""
    status = HTTPStatus.OK if problem is None else refusal(problem)[0]
    return status if status in (HTTPStatus.UNAUTHORIZED, HTTPStatus.FORBIDDEN) else HTTPStatus.OK


def add_pages(app: FastAPI) -> None:
    """Let an application answer unknown paths with a page, except for those of the API."""

    @app.exception_handler(HTTPStatus.NOT_FOUND)
    def not_found(request: Request, problem: Exception) -> Response:
        if request.url.path.startswith("/v1/"):
            return problem_response(HTTPStatus.NOT_FOUND, getattr(problem, "detail", HTTPStatus.NOT_FOUND.phrase))
        return _refused(HTTPStatus.NOT_FOUND, "there is no page at this address")


def _refused(status: HTTPStatus, reason: str, diagnostics: Sequence[Diagnostic] = ()) -> Response:
    return page("problem", status, title=status.phrase, reason=reason, diagnostics=diagnostics)


MOST_NAMES, MOST_NEWS = 12, 8
MOST_ROBOTS = 20
"""Robots of the store that are offered for a search, and compared with every entry shown."""
JUDGED = (Kind.RECIPE, Kind.OBJECT, Kind.ENVIRONMENT)
"""Kinds that require something of a robot."""


def _kind(request: Request) -> Kind:
    return Kind(request.url.path.split("/")[1])


OfKind = Annotated[Kind, Depends(_kind)]
"""Kind of entry, from the first segment of the path."""

router = APIRouter(route_class=PageRoute, include_in_schema=False)


@router.get("/")
def home(served: Served) -> Response:
    """Show the number of entries of each kind, and the latest news."""
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
    """Serve a style sheet, script or picture of the pages."""
    if name not in FILES:
        raise Problem(HTTPStatus.NOT_FOUND, f"file {name} does not exist")
    content, media_type = FILES[name]
    return Response(content, media_type=media_type, headers=HEADERS | {"Cache-Control": "max-age=86400"})


@router.get("/names")
def names(served: Served, start: Annotated[str, Query(min_length=1, max_length=100)]) -> dict[str, Any]:
    """Complete the name of a class, individual or property."""
    return {"names": served.catalogue.names_like(start, MOST_NAMES)}


@dataclass(frozen=True, slots=True)
class Comparison:
    """Comparison of an entry with a robot, or the ``reason`` why there is none.

    ``robot`` is None for a self-model that was sent with the request.
    """

    robot: Entry | None
    judgement: Judgement | None
    reason: str = ""


_entries = APIRouter(route_class=PageRoute, include_in_schema=False)


@_entries.get("")
def browse(kind: OfKind, served: Served, after: str = "") -> Response:
    """Show a page of the entries of a kind, after an identifier."""
    uids = served.catalogue.uids(kind, after, MOST_LISTED + 1)
    found = listing(served, uids, MOST_LISTED, lambda entry: {"entry": entry, "judgement": None})
    onward = f"/{kind.value}?" + urlencode({"after": found["next"]}) if found["next"] else None
    return page("browse", kind=kind, found=found["entries"], onward=onward, count=served.catalogue.count(kind))


@_entries.get("/{uid}")
def read(
    kind: OfKind,
    uid: str,
    served: Served,
    revision: Annotated[int | None, Query(ge=1, lt=2**53)] = None,
    robot: str = "",
) -> Response:
    """Show an entry, and which robots can use it."""
    return _entry_page(served, entry_of_kind(served, kind, uid), revision, robot=robot.strip())


@_entries.get("/{uid}/{part}")
def part_of(kind: OfKind, uid: str, part: str) -> Response:
    """Redirect from the URL of a form, if it is opened as a page, to its entry."""
    return RedirectResponse(f"/{kind.value}/{uid}", HTTPStatus.SEE_OTHER, HEADERS)


@_entries.post("/{uid}/robots")
def compare(kind: OfKind, uid: str, served: Served, form: Filled) -> Response:
    """Show an entry, compared with a self-model in the form."""
    entry = entry_of_kind(served, kind, uid)
    try:
        data = sent_model(form)
        if not data:
            raise Problem(HTTPStatus.UNPROCESSABLE_ENTITY, "choose a file with a self-model")
        sent = Comparison(None, served.abilities.of(decode(data, "model"), entry))
    except REFUSALS as problem:
        return _entry_page(served, entry, problem=problem, part="robots")
    return _entry_page(served, entry, sent=sent, part="robots")


@_entries.post("/{uid}/rating")
def rate(kind: OfKind, uid: str, served: Served, form: Filled) -> Response:
    """Store a rating, and redirect to the page of the entry."""
    entry = entry_of_kind(served, kind, uid)
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
    """Author of the key in a form. Raises Problem if the key is missing or not valid."""
    author = served.store.author_of(form.text("key"))
    if author is None:
        reason = "this key is unknown or was revoked" if form.text("key") else "this needs your key"
        raise Problem(HTTPStatus.UNAUTHORIZED, reason)
    return author


def _entry_page(
    served: Serving,
    entry: Entry,
    revision: int | None = None,
    *,
    robot: str = "",
    sent: Comparison | None = None,
    problem: Refusal | None = None,
    part: str = "",
) -> Response:
    """Render the page of an entry; ``problem`` is shown in the ``part`` of the page that caused it."""
    data = served.store.content(entry.uid, revision)
    _, reason, diagnostics = refusal(problem) if problem else (HTTPStatus.OK, "", ())
    gravest = sorted(diagnostics, key=lambda one: ("error", "warning", "note").index(one.severity.value))
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
        queries=queries_for(served.store.description(entry.uid), served.vocabulary, served.catalogue.query_name),
        is_judged=entry.kind in JUDGED,
        robot=robot,
        robots=[*([sent] if sent else []), *_comparisons(served, entry, robot, len(data))],
        ratings=range(LOWEST_RATING, HIGHEST_RATING + 1),
        reason=reason,
        diagnostics=gravest[:MOST_SHOWN],
        part=part,
    )


def _comparisons(served: Serving, entry: Entry, requested: str, size: int) -> list[Comparison]:
    """Compare an entry with the requested robot, and with others of the store if it is small enough."""
    if entry.kind not in JUDGED:
        return []
    robots = [entry_of_kind(served, Kind.ROBOT, requested)] if requested else []
    if size <= LARGEST_SHOWN:
        robots += (robot for robot in stored_robots(served) if robot.uid != requested)
    comparisons = []
    for robot in robots:
        try:
            comparisons.append(Comparison(robot, served.abilities.of(self_model(served, robot), entry)))
        except BadInput as problem:  # it was accepted with other ontologies on the server, or by another version
            comparisons.append(Comparison(robot, None, f"cannot be read: {refusal(problem)[1]}"))
        except (Failed, Busy):
            comparisons.append(Comparison(robot, None, "cannot be compared now; try again later"))
    return comparisons


for _one in Kind:
    router.include_router(_entries, prefix=f"/{_one.value}")


@router.get("/search")
def search(request: Request, served: Served, bounds: Bounds) -> Response:
    """Show the results of a search, and which of them a robot of the store can use."""
    query = _query(request.query_params)
    robot = request.query_params.get("robot", "").strip()
    if robot and not query:
        query["kind"] = Kind.RECIPE.value
    return _search_page(served, bounds, query, robot)


@router.post("/search")
def search_for_a_robot(form: Filled, served: Served, bounds: Bounds) -> Response:
    """Show the results of a search, and which of them the robot of a self-model in the form can use."""
    return _search_page(served, bounds, _query(form.fields), sent=sent_model(form))


def _query(fields: Mapping[str, str]) -> dict[str, str]:
    return {name: text.strip() for name, text in fields.items() if text.strip() and name in Question.model_fields}


def sent_model(form: Form) -> bytes:
    """Self-model in a form, as a file or as text; empty if there is none."""
    return form.files.get("model") or form.text("text").encode()


def _search_page(
    served: Serving, bounds: Patience, query: dict[str, str], robot: str = "", sent: bytes = b""
) -> Response:
    shown: dict[str, Any] = {"query": query, "robot": robot, "robots": stored_robots(served), "levels": tuple(LEVELS)}
    shown |= {"reason": "", "diagnostics": (), "found": None, "onward": None}
    if not query:
        return page("search", **shown)
    try:
        model = decode(sent, "model") if sent else None
        if robot:
            model = self_model(served, entry_of_kind(served, Kind.ROBOT, robot))
        found = _results(served, bounds, query, model)
    except REFUSALS as problem:
        _, shown["reason"], shown["diagnostics"] = refusal(problem)
        return page("search", **shown)
    if found["next"] and not sent:
        shown["onward"] = "/search?" + urlencode(query | {"robot": robot, "after": found["next"]})
    return page("search", **shown | {"found": found["entries"]})


def _results(served: Serving, bounds: Patience, query: dict[str, str], model: str | None) -> dict[str, Any]:
    """Search for entries, and compare the results with a self-model if given. Raises BadInput; Problem."""
    try:
        question = Question.model_validate({"sort": "rating", **query})
    except ValidationError as problem:
        reasons = "; ".join(f"{'.'.join(map(str, one['loc']))}: {one['msg']}" for one in problem.errors())
        raise Problem(HTTPStatus.UNPROCESSABLE_ENTITY, reasons) from None
    if model is not None:
        served.abilities.check(model)

    def shown(entry: Entry) -> dict[str, Any]:
        judgement = None
        if model is not None and entry.kind in JUDGED:
            with suppress(BadInput):  # accepted with other ontologies on the server, or by another version
                judgement = served.abilities.of(model, entry)
        return {"entry": entry, "judgement": judgement}

    return results(question, served, shown, bounds)


def stored_robots(served: Serving) -> list[Entry]:
    """First ``MOST_ROBOTS`` robots of the store."""
    robots = []
    for uid in served.catalogue.uids(Kind.ROBOT, limit=MOST_ROBOTS):
        with suppress(NoSuchEntry):  # deleted in the meantime
            robots.append(served.store.entry(uid))
    return robots


def self_model(served: Serving, robot: Entry) -> str:
    """Text of a robot's self-model. Raises BadInput."""
    return decode(served.store.content(robot.uid), robot.uid)
