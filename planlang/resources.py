"""Where the bundled ontologies and recipes are: beside the packages in a checkout, inside planlang in a wheel."""

from __future__ import annotations

from pathlib import Path


def bundled(folder: str) -> Path:
    """The folder "ontologies" or "recipes" that came with this installation."""
    here = Path(__file__).resolve().parent
    installed = here / "data" / folder
    return installed if installed.is_dir() else here.parent / folder
