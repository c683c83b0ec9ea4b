"""Loads a URDF in a worker process, to find out whether PyBullet survives it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from sim.engine import bullet
from sim.planning_world import PlanningWorld
from sim.scene import CameraModel, RobotBody, Scene


def prepared() -> Callable[[Callable[..., Any], Sequence[Any]], Any]:
    """Return the function by which workers make calls; importing this module has prepared their process."""
    return lambda function, arguments: function(*arguments)


def build() -> str:
    """Identify this build of PyBullet; its version is the same for all."""
    file = Path(bullet.__file__)
    return f"{file.name} {file.stat().st_size}"


def load(urdf: str, root: str) -> None:
    """Load a URDF with this root link as every world does, and measure its links. Raises BadInput."""
    PlanningWorld(Scene(()), RobotBody(Path(urdf), CameraModel(root))).close()
