"""Search by class expression, label, kind and place, optionally compared with a robot."""

from __future__ import annotations

from collections.abc import Callable
from http import HTTPStatus
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Query
from pydantic import BaseModel, ConfigDict, Field

from executive.serving.entries import MOST_LISTED, listing, record
from executive.serving.patience import Patience
from executive.serving.problems import Problem
from executive.serving.serving import Bounds, Served, Serving
from planlang.knowledge.entries import Entry, Kind
from planlang.knowledge.index import CannotAnswer
from planlang.knowledge.places import LEVELS
from planlang.knowledge.questions import LONGEST

router = APIRouter(prefix="/v1", tags=["search"])

LONGEST_TEXT = 1000
_Text = Annotated[str | None, Field(max_length=LONGEST_TEXT)]


class Question(BaseModel):
    """A query for entries that meet all given conditions."""

    model_config = ConfigDict(extra="forbid")

    expression: Annotated[str | None, Field(max_length=LONGEST)] = None
    """Class expression in Manchester syntax; finds its subclasses and instances."""
    label: _Text = None
    """Part of the entry's label, or of a name or label in its content."""
    kind: Kind | None = None
    room: _Text = None
    floor: _Text = None
    building: _Text = None
    street: _Text = None
    city: _Text = None
    limit: Annotated[int, Field(ge=1, le=MOST_LISTED)] = 20
    after: _Text = None
    """Identifier after which to continue."""
    sort: Literal["uid", "rating"] = "uid"
    """Order by identifier, or by rating, best first."""


class RobotsQuestion(Question):
    """A query whose results are compared with a robot's self-model."""

    robot: Annotated[str | None, Field(max_length=2_000_000)] = None
    """Text of the self-model."""


@router.get("/search")
def search(question: Annotated[Question, Query()], served: Served, bounds: Bounds) -> dict[str, Any]:
    """Search for entries."""
    return results(question, served, record, bounds)


@router.post("/search")
def search_for_a_robot(question: RobotsQuestion, served: Served, bounds: Bounds) -> dict[str, Any]:
    """Search for entries, and compare each with a robot's self-model."""
    robot = question.robot
    if robot is None:
        return results(question, served, record, bounds)
    served.abilities.check(robot)
    return results(question, served, lambda entry: record(entry) | served.abilities.of(robot, entry).as_json(), bounds)


def results(
    question: Question, served: Serving, shown: Callable[[Entry], dict[str, Any]], bounds: Patience
) -> dict[str, Any]:
    """Answer a query with one page of records. Raises BadInput for an invalid expression; Busy; Problem."""
    catalogue, place = served.catalogue, {level: text for level in LEVELS if (text := getattr(question, level))}
    text = question.expression
    expression = None if text is None else catalogue.question(text, served.staff.asking)
    try:
        with bounds.searching():
            uids = catalogue.find(expression, question.kind, question.label, place, bounds)
    except CannotAnswer as problem:
        raise Problem(HTTPStatus.UNPROCESSABLE_ENTITY, str(problem)) from None
    if question.sort == "rating":
        uids = _after(catalogue.ranked(uids), question.after)
    else:
        uids = tuple(uid for uid in uids if uid > (question.after or ""))

    def linked(entry: Entry) -> dict[str, Any]:
        bounds.look()
        return shown(entry) | {"links": served.catalogue.links(entry.uid)}

    return listing(served, uids, question.limit, linked)


def _after(uids: tuple[str, ...], after: str | None) -> tuple[str, ...]:
    """Identifiers after one of them in a ranking. Raises Problem if that is no longer among the results."""
    if not after:
        return uids
    if after not in uids:
        raise Problem(HTTPStatus.UNPROCESSABLE_ENTITY, f"{after} is no longer among the results; search again")
    return uids[uids.index(after) + 1 :]
