"""Fixtures shared by all tests."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

# no test is timed; continuous integration tries the same examples each time, everybody else new ones
settings.register_profile("planlang", deadline=None, derandomize="CI" in os.environ, print_blob=True)
settings.load_profile("planlang")

CORPUS = Path(__file__).resolve().parents[2] / "shared" / "corpus"


@pytest.fixture(scope="session")
def corpus() -> Path:
    """The folder of real OWL files; the test is skipped where it is absent."""
    if not CORPUS.is_dir():
        pytest.skip("the corpus of real OWL files is not beside this checkout")
    return CORPUS


@pytest.fixture(scope="session", autouse=True)
def own_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Tests, and the processes that they start, keep their cache to themselves."""
    before = os.environ.get("XDG_CACHE_HOME")
    os.environ["XDG_CACHE_HOME"] = str(tmp_path_factory.mktemp("cache"))
    yield
    if before is None:
        del os.environ["XDG_CACHE_HOME"]
    else:
        os.environ["XDG_CACHE_HOME"] = before
