"""Kill runs again and again, resume them, and count what happened outside of them.

    python tests/benchmarks/kills.py                three recipes, killed 20 times each
    python tests/benchmarks/kills.py --kills 5 --recipes serve_a_drink
    python tests/benchmarks/kills.py --kills 40 --recipes serve_a_drink --fault-rate 0.2 --seed 4

Beside the recipe a plan asks something outside in a thread, and lets a process module do something there that must not
happen twice. The run is killed (kill -9) when its trace has so many records, resumed, and killed again later. In the
end its trace has to be that of a run that was not killed, and everything outside has to have happened once; what was
under way there when the run was killed is said to be done again (X030), and may have happened twice.
"""

from __future__ import annotations

import argparse
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from planlang.runs import RecordedRun, Repetition

RECIPES = ("serve_a_drink", "fetch_from_cabinet", "pass_a_drink")
PLAN = '''

from pathlib import Path

from planlang import in_thread, par, pursue, sleep


def outside(what):
    """Do something that must not happen twice."""
    with (Path(__file__).parent / "outside.txt").open("a") as file:
        file.write(what + "\\n")
    return what


async def meanwhile():
    """Do something outside every five seconds."""
    number = 0
    while True:
        number += 1
        await in_thread(outside, f"step {number}")
        await perform(action("Reporting", amount=number))
        await sleep(5.0)


@plan
async def counted():
    """Perform the recipe while things happen outside."""
    await pursue(NAME, meanwhile)
'''
MODULE = '''"""Reports, outside of the run."""

from pathlib import Path

from planlang import sleep
from planlang import process_module


@process_module
class Reporting:
    """Writes a line to a file."""

    name, actions, failures, once = "reporting", ("Reporting",), (), True

    def __init__(self, platform):
        pass

    def resources(self, action):
        return ()

    async def execute(self, action):
        await sleep(0.5)
        with (Path(__file__).parent / "outside.txt").open("a") as file:
            file.write(f"module {action.get('amount'):g}\\n")
        await sleep(0.5)
'''


@dataclass
class Killed:
    """A recipe whose run was killed several times."""

    recipe: str
    folder: Path
    options: tuple[str, ...] = ()
    """Further options of the run: its world, and what goes wrong in it."""
    kills: int = 0
    whole: float = 0.0
    """Wall time of the run that was not killed [s]."""
    last: float = 0.0
    """Wall time of the last resumption, which repeats nearly all of it [s]."""
    under_way: int = 0
    """What was under way outside in the moments of the kills."""
    problems: list[str] = field(default_factory=list)

    def command(self, *arguments: str) -> list[str]:
        """Return how planlang runs the plan."""
        start = [sys.executable, "-m", "executive", "run", str(self.folder / "plan.py")]
        modules = ("--modules", str(self.folder / "module.py"))
        return [*start, *modules, *OPTIONS[self.recipe], *self.options, *arguments]

    def write(self) -> None:
        """Write plan and module."""
        compiled = subprocess.run(
            [sys.executable, "-m", "executive", "compile", self.recipe], check=True, capture_output=True, text=True
        ).stdout
        (self.folder / "plan.py").write_text(compiled + PLAN.replace("NAME", self.recipe))
        (self.folder / "module.py").write_text(MODULE)

    def run(self, kills: int) -> None:
        """Run it whole, then kill it so many times, and compare."""
        outside = self.folder / "outside.txt"
        begun = time.perf_counter()
        whole = self.folder / "whole.jsonl"
        first = subprocess.run(self.command("--trace", str(whole)), check=False, capture_output=True, text=True)
        if first.returncode not in (0, 1):  # with faults a plan may fail: it has to do so in the same way again
            raise SystemExit(first.stdout + first.stderr)
        self.whole = time.perf_counter() - begun
        records, done = without_marks(whole), sorted(outside.read_text().splitlines())
        outside.unlink()
        trace = self.folder / "run.jsonl"
        for number in range(kills):
            arguments = ("--resume", str(trace)) if trace.exists() else ("--trace", str(trace))
            self.killed_at(arguments, trace, (number + 1) * len(records) // (kills + 1))
            self.under_way += under_way(trace)
        begun = time.perf_counter()
        ended = subprocess.run(self.command("--resume", str(trace)), capture_output=True, text=True, check=False)
        self.last = time.perf_counter() - begun
        if ended.returncode != first.returncode:
            self.problems.append(ended.stdout + ended.stderr)
        if without_marks(trace) != records:
            self.problems.append("its trace differs from that of the run that was not killed")
        found = Counter(outside.read_text().splitlines())
        if sorted(found) != done or found.total() - len(done) > self.under_way:
            twice = sorted(one for one, times in found.items() if times > 1)
            self.problems.append(f"not once outside: {', '.join(twice) or 'something is missing'}")

    def killed_at(self, arguments: tuple[str, ...], trace: Path, records: int) -> None:
        """Begin, and kill it when so many records are written."""
        process = subprocess.Popen(self.command(*arguments), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        while process.poll() is None and lines_in(trace) < records:
            time.sleep(0.002)
        if process.poll() is None:
            process.send_signal(signal.SIGKILL)
            self.kills += 1
        process.wait()


OPTIONS: dict[str, tuple[str, ...]] = {
    "serve_a_drink": ("--robot", "amigo", "--environment", "hospital_room"),
    "fetch_from_cabinet": ("--robot", "amigo", "--environment", "kitchenette"),
    "pass_a_drink": ("--robot", "amigo", "--environment", "dining_room"),
}


def lines_in(path: Path) -> int:
    """Count the records of a trace; 0 if it is not there."""
    try:
        return path.read_bytes().count(b"\n")
    except FileNotFoundError:
        return 0


def without_marks(path: Path) -> list[str]:
    """Return the records of a trace, without those that say where it was resumed."""
    return [line for line in path.read_text().splitlines() if '"event": "resumed"' not in line]


def under_way(path: Path) -> int:
    """Count what was under way outside when a run was killed."""
    return len(Repetition(RecordedRun.read(path)).in_flight) if path.exists() else 0


def main() -> int:
    """Print a line for each recipe; 1 if something is not as it has to be."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--recipes", default=",".join(RECIPES))
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--fault-rate", default="0", help="probability of a fault at each opportunity (default: 0)")
    parser.add_argument("--seed", default="0", help="seed of the world, and of its faults (default: 0)")
    arguments = parser.parse_args()
    failed = False
    for recipe in arguments.recipes.split(","):
        with tempfile.TemporaryDirectory() as folder:
            one = Killed(recipe, Path(folder), ("--seed", arguments.seed, "--fault-rate", arguments.fault_rate))
            one.write()
            one.run(arguments.kills)
        said = "; ".join(one.problems) or f"same trace, each once outside ({one.under_way} under way at a kill)"
        print(
            f"{recipe:20} killed {one.kills:2} times: {said}; run {one.whole:.1f} s, last resumption {one.last:.1f} s "
            f"({one.last / one.whole:.2f})",
            flush=True,
        )
        failed = failed or bool(one.problems)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
