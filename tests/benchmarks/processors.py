"""Run the bundled recipe as other processors would, each run with an empty cache, and compare the traces.

    python tests/benchmarks/processors.py              seeds 0 to 9
    python tests/benchmarks/processors.py --seeds 2    fewer

OpenBLAS, glibc and NumPy choose their code by what the processor can do; here they are told to take that of an old one.
Exit code 1 if a decision differs: a record other than the same but for numbers, or a number by more than 1e-9.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import zip_longest
from pathlib import Path
from typing import Any

from numpy._core._multiarray_umath import __cpu_dispatch__

from planlang.runs.replay_check import agree

OLD_BLAS = {"OPENBLAS_CORETYPE": "Nehalem"}
OLD_GLIBC = {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-AVX2_Usable,-FMA,-FMA_Usable,-FMA4,-FMA4_Usable,-AVX512F"}
OLD_NUMPY = {"NPY_DISABLE_CPU_FEATURES": " ".join(__cpu_dispatch__)}
PROCESSORS = {
    "openblas": OLD_BLAS,
    "glibc": OLD_GLIBC,
    "all": {**OLD_BLAS, **OLD_GLIBC, **OLD_NUMPY},
}


def trace(seed: int, processor: dict[str, str], folder: Path) -> list[Any]:
    """The records of a run on a processor."""
    folder.mkdir(parents=True)
    command = [sys.executable, "-m", "executive", "run", "serve_a_drink", "--seed", str(seed), "--trace", "run.jsonl"]
    environment = {**os.environ, **processor, "XDG_CACHE_HOME": str(folder / "cache")}
    subprocess.run(command, cwd=folder, env=environment, capture_output=True, check=False)
    return [json.loads(line) for line in (folder / "run.jsonl").read_text(encoding="utf-8").splitlines()]


def differences(one: list[Any], other: list[Any]) -> Iterator[tuple[Any, Any]]:
    """The records that do not agree."""
    for recorded, found in zip_longest(one, other):
        if not agree(recorded, found):
            yield recorded, found


def main() -> int:
    """Compare, and print a line for each run."""
    options = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    options.add_argument("--seeds", type=int, default=10)
    options.add_argument("--jobs", type=int, default=2, help="runs at a time (default: 2)")
    options.add_argument("--processors", default=",".join(PROCESSORS), help="which of them (default: all)")
    chosen = options.parse_args()
    names, wrong = chosen.processors.split(","), 0
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(chosen.jobs) as pool:
        runs = {
            (seed, name): pool.submit(trace, seed, PROCESSORS.get(name, {}), Path(folder, f"{name}-{seed}"))
            for seed in range(chosen.seeds)
            for name in ("here", *names)
        }
        for (seed, name), run in runs.items():
            here, there = runs[seed, "here"].result(), run.result()
            found = list(differences(here, there))
            exact = sum(recorded == record for recorded, record in zip(here, there, strict=False))
            print(
                f"seed {seed}, {name}: {len(there)} records, {exact} equal, {len(found)} decided otherwise", flush=True
            )
            for recorded, record in found[:1]:
                print(f"  here:  {recorded}\n  there: {record}", flush=True)
            wrong += bool(found)
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
