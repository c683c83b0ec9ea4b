"""Sweeps: each world has one row, whatever happens to the processes."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from executive.processes.workers import Limits
from executive.sweeps import run
from executive.sweeps.files import merged, read_sweep, write_sweep
from executive.sweeps.records import Done
from tests.support.refusals import refusal

SQUARE, ENDS = "tests.support.sweep_jobs:square", "tests.support.sweep_jobs:ends"
TOP = Path(__file__).resolve().parents[3]
LIMITS = Limits(seconds=5, memory=300_000_000, wall=3.0)


def numbered(count: int, **more: Any) -> list[dict[str, Any]]:
    return [{"world": number, **more} for number in range(1, count + 1)]


def test_a_sweep_has_the_same_lines_on_one_process_on_two_and_in_merged_shards(tmp_path: Path) -> None:
    worlds = numbered(7)
    rows = run(worlds, SQUARE, processes=1, out=tmp_path / "one")
    assert [row["square"] for row in rows] == [1, 4, 9, 16, 25, 36, 49]
    assert run(worlds, SQUARE, processes=2, out=tmp_path / "two") == rows
    for part in (1, 2):
        run(worlds, SQUARE, processes=1, out=tmp_path / f"part{part}", shard=(part, 2))
    whole = merged([read_sweep(tmp_path / f"part{part}") for part in (2, 1)])
    write_sweep(tmp_path / "merged", whole.header, whole.rows)
    one = (tmp_path / "one").read_bytes()
    assert (tmp_path / "two").read_bytes() == one == (tmp_path / "merged").read_bytes()


def test_a_shard_has_the_worlds_that_belong_together() -> None:
    shards = [run(numbered(8), SQUARE, processes=1, shard=(part, 2), together=2) for part in (1, 2)]
    assert [[row["world"] for row in rows] for rows in shards] == [[1, 2, 5, 6], [3, 4, 7, 8]]


@pytest.mark.long
def test_what_happens_to_a_process_costs_its_world_only(tmp_path: Path) -> None:
    hows = ["abort", "killed once", "hang", "fill", "mistake", "no JSON", "well"]
    worlds = [
        {"world": number, "how": how, "marker": str(tmp_path / "marker"), "repeat": f"again {how}"}
        for number, how in enumerate(hows)
    ]
    rows = run(worlds, ENDS, processes=2, limits=LIMITS)
    assert [row["world"] for row in rows] == list(range(len(hows)))
    assert [row["repeat"] for row in rows] == [f"again {how}" for how in hows]
    crashed = {hows[row["world"]]: row["failure"] for row in rows if row["outcome"] == "crashed"}
    assert crashed == {
        "abort": ["ProcessEnded"],
        "hang": ["OutOfTime"],
        "fill": ["OutOfMemory"],
        "mistake": ["ZeroDivisionError"],
        "no JSON": ["TypeError"],
    }
    assert rows[1]["square"] == 1
    assert rows[4]["message"] == "ZeroDivisionError: the mass is zero"


def test_bad_input_ends_the_sweep_as_it_is_that_of_all_worlds() -> None:
    with refusal("C001"):
        run(numbered(3, how="refuse"), ENDS, processes=1)


def test_an_interrupted_sweep_goes_on_with_what_its_file_lacks(tmp_path: Path) -> None:
    out, log = tmp_path / "rows", tmp_path / "log"
    worlds = numbered(6, log=str(log))

    def interrupt(done: Done) -> None:
        if done.row["world"] == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(worlds, SQUARE, processes=1, out=out, told=interrupt)
    assert [row["world"] for row in read_sweep(out).rows] == [1, 2, 3]
    begun = log.read_text().split()
    with out.open("a", encoding="utf-8") as file:
        file.write('{"world": 4, "outcome": "do')  # torn by kill -9
    before: list[int] = []
    rows = run(worlds, SQUARE, processes=1, out=out, resumed=lambda rows: before.append(len(rows)))
    assert before == [3]
    assert [row["world"] for row in rows] == [1, 2, 3, 4, 5, 6]
    assert log.read_text().split() == [*begun, "4", "5", "6"]
    assert run(worlds, SQUARE, out=out) == rows
    assert len(log.read_text().split()) == len(begun) + 3
    run(worlds, SQUARE, processes=1, out=tmp_path / "whole")
    assert out.read_bytes() == (tmp_path / "whole").read_bytes()


HANGING = """
import sys
from pathlib import Path
from executive.sweeps import run
worlds = [{"world": 1}, *({"world": number, "how": "hang"} for number in (2, 3, 4))]
run(worlds, "tests.support.sweep_jobs:ends", processes=2, out=Path(sys.argv[1]))
"""


@pytest.mark.long
def test_kill_9_of_the_supervisor_leaves_no_process_and_loses_no_line(tmp_path: Path) -> None:
    out = tmp_path / "rows"
    running = subprocess.Popen([sys.executable, "-c", HANGING, str(out)], cwd=TOP)
    try:
        while len(found := descendants(running.pid)) < 3 or out.read_bytes().count(b"\n") < 2:
            assert running.poll() is None
            time.sleep(0.01)
        with refusal("C032"):
            run([{"world": 1}], ENDS, out=out)
    finally:
        running.send_signal(signal.SIGKILL)
        running.wait()
    began = time.monotonic()
    while left := [pid for pid in found if Path(f"/proc/{pid}").exists()]:
        assert time.monotonic() - began < 10, left
        time.sleep(0.01)
    assert [row["world"] for row in read_sweep(out).rows] == [1]


def descendants(pid: int) -> list[int]:
    found = []
    for file in Path(f"/proc/{pid}/task").glob("*/children"):
        for child in map(int, file.read_text().split()):
            found += [child, *descendants(child)]
    return found


def test_a_file_of_another_sweep_is_refused_and_what_differs_is_said(tmp_path: Path) -> None:
    out = tmp_path / "rows"
    run(numbered(2), SQUARE, processes=1, out=out, about={"arguments": "serve_a_drink"})
    kept = out.read_bytes()
    for refused, why in (
        ({"about": {"arguments": "stir_soup"}}, "serve_a_drink, not stir_soup"),
        ({"shard": (1, 2)}, "shard is 1/1, not 1/2"),
        ({"job": ENDS}, "job is tests.support.sweep_jobs:square, not tests.support.sweep_jobs:ends"),
        ({"worlds": numbered(3)}, "it has 2 worlds, not 3"),
        ({"worlds": numbered(2, friction=0.5)}, "the worlds differ"),
    ):
        given: dict[str, Any] = {"worlds": numbered(2), "job": SQUARE, "about": {"arguments": "serve_a_drink"}}
        with refusal("C031", naming=why):
            run(out=out, **(given | refused))
    assert out.read_bytes() == kept


def test_what_is_refused_in_a_world_is_said_with_its_variant() -> None:
    with refusal("C001", naming="with cup2: "):
        run(numbered(1, how="refuse", columns={"variant": "with cup2"}), ENDS, processes=1)


@pytest.mark.parametrize(
    "content", ["my notes\n", "[1, 2]\n", "\n", "{}", '{"sweep": "written by planlang"}\n', "[" * 99999]
)
def test_a_file_without_a_sweep_is_refused_and_stays(tmp_path: Path, content: str) -> None:
    out = tmp_path / "rows"
    out.write_text(content)
    with refusal("C030"):
        run(numbered(1), SQUARE, out=out)
    assert out.read_text() == content


def test_a_damaged_line_and_a_second_row_of_a_world_are_refused_with_their_line(tmp_path: Path) -> None:
    out = tmp_path / "rows"
    run(numbered(2), SQUARE, processes=1, out=out)
    whole = out.read_text()
    for line in ("{", '{"world": 1}', '{"world": 9}', '{"world": [1]}'):
        out.write_text(f"{whole}{line}\n")
        with refusal("C030") as refused:
            read_sweep(out)
        assert refused.value.diagnostics[0].span.line == 4  # type: ignore[union-attr]


def test_shards_of_different_sweeps_and_contradicting_rows_are_not_merged(tmp_path: Path) -> None:
    paths = [tmp_path / "a", tmp_path / "b", tmp_path / "c"]
    run(numbered(2), SQUARE, processes=1, out=paths[0], shard=(1, 2))
    run(numbered(2), SQUARE, processes=1, out=paths[1], shard=(1, 2), about={"robot": "pr2"})
    with refusal("C031", naming=("robot", "pr2", "None")):
        merged([read_sweep(path) for path in paths[:2]])
    paths[2].write_text(paths[0].read_text().replace('"square": 1', '"square": 2'))
    with refusal("C031", naming="world 1"):
        merged([read_sweep(paths[0]), read_sweep(paths[2])])
    assert merged([read_sweep(paths[0])]).missing == (2,)


def test_worlds_need_keys_of_their_own_and_the_job_has_to_be_there() -> None:
    with pytest.raises(ValueError, match="two worlds have the same key"):
        run([{"world": 1}, {"world": 1}], SQUARE)
    with pytest.raises(AttributeError):
        run(numbered(1), "tests.support.sweep_jobs:nothing")
    assert run([], SQUARE) == []
