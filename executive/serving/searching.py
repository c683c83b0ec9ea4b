"""Search: class expressions, words, places, and what a robot can do of it."""

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
    """A search for entries that fit everything that is given."""

    model_config = ConfigDict(extra="forbid")

    expression: Annotated[str | None, Field(max_length=LONGEST)] = None
    """A class expression in Manchester syntax, of which the entry's subject is to be a specialisation or a member."""
    label: _Text = None
    """A part of the label, or of a name or label in the content."""
    kind: Kind | None = None
    room: _Text = None
    floor: _Text = None
    building: _Text = None
    street: _Text = None
    city: _Text = None
    limit: Annotated[int, Field(ge=1, le=MOST_LISTED)] = 20
    after: _Text = None
    """The identifier behind which to go on."""
    sort: Literal["uid", "rating"] = "uid"
    """By identifier, or the best rated first."""


class RobotsQuestion(Question):
    """A question by a robot, which is told which of the recipes it can do."""

    robot: Annotated[str | None, Field(max_length=2_000_000)] = None
    """The text of its self-model."""


@router.get("/search")
def search(question: Annotated[Question, Query()], served: Served, bounds: Bounds) -> dict[str, Any]:
    """Return the entries that fit a question."""
    return answered(question, served, record, bounds)


@router.post("/search")
def search_for_a_robot(question: RobotsQuestion, served: Served, bounds: Bounds) -> dict[str, Any]:
    """Return the entries that fit a question, with what a robot can do of them."""
    robot = question.robot
    if robot is None:
        return answered(question, served, record, bounds)
    served.abilities.check(robot)
    return answered(question, served, lambda entry: record(entry) | served.abilities.of(robot, entry).as_json(), bounds)


def answered(
    question: Question, served: Serving, shown: Callable[[Entry], dict[str, Any]], bounds: Patience
) -> dict[str, Any]:
    """Return the records that fit a question. Raises BadInput for an expression that is none, Busy, and Problem."""
    catalogue, place = served.catalogue, {level: text for level in LEVELS if (text := getattr(question, level))}
    asked = question.expression
    expression = None if asked is None else catalogue.question(asked, served.staff.asking)
    try:
        with bounds.searching():
            found = catalogue.find(expression, question.kind, question.label, place, bounds)
    except CannotAnswer as problem:
        raise Problem(HTTPStatus.UNPROCESSABLE_ENTITY, str(problem)) from None
    if question.sort == "rating":
        found = _behind(catalogue.ranked(found), question.after)
    else:
        found = tuple(uid for uid in found if uid > (question.after or ""))

    def linked(entry: Entry) -> dict[str, Any]:
        bounds.look()
        return shown(entry) | {"links": served.catalogue.links(entry.uid)}

    return listing(served, found, question.limit, linked)


def _behind(uids: tuple[str, ...], after: str | None) -> tuple[str, ...]:
    """Return identifiers behind one of them. Raises Problem if it is none of them any more."""
    if not after:
        return uids
    if after not in uids:
        raise Problem(HTTPStatus.UNPROCESSABLE_ENTITY, f"{after} is no answer any more: begin anew")
    return uids[uids.index(after) + 1 :]
