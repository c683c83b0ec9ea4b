"""Breaks the kernel in many small ways and shows that the tests notice each.

    python tests/mutants/run.py            every mutant, about a quarter of an hour of computing
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
import signal
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
    "tests/planlang/kernel/test_fluents.py",
    "tests/planlang/kernel/test_cancel.py",
    "tests/planlang/kernel/test_shutdown.py",
    "tests/planlang/kernel/test_schedule.py",
    "tests/planlang/runs/test_trace.py",
    f"{LANGUAGE}/test_parallel.py",
    f"{LANGUAGE}/test_partial_order.py",
    f"{LANGUAGE}/test_performing.py",
    f"{LANGUAGE}/test_recovery.py",
    f"{LANGUAGE}/test_suspension_details.py",
    f"{LANGUAGE}/test_goals_and_strategies.py",
]
FIRST = {  # these before them, where one of these files is broken
    "language/conditions.py": f"{LANGUAGE}/test_policies.py",
    "language/budgets.py": f"{LANGUAGE}/test_budget.py",
    "language/state_machine.py": f"{LANGUAGE}/test_partial_order.py",
    "language/resources.py": f"{LANGUAGE}/test_performing.py",
    "language/recovery.py": f"{LANGUAGE}/test_recovery.py",
    "language/plans.py": f"{LANGUAGE}/test_suspension_details.py",
    "kernel/scope.py": "tests/planlang/kernel/test_cancel.py",
    "kernel/schedule.py": "tests/planlang/kernel/test_schedule.py",
    "kernel/signals.py": "tests/planlang/kernel/test_fluents.py",
    "kernel/fluent.py": "tests/planlang/kernel/test_fluents.py",
    "kernel/runner.py": f"tests/planlang/kernel/test_bad_plans.py {LANGUAGE}/test_failures.py",
    "runs/trace.py": "tests/planlang/runs/test_trace.py",
    "kernel/cancel.py": "tests/planlang/kernel/test_cancel.py",
    "kernel/threads.py": "tests/planlang/kernel/test_in_thread.py",
    "runs/journal.py": f"{LANGUAGE}/test_resumption.py {LANGUAGE}/test_resumed_state.py",
    "runs/recorded_run.py": f"{LANGUAGE}/test_resumption.py {LANGUAGE}/test_resumed_state.py",
    "runs/codec.py": f"{LANGUAGE}/test_resumption.py {LANGUAGE}/test_resumed_state.py",
    "runs/replay_check.py": f"{LANGUAGE}/test_replays.py {LANGUAGE}/test_order_of_replays.py",
}
SHORT = 4
CPU_TIME = 300
"""After so many seconds of computing a test does not end, however busy the machine is with other things."""
IDLE = 1500
"""After so many seconds on the clock it waits for what never comes."""
ENDLESS = "a test that does not end"

# what is broken, file below planlang/, a text that stands there once, what replaces it
MUTANTS = [
    ("the last in the run queue goes first", "kernel/event_loop.py", "queue.popleft()", "queue.pop()"),
    ("the less deeply nested decide first", "kernel/core.py", "(-self.depth, self.birth", "(self.depth, self.birth"),
    ("a wait that becomes true wakes nobody", "kernel/fluent.py", "self.scheduler.wake(task, value)", "pass"),
    ("an ended wait goes on listening", "kernel/fluent.py", "            source.unwatch(wait)", "            pass"),
    ("timers of held tasks go on", "kernel/cancel.py", "timer.freeze()", "pass"),
    ("a wait is not looked at again after waking up", "kernel/cancel.py", "task.wait.recheck()", "pass"),
    ("suspension is no count", "kernel/cancel.py", "    task.count -= 1\n", "    task.count = 0\n"),
    ("waking up forgets those woken meanwhile", "kernel/cancel.py", "        if not task.in_queue:\n            scheduler.enqueue(task)\n    # What it waits", "        pass\n    # What it waits"),
    ("evaporating a held task leaves it held", "kernel/cancel.py", "    task.holds = task.count = 0\n    if task.woken", "    if task.woken"),
    ("evaporation goes to parents only", "kernel/cancel.py", "stack.extend(reversed(scope.live))", "pass"),
    ("siblings are evaporated last first", "kernel/scope.py", "for task in tuple(self.live):", "for task in reversed(tuple(self.live)):"),
    ("a created task still begins when evaporated", "kernel/cancel.py", "if not task.begun:", "if False:"),
    ("shields protect from nothing", "kernel/cancel.py", "if (task.shields or task.doomed) and not through_shields:", "if task.doomed and not through_shields:"),
    ("a shield never ends", "kernel/cancel.py", "self._task.shields -= 1", "pass"),
    ("a shield's timer goes on after it", "kernel/cancel.py", "self._timers.pop().drop()", "pass"),
    ("evaporation is delivered once only", "kernel/cancel.py", "    if task.doomed:\n        await deliver(task)\n    scheduler.wake(task)", "    scheduler.wake(task)"),
    ("one that swallows evaporation has succeeded", "kernel/event_loop.py", "if task.thrown or task.generators", "if task.generators"),
    ("the order of dying is the order of deciding", "kernel/scope.py", "dead.sort(key=_index)", "pass"),
    ("errors in branches are swallowed", "kernel/scope.py", "if task.crash is None:", "if True:"),
    ("failures of cleanups are forgotten", "kernel/scope.py", "self.cleanup += task.cleanup_failures or ()", "pass"),
    ("a construct does not wait for its branches", "kernel/scope.py", "        if not self.live:\n            self.over", "        if self.over or not self.live:\n            self.over"),
    ("deadlines fire in any depth at once", "kernel/hosts.py", "if entry[2].task.depth == deepest:", "if True:"),
    ("deadlines are alarms", "kernel/hosts.py", "queue.deadlines if self.deadline else queue.alarms", "queue.alarms"),
    ("a dropped timer fires", "kernel/hosts.py", "        if self.due is not None:\n            self.due = None\n            self.queue.forget()\n\n    @property", "    @property"),
    ("later nodes of one name get no number", "kernel/core.py", "self.ordinal = counts[name] = counts[name] + 1", "pass"),
    ("all tasks draw from one stream", "kernel/primitives.py", 'CountedRandom(f"{scheduler.seed} {task.path}")', "CountedRandom(str(scheduler.seed))"),
    ("a step starts when one predecessor is done", "language/ordering.py", "if not left:\n                    heapq", "if True:\n                    heapq"),
    ("a limit is one too many", "language/ordering.py", "len(live) < limit", "len(live) <= limit"),
    ("success beats failure in pursue", "language/branches.py", "        if failed:\n            self.fail(failed)", "        if failed and len(failed) == len(dead):\n            self.fail(failed)"),
    ("try_in_order goes on after a success", "language/branches.py", "            return await in_node(attempt,", "            await in_node(attempt,"),
    ("a timeout strikes before the step is at rest", "language/budgets.py", "self.scheduler.deadline(self.owner, self.steps, self.expire)", "self.scheduler.alarm(self.owner, self.steps, self.expire)"),
    ("resources stay taken", "language/resources.py", "            lock.holder = None", "            pass"),
    ("held tasks get resources", "language/resources.py", "            if lease.task.holds:\n                continue\n", ""),
    ("an equal value is a change", "kernel/fluent.py", "if not same(self._value, value):", "if True:"),
    ("a world fluent is read when it is asked for", "kernel/fluent.py", "self._at[1] != scheduler.now:", "True:"),
    ("pulses that came together are seen as one", "kernel/signals.py", 'self._seen + 1 if self._missed == "always" else self._count()', "self._count()"),
    ("pulses from before the wait are seen", "kernel/signals.py", 'if self._missed == "never":', "if False:"),
    ("both is either", "kernel/signals.py", "get(self._operands[0]) and get(self._operands[1])", "get(self._operands[0]) or get(self._operands[1])"),
    ("the bound of a shield is none", "kernel/cancel.py", "scheduler.deadline(task, steps, self._overrun)", "scheduler.deadline(task, steps, lambda: None)"),
    ("a cleanup is not shielded", "language/branches.py", "with shield(within):", "if True:"),
    ("a drain ends with the first stuck task", "kernel/runner.py", "stuck = stuck or error", "raise"),
    ("two nodes have one number", "runs/trace.py", "self._nodes = number = node.number = self._nodes + 1", "number = node.number = self._nodes or 1"),
    ("the rest of a line is lost when the disk is full", "runs/trace.py", "data = data[self._put(data) :]", "data = data[self._put(data) :] and b''"),
    ("an overrun after an overrun cuts the cleanup short", "kernel/cancel.py", "if isinstance(task.error, CleanupOverrun):", "if False:"),
    ("a disk that is full does not end the run", "kernel/event_loop.py", "if scheduler.spoilt is not None:", "if False:"),
    ("the end of the body beats a violation", "language/conditions.py", "        if self.violated:\n            self.failed_body", "        if self.violated and body is None:\n            self.failed_body"),
    ("the first policy is cleaned up first", "language/conditions.py", "for policy in reversed(initialized):", "for policy in initialized:"),
    ("the cleanup of a policy is not shielded", "language/conditions.py", 'with shield():\n                await _part("clean_up"', 'if True:\n                await _part("clean_up"'),
    ("the recovery of a policy is not shielded", "language/conditions.py", 'with shield():\n            await _part("recover"', 'if True:\n            await _part("recover"'),
    ("a policy that is violated on entry lets the body start", "language/conditions.py", "if watch.look():", "if watch.look() and not watch.name:"),
    ("what could not be set up is cleaned up", "language/conditions.py", 'await _part("init", policy.init, policy)\n            initialized.append(policy)', 'initialized.append(policy)\n            await _part("init", policy.init, policy)'),
    ("the last policy that is violated recovers", "language/conditions.py", "first, *others = scope.violated", "*others, first = scope.violated"),
    ("a policy looks at its first inputs only", "language/conditions.py", "            self.follow(reads)", "            self.follow(self.inputs or reads)"),
    ("an inner budget is all that is charged", "language/budgets.py", "        enclosing = enclosing.outer", "        enclosing = None"),
    ("a budget allows one attempt more", "language/budgets.py", "self.left = attempts", "self.left = attempts and attempts + 1"),
    ("a budget that is used up strikes within the round", "language/budgets.py", "        enclosing.stir()", "        enclosing.expire()"),
    ("a budget does not say where time went", "language/budgets.py", "counts[part] = counts.get(part, 0) + number", "pass"),
    ("a state may be visited once more", "language/state_machine.py", "visits[state] > max_visits:", "visits[state] > max_visits + 1:"),
    ("a failure takes the last case that fits", "language/state_machine.py", "next((to for case, to in cases.items()", "next((to for case, to in reversed(cases.items())"),
    ("anything is an outcome", "language/state_machine.py", "if not isinstance(outcome, (str, Enum)):", "if False:"),
    ("a recovery tries once more", "language/recovery.py", "entry.used < recovery.attempts", "entry.used <= recovery.attempts"),
    ("a recovery that says that it ends in nothing ends as its strategy does", "language/recovery.py", "self.otherwise is _FROM_DO", "self.otherwise in (None, _FROM_DO)"),
    ("the last recovery that fits decides", "language/recovery.py", "((n for n, entry in enumerate(entries) if", "((n for n, entry in reversed([*enumerate(entries)]) if"),
    ("a suspended request goes on", "language/plans.py", "hooks.append(self._on_suspension)", "pass"),
    ("a goal that holds is worked for", "language/conditions.py", "    if holds():\n        record", "    if not holds:\n        record"),
    ("steps that were cut short are taken over", "runs/journal.py", "if not task.cancelled:", "if True:"),
    ("steps are taken over in any order", "runs/journal.py", "while self._due is not done:", "while False:"),
    ("what is taken over takes no time", "runs/journal.py", "await pause(done.step - scheduler.now, done.path)", "pass"),
    ("random numbers start anew in a resumed run", "runs/journal.py", "stream.go_to(done.draws)", "pass"),
    ("a resumed run has its whole budget", "runs/journal.py", "self._charge(kind, part, number)", "pass"),
    ("fluents are as at the beginning in a resumed run", "runs/journal.py", "            fluent.set(value)", "            pass"),
    ("what does not survive JSON is skipped", "runs/recorded_run.py", "                break\n            self.last", "                continue\n            self.last"),
    ("a tuple comes back as a list", "runs/codec.py", 'return {"$tuple": [dump(item, depth + 1) for item in value]}', "return [dump(item, depth + 1) for item in value]"),
    ("a repeated run may do something else", "runs/replay_check.py", "            self.differ({", "            self.take() or ({"),
    ("a plan may be repeated in another order", "runs/replay_check.py", "self._all = all_", "self._all = True"),
    ("what a request wakes comes before what was there", "runs/replay_check.py", "task in self._woken or ", ""),
    ("task_suspended wakes what it has not suspended", "language/plans.py", "if handle.bindings <= last:", "if True:"),
    ("task_suspended does not wake what it held before it began", "language/plans.py", "last = handle.bindings + (handle._task is None)", "last = handle.bindings"),
    ("a suspension that fails leaves the task held", "kernel/cancel.py", "        wake_up(scheduler, task)\n        raise error", "        raise error"),
    ("failures of cleanups deep below are lost", "kernel/scope.py", "elif self.cleanup:", "elif False:"),
    ("what a thread sets is set in the thread", "kernel/fluent.py", "if self._handed_over(self.set, value):", "if False:"),
    ("what a thread sets before the run has come to it is set in the thread", "kernel/fluent.py", "scheduler = self._home.scheduler", "return False"),
    ("a call in a thread takes no plan time", "kernel/threads.py", "if steps and scheduler.live is None:", "if False:"),
    ("an evaporated branch leaves its asyncio code behind", "kernel/threads.py", "                work.cancel()", "                pass"),
    ("draws of a stream are counted as one", "kernel/schedule.py", "self.moved += 2", "self.moved += 1"),
    ("a call without await is no error", "kernel/runner.py", "        raise first", "        pass"),
]  # fmt: skip


UNBROKEN = ("nothing", "__init__.py", "", "")


def caught(mutant: tuple[str, str, str, str]) -> tuple[bool, str]:
    """Return whether a mutant is caught, and what tells."""
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
        tests = list(dict.fromkeys([*TESTS, *" ".join(FIRST.values()).split()]))
        if mutant is not UNBROKEN:
            tests = list(dict.fromkeys([*FIRST.get(name, "").split(), *TESTS]))
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "-k", "not ctrl_c", *tests]
        bounded = ["sh", "-c", f'ulimit -t {CPU_TIME} && exec "$@"', "sh", *command]
        try:
            ended = subprocess.run(bounded, cwd=copy, env=environment, capture_output=True, text=True, timeout=IDLE)
        except subprocess.TimeoutExpired:
            return True, ENDLESS
        failed = [line for line in ended.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
        if ended.returncode == 1 and failed:
            return True, failed[0] if mutant is UNBROKEN else failed[0].split(" - ")[0].rpartition("::")[2]
        if ended.returncode == -signal.SIGKILL:
            return True, ENDLESS
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
