"""Fixtures shared by all tests."""

from pathlib import Path

import pytest

CORPUS = Path(__file__).resolve().parents[2] / "shared" / "corpus"


@pytest.fixture(scope="session")
def corpus() -> Path:
    """The folder of real OWL files; the test is skipped where it is absent."""
    if not CORPUS.is_dir():
        pytest.skip("the corpus of real OWL files is not beside this checkout")
    return CORPUS
