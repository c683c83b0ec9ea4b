"""Traces read back: a torn last line is left out, anything damaged is told with its line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from planlang import *
from planlang.runs import DamagedTrace, Past, RecordedRun, with_paths


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
        (3, "{", "no JSON"),
        (3, "\x00", "no JSON"),
        (3, "[" * 100_000, "no JSON: too deeply nested"),
        (3, "[]", "no record"),
        (3, '{"step": -1, "event": "x"}', "no record"),
        (3, '{"step": true, "event": "x"}', "no record"),
        (3, '{"step": 0}', "no record"),
        (4, '{"step": 0, "event": "x", "node": 99, "name": "y"}', "has not started"),
        (4, '{"step": 0, "event": "x", "node": [], "name": "y"}', "told by its number"),
        (4, '{"step": 0, "event": "started", "node": 99, "parent": 98, "name": "y"}', "has not started"),
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
    with pytest.raises(DamagedTrace, match="is told by its number") as damage:
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
        with Trace.at(written, past=past) as trace:
            run(top, host=VirtualHost(), trace=trace, resume=past)
        assert (written.parent / older).read_bytes() == content
        assert b'"resumed"' in written.read_bytes()
    past = Past(RecordedRun.read(written))
    fresh = written.with_name("fresh.jsonl")
    with Trace.at(fresh, past=past):
        pass
    assert list(map(json.loads, fresh.read_text().splitlines())) == [line.record for line in past.kept]


def test_a_trace_that_is_kept_in_memory_has_nothing_to_close() -> None:
    with Trace() as trace:
        run(top, host=VirtualHost(), trace=trace)
    assert trace.events
