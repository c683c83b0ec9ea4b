"""Temporary folders: a live one stays, one of a killed process is removed by the next process."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from planlang import temporary
from planlang.temporary import temporary_folder

_KILLED = """
import sys
from pathlib import Path
from planlang.temporary import process_folder, temporary_folder
with temporary_folder() as folder, temporary_folder(Path(sys.argv[1])) as beside:
    (folder / "large").write_text("left")
    (beside / "half.png").write_text("left")
    (process_folder() / "robot.urdf").write_text("left")
    print("made", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder for temporary files, in which this process has not looked yet."""
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setattr(temporary, "_cleared", set[str]())
    return tmp_path


def test_a_folder_is_gone_after_its_use_with_all_that_is_in_it(folder: Path) -> None:
    with temporary_folder() as made, temporary_folder(folder) as beside:
        (made / "file").write_text("x")
        assert (made.parent, beside.parent, beside.name[0]) == (folder, folder, ".")
    assert list(folder.iterdir()) == []


def test_folders_of_a_killed_process_are_removed_by_the_next_and_those_of_a_live_one_are_not(folder: Path) -> None:
    outputs = folder / "outputs"
    outputs.mkdir()
    environment = {**os.environ, "TMPDIR": str(folder)}
    with subprocess.Popen(
        [sys.executable, "-c", _KILLED, str(outputs)], stdin=-1, stdout=-1, env=environment, cwd=Path.cwd()
    ) as process:
        assert process.stdout is not None
        process.stdout.readline()
        left = [*folder.glob("planlang.*"), *outputs.glob(".planlang.*")]
        assert len(left) == 3
        with temporary_folder(), temporary_folder(outputs):
            assert all(path.is_dir() for path in left)
        process.send_signal(signal.SIGKILL)
    temporary._cleared.clear()
    with temporary_folder(), temporary_folder(outputs):
        assert not [path for path in left if path.exists()]


def test_what_only_has_the_name_of_such_a_folder_stays(folder: Path) -> None:
    (folder / "mine").mkdir()
    (folder / "planlang.link").symlink_to("mine")
    (folder / "planlang.txt").write_text("mine")
    with temporary_folder():
        pass
    assert sorted(path.name for path in folder.iterdir()) == ["mine", "planlang.link", "planlang.txt"]


def test_without_locks_a_folder_is_made_all_the_same(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise OSError

    monkeypatch.setattr("fcntl.flock", refuse)
    with temporary_folder() as made:
        assert made.is_dir()
    assert list(folder.iterdir()) == []


def test_nothing_else_of_planlang_makes_temporary_folders() -> None:
    checkout = Path(__file__).resolve().parents[2]
    files = [path for name in ("planlang", "executive", "sim") for path in (checkout / name).rglob("*.py")]
    makers = [
        path.name for path in files if any(f"{word}(" in path.read_text() for word in ("mkdtemp", "TemporaryDirectory"))
    ]
    assert makers == ["temporary.py"]
