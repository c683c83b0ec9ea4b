"""Records: what survives JSON comes back equal; traces read back without a torn line, damage told with its line."""

from __future__ import annotations

import enum
import json
import math
import tracemalloc
from collections import Counter, OrderedDict
from pathlib import Path
from typing import Any

import hypothesis
import numpy as np
import pytest
from hypothesis import strategies as st

from planlang import *
from planlang.designators import (
    Condition,
    a_device,
    a_location,
    a_person,
    a_posture,
    action,
    an_object,
    holding,
)
from planlang.failures import CompositeFailure, GraspMissed, LocationUnresolvable, ObjectNotFound, PlanFailure
from planlang.geometry import Pose
from planlang.plan_failure import Where
from planlang.protocols import Configuration, Solution
from planlang.runs import DamagedTrace, Past, RecordedRun, with_paths
from planlang.runs.codec import SCHEMA, Lost, dump, dump_failure, load, load_failure


class Colour(enum.Enum):
    RED = 1
    GREEN = 2


TEXTS = st.text(st.characters(exclude_categories=["Cs"]))
CUP = an_object("Cup", "http://example.org/kitchen.owl#cup1")
DESIGNATORS = st.sampled_from(
    [
        CUP,
        a_person("Patient"),
        a_device("Gripper", "http://example.org/robot.owl#gripper"),
        a_location("place", in_reach_of=(CUP, a_location(above=CUP)), using=a_device("Arm")),
        a_posture("carrying"),
        action(
            "Reaching", to_location=a_location(in_front_of=CUP), x=1.5, what="cup", often=3, now=True, both=(CUP, CUP)
        ),
        holding(CUP),
        Condition("open", ("door", 0.5)),
        Pose((1.0, -0.0, 1e-300)),
        Solution((1.0, 2.0, -3.0), 4, {"arm": "right"}),
        Configuration((0.0, 0.0, 0.1), {"elbow": 0.1 + 0.2}),
        Colour.GREEN,
    ]
)
VALUES: st.SearchStrategy[Any] = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), TEXTS, DESIGNATORS),
    lambda inner: st.one_of(
        st.lists(inner, max_size=4),
        st.lists(inner, max_size=4).map(tuple),
        st.dictionaries(TEXTS.filter(lambda key: not key.startswith("$")), inner, max_size=4),
    ),
    max_leaves=12,
)


def through_json(value: Any) -> Any:
    return load(json.loads(json.dumps(dump(value), ensure_ascii=False)))


def same(one: Any, other: Any) -> bool:
    """Equal, of the same types, at every depth; the order of mappings counts."""
    if type(one) is not type(other):
        return False
    if isinstance(one, float):
        return (one == other and math.copysign(1, one) == math.copysign(1, other)) or (one != one and other != other)
    if isinstance(one, (list, tuple)):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, dict):
        return list(one) == list(other) and all(same(one[key], other[key]) for key in one)
    return bool(one == other)


@hypothesis.given(VALUES)
def test_what_survives_comes_back_as_it_was(value: Any) -> None:
    assert same(through_json(value), value)


@pytest.mark.parametrize(
    ("value", "why"),
    [
        (object(), "builtins.object"),
        ({1, 2}, "builtins.set"),
        (b"bytes", "builtins.bytes"),
        (np.float64(1.0), "numpy.float64"),
        (np.zeros(2), "numpy.ndarray"),
        (Counter("a"), "collections.Counter"),
        (OrderedDict(), "collections.OrderedDict"),
        ({1: 2}, "a mapping with the key 1, which is no text"),
        ({"$x": 2}, "a mapping with the key '$x'"),
        ("\ud800", "a text with half a character (a lone surrogate)"),
        ([("deep", object())], "builtins.object"),
        (math.sin, "builtins.builtin_function_or_method"),
        (Pose((1.0,)), "the fields"),  # type: ignore[arg-type]
    ],
)
def test_what_does_not_survive_is_refused_with_the_reason(value: Any, why: str) -> None:
    if why == "the fields":
        with pytest.raises(ValueError, match="wrong type"):
            through_json(value)
    else:
        with pytest.raises(Lost) as lost:
            dump(value)
        assert str(lost.value) == why


def test_a_value_nested_without_end_is_refused() -> None:
    value: list[Any] = []
    value.append(value)
    with pytest.raises(Lost, match="inside of each other"):
        dump(value)


@pytest.mark.parametrize(
    "written",
    [
        {"$": "Pose"},
        {"$": "Pose", "position": [1.0, 2.0, 3.0], "orientation": {"$tuple": [0.0, 0.0, 0.0, 1.0]}},
        {"$": "Pose", "position": {"$tuple": [1.0, 2.0]}, "orientation": {"$tuple": [0.0, 0.0, 0.0, 1.0]}},
        {"$": "Object", "type": 17, "iri": None},
        {"$": "Action", "type": "Reaching", "properties": {"$tuple": [["x"]]}, "name": None},
        {"$": "Popen", "args": "ls"},
        {"$enum": "os.system", "name": "RED"},
        {"$enum": f"{__name__}.Colour", "name": "BLUE"},
        {"$float": "1.5"},
        {"$tuple": "abc"},
        {"$tuple": [], "more": 1},
        {"$new": 1},
    ],
)
def test_what_was_never_written_is_a_value_error(written: Any) -> None:
    with pytest.raises(ValueError, match=r"."):
        load(written)


def test_the_root_of_failures_has_the_name_by_which_plans_and_older_traces_know_it() -> None:
    written = dump_failure(PlanFailure("the plan stopped"))
    assert written["type"] == "planlang.failures.PlanFailure"
    assert type(load_failure(written)) is PlanFailure


def test_a_failure_comes_back_with_its_fields_place_members_attachments_and_causes() -> None:
    failure = CompositeFailure(
        failures=(ObjectNotFound(what="cup"), LocationUnresolvable(designator="x", counts={"out of reach": 3})),
        names=("look", "go"),
    )
    failure.where = Where("top/look", "plan.py", 12, 3)
    failure.siblings = (("other", GraspMissed(what="cup")),)
    failure.cleanup_failures = (PlanFailure("spilt"),)
    failure.__cause__ = ObjectNotFound("gone")
    failure.__cause__.__cause__ = KeyError("cup")
    again = load_failure(json.loads(json.dumps(dump_failure(failure))))
    assert isinstance(again, CompositeFailure)
    assert [str(link) for link in again.chain()] == [str(link) for link in failure.chain()]
    assert [type(link) for link in list(again.chain())[:2]] == [CompositeFailure, ObjectNotFound]
    assert isinstance(list(again.chain())[2], KeyError)
    assert (again.where, again.names) == (failure.where, failure.names)
    assert [repr(one) for one in again.failures] == [repr(one) for one in failure.failures]
    assert isinstance(again.failures[1], LocationUnresolvable)
    assert again.failures[1].counts == {"out of reach": 3}
    assert repr(again.siblings) == repr(failure.siblings)
    assert repr(again.cleanup_failures) == repr(failure.cleanup_failures)


def test_a_failure_with_a_field_that_does_not_survive_is_refused_by_name() -> None:
    with pytest.raises(Lost, match=r"the field what of ObjectNotFound \(builtins.object\)"):
        dump_failure(ObjectNotFound(what=object()))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "written",
    [
        17,
        {},
        {"type": "os.system", "fields": {}},
        {"type": "planlang.failures.GraspMissed", "fields": {"colour": "red"}},
        {"type": "planlang.failures.GraspMissed", "fields": {}, "where": "here"},
        {"type": "planlang.failures.GraspMissed", "fields": {}, "siblings": [1]},
        {"type": "planlang.failures.GraspMissed", "fields": {}, "siblings": 1},
        {"type": "planlang.failures.GraspMissed", "fields": {}, "cleanup": [{"type": "KeyError", "message": ""}]},
        {"type": "planlang.failures.GraspMissed", "fields": {}, "cause": {"type": 1}},
    ],
)
def test_what_is_no_failure_is_a_value_error(written: Any) -> None:
    with pytest.raises(ValueError, match=r"."):
        load_failure(written)


def test_numbers_that_are_not_finite_and_members_of_an_enum_come_back() -> None:
    for value in (math.inf, -math.inf, (Colour.RED, [Colour.GREEN]), {"a": (1, 2.5)}):
        assert load(json.loads(json.dumps(dump(value)))) == value
    assert math.isnan(load(dump(math.nan)))


def test_a_designator_comes_back_with_objects_side_by_side() -> None:
    carrying = action(
        "Reaching", both=(CUP, a_location(above=CUP)), to_location=a_location("place", above=CUP, using=CUP_HAND)
    )
    for value in (carrying, a_location(in_reach_of=(CUP, CUP)), a_posture("carrying")):
        assert load(json.loads(json.dumps(dump(value)))) == value


CUP_HAND = a_device("Gripper", "http://example.org/robot.owl#gripper")


def test_a_failure_with_endless_causes_does_not_survive() -> None:
    failure: PlanFailure = GraspMissed(what="cup")
    for _ in range(60):
        outer = GraspMissed(what="cup")
        outer.__cause__ = failure
        failure = outer
    with pytest.raises(Lost, match="causes"):
        dump_failure(failure)


@pytest.mark.parametrize("error", [KeyError("cup"), UnicodeDecodeError("utf-8", b"x", 0, 1, "why"), ValueError("no")])
def test_a_cause_of_pythons_own_comes_back_with_its_class_and_message(error: Exception) -> None:
    back = load_failure(json.loads(json.dumps(dump_failure(error))))
    assert isinstance(back, type(error))
    assert str(back) == str(error)


async def one() -> int:
    await sleep(1)
    return 1


@plan
async def top() -> list[Any]:
    await seq(one, two=one)
    return list(await par(one, one))


@pytest.fixture
def written(tmp_path: Path) -> Path:
    """The trace of a run."""
    path = tmp_path / "run.jsonl"
    with Trace.at(path) as trace:
        run(top, host=VirtualHost(), trace=trace, resumable=True)
    return path


def test_a_trace_read_back_has_the_records_with_their_lines_and_paths(written: Path) -> None:
    records = [json.loads(line) for line in written.read_text().splitlines()]
    found = RecordedRun.read(written)
    assert [line.record for line in found.lines] == records
    assert [line.number for line in found.lines] == list(range(1, len(records) + 1))
    assert [line.path for line in found.lines] == [event.get("path") for event in with_paths(records)]
    assert (found.outcome, found.torn, found.last, found.header["plan"]) == ("succeeded", False, 720, "top")


def test_a_torn_last_line_is_left_out_and_a_whole_one_without_its_end_is_not(written: Path) -> None:
    content = written.read_bytes()
    whole = len(RecordedRun.read(written).lines)
    begin = content.rstrip(b"\n").rfind(b"\n") + 1
    for end in range(begin + 1, len(content) - 1):
        written.write_bytes(content[:end])
        found = RecordedRun.read(written)
        assert (len(found.lines), found.torn, found.outcome) == (whole - 1, True, None)
    written.write_bytes(content[:-1])
    assert (len(RecordedRun.read(written).lines), RecordedRun.read(written).torn) == (whole, False)


@pytest.mark.parametrize(
    ("line", "text", "told"),
    [
        (3, "{", "not JSON: Expecting property name enclosed in double quotes at character"),
        (3, '{"a": "\t', "not JSON: Invalid control character at character 8"),
        (3, "\x00", "not JSON"),
        (3, "[" * 100_000, "not JSON: too deeply nested"),
        (3, "[]", "not a record"),
        (3, '{"step": -1, "event": "x"}', "not a record"),
        (3, '{"step": true, "event": "x"}', "not a record"),
        (3, '{"step": 0}', "not a record"),
        (4, '{"step": 0, "event": "x", "node": 99, "name": "y"}', "has not started"),
        (4, '{"step": 0, "event": "x", "node": [], "name": "y"}', "node has to be a number"),
        (
            4,
            '{"step": 0, "event": "started", "node": 99, "parent": 98, "kind": "branch", "name": "y"}',
            "has not started",
        ),
        (1, '{"step": 0, "event": "started"}', "begins with its header"),
        (1, '{"step": 0, "event": "header", "schema": 1}', "schema 1"),
        (5, '{"step": 0, "event": "x"}', None),
        (-1, '{"step": 0, "event": "x"}', "after step 720"),
    ],
)
def test_a_damaged_line_is_told(line: int, text: str, told: str | None, written: Path) -> None:
    lines = written.read_text().splitlines()
    number = len(lines) if line < 0 else line
    lines[number - 1 : number] = [text, *(lines[number - 1 : number] if told is None else [])]
    written.write_text("\n".join(lines) + "\n")
    if told is None:
        assert len(RecordedRun.read(written).lines) == len(lines), "an unknown event does no harm"
        return
    with pytest.raises(DamagedTrace, match=told) as damage:
        RecordedRun.read(written)
    assert damage.value.line == number


def test_an_empty_file_and_a_file_of_one_torn_line_are_no_traces(tmp_path: Path) -> None:
    path = tmp_path / "run.jsonl"
    for content in ("", '{"step": 0, "eve'):
        path.write_text(content)
        with pytest.raises(DamagedTrace) as damage:
            RecordedRun.read(path)
        assert damage.value.line == 1


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("value", {"$": "Popen"}),
        ("failure", {"type": "os.system"}),
        ("fluents", []),
        ("spent", {"x": -1}),
        ("used", {"x": "often"}),
        ("draws", [3, "AAAA"]),
        ("draws", "seventeen"),
        ("draws", -1),
        ("draws", True),
        ("draws", 10**12),
        ("open", "top"),
        ("open", [1]),
    ],
)
def test_a_completed_step_that_cannot_be_read_is_told_with_its_line(key: str, value: Any, written: Path) -> None:
    lines = written.read_text().splitlines()
    number = next(number for number, line in enumerate(lines) if '"event": "completed"' in line)
    lines[number] = json.dumps({**json.loads(lines[number]), key: value})
    written.write_text("\n".join(lines) + "\n")
    with pytest.raises(DamagedTrace) as damage:
        Past(RecordedRun.read(written))
    assert damage.value.line == number + 1


@pytest.mark.parametrize(
    ("event", "key", "value"), [("plan", "node", None), ("plan", "node", 1.5), ("called", "call", "first")]
)
def test_what_should_be_told_by_its_number_and_is_not_is_told_with_its_line(
    event: str, key: str, value: Any, written: Path
) -> None:
    lines = written.read_text().splitlines()
    number = next(number for number, line in enumerate(lines) if '"event": "started"' in line)
    lines[number] = json.dumps({**json.loads(lines[number]), "event": event, key: value})
    written.write_text("\n".join(lines) + "\n")
    with pytest.raises(DamagedTrace, match="has to be a number") as damage:
        Past(RecordedRun.read(written))
    assert damage.value.line == number + 1


def test_the_past_ends_with_the_last_completed_step_and_takes_over_whole_constructs(written: Path) -> None:
    found = RecordedRun.read(written)
    past = Past(found)
    assert [done.path for done in past.order] == ["top/seq", "top/par"]
    assert (past.last and past.last.step, past.again, past.last and past.last.path) == (720, (), "top/par")
    part = Past(RecordedRun.of([line.record for line in found.lines if line.step <= 240]))
    assert [done.path for done in part.order] == ["top/seq/one"]
    assert part.last is not None
    assert part.last.step == 240


def test_a_line_that_is_too_long_is_refused_with_its_number(written: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("planlang.runs.recorded_run.LONGEST_LINE", 50)
    with pytest.raises(DamagedTrace, match="a line of more than") as caught:
        RecordedRun.read(written)
    assert caught.value.line == 1


def test_a_trace_that_goes_on_from_a_past_begins_with_it_and_loses_no_older_file(written: Path) -> None:
    for older in ("run.jsonl.old", "run.jsonl.old2"):
        content = written.read_bytes()
        past = Past(RecordedRun.read(written))
        with Trace.at(written, earlier=past) as trace:
            run(top, host=VirtualHost(), trace=trace, resume=past)
        assert (written.parent / older).read_bytes() == content
        assert b'"resumed"' in written.read_bytes()
    past = Past(RecordedRun.read(written))
    fresh = written.with_name("fresh.jsonl")
    with Trace.at(fresh, earlier=past):
        pass
    assert list(map(json.loads, fresh.read_text().splitlines())) == [line.record for line in past.kept]


def test_a_trace_that_is_kept_in_memory_has_nothing_to_close() -> None:
    with Trace() as trace:
        run(top, host=VirtualHost(), trace=trace)
    assert trace.events


def test_what_is_read_of_nodes_inside_of_nodes_grows_as_the_trace_does(tmp_path: Path) -> None:
    def room(depth: int) -> int:
        file = tmp_path / f"{depth}.jsonl"
        lines: list[dict[str, object]] = [{"step": 0, "event": "header", "schema": SCHEMA, "rate": 30}]
        around = None
        for node in range(1, depth + 1):
            named = {"node": node, "parent": around, "kind": "branch", "name": f"part#{node}"}
            lines.append({"step": 0, "event": "started", **named})
            around = node
        file.write_text("".join(json.dumps(line) + "\n" for line in lines))
        tracemalloc.start()
        recorded = RecordedRun.read(file)
        kept = tracemalloc.get_traced_memory()[0]
        tracemalloc.stop()
        assert str(recorded.lines[-1].path).count("/") == depth - 1
        return kept

    assert room(4000) < 5 * room(1000)
