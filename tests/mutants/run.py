"""Breaks the kernel in many small ways and shows that the tests notice each.

    python tests/mutants/run.py            every mutant, about two minutes
    python tests/mutants/run.py --short    the first ones only
    python tests/mutants/run.py 3 7        these

Each mutant is a copy of the source, in a temporary folder, in which one line differs; the tests run against the copy
until one fails. Exit 1 when a mutant survives, or when its line is no longer there.
"""

# ruff: noqa: E501, T201 - lines of source as they are, and a report

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
LANGUAGE = "tests/planlang/language"
# what catches most comes first; tests against the wall clock are left out: they may fail for other reasons
TESTS = [
    f"{LANGUAGE}/test_cram_constructs.py",
    f"{LANGUAGE}/test_cram_task_trees.py",
    f"{LANGUAGE}/test_reference_machine.py",
    f"{LANGUAGE}/test_law.py",
    "tests/planlang/kernel/test_fluents.py",
    "tests/planlang/kernel/test_evaporation.py",
    "tests/planlang/kernel/test_endings.py",
    "tests/planlang/kernel/test_time.py",
    "tests/planlang/kernel/test_determinism.py",
    "tests/planlang/kernel/test_trace.py",
    f"{LANGUAGE}/test_parallel.py",
    f"{LANGUAGE}/test_partial_order.py",
    f"{LANGUAGE}/test_performing.py",
    f"{LANGUAGE}/test_recovery.py",
]
SHORT = 4

# what is broken, file below planlang/, a text that stands there once, what replaces it
MUTANTS = [
    ("the last in the run queue goes first", "kernel/rounds.py", "queue.popleft()", "queue.pop()"),
    ("the less deeply nested decide first", "kernel/scheduler.py", "(-group.depth, group", "(group.depth, group"),
    ("a wait that becomes true wakes nobody", "kernel/fluent.py", "self.scheduler.wake(task, value)", "pass"),
    ("an ended wait goes on listening", "kernel/fluent.py", "            source.unwatch(wait)", "            pass"),
    ("timers of held tasks go on", "kernel/suspension.py", "timer.freeze()", "pass"),
    ("a wait is not looked at again after waking up", "kernel/suspension.py", "task.wait.recheck()", "pass"),
    ("suspension is no count", "kernel/suspension.py", "    task.count -= 1\n", "    task.count = 0\n"),
    ("waking up forgets those woken meanwhile", "kernel/suspension.py", "        if not task.in_queue:\n            scheduler.enqueue(task)\n    elif", "        pass\n    elif"),
    ("evaporating a held task leaves it held", "kernel/suspension.py", "    task.holds = task.count = 0\n    if task.woken", "    if task.woken"),
    ("evaporation goes to parents only", "kernel/evaporation.py", "stack.extend(reversed(scope.live))", "pass"),
    ("siblings are evaporated last first", "kernel/scope.py", "for task in tuple(self.live):", "for task in reversed(tuple(self.live)):"),
    ("a created task still begins when evaporated", "kernel/evaporation.py", "if not task.begun:", "if False:"),
    ("shields protect from nothing", "kernel/evaporation.py", "if task.shields and not through_shields:", "if False:"),
    ("a shield never ends", "kernel/evaporation.py", "self._task.shields -= 1", "pass"),
    ("a shield's timer goes on after it", "kernel/evaporation.py", "self._timer.drop()", "pass"),
    ("evaporation is delivered once only", "kernel/park.py", "    if task.doomed:\n        await deliver(task)\n    scheduler.wake(task)", "    scheduler.wake(task)"),
    ("one that swallows evaporation has succeeded", "kernel/turn.py", "if task.thrown or task.generators", "if task.generators"),
    ("the order of dying is the order of deciding", "kernel/scope.py", "dead.sort(key=_index)", "pass"),
    ("errors in branches are swallowed", "kernel/scope.py", "if task.crash is not None:", "if False:"),
    ("failures of cleanups are forgotten", "kernel/scope.py", "self.cleanup.append(task.cleanup_failure)", "pass"),
    ("a construct does not wait for its branches", "kernel/scope.py", "        if not self.live:\n            self.over", "        if self.over or not self.live:\n            self.over"),
    ("deadlines fire in any depth at once", "kernel/timers.py", "if entry[2].task.depth == deepest:", "if True:"),
    ("deadlines are alarms", "kernel/timers.py", "queue.deadlines if self.deadline else queue.alarms", "queue.alarms"),
    ("a dropped timer fires", "kernel/timers.py", "        if self.due is not None:\n            self.due = None\n            self.queue.forget()\n\n    @property", "    @property"),
    ("later nodes of one name get no number", "kernel/task.py", "self.ordinal = counts[name] = counts[name] + 1", "pass"),
    ("all tasks draw from one stream", "kernel/primitives.py", 'Random(f"{scheduler.seed} {task.path}")', "Random(scheduler.seed)"),
    ("a step starts when one predecessor is done", "language/ordering.py", "if not left:\n                    heapq", "if True:\n                    heapq"),
    ("a limit is one too many", "language/ordering.py", "len(live) < limit", "len(live) <= limit"),
    ("success beats failure in pursue", "language/parallel.py", "        if failed:\n            self.failed = failed[0]", "        if failed and len(failed) == len(dead):\n            self.failed = failed[0]"),
    ("try_in_order goes on after a success", "language/sequence.py", "                    return node.result\n", "                    pass\n"),
    ("a timeout strikes before the step is at rest", "language/bounds.py", "self.scheduler.deadline(self.owner, self.steps, self.expire)", "self.scheduler.alarm(self.owner, self.steps, self.expire)"),
    ("resources stay taken", "language/resources.py", "            lock.holder = None", "            pass"),
]  # fmt: skip


UNBROKEN = ("nothing", "__init__.py", "", "")


def caught(mutant: tuple[str, str, str, str]) -> tuple[bool, str]:
    """Whether a mutant is caught, and what tells."""
    _, name, before, after = mutant
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder)
        for part in ("planlang", "executive", "sim", "tests/planlang", "tests/support", "ontologies", "recipes"):
            shutil.copytree(ROOT / part, copy / part, ignore=shutil.ignore_patterns("__pycache__"))
        for part in ("pyproject.toml", "tests/conftest.py"):
            shutil.copy(ROOT / part, copy / part)
        path = copy / "planlang" / name
        source = path.read_text()
        if mutant is not UNBROKEN and source.count(before) != 1:
            return False, f"its text stands {source.count(before)} times in {name}"
        path.write_text(source.replace(before, after) if before else source)
        environment = dict(os.environ, PYTHONPATH=folder, PLANLANG_EXAMPLES="1000", PYTHONDONTWRITEBYTECODE="1")
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "-k", "not ctrl_c", *TESTS]
        try:
            ended = subprocess.run(command, cwd=copy, env=environment, capture_output=True, text=True, timeout=120)
        except subprocess.TimeoutExpired:
            return True, "a test that does not end"
        failed = [line for line in ended.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
        if ended.returncode == 1 and failed:
            return True, failed[0].split(" - ")[0].rpartition("::")[2]
        return ended.returncode < 0, f"pytest ended with {ended.returncode}"  # a crash tells; a file not found does not


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("numbers", nargs="*", type=int)
    parser.add_argument("--short", action="store_true")
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    chosen = options.numbers or range(SHORT if options.short else len(MUTANTS))
    begin = time.monotonic()
    survived = 0
    with ThreadPoolExecutor(options.jobs) as pool:
        control = pool.submit(caught, UNBROKEN)
        for number, (good, why) in zip(chosen, pool.map(caught, [MUTANTS[one] for one in chosen]), strict=True):
            survived += not good
            print(f"{number:2} {'caught  ' if good else 'SURVIVED'} {MUTANTS[number][0]}: {why}", flush=True)
    noticed, why = control.result()
    if noticed or not why.endswith(" 0"):
        sys.exit(f"the unbroken kernel does not pass: {why}")
    print(f"{len(chosen) - survived} of {len(chosen)} mutants caught in {time.monotonic() - begin:.0f} s")
    sys.exit(1 if survived else 0)


if __name__ == "__main__":
    main()
