"""Workers that run one batch of worlds after another, on this machine and on a cluster."""

from __future__ import annotations

import os
import select
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from executive.sweeps import workers
from executive.sweeps.records import Task, Workers

PROCESS = "tests.support.sweep_jobs:process"


def processes(used: Workers, worlds: Sequence[dict[str, Any]], most: int = 1000) -> list[int]:
    """Processes of the first worlds that end."""
    found = []
    with used.done(worlds) as results:
        for done in results:
            found.append(done.row["process"])
            if len(found) == most:
                break
    return found


@pytest.mark.parametrize("engine", ["local", pytest.param("dask", marks=pytest.mark.long)])
def test_a_batch_leaves_its_processes_for_the_next_one(engine: str) -> None:
    if engine == "dask":
        pytest.importorskip("distributed", reason="the extra [cluster] is not installed")
    with workers(Task(job=PROCESS, on=engine, processes=1)) as used:
        first, second = processes(used, [{"world": 1}, {"world": 2}]), processes(used, [{"world": 1}])
    assert {*first} == {*second}


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux ends a process with its caller at once")
@pytest.mark.parametrize("engine", ["local", pytest.param("dask", marks=pytest.mark.long)])
def test_a_batch_that_is_ended_ends_its_worlds_at_once_and_the_next_one_runs(engine: str, tmp_path: Path) -> None:
    if engine == "dask":
        pytest.importorskip("distributed", reason="the extra [cluster] is not installed")
    marker = str(tmp_path / "marker")
    worlds = [{"world": 1, "marker": marker}, {"world": 2, "how": "hang", "marker": marker}]
    with workers(Task(job=PROCESS, on=engine, processes=2)) as used:
        with used.done(worlds) as results:
            ended = next(results).row["process"]
            hung = os.pidfd_open(int(Path(marker).read_text(encoding="utf-8")))
        assert select.select([hung], [], [], 20.0)[0], "it is readable once the process has ended"
        os.close(hung)
        again = processes(used, [{"world": 1}])
        assert engine == "dask" or again == [ended]


def test_the_next_world_begins_only_when_the_last_row_was_looked_at() -> None:
    with workers(Task(job=PROCESS, processes=1)) as used:
        first = processes(used, [{"world": 1}, {"world": 2, "how": "hang", "marker": "/nowhere/marker"}], most=1)
        assert processes(used, [{"world": 3}]) == first
