"""Measure how plans end when things go wrong: each kind of fault by name, and a drink that is served at several rates.

    python -m tests.benchmarks.faults --kinds 50 --rates 300 --out faults.jsonl   the whole, some hours on two cores
    python -m tests.benchmarks.faults --kinds 2 --only door:stuck,arm:stalls      some kinds
    python -m tests.benchmarks.faults --out faults.jsonl --docs                   writes docs/reference/faults.md

Each kind that a robot can make good is stated once in a run of a bundled task in which it can happen. Worlds have seeds
from a hash of the commit, so that nobody has looked at them before. A run is *reached* if its goals hold in the true
world; it is a *false success* if the plan says done and they do not. It has *recovered* if it is reached and the fault
happened. A failure *names* the fault if a class that the kind shows in is in its chain. A fault is *noticed* with the
first failure, change of belief or recovery after it; of what is shown by the camera the time includes that until the
next look. The exit code is 1 if there is a false success.
"""

from __future__ import annotations

import argparse
import hashlib
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import Any

from executive.processes.workers import Limits
from executive.runs.options import RunOptions
from executive.runs.plan_run import run_plan_file
from executive.sweeps import Row
from executive.sweeps import run as sweep
from planlang.faults.kinds import KINDS, Kind, kind_of
from planlang.faults.named import NamedFault
from planlang.proportions import wilson

JOB = "tests.benchmarks.faults:job"
LIMITS = Limits(seconds=300, memory=3_000_000_000, wall=1800.0)
PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference" / "faults.md"
BEGIN, END = "<!-- begin of the measurements -->\n", "<!-- end of the measurements -->"
SERVE = ("serve_a_drink", {"goal": ["bottle1 held by patient1"]})
FETCH = ("fetch_from_cabinet", {"goal": ["bottle1 held by robot", "cabinet_door1 closed"]})
TASKS: Mapping[str, tuple[str, Mapping[str, Any]]] = {"serve": SERVE, "fetch": FETCH}
OF_PART = {"handle": "fetch", "door": "fetch"}
"""Part -> the task in which its faults can happen, other than serving a drink."""
OF_WHAT = {"thing:moves": "thing.bottle1:moves", "camera:overlooks": "camera:overlooks=DrinkingBottle"}
"""Kind -> how it is stated, if not only by its name: so that it concerns the task."""
NO_TASK = ("device", "step")
"""Parts that no bundled task has."""
RATES = (0.0, 0.1, 0.2)
SIGNS = ("belief", "recovery", "pose failed")
"""Records of a trace that show that something was noticed, beside ends with a failure."""


def job(world: Mapping[str, Any]) -> Row:
    """Run a task in a world in which something goes wrong; return its row."""
    recipe, more = TASKS[world["task"]]
    settings = {"seed": world["seed"], "robot": world["robot"], "fault": world["faults"] or None, **more}
    bare, rate = world["bare"], world["rate"] or None
    result = run_plan_file(RunOptions(recipe=recipe, no_recoveries=bare, fault_rate=rate, **settings))
    fired = () if result.faults is None else result.faults.fired
    return {
        "outcome": result.outcome.value,
        "claimed": result.claimed,
        "reached": result.reached,
        "failure": list(result.failures),
        "message": result.message[:500],
        "fired": [one["kind"] for one in fired],
        "noticed": [noticed(result.trace, one["time"]) for one in fired],
        "duration": result.duration,
    }


def noticed(trace: Iterable[Mapping[str, Any]], time: float) -> float | None:
    """Time from a fault until something shows that it was noticed [s]; None if nothing does."""
    rate = 0.0
    for record in trace:
        rate = record.get("rate", rate) if record["event"] == "header" else rate
        is_failed = record["event"] == "ended" and bool(record.get("failure"))
        if record["step"] >= round(time * rate) and (is_failed or record["event"] in SIGNS):
            return round(abs(record["step"] / rate - time), 2)
    return None


def seeds(commit: str, what: str, number: int) -> list[int]:
    """Seeds of worlds, by a hash of the commit: nobody has looked at them before."""
    texts = (f"{commit} {what} {place}" for place in range(number))
    return [1 + int.from_bytes(hashlib.sha256(text.encode()).digest()[:4], "big") % 1_000_000 for text in texts]


def worlds_of_kinds(commit: str, number: int, only: Sequence[str], robot: str) -> list[dict[str, Any]]:
    """Worlds with one stated fault each."""
    kinds = [one for one in KINDS if one.recovers and one.part not in NO_TASK and (not only or str(one) in only)]
    return [
        {
            "world": f"{one} {robot} {seed}",
            "task": OF_PART.get(one.part, "serve"),
            "robot": robot,
            "seed": seed,
            "faults": [str(NamedFault.read(OF_WHAT.get(str(one), str(one))))],
            "rate": 0.0,
            "bare": False,
        }
        for one in kinds
        for seed in seeds(commit, str(one), number)
    ]


def worlds_of_rates(commit: str, number: int, robot: str) -> list[dict[str, Any]]:
    """Worlds with faults by chance, each with recoveries and without: the same worlds and faults."""
    return [
        {
            "world": f"rate {rate:g} {'bare' if bare else 'whole'} {robot} {seed}",
            "task": "serve",
            "robot": robot,
            "seed": seed,
            "faults": [],
            "rate": rate,
            "bare": bare,
        }
        for rate in RATES
        for bare in (False, True)
        for seed in seeds(commit, "rates", number)
    ]


def share(good: int, total: int) -> str:
    """A share with its interval."""
    if not total:
        return "-"
    low, high = wilson(good, total)
    return f"{good} of {total} ({100 * low:.0f} to {100 * high:.0f} %)"


def is_false(row: Row) -> bool:
    """Check whether a plan says done in a world in which its goals do not hold."""
    return bool(row.get("claimed")) and not row.get("reached")


def is_mute(row: Row) -> bool:
    """Check whether a run ended without a statement: neither done nor a failure of the plan."""
    return not row.get("claimed") and not row.get("failure")


def row_of_kind(kind: Kind, rows: Sequence[Row]) -> str:
    """The line of a kind in the table."""
    fired = [row for row in rows if row.get("fired")]
    failed = [row for row in fired if not row.get("reached")]
    named = sum(bool(set(kind.shows) & set(row.get("failure", ()))) for row in failed)
    times = [row["noticed"][0] for row in fired if row["noticed"][0] is not None]
    soon = sum(time <= 1.0 for time in times)
    cells = (
        f"`{kind}`",
        str(rows[0]["task"]) if rows and "task" in rows[0] else OF_PART.get(kind.part, "serve"),
        f"{len(fired)} of {len(rows)}",
        share(sum(bool(row.get("reached")) for row in fired), len(fired)),
        f"{median(times):.1f} s" if times else "-",
        f"{soon} of {len(fired)}",
        share(named, len(failed)),
        str(sum(map(is_false, rows))),
        str(sum(map(is_mute, rows))),
    )
    return f"| {' | '.join(cells)} |"


def table_of_kinds(rows: Sequence[Row]) -> str:
    """The table of kinds, in Markdown."""
    groups = defaultdict[str, list[Row]](list)
    for row in rows:
        groups[str(row["world"]).split()[0]].append(row)
    head = "| Fault | task | happened | recovered | noticed after | within 1 s | named | false successes | mute |"
    found = {name: (kind_of(*name.split(":")), some) for name, some in groups.items()}
    lines = [row_of_kind(kind, some) for kind, some in found.values() if kind is not None]
    fired = [row for row in rows if row.get("fired")]
    good = share(sum(bool(row.get("reached")) for row in fired), len(fired))
    return "\n".join([head, f"|{9 * '---|'}", *lines, "", f"Recovered over all kinds: {good}."])


def table_of_rates(rows: Sequence[Row]) -> str:
    """The table of rates, in Markdown."""
    lines = ["| Rate | recoveries | served | faults a run | false successes | mute |", f"|{6 * '---|'}"]
    groups = defaultdict[tuple[str, str], list[Row]](list)
    for row in rows:
        _, rate, which, *_ = str(row["world"]).split()
        groups[rate, which].append(row)
    for (rate, which), some in groups.items():
        served = share(sum(bool(row.get("reached")) for row in some), len(some))
        often = sum(len(row.get("fired", ())) for row in some) / len(some)
        false, mute = sum(map(is_false, some)), sum(map(is_mute, some))
        lines.append(f"| {rate} | {'no' if which == 'bare' else 'yes'} | {served} | {often:.2f} | {false} | {mute} |")
    return "\n".join(lines)


def commit_of_this() -> str:
    """The commit that is checked out."""
    here = Path(__file__).parent
    return subprocess.run(
        ["git", "rev-parse", "HEAD"], cwd=here, check=True, capture_output=True, text=True
    ).stdout.strip()


def main(words: Sequence[str] | None = None) -> int:
    """Measure, and print the tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--kinds", type=int, default=3, help="worlds for each kind (default: 3)")
    parser.add_argument("--rates", type=int, default=0, help="worlds for each rate, each run twice (default: none)")
    parser.add_argument("--only", default="", help="kinds, separated by commas (default: all)")
    parser.add_argument("--robot", default="amigo")
    parser.add_argument("--commit", default=None, help="whose hash gives the seeds (default: what is checked out)")
    parser.add_argument("--jobs", type=int, default=None, help="processes; as many as cores by default")
    parser.add_argument("--out", type=Path, help="a file of rows, which is gone on with")
    parser.add_argument("--docs", action="store_true", help="write the tables to the page")
    given = parser.parse_args(words)
    commit = given.commit or commit_of_this()
    worlds = worlds_of_kinds(commit, given.kinds, [one for one in given.only.split(",") if one], given.robot)
    worlds += worlds_of_rates(commit, given.rates, given.robot)
    rows = sweep(worlds, JOB, processes=given.jobs, limits=LIMITS, out=given.out)
    of_rates = [row for row in rows if str(row["world"]).startswith("rate ")]
    of_kinds = [row for row in rows if row not in of_rates]
    parts = [f"Commit `{commit[:12]}`, {given.robot}."]
    parts += [table_of_kinds(of_kinds)] if of_kinds else []
    parts += [table_of_rates(of_rates)] if of_rates else []
    text = "\n\n".join(parts)
    print(text)
    for row in filter(is_false, rows):
        print(f"FALSE SUCCESS: {row['world']}: {row['message']}")
    if given.docs:
        page = PAGE.read_text(encoding="utf-8")
        before, _, rest = page.partition(BEGIN)
        PAGE.write_text(f"{before}{BEGIN}{text}\n{END}{rest.partition(END)[2]}", encoding="utf-8")
    return int(any(map(is_false, rows)))


if __name__ == "__main__":
    sys.exit(main())
