"""Sweeps: what a world costs, whether processes and shards change a line, and whether killed sweeps lose any.

    python tests/benchmarks/sweeps.py --worlds 500

The exit code is 0 if all lines are the same, no process is left, and a world costs at most a tenth more CPU time on two
processes than on one.
"""

from __future__ import annotations

import argparse
import os
import random
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from tempfile import TemporaryDirectory

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from executive.commands.sweep import swept
from executive.options.running import SweepOptions
from executive.sweeps.files import merged, read_sweep, write_sweep
from executive.sweeps.records import Done
from tests.benchmarks.cluster import children

RECIPE = "serve_a_drink"
MOST_RATIO = 1.1
CHILDREN_KILLED = 5
SHARDS = 4
LONGEST_END = 10.0
"""Seconds of wall clock in which the processes of a killed sweep have to be gone."""


@dataclass
class Measured:
    """A sweep that was done: CPU time of its worlds and of the supervisor, and wall clock, of a world each [s]."""

    worlds: float
    supervisor: float
    wall: float

    def __str__(self) -> str:
        cpu = f"{self.worlds:.3f} s of CPU a world, {self.supervisor:.4f} s of its supervisor"
        return f"{cpu}; {60 / self.wall:.0f} worlds a minute"


def mean(measured: Sequence[Measured]) -> Measured:
    """Return what a world costs in the mean of equally large shards."""
    return Measured(*(sum(getattr(one, name.name) for one in measured) / len(measured) for name in fields(Measured)))


def sweep(out: Path, worlds: int, processes: int, shard: str) -> Measured:
    """Do a sweep in a file."""
    part, parts = map(int, shard.split("/"))
    options = SweepOptions(recipe=RECIPE, worlds=worlds, output=out, processes=processes, shard=(part, parts))
    done: list[Done] = []
    began, cpu = time.monotonic(), time.process_time()
    number = len(swept(options, finished=done.append))
    return Measured(
        sum(one.seconds for one in done) / number,
        (time.process_time() - cpu) / number,
        (time.monotonic() - began) / number,
    )


def single(seeds: Sequence[int]) -> float:
    """Return the CPU time of ``planlang run``, in the mean [s]."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    for seed in seeds:
        command = [sys.executable, "-m", "executive", "run", RECIPE, "--seed", str(seed), "--json"]
        subprocess.run(command, capture_output=True, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return (after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime) / len(seeds)


def workers(pid: int) -> Iterator[int]:
    """Yield the processes that worlds are done in, of a sweep."""
    for source in children(pid):
        yield from children(source)


def number_of_lines(file: Path) -> int:
    """Return the number of complete lines of a file, 0 if there is none."""
    return file.read_bytes().count(b"\n") if file.exists() else 0


def killed(out: Path, worlds: int) -> bool:
    """Kill processes of a sweep, then the sweep; return True if none is left. Afterwards it is done to its end."""
    command = [sys.executable, "-m", "executive", "sweep", RECIPE, "--worlds", str(worlds), "--out", str(out)]
    command += ["--processes", "2"]
    running = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    dice, number, lines = random.Random(0), 0, 2
    while number < CHILDREN_KILLED and running.poll() is None:
        time.sleep(dice.uniform(0.1, 0.5))
        # a world that is killed twice counts as one that crashes: between two kills the other processes do some
        if number_of_lines(out) > lines and (alive := list(workers(running.pid))):
            os.kill(dice.choice(alive), signal.SIGKILL)
            number, lines = number + 1, number_of_lines(out) + 2
    time.sleep(dice.uniform(0.5, 2.5))
    left = [*children(running.pid), *workers(running.pid)]
    running.kill()
    running.wait()
    began = time.monotonic()
    while (still := [pid for pid in left if Path(f"/proc/{pid}").exists()]) and time.monotonic() < began + LONGEST_END:
        time.sleep(0.05)
    print(f"killed {number} processes, then the sweep after {number_of_lines(out) - 1} worlds")
    print(f"{len(still)} of its {len(left)} processes left {time.monotonic() - began:.1f} s later")
    subprocess.run(command, stdout=subprocess.DEVNULL, check=False)
    return not still


def alternating(folder: Path, worlds: int) -> tuple[list[Measured], dict[int, Path]]:
    """Do a sweep shard by shard, each on one process and on two; return what they cost, and the merged files.

    What else the machine does, which comes and goes, weighs on both alike.
    """
    costs: dict[int, list[Measured]] = {1: [], 2: []}
    parts: dict[int, list[Path]] = {1: [], 2: []}
    for shard in range(1, SHARDS + 1):
        for processes in (1, 2):
            file = folder / f"{processes}_{shard}.jsonl"
            costs[processes].append(sweep(file, worlds, processes, f"{shard}/{SHARDS}"))
            parts[processes].append(file)
    files = {processes: folder / f"{processes}.jsonl" for processes in (1, 2)}
    for processes, file in files.items():
        whole = merged([read_sweep(part) for part in parts[processes]])
        write_sweep(file, whole.header, whole.rows)
    return [mean(costs[processes]) for processes in (1, 2)], files


def main() -> int:
    """Measure."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--worlds", type=int, default=100)
    number = parser.parse_args().worlds
    with TemporaryDirectory() as name:
        folder = Path(name)
        (alone, both), files = alternating(folder, number)
        ratio = (both.worlds + both.supervisor) / (alone.worlds + alone.supervisor)
        print(f"one process: {alone}\ntwo processes: {both}\nratio {ratio:.3f}", flush=True)
        all_ended = killed(folder / "killed.jsonl", number)
        content = files[1].read_bytes()
        on_two, when_killed = (one.read_bytes() == content for one in (files[2], folder / "killed.jsonl"))
        print(f"the same bytes as merged shards of one process: merged shards of two: {on_two}, killed: {when_killed}")
        seeds = range(1, min(number, 10) + 1)
        print(f"planlang run: {single(seeds):.3f} s of CPU a world (seeds 1 to {len(seeds)})")
    return int(not (all_ended and on_two and when_killed and ratio <= MOST_RATIO))


if __name__ == "__main__":
    sys.exit(main())
