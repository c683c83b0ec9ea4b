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
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from executive.cli.sweep import swept
from executive.cli.sweep_arguments import SweepArguments
from executive.cli.sweep_progress import Progress
from executive.sweeps.files import merged, read_sweep, write_sweep
from executive.sweeps.records import Done

RECIPE = "serve_a_drink"
MOST_RATIO = 1.1
CHILDREN_KILLED = 5


class Costs(Progress):
    """Adds up the CPU time of worlds."""

    seconds = 0.0

    def told(self, done: Done) -> None:
        """Count a world."""
        self.seconds += done.seconds
        super().told(done)


@dataclass
class Measured:
    """A sweep that was done: CPU time of its worlds and of the supervisor, and wall clock, of a world each [s]."""

    worlds: float
    supervisor: float
    wall: float

    def __str__(self) -> str:
        cpu = f"{self.worlds:.3f} s of CPU a world, {self.supervisor:.4f} s of its supervisor"
        return f"{cpu}; {60 / self.wall:.0f} worlds a minute"


def sweep(out: Path, worlds: int, processes: int, shard: str | None = None) -> Measured:
    """Do a sweep in a file."""
    arguments = SweepArguments(recipe=RECIPE, worlds=worlds, out=out, processes=processes, shard=shard, json=True)
    costs, began, cpu = Costs(worlds), time.monotonic(), time.process_time()
    number = len(swept(arguments, costs))
    return Measured(costs.seconds / number, (time.process_time() - cpu) / number, (time.monotonic() - began) / number)


def single(seeds: Sequence[int]) -> float:
    """Return the CPU time of ``planlang run``, in the mean [s]."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    for seed in seeds:
        command = [sys.executable, "-m", "executive", "run", RECIPE, "--seed", str(seed), "--json"]
        subprocess.run(command, capture_output=True, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return (after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime) / len(seeds)


def children(pid: int) -> list[int]:
    """Return the processes that a process has started and that still run."""
    found = []
    for task in Path(f"/proc/{pid}/task").glob("*/children"):
        with suppress(OSError):
            found += list(map(int, task.read_text().split()))
    return found


def workers(pid: int) -> Iterator[int]:
    """Yield the processes that worlds are done in, of a sweep."""
    for source in children(pid):
        yield from children(source)


def killed(out: Path, worlds: int) -> bool:
    """Kill processes of a sweep, then the sweep; return True if none is left. Afterwards it is done to its end."""
    command = [sys.executable, "-m", "executive", "sweep", RECIPE, "--worlds", str(worlds), "--out", str(out)]
    command += ["--processes", "2"]
    running = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    dice, number = random.Random(0), 0
    while number < CHILDREN_KILLED and running.poll() is None:
        time.sleep(dice.uniform(0.5, 2.5))
        if alive := list(workers(running.pid)):
            os.kill(dice.choice(alive), signal.SIGKILL)
            number += 1
    time.sleep(dice.uniform(0.5, 2.5))
    left = [*children(running.pid), *workers(running.pid)]
    running.kill()
    running.wait()
    time.sleep(1.0)
    lines = out.read_bytes().count(b"\n") - 1
    still = [pid for pid in left if Path(f"/proc/{pid}").exists()]
    print(f"killed {number} processes, then the sweep after {lines} worlds; {len(still)} of {len(left)} processes left")
    subprocess.run(command, stdout=subprocess.DEVNULL, check=False)
    return not still


def main() -> int:
    """Measure."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--worlds", type=int, default=100)
    number = parser.parse_args().worlds
    with TemporaryDirectory() as name:
        folder = Path(name)
        one, two, killed_one = folder / "one.jsonl", folder / "two.jsonl", folder / "killed.jsonl"
        alone = sweep(one, number, 1)
        print(f"one process: {alone}", flush=True)
        both = sweep(two, number, 2)
        ratio = (both.worlds + both.supervisor) / (alone.worlds + alone.supervisor)
        print(f"two processes: {both}; ratio {ratio:.3f}", flush=True)
        parts = [folder / "1.jsonl", folder / "2.jsonl"]
        for part, file in enumerate(parts, 1):
            sweep(file, number, 1, f"{part}/2")
        whole = merged([read_sweep(file) for file in parts])
        write_sweep(folder / "merged.jsonl", whole.header, whole.rows)
        all_ended = killed(killed_one, number)
        same = {file.stem: file.read_bytes() == one.read_bytes() for file in (two, folder / "merged.jsonl", killed_one)}
        print("the same bytes as of one process:", ", ".join(f"{what}: {is_so}" for what, is_so in same.items()))
        seeds = range(1, min(number, 10) + 1)
        print(f"planlang run: {single(seeds):.3f} s of CPU a world (seeds 1 to {len(seeds)})")
    return int(not (all_ended and all(same.values()) and ratio <= MOST_RATIO))


if __name__ == "__main__":
    sys.exit(main())
