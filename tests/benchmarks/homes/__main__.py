"""Everyday tasks in homes that are drawn at random: how many reach their goal, by template and robot.

python -m tests.benchmarks.homes --robots amigo,pr2 --seeds 0:3 [--templates fetch,pour] [--keep FOLDER]
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from tests.benchmarks.homes.tasks import TEMPLATES
from tests.benchmarks.homes.trial import run, write


def main() -> int:
    """Measure."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--robots", default="amigo,pr2")
    parser.add_argument("--seeds", default="0:1", help="FIRST:END")
    parser.add_argument("--templates", default="")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--displaced", action="store_true", help="the seed displaces the world, the map stays")
    parser.add_argument("--write", help="write the files of the tasks to a folder instead of running them")
    parser.add_argument("--out", help="append a line of JSON for each task to a file")
    given = parser.parse_args()
    first, end = map(int, given.seeds.split(":"))
    names: Sequence[str] = [
        one for one in sorted(TEMPLATES) if not given.templates or one in given.templates.split(",")
    ]
    if given.write:
        Path(given.write).mkdir(parents=True, exist_ok=True)
        for seed in range(first, end):
            for name in names:
                write(name, seed, Path(given.write))
        return 0
    cases = [(n, s, r, given.displaced) for s in range(first, end) for n in names for r in given.robots.split(",")]
    good = total = 0
    with ProcessPoolExecutor(given.jobs) as pool:
        for row in pool.map(run, *zip(*cases, strict=True)):
            total += row["outcome"] != "not drawn"
            good += bool(row.get("reached"))
            said = (
                "reached"
                if row.get("reached")
                else f"{row['outcome']}: {row.get('failure') or row.get('cause')} {row.get('unmet')}"
            )
            print(
                f"{row['robot']:6} {row['template']:24} {row['seed']:3} {row.get('cpu', 0):6} s  {said[:220]}",
                flush=True,
            )
            if given.out:
                with Path(given.out).open("a", encoding="utf-8") as file:
                    file.write(json.dumps(row) + "\n")
    print(f"{good} of {total}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
