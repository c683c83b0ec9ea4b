"""A trace whose records have entries of another type is refused with its line, whoever reads it."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from planlang import PlanFailure
from planlang.experience import experience_of, narrative
from planlang.failures import GraspMissed
from planlang.report import Told, model_of, page
from planlang.runs import DamagedTrace, RecordedRun
from planlang.runs.codec import OLDEST, SCHEMA
from planlang.runs.recorded_run import Past, read_records
from planlang.runs.repeating import Repetition
from planlang.runs.run_tree import RunTree
from planlang.testing import Script, compiled, run_plan

Records = list[dict[str, Any]]


@cache
def _text() -> str:
    """Records of a run with recoveries and a failure, and records that a scripted run lacks."""
    script = Script().on("ClosingAGripper", fails=GraspMissed)
    run = run_plan(compiled("serve_a_drink"), script=script)
    assert isinstance(run.failure, PlanFailure)
    records: Records = [dict(record) for record in run.events]
    first, last = records[1], records[-1]
    node = {"step": last["step"], "node": 1, "name": next(one["name"] for one in records if one.get("node") == 1)}
    nested = {"type": "A", "message": "b", "where": "plan (p.py:3)", "members": {"x": "A: b"}, "cleanup": ["A: b"]}
    lossless = {"type": "planlang.failures.GraspMissed", "fields": {"what": "cup"}}
    records[-1:-1] = [
        {**node, "event": "recovery", "recovery": 1, "decision": "retry", "failure": {**nested, "cause": nested}},
        {**node, "event": "pose failed", "attempt": 1, "base": [0, 0, 0], "failure": nested},
        {**node, "event": "transition", "state": "a", "outcome": "b", "to": "c"},
        {**node, "event": "called", "call": 1, "function": "f"},
        {**node, "event": "answer", "asked": "call 1", "failure": lossless},
        {**node, "event": "answer", "asked": "once", "failure": {"type": "ValueError", "message": "no"}},
        {"step": last["step"], "event": "belief", "change": "moved", "name": "door1", "value": 0.5},
        {"step": last["step"], "event": "resumed", "again": ["a/b"]},
    ]
    assert first["event"] != "header"
    return json.dumps(records)


def records_of() -> Records:
    records: Records = json.loads(_text())
    return records


def use(records: Records) -> None:
    """Read records as all commands do that read a trace."""
    recorded = RecordedRun.of(records)
    told = Told.of(line.record for line in recorded.lines)
    page(model_of(told))
    for node in told.tree.numbered.values():
        node.called("Reach"), node.summary(20), node.record(), node.action
    RunTree(line.record for line in recorded.lines)
    past = Past(recorded)
    past.expected(), past.answers()
    Repetition(recorded)
    narrative(experience_of(records), "http://example.org/run", None, records=["poses.jsonl"])


def places(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Paths of all values inside of one."""
    pairs = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [place for key, one in pairs for place in ((*path, key), *places(one, (*path, key)))]


ODD = [None, True, -1, 1.5, 10**400, "x", [1], {"a": 1}, {"type": 1}, {"$": "Object"}, "DELETE"]


@given(st.data())
def test_any_entry_may_have_another_type_or_be_missing(data: st.DataObject) -> None:
    records = records_of()
    number = data.draw(st.integers(0, len(records) - 1))
    *above, key = data.draw(st.sampled_from(places(records[number])))
    inside: Any = records[number]
    for one in above:
        inside = inside[one]
    odd = data.draw(st.sampled_from(ODD))
    if odd == "DELETE":
        del inside[key]
    else:
        inside[key] = odd
    with suppress(DamagedTrace):
        use(records)


def test_the_records_themselves_are_read() -> None:
    use(records_of())


def _last_end(records: Records) -> dict[str, Any]:
    return next(one for one in reversed(records) if one["event"] == "ended")


DAMAGE: dict[str, tuple[Callable[[Records], object], str]] = {
    "a failure without message": (lambda all: _last_end(all)["failure"].pop("message"), "message is a text"),
    "a failure without type": (lambda all: _last_end(all)["failure"].pop("type"), "type is a text"),
    "a list for a failure": (lambda all: _last_end(all).update(failure=["x"]), "failure has to be an object"),
    "a text for a cause": (lambda all: _last_end(all)["failure"].update(cause="x"), "failure has to be an object"),
    "a number for a place": (lambda all: _last_end(all)["failure"].update(where=3), "where is a text"),
    "a list of numbers for members": (lambda all: _last_end(all)["failure"].update(members=[1]), "members are texts"),
    "no status": (lambda all: _last_end(all).pop("status"), "ended has no status"),
    "an unknown status": (lambda all: _last_end(all).update(status="fine"), "status has to be one of"),
    "no rate": (lambda all: all[0].pop("rate"), "header has no rate"),
    "a rate of 0": (lambda all: all[0].update(rate=0), "rate has to be a number above 0"),
    "true for a node": (lambda all: _last_end(all).update(node=True), "node has to be a number above 0"),
    "a step beyond all time": (lambda all: all[-1].update(step=10**400), "is too late"),
    "too many causes": (lambda all: _last_end(all).update(failure=_chain(1000)), "no more than 200 causes"),
}


def _chain(length: int) -> Any:
    failure: Any = None
    for _ in range(length):
        failure = {"type": "A", "message": "b", "cause": failure}
    return failure


@pytest.mark.parametrize("damage", DAMAGE)
def test_a_damaged_record_is_told_with_what_it_has_to_be(damage: str) -> None:
    records = records_of()
    change, message = DAMAGE[damage]
    change(records)
    with pytest.raises(DamagedTrace, match=message):
        RecordedRun.of(records)


def test_a_line_of_a_thousand_lists_is_told(tmp_path: Path) -> None:
    path = tmp_path / "run.jsonl"
    path.write_text(json.dumps(records_of()[0])[:-1] + ', "x": ' + "[" * 300 + "]" * 300 + "}\n")
    with pytest.raises(DamagedTrace, match="too deeply nested"):
        RecordedRun.read(path)


@pytest.mark.parametrize(
    ("schema", "message"),
    [
        (
            OLDEST - 1,
            f"schema {OLDEST - 1}, .* an older planlang, and this one reads only schemas {OLDEST} to {SCHEMA}",
        ),
        (SCHEMA + 1, "a newer planlang.*run the plan again"),
        ("4", "schema has to be a number"),
        (None, "schema has to be a number"),
    ],
)
def test_a_trace_of_another_schema_is_told_with_both_numbers(schema: object, message: str) -> None:
    header = {"step": 0, "event": "header", "schema": schema, "rate": 30, "versions": {"planlang": "0.1.0"}}
    with pytest.raises(DamagedTrace, match=message) as told:
        RecordedRun.of([header])
    assert "read it with planlang 0.1.0" not in str(told.value)


def test_a_trace_in_utf_16_is_refused_with_what_to_do(tmp_path: Path) -> None:
    path = tmp_path / "run.jsonl"
    path.write_text('{"step": 0, "event": "header"}\n', encoding="utf-16")
    with pytest.raises(DamagedTrace, match="save it as UTF-8"):
        read_records(path)
