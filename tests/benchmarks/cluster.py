"""Sweeps on clusters: whether a world is lost or a process left where workers and scheduler die, and what it costs.

    python -m tests.benchmarks.cluster [--parts disturbed,cost,start,rate]

The exit code is 0 if 500 worlds in a cluster whose workers are killed and whose scheduler is started again have the
bytes of a sweep on one machine, at most 10 of them ran twice, no process outlives its worker by 3 s, a world costs at
most a twentieth more CPU time than on one machine, and the first world is done after 4 s.
"""

from __future__ import annotations

import argparse
import os
import random
import resource
import signal
import socket
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from executive.commands.sweep import swept
from executive.options.running import SweepOptions
from executive.processes.workers import Limits
from executive.sweeps import Row, run
from executive.sweeps.files import merged, read_sweep, write_sweep
from executive.sweeps.records import Done

JOB = "tests.support.sweep_jobs:ends"
LIMITS = Limits(seconds=10, memory=1_000_000_000, wall=10.0)
WORLDS, SLOTS, KILLS = 500, 4, 5
NAP = 0.05
"""Duration of a world [s]."""
MOST_TWICE, LONGEST_END, MOST_RATIO, LONGEST_START = 10, 3.0, 1.05, 4.0


class Cluster:
    """A scheduler and a worker with a nanny, as people start them."""

    def __init__(self) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self.address = f"tcp://127.0.0.1:{self.port}"
        self._processes: list[subprocess.Popen[bytes]] = []

    def start(self) -> None:
        """Start both; the worker waits for the scheduler."""
        quiet = {"DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED": "False", "DASK_LOGGING__DISTRIBUTED": "critical"}
        common = ["--no-dashboard", "--dashboard-address", "127.0.0.1:0"]
        scheduler = ["scheduler", "--host", "127.0.0.1", "--port", str(self.port), *common]
        worker = ["worker", self.address, "--nworkers", "1", "--nthreads", str(SLOTS), "--memory-limit", "0", *common]
        for words in (scheduler, worker):
            command = [sys.executable, "-m", "dask", *words]
            self._processes.append(subprocess.Popen(command, env={**os.environ, **quiet}))

    def worker(self) -> int | None:
        """Return the worker, which the nanny starts again each time it ends; it has started a source of processes."""
        for process in descendants(self._processes[1].pid):
            if any("workers import fork_workers" in command(child) for child in children(process)):
                return process
        return None

    def kill(self) -> None:
        """Kill everything."""
        for process in self._processes:
            for one in (*descendants(process.pid), process.pid):
                with suppress(ProcessLookupError):
                    os.kill(one, signal.SIGKILL)
            process.wait()
        self._processes.clear()


def children(pid: int) -> list[int]:
    """Return the processes that a process has started and that still run."""
    found = []
    for task in Path(f"/proc/{pid}/task").glob("*/children"):
        with suppress(OSError):
            found += list(map(int, task.read_text().split()))
    return found


def descendants(pid: int) -> list[int]:
    """Return these, and those that they have started."""
    return [one for child in children(pid) for one in (child, *descendants(child))]


def command(pid: int) -> str:
    """Return the command line of a process."""
    with suppress(OSError):
        return Path(f"/proc/{pid}/cmdline").read_bytes().replace(b"\0", b" ").decode()
    return ""


def is_running(pid: int) -> bool:
    """Check whether a process runs, and is not only kept for its parent to read how it ended."""
    with suppress(OSError):
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    return False


class Disturbance:
    """Kills workers after random numbers of worlds, and once everything, which is then started again."""

    def __init__(self, cluster: Cluster) -> None:
        dice = random.Random(0)
        self._cluster, self._done = cluster, 0
        self._kills = sorted(dice.sample(range(20, WORLDS - 60), KILLS))
        self._restart = WORLDS // 2
        self.longest = 0.0
        """Longest life of a process after its worker [s]."""
        self.killed = 0
        self._worker: int | None = None

    def __call__(self, done: Done) -> None:
        """Count a world, and kill what is due."""
        self._done += 1
        if self._restart and self._done >= self._restart:
            self._restart = 0
            self._cluster.kill()
            self._cluster.start()
        elif self._kills and self._done >= self._kills[0] and (worker := self._cluster.worker()) is not None:
            del self._kills[0]
            self.killed += 1
            left = descendants(worker)
            os.kill(worker, signal.SIGKILL)
            began = time.monotonic()
            while any(map(is_running, left)) and time.monotonic() - began < 2 * LONGEST_END:
                time.sleep(0.02)
            self.longest = max(self.longest, time.monotonic() - began)


def disturbed() -> bool:
    """Compare a sweep in a cluster that is disturbed with one on this machine, and with merged shards."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        log = folder / "log"
        kinds: dict[int, dict[str, Any]] = {
            100: {"how": "abort"},
            200: {"how": "hang"},
            300: {"how": "fill", "size": 4 * 10**9},
        }
        usual = {"how": "nap", "seconds": NAP, "log": str(log)}
        worlds = [{"world": number, **kinds.get(number, usual)} for number in range(1, WORLDS + 1)]

        def sweep(file: str, on: str, **more: Any) -> list[Row]:
            log.unlink(missing_ok=True)
            return run(worlds, JOB, on, processes=SLOTS, limits=LIMITS, out=folder / file, **more)

        cluster = Cluster()
        cluster.start()
        try:
            disturbance = Disturbance(cluster)
            began = time.monotonic()
            rows = sweep("disturbed", cluster.address, told=disturbance, say=print)
            seconds, runs = time.monotonic() - began, Counter(log.read_text().split())
            sweep("half1", cluster.address, shard=(1, 2))
        finally:
            cluster.kill()
        sweep("half2", "local", shard=(2, 2))
        sweep("local", "local")
        halves = merged([read_sweep(folder / half) for half in ("half1", "half2")])
        write_sweep(folder / "merged", halves.header, halves.rows)
        content = [(folder / file).read_bytes() for file in ("disturbed", "local", "merged")]
    twice = sum(count > 1 for count in runs.values())
    typed = {row["world"]: row["failure"][0] for row in rows if row["outcome"] == "crashed"}
    equal = content[0] == content[1] == content[2]
    print(f"{len(rows) - len(typed)} rows and {typed} in {seconds:.0f} s; {disturbance.killed} workers killed")
    print(f"{twice} worlds ended twice; the bytes of a sweep on this machine and of merged shards: {equal}")
    print(f"a killed worker's processes ended within {disturbance.longest:.2f} s")
    return equal and len(typed) == 3 and twice <= MOST_TWICE and disturbance.longest <= LONGEST_END


def cost(worlds: int = 40) -> bool:
    """Compare the CPU time of a world in a local cluster with that on one machine; shards alternate."""
    spent: Counter[str] = Counter()
    for part in (1, 2):
        for on in ("local", "dask"):
            before = cpu()
            done: list[Done] = []
            options = SweepOptions(recipe="serve_a_drink", worlds=worlds, processes=SLOTS, on=on, shard=(part, 2))
            swept(options, finished=done.append)
            spent[on] += cpu() - before + sum(one.seconds for one in done)
    ratio = spent["dask"] / spent["local"]
    each = ", ".join(f"{on} {seconds / worlds:.3f}" for on, seconds in spent.items())
    print(f"CPU of a world with all that starts and supervises it [s]: {each}; ratio {ratio:.3f}")
    return ratio <= MOST_RATIO


def cpu() -> float:
    """Return the CPU time of this process and of those that it has waited for [s]."""
    kinds = map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(one.ru_utime + one.ru_stime for one in kinds)


def start() -> bool:
    """Measure when the first world of a cluster that is started is done, in a program of its own."""
    program = """
import time
began = time.monotonic()
from executive.sweeps import run
times = []
told = lambda done: times.append(time.monotonic())
run([{"world": 1}], "tests.support.sweep_jobs:square", "dask", processes=4, told=told)
print(times[0] - began)
"""
    seconds = float(subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout)
    print(f"first world {seconds:.1f} s after the start")
    return seconds <= LONGEST_START


def rate() -> bool:
    """Measure how many empty worlds a scheduler and a client do in a second."""
    for slots in (1, 4, 16, 64):
        times: list[float] = []
        number = 400 + 10 * slots
        before = cpu()
        run(
            [{"world": world} for world in range(number)],
            "tests.support.sweep_jobs:square",
            "dask",
            processes=slots,
            told=lambda done, times=times: times.append(time.monotonic()),
        )
        skipped = 2 * slots + 20
        used = 1000 * (cpu() - before) / number
        each = (times[-1] - times[skipped]) / (number - 1 - skipped)
        print(f"{slots} slots: {1 / each:.0f} empty worlds per second, {used:.1f} ms of CPU each", flush=True)
    return True


PARTS: dict[str, Callable[[], bool]] = {"disturbed": disturbed, "cost": cost, "start": start, "rate": rate}


def measured(part: str) -> bool:
    """Measure a part, and say what it is."""
    print(f"== {part}", flush=True)
    return PARTS[part]()


def main() -> int:
    """Measure."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--parts", default=",".join(PARTS))
    parts = parser.parse_args().parts.split(",")
    return int(not all(list(map(measured, parts))))


if __name__ == "__main__":
    sys.exit(main())
