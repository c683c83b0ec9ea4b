"""Traces that others listen to: everybody is told everything, and nobody can break the run."""

from collections.abc import Mapping
from functools import partial

import pytest

from executive.runs.traces import ListenedTrace, line_of, lines_of
from planlang import VirtualHost, run, sleep
from planlang.designators import action, an_object
from planlang.failures import ObjectNotFound
from planlang.kernel.core import Task
from planlang.kernel.tree import Node

PLAN = Task(None, None, "serve", lambda: None, 0)
PERFORMED = Node(PLAN, "perform", "Fetching")


def test_listeners_are_told_each_record_in_order() -> None:
    told: list[object] = []
    trace = ListenedTrace.to(None, {}, (told.append, lambda record: told.append(record["event"])))
    trace.write(7, "belief", change="seen", name="bottle1")
    assert told == [{"step": 7, "event": "belief", "change": "seen", "name": "bottle1"}, "belief"]


def test_a_run_ends_with_what_a_listener_raises_and_the_others_are_told_on() -> None:
    told: list[str] = []

    def fail(record: Mapping[str, object]) -> None:
        if record["event"] == "started":
            raise BrokenPipeError

    trace = ListenedTrace.to(None, {}, (fail, lambda record: told.append(record["event"])))
    with pytest.raises(BrokenPipeError):
        run(partial(sleep, 1), host=VirtualHost(), trace=trace)
    assert told == ["header", "started", "drained", "ended"]


@pytest.mark.parametrize(
    ("record", "line"),
    [
        (
            {"event": "started", "node": Node(PERFORMED, "perform", "Reaching"), "action": action("Reaching")},
            "Reaching()",
        ),
        ({"event": "started", "node": PLAN}, None),
        ({"event": "started", "node": Node(PLAN, "plan", "serve_a_drink")}, "serve_a_drink"),
        (
            {"event": "ended", "node": PERFORMED, "failure": ObjectNotFound(what="bottle1")},
            "failed: ObjectNotFound: object not found: what bottle1",
        ),
        ({"event": "ended", "node": PERFORMED, "status": "succeeded"}, None),
        ({"event": "recovery", "node": PLAN, "decision": "retry"}, "recovery: retry"),
        ({"event": "belief", "change": "seen", "name": "bottle1"}, "  belief: bottle1 seen"),
    ],
)
def test_people_are_told_what_begins_fails_and_is_learnt(record: dict[str, object], line: str | None) -> None:
    assert line_of(record) == line


def test_each_line_comes_with_its_step_of_the_world() -> None:
    said: list[tuple[int, str]] = []
    tell = lines_of(lambda step, line: said.append((step, line)))
    what = an_object("DrinkingBottle", "http://example.org/#bottle1")
    tell({"step": 45, "event": "started", "node": PERFORMED, "action": action("X", object_acted_on=what)})
    tell({"step": 46, "event": "acquired", "node": PERFORMED})
    assert said == [(45, "X(object_acted_on=bottle1)")]
