"""Robots of the benchmark: those that are bundled, and one that is made from its URDF, as a user would make it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from tests.benchmarks.homes.series import TOP

ROBOTS = ("amigo", "pr2", "panda", "tiago_pro")
MADE = TOP / ".venv" / "homes"
"""Folder of the robots that are made."""
URDFS = {"tiago_pro": "robots/tiago_pro_description/robots/tiago_pro.urdf"}
"""Robot -> its URDF in the package example-robot-data."""
BLIND = ("panda",)
"""Robots without a camera."""
OPTIONS = dict.fromkeys(BLIND, ("--trust-map",))
"""Options of a robot's runs."""


def named(robot: str) -> str:
    """Return what ``--robot`` gets for a robot of the benchmark; one of a URDF is made if it is not there yet."""
    if robot not in URDFS:
        return robot
    file = MADE / f"{robot}.toml"
    if not file.exists():
        MADE.mkdir(parents=True, exist_ok=True)
        made = file.with_suffix(".part.toml")
        planlang = (sys.executable, "-m", "planlang_command", "robot", "make", str(urdf_of(robot)))
        subprocess.run([*planlang, "--output", str(made), "--force"], check=True, capture_output=True)
        made.replace(file)
    return str(file)


def urdf_of(robot: str) -> Path:
    """Return the URDF of a robot that is made."""
    for root in map(Path, sys.path):
        file = root / "cmeel.prefix" / "share" / "example-robot-data" / URDFS[robot]
        if file.exists():
            return file
    raise FileNotFoundError(f"{URDFS[robot]}: install example-robot-data (pip install -e '.[pr2]')")
