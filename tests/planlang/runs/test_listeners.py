"""Listeners of a trace, and how the nodes of its tree show themselves."""

from functools import partial

import pytest

from planlang import Trace, VirtualHost, par, run, sleep
from planlang.runs import RunTree


def test_what_a_listener_hears_of_a_run_is_what_its_trace_keeps() -> None:
    told: list[object] = []
    trace = Trace()
    trace.listeners = (lambda record, node: told.append(record),)
    run(partial(par, partial(sleep, 1), partial(sleep, 2)), host=VirtualHost(), trace=trace)
    assert told == trace.events
    (root,) = RunTree(trace.events).roots
    assert repr(root) == f"<{root.path}: {root.summary()}>"


def test_a_run_ends_with_what_a_listener_raises() -> None:
    def fail(record: object, node: object) -> None:
        raise BrokenPipeError

    trace = Trace()
    trace.listeners = (fail,)
    with pytest.raises(BrokenPipeError):
        trace.write(7, "belief", change="seen")
    assert trace.listeners == ()
