"""Worker processes keep the limits that a shell or a batch system has set, and say when one ended them."""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import textwrap
from pathlib import Path
from typing import Any

import pytest

CHECKOUT = Path(__file__).resolve().parents[3]


def answers(tmp_path: Path, program: str, **limits: int) -> Any:
    """Run a program with a worker in a process with limits of its own; return what it prints as JSON."""
    head = """
    import json, resource, sys
    from executive.processes.workers import Ending, Limits, Reply
    from executive.processes.workers import Source, Worker
    given = json.dumps({"path": sys.path, "environment": {}})
    source = Source("executive.sweeps.supervised:prepared", "math:sqrt", sys.argv[1], given)
    """
    stated = [f"resource.setrlimit(resource.RLIMIT_{kind}, ({most}, {most}))" for kind, most in limits.items()]
    text = "\n".join(["import resource", *stated, textwrap.dedent(head), textwrap.dedent(program), "source.close()"])
    environment = {**os.environ, "PYTHONPATH": str(CHECKOUT)}
    done = subprocess.run([sys.executable, "-c", text, str(tmp_path)], env=environment, capture_output=True, text=True)
    assert done.stderr == ""
    return json.loads(done.stdout)


def test_a_worker_keeps_the_limits_of_memory_and_time_of_the_shell(tmp_path: Path) -> None:
    program = """
    worker = Worker(source, Limits(seconds=120, memory=4_000_000_000))
    kinds = (resource.RLIMIT_AS, resource.RLIMIT_CPU)
    print(json.dumps([worker.call(resource.getrlimit, one).answer for one in kinds]))
    worker.close()
    """
    memory, time = answers(tmp_path, program, AS=900_000_000, CPU=100)
    assert memory == [900_000_000] * 2
    assert time == [100, 100]


def test_smaller_limits_of_the_call_hold_beside_those_of_the_shell(tmp_path: Path) -> None:
    program = """
    worker = Worker(source, Limits(seconds=5, memory=100_000_000))
    kinds = (resource.RLIMIT_AS, resource.RLIMIT_CPU)
    print(json.dumps([worker.call(resource.getrlimit, one).answer for one in kinds]))
    worker.close()
    """
    (memory, _), (soft, hard) = answers(tmp_path, program, AS=900_000_000, CPU=100)
    assert memory < 900_000_000
    assert (soft, hard) == (6, 100)


def test_a_worker_is_replaced_before_its_calls_add_up_to_the_limit_of_the_shell(tmp_path: Path) -> None:
    program = """
    import os
    worker = Worker(source, Limits(seconds=50))
    print(json.dumps([worker.call(os.getpid).answer for _ in range(2)]))
    worker.close()
    """
    first, second = answers(tmp_path, program, CPU=50)
    assert first != second, "after the first call less than the time of a call is left"
    first, second = answers(tmp_path, program, CPU=100)
    assert first == second


def test_what_the_shell_ended_is_said_in_a_sentence_with_the_option_of_ulimit(tmp_path: Path) -> None:
    program = """
    limits = Limits(seconds=120, memory=2_000_000_000, wall=600.0)
    endings = (Reply(Ending.LATE), Reply(Ending.MEMORY, 400_000_000), Reply(Ending.LOST))
    print(json.dumps([one.beyond(limits) for one in endings]))
    """
    late, memory, lost = answers(tmp_path, program, AS=900_000_000, CPU=100)
    whole = "100 s of CPU time (ulimit -t), 900 MB of memory (ulimit -v)"
    assert late == f"it took more than 99 s of CPU time, or 600 s in all; the shell's limit: {whole}"
    assert memory == f"it needed more than 400 MB of memory; the shell's limit: {whole}"
    assert lost == f"several processes in a row died without a result; the shell's limits: {whole}"


def test_a_sweep_goes_on_under_the_limits_of_a_batch_system(tmp_path: Path) -> None:
    def limited() -> None:
        resource.setrlimit(resource.RLIMIT_CPU, (100, 100))
        resource.setrlimit(resource.RLIMIT_AS, (3_000_000_000, 3_000_000_000))
        resource.setrlimit(resource.RLIMIT_NOFILE, (32, 32))

    command = [
        sys.executable,
        "-m",
        "executive",
        "sweep",
        "serve_a_drink",
        "--worlds",
        "1",
        "--processes",
        "1",
        "--json",
    ]
    environment = {**os.environ, "PYTHONPATH": str(CHECKOUT)}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, preexec_fn=limited)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("files", [6, 10])
def test_too_few_files_are_lacking_resources_and_no_internal_error(files: int, tmp_path: Path) -> None:
    def limited() -> None:
        resource.setrlimit(resource.RLIMIT_NOFILE, (files, files))

    command = [sys.executable, "-m", "executive", "sweep", "serve_a_drink", "--worlds", "4", "--processes", "4"]
    environment = {**os.environ, "PYTHONPATH": str(CHECKOUT)}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, preexec_fn=limited)
    assert done.returncode == 71, done.stderr
    assert "ulimit -n" in done.stderr
