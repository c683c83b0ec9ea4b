"""Facts about compiled code: where it is kept, when it is made anew, and what happens without a compiler."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from executive.motion import Chain, InverseKinematics
from executive.motion.compiled import CompiledChain
from executive.motion.native import compiler, library

ADD = "int add(int a, int b) { return a + b; }"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache."""
    if compiler() is None:
        pytest.skip("there is no C compiler")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "planlang" / "native"


def kept(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def never() -> str:
    raise AssertionError("what is kept is not generated again")


def test_a_library_is_compiled_once_and_then_loaded(folder: Path) -> None:
    made = library("add", lambda: ADD)
    assert made is not None
    assert made.add(2, 3) == 5
    again = library("add", never)
    assert again is not None
    assert again.add(4, 5) == 9
    assert len(kept(folder)) == 1


def test_other_facts_another_compiler_and_other_flags_are_other_libraries(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    library("add", lambda: ADD)
    library("add more", lambda: ADD)
    found = compiler()
    assert found is not None
    monkeypatch.setenv("CC", f"{found.command[0]} -g")
    library("add", lambda: ADD)
    assert len(kept(folder)) == 3


def test_a_torn_library_is_made_anew(folder: Path) -> None:
    library("add", lambda: ADD)
    entry = folder / kept(folder)[0]
    entry.unlink()
    entry.write_bytes(b"\x7fELF")
    made = library("add", lambda: ADD)
    assert made is not None
    assert made.add(1, 1) == 2


def test_without_a_folder_to_write_to_it_is_compiled_each_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    for _ in range(2):
        made = library("add", lambda: ADD)
        assert made is not None
        assert made.add(2, 2) == 4


@pytest.mark.parametrize("command", ["no-such-compiler", "", "false"])
def test_no_compiler_or_one_that_fails_means_no_library(command: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", command)
    assert library("add", lambda: ADD) is None


def test_processes_that_compile_the_same_at_once_do_no_harm(folder: Path, tmp_path: Path) -> None:
    program = (
        "from executive.motion.native import library\n"
        f"made = library('add', lambda: {ADD!r})\n"
        "raise SystemExit(0 if made is not None and made.add(2, 3) == 5 else 1)\n"
    )
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path)}
    running = [subprocess.Popen([sys.executable, "-c", program], env=environment) for _ in range(3)]
    assert [process.wait() for process in running] == [0, 0, 0]
    assert len(kept(folder)) == 1


def test_names_of_the_c_library_are_no_trap() -> None:
    made = library("step", lambda: "int step(int a) { return a + 1; } int twice(int a) { return step(step(a)); }")
    assert made is not None
    assert made.twice(3) == 5


def test_compiled_and_interpreted_kinematics_agree(
    urdf_of: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    urdf = urdf_of("amigo")
    compiled = Chain.from_urdf(urdf, "base_link", "grippoint_left")
    assert isinstance(compiled.backend, CompiledChain)
    monkeypatch.setenv("CC", "no-such-compiler")
    interpreted = Chain.from_urdf(urdf, "base_link", "grippoint_left")
    assert not isinstance(interpreted.backend, CompiledChain)
    rng = np.random.default_rng(0)
    q = compiled.sample(rng, 50)
    np.testing.assert_allclose(compiled.fk(q), interpreted.fk(q), atol=1e-12)
    np.testing.assert_allclose(compiled.jacobian(q), interpreted.jacobian(q), atol=1e-12)
    near = q[:, None] + rng.normal(0, 0.02, (50, 1, compiled.dof))
    found = [InverseKinematics(chain).solve(compiled.fk(q), near)[0] for chain in (compiled, interpreted)]
    np.testing.assert_allclose(*found, atol=2e-3)


def test_processes_that_need_the_same_chain_at_once_agree(
    folder: Path, tmp_path: Path, urdf_of: Callable[[str], Path]
) -> None:
    program = (
        "from executive.motion import Chain\n"
        f"chain = Chain.from_urdf({str(urdf_of('amigo'))!r}, 'base_link', 'grippoint_left')\n"
        "print(type(chain.backend).__name__, chain.fk([0.1] * chain.dof).tobytes().hex())\n"
    )
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path)}
    command = [sys.executable, "-c", program]
    running = [subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    said = {process.communicate()[0] for process in running}
    assert len(said) == 1
    assert said.pop().startswith("CompiledChain ")
    assert not any(name.startswith(".") for name in kept(folder)), "no temporary file is left"


@pytest.mark.parametrize("content", [b"", b"\x7fELF", b"not a library at all" * 100])
def test_a_damaged_library_of_a_chain_is_made_anew(
    content: bytes, folder: Path, urdf_of: Callable[[str], Path]
) -> None:
    first = Chain.from_urdf(urdf_of("amigo"), "base_link", "neck_pan")
    pose = first.fk([0.1] * first.dof)
    (entry,) = folder.iterdir()
    entry.unlink()  # one that is in use is never written to
    entry.write_bytes(content)
    again = Chain.from_urdf(urdf_of("amigo"), "base_link", "neck_pan")
    np.testing.assert_array_equal(again.fk([0.1] * again.dof), pose)
    assert isinstance(again.backend, CompiledChain)
