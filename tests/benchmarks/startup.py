"""Measure whole commands: wall clock and peak memory beside those of Python alone, or CPU time beside another checkout.

    python tests/benchmarks/startup.py                    what commands cost before and around their work
    python tests/benchmarks/startup.py --against FOLDER   in pairs with the checkout in a folder, after a warm-up

In the first table each line is the median of several processes; its last column is the ratio to starting this Python
with nothing else, measured in the same run. In the second it is the median of the ratios of pairs, with the least and
the greatest. Both checkouts are run by this Python, with the libraries that it has.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
CORPUS, EXAMPLES = ROOT.parent / "shared" / "corpus" / "recipes", ROOT / "docs" / "examples"
PLANLANG = (sys.executable, "-m", "executive")
PAIRED = {
    "run serve_a_drink": ("run", "serve_a_drink"),
    "locate": ("locate", "in reach of bottle1", "--robot", "amigo", "--environment", "hospital_room"),
    "run make_pancakes": (
        *("run", str(CORPUS / "make_pancakes@hydro.owl"), "--robot", "pr2", "--environment", "stove_kitchen"),
        *("--modules", str(EXAMPLES / "cooking.py")),
    ),
    "run TableSetting": (
        *("run", str(CORPUS / "TableSetting@2011-10.owl.in"), "--accept", "R042", "--robot", "pr2"),
        *("--set", f"@{EXAMPLES / 'table_setting.set'}", "--environment", "breakfast_room"),
    ),
}
"""Commands whose CPU time is compared; those of recipes of others need the corpus beside this checkout."""


def cost(command: tuple[str, ...], folder: str, checkout: Path = ROOT) -> tuple[float, float, float]:
    """Wall clock [s], peak resident memory [MB] and CPU time [s] of a process; raises SystemExit when it fails."""
    # an installed package has its byte code
    own = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
    with tempfile.TemporaryFile() as said:
        began = time.perf_counter()
        process = subprocess.Popen(
            command, cwd=folder, stdout=said, stderr=said, env={**own, "PYTHONPATH": str(checkout)}
        )
        _, status, usage = os.wait4(process.pid, 0)
        wall = time.perf_counter() - began
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode != 0:
            said.seek(0)
            raise SystemExit(f"{' '.join(command)} ended with {process.returncode}:\n{said.read().decode()}")
    return wall, usage.ru_maxrss / 1024, usage.ru_utime + usage.ru_stime


def alone() -> None:
    """Measure and print one line per command."""
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
            wall, peak, _ = (statistics.median(column) for column in zip(*costs, strict=True))
            baseline = baseline or wall
            print(f"{name:34}{wall:7.2f} s{peak:6.0f} MB{wall / baseline:10.1f}")


def paired(other: Path, repetitions: int) -> None:
    """Measure both checkouts in turns, and print the ratios of their CPU times."""
    print(f"{'planlang':20}{'there':>9}{'here':>9}{'here / there':>14}{'least to greatest':>20}")
    with tempfile.TemporaryDirectory() as folder:
        for name, words in PAIRED.items():
            if not all(Path(word).is_file() for word in words if word.startswith(str(CORPUS))):
                print(f"{name:20}  the corpus of real OWL files is not beside this checkout")
                continue
            rows = [
                [cost((*PLANLANG, *words), folder, checkout)[2] for checkout in (other, ROOT)]
                for _ in range(repetitions + 1)
            ][1:]
            there, here = (statistics.median(column) for column in zip(*rows, strict=True))
            ratios = sorted(after / before for before, after in rows)
            spread = f"{ratios[0]:.2f} to {ratios[-1]:.2f}"
            print(f"{name:20}{there:7.2f} s{here:7.2f} s{statistics.median(ratios):14.2f}{spread:>20}", flush=True)


def main() -> None:
    """Measure as asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--against", type=Path, metavar="FOLDER", help="compare with the checkout in this folder")
    parser.add_argument("--repetitions", type=int, default=5, metavar="N", help="pairs of each command (default: 5)")
    chosen = parser.parse_args()
    if chosen.against is None:
        alone()
    elif not (chosen.against / "executive" / "__main__.py").is_file():
        parser.error(f"{chosen.against} is no checkout of planlang")
    else:
        paired(chosen.against.resolve(), chosen.repetitions)


if __name__ == "__main__":
    main()
