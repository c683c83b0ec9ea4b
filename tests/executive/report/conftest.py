"""A run of the bundled recipe with its page, which all tests of reports share."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import pytest

from executive.runs.options import RunResult
from executive.runs.plan_run import run_plan_file
from planlang.geometry import Pose
from sim import PyBulletWorld
from tests.executive.conftest import BUNDLED

WATCHED = 900
"""A step of the world at which an arm moves while it holds the bottle."""


@dataclass(frozen=True, slots=True)
class Reported:
    """The result of a run, its folder with first.html and run.jsonl, and where everything was at one step."""

    result: RunResult
    folder: Path
    poses: dict[tuple[str, str], Pose] = field(default_factory=dict)

    @property
    def page(self) -> Path:
        """The page that was written with the run."""
        return self.folder / "first.html"

    @property
    def trace(self) -> Path:
        """The trace, with which no test may change anything."""
        return self.folder / "run.jsonl"


@pytest.fixture(scope="session")
def reported(tmp_path_factory: pytest.TempPathFactory) -> Reported:
    """A run in a world that differs from its map, and in which a first grasp is in collision."""
    folder, poses = tmp_path_factory.mktemp("reported"), dict[tuple[str, str], Pose]()

    def eye(world: PyBulletWorld) -> None:
        if world.steps == WATCHED:
            poses.update({("link", link): world.link_pose(link) for link in world.robot.links})
            poses.update({("body", name): world.pose(name) for name in world.names()})

    files = {"report": folder / "first.html", "trace": folder / "run.jsonl"}
    return Reported(run_plan_file(replace(BUNDLED, seed=3, watchers=(eye,), **files)), folder, poses)
