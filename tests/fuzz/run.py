"""Breaks real files in many ways; nothing but diagnostics may come of it.

    python tests/fuzz/run.py --seconds 1800          half an hour, on all cores
    python tests/fuzz/run.py --seconds 60 --seed 5   a minute of other cases
    python tests/fuzz/run.py --case 5:1234           one case again, by its seed and number
    python tests/fuzz/run.py --file finds/x.owl      a file that was found, again
    python tests/fuzz/run.py --cases 2000 --seed 3   attacks on all commands: files, arguments, environments, limits
    python tests/fuzz/run.py --case files:3:17       one of them again; --keep FOLDER keeps its files

Each case is a real file (the bundled ones, and the corpus where it is beside this checkout) whose bytes or triples
were changed, chosen by seed and number alone. Workers read, check, compile, draw and fix it with bounded memory and
time. A case that ends otherwise than in diagnostics is written to --finds: made as small as it gets, beside a JSON file
that says what came of it and which seed and number it has. Exit 1 when there was any.

``--cases`` attacks the commands instead (attacks.py): it counts exit 70 and other codes that are none of the command's,
signals, tracebacks, raw control characters, commands that compute for 20 s without a word, and more than 1.5 GB of
memory, and prints each cause once, with the case that shows it again.
"""

# ruff: noqa: T201 - it reports

from __future__ import annotations

import argparse
import hashlib
import importlib
import json
import os
import random
import re
import select
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
CORPUS = ROOT.parent / "shared" / "corpus"
KINDS = ("recipes", "environments", "objects", "robots", "ontologies")
LARGEST = 120_000
"""Bytes; larger files are not broken as a whole, but a part of this length."""

SECONDS = 300.0
"""For one case, by the clock; the worker itself ends what computes for too long, and says where."""

WARM = ("planlang_command", "executive.cli.app", "executive.cli.run", "executive.cli.show", "executive.cli.report",
        "executive.cli.enable", "executive.cli.search", "executive.cli.sweep", "executive.runs.plan_run", "sim.world",
        "planlang.compiler", "executive.robots.robot")  # fmt: skip
"""Modules imported once, before the processes of the attacks are forked."""

TRIES = 300
"""Runs that go into making a find smaller."""


@dataclass(frozen=True)
class Case:
    seed: int
    number: int
    kind: str
    source: str
    steps: tuple[str, ...]
    content: bytes


def sources() -> list[tuple[str, Path]]:
    """Kind and path of the files to break, sorted."""
    found = [("recipes", path) for path in sorted((ROOT / "recipes").glob("*.omn"))]
    for path in sorted((ROOT / "ontologies").rglob("*.omn")):
        found.append((path.parent.name if path.parent.name in KINDS else "ontologies", path))
    for kind in KINDS:
        found += ((kind, path) for path in sorted((CORPUS / kind).glob("*.owl*")))
    return found


def case_of(seed: int, number: int, files: list[tuple[str, Path]]) -> Case:
    """The case with this seed and number, whatever came before it."""
    from mutations import mutated

    draw = random.Random(f"{seed}:{number}")
    recipes = [one for one in files if one[0] == "recipes"]
    kind, path = draw.choice(recipes if draw.random() < 0.6 else files)
    other = draw.choice(files)[1].read_bytes()
    syntax = draw.choice(("ofn", "owx", None, None, None))
    content = path.read_bytes() if syntax is None else written(path, syntax)
    if len(content) > LARGEST:
        begin = draw.randrange(len(content) - LARGEST)
        head = content[: LARGEST // 2]
        content = head + content[begin : begin + LARGEST // 2]
    broken, steps = mutated(draw, content, other, path.name)
    return Case(seed, number, kind, path.name, steps, broken)


@cache
def written(path: Path, syntax: str) -> bytes:
    """A file in functional syntax (ofn) or OWL/XML (owx), as editors save it; unchanged if it cannot be written so."""
    import pyhornedowl

    from planlang.diagnostics import BadInput
    from planlang.ontology.convert import Target, convert

    try:
        text = convert(path, Target.FUNCTIONAL).text
        if syntax == "owx":
            text = pyhornedowl.open_ontology_from_string(text, "ofn").save_to_string("owx")
    except (BadInput, ValueError):
        return path.read_bytes()
    return text.encode()


class Worker:
    """A process that takes cases; it is started anew when it dies or hangs."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / "case.owl"
        self.peak = 0
        self.slowest = 0.0
        self._process: subprocess.Popen[str] | None = None
        self._cache = folder / "cache"

    def _start(self) -> subprocess.Popen[str]:
        environment = os.environ | {
            "PYTHONPATH": str(ROOT),
            "PYTHONHASHSEED": "0",
            "XDG_CACHE_HOME": str(self._cache),
        }
        return subprocess.Popen(
            [sys.executable, str(Path(__file__).parent / "worker.py")],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env=environment,
        )

    def problem_of(self, kind: str, content: bytes, seconds: float = SECONDS) -> str | None:
        """Return what came of a file besides diagnostics; None is good."""
        self.path.write_bytes(content)
        if self._process is None or self._process.poll() is not None:
            self._process = self._start()
        process = self._process
        assert process.stdin is not None
        assert process.stdout is not None
        began = time.perf_counter()
        process.stdin.write(json.dumps([kind, str(self.path)]) + "\n")
        process.stdin.flush()
        ready, _, _ = select.select([process.stdout], [], [], seconds)
        if not ready:
            self.close()
            return f"it took more than {seconds:.0f} seconds"
        line = process.stdout.readline()
        self.slowest = max(self.slowest, time.perf_counter() - began)
        if not line:
            code = process.wait()
            self._process = None
            return f"the process died with {code}"
        answer = json.loads(line)
        self.peak = max(self.peak, answer["megabytes"])
        problem: str | None = answer["problem"]
        return problem

    def close(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.communicate()
            self._process = None


def signature(problem: str) -> str:
    """Return what two finds have in common that have one cause: the exception and the place that raised it."""
    places = re.findall(r'File "[^"]*?([\w./-]+)", line (\d+), in (\S+)', problem)
    last = problem.strip().splitlines()[-1].partition(":")[0]
    return f"{last} in {places[-1][0].rpartition('/')[2]}:{places[-1][2]}" if places else last


def smaller(worker: Worker, case: Case, problem: str) -> bytes:
    """A smaller file with the same signature: ever smaller groups of lines, then of bytes, are left out."""
    if "TooLong" in problem or not problem.startswith("Traceback"):
        return case.content
    wanted, tries = signature(problem), TRIES
    content = case.content
    for split in (lambda text: text.splitlines(keepends=True), lambda text: [bytes((byte,)) for byte in text]):
        pieces: list[bytes] = split(content)
        size = max(len(pieces) // 2, 1)
        while size >= 1 and tries > 0:
            at = 0
            while at < len(pieces) and tries > 0:
                shorter = pieces[:at] + pieces[at + size :]
                tries -= 1
                found = worker.problem_of(case.kind, b"".join(shorter))
                if found is not None and signature(found) == wanted:
                    pieces[:] = shorter
                else:
                    at += size
            size //= 2
        content, tries = b"".join(pieces), TRIES
    return content


def keep(worker: Worker, case: Case, problem: str, finds: Path) -> Path:
    """Write a find down: the small file, and what is known of it."""
    finds.mkdir(parents=True, exist_ok=True)
    content = smaller(worker, case, problem)
    name = f"{signature(problem)}-{hashlib.sha256(content).hexdigest()[:8]}"
    path = finds / (re.sub(r"[^\w.-]+", "_", name) + ".owl")
    path.write_bytes(content)
    known = {
        "case": f"{case.seed}:{case.number}",
        "kind": case.kind,
        "source": case.source,
        "steps": case.steps,
        "problem": problem,
    }
    path.with_suffix(".json").write_text(json.dumps(known, indent=2) + "\n")
    return path


class Campaign:
    """Cases one after the other, shared among workers; a cause is written down once."""

    def __init__(self, seed: int, first: int, seconds: float, finds: Path) -> None:
        self.seed = seed
        self.next = first
        self.done = 0
        self.ends = time.monotonic() + seconds
        self.finds = finds
        self.found: dict[str, tuple[int, Path]] = {}
        self.peak, self.slowest = 0, 0.0
        self._files = sources()
        self._lock = threading.Lock()

    def work(self) -> None:
        """Run cases until the time is over."""
        with tempfile.TemporaryDirectory() as folder:
            worker = Worker(Path(folder))
            try:
                while time.monotonic() < self.ends:
                    with self._lock:
                        number = self.next
                        self.next += 1
                        case = case_of(self.seed, number, self._files)
                    problem = worker.problem_of(case.kind, case.content)
                    if problem is not None:
                        self._found(worker, case, problem)
                    with self._lock:
                        self.done += 1
                        self.peak = max(self.peak, worker.peak)
                        self.slowest = max(self.slowest, worker.slowest)
            finally:
                worker.close()

    def _found(self, worker: Worker, case: Case, problem: str) -> None:
        known = signature(problem)
        with self._lock:
            times, path = self.found.get(known, (0, Path()))
            self.found[known] = (times + 1, path)
        if times == 0:
            path = keep(worker, case, problem, self.finds)
            with self._lock:
                self.found[known] = (self.found[known][0], path)
            print(f"case {case.seed}:{case.number} ({case.source}, {', '.join(case.steps)}): {known}\n  {path}")
            sys.stdout.flush()


def again(kind: str, content: bytes) -> int:
    """Run one case and show what comes of it."""
    with tempfile.TemporaryDirectory() as folder:
        worker = Worker(Path(folder))
        problem = worker.problem_of(kind, content)
        worker.close()
    print(problem or "nothing but diagnostics")
    return 1 if problem else 0


def commands(options: argparse.Namespace) -> int:
    """Attack the commands; or repeat one case and show what it prints."""
    import attacks
    import sources as made

    for name in WARM:
        importlib.import_module(name)
    with tempfile.TemporaryDirectory(prefix="planlang-fuzz-", ignore_cleanup_errors=True) as folder:
        sources = Path(folder) / "sources"
        sources.mkdir()
        runner = attacks.Runner(sources, Path(folder))
        made.make(sources, runner.prepared)
        if options.case:
            part, seed, number = options.case.split(":")
            case = attacks.case_of(part, int(seed), int(number), sources)
            print(f"{case.line()}\n{', '.join(case.steps)}")
            if options.keep:
                shutil.copytree(runner.prepare(case), options.keep, symlinks=True, dirs_exist_ok=True)
            runner.start(case)
            outcome = runner.wait()
            print(f"{outcome.said}\n{outcome.problem or 'nothing'}, {outcome.seconds:.1f} s, {outcome.megabytes} MB")
            return 1 if outcome.problem else 0
        found: dict[str, int] = {}
        total, most = [0, 0.0], 0

        def tell(outcome: attacks.Outcome) -> None:
            nonlocal most
            total[0] += 1
            total[1] += outcome.seconds
            most = max(most, outcome.megabytes)
            if outcome.problem is None:
                return
            known = attacks.signature(outcome.case, outcome.problem)
            found[known] = found.get(known, 0) + 1
            if found[known] == 1:
                case = outcome.case
                print(f"{outcome.problem[:300]}\n    {case.line()}\n    {', '.join(case.steps)}")
                print(f"    again: python tests/fuzz/run.py --case {case.name}", flush=True)

        parts = tuple(options.parts.split(","))
        cases = attacks.drawn(options.seed, options.first, options.cases, parts, sources)
        attacks.attack(cases, runner, options.jobs, tell)
    print(f"{total[0]} attacks of seed {options.seed}, {len(found)} causes; {total[1]:.0f} s of computing, {most} MB")
    for known, times in sorted(found.items()):
        print(f"  {times} times {known}")
    return 1 if found else 0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--finds", type=Path, default=ROOT / "fuzz-finds")
    parser.add_argument("--case", help="SEED:NUMBER or PART:SEED:NUMBER, this case alone")
    parser.add_argument("--cases", type=int, help="attack the commands so many times")
    parser.add_argument("--parts", default="files,arguments,environments,limits", help="with --cases: only these")
    parser.add_argument("--keep", type=Path, help="with --case: keep its files in this folder")
    parser.add_argument("--file", type=Path, help="this file alone")
    parser.add_argument("--kind", choices=KINDS, default="recipes", help="what --file is")
    options = parser.parse_args()
    if options.cases or (options.case or "").count(":") == 2:
        return commands(options)
    if options.file:
        return again(options.kind, options.file.read_bytes())
    if options.case:
        seed, _, number = options.case.partition(":")
        case = case_of(int(seed), int(number), sources())
        print(f"{case.source}: {', '.join(case.steps)}, {len(case.content)} bytes")
        return again(case.kind, case.content)
    campaign = Campaign(options.seed, options.first, options.seconds, options.finds)
    threads = [threading.Thread(target=campaign.work) for _ in range(options.jobs)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    print(
        f"{campaign.done} cases of seed {options.seed} from number {options.first}, {len(campaign.found)} finds;"
        f" slowest {campaign.slowest:.1f} s, most memory {campaign.peak} MB"
    )
    for known, (times, path) in sorted(campaign.found.items()):
        print(f"  {times} times {known}: {path}")
    return 1 if campaign.found else 0


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))
    sys.exit(main())
