"""Measure what the command costs before and around the work: import, help, one whole run; wall clock and peak memory.

Every line is the median of several processes; its last column is the ratio to starting this Python with nothing else,
measured in the same run.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

PLANLANG = (sys.executable, "-m", "executive")


def cost(command: tuple[str, ...], folder: str) -> tuple[float, float]:
    """Wall clock [s] and peak resident memory [MB] of one process; raises SystemExit when it fails."""
    with tempfile.TemporaryFile() as said:
        began = time.perf_counter()
        process = subprocess.Popen(command, cwd=folder, stdout=said, stderr=said)
        _, status, usage = os.wait4(process.pid, 0)
        wall = time.perf_counter() - began
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode != 0:
            said.seek(0)
            raise SystemExit(f"{' '.join(command)} ended with {process.returncode}:\n{said.read().decode()}")
    return wall, usage.ru_maxrss / 1024


def main() -> None:
    """Measure and print one line per command."""
    os.environ.setdefault("PYTHONPATH", str(Path(__file__).resolve().parents[2]))
    commands = {
        "python -c pass": ((sys.executable, "-c", "pass"), 9),
        "import planlang": ((sys.executable, "-c", "import planlang"), 9),
        "planlang --help": ((*PLANLANG, "--help"), 9),
        "planlang compile serve_a_drink": ((*PLANLANG, "compile", "serve_a_drink"), 5),
        "planlang run serve_a_drink": ((*PLANLANG, "run", "serve_a_drink"), 3),
    }
    baseline = None
    print(f"{'command':34}{'wall':>9}{'peak':>9}{'x python':>10}")
    with tempfile.TemporaryDirectory() as folder:
        for name, (command, repetitions) in commands.items():
            cost(command, folder)  # the first fills the file system's caches
            costs = [cost(command, folder) for _ in range(repetitions)]
            wall, peak = (statistics.median(column) for column in zip(*costs, strict=True))
            baseline = baseline or wall
            print(f"{name:34}{wall:7.2f} s{peak:6.0f} MB{wall / baseline:10.1f}")


if __name__ == "__main__":
    main()
