"""Rows of robots that were tried, kept beside their robot files, so that a table can be made in several runs."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from planlang.package_paths import MODELS, PACKAGES

ROOT = Path(__file__).resolve().parents[3]
HERE = "tests/benchmarks/robots_tried"
SOURCES = (
    *("planlang", "executive", "sim", "ontologies", "recipes", "tests/support/scenarios"),
    *(f"{HERE}/trial.py", f"{HERE}/truth.py"),
)
"""Files, and folders of files, that results depend on besides the robots and the facts about them."""


class Kept:
    """Results of stages, a file beside each robot file, forgotten if code, limits, facts, URDF or packages differ.

    ``limits`` is what else results depend on; None keeps nothing.
    """

    def __init__(self, limits: str | None) -> None:
        self._code = None if limits is None else hashlib.sha256(limits.encode() + _code())

    def found(self, world: Mapping[str, Any], stage: str) -> dict[str, Any] | None:
        """Return what a stage gave for a robot, or None."""
        return self._stages(world).get(stage)

    def keep(self, world: Mapping[str, Any], stage: str, found: Mapping[str, Any]) -> None:
        """Keep what a stage gave for a robot."""
        if self._code is not None:
            kept = {"key": self._key(world), "stages": self._stages(world) | {stage: found}}
            self._file(world).write_text(json.dumps(kept, indent=1), encoding="utf-8")

    def _stages(self, world: Mapping[str, Any]) -> dict[str, Any]:
        with suppress(FileNotFoundError):
            kept = json.loads(self._file(world).read_text(encoding="utf-8"))
            if self._code is not None and kept["key"] == self._key(world):
                return dict(kept["stages"])
        return {}

    def _file(self, world: Mapping[str, Any]) -> Path:
        return Path(world["file"]).with_suffix(".json")

    def _key(self, world: Mapping[str, Any]) -> str:
        assert self._code is not None
        digest = self._code.copy()
        places = [os.environ.get(name) for name in (*PACKAGES, *MODELS)]
        digest.update(json.dumps([places, world], sort_keys=True).encode() + Path(world["urdf"]).read_bytes())
        return digest.hexdigest()


def _code() -> bytes:
    """Digest the sources."""
    digest = hashlib.sha256()
    paths = [path for part in SOURCES for path in (ROOT / part, *(ROOT / part).rglob("*"))]
    for path in sorted(paths):
        if path.is_file() and path.suffix != ".pyc":
            digest.update(f"{path.relative_to(ROOT)}\n".encode() + hashlib.sha256(path.read_bytes()).digest())
    return digest.digest()
