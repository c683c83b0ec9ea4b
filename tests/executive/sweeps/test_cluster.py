"""Sweeps on a cluster of dask.distributed: the rows are those of one machine, whatever happens to workers."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("distributed", reason="the extra [cluster] is not installed")

import dask
from distributed import KilledWorker, LocalCluster, Security

import planlang
from executive.options.engines import in_seconds, seconds
from executive.processes.workers import Limits
from executive.sweeps import cluster_worker, run
from executive.sweeps.files import read_sweep
from executive.sweeps.records import Done
from tests.support.refusals import refusal

SQUARE, ENDS, READING = (f"tests.support.sweep_jobs:{job}" for job in ("square", "ends", "reading"))
TOP = Path(__file__).resolve().parents[3]
LIMITS = Limits(seconds=5, memory=300_000_000, wall=3.0)
SETTINGS = {"distributed.worker.profile.enabled": False, "distributed.admin.system-monitor.interval": "10s"}


@contextmanager
def cluster(workers: int = 1, slots: int = 2, port: int = 0, **more: Any) -> Iterator[LocalCluster]:
    """A scheduler and workers in this process, which a sweep reaches by the network."""
    with (
        dask.config.set(SETTINGS),
        LocalCluster(
            n_workers=workers,
            threads_per_worker=slots,
            scheduler_port=port,
            dashboard_address="127.0.0.1:0",
            worker_dashboard_address="127.0.0.1:0",
            memory_limit=0,
            **{"processes": False, "protocol": "tcp://", **more},
        ) as made,
    ):
        yield made


def numbered(count: int, **more: Any) -> list[dict[str, Any]]:
    return [{"world": number, **more} for number in range(1, count + 1)]


def test_a_sweep_has_the_same_bytes_on_a_cluster_and_on_one_machine(tmp_path: Path) -> None:
    with cluster(workers=2) as made:
        done: list[Done] = []
        rows = run(numbered(9), SQUARE, made.scheduler_address, out=tmp_path / "cluster", told=done.append)
        assert {one.worker for one in done} == {address.partition("://")[2] for address in made.scheduler.workers}
        assert not made.scheduler.tasks
    assert run(numbered(9), SQUARE, out=tmp_path / "local") == rows
    assert (tmp_path / "cluster").read_bytes() == (tmp_path / "local").read_bytes()


def test_a_sweep_begun_on_one_machine_goes_on_in_a_cluster(tmp_path: Path) -> None:
    out, log = tmp_path / "rows", tmp_path / "log"
    worlds = numbered(6, log=str(log))

    def interrupt(done: Done) -> None:
        if done.row["world"] == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(worlds, SQUARE, processes=1, out=out, told=interrupt)
    missing = [one["world"] for one in worlds if one["world"] not in {row["world"] for row in read_sweep(out).rows}]
    told: list[int] = []
    with cluster() as made:
        run(worlds, SQUARE, made.scheduler_address, out=out, told=lambda done: told.append(done.row["world"]))
    assert sorted(told) == missing
    assert [row["square"] for row in read_sweep(out).rows] == [1, 4, 9, 16, 25, 36]


def test_bad_input_ends_the_sweep_and_the_next_one_uses_the_same_workers() -> None:
    with cluster() as made:
        with refusal("C001"):
            run(numbered(3, how="refuse"), ENDS, made.scheduler_address)
        assert len(run(numbered(3), SQUARE, made.scheduler_address)) == 3


def test_a_sweep_gives_up_without_a_scheduler_and_says_so() -> None:
    lines: list[str] = []
    with refusal("C036", naming="2 of 2 worlds have not run"):
        run(numbered(2), SQUARE, "tcp://127.0.0.1:9", cluster_wait=0.0, say=lines.append)
    assert lines == [
        "no scheduler answers at tcp://127.0.0.1:9: 2 worlds run once workers join; waits up to 0 s for one"
    ]


def test_a_program_that_listens_and_is_no_scheduler_is_named_as_such_within_the_wait() -> None:
    with socket.create_server(("127.0.0.1", 0)) as silent:  # accepts connections, and never answers
        address = f"tcp://127.0.0.1:{silent.getsockname()[1]}"
        with refusal("C036", naming=f"waited 0.1 s: what listens at {address} does not answer as a scheduler of dask"):
            run(numbered(2), SQUARE, address, cluster_wait=0.1)


@pytest.mark.parametrize(
    ("engine", "reason"),
    [
        *((one, "local, dask, or the address of a scheduler") for one in ("slurm", "tcp:host", "http://host:8786", "")),
        *((one, "local, dask, or the address of a scheduler") for one in ("tcp://:8786", "tcp://a..b:8786")),
        ("tcp://127.0.0.1", "the port is missing; write for example tcp://127.0.0.1:8786"),
        ("tls://[::1]", "the port is missing; write for example tls://[::1]:8786"),
        ("tcp://lab:99999", "ports are from 1 to 65535"),
        ("tcp://lab:0", "ports are from 1 to 65535"),
    ],
)
def test_an_engine_that_there_is_not_is_refused_before_the_file_is_begun(
    tmp_path: Path, engine: str, reason: str
) -> None:
    with refusal("C040", naming=reason):
        run(numbered(1), SQUARE, engine, out=tmp_path / "rows")
    assert not (tmp_path / "rows").exists()


@pytest.mark.parametrize("time", [0.5, 300.0, 1_080_000.0])
def test_advice_states_a_time_as_an_option_reads_it(time: float) -> None:
    assert seconds(in_seconds(time)) == time


def test_files_travel_by_content_and_rows_have_the_paths_of_the_client(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "maps").mkdir()
    (tmp_path / "real").mkdir()
    (tmp_path / "real" / "kitchen").write_text("room")
    (tmp_path / "real" / "room").write_text("a table")
    (tmp_path / "maps" / "home").symlink_to("../real/kitchen")
    monkeypatch.chdir(tmp_path)
    inode = (tmp_path / "real" / "room").stat().st_ino
    for name in ("maps/home", str(tmp_path / "maps" / "home")):
        worlds = numbered(3, file=name, inode=inode)
        with cluster() as made:
            rows = run(worlds, READING, made.scheduler_address, reads=READING)
        assert [row["original"] for row in rows] == [False] * 3
        here = run(worlds, READING, processes=1)
        assert [row | {"original": True} for row in rows] == here
        assert here[0]["message"] == f"{tmp_path}/real/room was read"


def test_a_worker_that_joins_later_gets_the_files_too(tmp_path: Path) -> None:
    (tmp_path / "home").write_text("home")
    workers = set()
    with cluster() as made:

        def told(done: Done) -> None:
            workers.add(done.worker)
            if len(workers) == len(made.scheduler.workers) == 1:
                made.scale(2)
                made.wait_for_workers(2)  # meanwhile the first one has no more than the few worlds that were sent

        rows = run(numbered(400, file=str(tmp_path / "home")), READING, made.scheduler_address, told=told)
    assert [row["content"] for row in rows] == ["home"] * 400
    assert len(workers) == 2


def test_pages_that_worlds_write_on_a_worker_are_written_on_the_client(tmp_path: Path) -> None:
    (tmp_path / "home").write_text("home")
    worlds = [one | {"report": str(tmp_path / "pages" / f"{one['world']}.html")} for one in numbered(2)]
    with cluster() as made:
        run([one | {"file": str(tmp_path / "home")} for one in worlds], READING, made.scheduler_address)
    assert [Path(one["report"]).read_text() for one in worlds] == ["page of 1", "page of 2"]


@pytest.mark.parametrize(
    ("what", "value", "said"),
    [
        (
            "executive.sweeps.dispatch.version",
            lambda name: "9.9",
            f"each has planlang {planlang.__version__}, not planlang 9.9",
        ),
        ("executive.sweeps.cluster.program", lambda: "1234567890", f"not planlang {planlang.__version__} (12345678)"),
    ],
)
def test_workers_with_another_planlang_are_refused(
    what: str, value: object, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(what, value)
    with cluster() as made, refusal("C037", naming=said):
        run(numbered(2), SQUARE, made.scheduler_address)


def test_worlds_of_a_worker_that_dies_run_again_on_another_one() -> None:
    lines: list[str] = []
    with cluster(workers=2) as made:

        def told(done: Done) -> None:
            if len(made.scheduler.workers) == 2:
                made.sync(made.scheduler.remove_worker, f"tcp://{done.worker}", stimulus_id="test")

        rows = run(numbered(40), SQUARE, made.scheduler_address, told=told, say=lines.append)
    assert [row["square"] for row in rows] == [number**2 for number in range(1, 41)]
    assert [line.partition("died; ")[2] for line in lines] == ["to run again: 3 worlds"]


def test_a_sweep_goes_on_when_its_scheduler_is_started_again() -> None:
    lines: list[str] = []
    with ExitStack() as first, ExitStack() as second:
        made = first.enter_context(cluster())
        address = made.scheduler_address

        def told(done: Done) -> None:
            if not lines:
                first.close()
                lines.append("closed")
                second.enter_context(cluster(port=int(address.rpartition(":")[2])))

        rows = run(numbered(30), SQUARE, address, told=told, say=lines.append)
    assert [row["square"] for row in rows] == [number**2 for number in range(1, 31)]


@pytest.mark.long
def test_kill_9_of_a_worker_costs_no_world_and_leaves_no_process(tmp_path: Path) -> None:
    worlds = numbered(6, how="worker killed once", marker=str(tmp_path / "marker"))
    lines: list[str] = []
    rows = run(worlds, ENDS, "dask", processes=2, limits=LIMITS, say=lines.append)
    assert [row["square"] for row in rows] == [1, 4, 9, 16, 25, 36]
    assert [line.partition(" ")[2].partition("died")[1] for line in lines] == ["died"]
    processes = (tmp_path / "marker").read_text().split()
    assert [one for one in processes if Path(f"/proc/{one}").exists()] == []


@pytest.mark.long
def test_what_happens_to_a_process_costs_its_world_only_on_a_cluster_as_on_one_machine(tmp_path: Path) -> None:
    hows = ["abort", "killed once", "hang", "fill", "mistake", "no JSON", "well"]
    worlds = [
        {"world": number, "how": how, "marker": str(tmp_path / "marker"), "repeat": f"again {how}"}
        for number, how in enumerate(hows)
    ]
    rows = run(worlds, ENDS, "dask", processes=2, limits=LIMITS)
    (tmp_path / "marker").unlink()
    assert rows == run(worlds, ENDS, processes=2, limits=LIMITS)
    assert [row["failure"] for row in rows if row["outcome"] == "crashed"] == [
        ["ProcessEnded"], ["OutOfTime"], ["OutOfMemory"], ["ZeroDivisionError"], ["TypeError"]
    ]  # fmt: skip


@pytest.mark.long
def test_workers_of_nannies_which_are_daemonic_run_worlds_in_processes() -> None:
    with cluster(processes=True) as made:
        assert len(run(numbered(3), SQUARE, made.scheduler_address)) == 3


PROGRAM = """
from executive.sweeps import run
print(len(run([{"world": 1}, {"world": 2}], "tests.support.sweep_jobs:square", "dask", processes=1)))
"""


@pytest.mark.long
def test_a_program_without_a_guard_for_its_main_part_runs_a_sweep_once(tmp_path: Path) -> None:
    (tmp_path / "program.py").write_text(PROGRAM)
    command = [sys.executable, str(tmp_path / "program.py")]
    environment = {**os.environ, "PYTHONPATH": str(TOP)}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr) == ("2\n", "")


def test_tls_uses_the_certificates_in_the_configuration_of_dask() -> None:
    made = Security.temporary()
    names = {"ca-file": made.tls_ca_file, "client.cert": made.tls_client_cert, "client.key": made.tls_client_key}
    with cluster(security=made, protocol="tls://") as own:
        with refusal("C036", naming="cannot be used"):
            run(numbered(2), SQUARE, own.scheduler_address)
        with dask.config.set({f"distributed.comm.tls.{name}": value for name, value in names.items()}):
            assert len(run(numbered(2), SQUARE, own.scheduler_address)) == 2


def test_worlds_that_kill_their_workers_run_alone_and_cost_only_themselves(monkeypatch: pytest.MonkeyPatch) -> None:
    finished = cluster_worker._Sweep.done

    def dies(sweep: Any, world: Any) -> Done:
        if world["world"] == 3:
            raise KilledWorker("world 3", None, 1)
        return finished(sweep, world)

    monkeypatch.setattr(cluster_worker._Sweep, "done", dies)
    with cluster() as made:
        rows = run(numbered(8), SQUARE, made.scheduler_address)
    assert [row["world"] for row in rows if row["outcome"] == "crashed"] == [3]
    assert rows[2]["failure"] == ["ProcessEnded"]
    assert rows[2]["message"].startswith("2 workers in a row died, or failed, that ran nothing else: ")


def test_a_worker_that_has_forgotten_a_sweep_is_prepared_again() -> None:
    with cluster() as made, ExitStack() as forgotten:

        def told(done: Done) -> None:
            for token in list(cluster_worker._sweeps):
                forgotten.callback(cluster_worker._sweeps.pop(token).close)

        rows = run(numbered(6), SQUARE, made.scheduler_address, told=told)
    assert [row["square"] for row in rows] == [1, 4, 9, 16, 25, 36]
