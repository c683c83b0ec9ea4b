"""Files that make fuzz once found end in diagnostics now."""

import importlib.util
from collections.abc import Callable
from pathlib import Path

import pytest

HERE = Path(__file__).parent
MENDED = sorted((HERE / "mended").glob("*.owl"))


@pytest.fixture(scope="module")
def problem_of() -> Callable[[str, Path], str | None]:
    """Return what the worker says of a file besides diagnostics, here without its bounds."""
    spec = importlib.util.spec_from_file_location("fuzz_worker", HERE / "worker.py")
    assert spec is not None
    assert spec.loader is not None
    worker = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(worker)
    found: Callable[[str, Path], str | None] = worker.problem_of
    return found


@pytest.mark.parametrize("path", MENDED, ids=lambda path: path.stem)
def test_what_was_found_once_ends_in_diagnostics(
    path: Path, problem_of: Callable[[str, Path], str | None], monkeypatch: pytest.MonkeyPatch
) -> None:
    kind = path.name.partition("_")[0]
    assert problem_of(kind, path) is None
