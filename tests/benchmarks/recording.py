"""Measure what --record and --poses cost a run: CPU time in pairs with the same run without them, and the file.

    python tests/benchmarks/recording.py              5 pairs of a short and of a long run
    python tests/benchmarks/recording.py --pairs 3

Without the extra [record] only --poses is measured. Pairs take turns in who is first; a line shows the median of their
differences.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
from importlib.util import find_spec
from pathlib import Path

from startup import PLANLANG, cost

RUNS = {
    "serve_a_drink": (),
    "wipe_table": ("--robot", "amigo", "--environment", "soup_kitchen"),
}
"""A run of 44 s of plan time, and one of 280 s."""
FILES = {"--poses": "poses.jsonl"} | ({"--record": "run.rrd"} if find_spec("rerun") else {})


def main() -> None:
    """Print a line per run and option."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=5)
    pairs = parser.parse_args().pairs
    print(f"{'run':<15}{'option':<10}{'alone':>9}{'more':>9}{'share':>8}{'file':>10}")
    for run, words in RUNS.items():
        command = (*PLANLANG, "run", run, *words)
        for option, name in FILES.items():
            with tempfile.TemporaryDirectory() as folder:
                found = (command, (*command, option, name, "--force"))
                for one in found:
                    cost(one, folder)  # byte code, and the disk's cache
                both = []
                for number in range(pairs):
                    order = found if number % 2 else found[::-1]
                    both.append({one: cost(one, folder)[2] for one in order})
                alone = statistics.median(pair[found[0]] for pair in both)
                more = statistics.median(pair[found[1]] - pair[found[0]] for pair in both)
                size = (Path(folder) / name).stat().st_size / 1e6
            print(f"{run:<15}{option:<10}{alone:>7.2f} s{more:>7.2f} s{more / alone:>8.1%}{size:>7.2f} MB", flush=True)


if __name__ == "__main__":
    main()
