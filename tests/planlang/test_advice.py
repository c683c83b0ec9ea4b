"""Changes that failures advise: what is written as JSON is read again, and nothing else is."""

from __future__ import annotations

import json

import pytest

from planlang.advice import Change, changes_in
from planlang.failures import LocationUnresolvable, ObjectUnreachable
from planlang.language.recovery import advised_changes
from planlang.plan_failure import links_of
from planlang.runs.codec import dump_failure, load_failure

CHANGES = (
    Change("translation", (1.35, 0.1, 0.79), "cup1"),
    Change("jointPosition", -1.2, "door1"),
    Change("absent", True, "box1"),
    Change("start", (1.0, 0.0, 3.14)),
)


@pytest.mark.parametrize("change", CHANGES, ids=lambda one: one.what)
def test_a_change_is_read_as_it_was_written(change: Change) -> None:
    assert Change.of(json.loads(json.dumps(change.as_json()))) == change


@pytest.mark.parametrize(
    "wrong",
    [
        {"thing": "cup1", "property": "translation", "value": [1.0, 2.0]},
        {"thing": "cup1", "property": "translation", "value": "1 2 3"},
        {"thing": "cup1", "property": "absent", "value": False},
        {"thing": "door1", "property": "jointPosition", "value": True},
        {"thing": "door1", "property": "jointPosition", "value": float("nan")},
        {"thing": "cup1", "property": "translation", "value": [10**400, 0, 0]},
        {"thing": "cup1", "property": "mass", "value": 1.0},
        {"option": "force", "value": True},
        "cup1",
    ],
    ids=str,
)
def test_what_is_no_change_is_refused(wrong: object) -> None:
    with pytest.raises(ValueError, match="is no"):
        Change.of(wrong)


def test_changes_are_found_in_a_list_and_in_the_result_of_a_run() -> None:
    written = [one.as_json() for one in CHANGES]
    assert changes_in(written) == changes_in({"failure": {"advice": "so", "changes": written}}) == CHANGES


@pytest.mark.parametrize("empty", [[], {}, {"failure": {"changes": []}}, "text", None], ids=str)
def test_that_nothing_states_a_change_is_said(empty: object) -> None:
    with pytest.raises(ValueError, match="states no changes"):
        changes_in(empty)


def test_a_failure_keeps_its_changes_in_a_trace_and_passes_them_on() -> None:
    failure = ObjectUnreachable(what="cup1")
    failure.__cause__ = LocationUnresolvable(figures="without box1 this would work", changes=CHANGES)
    again = load_failure(json.loads(json.dumps(dump_failure(failure))))
    assert advised_changes(links_of(again)) == CHANGES
