"""The trace: one line per event, keys in a fixed order, values encoded by a closed set of rules."""

from __future__ import annotations

import io
import json
import os
from contextlib import suppress
from enum import Enum
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from planlang import *
from planlang.failures import BranchEvaporated, CompositeFailure, GraspMissed, ObjectUnfetchable
from planlang.geometry import Pose
from planlang.protocols import Configuration
from planlang.runs import Past, RecordedRun, with_paths
from planlang.runs.codec import encode


def test_every_line_is_a_json_object_that_begins_with_step_and_event() -> None:
    out = io.StringIO()
    run(partial(par, partial(sleep, 1), partial(sleep, 2)), host=VirtualHost(), trace=Trace(out))
    lines = [json.loads(line) for line in out.getvalue().splitlines()]
    assert all(list(line)[:2] == ["step", "event"] for line in lines)
    assert [line["event"] for line in lines] == ["header", *["started"] * 4, *["ended"] * 4]
    assert lines[-1] == {"step": 480, "event": "ended", "node": 1, "parent": None} | {
        "kind": "branch",
        "name": "par",
        "status": "succeeded",
        "result": [None, None],
    }


def test_the_header_tells_plan_iri_rate_seed_schedule_and_what_the_caller_knows() -> None:
    @plan("http://example.org/r#Serve")
    async def serve(*, cup: str = "a") -> None: ...

    trace = Trace(header={"planlang": "0.1.0"})
    run(partial(serve, cup="b"), host=VirtualHost(30), trace=trace, seed=4, schedule=2)
    assert trace.events[0] == {
        "step": 0,
        "event": "header",
        "schema": 5,
        "plan": "serve",
        "iri": "http://example.org/r#Serve",
        "rate": 30,
        "seed": 4,
        "schedule": 2,
        "planlang": "0.1.0",
    }
    assert trace.events[2] == {
        "step": 0,
        "event": "plan",
        "node": 1,
        "name": "serve",
        "iri": "http://example.org/r#Serve",
        "parameters": {"cup": "b"},
    }


def test_a_plan_called_inside_another_is_a_node_with_its_parameters_and_result() -> None:
    @plan
    async def inner(number: int, *, what: str) -> int:
        return number + 1

    async def outer() -> int:
        return await inner(1, what="x")

    trace = Trace()
    assert run(outer, host=VirtualHost(), trace=trace) == 2
    assert trace.events[2] == {
        "step": 0,
        "event": "started",
        "node": 2,
        "parent": 1,
        "kind": "plan",
        "name": "inner",
        "arguments": [1],
        "parameters": {"what": "x"},
    }
    assert trace.events[3] == {
        "step": 0,
        "event": "ended",
        "node": 2,
        "parent": 1,
        "kind": "plan",
        "name": "inner",
        "status": "succeeded",
        "result": 2,
    }


def test_a_file_gets_the_same_bytes_as_the_kept_records_give() -> None:
    async def odd() -> None: ...

    odd.__name__ = 'quo"te\\ \u00e9 \n'
    body = partial(par, odd, odd, partial(sleep, 1))
    out, kept = io.StringIO(), Trace()
    run(body, host=VirtualHost(), trace=Trace(out))
    run(body, host=VirtualHost(), trace=kept)
    assert out.getvalue() == kept.text()


class Colour(Enum):
    """A choice."""

    RED = 1


class Unknown:
    """A class the trace knows nothing of."""


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (None, None),
        (True, True),
        (3, 3),
        (0.1, 0.1),
        (float("nan"), "nan"),
        (float("inf"), "inf"),
        ("é", "é"),
        (Colour.RED, "RED"),
        ((1, (2, 3)), [1, [2, 3]]),
        ({"b": 1, "a": {2, 1}}, {"b": 1, "a": [1, 2]}),
        (frozenset({"b", "a"}), ["a", "b"]),
        (np.float64(0.5), 0.5),
        (np.int32(7), 7),
        (np.bool_(True), True),
        (np.array([[1.0, 2.0]]), [[1.0, 2.0]]),
        (np.zeros((100, 7)), {"shape": [100, 7]}),
        (list(range(1000)), {"length": 1000}),
        (an_object("Cup", "http://example.org/m#cup1"), "cup1"),
        (Pose((1.0, 2.0, 3.0)), {"position": [1.0, 2.0, 3.0], "orientation": [0.0, 0.0, 0.0, 1.0]}),
        (Configuration((0.0, 0.0, 0.0), {"a": 1.0}), {"base": [0.0, 0.0, 0.0], "joints": {"a": 1.0}}),
        (Unknown, "test_trace.Unknown"),
    ],
)
def test_values_are_encoded_by_a_closed_set_of_rules(value: Any, expected: Any) -> None:
    encoded = encode(value)
    if isinstance(expected, str) and expected.endswith("Unknown"):
        assert encoded.endswith(expected)
    else:
        assert encoded == expected
        assert type(encoded) is type(expected)
    json.dumps(encoded, allow_nan=False)


def test_objects_of_unknown_classes_are_told_by_their_qualified_name_without_addresses() -> None:
    assert encode(Unknown()).endswith("test_trace.Unknown")
    assert "0x" not in encode(lambda: None)


def test_a_failure_is_told_with_place_members_and_chain_of_causes() -> None:
    failure = ObjectUnfetchable(what="cup")
    failure.__cause__ = CompositeFailure(failures=(GraspMissed(arm="left"), GraspMissed(arm="right")), names=("l", "r"))
    told = encode(failure)
    assert told["type"] == "ObjectUnfetchable"
    assert told["cause"]["members"] == {
        "l": "GraspMissed: the gripper closed on nothing: left arm",
        "r": "GraspMissed: the gripper closed on nothing: right arm",
    }


def test_a_trace_at_a_path_is_flushed_line_by_line_and_an_older_one_is_kept(tmp_path: Path) -> None:
    target = tmp_path / "run.jsonl"
    target.write_text("older")
    seen: list[int] = []

    async def looks() -> None:
        await sleep(1)
        seen.append(len(target.read_text().splitlines()))

    with Trace.at(target) as trace:
        run(looks, host=VirtualHost(), trace=trace)
    assert seen == [2]
    assert len(target.read_text().splitlines()) == 3
    assert (tmp_path / "run.jsonl.old").read_text() == "older"


def test_the_trace_of_a_failed_run_is_complete(tmp_path: Path) -> None:
    async def fails() -> None:
        await sleep(1)
        raise GraspMissed

    trace = Trace()
    with pytest.raises(GraspMissed):
        run(partial(par, fails, partial(sleep, 9)), host=VirtualHost(), trace=trace)
    ended = [(e["path"], e["status"]) for e in with_paths(trace.events) if e["event"] == "ended"]
    assert ended == [
        ("par/par/fails", "failed"),
        ("par/par/sleep", "evaporated"),
        ("par/par", "failed"),
        ("par", "failed"),
    ]


def nested(depth: int, last: Exception | None = None) -> Any:
    """A plan of as many par inside of each other; the innermost branch fails with ``last``, if there is one."""

    async def level(left: int) -> Any:
        if left:
            return await par(partial(level, left - 1))
        if last is not None:
            raise last
        return "done"

    return partial(level, depth)


@pytest.mark.parametrize("last", [None, GraspMissed(), BranchEvaporated(path="p/" * 3000)], ids=["", "short", "long"])
def test_a_node_is_told_in_as_many_characters_at_any_depth(last: Exception | None) -> None:
    lengths = []
    for depth in (100, 1000):
        trace = Trace()
        with suppress(PlanFailure):
            run(nested(depth, last), host=VirtualHost(), trace=trace)
        lengths.append(len(trace.text()) / depth)
    assert lengths[1] < 1.1 * lengths[0]


def test_every_node_of_a_deep_nest_is_found_again_in_the_task_tree_of_its_trace() -> None:
    trace = Trace()
    run(nested(2000), host=VirtualHost(), trace=trace)
    nodes = list(TaskTree.of(trace))
    assert [node.name for node in nodes] == ["level", *["par", "level"] * 2000]
    assert all(node.parent is before for before, node in pairwise(nodes))
    assert {node.status for node in nodes} == {"succeeded"}


def test_paths_are_given_back_to_records_of_what_happened_in_a_node() -> None:
    async def reach() -> None:
        async with using("arm"):
            await sleep(1)

    trace = Trace()
    run(partial(par, reach, reach), host=VirtualHost(), trace=trace)
    told = [(event["event"], event.get("path")) for event in with_paths(trace.events)]
    assert told[0] == ("header", None)
    assert [path for event, path in told if event == "acquired"] == ["par/par/reach", "par/par/reach#2"]
    assert [path for event, path in told if event == "ended"] == ["par/par/reach", "par/par/reach#2", "par/par", "par"]


def test_the_middle_of_a_long_message_is_left_out() -> None:
    message = encode(BranchEvaporated(path="first" + "/x" * 3000 + "/last"))["message"]
    assert "first" in message
    assert "last" in message
    assert len(message) < 1100


def test_what_is_nested_deeply_is_told_by_its_length() -> None:
    value: list[Any] = [1, 2, 3]
    for _ in range(5000):
        value = [value]
    told = encode(value)
    for _ in range(20):
        (told,) = told
    assert told == {"length": 1}


def test_text_that_cannot_be_encoded_is_escaped(tmp_path: Path) -> None:
    async def odd() -> str:
        return "half of a pair: \ud83d"

    odd.__name__ = "odd\ud83d"
    with Trace.at(tmp_path / "run.jsonl") as trace:
        run(partial(par, odd), host=VirtualHost(), trace=trace)
    lines = [json.loads(line) for line in (tmp_path / "run.jsonl").read_text("utf-8").splitlines()]
    assert lines[3]["name"] == "odd\ud83d"
    assert lines[4]["result"] == "half of a pair: \ud83d"


def test_a_line_that_the_system_takes_in_parts_is_written_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Slow(io.FileIO):
        """A file that takes at most ten bytes at a time."""

        def write(self, data: Any) -> int:
            return super().write(data[:10]) or 0

    written = []
    for file in (io.FileIO, Slow):
        monkeypatch.setattr("planlang.runs.trace.io.FileIO", file)
        with Trace.at(tmp_path / "run.jsonl") as trace:
            run(partial(par, partial(sleep, 1), partial(sleep, 2)), host=VirtualHost(), trace=trace)
        written.append((tmp_path / "run.jsonl").read_bytes())
    assert written[0] == written[1]


class Disk(io.StringIO):
    """Takes so many lines."""

    def __init__(self, lines: int) -> None:
        super().__init__()
        self.lines = lines

    def write(self, text: str) -> int:
        if not self.lines:
            raise OSError(28, "No space left on device")
        self.lines -= 1
        return super().write(text)


def test_a_run_whose_trace_cannot_be_written_any_further_ends_with_that_error_wherever_it_comes() -> None:
    def go(disk: Disk) -> list[str]:
        ended: list[str] = []

        async def body() -> None:
            try:
                await par(partial(sleep, 1), partial(unwind_protect, partial(sleep, 2), partial(sleep, 1)))
            finally:
                ended.append("body")

        run(partial(seq, body), host=VirtualHost(), trace=Trace(disk))
        return ended

    whole = Disk(1000)
    assert go(whole) == ["body"]
    lines = whole.getvalue().splitlines(keepends=True)
    for number in range(len(lines)):
        disk = Disk(number)
        with pytest.raises(OSError, match="No space left") as full:
            go(disk)
        assert disk.getvalue() == "".join(lines[:number])
        assert number == 0 or "the run was ended" in full.value.__notes__[0]


def test_a_pipe_is_written_to_and_not_renamed(tmp_path: Path) -> None:
    pipe = tmp_path / "run.jsonl"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDWR | os.O_NONBLOCK)
    try:
        with Trace.at(pipe) as trace:
            run(partial(sleep, 1), host=VirtualHost(), trace=trace, resumable=True)
        lines = os.read(reader, 100_000)
        assert lines.startswith(b'{"step": 0, "event": "header"')
        past = Past(RecordedRun.of([json.loads(line) for line in lines.splitlines()]))
        with Trace.at(pipe, earlier=past) as trace:
            run(partial(sleep, 1), host=VirtualHost(), trace=trace, resumable=True, resume=past)
        assert b'"event": "resumed"' in os.read(reader, 100_000)
    finally:
        os.close(reader)
    assert [path.name for path in tmp_path.iterdir()] == ["run.jsonl"]


def test_long_and_deep_sequences_of_any_class_are_written_as_their_length() -> None:
    deep: Any = [1]
    for _ in range(30):
        deep = [deep]
    shallow = encode(deep)
    for _ in range(20):
        (shallow,) = shallow
    assert shallow == {"length": 1}
    long = range(1000)
    assert [encode(one) for one in (long, list(long), tuple(long))] == [{"length": 1000}] * 3
    assert encode(range(3)) == encode([0, 1, 2]) == [0, 1, 2]
