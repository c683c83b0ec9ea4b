"""Run the scenarios with fixed seeds, hash their traces, and compare those of two checkouts byte by byte.

    python -m tests.benchmarks.equal_bytes --save FOLDER                    traces of this checkout, and FOLDER/sha256
    python -m tests.benchmarks.equal_bytes --against FOLDER                 this checkout and what was saved
    python -m tests.benchmarks.equal_bytes --checkout ../main --checkout .  two checkouts
    ... --short                                                             eight scenarios, in a minute or two
    ... --seeds 0,3 carry wipe                                              other worlds; scenarios with such names
    ... --but-schema                                                        equal but for schema and revision numbers

The first checkout is the one to compare with. Scenarios and their files are those of this checkout, whatever runs them.
With --but-schema, numbers of schemas and revisions and names of resources are left out, and a state that was left may
be told whole or as what differs from the start.

Ontologies that a checkout brings along stand in its traces by file instead of hash: one more property changes no run.
What differs is listed with the first line that does. Exit code 1 if something differs, 0 if all bytes are equal.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from itertools import zip_longest
from pathlib import Path
from typing import Any

from tests.support.scenarios import TOP, Scenario, at_home, scenarios

SHORT = (
    "serve_a_drink",
    "move_the_bottle with amigo",
    "fetch_from_cabinet with amigo",
    "flipping",
    "push_the_door_shut",
    "stir_soup",
    "carry_the_tray with amigo",
    "object-search",
)
"""Scenarios that together enter most modules: hands, doors, constraints, pushing, tools, trays, looking."""
HASHES = "sha256"
"""The file of hashes in a folder of traces, in the format of sha256sum."""
SHOWN = 160
"""Characters of a line that are printed around the first that differs."""
LONGEST = 3600
"""Seconds of wall clock after which a run is stopped; it counts as different."""

Traces = Mapping[str, Path]
"""Name of a run -> its trace; what the command printed stands there if it wrote none."""


def names_of(chosen: Sequence[Scenario], seeds: Sequence[int]) -> dict[str, tuple[Scenario, int]]:
    """Return the runs by the names of their traces."""
    return {
        f"{re.sub('[^a-z0-9]+', '_', one.name.lower())}-{seed}.jsonl": (one, seed) for one in chosen for seed in seeds
    }


def run(checkout: Path, scenario: Scenario, seed: int, trace: Path) -> None:
    """Run a scenario with the code of a checkout, in a folder of its own."""
    words = [*map(at_home, scenario.arguments), "--seed", str(seed), "--trace", str(trace), "--json"]
    environment = {**os.environ, "PYTHONPATH": str(checkout), "OPENBLAS_NUM_THREADS": "1", "PYTHONHASHSEED": "random"}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    command = [sys.executable, "-m", "executive", "run", *words]
    with tempfile.TemporaryDirectory() as folder:
        try:
            done = subprocess.run(
                command, cwd=folder, env=environment, capture_output=True, text=True, check=False, timeout=LONGEST
            )
            said = f"exit code {done.returncode}\n{done.stdout}{done.stderr}"
        except subprocess.TimeoutExpired:
            said = f"stopped after {LONGEST} s\n"
            trace.unlink(missing_ok=True)  # how far it came says nothing
    if not trace.exists():
        trace.write_text(said, encoding="utf-8")
    text = trace.read_text(encoding="utf-8")
    for file in sorted((checkout / "ontologies").rglob("*.omn")):
        text = text.replace(hashlib.sha256(file.read_bytes()).hexdigest(), str(file.relative_to(checkout)))
    trace.write_text(text, encoding="utf-8")


def traces_of(
    checkout: Path, runs: Mapping[str, tuple[Scenario, int]], folder: Path, pool: ThreadPoolExecutor
) -> Traces:
    """Run scenarios into a folder, and write the hashes of their traces beside them."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in runs:
        (folder / name).unlink(missing_ok=True)
    started = {name: pool.submit(run, checkout, *one, folder / name) for name, one in runs.items()}
    rows = []
    for name, one in started.items():
        one.result()
        rows.append(f"{hashlib.sha256((folder / name).read_bytes()).hexdigest()}  {name}")
        print(f"{checkout.name}  {rows[-1]}", file=sys.stderr, flush=True)
    (folder / HASHES).write_text("\n".join(rows) + "\n", encoding="utf-8")
    return {name: folder / name for name in runs}


def differences(before: Traces, after: Traces, *, but_schema: bool) -> Iterator[tuple[str, str]]:
    """Yield the runs whose traces differ, each with the first line that does, as it was and as it is."""
    for name in before:
        old, new = (one[name].read_text(encoding="utf-8", errors="replace") for one in (before, after))
        if but_schema and old != new:
            old, new = without_schema(old, new)
        if old != new:
            yield name, first_difference(old, new)


def without_schema(old: str, new: str) -> tuple[str, str]:
    """Rewrite two traces so that they are equal if they differ only in what a schema decides, and in revisions."""
    before, after = ([_plain(json.loads(line)) for line in text.splitlines() if line[:1] == "{"] for text in (old, new))
    start: dict[tuple[str, str], Any] = {}
    for was, now in zip(before, after, strict=False):
        whole, told = was.get("left"), now.get("left")
        if not (isinstance(whole, dict) and isinstance(told, dict)):
            continue
        for part, table in whole.items():
            if isinstance(table, dict):
                told_of = told.setdefault(part, {})
                # what is not told is as it was at the start, so that it is the same wherever it is not told
                missing = {key: start.setdefault((part, key), table[key]) for key in table if key not in told_of}
                told_of |= missing
            elif part not in told:
                told[part] = start.setdefault((part, ""), table)
    return "\n".join(map(_sorted, before)), "\n".join(map(_sorted, after))


_sorted = partial(json.dumps, sort_keys=True)


def _plain(record: dict[str, Any]) -> dict[str, Any]:
    """Leave out of a record what a schema or the count of changes decides."""
    if record.get("asked") == "revision":
        record.pop("value", None)
    if "resources" in record:
        record["resources"] = len(record["resources"])
    plain: dict[str, Any] = json.loads(json.dumps(record), object_hook=_without_revision)
    return plain


def _without_revision(entries: dict[str, Any]) -> dict[str, Any]:
    place = entries.get("where")
    if isinstance(place, list) and len(place) == 4:  # path, file, line and revision
        entries["where"] = place[:3]
    return {key: value for key, value in entries.items() if key not in ("schema", "revision")}


def first_difference(old: str, new: str) -> str:
    """Return the number of the first line that differs, and both lines around the first character that does."""
    lines = list(zip_longest(old.splitlines(), new.splitlines(), fillvalue="(the trace ends here)"))
    numbers = [number for number, (was, now) in enumerate(lines) if was != now]
    was, now = lines[numbers[0]]
    place = next((place for place, (one, other) in enumerate(zip(was, now, strict=False)) if one != other), len(was))
    start = max(0, place - SHOWN // 2)
    cut = "..." if start else ""
    before, after = (f"{cut}{one[start : start + SHOWN]}" for one in (was, now))
    count = f"{len(numbers)} of {len(lines)} lines differ, the first is {numbers[0] + 1}, at character {place + 1}"
    return f"{count}\n    before: {before}\n    after:  {after}"


def chosen_of(given: argparse.Namespace) -> list[Scenario]:
    """Return the scenarios that are asked for."""
    known = scenarios()
    if given.short:
        return [known[name] for name in SHORT]
    return [one for one in known.values() if not given.names or any(word in one.name for word in given.names)]


def main(words: Sequence[str] | None = None) -> int:
    """Run, save and compare what was asked for."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("names", nargs="*", help="parts of names of scenarios (default: all)")
    parser.add_argument("--but-schema", action="store_true", help="ignore schema, resources and revision numbers")
    parser.add_argument("--short", action="store_true", help=f"{len(SHORT)} scenarios")
    parser.add_argument("--seeds", default="0", help="seeds, with commas between them (default: 0)")
    parser.add_argument("--checkout", type=Path, action="append", help="one, or two to compare (default: this)")
    parser.add_argument("--against", type=Path, metavar="FOLDER", help="compare with the traces that were saved there")
    parser.add_argument("--save", type=Path, metavar="FOLDER", help="keep the traces of the last checkout")
    parser.add_argument("--jobs", type=int, default=2, help="runs at a time (default: 2)")
    given = parser.parse_args(words)
    checkouts = [one.resolve() for one in given.checkout or [TOP]]
    if len(checkouts) + (given.against is not None) > 2:
        parser.error("two are compared: name two checkouts, or one with --against")
    runs = names_of(chosen_of(given), [int(seed) for seed in given.seeds.split(",")])
    with tempfile.TemporaryDirectory() as scratch, ThreadPoolExecutor(given.jobs) as pool:
        columns: list[Traces] = []
        if given.against is not None:
            missing = [name for name in runs if not (given.against / name).is_file()]
            if missing:
                parser.error(f"{given.against} has no {missing[0]}; save it with the same names and seeds")
            columns.append({name: given.against / name for name in runs})
        for number, checkout in enumerate(checkouts):
            is_last = checkout is checkouts[-1]
            folder = given.save if given.save is not None and is_last else Path(scratch, str(number))
            columns.append(traces_of(checkout, runs, folder.resolve(), pool))
        if len(columns) == 1:
            return 0
        found = list(differences(*columns, but_schema=given.but_schema))
        for name, where in found:
            print(f"{name}: {where}")
        print(f"{len(runs) - len(found)} of {len(runs)} traces are equal")
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main())
