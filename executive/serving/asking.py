"""The page on which entries are searched, and what robots can do of them."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from http import HTTPStatus
from typing import Any
from urllib.parse import urlencode

from fastapi import APIRouter, Request, Response
from pydantic import ValidationError

from executive.serving.entries import known
from executive.serving.forms import Filled, Form
from executive.serving.pages import PageRoute, page
from executive.serving.patience import Patience
from executive.serving.problems import REFUSALS, Problem, refusal
from executive.serving.searching import Question, answered
from executive.serving.serving import Bounds, Served, Serving
from planlang.diagnostics import BadInput
from planlang.files import decode
from planlang.knowledge.entries import Entry, Kind, NoSuchEntry
from planlang.knowledge.places import LEVELS

MOST_ROBOTS = 20
"""Robots of the store that are offered for a search, and that an entry is compared with unasked."""
JUDGED = (Kind.RECIPE, Kind.OBJECT, Kind.ENVIRONMENT)
"""Kinds that require something of a robot."""

router = APIRouter(route_class=PageRoute, include_in_schema=False)


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
