"""Commands where the machine has little memory, or no folder that takes files."""

from __future__ import annotations

import os
import subprocess
import sys
import tracemalloc
from pathlib import Path

import pytest
from click.testing import CliRunner

from executive.cli.app import app
from planlang.files import read_at_most

CHECKOUT = Path(__file__).resolve().parents[2]


def limited(limit: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run the bundled recipe in a process with a limit of the shell's ``ulimit``."""
    command = f"ulimit {limit} && exec {sys.executable} -m planlang_command run serve_a_drink"
    environment = {key: value for key, value in os.environ.items() if key != "OPENBLAS_NUM_THREADS"}
    environment |= {"PYTHONPATH": str(CHECKOUT), "PYTHONDONTWRITEBYTECODE": "1"}
    return subprocess.run(
        command, shell=True, cwd=folder, env=environment, capture_output=True, text=True, timeout=120, check=False
    )


@pytest.mark.long
def test_350_mb_of_address_space_are_enough_to_serve_a_drink(tmp_path: Path) -> None:
    done = limited("-v 350000", tmp_path)
    assert (done.returncode, "bottle1: held by patient1" in done.stdout) == (0, True), done.stderr


def test_too_little_address_space_is_told_with_the_limit_and_an_exit_code_of_its_own(tmp_path: Path) -> None:
    refused = limited("-v 250000", tmp_path)
    assert refused.returncode == 71, refused.stderr
    assert "error C020 not enough memory: a run needs 320 MB" in refused.stderr
    assert "limited to 256 MB (ulimit -v)" in refused.stderr
    assert "bug" not in refused.stderr


def test_where_no_folder_takes_temporary_files_the_message_names_tmpdir(tmp_path: Path) -> None:
    refused = limited("-f 0", tmp_path)
    assert refused.returncode == 71, refused.stderr
    assert "error C021" in refused.stderr
    assert "set TMPDIR" in refused.stderr
    assert "bug" not in refused.stderr


@pytest.mark.parametrize(
    "problem", [MemoryError(), MemoryError("Unable to allocate 1.55 MiB"), RuntimeError("can't start new thread")]
)
def test_want_of_memory_or_threads_is_no_bug(problem: Exception, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object) -> None:
        raise problem

    monkeypatch.setattr("executive.cli.check.command", fails)
    refused = CliRunner().invoke(app, ["check", "serve_a_drink"])
    assert (refused.exit_code, "error C020" in refused.stderr) == (71, True), refused.stderr


def test_reading_a_small_file_takes_no_memory_for_the_largest_allowed(tmp_path: Path) -> None:
    path = tmp_path / "entry"
    path.write_bytes(b"kept")
    tracemalloc.start()
    try:
        with path.open("rb") as file:
            assert read_at_most(file, 64_000_000) == b"kept"
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 2_000_000
    with path.open("rb") as file:
        assert read_at_most(file, 3) == b"kep"
